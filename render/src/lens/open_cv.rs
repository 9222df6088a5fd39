//! A pinhole with OpenCV's distortion.

use super::poles::{Fraction, Poles};
use super::polynomial::bisect;
use super::{Domain, LensModel, OpticsError, check_finite, check_max_angle};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Largest visible angle from the optical axis \[rad\] (89.9 degrees) if no smaller angle is set.
pub(super) const MAX_ANGLE: f64 = 1.569_051;
/// Number of angles and directions at which the distortion is checked for folding back.
const ANGLES: usize = 1024;
const DIRECTIONS: usize = 64;
/// Continuation steps from the optical axis to a point, used if Newton's method fails at once.
const CONTINUATION_STEPS: usize = 32;

/// A pinhole with OpenCV's distortion: with (x, y) = (X / Z, Y / Z) and r² = x² + y² the normalized image has
///
/// - x' = x g + 2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴,
/// - y' = y g + p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴,
/// - g = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶).
///
/// Source: OpenCV, module calib3d, "Camera Calibration and 3D Reconstruction". ROS's `plumb_bob` uses k1, k2, p1, p2,
/// k3; its `rational_polynomial` adds k4 to k6. OpenCV's tilted sensor (tau) is not supported.
///
/// Newton's method inverts the mapping. At each azimuth around the optical axis, the inverse reaches from the axis to
/// the angle at which the mapping folds back. Folding is checked in steps of less than a tenth of a degree. If OpenCV's
/// formula has several directions for a pixel, the one within that range is used; `cv::undistortPoints` may find
/// another.
///
/// **Poles.** The fraction g may have a pole that a nearby zero nearly cancels. Calibrations with k4 to k6 often have
/// such a pole in the image. Within a ring of directions around it, OpenCV's formula runs to infinity and back, and
/// pixels have two directions or none. The ring is within 2 degrees of the pole, mostly much narrower. There the image
/// radius is replaced by a straight line from one end of the ring to the other, for lack of anything more accurate. So
/// each pixel has one direction, and each direction one pixel; everywhere else OpenCV's formula is used to the last
/// digit.
///
/// Any other pole ends the lens. If a zero follows the pole, directions behind the pole map to pixels before it. The
/// lens then ends before the pole, at the direction whose image radius equals that of the formula without pole and
/// zero. Otherwise the lens ends at the pole, and the image radius grows to it without bound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OpenCv {
    /// Radial, numerator: coefficient of r².
    pub k1: f64,
    /// Radial, numerator: coefficient of r⁴.
    pub k2: f64,
    /// Tangential: coefficient of 2 x y along x and of r² + 2 y² along y.
    pub p1: f64,
    /// Tangential: coefficient of r² + 2 x² along x and of 2 x y along y.
    pub p2: f64,
    /// Radial, numerator: coefficient of r⁶.
    pub k3: f64,
    /// Radial, denominator: coefficient of r².
    pub k4: f64,
    /// Radial, denominator: coefficient of r⁴.
    pub k5: f64,
    /// Radial, denominator: coefficient of r⁶.
    pub k6: f64,
    /// Thin prism, along x: coefficient of r².
    pub s1: f64,
    /// Thin prism, along x: coefficient of r⁴.
    pub s2: f64,
    /// Thin prism, along y: coefficient of r².
    pub s3: f64,
    /// Thin prism, along y: coefficient of r⁴.
    pub s4: f64,
    /// Largest visible angle from the optical axis \[rad\]; at most 1.569 (89.9 degrees). `None`: an image that reaches
    /// beyond the angle where the distortion folds back is an error.
    pub max_angle: Option<f64>,
}

/// A distorted point and its derivatives.
#[derive(Clone, Copy, Debug)]
struct Distorted {
    point: [f64; 2],
    /// Jacobian: derivatives of x' by x and y, and of y' by x and y.
    slope: [[f64; 2]; 2],
    /// True if the mapping keeps orientation and sign at this point.
    regular: bool,
}

impl OpenCv {
    /// Coefficients in OpenCV's order: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4.
    pub fn coefficients(&self) -> [f64; 12] {
        let Self { k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, .. } = *self;
        [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4]
    }

