//! States of robots, gathered once for each state of the simulation and shared by all terms.

use kinetoscope_sim::{RobotId, RobotState, SimulationManager};
use std::sync::{Mutex, OnceLock, PoisonError};

/// States of the robots that terms have read. A list whose entries keep their address while it grows.
#[derive(Debug, Default)]
pub(crate) struct RobotCache(OnceLock<Box<Entry>>);

#[derive(Debug)]
struct Entry {
    robot: RobotId,
    /// Present state, once a term has read it.
    present: OnceLock<RobotState>,
    /// Memory of an earlier state, for the next one.
    earlier: Mutex<Option<RobotState>>,
    others: RobotCache,
}

impl Entry {
    fn new(robot: RobotId) -> Self {
        Self { robot, present: OnceLock::new(), earlier: Mutex::new(None), others: RobotCache::default() }
    }
}

impl RobotCache {
    /// The state of a robot, which is gathered at the first call after [`clear`](Self::clear).
    ///
    /// # Panics
    /// The robot belongs to another manager.
    pub(crate) fn get(&self, sim: &SimulationManager, robot: RobotId) -> &RobotState {
        let entry = self.0.get_or_init(|| Box::new(Entry::new(robot)));
        if entry.robot != robot {
            return entry.others.get(sim, robot);
        }
        entry.present.get_or_init(|| {
            let earlier = entry.earlier.lock().unwrap_or_else(PoisonError::into_inner).take();
            let mut state = earlier.unwrap_or_default();
            sim.robot(robot).gather_state(&mut state);
            state
        })
    }

    /// Ends the present states, because the simulation may change. Their memory is used again.
    pub(crate) fn clear(&mut self) {
        let Some(entry) = self.0.get_mut() else { return };
        if let Some(state) = entry.present.take() {
            *entry.earlier.get_mut().unwrap_or_else(PoisonError::into_inner) = Some(state);
        }
        entry.others.clear();
    }
}
