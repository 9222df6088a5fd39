//! Poles of OpenCV's radial factor, a fraction of two polynomials of r²: those that a zero nearly cancels are bridged, another
//! one ends the lens.
//!
//! A calibration that fits k4 to k6 has more numbers than the lens needs. The surplus makes pairs of a pole and a zero beside
//! it, also where the image is: the factory's calibrations of OAK-D cameras have such pairs, and 18 of 57 fits of
//! `cv2.calibrateCamera` to simulated points with a quarter pixel of noise had. (OpenCV, issue 15577, "Ill-defined distortion model
//! found by calibrateCamera".)
//!
//! Beside a pole at the tangent p, the image's radius R of a ray at the tangent r is about c + m (r - p) - e / (r - p): with
//! the pole before the zero (e > 0) both sides reach every radius, so that a pixel has two directions; behind it (e < 0) there
//! is a ring of the image that no direction reaches. Either is so within sqrt(|e| / m) of the pole. A little beyond, where the
//! radius grows again as the lens has it, a bridge begins: there R is a straight line from one end to the other. All else is
//! OpenCV's formula to the last digit.

use super::open_cv::MOST;
use super::polynomial::{bisect, derivative, sign_changes, value};

/// A bridge may reach as far as this to either side of its pole \[rad\] (2 degrees). Where a wider one is needed, the formula is
/// off by so much that no calibration with points there would give it: what it says there is not of the lens. The widest of
/// the calibrations that were looked at, of an OAK-D Lite, needs 1.6 degrees.
const WIDEST: f64 = 0.035;
/// How far to either side a bridge reaches, where what is about the pole reaches 1: the first that will do. At 1.1, R grows by a
/// sixth of m beside the bridge (e < 0) or on it (e > 0), which Newton's method is content with.
const REACHES: [f64; 5] = [1.1, 1.2, 1.4, 1.7, 2.0];
/// The least of m by which R has to grow on a bridge, and beside it.
const LEAST_SLOPE: f64 = 0.05;
/// The shortest bridge, where its pole is 1 from the axis: so close to a pole the fraction still has ten digits.
const SHORTEST: f64 = 1e-6;

/// A fraction of two polynomials of s = r², the square of the tangent; lowest coefficient first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fraction {
    pub(super) above: [f64; 4],
    pub(super) below: [f64; 4],
}

impl Fraction {
    /// Value, and slope by s.
    fn at(&self, s: f64) -> (f64, f64) {
        let [_, k1, k2, k3] = self.above;
        let [_, k4, k5, k6] = self.below;
        let above = 1.0 + s * (k1 + s * (k2 + s * k3));
        let below = 1.0 + s * (k4 + s * (k5 + s * k6));
        let g = above / below;
        (g, ((k1 + s * (2.0 * k2 + s * 3.0 * k3)) - g * (k4 + s * (2.0 * k5 + s * 3.0 * k6))) / below)
    }

    /// The image's radius at a tangent r, and its slope by r.
    fn radius(&self, r: f64) -> (f64, f64) {
        let (g, slope) = self.at(r * r);
        (r * g, g + 2.0 * r * r * slope)
    }

    /// e and m beside a pole at s. With g = c0 / u + c1 + c2 u + .. of u = s - p², e is -c0 / 2 and m is c1 + 2 p² c2.
    fn beside(&self, pole: f64) -> (f64, f64) {
        let taylor = |of: &[f64]| {
            let (first, third) = (derivative(of), of[3]);
            [value(of, pole), value(&first, pole), 0.5 * value(&derivative(&first), pole), third]
        };
        let ([a0, a1, a2, _], [_, b1, b2, b3]) = (taylor(&self.above), taylor(&self.below));
        let c0 = a0 / b1;
        let c1 = (a1 - c0 * b2) / b1;
        let c2 = (a2 - c0 * b3 - c1 * b2) / b1;
        (-0.5 * c0, c1 + 2.0 * pole * c2)
    }

    /// A bridge over a pole at s, not before a tangent; `None` where none will do.
    fn bridge(&self, pole: f64, before: f64) -> Option<Bridge> {
        let (e, m) = self.beside(pole);
        let at = pole.sqrt();
        let about = (e.abs() / m).sqrt().max(SHORTEST * at);
        REACHES.into_iter().map(|reach| reach * about).find_map(|half| {
            let (from, to) = (at - half, at + half);
            if !(m > 0.0 && half <= WIDEST * (1.0 + pole) && from > before) {
                return None;
            }
            let [(start, first), (end, last)] = [from, to].map(|r| self.radius(r));
            let slope = (end - start) / (to - from);
            let grows = start > 0.0 && [first, slope, last].into_iter().all(|slope| slope > LEAST_SLOPE * m);
            grows.then_some(Bridge { from, to, start, slope })
        })
    }
}

/// Where the image's radius is a straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bridge {
    /// The tangents of its ends.
    from: f64,
    to: f64,
    /// The radius where it begins.
    start: f64,
    /// By the tangent.
    slope: f64,
}

impl Bridge {
    /// The factor and its slope by s, if that is on the bridge.
    fn at(&self, s: f64) -> Option<(f64, f64)> {
        let r = s.sqrt();
        if r < self.from || r > self.to {
            return None;
        }
        let g = (self.start + self.slope * (r - self.from)) / r;
        Some((g, 0.5 * (self.slope - g) / s))
    }
}

/// Where a pole ends a lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct End {
    /// The last angle with the optical axis \[rad\].
    pub(super) angle: f64,
    /// Whether the image has no end there.
    pub(super) endless: bool,
}

/// What is known of the poles of a fraction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Poles {
    bridges: [Option<Bridge>; 3],
    pub(super) end: Option<End>,
}

impl Poles {
    pub(super) const NONE: Self = Self { bridges: [None; 3], end: None };

    /// Looks for them, up to an angle for what ends the lens \[rad\].
    pub(super) fn of(fraction: &Fraction, most: f64) -> Self {
        let far = MOST.tan().powi(2);
        let mut poles = Self::NONE;
        let mut before = 0.0;
        for (k, pole) in sign_changes(&fraction.below, 0.0, far).into_iter().enumerate() {
            let Some(bridge) = fraction.bridge(pole, before) else {
                poles.end = (pole.sqrt().atan() <= most).then(|| poles.end_before(fraction, pole, far));
                break;
            };
            poles.bridges[k] = Some(bridge);
            before = bridge.to;
        }
        poles
    }

    /// The end that a pole at s is. Where no zero follows it, the image grows to it without end. With a zero up to `far`
    /// there are directions on the other side, too, for each pixel; the pixels from the axis on are those that would be before
    /// the pole if neither were there.
    fn end_before(&self, fraction: &Fraction, pole: f64, far: f64) -> End {
        let (e, _) = fraction.beside(pole);
        let (at, angle) = (pole.sqrt(), pole.sqrt().atan());
        let zero = sign_changes(&fraction.above, pole, far).first().copied();
        match zero {
            Some(zero) if e > 0.0 => {
                // The factor without both, times the tangent.
                let radius = 2.0 * e / at * zero / (zero - pole);
                let before = |angle: f64| {
                    let r = angle.tan();
                    r * self.factor(fraction, r * r).0 <= radius
                };
                End { angle: bisect(0.0, angle, before), endless: false }
            }
            _ => End { angle, endless: e > 0.0 },
        }
    }

    /// The factor and its slope by s.
    pub(super) fn factor(&self, fraction: &Fraction, s: f64) -> (f64, f64) {
        self.bridges.iter().flatten().find_map(|bridge| bridge.at(s)).unwrap_or_else(|| fraction.at(s))
    }
}
