//! Sensors in a running simulation: schedule, values, resets, and sensors of other crates.

mod contact;
pub(crate) mod custom;
mod debug_vis;
mod determinism;
mod frames;
mod imu;
mod refused;
mod schedule;
mod worlds;
mod wrench;
