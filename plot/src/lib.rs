//! Line plots as SVG text, and the places of their lines and letters for other formats.
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
//! Letters have one width that no font decides, so that a plot is the same on every machine.
#![forbid(unsafe_code)]

mod axis;
mod layout;
mod svg;
mod thin;

pub use layout::{Anchor, Curve, Drawing, Label};
use std::fmt;

/// A curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points in the order in which the line goes through them, each in the units of the two axes. At one that is not finite the
    /// line is broken; on logarithmic axes, also at one that is not above 0.
    pub points: Vec<[f64; 2]>,
}

impl Series {
    /// A curve through points.
    pub fn new(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self { name: name.into(), points: points.into_iter().collect() }
    }
}

/// Curves in one frame, with a legend beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Title above the frame.
    pub title: String,
    /// Labels of the horizontal and the vertical axis, with units.
    pub axes: [String; 2],
    /// Makes both axes logarithmic.
    pub log: bool,
    /// Draws a mark at each point.
    pub marks: bool,
    /// The curves.
    pub series: Vec<Series>,
    /// Pixels per row, rows.
    pub size: [usize; 2],
}

impl Default for Plot {
    fn default() -> Self {
        Self {
            title: String::new(),
            axes: Default::default(),
            log: false,
            marks: false,
            series: Vec::new(),
            size: [960, 540],
        }
    }
}

/// A size that is too small to read or too large to draw.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SizeError {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The smallest side.
    pub least: usize,
    /// The largest one.
    pub most: usize,
}

impl fmt::Display for SizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height, least, most } = self;
        write!(f, "a plot of {width} x {height} pixels: {least} to {most} would do for both")
    }
}

impl std::error::Error for SizeError {}

/// Shortest and longest side \[pixels\].
const SIDES: [usize; 2] = [200, 16384];

impl Plot {
    /// A plot of something over time \[s\]; `label` is the label of the vertical axis, with its unit.
    pub fn over_time(title: impl Into<String>, label: impl Into<String>) -> Self {
        Self { title: title.into(), axes: ["time [s]".into(), label.into()], ..Self::default() }
    }

    /// The same with one more curve.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Returns the plot as SVG text.
    ///
    /// # Errors
    /// A side is too short or too long.
    pub fn to_svg(&self) -> Result<String, SizeError> {
        Ok(svg::text(&self.drawing()?))
    }

    /// Returns the places of all lines and letters.
    ///
    /// # Errors
    /// A side is too short or too long.
    pub fn drawing(&self) -> Result<Drawing, SizeError> {
        let ([width, height], [least, most]) = (self.size, SIDES);
        if ![width, height].iter().all(|side| (least..=most).contains(side)) {
            return Err(SizeError { width, height, least, most });
        }
        Ok(Drawing::of(self))
    }
}

#[cfg(test)]
mod tests;
