//! Access to poses and vectors of bodies in a state, and validation of offsets.

use crate::error::SensorError;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::from_row;
use nalgebra::Vector3;
use ndarray::Array3;

/// Returns the pose of body `body` in environment `env`, in the frame of the environment.
pub(crate) fn pose(poses: &Array3<f64>, env: usize, body: usize) -> Pose {
    from_row(&std::array::from_fn(|k| poses[(env, body, k)]))
}

/// Returns three numbers of a body, from index `first` on.
pub(crate) fn vector(rows: &Array3<f64>, env: usize, body: usize, first: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| rows[(env, body, first + k)])
}

/// Rejects an offset that is not a pose: a number that is not finite, or a rotation whose quaternion does not have
/// length 1, to 1e-6. nalgebra's types allow both, and every measurement would be wrong with them.
pub(crate) fn check_offset(field: &str, offset: &Pose) -> Result<(), SensorError> {
    let numbers = || offset.translation.vector.iter().chain(offset.rotation.coords.iter());
    let wrong = |value, expected| Err(SensorError::OutOfRange { field: field.into(), value, expected });
    if let Some(&value) = numbers().find(|x| !x.is_finite()) {
        return wrong(value, "every number must be finite");
    }
    let length = offset.rotation.coords.norm();
    if (length - 1.0).abs() > 1e-6 {
        return wrong(length, "this is the length of its quaternion, which must be 1");
    }
    Ok(())
}

/// Writes numbers to the beginning of `row`; returns the rest of the row.
pub(crate) fn write_front<'r>(row: &'r mut [f64], values: &[f64]) -> &'r mut [f64] {
    let (mine, rest) = row.split_at_mut(values.len());
    mine.copy_from_slice(values);
    rest
}
