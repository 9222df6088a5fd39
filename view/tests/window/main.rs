//! The window on a real X server without a screen.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod display;
mod huge;
mod on_x;
mod pictures;
