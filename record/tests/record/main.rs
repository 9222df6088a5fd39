//! Recordings: what is in the files, held against the simulation and read by readers that nobody here wrote.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod button;
mod contents;
mod episodes;
mod hdf5;
mod kill;
mod lerobot;
mod outcomes;
mod pictures;
mod readers;
mod refused;
mod scenes;
mod stage;
mod support;
