//! The time of a measurement, and its result.

/// Rows, or the reason why a benchmark has no result.
pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// How long to measure.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Time for one comparison \[s\], setting up not counted.
    pub(crate) seconds: f64,
}
