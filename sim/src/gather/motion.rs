//! Poses and velocities of links and objects.

use crate::capture::{body_velocity, link_pose};
use kinetoscope_mujoco::Data;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;
use ndarray::Array3;

/// Fills the poses of an environment.
pub(super) fn poses(bodies: &[(usize, Pose)], data: &Data, env: usize, array: &mut Option<Array3<f64>>) {
    let Some(array) = array else { return };
    for (b, link) in bodies.iter().enumerate() {
        for (k, value) in to_row(&link_pose(data, link)).into_iter().enumerate() {
            array[(env, b, k)] = value;
        }
    }
}

/// Fills the velocities of an environment.
pub(super) fn velocities(bodies: &[(usize, Pose)], data: &Data, env: usize, array: &mut Option<Array3<f64>>) {
    let Some(array) = array else { return };
    for (b, link) in bodies.iter().enumerate() {
        let [velocity, turning] = body_velocity(data, link.0, &link_pose(data, link).translation.vector);
        for (k, value) in velocity.iter().chain(&turning).enumerate() {
            array[(env, b, k)] = *value;
        }
    }
}
