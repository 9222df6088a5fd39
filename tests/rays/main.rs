//! Ray casters in a simulation, held against MuJoCo's own rays and against closed forms.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod cameras;
mod judge;
mod primitives;
mod scanner;
