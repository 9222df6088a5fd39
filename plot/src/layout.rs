//! Layout of a plot: positions of lines and texts in pixels.

use super::Plot;
use super::axis::Axis;
use super::decimate::decimate_m4;

/// The geometry of a plot, in pixels from the top left corner.
#[derive(Clone, Debug, PartialEq)]
pub struct PlotLayout {
    /// Width and height.
    pub size: [usize; 2],
    /// Left, top, right and bottom of the frame.
    pub frame: [f64; 4],
    /// Lines of the grid, each from one end to the other.
    pub grid: Vec<[[f64; 2]; 2]>,
    /// All texts: tick labels, title, axis labels and legend.
    pub labels: Vec<Label>,
    /// The curves, one for each series, in the same order.
    pub curves: Vec<Curve>,
    /// Line samples of the legend, with their colors; fewer than the curves if the legend has no room.
    pub legend_lines: Vec<([[f64; 2]; 2], [u8; 3])>,
}

/// A text at a position.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// The text.
    pub text: String,
    /// A point on the baseline of the text \[pixels\].
    pub at: [f64; 2],
    /// Horizontal alignment of the text at that point.
    pub anchor: Anchor,
}

/// Horizontal alignment of a text at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Anchor {
    /// The text starts at the position.
    Start,
    /// The text is centered at the position.
    Middle,
    /// The text ends at the position.
    End,
}

/// A curve as polylines, broken at gaps.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Color as red, green, blue.
    pub color: [u8; 3],
    /// Points of each polyline \[pixels\], reduced to those that differ in the image. A polyline of one point is drawn
    /// as a dot.
    pub polylines: Vec<Vec<[f64; 2]>>,
    /// Positions of the markers \[pixels\]; empty without [`Plot::markers`].
    pub markers: Vec<[f64; 2]>,
}

/// Colors of curves. The first seven are distinguishable with any color vision; the others differ from these and from
/// each other in hue or lightness. Source of the seven: Okabe and Ito, Color Universal Design.
const COLORS: [[u8; 3]; 24] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [0, 0, 0],
    [140, 20, 20],
    [120, 60, 200],
    [120, 120, 120],
    [100, 140, 0],
    [255, 110, 130],
    [0, 60, 80],
    [150, 90, 40],
    [220, 0, 150],
    [0, 200, 190],
    [60, 90, 255],
    [20, 90, 20],
    [170, 150, 230],
    [190, 190, 90],
    [90, 0, 90],
    [255, 60, 40],
    [110, 200, 90],
    [190, 170, 160],
];
/// Width and height of a character \[pixels\].
const CHAR_SIZE: [f64; 2] = [7.0, 13.0];
/// Length of a line sample of the legend \[pixels\].
const LEGEND_LINE: f64 = 24.0;
const GAP: f64 = 8.0;
const TOP: f64 = 46.0;
const BOTTOM: f64 = 46.0;

impl PlotLayout {
    pub(super) fn of(plot: &Plot) -> Self {
        let [width, height] = plot.size.map(|n| n as f64);
        let shown = |p: &&[f64; 2]| p.iter().all(|x| x.is_finite() && (!plot.log_axes || *x > 0.0));
        let values = |k: usize| plot.series.iter().flat_map(|s| &s.points).filter(shown).map(move |p| p[k]);
        let letters = plot.series.iter().map(|s| s.name.chars().count()).max().unwrap_or(0);
        let max_chars = (((0.4 * width - LEGEND_LINE - 3.0 * GAP) / CHAR_SIZE[0]) as usize).min(letters);
        let legend_width = if letters == 0 { 0.0 } else { LEGEND_LINE + 2.0 * GAP + CHAR_SIZE[0] * max_chars as f64 };
        let (top, right, bottom) = (TOP, width - 2.0 * GAP - legend_width, height - BOTTOM);
        let y_axis = Axis::new(values(1), plot.log_axes, [bottom, top]);
        let rows = y_axis.ticks();
        let longest = rows.iter().map(|(_, label)| label.len()).max().unwrap_or(0);
        let left = CHAR_SIZE[0] * longest as f64 + 3.0 * GAP;
        let x_axis = Axis::new(values(0), plot.log_axes, [left, right]);
        let mut drawing = Self {
            size: plot.size,
            frame: [left, top, right, bottom],
            grid: Vec::new(),
            labels: Vec::new(),
            curves: Vec::new(),
            legend_lines: Vec::new(),
        };
        for (tick, label) in x_axis.ticks() {
            let x = x_axis.pixel_of(tick);
            drawing.grid.push([[x, bottom], [x, top]]);
            drawing.label(label, [x, bottom + CHAR_SIZE[1] + 3.0], Anchor::Middle);
        }
        for (tick, label) in rows {
            let y = y_axis.pixel_of(tick);
            drawing.grid.push([[left, y], [right, y]]);
            drawing.label(label, [left - GAP, y + 4.0], Anchor::End);
        }
        let middle = (left + right) / 2.0;
        drawing.label(plot.title.clone(), [middle, 18.0], Anchor::Middle);
        drawing.label(plot.axis_labels[0].clone(), [middle, height - GAP], Anchor::Middle);
        drawing.label(plot.axis_labels[1].clone(), [GAP, top - GAP], Anchor::Start);
        let max_entries = ((bottom - top) / (CHAR_SIZE[1] + 3.0)) as usize;
        for (k, series) in plot.series.iter().enumerate() {
            let color = COLORS[k % COLORS.len()];
            let pieces = series.points.split(|p| !shown(&p)).filter(|piece| !piece.is_empty());
            let places =
                |piece: &[[f64; 2]]| piece.iter().map(|p| [x_axis.pixel_of(p[0]), y_axis.pixel_of(p[1])]).collect();
            let polylines: Vec<Vec<[f64; 2]>> = pieces.map(|piece| decimate_m4(places(piece))).collect();
            let markers = if plot.markers { polylines.concat() } else { Vec::new() };
            drawing.curves.push(Curve { color, polylines, markers });
            let [from, y] = [right + GAP, top + (CHAR_SIZE[1] + 3.0) * (k as f64 + 0.5)];
            let more = plot.series.len() - k;
            if k + 1 < max_entries || more == 1 && k < max_entries {
                drawing.legend_lines.push(([[from, y], [from + LEGEND_LINE, y]], color));
                drawing.label(
                    truncate_start(&series.name, max_chars),
                    [from + LEGEND_LINE + GAP, y + 4.0],
                    Anchor::Start,
                );
            } else if k + 1 == max_entries {
                drawing.label(format!("and {more} more"), [from, y + 4.0], Anchor::Start);
            }
        }
        drawing
    }

    fn label(&mut self, text: String, at: [f64; 2], anchor: Anchor) {
        self.labels.push(Label { text, at, anchor });
    }
}

/// Shortens a name to `room` characters, dots included, and keeps its end, where long names usually differ.
fn truncate_start(name: &str, room: usize) -> String {
    let count = name.chars().count();
    if count <= room {
        return name.into();
    }
    let end = name.chars().skip(count - room.saturating_sub(3));
    ["..".chars(), ".".chars()].into_iter().flatten().take(room).chain(end).collect()
}
