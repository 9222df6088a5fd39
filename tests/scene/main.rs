//! Scenes that are declared: from Rust, from files, and the same from both.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod file_errors;
mod kinds;
mod look_up;
mod parts;
mod quadruped;
mod round_trip;
mod terrain;
mod yaml;
