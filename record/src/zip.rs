//! ZIP archives with the 64-bit extension, as NumPy writes and reads them: stored and deflated files.
//!
//! Numbers and layout follow PKWARE's APPNOTE.TXT, sections 4.3 and 4.5.3.

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use std::io::{self, Read, Seek, SeekFrom, Write};

const LOCAL: u32 = 0x0403_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END_64: u32 = 0x0606_4b50;
const LOCATOR_64: u32 = 0x0706_4b50;
const END: u32 = 0x0605_4b50;
/// Version of the format with 64-bit sizes.
const VERSION: u16 = 45;
/// January 1, 1980, the earliest date. A constant date gives the same bytes in every run.
const DATE: u16 = 0x21;
/// General-purpose flags, section 4.4.4: bit 11, names are UTF-8. Without it, readers decode them as code page 437.
const UTF8_NAMES: u16 = 1 << 11;
/// Marks a size that is in the 64-bit extension.
const ZIP64_MARKER: u32 = u32::MAX;
const ZIP64_EXTRA_ID: u16 = 1;
/// Compression methods.
const STORED: u16 = 0;
const DEFLATED: u16 = 8;
/// Upper limit of the uncompressed size of all files of a scene \[bytes\].
const MAX_UNCOMPRESSED: u64 = 1 << 31;

/// Writer of an archive.
#[derive(Debug)]
pub(crate) struct ZipWriter<W> {
    to: W,
    entries: Vec<Entry>,
    at: u64,
}

#[derive(Debug)]
struct Entry {
    name: String,
    offset: u64,
    /// Size in the archive \[bytes\].
    size: u64,
    /// Uncompressed size of a deflated file \[bytes\]; `None` for a stored file.
    uncompressed_size: Option<u64>,
    crc: u32,
}

fn put(out: &mut Vec<u8>, numbers: &[(u64, usize)]) {
    for (number, bytes) in numbers {
        out.extend_from_slice(&number.to_le_bytes()[..*bytes]);
    }
}

impl<W: Write + Seek> ZipWriter<W> {
    pub(crate) fn new(to: W) -> Self {
        Self { to, entries: Vec::new(), at: 0 }
    }

    /// Adds a stored file: `head`, followed by `data`.
    pub(crate) fn add(&mut self, name: &str, head: &[u8], data: &mut dyn Read) -> io::Result<()> {
        let offset = self.at;
        let mut header = Vec::new();
        let (version, flags) = (u64::from(VERSION), u64::from(UTF8_NAMES));
        let fields = [(LOCAL.into(), 4), (version, 2), (flags, 2), (STORED.into(), 2), (0, 2), (DATE.into(), 2)];
        put(&mut header, &fields);
        // Checksum and sizes are written when they are known.
        let known_later = header.len() as u64;
        put(
            &mut header,
            &[(0, 4), (ZIP64_MARKER.into(), 4), (ZIP64_MARKER.into(), 4), (name.len() as u64, 2), (20, 2)],
        );
        header.extend_from_slice(name.as_bytes());
        put(&mut header, &[(ZIP64_EXTRA_ID.into(), 2), (16, 2), (0, 8), (0, 8)]);
        self.to.write_all(&header)?;
        let mut crc = crc32fast::Hasher::new();
        let mut size = head.len() as u64;
        crc.update(head);
        self.to.write_all(head)?;
        let mut buffer = vec![0; 1 << 16];
        loop {
            let count = data.read(&mut buffer)?;
            if count == 0 {
                break;
            }
            crc.update(&buffer[..count]);
            self.to.write_all(&buffer[..count])?;
            size += count as u64;
        }
        let crc = crc.finalize();
        self.to.seek(SeekFrom::Start(offset + known_later))?;
        self.to.write_all(&crc.to_le_bytes())?;
        self.to.seek(SeekFrom::Start(offset + header.len() as u64 - 16))?;
        self.to.write_all(&size.to_le_bytes())?;
        self.to.write_all(&size.to_le_bytes())?;
        self.at = offset + header.len() as u64 + size;
        self.to.seek(SeekFrom::Start(self.at))?;
        self.entries.push(Entry { name: name.into(), offset, size, uncompressed_size: None, crc });
        Ok(())
    }

