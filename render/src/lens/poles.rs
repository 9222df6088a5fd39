//! Poles of OpenCV's radial factor, a fraction of two polynomials of r². Poles that a zero nearly cancels are bridged;
//! any other pole ends the lens.
//!
//! A calibration that fits k4 to k6 has more parameters than the lens needs. The surplus makes pairs of a pole and a
//! nearby zero, also within the image. The factory calibrations of OAK-D cameras have such pairs, and so had 18 of 57
//! fits of `cv2.calibrateCamera` to simulated points with a quarter pixel of noise. (OpenCV, issue 15577, "Ill-defined
//! distortion model found by calibrateCamera".)
//!
//! Near a pole at the tangent p, a ray at the tangent r has the image radius R = c + m (r - p) - e / (r - p),
//! approximately. With the pole before the zero (e > 0) both sides reach every radius, so a pixel has two directions.
//! With the pole behind the zero (e < 0) no direction reaches a ring of the image. Both happen within sqrt(|e| / m) of
//! the pole. Slightly beyond, where the radius grows again as the lens does, a bridge begins: there R is a straight
//! line from one end to the other. Everywhere else OpenCV's formula is used to the last digit.

use super::open_cv::MAX_ANGLE;
use super::polynomial::{bisect, derivative, sign_changes, value};

/// Largest reach of a bridge to either side of its pole \[rad\] (2 degrees). If a pole needs a wider bridge, the
/// formula is off by so much that no calibration with points there would give it: the formula does not describe the
/// lens there. The widest bridge of all examined calibrations, of an OAK-D Lite, is 1.6 degrees.
const MAX_BRIDGE_REACH: f64 = 0.035;
/// Reach of a bridge to either side, in units of sqrt(|e| / m): the first sufficient one is used. At 1.1, R grows by a
/// sixth of m beside the bridge (e < 0) or on it (e > 0), which is enough for Newton's method.
const REACHES: [f64; 5] = [1.1, 1.2, 1.4, 1.7, 2.0];
/// Least growth of R on a bridge and beside it, as a fraction of m.
const MIN_SLOPE: f64 = 0.05;
/// Shortest reach of a bridge, for a pole at the tangent 1: so close to a pole the fraction still has ten digits.
const MIN_BRIDGE_REACH: f64 = 1e-6;

/// A fraction of two polynomials of s = r², the square of the tangent; lowest coefficient first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fraction {
    pub(super) numerator: [f64; 4],
    pub(super) denominator: [f64; 4],
}

impl Fraction {
    /// Value, and derivative by s.
    fn at(&self, s: f64) -> (f64, f64) {
        let [_, k1, k2, k3] = self.numerator;
        let [_, k4, k5, k6] = self.denominator;
        let above = 1.0 + s * (k1 + s * (k2 + s * k3));
        let below = 1.0 + s * (k4 + s * (k5 + s * k6));
        let g = above / below;
        (g, ((k1 + s * (2.0 * k2 + s * 3.0 * k3)) - g * (k4 + s * (2.0 * k5 + s * 3.0 * k6))) / below)
    }

    /// Image radius R = r g(r²) and its derivative dR/dr, with r the tangent of the angle to the optical axis.
    fn radius(&self, r: f64) -> (f64, f64) {
        let (g, slope) = self.at(r * r);
        (r * g, g + 2.0 * r * r * slope)
    }

    /// e and m at a pole at s. With g = c0 / u + c1 + c2 u + .. of u = s - p², e is -c0 / 2 and m is c1 + 2 p² c2.
    fn residue_and_slope(&self, pole: f64) -> (f64, f64) {
        let taylor = |of: &[f64]| {
            let (first, third) = (derivative(of), of[3]);
            [value(of, pole), value(&first, pole), 0.5 * value(&derivative(&first), pole), third]
        };
        let ([a0, a1, a2, _], [_, b1, b2, b3]) = (taylor(&self.numerator), taylor(&self.denominator));
        let c0 = a0 / b1;
        let c1 = (a1 - c0 * b2) / b1;
        let c2 = (a2 - c0 * b3 - c1 * b2) / b1;
        (-0.5 * c0, c1 + 2.0 * pole * c2)
    }

