//! SVG output.

use super::layout::{Anchor, Curve, Label, PlotLayout};
use std::fmt::Write as _;

/// Formats a drawing as an SVG document.
pub(super) fn document(drawing: &PlotLayout) -> String {
    let PlotLayout { size: [width, height], frame: [left, top, right, bottom], grid, labels, curves, legend_lines } =
        drawing;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"monospace\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    // Writing to a `String` does not fail.
    for [from, to] in grid {
        let _ = writeln!(out, "<path d=\"M{} L{}\" stroke=\"#ddd\"/>", point(from), point(to));
    }
    let (w, h) = (right - left, bottom - top);
    let _ = writeln!(
        out,
        "<rect x=\"{left:.2}\" y=\"{top:.2}\" width=\"{w:.2}\" height=\"{h:.2}\" fill=\"none\" stroke=\"black\"/>"
    );
    for Curve { color, polylines, markers } in curves {
        let color = hex(*color);
        for piece in polylines {
            match &piece[..] {
                [[x, y]] => {
                    let _ = writeln!(out, "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"2\" fill=\"{color}\"/>");
                }
                piece => {
                    let points: Vec<String> = piece.iter().map(point).collect();
                    let points = points.join(" ");
                    let _ = writeln!(
                        out,
                        "<polyline fill=\"none\" stroke=\"{color}\" stroke-width=\"1.5\" points=\"{points}\"/>"
                    );
                }
            }
        }
        for [x, y] in markers {
            let _ = writeln!(out, "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"3\" fill=\"{color}\"/>");
        }
    }
    for ([from, to], color) in legend_lines {
        let (from, to, color) = (point(from), point(to), hex(*color));
        let _ = writeln!(out, "<path d=\"M{from} L{to}\" stroke=\"{color}\" stroke-width=\"3\"/>");
    }
    for Label { text, at: [x, y], anchor } in labels.iter().filter(|label| !label.text.is_empty()) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = escaped(text);
        let _ = writeln!(out, "<text x=\"{x:.2}\" y=\"{y:.2}\" text-anchor=\"{anchor}\">{text}</text>");
    }
    out + "</svg>\n"
}

fn point([x, y]: &[f64; 2]) -> String {
    format!("{x:.2},{y:.2}")
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Escapes `&`, `<` and `>`, and removes control characters, most of which XML does not allow.
fn escaped(text: &str) -> String {
    let text: String = text.chars().filter(|c| !c.is_control()).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
