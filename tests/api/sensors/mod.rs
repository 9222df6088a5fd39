//! Sensors in a running simulation: schedule, values, resets, and sensors of other crates.

mod contact;
pub(crate) mod custom;
mod debug_vis;
mod frames;
mod imu;
mod refused;
mod same_bits;
mod schedule;
mod worlds;
mod wrench;
