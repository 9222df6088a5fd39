//! Memory of steps and solves: after the first, none is allocated.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod kinematics;
mod update;
