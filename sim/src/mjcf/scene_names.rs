//! Names and limits of elements that a simulation adds to its document.

/// Maximum number of robots and articulations: each has a contact bit of its own.
pub(crate) const MAX_ROBOTS: usize = 30;

/// Name of a light of the simulation.
pub(crate) fn light_name(index: usize) -> String {
    format!("light{index}")
}
