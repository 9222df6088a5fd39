//! Accelerations of links and objects, with the poses and velocities of the same time.

use super::rows::{ChunkRows, fill_captured};
use super::{poses, velocities};
use crate::env::SimEnv;
use crate::simulation::Simulation;

/// Fills `force_poses`, `force_velocities` and `body_accelerations` of environment `i` of the chunk. If nothing was
/// solved for this state, poses and velocities are the current ones, and accelerations are 0.
pub(super) fn fill(simulation: &Simulation, env: &SimEnv, i: usize, state: &mut ChunkRows<'_>) {
    let solved = env.captured();
    if solved.poses.is_empty() {
        // Nothing was solved for this state, but its poses and velocities exist.
        poses::rows(simulation, env, i, &mut state.force_poses);
        velocities::rows(simulation, env, i, &mut state.force_velocities);
    } else {
        fill_captured(&solved.poses, i, &mut state.force_poses);
        fill_captured(&solved.velocities, i, &mut state.force_velocities);
    }
    fill_captured(&solved.accelerations, i, &mut state.body_accelerations);
}
