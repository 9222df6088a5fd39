//! PNG files, and animations of them.

use crate::file::{PartFile, Storage};
use crate::packet::Packet;
use crate::stream::Stream;
use crate::writer::Sink;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use std::io::{self, BufWriter, SeekFrom, Write};
use std::path::PathBuf;

/// Depths are written in millimetres.
const PER_METRE: f32 = 1000.0;

/// Makes PNG files, one after the other in the same memory.
#[derive(Debug, Default)]
pub(crate) struct Png {
    pixels: Vec<u8>,
    file: Vec<u8>,
}

impl Png {
    /// Pixels of red, green, blue and opacity, which is left out.
    pub(crate) fn rgb(&mut self, rgba: &[u8], size: [usize; 2]) -> io::Result<&[u8]> {
        self.pixels.clear();
        for pixel in rgba.as_chunks::<4>().0 {
            self.pixels.extend_from_slice(&pixel[..3]);
        }
        self.encode(size, ExtendedColorType::Rgb8)
    }

    /// Depths \[m\] as 16-bit millimetres: 0 where nothing was hit, 65535 for 65.535 m and more.
    pub(crate) fn millimetres(&mut self, depths: &[f32], size: [usize; 2]) -> io::Result<&[u8]> {
        self.pixels.clear();
        for depth in depths {
            self.pixels.extend_from_slice(&millimetres(*depth).to_ne_bytes());
        }
        self.encode(size, ExtendedColorType::L16)
    }

    fn encode(&mut self, [width, height]: [usize; 2], color: ExtendedColorType) -> io::Result<&[u8]> {
        self.file.clear();
        let side = |side: usize| u32::try_from(side).map_err(|_| io::Error::other("a picture is too large for PNG"));
        let encoder = PngEncoder::new(&mut self.file);
        encoder.write_image(&self.pixels, side(width)?, side(height)?, color).map_err(io::Error::other)?;
        Ok(&self.file)
    }
}

/// A depth in whole millimetres, as PNG files have it.
fn millimetres(depth: f32) -> u16 {
    // What is beyond becomes the largest number; infinity, where nothing was hit, 0.
    if depth.is_finite() { (depth * PER_METRE).round() as u16 } else { 0 }
}

/// An animated PNG: the frames are chunks of PNG files, as the third edition of the PNG specification, section 4.9, has them.
pub(crate) struct Animation {
    part: PartFile,
    file: Option<BufWriter<Box<dyn Storage>>>,
    png: Png,
    size: [usize; 2],
    /// The frame that waits to know how long it is shown: its image data and its time \[s\].
    waiting: Option<(Vec<u8>, f64)>,
    /// How long the frame before was shown \[s\].
    last: f64,
    frames: u32,
    sequence: u32,
    /// Where the count of frames is in the file.
    count_at: u64,
}

const SIGNATURE: &[u8; 8] = b"\x89PNG\r\n\x1a\n";

fn chunk(to: &mut impl Write, kind: &[u8; 4], data: &[&[u8]]) -> io::Result<()> {
    let length: usize = data.iter().map(|part| part.len()).sum();
    let length = u32::try_from(length).map_err(|_| io::Error::other("a frame is too large for PNG"))?;
    to.write_all(&length.to_be_bytes())?;
    to.write_all(kind)?;
    let mut crc = crc32fast::Hasher::new();
    crc.update(kind);
    for part in data {
        crc.update(part);
        to.write_all(part)?;
    }
    to.write_all(&crc.finalize().to_be_bytes())
}

/// The data of the chunks of one kind in a PNG file.
fn chunks<'f>(file: &'f [u8], kind: &'static [u8; 4]) -> impl Iterator<Item = &'f [u8]> {
    let mut rest = file.get(SIGNATURE.len()..).unwrap_or(&[]);
    std::iter::from_fn(move || {
        let (length, after) = rest.split_first_chunk::<4>()?;
        let (name, after) = after.split_first_chunk::<4>()?;
        let (data, after) = after.split_at_checked(u32::from_be_bytes(*length) as usize)?;
        rest = after.get(4..)?;
        Some((name, data))
    })
    .filter(move |(name, _)| *name == kind)
    .map(|(_, data)| data)
}

