//! States of robots: root link, joints, the bundled quadruped.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod quadruped;
mod root;
mod standing;
mod state;
mod wrenches;
