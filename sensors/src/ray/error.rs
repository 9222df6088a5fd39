//! What can be wrong with a ray caster.

use kinetoscope_render::OpticsError;

/// Why a ray caster cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RayError {
    /// A number of a pattern or of the configuration that makes no sense.
    #[error("{what} of the {of} is {value}; it must be {allowed}")]
    Number {
        /// Which number.
        what: &'static str,
        /// Of what.
        of: &'static str,
        /// The number.
        value: f64,
        /// Accepted values.
        allowed: &'static str,
    },
    /// More rays than fit into memory, or none.
    #[error("the {pattern} pattern has {count:e} rays; it must have between 1 and {limit}")]
    Count {
        /// The kind of pattern.
        pattern: &'static str,
        /// How many rays it has; beyond the range of integers for some parameters.
        count: f64,
        /// The most that is allowed.
        limit: usize,
    },
    /// Starts and directions that do not belong together.
    #[error("a custom pattern has {starts} starts and {directions} directions; give as many of both")]
    Lengths {
        /// How many starts.
        starts: usize,
        /// How many directions.
        directions: usize,
    },
    /// A ray without a direction, or with a number that is not finite.
    #[error(
        "ray {ray} of the {pattern} pattern begins at {start:?} and goes along {direction:?}; a ray needs finite numbers \
             and a direction other than zero"
    )]
    Ray {
        /// The kind of pattern.
        pattern: &'static str,
        /// Which ray.
        ray: usize,
        /// Origin \[m\].
        start: [f64; 3],
        /// Where it goes.
        direction: [f64; 3],
    },
    /// The rays of all environments do not fit into memory.
    #[error("{envs} environments with {rays} rays each do not fit into memory (at most {limit} bytes)")]
    Memory {
        /// How many environments.
        envs: usize,
        /// Rays in each.
        rays: usize,
        /// The most that is allowed.
        limit: u64,
    },
    /// Something is wrong with the lens of a pattern.
    #[error(transparent)]
    Lens(#[from] OpticsError),
    /// There is no scene to cast rays into.
    #[error("the ray caster was built without a scene")]
    NoScene,
}
