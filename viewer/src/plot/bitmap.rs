//! Rasterization of plots.

use crate::scene_view::Canvas;
use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::mono_font::iso_8859_1::FONT_7X13;
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::text::{Alignment, Baseline, Text, TextStyleBuilder};
use kinetoscope_plot::{Anchor, Curve, Label, PlotLayout};

const GRAY: [u8; 3] = [221; 3];
const BLACK: [u8; 3] = [0; 3];
/// Half the width of a curve \[pixels\].
const CURVE_HALF_WIDTH: f64 = 0.75;

/// Rasterizes a plot.
pub(super) fn rasterize(drawing: &PlotLayout) -> Canvas {
    let PlotLayout { size: [width, height], frame: [left, top, right, bottom], grid, labels, curves, legend_lines } =
        drawing;
    let mut canvas = Canvas::new(*width, *height);
    canvas.bytes_mut().fill(255);
    let mut pen = LineRasterizer { coverage: vec![0; width * height], touched: Vec::new(), size: [*width, *height] };
    for [from, to] in grid {
        pen.add_line(*from, *to, 0.5);
    }
    pen.composite(&mut canvas, GRAY);
    for Curve { color, polylines, markers } in curves {
        for piece in polylines {
            for pair in piece.windows(2) {
                pen.add_line(pair[0], pair[1], CURVE_HALF_WIDTH);
            }
            if let [one] = piece[..] {
                pen.add_line(one, one, 2.0);
            }
        }
        for mark in markers {
            pen.add_line(*mark, *mark, 3.0);
        }
        pen.composite(&mut canvas, *color);
    }
    let corners = [[*left, *top], [*right, *top], [*right, *bottom], [*left, *bottom]];
    for k in 0..4 {
        pen.add_line(corners[k], corners[(k + 1) % 4], 0.5);
    }
    pen.composite(&mut canvas, BLACK);
    for ([from, to], color) in legend_lines {
        pen.add_line(*from, *to, 1.5);
        pen.composite(&mut canvas, *color);
    }
    for label in labels {
        draw_label(&mut canvas, label);
    }
    canvas
}

fn draw_label(canvas: &mut Canvas, Label { text, at, anchor }: &Label) {
    let alignment = match anchor {
        Anchor::Start => Alignment::Left,
        Anchor::Middle => Alignment::Center,
        Anchor::End => Alignment::Right,
    };
    let style = TextStyleBuilder::new().alignment(alignment).baseline(Baseline::Alphabetic).build();
    let [x, y] = at.map(|x| x.round() as i32);
    let Ok(_) = Text::with_text_style(text, Point::new(x, y), MonoTextStyle::new(&FONT_7X13, Rgb888::BLACK), style)
        .draw(canvas);
}

/// Draws antialiased lines. The coverage of all lines of one curve is collected first, so that crossings are not
/// darker.
struct LineRasterizer {
    /// Coverage of each pixel, 0 to 255.
    coverage: Vec<u8>,
    touched: Vec<usize>,
    size: [usize; 2],
}

impl LineRasterizer {
    /// Adds a line of width 2 `half` \[pixels\]. Coverage falls off linearly over one pixel at the edges.
    fn add_line(&mut self, from: [f64; 2], to: [f64; 2], half: f64) {
        let way = [to[0] - from[0], to[1] - from[1]];
        let length = way[0].hypot(way[1]);
        // Points of a plot are inside its frame, so a line is at most as long as the image.
        let steps = length.ceil().clamp(1.0, 1e5) as u32;
        let reach = (half + 1.0).ceil() as i64;
        let mut last = None;
        for k in 0..=steps {
            let t = f64::from(k) / f64::from(steps);
            let near = [0, 1].map(|axis| (from[axis] + t * way[axis]).floor() as i64);
            if last == Some(near) {
                continue;
            }
            last = Some(near);
            for y in near[1] - reach..=near[1] + reach {
                for x in near[0] - reach..=near[0] + reach {
                    let center = [x as f64 + 0.5 - from[0], y as f64 + 0.5 - from[1]];
                    let along = if length > 0.0 {
                        ((center[0] * way[0] + center[1] * way[1]) / (length * length)).clamp(0.0, 1.0)
                    } else {
                        0.0
                    };
                    let off = (center[0] - along * way[0]).hypot(center[1] - along * way[1]);
                    self.cover_pixel([x, y], (half + 0.5 - off).clamp(0.0, 1.0));
                }
            }
        }
    }

    fn cover_pixel(&mut self, [x, y]: [i64; 2], share: f64) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        let covered = (255.0 * share).round() as u8;
        if x >= self.size[0] || y >= self.size[1] || covered == 0 {
            return;
        }
        let at = y * self.size[0] + x;
        if self.coverage[at] == 0 {
            self.touched.push(at);
        }
        self.coverage[at] = self.coverage[at].max(covered);
    }

    /// Blends the collected coverage onto the canvas and clears it.
    fn composite(&mut self, canvas: &mut Canvas, color: [u8; 3]) {
        let (pixels, _) = canvas.bytes_mut().as_chunks_mut::<4>();
        for at in self.touched.drain(..) {
            let a = u32::from(std::mem::take(&mut self.coverage[at]));
            for (to, new) in pixels[at].iter_mut().zip(color) {
                *to = ((u32::from(*to) * (255 - a) + u32::from(new) * a + 127) / 255) as u8;
            }
        }
    }
}
