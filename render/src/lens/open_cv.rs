//! A pinhole with OpenCV's distortion.

use super::poles::{Fraction, Poles};
use super::polynomial::bisect;
use super::{OpticsError, Domain, LensModel, angle_up_to, finite};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Nothing is seen farther from the optical axis than this \[rad\] (89.9 degrees), where no smaller angle is given.
pub(super) const MOST: f64 = 1.569_051;
/// Angles and directions at which it is looked whether the distortion folds back.
const ANGLES: usize = 1024;
const DIRECTIONS: usize = 64;
/// Parts of the way to a point, where Newton's method does not find it at once.
const PARTS: usize = 32;

/// A pinhole with OpenCV's distortion: with (x, y) = (X / Z, Y / Z) and r² = x² + y² the normalized image has
///
/// - x' = x g + 2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴,
/// - y' = y g + p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴,
/// - g = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶).
///
/// Source: OpenCV, module calib3d, "Camera Calibration and 3D Reconstruction". ROS's `plumb_bob` has k1, k2, p1, p2, k3 of it,
/// its `rational_polynomial` k4 to k6 too. OpenCV's tilted sensor (tau) is not offered.
///
/// The mapping is inverted by Newton's method, where it can be: from the optical axis to where it folds back in the direction
/// in question. Whether it does is looked at in steps of less than a tenth of a degree. Of the directions that OpenCV's formula
/// has for a pixel it is the one within that, which `cv::undistortPoints` need not find.
///
/// **Poles.** Where the fraction g has a pole that a zero beside it nearly cancels, as calibrations with k4 to k6 often have one in
/// the image, OpenCV's formula runs to infinity and back within a ring of directions, in which pixels have two of them or none.
/// There, within 2 degrees of the pole and mostly much less, the radius of the image is a straight line from one end of the ring
/// to the other, for lack of anything that would be right: each pixel has a direction, each direction a pixel, and everywhere else
/// it is OpenCV's formula to the last digit. Another pole ends the lens: where it would be without pole and zero, if there are
/// directions behind it, for they would be seen in the same pixels; else the image has no end before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OpenCv {
    /// Radial, above: of r².
    pub k1: f64,
    /// Radial, above: of r⁴.
    pub k2: f64,
    /// Tangential.
    pub p1: f64,
    /// Tangential.
    pub p2: f64,
    /// Radial, above: of r⁶.
    pub k3: f64,
    /// Radial, below: of r².
    pub k4: f64,
    /// Radial, below: of r⁴.
    pub k5: f64,
    /// Radial, below: of r⁶.
    pub k6: f64,
    /// Thin prism, along x: of r².
    pub s1: f64,
    /// Thin prism, along x: of r⁴.
    pub s2: f64,
    /// Thin prism, along y: of r².
    pub s3: f64,
    /// Thin prism, along y: of r⁴.
    pub s4: f64,
    /// Nothing is seen farther from the optical axis than this angle \[rad\]; at most 1.569 (89.9 degrees). `None`: a image
    /// that reaches beyond where the distortion folds back is an error.
    pub max_angle: Option<f64>,
}

/// A point after the distortion.
#[derive(Clone, Copy, Debug)]
struct Distorted {
    point: [f64; 2],
    /// Derivatives: of x' by x and y, of y' by x and y.
    slope: [[f64; 2]; 2],
    /// Whether orientation and sign are kept there.
    regular: bool,
}

impl OpenCv {
    /// The coefficients in OpenCV's order: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4.
    pub fn coefficients(&self) -> [f64; 12] {
        let Self { k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, .. } = *self;
        [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4]
    }

    /// The lens of coefficients in OpenCV's order; missing ones are 0, and those after the twelfth do not count.
    pub fn from_coefficients(coefficients: &[f64]) -> Self {
        let mut all = [0.0; 12];
        all.iter_mut().zip(coefficients).for_each(|(to, from)| *to = *from);
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = all;
        Self { k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, max_angle: None }
    }

