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
        let y = top + 16.0 + 16.0 * k as f64;
        let _ = writeln!(
            out,
            "<path d=\"M{} {y}H{}\" stroke=\"{color}\" stroke-width=\"3\"/><text x=\"{}\" y=\"{}\">{}</text>",
            left + 8.0,
            left + 28.0,
            left + 33.0,
            y + 4.0,
            escape(&series.name)
        );
    }
    out + "</svg>\n"
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Whether two texts are the same but for numbers that differ by at most `most`.
pub(crate) fn agree(a: &str, b: &str, most: f64) -> bool {
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
    fn curves_stay_inside_of_the_frame() {
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
    fn logarithms_have_decades_and_no_zeros() {
        let text = svg(&plot(true, &[[1e-3, 1e-9], [1e-2, 1e-5], [1e-1, 0.0]]));
        assert!(text.contains(">1e-3<") && text.contains(">1e-6<"), "{text}");
        assert_eq!(text.matches("<circle").count(), 2);
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    }

    #[test]
    fn nothing_to_draw_is_a_frame() {
        for points in [&[][..], &[[1.0, 2.0]], &[[f64::NAN, 1.0]]] {
            let text = svg(&plot(false, points));
            assert!(text.ends_with("</svg>\n") && !text.contains("NaN"), "{text}");
        }
    }

    #[test]
    fn texts_agree_within_a_pixel() {
        assert!(agree("a 1.0,2.5 b", "a 1.2,2.4 b", 0.5));
        assert!(!agree("a 1.0,2.5 b", "a 1.0,3.5 b", 0.5));
        assert!(!agree("a 1.0,2.5 b", "a 1.0,2.5 c", 0.5));
        assert!(!agree("1 2", "1", 0.5));
        assert!(agree("M-1.5 2", "M-1.4 2", 0.5));
    }
}