    /// Adds a deflated file.
    pub(crate) fn add_deflated(&mut self, name: &str, data: &[u8]) -> io::Result<()> {
        let mut packed = DeflateEncoder::new(Vec::new(), Compression::default());
        packed.write_all(data)?;
        let packed = packed.finish()?;
        self.add(name, b"", &mut &packed[..])?;
        let mut crc = crc32fast::Hasher::new();
        crc.update(data);
        if let Some(entry) = self.entries.last_mut() {
            // Replaces checksum and size of the stored bytes by those of the uncompressed data.
            (entry.crc, entry.uncompressed_size) = (crc.finalize(), Some(data.len() as u64));
            let Entry { offset, crc, size, .. } = *entry;
            self.to.seek(SeekFrom::Start(offset + 8))?;
            self.to.write_all(&DEFLATED.to_le_bytes())?;
            self.to.seek(SeekFrom::Start(offset + 14))?;
            self.to.write_all(&crc.to_le_bytes())?;
            // The 64-bit extension follows the name: uncompressed size, compressed size.
            self.to.seek(SeekFrom::Start(offset + 30 + name.len() as u64 + 4))?;
            self.to.write_all(&(data.len() as u64).to_le_bytes())?;
            self.to.write_all(&size.to_le_bytes())?;
            self.to.seek(SeekFrom::Start(self.at))?;
        }
        Ok(())
    }

    /// Writes the central directory; returns the underlying writer.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        let start = self.at;
        let mut out = Vec::new();
        for Entry { name, offset, size, uncompressed_size, crc } in &self.entries {
            let (version, method) = (u64::from(VERSION), if uncompressed_size.is_some() { DEFLATED } else { STORED });
            put(&mut out, &[(CENTRAL.into(), 4), (version, 2), (version, 2)]);
            put(&mut out, &[(UTF8_NAMES.into(), 2), (method.into(), 2), (0, 2), (DATE.into(), 2)]);
            put(
                &mut out,
                &[
                    ((*crc).into(), 4),
                    (ZIP64_MARKER.into(), 4),
                    (ZIP64_MARKER.into(), 4),
                    (name.len() as u64, 2),
                    (28, 2),
                ],
            );
            // No comment, disk 0, no attributes.
            put(&mut out, &[(0, 2), (0, 2), (0, 2), (0, 4), (ZIP64_MARKER.into(), 4)]);
            out.extend_from_slice(name.as_bytes());
            let before = uncompressed_size.unwrap_or(*size);
            put(&mut out, &[(ZIP64_EXTRA_ID.into(), 2), (24, 2), (before, 8), (*size, 8), (*offset, 8)]);
        }
        let (length, count) = (out.len() as u64, self.entries.len() as u64);
        put(&mut out, &[(END_64.into(), 4), (44, 8), (VERSION.into(), 2), (VERSION.into(), 2), (0, 4), (0, 4)]);
        put(&mut out, &[(count, 8), (count, 8), (length, 8), (start, 8)]);
        put(&mut out, &[(LOCATOR_64.into(), 4), (0, 4), (start + length, 8), (1, 4)]);
        put(&mut out, &[(END.into(), 4), (0, 2), (0, 2), (0xffff, 2), (0xffff, 2), (ZIP64_MARKER.into(), 4)]);
        put(&mut out, &[(ZIP64_MARKER.into(), 4), (0, 2)]);
        self.to.write_all(&out)?;
        self.to.flush()?;
        Ok(self.to)
    }
}

/// Underlying reader of an archive.
pub(crate) trait ReadSeek: Read + Seek + Send {}

impl<S: Read + Seek + Send> ReadSeek for S {}

/// Directory entry of a file.
#[derive(Clone, Debug)]
struct DirectoryEntry {
    name: String,
    method: u16,
    /// Offset of the local header.
    offset: u64,
    /// Size in the archive \[bytes\].
    size: u64,
    uncompressed_size: u64,
    crc: u64,
}