impl Animation {
    pub(crate) fn create(part: PartFile, storage: Box<dyn Storage>, size: [usize; 2]) -> io::Result<Self> {
        let file = Some(BufWriter::with_capacity(1 << 16, storage));
        let png = Png::default();
        Ok(Self { part, file, png, size, waiting: None, last: 0.04, frames: 0, sequence: 0, count_at: 0 })
    }

    /// Writes the frame that waits, which is shown until `next` \[s\]; where there is no next one, as long as the one before.
    fn show(&mut self, next: Option<f64>) -> io::Result<()> {
        let Some((data, time)) = self.waiting.take() else { return Ok(()) };
        // A time that goes back is that of an environment that was reset: the recorded one does not.
        self.last = next.map_or(self.last, |next| next - time);
        let Some(file) = &mut self.file else { return Ok(()) };
        let milliseconds = (self.last * 1e3).round().clamp(1.0, f64::from(u16::MAX)) as u16;
        let [width, height] = self.size.map(|side| (side as u32).to_be_bytes());
        let mut control = self.sequence.to_be_bytes().to_vec();
        for number in [width, height, [0; 4], [0; 4]] {
            control.extend_from_slice(&number);
        }
        control.extend_from_slice(&milliseconds.to_be_bytes());
        control.extend_from_slice(&1000_u16.to_be_bytes());
        // The frame replaces the one before.
        control.extend_from_slice(&[0, 0]);
        chunk(file, b"fcTL", &[&control])?;
        self.sequence += 1;
        if self.frames == 0 {
            chunk(file, b"IDAT", &[&data])?;
        } else {
            chunk(file, b"fdAT", &[&self.sequence.to_be_bytes(), &data])?;
            self.sequence += 1;
        }
        self.frames += 1;
        Ok(())
    }

    fn write_count(file: &mut impl Write, frames: u32) -> io::Result<()> {
        // Played for ever.
        chunk(file, b"acTL", &[&frames.to_be_bytes(), &[0; 4]])
    }
}

impl Sink for Animation {
    fn write(&mut self, _streams: &[Stream], packet: &Packet) -> io::Result<()> {
        let Some(block) = packet.blocks.iter().find(|block| block.used) else { return Ok(()) };
        let time = block.stamps.first().copied().unwrap_or(0.0);
        self.show(Some(time))?;
        let picture = self.png.rgb(block.values.bytes(), self.size)?;
        if let Some(file) = self.file.as_mut().filter(|_| self.count_at == 0) {
            file.write_all(SIGNATURE)?;
            for header in chunks(picture, b"IHDR") {
                chunk(file, b"IHDR", &[header])?;
                self.count_at = (SIGNATURE.len() + 12 + header.len()) as u64;
            }
            Self::write_count(file, 0)?;
        }
        self.waiting = Some((chunks(picture, b"IDAT").flatten().copied().collect(), time));
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        // Nobody can read it before the end.
        Ok(())
    }

    fn finish(&mut self, _streams: &[Stream]) -> io::Result<u64> {
        self.show(None)?;
        let mut file = self.file.take().ok_or_else(|| io::Error::other("finished twice"))?;
        if self.frames == 0 {
            return Err(io::Error::other("the camera has measured nothing: there is no frame"));
        }
        chunk(&mut file, b"IEND", &[])?;
        use std::io::Seek as _;
        file.seek(SeekFrom::Start(self.count_at))?;
        Self::write_count(&mut file, self.frames)?;
        file.flush()?;
        self.part.commit()
    }

    fn kept(&self) -> Option<PathBuf> {
        self.part.kept()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_whole_millimetres() {
        let depths = [0.0, 0.0014, 0.0016, 1.0, 65.535, 70.0, f32::INFINITY, f32::NAN];
        assert_eq!(depths.map(millimetres), [0, 1, 2, 1000, 65535, 65535, 0, 0]);
    }
}
