//! A buffer file of byte blocks.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Position of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BlockPosition {
    at: u64,
    bytes: u64,
}

/// The buffer file. Blocks may be written and read in any order.
pub(super) struct BlockFile {
    file: BufWriter<File>,
    at: u64,
}

impl BlockPosition {
    /// Size of a serialized position.
    pub(super) const BYTES: usize = 16;

    pub(super) fn to_bytes(self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        bytes[..8].copy_from_slice(&self.at.to_le_bytes());
        bytes[8..].copy_from_slice(&self.bytes.to_le_bytes());
        bytes
    }

    /// Deserializes a position; missing bytes are 0.
    pub(super) fn from_bytes(bytes: &[u8]) -> Self {
        let (words, _) = bytes.as_chunks::<8>();
        let word = |k: usize| words.get(k).map_or(0, |word| u64::from_le_bytes(*word));
        Self { at: word(0), bytes: word(1) }
    }
}

impl BlockFile {
    pub(super) fn create(folder: &Path) -> io::Result<Self> {
        Ok(Self { file: BufWriter::with_capacity(1 << 16, tempfile::tempfile_in(folder)?), at: 0 })
    }

    /// Appends `piece` as a block and returns its position in the file.
    pub(super) fn append(&mut self, piece: &[u8]) -> io::Result<BlockPosition> {
        self.file.write_all(piece)?;
        let place = BlockPosition { at: self.at, bytes: piece.len() as u64 };
        self.at += place.bytes;
        Ok(place)
    }

    /// Reads a block into `to`, replacing its content.
    pub(super) fn read(&mut self, place: BlockPosition, to: &mut Vec<u8>) -> io::Result<()> {
        self.file.flush()?;
        let file = self.file.get_mut();
        file.seek(SeekFrom::Start(place.at))?;
        to.clear();
        file.take(place.bytes).read_to_end(to)?;
        // Returns to the position of the next write.
        file.seek(SeekFrom::Start(self.at))?;
        if to.len() as u64 == place.bytes { Ok(()) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn any_order() {
        let folder = tempfile::tempdir().unwrap();
        let mut heap = BlockFile::create(folder.path()).unwrap();
        let pieces: Vec<Vec<u8>> = (0..50_u8).map(|k| vec![k; 37 * usize::from(k)]).collect();
        let (mut places, mut found) = (Vec::new(), Vec::new());
        for piece in &pieces {
            places.push(heap.append(piece).unwrap());
            let middle = places.len() / 2;
            heap.read(places[middle], &mut found).unwrap();
            assert_eq!(found, pieces[middle]);
        }
        for (place, piece) in places.iter().zip(&pieces).rev() {
            let place = BlockPosition::from_bytes(&place.to_bytes());
            heap.read(place, &mut found).unwrap();
            assert_eq!(found, *piece);
        }
        let beyond = BlockPosition { at: places[49].at, bytes: places[49].bytes + 1 };
        assert_eq!(heap.read(beyond, &mut found).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "it has no name");
    }
}
