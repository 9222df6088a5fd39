//! OpenCV's fisheye lens.

use super::polynomial::{first_sign_change, solve, value};
use super::{Domain, LensModel, OpticsError, check_finite, check_max_angle, radial};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Coefficients of OpenCV's fisheye lens: r = theta (1 + k1 theta² + k2 theta⁴ + k3 theta⁶ + k4 theta⁸), with r in the
/// normalized image. Focal lengths and principal point are in [`Intrinsics`](crate::Intrinsics). Calibration files of
/// ROS call this lens `equidistant`; in scene files, `equidistant` is [`Equidistant`](super::Equidistant), which has no
/// coefficients. Skew is not supported.
///
/// Source: OpenCV, module calib3d, `cv::fisheye`; Kannala and Brandt, A generic camera model and calibration method for
/// conventional, wide-angle, and fish-eye lenses, PAMI 2006.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OpenCvFisheye {
    /// Coefficient of theta³.
    pub k1: f64,
    /// Coefficient of theta⁵.
    pub k2: f64,
    /// Coefficient of theta⁷.
    pub k3: f64,
    /// Coefficient of theta⁹.
    pub k4: f64,
    /// Largest visible angle from the optical axis \[rad\]; at most pi. `None`: an image that reaches beyond the angle
    /// where the polynomial folds back is an error.
    pub max_angle: Option<f64>,
}

impl OpenCvFisheye {
    /// Radius and its slope at an angle \[rad\].
    fn radius(&self, angle: f64) -> (f64, f64) {
        let s = angle * angle;
        (angle * value(&[1.0, self.k1, self.k2, self.k3, self.k4], s), value(&self.slope(), s))
    }

    /// Coefficients of the slope, as a polynomial of the squared angle.
    fn slope(&self) -> [f64; 5] {
        [1.0, 3.0 * self.k1, 5.0 * self.k2, 7.0 * self.k3, 9.0 * self.k4]
    }
}

impl LensModel for OpenCvFisheye {
    const NAME: &'static str = "opencv_fisheye";
    const ALIASES: &'static [&'static str] =
        &["kannala_brandt", "kannala_brandt4", "fisheyeKannalaBrandtK3", "fisheye"];

    fn max_angle(&self) -> Option<f64> {
        self.max_angle
    }

    fn validate(&self) -> Result<(), OpticsError> {
        check_finite(&[("k1", self.k1), ("k2", self.k2), ("k3", self.k3), ("k4", self.k4)])?;
        self.max_angle.map_or(Ok(()), |angle| check_max_angle(angle, PI, "above 0, at most pi"))
    }

    fn domain(&self) -> Domain {
        let most = self.max_angle.unwrap_or(PI);
        let fold = first_sign_change(&self.slope(), most * most).map(f64::sqrt);
        let angle = fold.unwrap_or(most);
        Domain::new(angle, self.radius(angle).0, fold.is_some())
    }

    fn project(&self, domain: &Domain, direction: [f64; 3]) -> Option<[f64; 2]> {
        radial::project(direction, domain.angle, |angle| self.radius(angle).0)
    }

    fn unproject(&self, domain: &Domain, point: [f64; 2]) -> Option<[f64; 3]> {
        radial::unproject(point, domain.angle, |radius| {
            (radius <= domain.radius).then(|| solve(radius, 0.0, domain.angle, radius, |angle| self.radius(angle)))
        })
    }
}