    /// A bridge over a pole at s that starts after the tangent `before`; `None` if no reach is sufficient.
    fn bridge(&self, pole: f64, before: f64) -> Option<Bridge> {
        let (e, m) = self.residue_and_slope(pole);
        let at = pole.sqrt();
        let about = (e.abs() / m).sqrt().max(MIN_BRIDGE_REACH * at);
        REACHES.into_iter().map(|reach| reach * about).find_map(|half| {
            let (from, to) = (at - half, at + half);
            if !(m > 0.0 && half <= MAX_BRIDGE_REACH * (1.0 + pole) && from > before) {
                return None;
            }
            let [(start, first), (end, last)] = [from, to].map(|r| self.radius(r));
            let slope = (end - start) / (to - from);
            let grows = start > 0.0 && [first, slope, last].into_iter().all(|slope| slope > MIN_SLOPE * m);
            grows.then_some(Bridge { from, to, start, slope })
        })
    }
}

/// A range in which the image radius is a straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bridge {
    /// Tangents of the start and the end.
    from: f64,
    to: f64,
    /// Image radius at the start.
    start: f64,
    /// Derivative of the image radius by the tangent.
    slope: f64,
}

impl Bridge {
    /// The factor and its derivative by s; `None` if s is not on the bridge.
    fn at(&self, s: f64) -> Option<(f64, f64)> {
        let r = s.sqrt();
        if r < self.from || r > self.to {
            return None;
        }
        let g = (self.start + self.slope * (r - self.from)) / r;
        Some((g, 0.5 * (self.slope - g) / s))
    }
}

/// End of a lens at a pole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LensEnd {
    /// The last angle from the optical axis \[rad\].
    pub(super) angle: f64,
    /// True if the image radius grows without bound there.
    pub(super) unbounded: bool,
}

/// Poles of a fraction: the bridged ones, and the one that ends the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Poles {
    bridges: [Option<Bridge>; 3],
    pub(super) end: Option<LensEnd>,
}

impl Poles {
    pub(super) const NONE: Self = Self { bridges: [None; 3], end: None };

    /// Finds the poles; `most` is the largest angle \[rad\] at which a pole can end the lens.
    pub(super) fn find(fraction: &Fraction, most: f64) -> Self {
        let far = MAX_ANGLE.tan().powi(2);
        let mut poles = Self::NONE;
        let mut before = 0.0;
        for (k, pole) in sign_changes(&fraction.denominator, 0.0, far).into_iter().enumerate() {
            let Some(bridge) = fraction.bridge(pole, before) else {
                poles.end = (pole.sqrt().atan() <= most).then(|| poles.end_at_pole(fraction, pole, far));
                break;
            };
            poles.bridges[k] = Some(bridge);
            before = bridge.to;
        }
        poles
    }

    /// The end of the lens at a pole at s. If no zero follows the pole, the image radius grows to it without bound.
    /// With a zero up to `far`, directions behind the pole map to the same pixels. Then the pixels from the axis on are
    /// those that the formula without pole and zero has before the pole.
    fn end_at_pole(&self, fraction: &Fraction, pole: f64, far: f64) -> LensEnd {
        let (e, _) = fraction.residue_and_slope(pole);
        let (at, angle) = (pole.sqrt(), pole.sqrt().atan());
        let zero = sign_changes(&fraction.numerator, pole, far).first().copied();
        match zero {
            Some(zero) if e > 0.0 => {
                // The factor without pole and zero, times the tangent.
                let radius = 2.0 * e / at * zero / (zero - pole);
                let before = |angle: f64| {
                    let r = angle.tan();
                    r * self.factor(fraction, r * r).0 <= radius
                };
                LensEnd { angle: bisect(0.0, angle, before), unbounded: false }
            }
            _ => LensEnd { angle, unbounded: e > 0.0 },
        }
    }

    /// The factor and its derivative by s.
    pub(super) fn factor(&self, fraction: &Fraction, s: f64) -> (f64, f64) {
        self.bridges.iter().flatten().find_map(|bridge| bridge.at(s)).unwrap_or_else(|| fraction.at(s))
    }
}
