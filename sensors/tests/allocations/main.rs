//! Memory of cameras and sensors: after the first frames, none is allocated.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod camera;
mod rendering;
mod sampler;
mod sensor;
