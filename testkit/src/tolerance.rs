//! Comparison within a tolerance that carries its derivation, so that a failure says why the limit is what it is.

/// A limit on the error, and where the limit comes from.
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
    #[must_use]
    pub const fn absolute(limit: f64, derivation: &'static str) -> Self {
        Self { absolute: limit, relative: 0.0, derivation }
    }

    /// A limit on the error relative to the expected value.
    #[must_use]
    pub const fn relative(limit: f64, derivation: &'static str) -> Self {
        Self { absolute: 0.0, relative: limit, derivation }
    }

    /// The rounding error of `operations` operations in double precision on numbers of the expected size, or of size one.
    #[must_use]
    pub const fn rounding(operations: f64) -> Self {
        let limit = operations * f64::EPSILON;
        Self { absolute: limit, relative: limit, derivation: "rounding in double precision" }
    }

    /// True if `found` is within the limit of `expected`; equal values are, infinities included, and NaN is not.
    #[must_use]
    pub fn holds(&self, found: f64, expected: f64) -> bool {
        found == expected || (found - expected).abs() <= self.absolute.max(self.relative * expected.abs())
    }
}

/// Asserts that every element is within the tolerance.
///
/// # Panics
/// If one is not; the message names `what`, the index, both values, the limit and its derivation.
#[track_caller]
pub fn assert_close<'a>(
    what: &str,
    found: impl IntoIterator<Item = &'a f64>,
    expected: impl IntoIterator<Item = &'a f64>,
    tolerance: Tolerance,
) {
    let (found, expected): (Vec<f64>, Vec<f64>) =
        (found.into_iter().copied().collect(), expected.into_iter().copied().collect());
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
