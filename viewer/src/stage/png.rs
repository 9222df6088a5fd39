//! Pictures as PNG files.

use super::canvas::Canvas;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use std::io;

impl Canvas {
    /// The picture as a PNG file, red, green, blue and 255 in each pixel.
    ///
    /// # Errors
    /// A picture without pixels.
    pub fn to_png(&self) -> io::Result<Vec<u8>> {
        let [width, height] = self.dimensions().map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        let mut file = Vec::new();
        let encoder = PngEncoder::new(&mut file);
        encoder.write_image(self.bytes(), width, height, ExtendedColorType::Rgba8).map_err(io::Error::other)?;
        Ok(file)
    }
}
