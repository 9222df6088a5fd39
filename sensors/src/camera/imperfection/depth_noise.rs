//! Depth noise that grows with the square of the depth.

use super::{DepthEffect, ImageContext, within};
use crate::error::SensorError;
use kinetoscope_render::RngStream;
use serde::{Deserialize, Serialize};

/// Depth noise of triangulation. Disparity errors have the same size everywhere, so errors of a depth z grow with its
/// square. The standard deviation is `constant + quadratic (z - offset)²`. Results outside the near and far plane are
/// clamped to them. If rays of the lens do not all go forward, z is the distance along the ray: errors of angles also
/// grow with its square.
///
/// The default is [`DepthNoise::KHOSHELHAM`]. Errors of neighboring pixels are independent; on a real sensor they are
/// slightly correlated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DepthNoise {
    /// Standard deviation at depth `offset` \[m\], 0 to 1000.
    pub constant: f64,
    /// Coefficient of (z - `offset`)² in the standard deviation \[1/m\], 0 to 1000.
    pub quadratic: f64,
    /// Depth of the minimum of the parabola \[m\], -1000 to 1000.
    pub offset: f64,
}

impl DepthNoise {
    /// Kinect: 1.425e-3 z², which is 36 mm at 5 m. Source: Khoshelham and Oude Elberink 2012, "Accuracy and resolution
    /// of Kinect depth data for indoor mapping applications", Sensors 12: sigma = m/(f b) z² sigma_d with m/(f b) =
    /// 2.85e-5 per centimeter and sigma_d = 1/2.
    pub const KHOSHELHAM: Self = Self { constant: 0.0, quadratic: 1.425e-3, offset: 0.0 };
    /// Kinect, facing a wall: 1.2 mm + 1.9e-3 (z - 0.4 m)². Source: Nguyen, Izadi and Lovell 2012, "Modeling Kinect
    /// sensor noise for improved 3D reconstruction and tracking", 3DIMPVT. Their growth at grazing angles is not
    /// included: see [`Holes::max_angle`](super::Holes::max_angle).
    pub const NGUYEN: Self = Self { constant: 1.2e-3, quadratic: 1.9e-3, offset: 0.4 };
}

impl Default for DepthNoise {
    fn default() -> Self {
        Self::KHOSHELHAM
    }
}

impl DepthEffect for DepthNoise {
    fn check(&self) -> Result<(), SensorError> {
        const UP_TO: &str = "it must be 0 to 1000";
        within("constant of the depth noise", self.constant, [0.0, 1000.0], UP_TO)?;
        within("quadratic of the depth noise", self.quadratic, [0.0, 1000.0], UP_TO)?;
        within("offset of the depth noise", self.offset, [-1000.0, 1000.0], "it must be -1000 to 1000")
    }

    fn apply(&self, depths: &mut [f32], image: &ImageContext<'_>) {
        let (near, far) = (image.view.near, image.view.far);
        for (block, depths) in (0..).zip(depths.chunks_mut(4)) {
            if depths.iter().all(|depth| depth.is_infinite()) {
                continue;
            }
            let normals = image.rng_key.normals(RngStream::DEPTH, block);
            for (depth, normal) in depths.iter_mut().zip(normals).filter(|(depth, _)| depth.is_finite()) {
                let z = f64::from(*depth);
                let sigma = self.constant + self.quadratic * (z - self.offset).powi(2);
                *depth = ((z + sigma * normal) as f32).max(near).min(far);
            }
        }
    }
}
