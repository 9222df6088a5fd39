//! Frames of an episode in progress. An episode gets its number and its frames their indices when it ends, so its
//! frames wait in a file without index until then.

use crate::file::StorageFactory;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufReader, Read, Write};
use std::path::PathBuf;

/// Buffered bytes at which frames are written to the file.
const FLUSH_BYTES: usize = 1 << 20;

/// Values of a frame.
#[derive(Debug, Default, PartialEq)]
pub(super) struct BufferedFrame {
    /// Values of all features of numbers.
    pub(super) numbers: Vec<f32>,
    /// Image files, or coded frames of videos.
    pub(super) images: Vec<Vec<u8>>,
    pub(super) reward: f32,
    pub(super) done: bool,
}

/// The frames of an episode, in memory and in a file that is deleted at the end.
#[derive(Debug)]
pub(super) struct EpisodeBuffer {
    path: PathBuf,
    buffer: Vec<u8>,
    frames: u64,
}

impl EpisodeBuffer {
    /// Creates the buffer; its file is created with the first write.
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path, buffer: Vec::new(), frames: 0 }
    }

    /// Number of frames.
    pub(super) fn frames(&self) -> u64 {
        self.frames
    }

    /// Appends a frame.
    pub(super) fn push(&mut self, frame: &BufferedFrame, disk: &StorageFactory) -> io::Result<()> {
        frame.numbers.iter().for_each(|number| self.buffer.extend_from_slice(&number.to_le_bytes()));
        for image in &frame.images {
            self.buffer.extend_from_slice(&(image.len() as u64).to_le_bytes());
            self.buffer.extend_from_slice(image);
        }
        self.buffer.extend_from_slice(&frame.reward.to_le_bytes());
        self.buffer.push(u8::from(frame.done));
        self.frames += 1;
        if self.buffer.len() >= FLUSH_BYTES { self.flush(disk) } else { Ok(()) }
    }

    /// Writes the buffered frames. The file is open only meanwhile, because there may be thousands of environments.
    fn flush(&mut self, disk: &StorageFactory) -> io::Result<()> {
        self.path.parent().map_or(Ok(()), fs::create_dir_all)?;
        let mut file = disk.storage(OpenOptions::new().create(true).append(true).open(&self.path)?);
        file.write_all(&self.buffer)?;
        file.flush()?;
        self.buffer.clear();
        Ok(())
    }

    /// Passes the frames to `take` in their order, then deletes the file. Each frame has `values` numbers and
    /// `images` images.
    pub(super) fn drain<E: From<io::Error>>(
        mut self,
        values: usize,
        images: usize,
        disk: &StorageFactory,
        mut take: impl FnMut(BufferedFrame) -> Result<(), E>,
    ) -> Result<(), E> {
        let in_memory = !self.path.exists();
        let mut bytes: Box<dyn Read> = if in_memory {
            Box::new(io::Cursor::new(std::mem::take(&mut self.buffer)))
        } else {
            self.flush(disk)?;
            Box::new(BufReader::with_capacity(1 << 16, File::open(&self.path)?))
        };
        for _ in 0..self.frames {
            take(read_frame(&mut bytes, values, images)?)?;
        }
        drop(bytes);
        if !in_memory {
            fs::remove_file(&self.path)?;
        }
        Ok(())
    }
}

fn read_frame(bytes: &mut impl Read, values: usize, images: usize) -> io::Result<BufferedFrame> {
    let mut frame = BufferedFrame::default();
    for _ in 0..values {
        frame.numbers.push(f32::from_le_bytes(read_array(bytes)?));
    }
    for _ in 0..images {
        let length = u64::from_le_bytes(read_array(bytes)?);
        let mut image = Vec::new();
        if bytes.by_ref().take(length).read_to_end(&mut image)? as u64 != length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        frame.images.push(image);
    }
    frame.reward = f32::from_le_bytes(read_array(bytes)?);
    frame.done = read_array::<1>(bytes)? != [0];
    Ok(frame)
}

fn read_array<const N: usize>(bytes: &mut impl Read) -> io::Result<[u8; N]> {
    let mut array = [0; N];
    bytes.read_exact(&mut array)?;
    Ok(array)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// A short episode stays in memory, a long one goes through the file; both return the same frames.
    #[test]
    fn in_memory_and_in_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("buffers/env_0");
        let frame = |k: u64| BufferedFrame {
            numbers: vec![k as f32, -0.5],
            images: vec![vec![k as u8; 1000], Vec::new()],
            reward: 0.25 * k as f32,
            done: k % 7 == 3,
        };
        let disk = StorageFactory::default();
        for (count, is_file) in [(10, false), (3000, true)] {
            let mut buffer = EpisodeBuffer::new(path.clone());
            (0..count).for_each(|k| buffer.push(&frame(k), &disk).unwrap());
            assert_eq!((buffer.frames(), path.exists()), (count, is_file));
            let mut next = 0;
            let all = buffer.drain(2, 2, &disk, |found| {
                assert_eq!(found, frame(next));
                next += 1;
                Ok::<_, io::Error>(())
            });
            assert!(all.is_ok() && next == count && !path.exists());
        }
    }

    /// A file that was cut off is an error, not a short episode.
    #[test]
    fn cut_off() {
        let folder = tempfile::tempdir().unwrap();
        let (path, disk) = (folder.path().join("env_0"), StorageFactory::default());
        let mut buffer = EpisodeBuffer::new(path.clone());
        let frame = BufferedFrame { images: vec![vec![1; FLUSH_BYTES]], ..BufferedFrame::default() };
        buffer.push(&frame, &disk).unwrap();
        OpenOptions::new().write(true).open(&path).unwrap().set_len(1000).unwrap();
        let error = buffer.drain(0, 1, &disk, |_| Ok::<_, io::Error>(())).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::UnexpectedEof);
    }
}
