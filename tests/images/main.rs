//! Images and ray casts of a simulation, against MuJoCo's own rays and renderer.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod camera;
mod rays;
