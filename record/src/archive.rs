//! ZIP archives with 64-bit sizes, as NumPy writes and reads them: stored and deflated files, by the crate `zip`.

use std::io::{self, Read, Seek, SeekFrom, Write};
use zip::read::{ArchiveOffset, Config};
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive};

/// Upper limit of the uncompressed size of all files of a scene \[bytes\].
const MAX_UNCOMPRESSED: u128 = 1 << 31;

/// Writer of an archive.
pub(crate) struct ArchiveWriter<W: Write + Seek>(zip::ZipWriter<FusedWriter<W>>);

/// A writer that discards data after an error, as if the disk had room. When the crate's writer is dropped, it
/// completes the archive, and prints to the terminal if it cannot.
struct FusedWriter<W> {
    to: W,
    has_failed: bool,
    /// Position of the next byte, and length of the file, with the discarded bytes.
    position: u64,
    length: u64,
}

impl<W: Write> Write for FusedWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = if self.has_failed { Ok(bytes.len()) } else { self.to.write(bytes) };
        match &written {
            Ok(count) => {
                self.position += *count as u64;
                self.length = self.length.max(self.position);
            }
            Err(error) => self.has_failed = error.kind() != io::ErrorKind::Interrupted,
        }
        written
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = if self.has_failed { Ok(()) } else { self.to.flush() };
        self.has_failed |= flushed.is_err();
        flushed
    }
}

impl<W: Seek> Seek for FusedWriter<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let place = match to {
            _ if !self.has_failed => self.to.seek(to),
            SeekFrom::Start(place) => Ok(place),
            SeekFrom::End(by) => Ok(self.length.saturating_add_signed(by)),
            SeekFrom::Current(by) => Ok(self.position.saturating_add_signed(by)),
        };
        match &place {
            Ok(place) => self.position = *place,
            Err(_) => self.has_failed = true,
        }
        place
    }
}

impl<W: Write + Seek> ArchiveWriter<W> {
    pub(crate) fn new(to: W) -> Self {
        Self(zip::ZipWriter::new(FusedWriter { to, has_failed: false, position: 0, length: 0 }))
    }

    /// Adds a stored file: `head`, followed by `data`.
    pub(crate) fn add(&mut self, name: &str, head: &[u8], data: &mut dyn Read) -> io::Result<()> {
        self.0.start_file(name, options(CompressionMethod::Stored)).map_err(write_error)?;
        self.0.write_all(head)?;
        io::copy(data, &mut self.0)?;
        Ok(())
    }

    /// Adds a deflated file.
    pub(crate) fn add_deflated(&mut self, name: &str, data: &[u8]) -> io::Result<()> {
        self.0.start_file(name, options(CompressionMethod::Deflated)).map_err(write_error)?;
        self.0.write_all(data)
    }

    /// Writes the central directory; returns the underlying writer.
    pub(crate) fn finish(self) -> io::Result<W> {
        let mut to = self.0.finish().map_err(write_error)?.to;
        to.flush()?;
        Ok(to)
    }
}

/// Options of a file. The constant date gives the same bytes in every run; sizes are not known before the data.
fn options(method: CompressionMethod) -> SimpleFileOptions {
    SimpleFileOptions::default().compression_method(method).last_modified_time(DateTime::default()).large_file(true)
}

fn write_error(error: ZipError) -> io::Error {
    match error {
        ZipError::Io(error) => error,
        error => io::Error::other(error),
    }
}

/// Underlying reader of an archive.
pub(crate) trait ReadSeek: Read + Seek + Send {}

impl<S: Read + Seek + Send> ReadSeek for S {}

/// Reader of an archive. It reads the directory first, then only the requested files.
pub(crate) struct ArchiveReader<'s>(ZipArchive<Box<dyn ReadSeek + 's>>);

impl std::fmt::Debug for ArchiveReader<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ArchiveReader").field("files", &self.0.len()).finish_non_exhaustive()
    }
}

/// Error of a file that is no archive, or is damaged.
fn invalid_data(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what.to_string())
}

impl<'s> ArchiveReader<'s> {
    /// Reads the directory.
    ///
    /// # Errors
    /// It cannot be read; `InvalidData` if this is no archive, or is incomplete.
    pub(crate) fn open(from: impl ReadSeek + 's) -> io::Result<Self> {
        // The archive begins at the first byte. Otherwise, the scene in a truncated recording would be taken for it.
        let config = Config { archive_offset: ArchiveOffset::Known(0) };
        match ZipArchive::with_config(config, Box::new(from) as Box<dyn ReadSeek + 's>) {
            Ok(archive) => Ok(Self(archive)),
            Err(ZipError::Io(error)) if error.kind() != io::ErrorKind::UnexpectedEof => Err(error),
            Err(_) => Err(invalid_data("this is not an archive of a recorder, or it is incomplete")),
        }
    }

