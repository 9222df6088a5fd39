//! Animated WebP, without loss: each frame is the stream of a still picture in a chunk of the container that RFC 9649, section
//! 2.7, describes.

use super::{Encoder, Out, duration, rgb_of, sides};
use image_webp::{ColorType, WebPEncoder};
use std::io::{self, Seek, SeekFrom, Write};

struct Webp {
    size: [u32; 2],
    begun: bool,
    rgb: Vec<u8>,
    still: Vec<u8>,
}

/// The longest side of a stream without loss.
const MOST: usize = 1 << 14;

/// Where the pictures begin in the file of a still one: behind `RIFF`, a length, and `WEBP`.
const CHUNKS: usize = 12;

/// The frame is not blended with the one before.
const REPLACES: u8 = 0b10;

const ANIMATED: u8 = 0b10;

pub(super) fn begin(size: [usize; 2]) -> Result<Box<dyn Encoder>, String> {
    Ok(Box::new(Webp { size: sides(size, MOST)?, begun: false, rgb: Vec::new(), still: Vec::new() }))
}

/// The lowest three bytes of a number.
fn three(number: u32) -> [u8; 3] {
    let [a, b, c, _] = number.to_le_bytes();
    [a, b, c]
}

fn chunk(out: &mut Out, kind: &[u8; 4], parts: &[&[u8]]) -> io::Result<()> {
    let length: usize = parts.iter().map(|part| part.len()).sum();
    let known = u32::try_from(length).map_err(|_| io::Error::other("a frame is too large for WebP"))?;
    out.write_all(kind)?;
    out.write_all(&known.to_le_bytes())?;
    parts.iter().try_for_each(|part| out.write_all(part))?;
    // The next one begins at an even place.
    out.write_all(&[0][..length % 2])
}

impl Encoder for Webp {
    fn frame(&mut self, out: &mut Out, rgba: &[u8], shown: [f64; 2]) -> io::Result<()> {
        let [width, height] = self.size.map(|side| three(side - 1));
        if !self.begun {
            // The length is not known yet.
            out.write_all(b"RIFF\0\0\0\0WEBP")?;
            chunk(out, b"VP8X", &[&[ANIMATED, 0, 0, 0], &width, &height])?;
            // No background, played for ever.
            chunk(out, b"ANIM", &[&[0; 4], &[0; 2]])?;
            self.begun = true;
        }
        rgb_of(rgba, &mut self.rgb);
        self.still.clear();
        let encoder = WebPEncoder::new(&mut self.still);
        encoder.encode(&self.rgb, self.size[0], self.size[1], ColorType::Rgb8).map_err(io::Error::other)?;
        let milliseconds = three(duration(shown, 1e3, (1 << 24) - 1)?);
        let place = [0; 6];
        let picture = self.still.get(CHUNKS..).unwrap_or_default();
        chunk(out, b"ANMF", &[&place, &width, &height, &milliseconds, &[REPLACES], picture])
    }

    fn finish(&mut self, out: &mut Out) -> io::Result<()> {
        let length = out.stream_position()?.saturating_sub(8);
        let length = u32::try_from(length).map_err(|_| io::Error::other("a WebP file has at most 4 GiB"))?;
        out.seek(SeekFrom::Start(4))?;
        out.write_all(&length.to_le_bytes())
    }
}
