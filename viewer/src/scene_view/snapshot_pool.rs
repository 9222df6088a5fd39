//! Reusable snapshot buffers.

use super::snapshot::{Names, RunState, Snapshot};
use crate::control::SnapshotRequest;
use kinetoscope_sim::SimulationManager;
use std::sync::Arc;

/// A limited number of snapshots. Snapshots that no viewer holds are filled again.
#[derive(Debug, Default)]
pub(crate) struct SnapshotPool {
    snapshots: Vec<Arc<Snapshot>>,
    last_number: u64,
    names: Option<Arc<Names>>,
}

impl SnapshotPool {
    /// Fills a snapshot of the current state and returns it, or `None` if all `size` snapshots are held by viewers.
    pub(crate) fn capture(
        &mut self,
        sim: &mut SimulationManager,
        size: usize,
        wants: &SnapshotRequest,
        run: RunState,
    ) -> Option<Arc<Snapshot>> {
        if self.names.as_ref().is_none_or(|names| !names.apply_to(sim)) {
            self.names = Some(Arc::new(Names::of(sim)));
        }
        let names = Arc::clone(self.names.as_ref()?);
        if self.snapshots.len() > size {
            // Fewer viewers need fewer snapshots.
            self.snapshots.retain(|snapshot| Arc::strong_count(snapshot) > 1);
        }
        let free = self.snapshots.iter().position(|snapshot| Arc::strong_count(snapshot) == 1);
        let place = free.unwrap_or(self.snapshots.len());
        if place == self.snapshots.len() {
            if place >= size {
                return None;
            }
            self.snapshots.push(Arc::default());
        }
        let snapshot = Arc::get_mut(&mut self.snapshots[place])?;
        self.last_number += 1;
        snapshot.number = self.last_number;
        snapshot.capture(sim, &names, wants, run);
        Some(Arc::clone(&self.snapshots[place]))
    }

    /// Invalidates the names after entities were added to the simulation.
    pub(crate) fn invalidate_names(&mut self) {
        self.names = None;
    }
}
