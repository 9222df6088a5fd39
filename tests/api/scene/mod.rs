//! Scenes that are declared: from Rust, from files, and the same from both.

mod kinds;
mod look_up;
mod mistakes;
mod parts;
mod quadruped;
mod reset;
mod round_trip;
mod terrain;
