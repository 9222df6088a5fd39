//! Parquet files with the features that LeRobot datasets need: flat columns, lists of equal length and images, without
//! compression and missing values. The layout follows the Apache Parquet format; metadata are in Thrift's compact
//! protocol.

use crate::writer::{WriteError, WriteResult};
use std::io::Write;

/// Type of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ColumnType {
    /// 64-bit integer.
    Int64,
    /// Boolean, passed as one byte, 1 or 0, and packed when written.
    Bool,
    /// This number of floats; one alone is no list.
    Float32(usize),
    /// A string.
    String,
    /// A list of one string.
    StringList,
    /// An image file and its name.
    Image,
}

/// A physical column. Images have two.
struct Leaf {
    path: Vec<String>,
    /// Physical type: 0 BOOLEAN, 2 INT64, 4 FLOAT, 6 BYTE_ARRAY.
    physical: i64,
    /// Length of the lists, for a column of lists.
    list: Option<usize>,
}

/// Writer of a file: row groups in sequence, then the metadata.
pub(crate) struct ParquetWriter {
    columns: Vec<(String, ColumnType)>,
    leaves: Vec<Leaf>,
    /// Bytes written so far.
    offset: u64,
    rows: u64,
    groups: Vec<RowGroup>,
}

struct RowGroup {
    rows: u64,
    /// For each leaf: offset of its page, size of the page, offset of the values.
    pages: Vec<(u64, u64, u64)>,
}

const MAGIC: &[u8; 4] = b"PAR1";
const BOOLEAN: i64 = 0;

impl ParquetWriter {
    pub(crate) fn new(columns: Vec<(String, ColumnType)>) -> Self {
        let leaf = |(name, kind): &(String, ColumnType)| {
            let one = |below: &[&str], physical, list| {
                let path = std::iter::once(&**name).chain(below.iter().copied()).map(String::from).collect();
                Leaf { path, physical, list }
            };
            let listed = |physical, width| one(&["list", "element"], physical, Some(width));
            match *kind {
                ColumnType::Int64 => vec![one(&[], 2, None)],
                ColumnType::Bool => vec![one(&[], BOOLEAN, None)],
                ColumnType::Float32(1) => vec![one(&[], 4, None)],
                ColumnType::Float32(width) => vec![listed(4, width)],
                ColumnType::String => vec![one(&[], 6, None)],
                ColumnType::StringList => vec![listed(6, 1)],
                ColumnType::Image => vec![one(&["bytes"], 6, None), one(&["path"], 6, None)],
            }
        };
        let leaves = columns.iter().flat_map(leaf).collect();
        Self { columns, leaves, offset: 0, rows: 0, groups: Vec::new() }
    }

    /// Number of physical columns.
    pub(crate) fn width(&self) -> usize {
        self.leaves.len()
    }

    /// Writes a row group: the little-endian values of each leaf, concatenated. Strings and files are prefixed by their
    /// lengths ([`put_bytes`]).
    pub(crate) fn write(&mut self, out: &mut impl Write, rows: usize, values: &[Vec<u8>]) -> WriteResult {
        if self.offset == 0 {
            out.write_all(MAGIC)?;
            self.offset = MAGIC.len() as u64;
        }
        let mut pages = Vec::new();
        for (leaf, values) in self.leaves.iter().zip(values) {
            // Eight per byte, the first in the lowest bit.
            let bits = |eight: &[u8]| eight.iter().enumerate().fold(0, |byte, (k, one)| byte | (one & 1) << k);
            let packed: Vec<u8> =
                if leaf.physical == BOOLEAN { values.chunks(8).map(bits).collect() } else { Vec::new() };
            let values = if leaf.physical == BOOLEAN { &packed } else { values };
            let count = rows * leaf.list.unwrap_or(1);
            let levels = leaf.list.map_or_else(Vec::new, |width| levels(rows, width));
            let size = levels.len() + values.len();
            let page = page_head(size, count)?;
            [&page, &levels, values].into_iter().try_for_each(|bytes| out.write_all(bytes))?;
            let (head, size) = (page.len() as u64, size as u64);
            pages.push((self.offset, head + size, self.offset + head + levels.len() as u64));
            self.offset += head + size;
        }
        self.rows += rows as u64;
        self.groups.push(RowGroup { rows: rows as u64, pages });
        Ok(())
    }

    /// File offset of the values and number of rows of each row group, for an integer column.
    pub(crate) fn value_offsets(&self, name: &str) -> Vec<(u64, u64)> {
        let leaf = self.leaves.iter().position(|leaf| leaf.path == [name]);
        let place = |group: &RowGroup| leaf.and_then(|leaf| group.pages.get(leaf)).map(|page| (page.2, group.rows));
        self.groups.iter().filter_map(place).collect()
    }

