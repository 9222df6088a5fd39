//! Errors of convex hulls.

use super::InvalidMesh;

/// Error of a convex hull or of convex pieces.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HullError {
    /// A field of the configuration is out of its range.
    #[error("HullCfg::{field} is {value}; expected {expected}")]
    InvalidCfg {
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: f64,
        /// Accepted values.
        expected: &'static str,
    },
    /// A field of the configuration of convex pieces is out of its range.
    #[error("ConvexDecompositionCfg::{field} is {value}; expected {expected}")]
    InvalidDecomposition {
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: f64,
        /// Accepted values.
        expected: &'static str,
    },
    /// The thickness of prisms is not positive and finite.
    #[error("the thickness of prisms is {value} m; expected a length above 0")]
    InvalidThickness {
        /// The thickness \[m\].
        value: f64,
    },
    /// A mesh violates an invariant of its type.
    #[error("{source}")]
    Mesh {
        /// The violation.
        source: InvalidMesh,
    },
    /// A mesh has too many triangles to be cut into convex pieces.
    #[error(
        "{found} triangles; convex decomposition supports at most {most}: simplify the mesh, or use its convex hull \
         for collisions"
    )]
    TooManyTriangles {
        /// Number of triangles.
        found: usize,
        /// Largest accepted number.
        most: usize,
    },
    /// No triangle of a mesh has an area.
    #[error("none of {triangles} triangles has an area")]
    NoArea {
        /// Number of triangles.
        triangles: usize,
    },
    /// Fewer than four points.
    #[error("{found} points; a hull needs at least 4")]
    TooFewPoints {
        /// Number of points.
        found: usize,
    },
    /// A coordinate is infinite or not a number.
    #[error("point {index} is {value:?}; expected finite coordinates")]
    NonFinite {
        /// Index of the point among the given ones.
        index: usize,
        /// Coordinates of the point \[m\].
        value: [f32; 3],
    },
    /// All points are the same.
    #[error("all {count} points coincide")]
    Coincident {
        /// Number of points.
        count: usize,
    },
    /// All points are on a line, within the tolerance.
    #[error(
        "the points are collinear: their largest distance from a line is {deviation:e} m, the tolerance is \
         {tolerance:e} m"
    )]
    Collinear {
        /// Largest distance from the line \[m\].
        deviation: f64,
        /// The tolerance \[m\].
        tolerance: f64,
    },
    /// All points are in a plane, within the tolerance, and were not thickened: no thickness is configured, the
    /// thickness is too small for single precision, or the points belong to a closed mesh to decompose.
    #[error(
        "the points are coplanar: their largest distance from a plane is {deviation:e} m, the tolerance is \
         {tolerance:e} m; set HullCfg::min_thickness to thicken them"
    )]
    Coplanar {
        /// Largest distance from the plane \[m\].
        deviation: f64,
        /// The tolerance \[m\].
        tolerance: f64,
    },
}
