//! Errors of calibration files.

use crate::camera::CameraError;
use std::path::PathBuf;

/// Fields of a calibration file.
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

/// Errors of reading or writing a calibration file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The file cannot be read or written.
    #[error("{}: {error}", .path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Message of the operating system.
        error: String,
    },
    /// The text is not valid YAML, or uses YAML that calibration files do not support.
    #[error("{file}:{line}:{column}: {message}")]
    Yaml {
        /// Name of the file.
        file: String,
        /// Line, counted from 1.
        line: usize,
        /// Column, counted from 1.
        column: usize,
        /// The problem.
        message: String,
    },
    /// A field is missing.
    #[error("{file}: {field} is missing; a camera_info file has {}", FIELDS.join(", "))]
    Missing {
        /// Name of the file.
        file: String,
        /// Name of the field.
        field: String,
    },
    /// A field is invalid.
    #[error("{file}:{line}: {field} {problem}")]
    Field {
        /// Name of the file.
        file: String,
        /// Line, counted from 1.
        line: usize,
        /// Name of the field.
        field: String,
        /// The problem, and the accepted values.
        problem: String,
    },
    /// The distortion model is unknown.
    #[error("{file}:{line}: unknown distortion model {model:?}; known models: {}", .candidates.join(", "))]
    Model {
        /// Name of the file.
        file: String,
        /// Line, counted from 1.
        line: usize,
        /// Name of the model.
        model: String,
        /// Known models, nearest first, at most 12.
        candidates: Vec<&'static str>,
    },
    /// The lens has no `camera_info` distortion model.
    #[error("camera_info cannot represent the {lens} lens: {reason}")]
    Lens {
        /// Name of the lens.
        lens: &'static str,
        /// Reason.
        reason: &'static str,
    },
    /// The numbers describe no valid camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
}
