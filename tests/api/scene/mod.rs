//! Declarative scenes: from Rust, from files, and their equality.

mod kinds;
mod look_up;
mod mistakes;
mod parts;
mod quadruped;
mod reset;
mod round_trip;
mod terrain;
