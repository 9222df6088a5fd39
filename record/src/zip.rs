//! Archives of files that are stored as they are: the ZIP format with its 64-bit extension, as NumPy writes and reads it.
//!
//! Numbers and layout are those of PKWARE's APPNOTE.TXT, sections 4.3 and 4.5.3.

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use std::io::{self, Read, Seek, SeekFrom, Write};

const LOCAL: u32 = 0x0403_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END_64: u32 = 0x0606_4b50;
const LOCATOR_64: u32 = 0x0706_4b50;
const END: u32 = 0x0605_4b50;
/// The version that knows 64-bit sizes.
const VERSION: u16 = 45;
/// The first of January 1980, the earliest date there is: the same bytes at every run.
const DATE: u16 = 0x21;
/// The size stands in the 64-bit extension.
const SEE_64: u32 = u32::MAX;
const EXTENSION_64: u16 = 1;
/// How files are in the archive.
const STORED: u16 = 0;
const DEFLATED: u16 = 8;
/// The files of a scene are together no larger, unpacked \[bytes\].
const LARGEST: u64 = 1 << 31;

/// Writes an archive.
#[derive(Debug)]
pub(crate) struct Archive<W> {
    to: W,
    entries: Vec<Entry>,
    at: u64,
}

#[derive(Debug)]
struct Entry {
    name: String,
    offset: u64,
    /// In the archive.
    size: u64,
    /// Of a file that is packed, what it was before.
    unpacked: Option<u64>,
    crc: u32,
}

fn put(out: &mut Vec<u8>, numbers: &[(u64, usize)]) {
    for (number, bytes) in numbers {
        out.extend_from_slice(&number.to_le_bytes()[..*bytes]);
    }
}

impl<W: Write + Seek> Archive<W> {
    pub(crate) fn new(to: W) -> Self {
        Self { to, entries: Vec::new(), at: 0 }
    }

    /// Adds a file: `head`, then everything that `data` gives.
    pub(crate) fn add(&mut self, name: &str, head: &[u8], data: &mut dyn Read) -> io::Result<()> {
        let offset = self.at;
        let mut header = Vec::new();
        let fields = [(u64::from(LOCAL), 4), (u64::from(VERSION), 2), (0, 2), (0, 2), (0, 2), (u64::from(DATE), 2)];
        put(&mut header, &fields);
        // Checksum and sizes come when they are known.
        let known_later = header.len() as u64;
        put(&mut header, &[(0, 4), (SEE_64.into(), 4), (SEE_64.into(), 4), (name.len() as u64, 2), (20, 2)]);
        header.extend_from_slice(name.as_bytes());
        put(&mut header, &[(EXTENSION_64.into(), 2), (16, 2), (0, 8), (0, 8)]);
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
        self.entries.push(Entry { name: name.into(), offset, size, unpacked: None, crc });
        Ok(())
    }

    /// Adds a file, packed.
    pub(crate) fn add_packed(&mut self, name: &str, data: &[u8]) -> io::Result<()> {
        let mut packed = DeflateEncoder::new(Vec::new(), Compression::default());
        packed.write_all(data)?;
        let packed = packed.finish()?;
        self.add(name, b"", &mut &packed[..])?;
        let mut crc = crc32fast::Hasher::new();
        crc.update(data);
        if let Some(entry) = self.entries.last_mut() {
            // What was written as it is becomes what it was before it was packed.
            (entry.crc, entry.unpacked) = (crc.finalize(), Some(data.len() as u64));
            let Entry { offset, crc, size, .. } = *entry;
            self.to.seek(SeekFrom::Start(offset + 8))?;
            self.to.write_all(&DEFLATED.to_le_bytes())?;
            self.to.seek(SeekFrom::Start(offset + 14))?;
            self.to.write_all(&crc.to_le_bytes())?;
            // The 64-bit extension stands behind the name: the size unpacked, then packed.
            self.to.seek(SeekFrom::Start(offset + 30 + name.len() as u64 + 4))?;
            self.to.write_all(&(data.len() as u64).to_le_bytes())?;
            self.to.write_all(&size.to_le_bytes())?;
            self.to.seek(SeekFrom::Start(self.at))?;
        }
        Ok(())
    }

