//! NVIDIA's f-theta lens.

use super::polynomial::{derivative, first_sign_change, solve, value};
use super::{Domain, LensModel, OpticsError, check_finite, check_max_angle, radial};
use crate::intrinsics::Intrinsics;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Slope of Isaac's default lens \[rad per pixel\].
const ISAAC_SLOPE: f64 = 0.00245;

/// NVIDIA's f-theta lens: theta = a + b r + c r² + d r³ + e r⁴ + f r⁵ \[rad\], where r is the distance from the
/// principal point in pixels of the calibration image.
///
/// For the calibration image, fx and fy equal [`focal_length`](Self::focal_length). For another image size, scale fx
/// in proportion to its width and fy in proportion to its height.
///
/// The default is Isaac Lab's `FisheyeCameraCfg`: b = 0.00245 rad per pixel, all other coefficients 0, a field of view
/// of 200 degrees. Source of these numbers: `isaaclab/sim/spawners/sensors/sensors_cfg.py`, fields
/// `fisheye_polynomial_a` to `_f` and `fisheye_max_fov`. Its nominal image has 1936 x 1216 pixels: see
/// [`ISAAC`](Self::ISAAC).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FTheta {
    /// Coefficients a to f; a is 0, because the optical axis is at r = 0.
    pub polynomial: [f64; 6],
    /// Focal length of the calibration image \[pixels\]: a radius in pixels of that image, divided by it, is the radius
    /// in the normalized image. If it is 1 / b, with b of [`polynomial`](Self::polynomial), fx is the scale at the
    /// image center \[pixels/rad\].
    pub focal_length: f64,
    /// Largest visible angle from the optical axis \[rad\]: half of Isaac's `fisheye_max_fov`.
    pub max_angle: f64,
}

impl Default for FTheta {
    fn default() -> Self {
        Self {
            polynomial: [0.0, ISAAC_SLOPE, 0.0, 0.0, 0.0, 0.0],
            focal_length: 1.0 / ISAAC_SLOPE,
            max_angle: 100f64.to_radians(),
        }
    }
}

impl FTheta {
    /// Focal length and principal point of Isaac's default lens, in an image of 1936 x 1216 pixels. Source: the file
    /// above, `fisheye_optical_centre_x` and `_y`.
    pub const ISAAC: Intrinsics =
        Intrinsics::Pixels { fx: 1.0 / ISAAC_SLOPE, fy: 1.0 / ISAAC_SLOPE, cx: 970.94244, cy: 600.37482 };

    /// Angle \[rad\] at a radius \[pixels\], and its slope.
    fn angle(&self, radius: f64) -> (f64, f64) {
        let [_, b, c, d, e, f] = self.polynomial;
        (value(&self.polynomial, radius), value(&[b, 2.0 * c, 3.0 * d, 4.0 * e, 5.0 * f], radius))
    }
}

impl LensModel for FTheta {
    const NAME: &'static str = "ftheta";
    const ALIASES: &'static [&'static str] = &["f_theta", "fisheye_polynomial", "fisheyePolynomial"];

    fn max_angle(&self) -> Option<f64> {
        Some(self.max_angle)
    }

    fn validate(&self) -> Result<(), OpticsError> {
        let [a, b, c, d, e, f] = self.polynomial;
        check_finite(&[("a", a), ("b", b), ("c", c), ("d", d), ("e", e), ("f", f)])?;
        if a != 0.0 {
            return Err(OpticsError::Lens { what: "a", value: a, allowed: "0: the optical axis is at r = 0" });
        }
        if b <= 0.0 {
            return Err(OpticsError::Lens { what: "b", value: b, allowed: "positive" });
        }
        let focal_length = self.focal_length;
        if !(focal_length > 0.0 && focal_length.is_finite()) {
            let allowed = "positive and finite";
            return Err(OpticsError::Lens { what: "focal_length", value: focal_length, allowed });
        }
        check_max_angle(self.max_angle, PI, "above 0, at most pi")
    }

    fn domain(&self) -> Domain {
        let slope = derivative(&self.polynomial);
        // Doubles the radius until the angle is reached or the polynomial falls: its last coefficient decides.
        let mut far = self.max_angle / self.polynomial[1];
        let reached = |radius: f64| self.angle(radius).0 >= self.max_angle;
        while far < 1e12 && !reached(far) && first_sign_change(&slope, far).is_none() {
            far *= 2.0;
        }
        let fold = first_sign_change(&slope, far);
        let end = fold.unwrap_or(far);
        if !reached(end) {
            return Domain::new(self.angle(end).0, end / self.focal_length, true);
        }
        let radius = solve(self.max_angle, 0.0, end, 0.5 * end, |radius| self.angle(radius));
        Domain::new(self.max_angle, radius / self.focal_length, false)
    }

    fn project(&self, domain: &Domain, direction: [f64; 3]) -> Option<[f64; 2]> {
        let most = domain.radius * self.focal_length;
        radial::project(direction, domain.angle, |angle| {
            let start = angle / self.polynomial[1];
            solve(angle, 0.0, most, start, |radius| self.angle(radius)) / self.focal_length
        })
    }

    fn unproject(&self, domain: &Domain, point: [f64; 2]) -> Option<[f64; 3]> {
        radial::unproject(point, domain.angle, |radius| {
            (radius <= domain.radius).then(|| self.angle(radius * self.focal_length).0)
        })
    }
}
