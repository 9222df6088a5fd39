//! Errors of properties of environments.

use crate::pattern::PatternError;
use kinetoscope_scene::RenderSceneError;

/// Error of randomizing or setting a property.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RandomizationError {
    /// A pattern of a property is not a regular expression or matches nothing, or two patterns match the same name.
    #[error("{property}: {error}")]
    Pattern {
        /// Name of the property.
        property: &'static str,
        /// Error of the patterns.
        #[source]
        error: Box<PatternError>,
    },
    /// The ends of a range are not finite, or in the wrong order.
    #[error("{property} of {pattern:?}: the range {low}..{high} must have finite ends, the smaller one first")]
    Range {
        /// Name of the property.
        property: &'static str,
        /// Pattern of the names.
        pattern: String,
        /// First end.
        low: f64,
        /// Second end.
        high: f64,
    },
    /// A value is invalid for the property.
    #[error("environment {env}: {property} of {name:?} would be {value:?}; {expected}")]
    Value {
        /// Index of the environment in the simulation.
        env: usize,
        /// Name of the property.
        property: &'static str,
        /// Name of the element.
        name: String,
        /// Invalid value.
        value: Vec<f64>,
        /// Accepted values.
        expected: &'static str,
    },
    /// Gains or limits of a drive are invalid for its explicit model.
    #[error("environment {env}: the drive model of {name:?} does not accept the new gains or limits: {expected}")]
    Model {
        /// Index of the environment in the simulation.
        env: usize,
        /// Name of the joint.
        name: String,
        /// Problem and accepted values.
        expected: String,
    },
    /// The size of a mesh, a plane or a height field is not a property.
    #[error("the size of {name:?} cannot differ between environments: {reason}")]
    NoSizeProperty {
        /// Name of the element.
        name: String,
        /// Reason and remedy.
        reason: &'static str,
    },
    /// The number of values is not that of the property.
    #[error("{property} of {name:?} needs {expected} numbers, found {found}")]
    Width {
        /// Name of the property.
        property: &'static str,
        /// Name of the element.
        name: String,
        /// Number of values given.
        found: usize,
        /// Number of values of the property.
        expected: usize,
    },
    /// The memory for the own values and models of all environments is not available.
    #[error(
        "properties of {envs} environments need more than {} MiB of memory, which is not available; choose fewer",
        bytes >> 20
    )]
    OutOfMemory {
        /// Number of environments to change.
        envs: usize,
        /// Memory of the changes up to the one that does not fit \[bytes\].
        bytes: usize,
    },
    /// The scene of an environment cannot be rendered.
    #[error("environment {env}: its scene cannot be rendered: {error}")]
    EnvScene {
        /// Index of the environment in the simulation.
        env: usize,
        /// Error of the scene.
        #[source]
        error: RenderSceneError,
    },
    /// The center of mass of a body cannot be moved. MuJoCo 4.x keeps only the diagonal of the inertia matrix of a
    /// freely moving body with its center of mass at its origin.
    #[error(
        "environment {env}: the center of mass of {name:?} cannot be changed: its nominal value is the body's origin, \
         and MuJoCo 4.x stores only the diagonal of such a body's inertia matrix; give the body a nominal center of \
         mass that differs from its origin"
    )]
    DiagonalInertia {
        /// Index of the environment in the simulation.
        env: usize,
        /// Name of the body.
        name: String,
    },
}
