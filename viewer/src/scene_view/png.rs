//! PNG encoding.

use super::canvas::Canvas;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use std::io;

impl Canvas {
    /// Encodes the image as a PNG file in RGBA.
    ///
    /// # Errors
    /// The image has no pixels.
    pub fn to_png(&self) -> io::Result<Vec<u8>> {
        let [width, height] = self.dimensions().map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        let mut file = Vec::new();
        let encoder = PngEncoder::new(&mut file);
        encoder.write_image(self.bytes(), width, height, ExtendedColorType::Rgba8).map_err(io::Error::other)?;
        Ok(file)
    }
}
