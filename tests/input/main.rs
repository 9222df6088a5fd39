//! User input, valid and invalid: it works, or it is refused with a helpful message. A refused call changes nothing,
//! and no input ends the process.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "output of tests")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod accepted;
mod assets;
mod configuration;
mod every_writer;
mod export;
mod inspect_robot;
mod located;
mod names;
mod refused;
mod self_collision;
mod support;
mod urdf;
mod writers;
