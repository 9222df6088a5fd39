//! Plots of numbers over time: joints that follow their targets, forces, whatever a sensor has seen.
//!
//! ```no_run
//! use kinetoscope_viewer::plot::{Plot, Series};
//!
//! let swing = (0..200).map(|k| 0.01 * f64::from(k)).map(|t| [t, (3.0 * t).sin()]);
//! let plot = Plot::over_time("pendulum", "angle [rad]").with(Series::new("hinge", swing));
//! plot.write("pendulum.svg")?;
//! plot.write("pendulum.png")?;
//! # Ok::<(), kinetoscope_viewer::plot::PlotError>(())
//! ```
//!
//! Both files show the same lines at the same places. Letters are drawn from a table in the program or named by their family:
//! no font is looked for, and a plot is the same on every machine.

mod axis;
mod bitmap;
mod layout;
mod svg;
mod thin;

use crate::file_extension;
use crate::stage::Canvas;
use kinetoscope_scene::AtomicFile;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// What the legend calls it.
    pub name: String,
    /// Points in the order in which the line goes through them, each in the units of the two axes. At one that is not finite the
    /// line is broken.
    pub points: Vec<[f64; 2]>,
}

impl Series {
    /// A curve through points.
    pub fn new(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self { name: name.into(), points: points.into_iter().collect() }
    }
}

/// A plot: some curves in one frame, with a legend beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// What stands above it.
    pub title: String,
    /// What the horizontal and the vertical axis show, with units.
    pub axes: [String; 2],
    /// The curves.
    pub series: Vec<Series>,
    /// Pixels per row, rows.
    pub size: [usize; 2],
}

impl Default for Plot {
    fn default() -> Self {
        Self { title: String::new(), axes: Default::default(), series: Vec::new(), size: [960, 540] }
    }
}

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
    #[error("a plot of {width} x {height} pixels: {least} to {most} would do for both")]
    Size {
        /// Pixels per row.
        width: usize,
        /// Rows.
        height: usize,
        /// The smallest side.
        least: usize,
        /// The largest one.
        most: usize,
    },
    /// The file cannot be written.
    #[error("{path}: {error}")]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        error: Arc<std::io::Error>,
    },
}

/// Shortest and longest side \[pixels\].
const SIDES: [usize; 2] = [200, 16384];

impl Plot {
    /// A plot of something over time \[s\]; `what` is what the curves are, with its unit.
    pub fn over_time(title: impl Into<String>, what: impl Into<String>) -> Self {
        Self { title: title.into(), axes: ["time [s]".into(), what.into()], ..Self::default() }
    }

    /// The same with one more curve.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// As SVG text.
    ///
    /// # Errors
    /// [`PlotError::Size`].
    pub fn to_svg(&self) -> Result<String, PlotError> {
        Ok(svg::text(&self.drawing()?))
    }

    /// As a picture.
    ///
    /// # Errors
    /// [`PlotError::Size`].
    pub fn to_canvas(&self) -> Result<Canvas, PlotError> {
        Ok(bitmap::picture(&self.drawing()?))
    }

    /// Writes it to a file, as the end of its name says: `.svg` or `.png`. A file of that name is replaced, when the new one is
    /// whole.
    ///
    /// # Errors
    /// [`PlotError::Extension`], [`PlotError::Size`], [`PlotError::File`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), PlotError> {
        let path = path.as_ref();
        let end = file_extension::lower_case(path);
        let bytes = match end.as_str() {
            "svg" => Ok(self.to_svg()?.into_bytes()),
            "png" => self.to_canvas()?.to_png(),
            _ => return Err(PlotError::Extension { path: path.into(), end }),
        };
        let written = bytes.and_then(|bytes| AtomicFile::write(path, &bytes));
        written.map_err(|error| PlotError::File { path: path.into(), error: Arc::new(error) })
    }

    fn drawing(&self) -> Result<layout::Drawing, PlotError> {
        let ([width, height], [least, most]) = (self.size, SIDES);
        if ![width, height].iter().all(|side| (least..=most).contains(side)) {
            return Err(PlotError::Size { width, height, least, most });
        }
        Ok(layout::Drawing::of(self))
    }
}

#[cfg(test)]
mod tests;
