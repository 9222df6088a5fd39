//! Errors of lenses and intrinsics.

/// An error of a lens, of intrinsics, or of the rays behind a lens.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OpticsError {
    /// The lens has numbers that no lens has.
    #[error("{what} of the lens is {value}; it must be {allowed}")]
    Lens {
        /// Which number.
        what: &'static str,
        /// The number.
        value: f64,
        /// Accepted values.
        allowed: &'static str,
    },
    /// The mapping of a lens folds back on itself, or has a pole, before where the lens is to see: there are two directions for a
    /// pixel.
    #[error(
        "the mapping of the {lens} lens cannot be inverted: it folds back, or nears a pole, {:.2} degrees from the optical axis, at \
         radius {radius:.4} of the normalised picture (times fx: in pixels), and {wanted}; check the coefficients, make the picture \
         smaller, or end the lens before with max_angle",
        .angle.to_degrees()
    )]
    LensFolds {
        /// The lens.
        lens: &'static str,
        /// The angle with the optical axis where it folds back or is about to reach its pole, in the first direction in which it
        /// does \[rad\].
        angle: f64,
        /// How far from the principal point that is, in the normalized image (times fx: in pixels).
        radius: f64,
        /// The part of the image that needs more.
        wanted: String,
    },
    /// Nothing at all is seen through a lens.
    #[error("no pixel of the picture is within what the {lens} lens sees; check the intrinsics and max_angle")]
    LensBlind {
        /// The lens.
        lens: &'static str,
    },
    /// The rays of all kinds of pixels behind a lens do not fit into memory.
    #[error(
        "{tables} different intrinsics behind a lens need {bytes} bytes of rays, which do not fit into memory (at most {limit} \
         bytes)"
    )]
    LensMemory {
        /// How many different intrinsics there are.
        tables: usize,
        /// Memory that they need \[bytes\].
        bytes: usize,
        /// The most that is allowed.
        limit: usize,
    },
    /// A matrix that is not that of a pinhole camera.
    #[error("an intrinsic matrix is [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]; row {row}, column {column} is {value}")]
    IntrinsicMatrix {
        /// Row, counted from 0.
        row: usize,
        /// Column, counted from 0.
        column: usize,
        /// What is there.
        value: f64,
    },
}
