//! Errors of lenses and intrinsics.

/// An error of a lens, of intrinsics, or of the rays through a lens.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OpticsError {
    /// A number of a lens or of intrinsics is out of its range.
    #[error("{what} of the lens is {value}; it must be {allowed}")]
    Lens {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Accepted values.
        allowed: &'static str,
    },
    /// The mapping of a lens folds back on itself, or has a pole, before the edge of the image or the lens's largest
    /// angle: pixels would have two directions.
    #[error(
        "the mapping of the {lens} lens cannot be inverted: it folds back, or approaches a pole, {:.2} degrees from the optical \
         axis, at radius {radius:.4} of the normalized image (times fx: in pixels), but {requirement}; check the coefficients, \
         reduce the image size, or limit the lens with max_angle",
        .angle.to_degrees()
    )]
    LensFolds {
        /// Name of the lens.
        lens: &'static str,
        /// Angle from the optical axis where the mapping first folds back or nears a pole, over all directions \[rad\].
        angle: f64,
        /// Distance of that angle from the principal point in the normalized image (times fx: in pixels).
        radius: f64,
        /// Pixel or `max_angle` beyond the fold, as text for the message.
        requirement: String,
    },
    /// No pixel of the image lies in the domain of the lens.
    #[error("no pixel of the image is in the domain of the {lens} lens; check the intrinsics and max_angle")]
    NoVisiblePixel {
        /// Name of the lens.
        lens: &'static str,
    },
    /// The rays of the given intrinsics of a lens do not fit into memory.
    #[error("the lens rays of {tables} different intrinsics need {bytes} bytes of memory; the limit is {limit} bytes")]
    LensMemory {
        /// Number of different intrinsics, up to the first whose rays do not fit.
        tables: usize,
        /// Memory that their rays need \[bytes\].
        bytes: usize,
        /// Allowed memory \[bytes\].
        limit: usize,
    },
    /// A matrix that is not the intrinsic matrix of a pinhole camera.
    #[error("an intrinsic matrix is [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]; row {row}, column {column} is {value}")]
    IntrinsicMatrix {
        /// Row, counted from 0.
        row: usize,
        /// Column, counted from 0.
        column: usize,
        /// Value of that element.
        value: f64,
    },
}
