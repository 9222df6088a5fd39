//! Declarative scenes: from Rust, from files, and their equality.

mod groups_and_welds;
mod kinds;
mod look_up;
mod mistakes;
mod quadruped;
mod reset;
mod round_trip;
mod schema;
mod terrain;
