//! Poses and vectors in the rows of a state.

use nalgebra::Vector3;
use ndarray::Array3;
use scene::Pose;
use scene::pose::from_row;

/// The pose of a body.
pub(crate) fn pose(poses: &Array3<f64>, env: usize, body: usize) -> Pose {
    from_row(&std::array::from_fn(|k| poses[(env, body, k)]))
}

/// Three numbers of a body, from `first` on.
pub(crate) fn vector(rows: &Array3<f64>, env: usize, body: usize, first: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| rows[(env, body, first + k)])
}

/// Writes numbers one after the other to the beginning of `row`; gives the rest of it.
pub(crate) fn put<'r>(row: &'r mut [f64], values: &[f64]) -> &'r mut [f64] {
    let (mine, rest) = row.split_at_mut(values.len());
    mine.copy_from_slice(values);
    rest
}
