//! What can be wrong with a calibration file.

use crate::camera::CameraError;
use std::path::PathBuf;

/// The fields of a file.
pub(super) const FIELDS: [&str; 8] = [
    "image_width",
    "image_height",
    "camera_name",
    "camera_matrix",
    "distortion_model",
    "distortion_coefficients",
    "rectification_matrix",
    "projection_matrix",
];

/// Why a calibration file cannot be read or written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The file cannot be opened, or not be written.
    #[error("{}: {error}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: String,
    },
    /// It is no YAML, or YAML that no calibration file has.
    #[error("{file}:{line}:{column}: {message}")]
    Yaml {
        /// The file.
        file: String,
        /// Line, counted from 1.
        line: usize,
        /// Column, counted from 1.
        column: usize,
        /// What is wrong.
        message: String,
    },
    /// A field is not there.
    #[error("{file}: {field} is missing; a camera_info file has {}", FIELDS.join(", "))]
    Missing {
        /// The file.
        file: String,
        /// The field.
        field: String,
    },
    /// A field is no good.
    #[error("{file}:{line}: {field} {problem}")]
    Field {
        /// The file.
        file: String,
        /// Line, counted from 1.
        line: usize,
        /// The field.
        field: String,
        /// What is wrong with it, and what would be right.
        problem: String,
    },
    /// A distortion model that nobody knows here.
    #[error("{file}:{line}: there is no distortion model {model:?}; known are {}", .candidates.join(", "))]
    Model {
        /// The file.
        file: String,
        /// Line, counted from 1.
        line: usize,
        /// The model.
        model: String,
        /// Models that exist, nearest first.
        candidates: Vec<&'static str>,
    },
    /// A lens that camera_info has no model for.
    #[error("camera_info cannot say what the {lens} lens does: {reason}")]
    Lens {
        /// The lens.
        lens: &'static str,
        /// Why.
        reason: &'static str,
    },
    /// Numbers that no camera has.
    #[error(transparent)]
    Camera(#[from] CameraError),
}