    /// Creates a lens from coefficients in OpenCV's order; missing ones are 0, and those after the twelfth are ignored.
    pub fn from_coefficients(coefficients: &[f64]) -> Self {
        let mut all = [0.0; 12];
        all.iter_mut().zip(coefficients).for_each(|(to, from)| *to = *from);
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = all;
        Self { k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, max_angle: None }
    }

    /// True if the distortion is rotationally symmetric.
    fn is_radial(&self) -> bool {
        let Self { p1, p2, s1, s2, s3, s4, .. } = *self;
        [p1, p2, s1, s2, s3, s4] == [0.0; 6]
    }

    /// Factor g of the radial distortion.
    fn fraction(&self) -> Fraction {
        Fraction { numerator: [1.0, self.k1, self.k2, self.k3], denominator: [1.0, self.k4, self.k5, self.k6] }
    }

    fn distort(&self, poles: &Poles, [x, y]: [f64; 2]) -> Distorted {
        let Self { p1, p2, s1, s2, s3, s4, .. } = *self;
        let r = x * x + y * y;
        // The slope is the derivative by r².
        let (g, slope) = poles.factor(&self.fraction(), r);
        let point = [
            x * g + 2.0 * p1 * x * y + p2 * (r + 2.0 * x * x) + r * (s1 + r * s2),
            y * g + p1 * (r + 2.0 * y * y) + 2.0 * p2 * x * y + r * (s3 + r * s4),
        ];
        let (prism_x, prism_y) = (2.0 * (s1 + 2.0 * r * s2), 2.0 * (s3 + 2.0 * r * s4));
        let mixed = 2.0 * x * y * slope;
        let slope = [
            [
                g + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x + x * prism_x,
                mixed + 2.0 * p1 * x + 2.0 * p2 * y + y * prism_x,
            ],
            [
                mixed + 2.0 * p1 * x + 2.0 * p2 * y + x * prism_y,
                g + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x + y * prism_y,
            ],
        ];
        let area = slope[0][0] * slope[1][1] - slope[0][1] * slope[1][0];
        Distorted { point, slope, regular: g > 0.0 && area > 0.0 && area.is_finite() }
    }

    /// Angle \[rad\] up to which the mapping is regular in a direction; `None` if that is at least `most`.
    fn fold_angle(&self, poles: &Poles, [c, s]: [f64; 2], most: f64) -> Option<f64> {
        let end = poles.end.map(|end| end.angle).filter(|end| *end < most);
        let last = end.unwrap_or(most);
        // An angle that ends at a pole is regular up to there.
        let regular = |angle: f64| {
            let r = angle.tan();
            Some(angle) == end || self.distort(poles, [c * r, s * r]).regular
        };
        let at = |k: usize| if k == ANGLES { last } else { last * k as f64 / ANGLES as f64 };
        match (1..=ANGLES).find(|&k| !regular(at(k))) {
            Some(first) => Some(bisect(at(first - 1), at(first), regular)),
            None => end,
        }
    }

    /// True if an undistorted point belongs to the lens: in its domain, or in a direction that folds back later.
    fn contains(&self, domain: &Domain, [x, y]: [f64; 2]) -> bool {
        let r = x.hypot(y);
        if r <= domain.angle.tan() {
            return true;
        }
        let angle = r.atan();
        // A rotationally symmetric distortion folds back at the same angle in all directions.
        domain.folds
            && !self.is_radial()
            && angle <= self.max_angle.unwrap_or(MAX_ANGLE)
            && self.fold_angle(&domain.poles, [x / r, y / r], angle).is_none()
    }

