//! Ray caster errors.

use kinetoscope_render::OpticsError;

/// Error returned when a ray caster is built from an invalid configuration, pattern or scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RayError {
    /// A number of a pattern or of the configuration is invalid.
    #[error("{what} of the {owner} is {value}; it must be {allowed}")]
    Number {
        /// Name of the number.
        what: &'static str,
        /// Pattern or sensor that the number belongs to.
        owner: &'static str,
        /// Value of the number.
        value: f64,
        /// Accepted values.
        allowed: &'static str,
    },
    /// A pattern has no rays, or too many.
    #[error("the {pattern} pattern has {count:e} rays; it must have between 1 and {limit}")]
    Count {
        /// Name of the pattern.
        pattern: &'static str,
        /// Number of rays; exceeds the range of integers for some parameters.
        count: f64,
        /// Maximum number of rays.
        limit: usize,
    },
    /// The numbers of ray origins and directions differ.
    #[error("a custom pattern has {starts} starts and {directions} directions; the two numbers must be equal")]
    Lengths {
        /// Number of origins.
        starts: usize,
        /// Number of directions.
        directions: usize,
    },
    /// A ray has no direction, or a number that is not finite.
    #[error(
        "ray {ray} of the {pattern} pattern has the origin {start:?} and the direction {direction:?}; a ray needs finite \
         numbers and a direction other than zero"
    )]
    Ray {
        /// Name of the pattern.
        pattern: &'static str,
        /// Index of the ray in the pattern.
        ray: usize,
        /// Origin in the frame of the sensor \[m\].
        start: [f64; 3],
        /// Direction in the axes of the sensor.
        direction: [f64; 3],
    },
    /// The rays of all environments do not fit into memory, or their number of bytes exceeds the limit.
    #[error("{envs} environments with {rays} rays each do not fit into memory (at most {limit} bytes)")]
    Memory {
        /// Number of environments.
        envs: usize,
        /// Rays per environment.
        rays: usize,
        /// Memory limit \[bytes\].
        limit: u64,
    },
    /// The intrinsics of a pattern are invalid.
    #[error(transparent)]
    Intrinsics(#[from] OpticsError),
    /// The ray caster was built without a scene.
    #[error("the ray caster was built without a scene")]
    NoScene,
}
