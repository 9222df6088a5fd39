//! Poses and velocities of links and objects.

use crate::body_pose::BodyFrame;
use crate::capture::body_velocity;
use kinetoscope_mujoco::Data;
use kinetoscope_scene::pose::to_row;
use ndarray::Array3;

/// Fills the poses of an environment.
pub(super) fn poses(bodies: &[BodyFrame], data: &Data, env: usize, array: &mut Option<Array3<f64>>) {
    let Some(array) = array else { return };
    for (b, link) in bodies.iter().enumerate() {
        for (k, value) in to_row(&link.pose(data)).into_iter().enumerate() {
            array[(env, b, k)] = value;
        }
    }
}

/// Fills the velocities of an environment.
pub(super) fn velocities(bodies: &[BodyFrame], data: &Data, env: usize, array: &mut Option<Array3<f64>>) {
    let Some(array) = array else { return };
    for (b, link) in bodies.iter().enumerate() {
        let [velocity, turning] = body_velocity(data, link.body, &link.pose(data).translation.vector);
        for (k, value) in velocity.iter().chain(&turning).enumerate() {
            array[(env, b, k)] = *value;
        }
    }
}