    /// Writes the directory; gives back what was written to.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        let start = self.at;
        let mut out = Vec::new();
        for Entry { name, offset, size, unpacked, crc } in &self.entries {
            let (version, method) = (u64::from(VERSION), if unpacked.is_some() { DEFLATED } else { STORED });
            let head =
                [(CENTRAL.into(), 4), (version, 2), (version, 2), (0, 2), (method.into(), 2), (0, 2), (DATE.into(), 2)];
            put(&mut out, &head);
            put(
                &mut out,
                &[((*crc).into(), 4), (SEE_64.into(), 4), (SEE_64.into(), 4), (name.len() as u64, 2), (28, 2)],
            );
            // No comment, on this disk, no attributes.
            put(&mut out, &[(0, 2), (0, 2), (0, 2), (0, 4), (SEE_64.into(), 4)]);
            out.extend_from_slice(name.as_bytes());
            let before = unpacked.unwrap_or(*size);
            put(&mut out, &[(EXTENSION_64.into(), 2), (24, 2), (before, 8), (*size, 8), (*offset, 8)]);
        }
        let (length, count) = (out.len() as u64, self.entries.len() as u64);
        put(&mut out, &[(END_64.into(), 4), (44, 8), (VERSION.into(), 2), (VERSION.into(), 2), (0, 4), (0, 4)]);
        put(&mut out, &[(count, 8), (count, 8), (length, 8), (start, 8)]);
        put(&mut out, &[(LOCATOR_64.into(), 4), (0, 4), (start + length, 8), (1, 4)]);
        put(&mut out, &[(END.into(), 4), (0, 2), (0, 2), (0xffff, 2), (0xffff, 2), (SEE_64.into(), 4)]);
        put(&mut out, &[(SEE_64.into(), 4), (0, 2)]);
        self.to.write_all(&out)?;
        self.to.flush()?;
        Ok(self.to)
    }
}

/// A file in an archive, as it is there.
struct Found<'b> {
    name: &'b str,
    method: u16,
    data: &'b [u8],
    unpacked: u64,
    crc: u64,
}

/// The files of an archive that [`Archive`] has written, by name, without those that are packed; `None` where it is none.
pub(crate) fn parse(bytes: &[u8]) -> Option<Vec<(&str, &[u8])>> {
    let stored = find(bytes)?.into_iter().filter(|found| found.method == STORED);
    stored.map(|found| (crc_of(found.data) == found.crc).then_some((found.name, found.data))).collect()
}

/// All of them, unpacked.
pub(crate) fn unpack(bytes: &[u8]) -> Option<Vec<(String, Vec<u8>)>> {
    let unpacked = |found: Found<'_>| {
        let data = match found.method {
            STORED => found.data.to_vec(),
            DEFLATED => {
                let mut data = Vec::new();
                // One more than there should be tells what lies about its size.
                DeflateDecoder::new(found.data).take(found.unpacked + 1).read_to_end(&mut data).ok()?;
                data
            }
            _ => return None,
        };
        let whole = data.len() as u64 == found.unpacked && crc_of(&data) == found.crc;
        whole.then(|| (found.name.to_string(), data))
    };
    let files = find(bytes)?;
    let all = files.iter().try_fold(0_u64, |all, file| all.checked_add(file.unpacked));
    if all.is_none_or(|all| all > LARGEST) {
        return None;
    }
    files.into_iter().map(unpacked).collect()
}

fn crc_of(data: &[u8]) -> u64 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(data);
    crc.finalize().into()
}

