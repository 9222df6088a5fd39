//! RGBA image with line and text drawing.

use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::text::{Baseline, Text};
use std::convert::Infallible;

/// An image with four bytes per pixel (red, green, blue, 255), row by row from the top left.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Canvas {
    size: [usize; 2],
    bytes: Vec<u8>,
}

impl Canvas {
    /// Creates a black image of `width` by `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let mut canvas = Self::default();
        canvas.resize(width, height);
        canvas
    }

    /// Creates an image from RGBA bytes, row by row from the top left, such as one environment of a camera's color. All
    /// pixels become opaque. Returns `None` unless there are 4 * width * height bytes.
    pub fn from_rgba(width: usize, height: usize, rgba: &[u8]) -> Option<Self> {
        let mut canvas = Self::new(width, height);
        if rgba.len() != canvas.bytes.len() {
            return None;
        }
        for (to, from) in canvas.bytes.chunks_exact_mut(4).zip(rgba.chunks_exact(4)) {
            to[..3].copy_from_slice(&from[..3]);
        }
        Some(canvas)
    }

    /// Changes the size. If the size differs, all pixels become black; otherwise the content is kept.
    pub fn resize(&mut self, width: usize, height: usize) {
        if self.size != [width, height] {
            self.size = [width, height];
            self.bytes.clear();
            self.bytes.extend([0, 0, 0, 255].repeat(width * height));
        }
    }

    /// Size of the image: pixels per row, rows.
    pub fn dimensions(&self) -> [usize; 2] {
        self.size
    }

    /// RGBA bytes of the image, row by row from the top left.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// RGBA bytes of the image, writable. Callers keep the fourth byte of each pixel at 255.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.bytes
    }

    /// Returns the color of a pixel, or `None` outside the image.
    pub fn pixel(&self, x: usize, y: usize) -> Option<[u8; 3]> {
        let [width, height] = self.size;
        let at = (x < width && y < height).then_some(4 * (y * width + x))?;
        self.bytes.get(at..at + 3).map(|rgb| [rgb[0], rgb[1], rgb[2]])
    }

    /// Sets the color of the pixel in column `x` and row `y`; ignored outside the image.
    pub fn set(&mut self, x: i32, y: i32, color: [u8; 3]) {
        self.blend(x, y, color, 255);
    }

    /// Blends a color into a pixel with an opacity of 0 to 255.
    fn blend(&mut self, x: i32, y: i32, color: [u8; 3], opacity: u8) {
        let [width, height] = self.size;
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x >= width || y >= height {
            return;
        }
        let (at, a) = (4 * (y * width + x), u32::from(opacity));
        for (to, new) in self.bytes[at..at + 3].iter_mut().zip(color) {
            *to = ((u32::from(*to) * (255 - a) + u32::from(new) * a + 127) / 255) as u8;
        }
    }

    /// Fills the rectangle of this width and height \[pixels\] with the top left pixel `[x, y]`, clipped to the image.
    /// An opacity of 255 is opaque.
    pub fn fill(&mut self, [x, y]: [i32; 2], [width, height]: [i32; 2], color: [u8; 3], opacity: u8) {
        let [w, h] = self.size.map(|n| i32::try_from(n).unwrap_or(i32::MAX));
        for row in y.max(0)..y.saturating_add(height).min(h) {
            for column in x.max(0)..x.saturating_add(width).min(w) {
                self.blend(column, row, color, opacity);
            }
        }
    }

    /// Draws a line one pixel wide between two points \[pixels\], clipped to the image; the center of the first pixel
    /// is at (0.5, 0.5). A coordinate that is not finite draws nothing.
    pub fn line(&mut self, from: [f32; 2], to: [f32; 2], color: [u8; 3]) {
        let Some([from, to]) = clip_line(from, to, self.size.map(|n| n as f32)) else { return };
        let delta = [to[0] - from[0], to[1] - from[1]];
        let steps = delta[0].abs().max(delta[1].abs()).ceil().max(1.0);
        for k in 0..=steps as i32 {
            let t = k as f32 / steps;
            self.set((from[0] + t * delta[0]).floor() as i32, (from[1] + t * delta[1]).floor() as i32, color);
        }
    }

    /// Draws text, which may have several lines, with its top left corner at a pixel. A translucent dark background
    /// behind the text extends up to two pixels beyond it.
    pub fn text(&mut self, text: &str, [x, y]: [i32; 2], font: &MonoFont<'_>, color: [u8; 3]) {
        let cell = font.character_size;
        let (columns, lines) = text.lines().fold((0, 0), |(w, n), line| (w.max(line.chars().count()), n + 1));
        let [width, height] = [columns as i32 * cell.width as i32, lines * cell.height as i32];
        self.fill([x - 2, y - 1], [width + 4, height + 2], [20, 22, 26], 150);
        let [r, g, b] = color;
        let style = MonoTextStyle::new(font, Rgb888::new(r, g, b));
        let Ok(_) = Text::with_baseline(text, Point::new(x, y), style, Baseline::Top).draw(self);
    }

    /// Copies `image` into this image, with its top left corner at a pixel, clipped to this image.
    pub fn draw_image(&mut self, image: &Self, [x, y]: [usize; 2]) {
        let [width, height] = self.size;
        let [w, h] = image.size;
        let columns = w.min(width.saturating_sub(x));
        for row in 0..h.min(height.saturating_sub(y)) {
            let (to, from) = (4 * ((y + row) * width + x), 4 * row * w);
            self.bytes[to..to + 4 * columns].copy_from_slice(&image.bytes[from..from + 4 * columns]);
        }
    }
}

