//! Plots of numbers over time: joints that follow their targets, forces, values of sensors.
//!
//! ```no_run
//! use kinetoscope_viewer::plot::{self, Plot, Series};
//!
//! let swing = (0..200).map(|k| 0.01 * f64::from(k)).map(|t| [t, (3.0 * t).sin()]);
//! let pendulum = Plot::over_time("pendulum", "angle [rad]").with(Series::new("hinge", swing));
//! plot::write(&pendulum, "pendulum.svg")?;
//! plot::write(&pendulum, "pendulum.png")?;
//! # Ok::<(), kinetoscope_viewer::plot::PlotError>(())
//! ```
//!
//! Both files show the same lines at the same places. Letters are drawn from a table in the program or named by their family:
//! no font is looked for, and a plot is the same on every machine.

mod bitmap;

use crate::file_extension;
use crate::stage::Canvas;
pub use kinetoscope_plot::{Plot, Series, SizeError};
use kinetoscope_scene::AtomicFile;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A plot cannot be drawn or written.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// The end of the name is of no format.
    #[error("{path}: plots are not written as .{end}; give a name that ends in .svg or .png")]
    Extension {
        /// The file.
        path: PathBuf,
        /// The end of its name.
        end: String,
    },
    /// A size that is too small to read or too large to draw.
    #[error(transparent)]
    Size(#[from] SizeError),
    /// The file cannot be written.
    #[error("{path}: {error}")]
    File {
        /// The file.
        path: PathBuf,
        /// Cause.
        error: Arc<std::io::Error>,
    },
}

/// Draws a plot as an image.
///
/// # Errors
/// [`PlotError::Size`].
pub fn canvas(plot: &Plot) -> Result<Canvas, PlotError> {
    Ok(bitmap::picture(&plot.drawing()?))
}

/// Writes a plot to a file, as the end of its name says: `.svg` or `.png`. A file of that name is replaced, when the new one is
/// whole.
///
/// # Errors
/// [`PlotError::Extension`], [`PlotError::Size`], [`PlotError::File`].
pub fn write(plot: &Plot, path: impl AsRef<Path>) -> Result<(), PlotError> {
    let path = path.as_ref();
    let end = file_extension::lower_case(path);
    let bytes = match end.as_str() {
        "svg" => Ok(plot.to_svg()?.into_bytes()),
        "png" => canvas(plot)?.to_png(),
        _ => return Err(PlotError::Extension { path: path.into(), end }),
    };
    let written = bytes.and_then(|bytes| AtomicFile::write(path, &bytes));
    written.map_err(|error| PlotError::File { path: path.into(), error: Arc::new(error) })
}

#[cfg(test)]
mod tests;