    /// Names of all files, in their order; names that are not UTF-8 are left out.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        // Archives of earlier versions do not mark their names as UTF-8.
        self.0.file_names_raw().filter_map(|name| std::str::from_utf8(name).ok())
    }

    /// The first `count` bytes of a stored file, without a check, and the size of the file \[bytes\]; `None` if there is
    /// no such file, or it is deflated.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) fn read_prefix(&mut self, name: &str, count: u64) -> io::Result<Option<(Vec<u8>, u64)>> {
        let Some(file) = self.find(name)? else { return Ok(None) };
        if file.compression() != CompressionMethod::Stored {
            return Ok(None);
        }
        let (mut bytes, size) = (Vec::new(), file.size());
        file.take(count).read_to_end(&mut bytes)?;
        Ok(Some((bytes, size)))
    }

    /// Reads a file, decompresses it and verifies its checksum; `None` if there is no such file.
    ///
    /// # Errors
    /// It cannot be read; `InvalidData` if it is damaged.
    pub(crate) fn read(&mut self, name: &str) -> io::Result<Option<Vec<u8>>> {
        let Some(mut file) = self.find(name)? else { return Ok(None) };
        let mut data = Vec::new();
        // The crate reads at most one byte more than declared, and compares the checksum.
        match file.read_to_end(&mut data) {
            Ok(read) if read as u64 == file.size() => Ok(Some(data)),
            Err(error) if !is_damage(&error) => Err(error),
            _ => Err(invalid_data(&format!("{name} is damaged"))),
        }
    }

    fn find(&mut self, name: &str) -> io::Result<Option<zip::read::ZipFile<'_, Box<dyn ReadSeek + 's>>>> {
        let Some(index) = self.0.index_for_name_raw(name.as_bytes()) else { return Ok(None) };
        match self.0.by_index(index) {
            Ok(file) => Ok(Some(file)),
            Err(ZipError::Io(error)) => Err(error),
            Err(_) => Err(invalid_data(&format!("{name} is damaged"))),
        }
    }
}

/// True for an error that the content of an archive causes, not the disk.
fn is_damage(error: &io::Error) -> bool {
    use io::ErrorKind::{InvalidData, InvalidInput, Other, UnexpectedEof};
    matches!(error.kind(), InvalidData | InvalidInput | Other | UnexpectedEof)
}

