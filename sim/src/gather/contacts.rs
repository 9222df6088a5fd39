//! Contacts with their forces.

use crate::row::EnvRow;
use kinetoscope_scene::SceneState;

/// Appends the contacts of environment `i` to those of the environments before it.
pub(super) fn fill(row: &EnvRow, i: usize, state: &mut SceneState) {
    if let Some(contacts) = &mut state.contacts {
        // Environment 0 removes all contacts of the previous call.
        contacts.list.truncate(contacts.first[i]);
        contacts.list.extend_from_slice(&row.captured().contacts);
        contacts.first[i + 1] = contacts.list.len();
    }
}
