//! Comparison of SVG plots.

/// Attributes with coordinates.
const COORDINATE_ATTRIBUTES: [&str; 6] = ["x", "y", "cx", "cy", "d", "points"];

/// True if two plots are equal except for coordinates that differ by at most `most` pixels. Their texts must be equal,
/// because the tick labels give the scale of the coordinates.
pub(crate) fn agree(a: &str, b: &str, most: f64) -> bool {
    // Parts outside and inside of quotation marks alternate.
    let (a, b): (Vec<&str>, Vec<&str>) = (a.split('"').collect(), b.split('"').collect());
    let is_place = |k: usize| {
        let before = a[k - 1].strip_suffix('=').unwrap_or_default();
        COORDINATE_ATTRIBUTES.contains(&before.rsplit(' ').next().unwrap_or_default())
    };
    a.len() == b.len() && (0..a.len()).all(|k| a[k] == b[k] || k % 2 == 1 && is_place(k) && are_near(a[k], b[k], most))
}

/// True if two texts are equal except for numbers that differ by at most `most`.
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
    use kinetoscope_plot::{Plot, Series};

    fn svg(log_axes: bool, points: &[[f64; 2]]) -> String {
        let plot = Plot { title: "t".into(), axis_labels: ["x".into(), "y".into()], log_axes, ..Plot::default() };
        plot.with(Series::new("a < b", points.iter().copied())).to_svg().expect("a size that can be drawn")
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
        let text = svg(false, &points);
        assert!(agree(&text, &text, 0.0));
        // The plot is 448 pixels high for 2 J with margins: 0.004 J are 0.9 pixels.
        let noise = svg(false, &[[0.0, 1.0], [1.0, 3.0], [2.0, 2.004]]);
        assert!(text != noise && agree(&text, &noise, 1.0) && !agree(&text, &noise, 0.1));
        let moved = svg(false, &[[0.0, 1.0], [1.0, 3.0], [2.0, 2.02]]);
        assert!(!agree(&text, &moved, 1.0));
        // The same curve with other values: the same coordinates with other tick labels, for all kinds of axes.
        for (log, by) in [(false, 10.0), (false, 0.1), (true, 10.0)] {
            let [one, other] = [1.0, by].map(|by| svg(log, &points.map(|[x, y]| [x + 1.0, by * y])));
            assert!(!agree(&one, &other, 1.0), "{one} and {other}");
        }
        for (what, instead) in
            [("a &lt; b", "a &lt; c"), (">t<", ">1<"), ("#0072b2", "#0073b2"), ("-width=\"1.5", "-width=\"2")]
        {
            assert!(text.contains(what), "{what}");
            assert!(!agree(&text, &text.replace(what, instead), 1.0), "{what}");
        }
        assert!(!agree(&text, &svg(false, &points[..2]), 1.0), "a point less");
    }
}