/// Reader of an archive that [`ZipWriter`] has written. It reads the directory first, then only the requested files.
pub(crate) struct ZipReader<'s> {
    from: Box<dyn ReadSeek + 's>,
    files: Vec<DirectoryEntry>,
}

impl std::fmt::Debug for ZipReader<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reader").field("files", &self.files).finish_non_exhaustive()
    }
}

/// Error of a file that is no archive, or is damaged.
fn invalid_data(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what.to_string())
}

/// Length of the end of an archive \[bytes\]: the locator of the 64-bit end record, then the 32-bit end record.
const END_LEN: u64 = 20 + 22;
/// Length of a local header without the name \[bytes\].
const LOCAL_HEADER_LEN: usize = 30;

fn number(bytes: &[u8], at: usize, count: usize) -> Option<u64> {
    let mut all = [0; 8];
    all[..count].copy_from_slice(bytes.get(at..at.checked_add(count)?)?);
    Some(u64::from_le_bytes(all))
}

impl<'s> ZipReader<'s> {
    /// Reads the directory.
    ///
    /// # Errors
    /// It cannot be read; `InvalidData` if this is no such archive, or is incomplete.
    pub(crate) fn open(from: impl ReadSeek + 's) -> io::Result<Self> {
        let mut reader = Self { from: Box::new(from), files: Vec::new() };
        let length = reader.from.seek(SeekFrom::End(0))?;
        let none = || invalid_data("this is not an archive of a recorder, or it is incomplete");
        let tail = reader.bytes(length.checked_sub(END_LEN).ok_or_else(none)?, END_LEN, length)?;
        let is_end = number(&tail, 20, 4) == Some(END.into()) && number(&tail, 0, 4) == Some(LOCATOR_64.into());
        let end = number(&tail, 8, 8).filter(|_| is_end).ok_or_else(none)?;
        let end = reader.bytes(end, 56, length)?;
        let [count, size, start] = [32, 40, 48].map(|at| number(&end, at, 8));
        let (Some(count), Some(size), Some(start)) = (count, size, start) else { return Err(none()) };
        let directory = reader.bytes(start, size, length)?;
        reader.files = parse_directory(&directory, count, length).ok_or_else(none)?;
        Ok(reader)
    }

    /// Reads `count` bytes at offset `at`, within the file of size `length`.
    fn bytes(&mut self, at: u64, count: u64, length: u64) -> io::Result<Vec<u8>> {
        if at.checked_add(count).is_none_or(|end| end > length) {
            return Err(invalid_data("its directory points beyond the file"));
        }
        let mut bytes = vec![0; usize::try_from(count).map_err(|_| invalid_data("it is larger than memory"))?];
        self.from.seek(SeekFrom::Start(at))?;
        self.from.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// Names of all files, in their order.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|file| file.name.as_str())
    }

    fn find(&self, name: &str) -> Option<DirectoryEntry> {
        self.files.iter().find(|file| file.name == name).cloned()
    }

    /// Offset of the content of a file.
    fn data_offset(&mut self, file: &DirectoryEntry) -> io::Result<u64> {
        self.from.seek(SeekFrom::Start(file.offset))?;
        let mut head = [0; LOCAL_HEADER_LEN];
        self.from.read_exact(&mut head)?;
        let [name, extension] = [26, 28].map(|at| number(&head, at, 2).unwrap_or(0));
        Ok(file.offset + LOCAL_HEADER_LEN as u64 + name + extension)
    }

    /// The first `count` bytes of a stored file, without a check; `None` if there is no such file, or it is deflated.
    pub(crate) fn read_prefix(&mut self, name: &str, count: u64) -> io::Result<Option<Vec<u8>>> {
        let Some(file) = self.find(name).filter(|file| file.method == STORED) else { return Ok(None) };
        let begin = self.data_offset(&file)?;
        let mut bytes = Vec::new();
        self.from.seek(SeekFrom::Start(begin))?;
        self.from.by_ref().take(count.min(file.size)).read_to_end(&mut bytes)?;
        Ok(Some(bytes))
    }

