//! Input of users, good and bad: it works, or it is refused with a message that helps; nothing is half done, and nothing
//! ends the process.
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