    /// Writes the metadata, which ends the file. `about` are key-value pairs for readers.
    pub(crate) fn finish(&mut self, out: &mut impl Write, about: &[(&str, &str)]) -> WriteResult {
        if self.offset == 0 {
            out.write_all(MAGIC)?;
        }
        let mut file = Thrift::default();
        file.int(1, 5, 1);
        self.schema(&mut file);
        file.int(3, 6, checked_int(self.rows)?);
        file.list(4, 12, self.groups.len());
        for group in &self.groups {
            file.begin_struct();
            file.list(1, 12, self.leaves.len());
            for (leaf, (at, bytes, _)) in self.leaves.iter().zip(&group.pages) {
                file.begin_struct();
                file.int(2, 6, checked_int(*at)?);
                file.begin_struct_field(3);
                file.int(1, 5, leaf.physical);
                file.list(2, 5, 2); // PLAIN, RLE
                [0, 3].into_iter().for_each(|encoding| file.zigzag(encoding));
                file.list(3, 8, leaf.path.len());
                leaf.path.iter().for_each(|part| file.binary(part.as_bytes()));
                file.int(4, 5, 0); // uncompressed
                file.int(5, 6, checked_int(group.rows * leaf.list.unwrap_or(1) as u64)?);
                file.int(6, 6, checked_int(*bytes)?);
                file.int(7, 6, checked_int(*bytes)?);
                file.int(9, 6, checked_int(*at)?);
                file.end_struct();
                file.end_struct();
            }
            file.int(2, 6, checked_int(group.pages.iter().map(|page| page.1).sum::<u64>())?);
            file.int(3, 6, checked_int(group.rows)?);
            file.end_struct();
        }
        if !about.is_empty() {
            file.list(5, 12, about.len());
            for (key, value) in about {
                file.begin_struct();
                file.text(1, key);
                file.text(2, value);
                file.end_struct();
            }
        }
        file.text(6, "kinetoscope");
        file.end_struct();
        out.write_all(&file.bytes)?;
        // Readers treat the length as signed.
        out.write_all(&checked_int::<i32>(file.bytes.len() as u64)?.to_le_bytes())?;
        Ok(out.write_all(MAGIC)?)
    }

    fn schema(&self, file: &mut Thrift) {
        // Elements in depth-first order: type, repetition (0 required, 2 repeated), name, children, converted type.
        type Element<'e> = (Option<i64>, Option<i64>, &'e str, Option<usize>, Option<i64>);
        let mut elements: Vec<Element<'_>> = vec![(None, None, "schema", Some(self.columns.len()), None)];
        const UTF8: Option<i64> = Some(0);
        for (name, kind) in &self.columns {
            let mut list = |physical, converted| {
                elements.push((None, Some(0), name.as_str(), Some(1), Some(3)));
                elements.push((None, Some(2), "list", Some(1), None));
                elements.push((Some(physical), Some(0), "element", None, converted));
            };
            match kind {
                ColumnType::Float32(width) if *width != 1 => list(4, None),
                ColumnType::StringList => list(6, UTF8),
                ColumnType::Float32(_) => elements.push((Some(4), Some(0), name.as_str(), None, None)),
                ColumnType::Int64 => elements.push((Some(2), Some(0), name.as_str(), None, None)),
                ColumnType::Bool => elements.push((Some(BOOLEAN), Some(0), name.as_str(), None, None)),
                ColumnType::String => elements.push((Some(6), Some(0), name.as_str(), None, UTF8)),
                ColumnType::Image => {
                    elements.push((None, Some(0), name.as_str(), Some(2), None));
                    elements.push((Some(6), Some(0), "bytes", None, None));
                    elements.push((Some(6), Some(0), "path", None, UTF8));
                }
            }
        }
        file.list(2, 12, elements.len());
        for (physical, repetition, name, children, converted) in elements {
            file.begin_struct();
            let mut int = |field, value: Option<i64>| value.into_iter().for_each(|value| file.int(field, 5, value));
            int(1, physical);
            int(3, repetition);
            file.text(4, name);
            let mut int = |field, value: Option<i64>| value.into_iter().for_each(|value| file.int(field, 5, value));
            int(5, children.map(|count| count as i64));
            int(6, converted);
            file.end_struct();
        }
    }
}

/// Appends a string or a file as a value.
pub(crate) fn put_bytes(bytes: &[u8], to: &mut Vec<u8>) -> WriteResult {
    to.extend_from_slice(&checked_int::<i32>(bytes.len() as u64)?.to_le_bytes());
    to.extend_from_slice(bytes);
    Ok(())
}

/// Converts a size or a count to the signed type of the format: 32 bits in pages, 64 bits elsewhere.
fn checked_int<N: TryFrom<u64>>(number: u64) -> WriteResult<N> {
    let too_large = "bytes or rows exceed the limit of a page or table of a Parquet file";
    let error = |_| WriteError::limit(format!("{number} {too_large}; use smaller images or shorter episodes"));
    N::try_from(number).map_err(error)
}

