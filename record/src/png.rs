//! PNG images.

use crate::writer::{WriteError, WriteResult};
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use std::io;

/// Depth units of PNG files (millimeters) in a meter.
const MM_PER_METER: f32 = 1000.0;

/// Encodes PNG files, reusing its buffers.
#[derive(Debug, Default)]
pub(crate) struct PngWriter {
    pixels: Vec<u8>,
    file: Vec<u8>,
}

impl PngWriter {
    /// Encodes RGBA pixels as an RGB PNG file, without their alpha channel. `size` is width and height.
    pub(crate) fn encode_rgb(&mut self, rgba: &[u8], size: [usize; 2]) -> WriteResult<&[u8]> {
        self.pixels.clear();
        for pixel in rgba.as_chunks::<4>().0 {
            self.pixels.extend_from_slice(&pixel[..3]);
        }
        self.encode(size, ExtendedColorType::Rgb8)
    }

    /// Encodes depths \[m\] as a PNG file of 16-bit millimeters. A miss (infinite or NaN) is 0; 65.535 m and more is
    /// 65535. `size` is width and height.
    pub(crate) fn encode_depth(&mut self, depths: &[f32], size: [usize; 2]) -> WriteResult<&[u8]> {
        self.pixels.clear();
        for depth in depths {
            self.pixels.extend_from_slice(&depth_mm(*depth).to_ne_bytes());
        }
        self.encode(size, ExtendedColorType::L16)
    }

    fn encode(&mut self, [width, height]: [usize; 2], color: ExtendedColorType) -> WriteResult<&[u8]> {
        self.file.clear();
        let side = |side: usize| {
            u32::try_from(side).map_err(|_| WriteError::limit("a side of a PNG image has less than 4294967296 pixels"))
        };
        let encoder = PngEncoder::new(&mut self.file);
        encoder.write_image(&self.pixels, side(width)?, side(height)?, color).map_err(io::Error::other)?;
        Ok(&self.file)
    }
}

/// Depth \[m\] in whole millimeters.
fn depth_mm(depth: f32) -> u16 {
    // Larger depths saturate. An infinite depth, a miss, becomes 0.
    if depth.is_finite() { (depth * MM_PER_METER).round() as u16 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_millimeters() {
        let depths = [0.0, 0.0014, 0.0016, 1.0, 65.535, 70.0, f32::INFINITY, f32::NAN];
        assert_eq!(depths.map(depth_mm), [0, 1, 2, 1000, 65535, 65535, 0, 0]);
    }
}
