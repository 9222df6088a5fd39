//! What can be wrong with properties of environments.

use crate::pattern::PatternError;
use kinetoscope_scene::RenderSceneError;

/// A property cannot be drawn or set.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RandomizationError {
    /// The patterns of a property match nothing, or one name twice.
    #[error("{property}: {error}")]
    Pattern {
        /// The property.
        property: &'static str,
        /// What is wrong.
        #[source]
        error: Box<PatternError>,
    },
    /// The ends of a range are not finite, or the first is the larger one.
    #[error("{property} of {pattern:?}: the range {low}..{high} must have finite ends, the smaller one first")]
    Range {
        /// The property.
        property: &'static str,
        /// Whose.
        pattern: String,
        /// First end.
        low: f64,
        /// Second end.
        high: f64,
    },
    /// A value is not one that the property can have.
    #[error("environment {env}: {property} of {name:?} would be {value:?}; {expected}")]
    Value {
        /// The environment.
        env: usize,
        /// The property.
        property: &'static str,
        /// Whose.
        name: String,
        /// The value.
        value: Vec<f64>,
        /// What would be right.
        expected: &'static str,
    },
    /// Gains or limits of a drive with an explicit model are not right for the model.
    #[error("environment {env}: what the drive of {name:?} would have is not right for its model: {expected}")]
    Model {
        /// The environment.
        env: usize,
        /// The joint.
        name: String,
        /// What is wrong, and what would be right.
        expected: String,
    },
    /// The size of what is called so is no property: a mesh, a plane or a height field.
    #[error("the size of {name:?} cannot differ between environments: {reason}")]
    Unsized {
        /// Whose.
        name: String,
        /// Why, and what to do.
        reason: &'static str,
    },
    /// Another number of numbers than the property has.
    #[error("{property} of {name:?} is {expected} numbers, not {found}")]
    Width {
        /// The property.
        property: &'static str,
        /// Whose.
        name: String,
        /// How many were given.
        found: usize,
        /// How many it has.
        expected: usize,
    },
    /// What an environment would look like cannot be drawn.
    #[error("environment {env} cannot be drawn as it would be: {error}")]
    Look {
        /// The environment.
        env: usize,
        /// What is wrong.
        #[source]
        error: RenderSceneError,
    },
    /// MuJoCo 4.x keeps only the diagonal of the inertia matrix of a body that moves freely with its centre of mass in its
    /// origin: there is no room for another centre of mass.
    #[error(
        "environment {env}: the centre of mass of {name:?} cannot be moved: it is nominally in the origin, and MuJoCo 4.x \
         keeps only the diagonal of such a body's inertia matrix; give the body a nominal centre of mass beside its origin"
    )]
    DiagonalInertia {
        /// The environment.
        env: usize,
        /// The body.
        name: String,
    },
}
