//! Poses and vectors in the rows of a state, and offsets that are poses.

use crate::error::SensorError;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::from_row;
use nalgebra::Vector3;
use ndarray::Array3;

/// The pose of a body.
pub(crate) fn pose(poses: &Array3<f64>, env: usize, body: usize) -> Pose {
    from_row(&std::array::from_fn(|k| poses[(env, body, k)]))
}

/// Three numbers of a body, from `first` on.
pub(crate) fn vector(rows: &Array3<f64>, env: usize, body: usize, first: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| rows[(env, body, first + k)])
}

/// Refuses an offset that is no pose: a number that is not finite, or a rotation whose quaternion has not length 1, to 1e-6.
/// nalgebra's types allow both, and every measurement would be wrong with them.
pub(crate) fn check_offset(field: &str, offset: &Pose) -> Result<(), SensorError> {
    let numbers = || offset.translation.vector.iter().chain(offset.rotation.coords.iter());
    let wrong = |value, expected| Err(SensorError::OutOfRange { field: field.into(), value, expected });
    if let Some(&value) = numbers().find(|x| !x.is_finite()) {
        return wrong(value, "every number of it must be finite");
    }
    let length = offset.rotation.coords.norm();
    if (length - 1.0).abs() > 1e-6 {
        return wrong(length, "that is the length of its quaternion, which must be 1");
    }
    Ok(())
}

/// Writes numbers one after the other to the beginning of `row`; gives the rest of it.
pub(crate) fn put<'r>(row: &'r mut [f64], values: &[f64]) -> &'r mut [f64] {
    let (mine, rest) = row.split_at_mut(values.len());
    mine.copy_from_slice(values);
    rest
}
