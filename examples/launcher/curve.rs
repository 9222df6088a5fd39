//! A line plot of shares between 0 and 1 as an image.

use super::panel::Canvas;
use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::mono_font::ascii::FONT_8X13;
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::{Line, PrimitiveStyle};
use embedded_graphics::text::Text;
use image::{Rgb, RgbImage};

/// Image size (width, height) \[pixels\], and the margins around the plot area: left, top, right, bottom \[pixels\].
const SIZE: [u32; 2] = [640, 360];
const MARGIN: [i32; 4] = [56, 36, 20, 36];

/// Plots numbers over their count from 1 on; the vertical axis is from 0 to 1, and other values are clamped.
pub(crate) fn plot(title: &str, values: &[f64]) -> RgbImage {
    let mut canvas = Canvas(RgbImage::from_pixel(SIZE[0], SIZE[1], Rgb([250, 250, 250])));
    let [left, top, right, bottom] = MARGIN;
    let (width, height) = (SIZE[0] as i32 - left - right, SIZE[1] as i32 - top - bottom);
    let ink = MonoTextStyle::new(&FONT_8X13, Rgb888::new(30, 30, 30));
    let mut line = |from: Point, to: Point, [r, g, b]: [u8; 3], wide: u32| {
        let style = PrimitiveStyle::with_stroke(Rgb888::new(r, g, b), wide);
        let Ok(()) = Line::new(from, to).into_styled(style).draw(&mut canvas);
    };
    let at = |k: usize, value: f64| {
        let along = k as f64 / values.len().saturating_sub(1).max(1) as f64;
        let up = value.clamp(0.0, 1.0);
        Point::new(left + (along * f64::from(width)) as i32, top + height - (up * f64::from(height)) as i32)
    };
    for tick in 0..=4 {
        let y = at(0, f64::from(tick) / 4.0).y;
        line(Point::new(left, y), Point::new(left + width, y), [215, 215, 215], 1);
    }
    for (k, pair) in values.windows(2).enumerate() {
        line(at(k, pair[0]), at(k + 1, pair[1]), [200, 60, 30], 3);
    }
    let mut text = |words: &str, x: i32, y: i32| {
        let Ok(_) = Text::new(words, Point::new(x, y), ink).draw(&mut canvas);
    };
    text(title, left, top - 14);
    for tick in 0..=4 {
        let share = f64::from(tick) / 4.0;
        text(&format!("{share:.2}"), 12, at(0, share).y + 4);
    }
    text("1", left, top + height + 18);
    let last = values.len().to_string();
    text(&last, left + width - 8 * last.len() as i32, top + height + 18);
    canvas.0
}
