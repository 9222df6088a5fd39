//! Line plots as SVG text: a frame, ticks, curves, a legend. Nothing is measured by fonts, so that the text is the same on
//! every machine.

use std::fmt::Write as _;

/// A curve.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) points: Vec<[f64; 2]>,
}

/// A picture: labels of the axes with units, and whether both are logarithmic. A logarithmic plot leaves out what is not
/// above 0.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plot {
    pub(crate) title: String,
    pub(crate) axes: [String; 2],
    pub(crate) log: bool,
    pub(crate) series: Vec<Series>,
}

const SIZE: [f64; 2] = [560.0, 340.0];
/// Left, top, right and bottom of the frame.
const FRAME: [f64; 4] = [74.0, 34.0, 544.0, 290.0];
/// Colours that people with any eyes tell apart. Source: Okabe and Ito, Color Universal Design.
const COLORS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// One axis: from values to the picture.
#[derive(Clone, Copy, Debug)]
struct Axis {
    log: bool,
    low: f64,
    high: f64,
    /// Where `low` and `high` are in the picture.
    ends: [f64; 2],
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, log: bool, ends: [f64; 2]) -> Self {
        let (mut low, mut high) = (f64::MAX, f64::MIN);
        for value in values {
            let value = if log { value.log10() } else { value };
            (low, high) = (low.min(value), high.max(value));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        if high - low < 1e-12 * high.abs().max(1e-300) {
            (low, high) = (low - 0.5, high + 0.5);
        }
        let margin = 0.04 * (high - low);
        Self { log, low: low - margin, high: high + margin, ends }
    }

    fn place(&self, value: f64) -> f64 {
        let value = if self.log { value.log10() } else { value };
        self.ends[0] + (value - self.low) / (self.high - self.low) * (self.ends[1] - self.ends[0])
    }

    /// Values with a tick: 1, 2 or 5 times a power of ten, four to nine of them; whole decades on a logarithmic axis.
    fn ticks(&self) -> Vec<f64> {
        let span = self.high - self.low;
        let raw = span / 6.0;
        let power = 10.0_f64.powf(raw.log10().floor());
        let mut step = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|s| *s >= raw).unwrap_or(power);
        if self.log {
            step = step.max(1.0).round();
        }
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        let ticks = (first..=last).map(|k| k as f64 * step);
        if self.log { ticks.map(|t| 10.0_f64.powf(t)).collect() } else { ticks.collect() }
    }

    fn label(&self, tick: f64) -> String {
        if self.log {
            return format!("1e{}", tick.log10().round());
        }
        if tick != 0.0 && !(1e-3..1e6).contains(&tick.abs()) {
            return format!("{tick:.1e}");
        }
        // Adding 0 makes -0 a 0.
        let text = format!("{:.6}", tick + 0.0);
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    }
}

/// The picture.
pub(crate) fn svg(plot: &Plot) -> String {
    let shown = |p: &&[f64; 2]| p.iter().all(|x| x.is_finite() && (!plot.log || *x > 0.0));
    let points = |k: usize| plot.series.iter().flat_map(|s| &s.points).filter(shown).map(move |p| p[k]);
    let [left, top, right, bottom] = FRAME;
    let axes = [Axis::new(points(0), plot.log, [left, right]), Axis::new(points(1), plot.log, [bottom, top])];
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        SIZE[0], SIZE[1]
    );
    let middle = (left + right) / 2.0;
    let _ = writeln!(
        out,
        "<text x=\"{middle}\" y=\"20\" text-anchor=\"middle\" font-size=\"14\">{}</text>",
        escape(&plot.title)
    );
    for tick in axes[0].ticks() {
        let x = axes[0].place(tick);
        let _ = writeln!(
            out,
            "<path d=\"M{x:.1} {bottom}V{top}\" stroke=\"#ddd\"/><text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            bottom + 16.0,
            axes[0].label(tick)
        );
    }
    for tick in axes[1].ticks() {
        let y = axes[1].place(tick);
        let _ = writeln!(
            out,
            "<path d=\"M{left} {y:.1}H{right}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 5.0,
            y + 4.0,
            axes[1].label(tick)
        );
    }
    let _ = writeln!(
        out,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"black\"/>\n\
         <text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n\
         <text transform=\"translate(14 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        right - left,
        bottom - top,
        bottom + 36.0,
        escape(&plot.axes[0]),
        (top + bottom) / 2.0,
        escape(&plot.axes[1])
    );
    let mut lines = Vec::new();
    for (k, series) in plot.series.iter().enumerate() {
        let color = COLORS[k % COLORS.len()];
        let places = series.points.iter().filter(shown).map(|p| [axes[0].place(p[0]), axes[1].place(p[1])]);
        let places: Vec<[f64; 2]> = places.collect();
        let line: Vec<String> = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(
            out,
            "<polyline fill=\"none\" stroke=\"{color}\" stroke-width=\"1.5\" points=\"{}\"/>",
            line.join(" ")
        );
        // Few points are measurements, which are to be seen.
        for [x, y] in places.iter().filter(|_| places.len() <= 12) {
            let _ = writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{color}\"/>");
        }
        lines.push(places);
    }
    let size = legend_size(&plot.series);
    let [x, y] = emptiest_corner(size, &lines);
    // On a ground of its own: where no corner is empty, a curve goes behind it.
    let _ = writeln!(
        out,
        "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"white\" stroke=\"#ddd\"/>",
        size[0], size[1]
    );
    for (k, series) in plot.series.iter().enumerate() {
        let (color, row) = (COLORS[k % COLORS.len()], y + ROW * (k as f64 + 0.5) + 2.0);
        let _ = writeln!(
            out,
            "<path d=\"M{:.1} {row:.1}H{:.1}\" stroke=\"{color}\" stroke-width=\"3\"/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            x + 4.0,
            x + 24.0,
            x + 29.0,
            row + 4.0,
            escape(&series.name)
        );
    }
    out + "</svg>\n"
}

