//! Line plots as SVG text, or as lines and texts in pixels for other output formats.
//!
//! ```
//! use kinetoscope_plot::{Plot, Series};
//!
//! let swing = (0..200).map(|k| 0.01 * f64::from(k)).map(|t| [t, (3.0 * t).sin()]);
//! let plot = Plot::over_time("pendulum", "angle [rad]").with(Series::new("hinge", swing));
//! assert!(plot.to_svg()?.starts_with("<svg"));
//! # Ok::<(), kinetoscope_plot::SizeError>(())
//! ```
//!
//! All characters have the same assumed width, independent of fonts, so that a plot is the same on every machine.
//!
//! | module | content |
//! |---|---|
//! | `axis` | linear and logarithmic axes, ticks |
//! | `layout` | positions of lines and texts: [`PlotLayout`] |
//! | `decimate` | reduction of long curves to what is visible |
//! | `svg` | SVG output |
#![forbid(unsafe_code)]

mod axis;
mod decimate;
mod layout;
mod svg;

pub use layout::{Anchor, Curve, Label, PlotLayout};
use std::fmt;

/// A curve with a name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points of the line in drawing order, in the units of the two axes. The line is broken at a point that is not
    /// finite. On logarithmic axes it is also broken at a point with a coordinate that is not positive.
    pub points: Vec<[f64; 2]>,
}

impl Series {
    /// Creates a curve through points.
    pub fn new(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self { name: name.into(), points: points.into_iter().collect() }
    }
}

/// A plot of curves with a legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Title above the frame.
    pub title: String,
    /// Labels of the horizontal and the vertical axis, with units.
    pub axis_labels: [String; 2],
    /// True if both axes are logarithmic.
    pub log_axes: bool,
    /// True for markers at the points. Of consecutive points in one column of pixels, only the first, lowest, highest
    /// and last have markers.
    pub markers: bool,
    /// The curves.
    pub series: Vec<Series>,
    /// Width and height \[pixels\].
    pub size: [usize; 2],
}

impl Default for Plot {
    fn default() -> Self {
        Self {
            title: String::new(),
            axis_labels: Default::default(),
            log_axes: false,
            markers: false,
            series: Vec::new(),
            size: [960, 540],
        }
    }
}

/// Error of a plot whose width or height is outside the supported range.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SizeError {
    /// Requested width \[pixels\].
    pub width: usize,
    /// Requested height \[pixels\].
    pub height: usize,
    /// Smallest supported width and height \[pixels\].
    pub min_size: usize,
    /// Largest supported width and height \[pixels\].
    pub max_size: usize,
}

impl fmt::Display for SizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height, min_size, max_size } = self;
        write!(f, "a plot of {width} x {height} pixels: both must be from {min_size} to {max_size}")
    }
}

impl std::error::Error for SizeError {}

/// Smallest and largest supported width and height \[pixels\].
const SIZE_RANGE: [usize; 2] = [200, 16384];

impl Plot {
    /// Creates an empty plot over time \[s\]; `label` is the label of the vertical axis, with its unit.
    pub fn over_time(title: impl Into<String>, label: impl Into<String>) -> Self {
        Self { title: title.into(), axis_labels: ["time [s]".into(), label.into()], ..Self::default() }
    }

    /// Adds a curve.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Returns the plot as an SVG document.
    ///
    /// # Errors
    /// The width or the height is below 200 or above 16384 pixels.
    pub fn to_svg(&self) -> Result<String, SizeError> {
        Ok(svg::document(&self.layout()?))
    }

    /// Returns the positions of all lines and texts.
    ///
    /// # Errors
    /// The width or the height is below 200 or above 16384 pixels.
    pub fn layout(&self) -> Result<PlotLayout, SizeError> {
        let ([width, height], [min_size, max_size]) = (self.size, SIZE_RANGE);
        if ![width, height].iter().all(|side| (min_size..=max_size).contains(side)) {
            return Err(SizeError { width, height, min_size, max_size });
        }
        Ok(PlotLayout::of(self))
    }
}

#[cfg(test)]
mod tests;
