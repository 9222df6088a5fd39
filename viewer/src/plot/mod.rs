//! Plots of numbers over time, such as joint positions and targets, forces, and sensor values.
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
//! Both files show the same lines at the same coordinates. The PNG file uses a built-in bitmap font, and the SVG file
//! names a font family. No system font is loaded, so a plot is the same on every machine.

mod bitmap;

use crate::file_extension;
use crate::scene_view::Canvas;
pub use kinetoscope_plot::{Plot, Series, SizeError};
use kinetoscope_scene::AtomicFile;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An error of plotting.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// The file name extension is neither `.svg` nor `.png`, in upper or lower case.
    #[error("{path}: unsupported plot format .{end}; use a file name that ends in .svg or .png")]
    Extension {
        /// Path of the plot file.
        path: PathBuf,
        /// File name extension, in lower case and without its dot.
        end: String,
    },
    /// The plot is too small to read or too large to draw.
    #[error(transparent)]
    Size(#[from] SizeError),
    /// The file cannot be written.
    #[error("{path}: {error}")]
    File {
        /// Path of the plot file.
        path: PathBuf,
        /// Error of the operating system or of the PNG encoder.
        error: Arc<std::io::Error>,
    },
}

/// Draws a plot as an image.
///
/// # Errors
/// [`PlotError::Size`].
pub fn canvas(plot: &Plot) -> Result<Canvas, PlotError> {
    Ok(bitmap::rasterize(&plot.layout()?))
}

/// Writes a plot to a file in the format of its extension, `.svg` or `.png`. An existing file is replaced once the new
/// file is complete.
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