/// Clips a line to the image plus a margin of one pixel; `None` if the line is outside or a coordinate is not finite.
/// Source: Liang and Barsky 1984.
fn clip_line(from: [f32; 2], to: [f32; 2], size: [f32; 2]) -> Option<[[f32; 2]; 2]> {
    if from.iter().chain(&to).any(|x| !x.is_finite()) {
        return None;
    }
    let (mut first, mut last) = (0.0f32, 1.0f32);
    for k in 0..2 {
        let delta = to[k] - from[k];
        for (p, q) in [(-delta, from[k] + 1.0), (delta, size[k] + 1.0 - from[k])] {
            if p == 0.0 && q < 0.0 {
                return None;
            } else if p < 0.0 {
                first = first.max(q / p);
            } else if p > 0.0 {
                last = last.min(q / p);
            }
        }
    }
    let at = |t: f32| [0, 1].map(|k| from[k] + t * (to[k] - from[k]));
    (first <= last).then(|| [at(first), at(last)])
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        let [width, height] = self.size.map(|n| u32::try_from(n).unwrap_or(u32::MAX));
        Size::new(width, height)
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, color) in pixels {
            self.set(at.x, at.y, [color.r(), color.g(), color.b()]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_graphics::mono_font::ascii::FONT_6X10;

    #[test]
    fn lines() {
        let mut canvas = Canvas::new(10, 8);
        canvas.line([1.5, 2.5], [7.5, 5.5], [255, 0, 0]);
        assert_eq!([canvas.pixel(1, 2), canvas.pixel(7, 5)], [Some([255, 0, 0]); 2]);
        assert_eq!(canvas.pixel(7, 2), Some([0, 0, 0]));
        // Through the whole image, from far outside; and outside the image.
        canvas.line([-1e6, 3.5], [1e6, 3.5], [0, 255, 0]);
        assert!((0..10).all(|x| canvas.pixel(x, 3) == Some([0, 255, 0])));
        let before = canvas.clone();
        canvas.line([-1e6, -30.0], [1e6, -30.0], [0, 0, 255]);
        canvas.line([f32::NAN, 0.0], [1.0, 1.0], [0, 0, 255]);
        assert_eq!(canvas, before);
    }

    #[test]
    fn letters_and_smallest_images() {
        let rgba = [1, 2, 3, 0, 4, 5, 6, 9];
        let pair = Canvas::from_rgba(2, 1, &rgba).unwrap();
        assert_eq!([pair.pixel(0, 0), pair.pixel(1, 0)], [Some([1, 2, 3]), Some([4, 5, 6])]);
        assert_eq!(pair.bytes()[3], 255);
        assert_eq!(Canvas::from_rgba(1, 1, &rgba), None);
        let mut canvas = Canvas::new(40, 14);
        canvas.text("H", [4, 2], &FONT_6X10, [255; 3]);
        let places = (0..14).flat_map(|y| (0..40).map(move |x| (x, y)));
        let white: Vec<_> = places.filter(|&(x, y)| canvas.pixel(x, y) == Some([255; 3])).collect();
        // Two bars of seven pixels and a bar of three between them.
        assert_eq!(white.len(), 17, "{white:?}");
        assert!(white.iter().all(|&(x, y)| (4..10).contains(&x) && (2..12).contains(&y)));
        for size in [[0, 0], [1, 1], [1, 300]] {
            let mut canvas = Canvas::new(size[0], size[1]);
            canvas.text("Some words\nand more", [-5, -3], &FONT_6X10, [255; 3]);
            canvas.fill([i32::MAX - 1, 0], [i32::MAX, i32::MAX], [1, 2, 3], 255);
            canvas.line([0.0, 0.0], [9.0, 9.0], [9; 3]);
            canvas.draw_image(&Canvas::new(4, 4), [3, 3]);
            assert_eq!(canvas.bytes().len(), 4 * size[0] * size[1]);
        }
    }
}
