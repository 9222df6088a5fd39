//! Animated WebP, lossless: each frame is the bitstream of a still image, in a chunk of the container of RFC 9649,
//! section 2.7.

use super::{Encoder, Out, duration, rgb_of, sides};
use crate::writer::{Fault, Written};
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
const MOST: usize = 1 << 14;

/// Largest value of the length field (section 2.4) \[bytes\].
const LONGEST: u64 = (1 << 32) - 10;

/// Offset of the chunks in the file of a still image: after `RIFF`, a length, and `WEBP`.
const CHUNKS: usize = 12;

/// Blending method: the frame replaces the previous one.
const REPLACES: u8 = 0b10;

const ANIMATED: u8 = 0b10;

pub(super) fn begin(size: [usize; 2]) -> Result<Box<dyn Encoder>, String> {
    Ok(Box::new(Webp { size: sides(size, MOST)?, length: 0, rgb: Vec::new(), still: Vec::new() }))
}

/// The lowest three bytes of a number.
fn three(number: u32) -> [u8; 3] {
    let [a, b, c, _] = number.to_le_bytes();
    [a, b, c]
}

impl Webp {
    /// Writes a chunk, if the file has room for it.
    fn chunk(&mut self, out: &mut Out, kind: &[u8; 4], parts: &[&[u8]]) -> Written {
        let length: usize = parts.iter().map(|part| part.len()).sum();
        // Chunks begin at even offsets.
        let after = self.length + 8 + (length + length % 2) as u64;
        let known = u32::try_from(length).ok().filter(|_| after <= LONGEST);
        let known =
            known.ok_or_else(|| Fault::limit("a WebP file has at most 4 GiB; record less, or as .apng or .mp4"))?;
        out.write_all(kind)?;
        out.write_all(&known.to_le_bytes())?;
        parts.iter().try_for_each(|part| out.write_all(part))?;
        out.write_all(&[0][..length % 2])?;
        self.length = after;
        Ok(())
    }
}

impl Encoder for Webp {
    fn frame(&mut self, out: &mut Out, rgba: &[u8], shown: [f64; 2]) -> Written {
        let [width, height] = self.size.map(|side| three(side - 1));
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
        let milliseconds = three(duration(shown, 1e3, (1 << 24) - 1)?);
        let place = [0; 6];
        let still = std::mem::take(&mut self.still);
        let picture = still.get(CHUNKS..).unwrap_or_default();
        let written = self.chunk(out, b"ANMF", &[&place, &width, &height, &milliseconds, &[REPLACES], picture]);
        self.still = still;
        written
    }

    fn finish(&mut self, out: &mut Out) -> Written {
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
            let mut out: Out = BufWriter::new(Box::new(file.try_clone().unwrap()));
            let mut webp = Webp { size: [16, 16], length, rgb: Vec::new(), still: Vec::new() };
            let result = webp.frame(&mut out, &rgba, [0.0, 0.1]);
            out.flush().unwrap();
            (result, webp.length, file.metadata().unwrap().len())
        };
        let (result, after, size) = frame_at(4);
        result.unwrap();
        assert_eq!(after - 4, size, "a chunk is counted as it is written");
        // The last frame that fits, and the first that does not: it is not written at all.
        let (result, last, _) = frame_at(LONGEST - size);
        result.unwrap();
        assert_eq!(last, LONGEST);
        let (result, still, written) = frame_at(LONGEST - size + 1);
        assert!(matches!(result, Err(Fault::Limit(_))), "{result:?}");
        assert_eq!((still, written), (LONGEST - size + 1, 0));
    }
}
