//! Animated WebP, lossless: each frame is the bitstream of a still image, in a chunk of the container of RFC 9649,
//! section 2.7.

use super::{Encoder, Output, check_sides, duration, rgb_of};
use crate::writer::{WriteError, WriteResult};
use image_webp::{ColorType, WebPEncoder};
use std::io::{self, Seek, SeekFrom, Write};

struct Webp {
    size: [u32; 2],
    /// Size of the file after its length field \[bytes\].
    length: u64,
    rgb: Vec<u8>,
    still: Vec<u8>,
}

/// Largest side of a lossless bitstream \[pixels\].
const MAX_SIDE: usize = 1 << 14;

/// Largest value of the length field (section 2.4) \[bytes\].
const MAX_LENGTH: u64 = (1 << 32) - 10;

/// Offset of the chunks in the file of a still image: after `RIFF`, a length, and `WEBP`.
const CHUNKS_OFFSET: usize = 12;

/// Blending method: the frame replaces the previous one.
const DO_NOT_BLEND: u8 = 0b10;

const ANIMATED: u8 = 0b10;

pub(super) fn begin(size: [usize; 2]) -> Result<Box<dyn Encoder>, String> {
    Ok(Box::new(Webp { size: check_sides(size, MAX_SIDE)?, length: 0, rgb: Vec::new(), still: Vec::new() }))
}

/// The lowest three bytes of a number.
fn low_24_bits(number: u32) -> [u8; 3] {
    let [a, b, c, _] = number.to_le_bytes();
    [a, b, c]
}

impl Webp {
    /// Writes a RIFF chunk of type `kind` with the concatenated `parts`, padded to an even length. A file of more than
    /// 4 GiB is an error.
    fn chunk(&mut self, out: &mut Output, kind: &[u8; 4], parts: &[&[u8]]) -> WriteResult {
        let length: usize = parts.iter().map(|part| part.len()).sum();
        // Chunks begin at even offsets.
        let after = self.length + 8 + (length + length % 2) as u64;
        let known = u32::try_from(length).ok().filter(|_| after <= MAX_LENGTH);
        let known = known
            .ok_or_else(|| WriteError::limit("a WebP file has at most 4 GiB; record less, or use .apng or .mp4"))?;
        out.write_all(kind)?;
        out.write_all(&known.to_le_bytes())?;
        parts.iter().try_for_each(|part| out.write_all(part))?;
        out.write_all(&[0][..length % 2])?;
        self.length = after;
        Ok(())
    }
}

impl Encoder for Webp {
    fn frame(&mut self, out: &mut Output, rgba: &[u8], shown: [f64; 2]) -> WriteResult {
        let [width, height] = self.size.map(|side| low_24_bits(side - 1));
        if self.length == 0 {
            // The length is not known yet.
            out.write_all(b"RIFF\0\0\0\0WEBP")?;
            self.length = 4;
            self.chunk(out, b"VP8X", &[&[ANIMATED, 0, 0, 0], &width, &height])?;
            // No background, endless loop.
            self.chunk(out, b"ANIM", &[&[0; 4], &[0; 2]])?;
        }
        rgb_of(rgba, &mut self.rgb);
        self.still.clear();
        let encoder = WebPEncoder::new(&mut self.still);
        encoder.encode(&self.rgb, self.size[0], self.size[1], ColorType::Rgb8).map_err(io::Error::other)?;
        let milliseconds = low_24_bits(duration(shown, 1e3, (1 << 24) - 1)?);
        let place = [0; 6];
        let still = std::mem::take(&mut self.still);
        let image = still.get(CHUNKS_OFFSET..).unwrap_or_default();
        let written = self.chunk(out, b"ANMF", &[&place, &width, &height, &milliseconds, &[DO_NOT_BLEND], image]);
        self.still = still;
        written
    }

    fn finish(&mut self, out: &mut Output) -> WriteResult {
        // Each chunk has checked that it fits.
        let length = u32::try_from(self.length).unwrap_or(u32::MAX);
        out.seek(SeekFrom::Start(4))?;
        Ok(out.write_all(&length.to_le_bytes())?)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use std::io::BufWriter;

    /// Root cause: the length of a file was checked after its last frame, after hours of recording.
    #[test]
    fn length_limit() {
        let rgba = [7; 4 * 16 * 16];
        // Size of a single frame.
        let frame_at = |length: u64| {
            let file = tempfile::tempfile().unwrap();
            let mut out: Output = BufWriter::new(Box::new(file.try_clone().unwrap()));
            let mut webp = Webp { size: [16, 16], length, rgb: Vec::new(), still: Vec::new() };
            let result = webp.frame(&mut out, &rgba, [0.0, 0.1]);
            out.flush().unwrap();
            (result, webp.length, file.metadata().unwrap().len())
        };
        let (result, after, size) = frame_at(4);
        result.unwrap();
        assert_eq!(after - 4, size, "a chunk is counted as it is written");
        // The last frame that fits, and the first that does not: it is not written at all.
        let (result, last, _) = frame_at(MAX_LENGTH - size);
        result.unwrap();
        assert_eq!(last, MAX_LENGTH);
        let (result, still, written) = frame_at(MAX_LENGTH - size + 1);
        assert!(matches!(result, Err(WriteError::Limit(_))), "{result:?}");
        assert_eq!((still, written), (MAX_LENGTH - size + 1, 0));
    }
}
