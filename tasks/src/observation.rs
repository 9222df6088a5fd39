//! What agents see of environments.

use crate::error::{EnvError, Result, TermKind, TermResult};
use crate::now::Now;
use crate::space::Space;
use kinetoscope_scene::Random;
use ndarray::Array2;
use std::fmt;

type Observe = Box<dyn Fn(&Now<'_>) -> TermResult<Array2<f64>> + Send>;

/// Noise that is added to every number of an observation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Noise {
    /// Normal, with mean 0.
    Normal {
        /// Standard deviation, in the unit of the columns.
        std: f64,
    },
    /// Uniform.
    Uniform {
        /// Smallest, in the unit of the columns.
        low: f64,
        /// Largest.
        high: f64,
    },
}

impl Noise {
    fn draw(self, random: &mut Random) -> f64 {
        match self {
            Self::Normal { std } => std * random.normal(),
            Self::Uniform { low, high } => random.between(low, high),
        }
    }

    fn is_good(self) -> bool {
        match self {
            Self::Normal { std } => std.is_finite() && std >= 0.0,
            Self::Uniform { low, high } => low.is_finite() && high.is_finite() && low <= high,
        }
    }
}

/// Columns of the observations. What the function gives gets its noise, is clipped, and scaled, in this order.
pub struct ObservationTerm {
    pub(crate) name: String,
    pub(crate) columns: Vec<String>,
    noise: Option<Noise>,
    clip: [f64; 2],
    scale: f64,
    pub(crate) observe: Observe,
}

impl ObservationTerm {
    /// A term with named columns. `observe` gives rows for all environments, shape (N, columns). It may be called again in
    /// the same step, for environments that begin a new episode: what it gives must depend on what it is shown alone.
    pub fn new<N: Into<String>>(
        name: impl Into<String>,
        columns: impl IntoIterator<Item = N>,
        observe: impl Fn(&Now<'_>) -> TermResult<Array2<f64>> + Send + 'static,
    ) -> Self {
        let columns = columns.into_iter().map(Into::into).collect();
        let clip = [f64::NEG_INFINITY, f64::INFINITY];
        Self { name: name.into(), columns, noise: None, clip, scale: 1.0, observe: Box::new(observe) }
    }

    /// With noise.
    #[must_use]
    pub fn with_noise(self, noise: Noise) -> Self {
        Self { noise: Some(noise), ..self }
    }

    /// Held between two numbers, in the unit of the columns. What is infinite, such as the depth of a miss, becomes one of them.
    #[must_use]
    pub fn clipped(self, clip: [f64; 2]) -> Self {
        Self { clip, ..self }
    }

    /// Multiplied.
    #[must_use]
    pub fn scaled(self, scale: f64) -> Self {
        Self { scale, ..self }
    }

    /// Checks noise, clip and scale; what the columns can be.
    pub(crate) fn space(&self) -> Result<Space> {
        let wrong = |field: &str, value: String, expected| {
            let field = format!("{field} of the observation term {:?}", self.name);
            Err(EnvError::Config { field, value, expected })
        };
        if let Some(noise) = self.noise.filter(|noise| !noise.is_good()) {
            return wrong(
                "noise",
                format!("{noise:?}"),
                "its numbers must be finite, a deviation >= 0, ranges in order",
            );
        }
        if !(self.scale.is_finite() && self.scale != 0.0) {
            return wrong("scale", self.scale.to_string(), "it must be finite and not 0");
        }
        // What the user wrote, before what becomes of it.
        Space::uniform(self.columns.iter().map(String::as_str), self.clip)?;
        let ends = self.clip.map(|end| self.scale * end);
        let bounds = if self.scale > 0.0 { ends } else { [ends[1], ends[0]] };
        Space::uniform(self.columns.iter().map(String::as_str), bounds)
    }

    /// The rows of all environments as the function gives them.
    pub(crate) fn rows(&self, now: &Now<'_>) -> Result<Array2<f64>> {
        let rows = (self.observe)(now).map_err(|e| EnvError::term(TermKind::Observation, &self.name, e))?;
        let expected = vec![now.num_envs(), self.columns.len()];
        if rows.shape() == expected {
            return Ok(rows);
        }
        let (what, found) = (TermKind::Observation.gives(&self.name), rows.shape().to_vec());
        Err(EnvError::Shape { what, found, expected, meaning: "environments, columns of the term" })
    }

    /// What agents see of a number.
    pub(crate) fn seen(&self, value: f64, random: &mut Random) -> f64 {
        let noisy = self.noise.map_or(value, |noise| value + noise.draw(random));
        self.scale * noisy.clamp(self.clip[0], self.clip[1])
    }
}

impl fmt::Debug for ObservationTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("ObservationTerm");
        out.field("name", &self.name).field("columns", &self.columns).field("noise", &self.noise);
        out.field("clip", &self.clip).field("scale", &self.scale).finish_non_exhaustive()
    }
}
