//! Names and limits of what a simulation adds to its document.

/// How many robots can have a bit of their own.
pub(crate) const MAX_ROBOTS: usize = 30;

/// Name of a lamp of the simulation.
pub(crate) fn light_name(index: usize) -> String {
    format!("light{index}")
}
