//! Images and ray casts of a simulation, compared with MuJoCo's rays and renderer.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "output of tests")]
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod camera;
mod rays;
