//! Forces and torques in joints.

use super::rows::{ChunkRows, fill_captured};
use crate::env::SimEnv;
use crate::simulation::Simulation;

/// Fills the rows of environment `i` of the chunk.
pub(super) fn fill(_simulation: &Simulation, env: &SimEnv, i: usize, state: &mut ChunkRows<'_>) {
    fill_captured(&env.captured().wrenches, i, &mut state.joint_wrenches);
}
