//! Animated GIF: a palette of 256 colors per frame, quantized if necessary, and times in 1/100 s.

use super::{Encoder, Output, check_sides, duration, rgb_of};
use crate::writer::WriteResult;
use gif::{Frame, Repeat};
use std::io::{self, Write};

struct Gif {
    size: [u16; 2],
    /// Writes into memory, which is copied to the file after every frame.
    encoder: Option<gif::Encoder<Vec<u8>>>,
    rgb: Vec<u8>,
}

/// Sampling step of color quantization: 1 uses all pixels, 30 uses few. Larger values are hardly faster and visibly
/// worse.
const SAMPLING_STEP: i32 = 10;

pub(super) fn begin(size: [usize; 2]) -> Result<Box<dyn Encoder>, String> {
    Ok(Box::new(Gif { size: check_sides(size, usize::from(u16::MAX))?, encoder: None, rgb: Vec::new() }))
}

impl Encoder for Gif {
    fn frame(&mut self, out: &mut Output, rgba: &[u8], shown: [f64; 2]) -> WriteResult {
        let [width, height] = self.size;
        if self.encoder.is_none() {
            let mut encoder = gif::Encoder::new(Vec::new(), width, height, &[]).map_err(io::Error::other)?;
            encoder.set_repeat(Repeat::Infinite).map_err(io::Error::other)?;
            self.encoder = Some(encoder);
        }
        let Some(encoder) = &mut self.encoder else { return Ok(()) };
        rgb_of(rgba, &mut self.rgb);
        let mut frame = Frame::from_rgb_speed(width, height, &self.rgb, SAMPLING_STEP);
        frame.delay = duration(shown, 100.0, u16::MAX.into())?;
        encoder.write_frame(&frame).map_err(io::Error::other)?;
        let written = encoder.get_mut();
        out.write_all(written)?;
        written.clear();
        Ok(())
    }

    fn finish(&mut self, out: &mut Output) -> WriteResult {
        let Some(encoder) = self.encoder.take() else { return Ok(()) };
        Ok(out.write_all(&encoder.into_inner().map_err(io::Error::other)?)?)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use std::io::{BufWriter, Seek, SeekFrom};

    #[test]
    fn palette() {
        let mut file = tempfile::tempfile().unwrap();
        let mut out: Output = BufWriter::new(Box::new(file.try_clone().unwrap()));
        let mut encoder = begin([64, 64]).unwrap();
        // 4096 combinations of red and green, which a fixed palette of all colors represents poorly.
        let rgba: Vec<u8> =
            (0..64 * 64_u32).flat_map(|k| [(4 * (k % 64)) as u8, (4 * (k / 64)) as u8, 40, 255]).collect();
        encoder.frame(&mut out, &rgba, [0.0, 0.25]).unwrap();
        encoder.finish(&mut out).unwrap();
        out.flush().unwrap();
        file.seek(SeekFrom::Start(0)).unwrap();
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(&file).unwrap();
        let frame = decoder.read_next_frame().unwrap().unwrap();
        assert_eq!(frame.delay, 25);
        let fixed = |x: u8, kept: u32| (u32::from(x >> (8 - kept)) * 255 / ((1 << kept) - 1)) as u8;
        let of_all: Vec<u8> = rgba
            .as_chunks::<4>()
            .0
            .iter()
            .flat_map(|p| [fixed(p[0], 3), fixed(p[1], 3), fixed(p[2], 2), 255])
            .collect();
        let error = |found: &[u8]| found.iter().zip(&rgba).map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>();
        assert!(2 * error(&frame.buffer) < error(&of_all), "{} {}", error(&frame.buffer), error(&of_all));
    }
}