fn find(bytes: &[u8]) -> Option<Vec<Found<'_>>> {
    fn number(bytes: &[u8], at: usize, count: usize) -> Option<u64> {
        let mut all = [0; 8];
        all[..count].copy_from_slice(bytes.get(at..at.checked_add(count)?)?);
        Some(u64::from_le_bytes(all))
    }
    let place = |at: usize, count| usize::try_from(number(bytes, at, count)?).ok();
    let end = bytes.len().checked_sub(22)?;
    let locator = end.checked_sub(20)?;
    if number(bytes, end, 4)? != u64::from(END) || number(bytes, locator, 4)? != u64::from(LOCATOR_64) {
        return None;
    }
    let end_64 = place(locator + 8, 8)?;
    let (count, mut at) = (place(end_64.checked_add(32)?, 8)?, place(end_64.checked_add(48)?, 8)?);
    let (mut files, mut sum) = (Vec::new(), 0_usize);
    for _ in 0..count {
        bytes.get(at..)?;
        let name_length = place(at.checked_add(28)?, 2)?;
        let name = std::str::from_utf8(bytes.get(at + 46..at + 46 + name_length)?).ok()?;
        let extension = at + 46 + name_length + 4;
        let (unpacked, size) = (number(bytes, extension, 8)?, place(extension.checked_add(8)?, 8)?);
        let offset = place(extension.checked_add(16)?, 8)?;
        bytes.get(offset..)?;
        let begin = offset.checked_add(30 + place(offset.checked_add(26)?, 2)? + place(offset.checked_add(28)?, 2)?)?;
        let data = bytes.get(begin..begin.checked_add(size)?)?;
        let method = u16::try_from(place(at + 10, 2)?).ok()?;
        // Each has its own bytes of the archive: several that share some would be read again and again.
        sum = sum.checked_add(size).filter(|sum| *sum <= bytes.len())?;
        files.push(Found { name, method, data, unpacked, crc: number(bytes, at + 16, 4)? });
        at = extension + 24;
    }
    Some(files)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use std::io::Cursor;

    #[test]
    fn what_was_put_in_comes_out_and_damage_is_found() {
        let mut archive = Archive::new(Cursor::new(Vec::new()));
        archive.add("a.npy", b"head", &mut &b" and data"[..]).unwrap();
        archive.add("empty", b"", &mut io::empty()).unwrap();
        let meshes = b"v 0.1 0.2 0.3\n".repeat(1000);
        archive.add_packed("meshes/a.obj", &meshes).unwrap();
        archive.add("behind", b"", &mut &b"x"[..]).unwrap();
        let mut bytes = archive.finish().unwrap().into_inner();
        assert!(bytes.len() < 1500, "{}", bytes.len());
        let all = unpack(&bytes).unwrap();
        assert_eq!(
            all.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(),
            ["a.npy", "empty", "meshes/a.obj", "behind"]
        );
        assert!(all[2].1 == meshes && all[3].1 == b"x" && all[0].1 == b"head and data");
        let stored = [("a.npy", &b"head and data"[..]), ("empty", &b""[..]), ("behind", &b"x"[..])];
        assert_eq!(parse(&bytes).unwrap(), stored);
        assert_eq!(parse(&bytes[..bytes.len() - 1]), None);
        let place = bytes.windows(4).position(|four| four == b"head").unwrap();
        bytes[place] ^= 1;
        assert_eq!(parse(&bytes), None);
        assert_eq!(unpack(&bytes), None);
        bytes[place] ^= 1;
        // Entries that share their bytes, each of which would be read again.
        let mut archive = Archive::new(Cursor::new(Vec::new()));
        archive.add("a", b"", &mut &[7; 1000][..]).unwrap();
        let again = archive.entries.remove(0);
        let Entry { offset, size, unpacked, crc, .. } = again;
        archive.entries.extend(["a", "b"].map(|name| Entry { name: name.into(), offset, size, unpacked, crc }));
        let shared = archive.finish().unwrap().into_inner();
        assert!(parse(&shared).is_none() && unpack(&shared).is_none());
        let name = bytes.windows(12).position(|name| name == b"meshes/a.obj").unwrap();
        bytes[name + 12 + 20 + 5] ^= 1;
        assert_eq!(unpack(&bytes), None, "what is packed is compared with its checksum too");
    }
}
