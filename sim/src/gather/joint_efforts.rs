//! Efforts of joints.

use super::rows::{ChunkRows, fill_joints};
use crate::env::SimEnv;
use crate::indexing::JointIndexing;
use crate::simulation::Simulation;

/// Fills the row of environment `i` of the chunk.
pub(super) fn fill(simulation: &Simulation, env: &SimEnv, i: usize, state: &mut ChunkRows<'_>) {
    // A joint without a drive of this crate may have actuators of an MJCF file.
    let effort = |joint: &JointIndexing| match joint.drive {
        Some(drive) => env.drives.effort[drive],
        None => env.data().qfrc_actuator()[joint.dof],
    };
    fill_joints(&mut state.joint_efforts, i, simulation, effort);
}
