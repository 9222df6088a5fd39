//! Observation terms.

use crate::context::TermContext;
use crate::error::{EnvError, Result, TermKind, TermResult};
use crate::guard::guard;
use crate::space::Space;
use kinetoscope_scene::KeyedRng;
use ndarray::Array2;
use std::fmt;

type Observe = Box<dyn Fn(&TermContext<'_>) -> TermResult<Array2<f64>> + Send>;

/// Noise that is added to every value of an observation term.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Noise {
    /// Normal distribution with mean 0.
    Normal {
        /// Standard deviation, in the unit of the values before scaling.
        std: f64,
    },
    /// Uniform distribution.
    Uniform {
        /// Lower bound, in the unit of the values before scaling.
        low: f64,
        /// Upper bound, in the unit of the values before scaling.
        high: f64,
    },
}

impl Noise {
    fn sample(self, random: &mut KeyedRng) -> f64 {
        match self {
            Self::Normal { std } => std * random.normal(),
            Self::Uniform { low, high } => random.uniform_range(low, high),
        }
    }

    fn is_valid(self) -> bool {
        match self {
            Self::Normal { std } => std.is_finite() && std >= 0.0,
            Self::Uniform { low, high } => low.is_finite() && high.is_finite() && low <= high,
        }
    }
}

/// Observation columns that one function computes. Noise is added to the values first, then they are clipped, then
/// scaled.
pub struct ObservationTerm {
    pub(crate) name: String,
    pub(crate) columns: Vec<String>,
    noise: Option<Noise>,
    clip: [f64; 2],
    scale: f64,
    pub(crate) observe: Observe,
}

impl ObservationTerm {
    /// Creates a term with named columns. `observe` returns the rows of all environments, shape (N, columns).
    ///
    /// It may be called twice in a step, because environments that begin a new episode are observed again. Its result
    /// must therefore depend on its argument only.
    pub fn new<N: Into<String>>(
        name: impl Into<String>,
        columns: impl IntoIterator<Item = N>,
        observe: impl Fn(&TermContext<'_>) -> TermResult<Array2<f64>> + Send + 'static,
    ) -> Self {
        let columns = columns.into_iter().map(Into::into).collect();
        let clip = [f64::NEG_INFINITY, f64::INFINITY];
        Self { name: name.into(), columns, noise: None, clip, scale: 1.0, observe: Box::new(observe) }
    }

    /// Adds noise to the values, drawn anew for each observation. It replaces the noise of an earlier call.
    #[must_use]
    pub fn with_noise(self, noise: Noise) -> Self {
        Self { noise: Some(noise), ..self }
    }

    /// Clips the noisy values to \[low, high\], in their unit before scaling. An infinite value, such as the depth of a
    /// miss, becomes a bound.
    #[must_use]
    pub fn clipped(self, clip: [f64; 2]) -> Self {
        Self { clip, ..self }
    }

    /// Multiplies the clipped values by `scale`, which must be finite and not 0.
    #[must_use]
    pub fn scaled(self, scale: f64) -> Self {
        Self { scale, ..self }
    }

    /// Checks noise, clip and scale, and returns the columns with the bounds after scaling.
    pub(crate) fn space(&self) -> Result<Space> {
        let wrong = |field: &str, value: String, expected| {
            let field = format!("{field} of the observation term {:?}", self.name);
            Err(EnvError::Config { field, value, expected })
        };
        if let Some(noise) = self.noise.filter(|noise| !noise.is_valid()) {
            return wrong(
                "noise",
                format!("{noise:?}"),
                "its numbers must be finite, a deviation >= 0, ranges in order",
            );
        }
        if !(self.scale.is_finite() && self.scale != 0.0) {
            return wrong("scale", self.scale.to_string(), "it must be finite and not 0");
        }
        // Checks the clip as given, so that an error shows the user's numbers and not the scaled ones.
        Space::uniform(self.columns.iter().map(String::as_str), self.clip)?;
        let ends = self.clip.map(|end| self.scale * end);
        let bounds = if self.scale > 0.0 { ends } else { [ends[1], ends[0]] };
        Space::uniform(self.columns.iter().map(String::as_str), bounds)
    }

    /// Computes the raw values of all environments, shape (N, columns).
    pub(crate) fn compute(&self, now: &TermContext<'_>) -> Result<Array2<f64>> {
        let rows = guard(TermKind::Observation, &self.name, || (self.observe)(now))?;
        let expected = vec![now.num_envs(), self.columns.len()];
        if rows.shape() == expected {
            return Ok(rows);
        }
        let (what, found) = (TermKind::Observation.result_label(&self.name), rows.shape().to_vec());
        Err(EnvError::Shape { what, found, expected, meaning: "environments, columns of the term" })
    }

    /// Applies noise, clip and scale to a raw value.
    pub(crate) fn process(&self, value: f64, random: Option<&mut KeyedRng>) -> f64 {
        let noisy = match (self.noise, random) {
            (Some(noise), Some(random)) => value + noise.sample(random),
            _ => value,
        };
        self.scale * noisy.clamp(self.clip[0], self.clip[1])
    }

    /// True if values have noise.
    pub(crate) fn has_noise(&self) -> bool {
        self.noise.is_some()
    }

    /// Error for a processed value that is not finite.
    pub(crate) fn not_finite(&self, env: usize, column: usize, value: f64) -> EnvError {
        let (what, column) = (TermKind::Observation.result_label(&self.name), self.columns[column].clone());
        EnvError::NotFinite { what, env, column, value }
    }
}

impl fmt::Debug for ObservationTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("ObservationTerm");
        out.field("name", &self.name).field("columns", &self.columns).field("noise", &self.noise);
        out.field("clip", &self.clip).field("scale", &self.scale).finish_non_exhaustive()
    }
}