/// Reads all files of an archive; `None` if it is no archive, is damaged, is larger than [`MAX_UNCOMPRESSED`], or has
/// files that share bytes or a name that is not UTF-8.
pub(crate) fn read_all(bytes: &[u8]) -> Option<Vec<(String, Vec<u8>)>> {
    let mut reader = ArchiveReader::open(io::Cursor::new(bytes)).ok()?;
    // Files that share bytes would be read many times.
    if reader.0.decompressed_size()? > MAX_UNCOMPRESSED || reader.0.has_overlapping_files().ok()? {
        return None;
    }
    let names: Vec<String> = reader.names().map(String::from).collect();
    (names.len() == reader.0.len()).then_some(())?;
    names.into_iter().map(|name| Some((name.clone(), reader.read(&name).ok()??))).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// Root cause: the flag of UTF-8 names was not set, so that other programs decoded names as code page 437.
    #[test]
    fn utf8_names() {
        let names = ["é.npy", "ü.obj"];
        let mut archive = ArchiveWriter::new(Cursor::new(Vec::new()));
        archive.add(names[0], b"", &mut &b"x"[..]).unwrap();
        archive.add_deflated(names[1], b"v 0 0 0\n").unwrap();
        let mut bytes = archive.finish().unwrap().into_inner();
        // Flags are at offset 6 of a local header and at offset 8 of a directory entry (APPNOTE.TXT, 4.3.7 and 4.3.12).
        let flags_at = |at: usize| match &bytes[at..at + 4] {
            b"PK\x03\x04" => Some(at + 6),
            b"PK\x01\x02" => Some(at + 8),
            _ => None,
        };
        let places: Vec<usize> = (0..bytes.len() - 4).filter_map(flags_at).collect();
        // Bit 11: names are UTF-8.
        assert_eq!(places.iter().map(|&at| bytes[at + 1] & 8).collect::<Vec<_>>(), [8; 4]);
        let names_in = |bytes: &[u8]| read_all(bytes).unwrap().into_iter().map(|(name, _)| name).collect::<Vec<_>>();
        assert_eq!(names_in(&bytes), names);
        // Archives of earlier versions have no flags.
        places.iter().for_each(|&at| bytes[at..at + 2].fill(0));
        assert_eq!(names_in(&bytes), names);
    }

    #[test]
    fn round_trip_and_damage() {
        let mut archive = ArchiveWriter::new(Cursor::new(Vec::new()));
        archive.add("a.npy", b"head", &mut &b" and data"[..]).unwrap();
        archive.add("empty", b"", &mut io::empty()).unwrap();
        let meshes = b"v 0.1 0.2 0.3\n".repeat(1000);
        archive.add_deflated("meshes/a.obj", &meshes).unwrap();
        archive.add("behind", b"", &mut &b"x"[..]).unwrap();
        let mut bytes = archive.finish().unwrap().into_inner();
        assert!(bytes.len() < 1500, "{}", bytes.len());
        let all = read_all(&bytes).unwrap();
        let names = ["a.npy", "empty", "meshes/a.obj", "behind"];
        assert_eq!(all.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), names);
        assert!(all[2].1 == meshes && all[3].1 == b"x" && all[0].1 == b"head and data" && all[1].1.is_empty());
        let mut reader = ArchiveReader::open(Cursor::new(bytes.clone())).unwrap();
        assert!(reader.names().eq(names));
        assert_eq!(reader.read_prefix("a.npy", 4).unwrap(), Some((b"head".to_vec(), 13)));
        assert_eq!(reader.read_prefix("meshes/a.obj", 4).unwrap(), None);
        assert_eq!((reader.read("nothing").unwrap(), reader.read("behind").unwrap()), (None, Some(b"x".to_vec())));
        assert_eq!(read_all(&bytes[..bytes.len() - 1]), None);
        // An archive within an archive, which is truncated.
        let mut outer = ArchiveWriter::new(Cursor::new(Vec::new()));
        outer.add("inner.zip", b"", &mut &bytes[..]).unwrap();
        let outer = outer.finish().unwrap().into_inner();
        assert!(read_all(&outer).is_some() && read_all(&outer[..outer.len() - 60]).is_none());
        for part in [&b"head"[..], b"meshes/a.obj"] {
            // Within the stored data, or within the deflated data behind the local header.
            let at = bytes.windows(part.len()).position(|found| found == part).unwrap();
            let at = if part == b"head" { at } else { at + part.len() + 20 + 5 };
            bytes[at] ^= 1;
            assert_eq!(read_all(&bytes), None, "{part:?}");
            bytes[at] ^= 1;
        }
        assert!(read_all(&bytes).is_some());
    }

    /// Files that share their bytes, each of which would be read again.
    #[test]
    fn shared_bytes() {
        let mut archive = ArchiveWriter::new(Cursor::new(Vec::new()));
        for name in ["a", "b"] {
            archive.add(name, b"", &mut &[7; 1000][..]).unwrap();
        }
        let mut bytes = archive.finish().unwrap().into_inner();
        assert_eq!(read_all(&bytes).unwrap().len(), 2);
        // The directory entry of `b` gets the offset of `a`, 0: the last four bytes of its fixed part, or the last eight
        // of its 64-bit extension.
        let entry = bytes.windows(4).rposition(|four| four == b"PK\x01\x02").unwrap();
        let name = entry + 46;
        if bytes[name - 4..name] == [0xff; 4] {
            let length = usize::from(bytes[entry + 30]);
            bytes[name + 1 + length - 8..name + 1 + length].fill(0);
        } else {
            bytes[name - 4..name].fill(0);
        }
        assert_eq!(read_all(&bytes), None);
    }

    /// On a full disk, the error is returned and nothing is printed: the archive is completed into the void.
    #[test]
    fn full_disk() {
        struct Full(Cursor<Vec<u8>>);
        impl Write for Full {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                if self.0.position() > 100 { Err(io::ErrorKind::StorageFull.into()) } else { self.0.write(bytes) }
            }

            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        impl Seek for Full {
            fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
                self.0.seek(to)
            }
        }
        let mut archive = ArchiveWriter::new(Full(Cursor::new(Vec::new())));
        let error = (0..10).find_map(|k| archive.add(&k.to_string(), &[k; 40], &mut io::empty()).err()).unwrap();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert!(archive.0.finish().is_ok(), "as when it is dropped");
    }
}