/// Height of a row of the legend \[pixels\].
const ROW: f64 = 16.0;
/// Widest that a letter of most names is, of 12 pixels \[pixels\].
const LETTER: f64 = 6.8;
/// From the frame to the legend \[pixels\].
const GAP: f64 = 6.0;

/// Width and height of the legend.
fn legend_size(series: &[Series]) -> [f64; 2] {
    let letters = series.iter().map(|s| s.name.chars().count()).max().unwrap_or(0);
    [33.0 + LETTER * letters as f64, ROW * series.len() as f64 + 4.0]
}

/// Where in the frame something of this size hides least of the lines: the first of the corners where that is so, to 10 pixels of
/// line, so that numbers which differ in their last digits have it in the same corner.
fn emptiest_corner([width, height]: [f64; 2], lines: &[Vec<[f64; 2]>]) -> [f64; 2] {
    let [left, top, right, bottom] = FRAME;
    let [near, far] = [[left + GAP, top + GAP], [right - GAP - width, bottom - GAP - height]];
    let corners = [near, [far[0], near[1]], [near[0], far[1]], far];
    let hidden = |corner: [f64; 2]| {
        // With half a stroke around it.
        let inside =
            |p: [f64; 2]| (0..2).all(|k| p[k] > corner[k] - 2.0 && p[k] < corner[k] + [width, height][k] + 2.0);
        let mut pixels = 0.0;
        for line in lines {
            for pair in line.windows(2) {
                let way = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
                let steps = way[0].hypot(way[1]).ceil().max(1.0);
                let length = way[0].hypot(way[1]) / steps;
                let at = |k: u32| [0, 1].map(|axis| pair[0][axis] + (f64::from(k) + 0.5) / steps * way[axis]);
                pixels += length * (0..steps as u32).filter(|k| inside(at(*k))).count() as f64;
            }
            // Measurements count as much as a stroke of the size of their mark.
            pixels += 6.0 * line.iter().filter(|p| line.len() <= 12 && inside(**p)).count() as f64;
        }
        (pixels / 10.0).ceil() as u64
    };
    let mut best = (hidden(near), near);
    for corner in &corners[1..] {
        let here = hidden(*corner);
        if here < best.0 {
            best = (here, *corner);
        }
    }
    best.1
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Attributes that say where something is in the picture.
const PLACES: [&str; 6] = ["x", "y", "cx", "cy", "d", "points"];

/// Whether two pictures are the same but for places that differ by at most `most` pixels. What is written in them is the same
/// to the letter: the numbers at the ticks say what the places mean.
pub(crate) fn agree(a: &str, b: &str, most: f64) -> bool {
    // Outside and inside of quotation marks in turn.
    let (a, b): (Vec<&str>, Vec<&str>) = (a.split('"').collect(), b.split('"').collect());
    let is_place = |k: usize| {
        let before = a[k - 1].strip_suffix('=').unwrap_or_default();
        PLACES.contains(&before.rsplit(' ').next().unwrap_or_default())
    };
    a.len() == b.len() && (0..a.len()).all(|k| a[k] == b[k] || k % 2 == 1 && is_place(k) && are_near(a[k], b[k], most))
}

/// Whether two texts are the same but for numbers that differ by at most `most`.
fn are_near(a: &str, b: &str, most: f64) -> bool {
    let split = |text: &str| -> (String, Vec<f64>) {
        let (mut rest, mut numbers, mut number) = (String::new(), Vec::new(), String::new());
        for c in text.chars().chain([' ']) {
            if c.is_ascii_digit() || c == '.' || c == '-' && number.is_empty() {
                number.push(c);
                continue;
            }
            match number.parse() {
                Ok(x) => {
                    numbers.push(x);
                    rest.push('#');
                }
                Err(_) => rest.push_str(&number),
            }
            number.clear();
            rest.push(c);
        }
        (rest, numbers)
    };
    let ((a, x), (b, y)) = (split(a), split(b));
    a == b && x.len() == y.len() && x.iter().zip(&y).all(|(x, y)| (x - y).abs() <= most)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(log: bool, points: &[[f64; 2]]) -> Plot {
        let series = vec![Series { name: "a < b".into(), points: points.to_vec() }];
        Plot { title: "t".into(), axes: ["x".into(), "y".into()], log, series }
    }

    #[test]
    fn frame() {
        let text = svg(&plot(false, &[[0.0, -3.0], [1.0, 5.0], [2.0, 1.0]]));
        let line = text.lines().find(|line| line.starts_with("<polyline")).expect("a curve");
        let points = line.split("points=\"").nth(1).expect("its points").trim_end_matches("\"/>");
        for point in points.split(' ') {
            let (x, y) = point.split_once(',').expect("two numbers");
            let [x, y]: [f64; 2] = [x, y].map(|n| n.parse().expect("a number"));
            assert!(x > FRAME[0] && x < FRAME[2] && y > FRAME[1] && y < FRAME[3], "{point}");
        }
        assert!(text.contains("a &lt; b") && text.contains("<circle"), "{text}");
    }

    #[test]
    fn logarithms() {
        let text = svg(&plot(true, &[[1e-3, 1e-9], [1e-2, 1e-5], [1e-1, 0.0]]));
        assert!(text.contains(">1e-3<") && text.contains(">1e-6<"), "{text}");
        assert_eq!(text.matches("<circle").count(), 2);
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    }

    #[test]
    fn no_curves() {
        for points in [&[][..], &[[1.0, 2.0]], &[[f64::NAN, 1.0]]] {
            let text = svg(&plot(false, points));
            assert!(text.ends_with("</svg>\n") && !text.contains("NaN"), "{text}");
        }
    }

    /// Where the ground of the legend is: left, top, width, height.
    fn legend(text: &str) -> [f64; 4] {
        let ground = text.lines().rfind(|line| line.starts_with("<rect")).expect("a ground");
        ["x", "y", "width", "height"].map(|name| {
            let rest = ground.split(&format!(" {name}=\"")).nth(1).expect("an attribute");
            rest.split('"').next().and_then(|n| n.parse().ok()).expect("a number")
        })
    }

    #[test]
    fn legend_place() {
        let [left, top, right, bottom] = FRAME;
        // Through two opposite corners, or with an end in three of them: one is empty, and which one is known.
        let free = [
            (vec![[0.0, 0.0], [1.0, 1.0]], [true, true]),
            (vec![[0.0, 1.0], [1.0, 0.0]], [false, true]),
            (vec![[0.0, 0.0], [0.0, 1.0], [1.0, 1.0]], [false, false]),
            (vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]], [true, false]),
        ];
        for (points, [at_left, at_top]) in free {
            let [x, y, width, height] = legend(&svg(&plot(false, &points)));
            assert_eq!([x - left == GAP, (right - GAP - width - x).abs() < 0.11], [at_left, !at_left], "{points:?}");
            assert_eq!([y - top == GAP, (bottom - GAP - height - y).abs() < 0.11], [at_top, !at_top], "{points:?}");
        }
        // Curves are drawn before it, names after it.
        let text = svg(&plot(false, &[[0.0, 0.0], [1.0, 1.0]]));
        let place = |what: &str| text.rfind(what).expect("is there");
        assert!(
            place("<polyline") < place("fill=\"white\" stroke") && place("fill=\"white\" stroke") < place("a &lt; b")
        );
    }

    #[test]
    fn near_places() {
        assert!(are_near("1.0,2.5 b", "1.2,2.4 b", 0.5));
        assert!(!are_near("1.0,2.5 b", "1.0,3.5 b", 0.5));
        assert!(!are_near("1.0,2.5 b", "1.0,2.5 c", 0.5));
        assert!(!are_near("1 2", "1", 0.5));
        assert!(are_near("M-1.5 2", "M-1.4 2", 0.5));
    }

    #[test]
    fn same_numbers() {
        let points = [[0.0, 1.0], [1.0, 3.0], [2.0, 2.0]];
        let text = svg(&plot(false, &points));
        assert!(agree(&text, &text, 0.0));
        // 256 pixels high and 2 J with their margins: 0.004 J are half a pixel.
        let noise = svg(&plot(false, &[[0.0, 1.0], [1.0, 3.0], [2.0, 2.004]]));
        assert!(text != noise && agree(&text, &noise, 1.0) && !agree(&text, &noise, 0.1));
        let moved = svg(&plot(false, &[[0.0, 1.0], [1.0, 3.0], [2.0, 2.02]]));
        assert!(!agree(&text, &moved, 1.0));
        // The same curve at other numbers: in the same places, with other ticks. On axes of any kind.
        for (log, by) in [(false, 10.0), (false, 0.1), (true, 10.0)] {
            let [one, other] = [1.0, by].map(|by| svg(&plot(log, &points.map(|[x, y]| [x + 1.0, by * y]))));
            assert!(!agree(&one, &other, 1.0), "{one} and {other}");
        }
        for (what, instead) in
            [("a &lt; b", "a &lt; c"), (">t<", ">1<"), ("#0072b2", "#0073b2"), ("-width=\"1.5", "-width=\"2")]
        {
            assert!(text.contains(what), "{what}");
            assert!(!agree(&text, &text.replace(what, instead), 1.0), "{what}");
        }
        assert!(!agree(&text, &svg(&plot(false, &points[..2])), 1.0), "a point less");
    }
}
