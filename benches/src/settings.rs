//! Length and result type of a measurement.

/// The result of a benchmark, or the reason for its failure.
pub(crate) type BenchResult<T> = Result<T, Box<dyn std::error::Error>>;

/// Length of a measurement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Nominal time for one comparison \[s\], without the setup; some benchmarks use a multiple of it.
    pub(crate) seconds: f64,
}