    /// Reads a file, decompresses it and verifies its checksum; `None` if there is no such file.
    ///
    /// # Errors
    /// It cannot be read; `InvalidData` if it is damaged.
    pub(crate) fn read(&mut self, name: &str) -> io::Result<Option<Vec<u8>>> {
        let Some(file) = self.find(name) else { return Ok(None) };
        self.read_file(&file).map(Some)
    }

    fn read_file(&mut self, file: &DirectoryEntry) -> io::Result<Vec<u8>> {
        let begin = self.data_offset(file)?;
        self.from.seek(SeekFrom::Start(begin))?;
        let packed = self.from.by_ref().take(file.size);
        let mut data = Vec::new();
        match file.method {
            STORED => packed.take(file.uncompressed_size).read_to_end(&mut data)?,
            // One byte more than declared reveals a wrong size.
            DEFLATED => {
                DeflateDecoder::new(packed).take(file.uncompressed_size.saturating_add(1)).read_to_end(&mut data)?
            }
            _ => return Err(invalid_data("it uses an unsupported compression method")),
        };
        let whole = data.len() as u64 == file.uncompressed_size && crc_of(&data) == file.crc;
        if whole { Ok(data) } else { Err(invalid_data(&format!("{} is damaged", file.name))) }
    }
}

/// Reads all files of an archive; `None` if it is no archive, is damaged, or is too large.
pub(crate) fn read_all(bytes: &[u8]) -> Option<Vec<(String, Vec<u8>)>> {
    let mut reader = ZipReader::open(io::Cursor::new(bytes)).ok()?;
    let files = reader.files.clone();
    let all = files.iter().try_fold(0_u64, |all, file| all.checked_add(file.uncompressed_size));
    if all.is_none_or(|all| all > MAX_UNCOMPRESSED) {
        return None;
    }
    files.into_iter().map(|file| Some((file.name.clone(), reader.read_file(&file).ok()?))).collect()
}

fn crc_of(data: &[u8]) -> u64 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(data);
    crc.finalize().into()
}

/// Parses the directory of an archive of `length` bytes; `None` for an invalid directory.
fn parse_directory(directory: &[u8], count: u64, length: u64) -> Option<Vec<DirectoryEntry>> {
    let (mut files, mut sum, mut at) = (Vec::new(), 0_u64, 0_usize);
    for _ in 0..count {
        directory.get(at..)?;
        let name_length = usize::try_from(number(directory, at.checked_add(28)?, 2)?).ok()?;
        let name = std::str::from_utf8(directory.get(at + 46..at + 46 + name_length)?).ok()?;
        let extension = at + 46 + name_length + 4;
        let [unpacked, size, offset] = [0, 8, 16].map(|k| number(directory, extension + k, 8));
        let (uncompressed_size, size, offset) = (unpacked?, size?, offset?);
        let inside = offset.checked_add(LOCAL_HEADER_LEN as u64 + size).is_some_and(|end| end <= length);
        // The sum of sizes is limited by that of the archive, so that entries cannot share bytes to be read many times.
        sum = sum.checked_add(size).filter(|sum| inside && *sum <= length)?;
        let method = u16::try_from(number(directory, at + 10, 2)?).ok()?;
        // The sizes of a stored file are equal, so that no more memory is allocated than there are bytes.
        if method == STORED && uncompressed_size != size {
            return None;
        }
        let crc = number(directory, at + 16, 4)?;
        files.push(DirectoryEntry { name: name.into(), method, offset, size, uncompressed_size, crc });
        at = extension + 24;
    }
    Some(files)
}

