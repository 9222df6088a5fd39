//! Images and ray casts of a simulation, compared with MuJoCo's rays and renderer.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod camera;
mod rays;
