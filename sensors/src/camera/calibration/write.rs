//! Writer of ROS calibration files.

use super::{CalibrationError, CameraInfo};
use std::fmt::Write as _;
use std::path::Path;

impl CameraInfo {
    /// Returns the text of a calibration file. Numbers have as many digits as they need to read back with the same
    /// bits.
    pub fn to_yaml(&self) -> String {
        let mut out = String::new();
        let Self { width, height, distortion_model, .. } = self;
        // Writing to a string does not fail.
        let _ =
            writeln!(out, "image_width: {width}\nimage_height: {height}\ncamera_name: {}", quoted_scalar(&self.name));
        let k = self.camera_matrix.transpose();
        write_matrix(&mut out, "camera_matrix", [3, 3], k.as_slice());
        let _ = writeln!(out, "distortion_model: {distortion_model}");
        let d = &self.distortion_coefficients;
        write_matrix(&mut out, "distortion_coefficients", [1, d.len()], d);
        let r = self.rectification_matrix.transpose();
        write_matrix(&mut out, "rectification_matrix", [3, 3], r.as_slice());
        let p = self.projection_matrix.transpose();
        write_matrix(&mut out, "projection_matrix", [3, 4], p.as_slice());
        out
    }

    /// Writes a calibration file; an existing file is replaced.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::File`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), CalibrationError> {
        let path = path.as_ref();
        std::fs::write(path, self.to_yaml())
            .map_err(|error| CalibrationError::File { path: path.into(), error: error.to_string() })
    }
}

/// Writes a matrix, row by row.
fn write_matrix(out: &mut String, name: &str, [rows, cols]: [usize; 2], data: &[f64]) {
    let data: Vec<String> = data.iter().map(|&x| format_number(x)).collect();
    let _ = writeln!(out, "{name}:\n  rows: {rows}\n  cols: {cols}\n  data: [{}]", data.join(", "));
}

/// Formats a number for YAML 1.1 readers too: with a decimal point, and a sign in the exponent.
fn format_number(x: f64) -> String {
    let text = format!("{x:?}");
    let Some((digits, exponent)) = text.split_once('e') else { return text };
    let point = if digits.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{digits}{point}e{sign}{exponent}")
}

/// Words that YAML 1.1 reads as booleans or null, in any case.
const YAML_WORDS: [&str; 9] = ["y", "n", "yes", "no", "on", "off", "true", "false", "null"];

/// Formats a string, quoted unless it is a plain word.
fn quoted_scalar(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
    let is_word = text.chars().all(plain) && text.starts_with(|c: char| c.is_ascii_alphabetic());
    if is_word && !YAML_WORDS.iter().any(|word| text.eq_ignore_ascii_case(word)) {
        return text.into();
    }
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(out, "\\U{:08x}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
