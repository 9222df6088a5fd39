//! What was captured inside the step: see [`crate::capture`].

use crate::capture::Solved;
use kinetoscope_scene::state::Contacts;
use ndarray::{Array3, Axis};

/// Appends the contacts of environment `env`; those of the environments before it are there.
pub(super) fn contacts(solved: &Solved, env: usize, contacts: &mut Option<Contacts>) {
    if let Some(contacts) = contacts {
        contacts.list.extend_from_slice(&solved.contacts);
        contacts.first[env + 1] = contacts.list.len();
    }
}

/// Copies the rows of environment `env`; zeros where nothing was captured, because a step failed.
pub(super) fn rows(values: &[f64], env: usize, array: &mut Option<Array3<f64>>) {
    if let Some(array) = array
        && let Some(row) = array.index_axis_mut(Axis(0), env).as_slice_mut()
    {
        if row.len() == values.len() { row.copy_from_slice(values) } else { row.fill(0.0) }
    }
}