    /// Finds the point that is distorted to `target` by Newton's method from a nearby start; `None` if the method
    /// leaves the regular range or does not converge.
    fn undistort_from(&self, poles: &Poles, target: [f64; 2], start: [f64; 2]) -> Option<[f64; 2]> {
        let mut p = start;
        let mut now = self.distort(poles, p);
        let scale = 1.0 + target[0].hypot(target[1]);
        let error = |d: &Distorted| [d.point[0] - target[0], d.point[1] - target[1]];
        for _ in 0..100 {
            let [ex, ey] = error(&now);
            let size = ex.hypot(ey);
            if !now.regular || !size.is_finite() {
                return None;
            }
            if size <= 4e-16 * scale {
                return Some(p);
            }
            let [[a, b], [c, d]] = now.slope;
            let area = a * d - b * c;
            let step = [(d * ex - b * ey) / area, (a * ey - c * ex) / area];
            let mut part = 1.0;
            loop {
                let next = [p[0] - part * step[0], p[1] - part * step[1]];
                let then = self.distort(poles, next);
                let [fx, fy] = error(&then);
                if then.regular && fx.hypot(fy) < size {
                    (p, now) = (next, then);
                    break;
                }
                // Rounding allows no closer approach.
                if size <= 1e-13 * scale {
                    return Some(p);
                }
                part *= 0.5;
                if part < 1e-9 {
                    return None;
                }
            }
        }
        None
    }

    /// Finds the point within the lens that is distorted to `target`; `None` without such a point. Newton's method
    /// starts at the target. If it fails, or finds a point beyond a fold (another direction for the same pixel),
    /// continuation from the optical axis is used.
    fn undistort(&self, domain: &Domain, target: [f64; 2]) -> Option<[f64; 2]> {
        let from = |target: [f64; 2], start: [f64; 2]| {
            self.undistort_from(&domain.poles, target, start).filter(|point| self.contains(domain, *point))
        };
        from(target, target).or_else(|| {
            (1..=CONTINUATION_STEPS).try_fold([0.0; 2], |near, k| {
                let part = k as f64 / CONTINUATION_STEPS as f64;
                from(target.map(|x| x * part), near)
            })
        })
    }
}

impl LensModel for OpenCv {
    const NAME: &'static str = "opencv";
    const ALIASES: &'static [&'static str] =
        &["plumb_bob", "rational_polynomial", "radtan", "opencv_pinhole", "brown_conrady", "fisheyeRadTanThinPrism"];
    const FORWARD: bool = true;

    fn is_pinhole(&self) -> bool {
        self.max_angle.is_none() && self.coefficients() == [0.0; 12]
    }

    fn max_angle(&self) -> Option<f64> {
        self.max_angle
    }

    fn validate(&self) -> Result<(), OpticsError> {
        const NAMES: [&str; 12] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"];
        let all = self.coefficients();
        check_finite(&std::array::from_fn::<_, 12, _>(|k| (NAMES[k], all[k])))?;
        self.max_angle
            .map_or(Ok(()), |angle| check_max_angle(angle, MAX_ANGLE, "above 0, at most 1.569 (89.9 degrees)"))
    }

    fn domain(&self) -> Domain {
        let most = self.max_angle.unwrap_or(MAX_ANGLE);
        let poles = Poles::find(&self.fraction(), most);
        let count = if self.is_radial() { 1 } else { DIRECTIONS };
        let folds = (0..count).filter_map(|k| {
            let (s, c) = (TAU * k as f64 / count as f64).sin_cos();
            Some((self.fold_angle(&poles, [c, s], most)?, [c, s]))
        });
        let first = folds.min_by(|(a, _), (b, _)| a.total_cmp(b));
        let (angle, [c, s]) = first.unwrap_or((most, [1.0, 0.0]));
        let endless = poles.end.is_some_and(|end| end.unbounded && end.angle == angle);
        let [x, y] = self.distort(&poles, [c * angle.tan(), s * angle.tan()]).point;
        let radius = if endless { f64::INFINITY } else { x.hypot(y) };
        Domain { poles, ..Domain::new(angle, radius, first.is_some()) }
    }

    fn project(&self, domain: &Domain, [x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
        if z <= 0.0 {
            return None;
        }
        let point = [x / z, y / z];
        self.contains(domain, point).then(|| self.distort(&domain.poles, point).point)
    }

    fn unproject(&self, domain: &Domain, point: [f64; 2]) -> Option<[f64; 3]> {
        let [x, y] = self.undistort(domain, point)?;
        Some([x, y, 1.0])
    }
}
