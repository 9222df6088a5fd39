//! Animated PNG: frames are chunks of PNG files, as in the third edition of the PNG specification, section 4.9.

use super::{Encoder, Output, check_sides, duration};
use crate::png::PngWriter;
use crate::writer::{WriteError, WriteResult};
use std::io::{Seek, SeekFrom, Write};

struct Apng {
    png: PngWriter,
    size: [u32; 2],
    frames: u32,
    sequence: u32,
    /// File offset of the frame count.
    count_at: u64,
    data: Vec<u8>,
}

const SIGNATURE: &[u8; 8] = b"\x89PNG\r\n\x1a\n";

/// Largest side of a PNG file \[pixels\].
const MAX_SIDE: usize = (1 << 31) - 1;

pub(super) fn begin(size: [usize; 2]) -> Result<Box<dyn Encoder>, String> {
    let size = check_sides(size, MAX_SIDE)?;
    Ok(Box::new(Apng { png: PngWriter::default(), size, frames: 0, sequence: 0, count_at: 0, data: Vec::new() }))
}

fn chunk(to: &mut impl Write, kind: &[u8; 4], data: &[&[u8]]) -> WriteResult {
    let length: usize = data.iter().map(|part| part.len()).sum();
    let length = u32::try_from(length)
        .map_err(|_| WriteError::limit("a frame of a PNG file has at most 4 GiB; use smaller images"))?;
    to.write_all(&length.to_be_bytes())?;
    to.write_all(kind)?;
    let mut crc = crc32fast::Hasher::new();
    crc.update(kind);
    for part in data {
        crc.update(part);
        to.write_all(part)?;
    }
    Ok(to.write_all(&crc.finalize().to_be_bytes())?)
}

/// Data of the chunks of one type in a PNG file.
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

impl Apng {
    fn write_count(out: &mut Output, frames: u32) -> WriteResult {
        // Endless loop.
        chunk(out, b"acTL", &[&frames.to_be_bytes(), &[0; 4]])
    }
}

impl Encoder for Apng {
    fn frame(&mut self, out: &mut Output, rgba: &[u8], shown: [f64; 2]) -> WriteResult {
        let image = self.png.encode_rgb(rgba, self.size.map(|side| side as usize))?;
        if self.frames == 0 {
            out.write_all(SIGNATURE)?;
            for header in chunks(image, b"IHDR") {
                chunk(out, b"IHDR", &[header])?;
                self.count_at = (SIGNATURE.len() + 12 + header.len()) as u64;
            }
            Self::write_count(out, 0)?;
        }
        self.data.clear();
        chunks(image, b"IDAT").for_each(|data| self.data.extend_from_slice(data));
        let milliseconds = duration::<u16>(shown, 1e3, u16::MAX.into())?;
        let [width, height] = self.size.map(u32::to_be_bytes);
        let mut control = self.sequence.to_be_bytes().to_vec();
        for number in [width, height, [0; 4], [0; 4]] {
            control.extend_from_slice(&number);
        }
        control.extend_from_slice(&milliseconds.to_be_bytes());
        control.extend_from_slice(&1000_u16.to_be_bytes());
        // The frame replaces the previous one.
        control.extend_from_slice(&[0, 0]);
        chunk(out, b"fcTL", &[&control])?;
        self.sequence += 1;
        if self.frames == 0 {
            chunk(out, b"IDAT", &[&self.data])?;
        } else {
            chunk(out, b"fdAT", &[&self.sequence.to_be_bytes(), &self.data])?;
            self.sequence += 1;
        }
        self.frames += 1;
        Ok(())
    }

    fn finish(&mut self, out: &mut Output) -> WriteResult {
        chunk(out, b"IEND", &[])?;
        out.seek(SeekFrom::Start(self.count_at))?;
        Self::write_count(out, self.frames)
    }
}
