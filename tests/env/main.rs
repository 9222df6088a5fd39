//! Tasks: against loops over the plain API, closed forms, and themselves in other batches.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod batches;
mod cart_pole;
mod checks;
mod closed_forms;
mod episodes;
mod mistakes;
mod noise;
mod quarantine;
mod resets;
mod sensors;
mod tasks;
mod terms;
mod vector_env;
