//! One number per movable joint.

use crate::compile::{JointIndexing, RobotIndex};
use ndarray::Array2;

/// Fills the row of an environment.
pub(super) fn fill(
    array: &mut Option<Array2<f64>>,
    env: usize,
    robots: &[RobotIndex],
    value: impl Fn(&JointIndexing) -> f64,
) {
    if let Some(array) = array {
        for (j, joint) in robots.iter().flat_map(|r| &r.joints).enumerate() {
            array[(env, j)] = value(joint);
        }
    }
}
