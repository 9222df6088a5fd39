//! Comparison within a tolerance that carries its derivation, so that a failure shows the reason for the limit.

use std::borrow::Borrow;

/// A limit on an error, with its derivation: the larger of an absolute and a relative limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Largest absolute error, in the unit of the value.
    pub absolute: f64,
    /// Largest error relative to the expected value.
    pub relative: f64,
    /// Derivation of the numbers: integrator and time step, rounding, resolution.
    pub derivation: &'static str,
}

impl Tolerance {
    /// A limit on the absolute error.
    pub const fn absolute(limit: f64, derivation: &'static str) -> Self {
        Self { absolute: limit, relative: 0.0, derivation }
    }

    /// A limit on the error relative to the expected value.
    pub const fn relative(limit: f64, derivation: &'static str) -> Self {
        Self { absolute: 0.0, relative: limit, derivation }
    }

    /// A limit on the relative error of expected values larger than one, and on the absolute error of smaller ones.
    pub const fn mixed(limit: f64, derivation: &'static str) -> Self {
        Self { absolute: limit, relative: limit, derivation }
    }

    /// Rounding error of `operations` operations in double precision, for values of the expected size, or of size one.
    pub const fn rounding(operations: f64) -> Self {
        Self::mixed(operations * f64::EPSILON, "rounding in double precision")
    }

    /// Largest absolute error of a value: the larger of both limits.
    pub const fn limit(&self, expected: f64) -> f64 {
        self.absolute.max(self.relative * expected.abs())
    }

    /// True if `found` is within the limit of `expected`. Only the same infinity is within the limit of an infinity, and
    /// nothing is within the limit of NaN.
    pub fn holds(&self, found: f64, expected: f64) -> bool {
        found == expected || (expected.is_finite() && (found - expected).abs() <= self.limit(expected))
    }
}

/// Scales the limits by a factor, for example a weight. The derivation remains that of one unit.
impl std::ops::Mul<f64> for Tolerance {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { absolute: self.absolute * factor, relative: self.relative * factor, ..self }
    }
}

/// Asserts that every element is within the tolerance.
#[track_caller]
pub fn assert_close(
    what: &str,
    found: impl IntoIterator<Item = impl Borrow<f64>>,
    expected: impl IntoIterator<Item = impl Borrow<f64>>,
    tolerance: Tolerance,
) {
    let (found, expected): (Vec<f64>, Vec<f64>) =
        (found.into_iter().map(|x| *x.borrow()).collect(), expected.into_iter().map(|x| *x.borrow()).collect());
    assert_eq!(found.len(), expected.len(), "{what}: lengths");
    let failed = (0..found.len()).find(|&k| !tolerance.holds(found[k], expected[k]));
    if let Some(k) = failed {
        let (found, expected) = (found[k], expected[k]);
        panic!(
            "{what}: element {k} is {found:.12e}, expected {expected:.12e}: off by {:.2e}; {tolerance:?}",
            (found - expected).abs()
        );
    }
}

/// Asserts closeness as [`assert_close`] does, with the limit of the largest finite expected element for every element.
#[track_caller]
pub fn assert_vector(
    what: &str,
    found: impl IntoIterator<Item = impl Borrow<f64>>,
    expected: impl IntoIterator<Item = impl Borrow<f64>>,
    tolerance: Tolerance,
) {
    let expected: Vec<f64> = expected.into_iter().map(|x| *x.borrow()).collect();
    // An infinite element must not loosen the limit of the others.
    let finite = expected.iter().filter(|x| x.is_finite());
    let largest = finite.fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let limit = Tolerance::absolute(tolerance.limit(largest), tolerance.derivation);
    assert_close(what, found, &expected, limit);
}

/// Asserts that a number is within the tolerance.
#[track_caller]
pub fn assert_number(what: &str, found: f64, expected: f64, tolerance: Tolerance) {
    assert_close(what, [&found], [&expected], tolerance);
}