    /// Whether it is the same in all directions.
    fn is_radial(&self) -> bool {
        let Self { p1, p2, s1, s2, s3, s4, .. } = *self;
        [p1, p2, s1, s2, s3, s4] == [0.0; 6]
    }

    /// The factor of the radial distortion.
    fn fraction(&self) -> Fraction {
        Fraction { above: [1.0, self.k1, self.k2, self.k3], below: [1.0, self.k4, self.k5, self.k6] }
    }

    fn distort(&self, poles: &Poles, [x, y]: [f64; 2]) -> Distorted {
        let Self { p1, p2, s1, s2, s3, s4, .. } = *self;
        let r = x * x + y * y;
        // The slope is by r².
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

    /// The angle up to which all is regular in a direction, if that is less than `most` \[rad\].
    fn fold(&self, poles: &Poles, [c, s]: [f64; 2], most: f64) -> Option<f64> {
        let end = poles.end.map(|end| end.angle).filter(|end| *end < most);
        let last = end.unwrap_or(most);
        // What ends at a pole is good up to there.
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

    /// Whether a point before the distortion belongs to the lens: in its domain, or in a direction that folds back later.
    fn sees(&self, domain: &Domain, [x, y]: [f64; 2]) -> bool {
        let r = x.hypot(y);
        if r <= domain.angle.tan() {
            return true;
        }
        let angle = r.atan();
        // What is the same in all directions folds back at the same angle in all of them.
        domain.folds
            && !self.is_radial()
            && angle <= self.max_angle.unwrap_or(MOST)
            && self.fold(&domain.poles, [x / r, y / r], angle).is_none()
    }

    /// The point that is distorted to `target`, from one that is near it.
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
                // As near as rounding lets it come.
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

    /// The point that belongs to the lens and is distorted to `target`: Newton's method finds it from there, or what is beyond a
    /// fold, which is another direction for the same pixel; then it is gone after from the optical axis.
    fn undistort(&self, domain: &Domain, target: [f64; 2]) -> Option<[f64; 2]> {
        let from = |target: [f64; 2], start: [f64; 2]| {
            self.undistort_from(&domain.poles, target, start).filter(|point| self.sees(domain, *point))
        };
        from(target, target).or_else(|| {
            (1..=PARTS).try_fold([0.0; 2], |near, k| {
                let part = k as f64 / PARTS as f64;
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
        finite(&std::array::from_fn::<_, 12, _>(|k| (NAMES[k], all[k])))?;
        self.max_angle.map_or(Ok(()), |angle| angle_up_to(angle, MOST, "above 0, at most 1.569 (89.9 degrees)"))
    }

    fn domain(&self) -> Domain {
        let most = self.max_angle.unwrap_or(MOST);
        let poles = Poles::of(&self.fraction(), most);
        let count = if self.is_radial() { 1 } else { DIRECTIONS };
        let folds = (0..count).filter_map(|k| {
            let (s, c) = (TAU * k as f64 / count as f64).sin_cos();
            Some((self.fold(&poles, [c, s], most)?, [c, s]))
        });
        let first = folds.min_by(|(a, _), (b, _)| a.total_cmp(b));
        let (angle, [c, s]) = first.unwrap_or((most, [1.0, 0.0]));
        let endless = poles.end.is_some_and(|end| end.endless && end.angle == angle);
        let [x, y] = self.distort(&poles, [c * angle.tan(), s * angle.tan()]).point;
        let radius = if endless { f64::INFINITY } else { x.hypot(y) };
        Domain { poles, ..Domain::new(angle, radius, first.is_some()) }
    }

    fn project(&self, domain: &Domain, [x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
        if z <= 0.0 {
            return None;
        }
        let point = [x / z, y / z];
        self.sees(domain, point).then(|| self.distort(&domain.poles, point).point)
    }

    fn unproject(&self, domain: &Domain, point: [f64; 2]) -> Option<[f64; 3]> {
        let [x, y] = self.undistort(domain, point)?;
        Some([x, y, 1.0])
    }
}
