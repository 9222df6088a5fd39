//! The browser view without a browser: who is let in, what viewers get and may do, and what those with bad manners cannot.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod door;
mod hostile;
mod pictures;
mod recordings;
mod running;
mod selecting;
mod several;
mod steering;
mod visitor;
