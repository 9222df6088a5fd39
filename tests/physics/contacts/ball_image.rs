//! Closed form of a ball's image in a pinhole camera.
//!
//! A ball of radius R at (x, y, z) in the optical frame is enclosed by its tangent cone. The image plane cuts the cone
//! in an ellipse, with s = z² - R²:
//!
//! ```text
//! middle (c + f (x, y) z/s),   area π f² R² √(x² + y² + s)/s^(3/2)
//! ```
//!
//! (Its half axes are f R/√s across the direction to the principal point, and f R √(x² + y² + s)/s along it.)

use kinetoscope::ndarray::{ArrayView2, ArrayView3, Axis};
use std::f64::consts::PI;

/// Image size, focal length and principal point \[pixels\].
pub(super) const SIZE: [usize; 2] = [320, 240];
pub(super) const FOCAL: f64 = 280.0;
pub(super) const PRINCIPAL_POINT: [f64; 2] = [160.0, 120.0];

/// Image moments of one object.
#[derive(Clone, Copy, Debug)]
pub(super) struct ImageMoments {
    /// Area \[pixels\].
    pub(super) area: f64,
    /// Mean of its pixel centers \[pixels\].
    pub(super) centroid: [f64; 2],
}

/// The closed form.
pub(super) fn expected_moments([x, y, z]: [f64; 3], radius: f64) -> ImageMoments {
    let s = z * z - radius * radius;
    let area = PI * FOCAL * FOCAL * radius * radius * (x * x + y * y + s).sqrt() / s.powf(1.5);
    ImageMoments { area, centroid: [PRINCIPAL_POINT[0] + FOCAL * x * z / s, PRINCIPAL_POINT[1] + FOCAL * y * z / s] }
}

/// Moments of the pixels with a mask id.
pub(super) fn measured_moments(mask: &ArrayView3<'_, i32>, id: i32) -> ImageMoments {
    let mask: ArrayView2<'_, i32> = mask.index_axis(Axis(0), 0);
    let (mut area, mut sum) = (0.0, [0.0; 2]);
    for ((v, u), _) in mask.indexed_iter().filter(|(_, found)| **found == id) {
        area += 1.0;
        sum[0] += u as f64 + 0.5;
        sum[1] += v as f64 + 0.5;
    }
    ImageMoments { area, centroid: sum.map(|x| x / area) }
}
