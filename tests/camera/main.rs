//! Cameras in a simulation, held against MuJoCo's own rays and against where things are.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod models;
mod objects;
mod placement;
mod rays;
mod schedule;