/// Page header for `size` bytes, including the levels, and `count` values.
fn page_head(size: usize, count: usize) -> WriteResult<Vec<u8>> {
    let (size, count) = (checked_int::<i32>(size as u64)?, checked_int::<i32>(count as u64)?);
    let mut page = Thrift::default();
    page.int(1, 5, 0); // data page
    page.int(2, 5, size.into());
    page.int(3, 5, size.into());
    page.begin_struct_field(5);
    page.int(1, 5, count.into());
    page.int(2, 5, 0); // PLAIN
    page.int(3, 5, 3); // levels: RLE
    page.int(4, 5, 3);
    page.end_struct();
    page.end_struct();
    Ok(page.bytes)
}

/// Repetition and definition levels of lists of equal length without missing values, as run-length encoding.
fn levels(rows: usize, width: usize) -> Vec<u8> {
    let run = |count: usize, value: u8, to: &mut Vec<u8>| {
        varint((count as u64) << 1, to);
        to.push(value);
    };
    let (mut repeated, mut defined) = (Vec::new(), Vec::new());
    for _ in 0..rows {
        run(1, 0, &mut repeated);
        if width > 1 {
            run(width - 1, 1, &mut repeated);
        }
    }
    run(rows * width, 1, &mut defined);
    let sized = |levels: Vec<u8>| [(levels.len() as u32).to_le_bytes().to_vec(), levels].concat();
    [sized(repeated), sized(defined)].concat()
}

fn varint(mut number: u64, to: &mut Vec<u8>) {
    while number >= 0x80 {
        to.push(number as u8 | 0x80);
        number >>= 7;
    }
    to.push(number as u8);
}

/// Writer of Thrift's compact protocol, within a top-level structure.
struct Thrift {
    bytes: Vec<u8>,
    /// The last field id of each open structure.
    last: Vec<u8>,
}

impl Default for Thrift {
    fn default() -> Self {
        Self { bytes: Vec::new(), last: vec![0] }
    }
}

impl Thrift {
    /// Begins a field. Fields have ascending ids with differences below 16.
    fn field(&mut self, field: u8, kind: u8) {
        if let Some(last) = self.last.last_mut() {
            self.bytes.push((field - *last) << 4 | kind);
            *last = field;
        }
    }

    fn zigzag(&mut self, number: i64) {
        varint((number << 1 ^ number >> 63) as u64, &mut self.bytes);
    }

    /// Writes an integer; `kind` is 5 for 32 bits and 6 for 64.
    fn int(&mut self, field: u8, kind: u8, number: i64) {
        self.field(field, kind);
        self.zigzag(number);
    }

    fn binary(&mut self, bytes: &[u8]) {
        varint(bytes.len() as u64, &mut self.bytes);
        self.bytes.extend_from_slice(bytes);
    }

    fn text(&mut self, field: u8, text: &str) {
        self.field(field, 8);
        self.binary(text.as_bytes());
    }

    /// Begins a list, whose elements follow.
    fn list(&mut self, field: u8, kind: u8, count: usize) {
        self.field(field, 9);
        if count < 15 {
            self.bytes.push((count as u8) << 4 | kind);
        } else {
            self.bytes.push(0xf0 | kind);
            varint(count as u64, &mut self.bytes);
        }
    }

    /// Begins a structure in a list.
    fn begin_struct(&mut self) {
        self.last.push(0);
    }

    /// Begins a structure in a field.
    fn begin_struct_field(&mut self, field: u8) {
        self.field(field, 12);
        self.begin_struct();
    }

    fn end_struct(&mut self) {
        self.bytes.push(0);
        self.last.pop();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// Root cause: sizes were converted to 64 bits, and written where readers expect 32.
    #[test]
    fn large_pages() {
        let most = i32::MAX as usize;
        // Field 2 of 32 bits, zigzag: twice the size, seven bits per byte, after field 1, which is 0.
        assert_eq!(page_head(most, 1).unwrap()[2..8], [0x15, 0xfe, 0xff, 0xff, 0xff, 0x0f]);
        for (size, count) in [(most + 1, 1), (1, most + 1)] {
            let error = page_head(size, count).unwrap_err();
            assert!(matches!(error, WriteError::Limit(_)) && error.to_string().contains("2147483648"), "{error}");
        }
    }

    #[test]
    fn thrift_numbers() {
        // From the description of the compact protocol: 50 399 is 0xdf 0x89 0x03; -1 becomes 1, 1 becomes 2.
        let mut bytes = Vec::new();
        varint(50_399, &mut bytes);
        assert_eq!(bytes, [0xdf, 0x89, 0x03]);
        let mut thrift = Thrift::default();
        [-1, 1].into_iter().for_each(|number| thrift.zigzag(number));
        assert_eq!(thrift.bytes, [1, 2]);
    }
}