/// Reads the stored files of an archive; `None` if it is no archive or is damaged.
#[cfg(test)]
pub(crate) fn read_stored(bytes: &[u8]) -> Option<Vec<(String, Vec<u8>)>> {
    let mut reader = ZipReader::open(io::Cursor::new(bytes)).ok()?;
    let stored: Vec<DirectoryEntry> = reader.files.iter().filter(|file| file.method == STORED).cloned().collect();
    stored.into_iter().map(|file| Some((file.name.clone(), reader.read_file(&file).ok()?))).collect()
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
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        archive.add(names[0], b"", &mut &b"x"[..]).unwrap();
        archive.add_deflated(names[1], b"v 0 0 0\n").unwrap();
        let mut bytes = archive.finish().unwrap().into_inner();
        // Flags are at offset 6 of a local header and at offset 8 of a directory entry.
        let flags_at = |at: usize| match number(&bytes, at, 4)? {
            signature if signature == u64::from(LOCAL) => Some(at + 6),
            signature if signature == u64::from(CENTRAL) => Some(at + 8),
            _ => None,
        };
        let places: Vec<usize> = (0..bytes.len()).filter_map(flags_at).collect();
        let flags: Vec<Option<u64>> = places.iter().map(|&at| number(&bytes, at, 2)).collect();
        assert_eq!(flags, [Some(1 << 11); 4]);
        let names_in = |bytes: &[u8]| read_all(bytes).unwrap().into_iter().map(|(name, _)| name).collect::<Vec<_>>();
        assert_eq!(names_in(&bytes), names);
        // Archives of earlier versions have no flags.
        places.iter().for_each(|&at| bytes[at..at + 2].fill(0));
        assert_eq!(names_in(&bytes), names);
    }

    #[test]
    fn round_trip_and_damage() {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        archive.add("a.npy", b"head", &mut &b" and data"[..]).unwrap();
        archive.add("empty", b"", &mut io::empty()).unwrap();
        let meshes = b"v 0.1 0.2 0.3\n".repeat(1000);
        archive.add_deflated("meshes/a.obj", &meshes).unwrap();
        archive.add("behind", b"", &mut &b"x"[..]).unwrap();
        let mut bytes = archive.finish().unwrap().into_inner();
        assert!(bytes.len() < 1500, "{}", bytes.len());
        let all = read_all(&bytes).unwrap();
        assert_eq!(
            all.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(),
            ["a.npy", "empty", "meshes/a.obj", "behind"]
        );
        assert!(all[2].1 == meshes && all[3].1 == b"x" && all[0].1 == b"head and data");
        let stored = [("a.npy", &b"head and data"[..]), ("empty", &b""[..]), ("behind", &b"x"[..])];
        assert_eq!(read_stored(&bytes).unwrap(), stored.map(|(name, data)| (name.to_string(), data.to_vec())));
        let mut reader = ZipReader::open(Cursor::new(bytes.clone())).unwrap();
        assert!(reader.names().eq(["a.npy", "empty", "meshes/a.obj", "behind"]));
        assert_eq!(reader.read_prefix("a.npy", 4).unwrap(), Some(b"head".to_vec()));
        assert_eq!((reader.read("nothing").unwrap(), reader.read("behind").unwrap()), (None, Some(b"x".to_vec())));
        assert_eq!(read_stored(&bytes[..bytes.len() - 1]), None);
        let place = bytes.windows(4).position(|four| four == b"head").unwrap();
        bytes[place] ^= 1;
        assert_eq!(read_stored(&bytes), None);
        assert_eq!(read_all(&bytes), None);
        bytes[place] ^= 1;
        // Entries that share their bytes, each of which would be read again.
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        archive.add("a", b"", &mut &[7; 1000][..]).unwrap();
        let again = archive.entries.remove(0);
        let Entry { offset, size, uncompressed_size, crc, .. } = again;
        archive.entries.extend(["a", "b"].map(|name| Entry {
            name: name.into(),
            offset,
            size,
            uncompressed_size,
            crc,
        }));
        let shared = archive.finish().unwrap().into_inner();
        assert!(read_stored(&shared).is_none() && read_all(&shared).is_none());
        let name = bytes.windows(12).position(|name| name == b"meshes/a.obj").unwrap();
        bytes[name + 12 + 20 + 5] ^= 1;
        assert_eq!(read_all(&bytes), None, "deflated files are checked, too");
    }
}
