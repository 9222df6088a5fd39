//! Records of MCAP files, one after another, those inside chunks included.
//!
//! Lengths in a file may be wrong. A record is never longer than the file, and a chunk never has more than its compressed
//! bytes can contain, so memory is in proportion to the file.

use mcap::McapError;
use mcap::records::{ChunkHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::fs::File;
use std::io::{self, BufReader, Read as _};

/// Largest number of bytes that are requested at once.
const READ_SIZE: usize = 1 << 20;
/// Uncompressed bytes per compressed byte: an LZ4 block has at most 255.
const MAX_COMPRESSION: u64 = 255;
/// Bytes before the content of a record: its type and its length.
const HEAD: usize = 9;

/// Reason why the records of a file end early.
pub(crate) enum ReadError<E> {
    /// The file cannot be read.
    File(io::Error),
    /// The rest of the file cannot be understood.
    Format(McapError),
    /// The visitor does not want more records.
    Visitor(E),
}

/// Calls `visit` for each record of a file, from its start: with the record, or with the error of one that cannot be
/// parsed. The checksum of a chunk is verified before its records are visited. `is_whole` demands the end of a complete
/// file.
pub(crate) fn visit_records<E>(
    file: &File,
    is_whole: bool,
    mut visit: impl FnMut(Result<Record<'_>, McapError>) -> Result<(), E>,
) -> Result<(), ReadError<E>> {
    let bytes = file.metadata().map_err(ReadError::File)?.len();
    // mcap 0.26 subtracts lengths of records inside chunks without a check, so chunks are read here.
    let options = LinearReaderOptions::default()
        .with_skip_end_magic(!is_whole)
        .with_emit_chunks(true)
        .with_record_length_limit(usize::try_from(bytes).unwrap_or(usize::MAX));
    let (mut reader, mut file) = (LinearReader::new_with_options(options), BufReader::with_capacity(READ_SIZE, file));
    while let Some(event) = reader.next_event() {
        match event.map_err(ReadError::Format)? {
            LinearReadEvent::ReadRequest(wanted) => {
                let count = file.read(reader.insert(wanted.min(READ_SIZE))).map_err(ReadError::File)?;
                reader.notify_read(count);
            }
            LinearReadEvent::Record { opcode: op::CHUNK, data } => match parse(op::CHUNK, data) {
                Ok(Record::Chunk { header, data }) => {
                    let content = content(&header, &data).map_err(ReadError::Format)?;
                    visit_chunk(&content, &mut visit)?;
                }
                Ok(_) => {}
                Err(error) => return Err(ReadError::Format(error)),
            },
            LinearReadEvent::Record { opcode, data } => visit(parse(opcode, data)).map_err(ReadError::Visitor)?,
        }
    }
    Ok(())
}

fn visit_chunk<E>(
    mut content: &[u8],
    visit: &mut impl FnMut(Result<Record<'_>, McapError>) -> Result<(), E>,
) -> Result<(), ReadError<E>> {
    while let Some((head, rest)) = content.split_first_chunk::<HEAD>() {
        let [opcode, length @ ..] = *head;
        let length = u64::from_le_bytes(length);
        let body = usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length));
        let Some((body, rest)) = body else { return Err(ReadError::Format(McapError::UnexpectedEoc)) };
        visit(parse(opcode, body)).map_err(ReadError::Visitor)?;
        content = rest;
    }
    if content.is_empty() { Ok(()) } else { Err(ReadError::Format(McapError::UnexpectedEoc)) }
}

/// Uncompressed content of a chunk, with the right checksum.
fn content(header: &ChunkHeader, data: &[u8]) -> Result<Vec<u8>, McapError> {
    let wanted = header.uncompressed_size;
    let limit = (data.len() as u64).saturating_mul(MAX_COMPRESSION);
    let mut content = Vec::new();
    match header.compression.as_str() {
        _ if wanted > limit => return Err(McapError::ChunkTooLarge(wanted)),
        "" => content.extend_from_slice(data),
        "lz4" => {
            // One byte more shows that the content is longer than the header says.
            let mut reader = lz4::Decoder::new(data)?.take(wanted + 1);
            reader.read_to_end(&mut content).map_err(|error| McapError::DecompressionError(error.to_string()))?;
        }
        other => return Err(McapError::UnsupportedCompression(other.into())),
    }
    if content.len() as u64 != wanted {
        return Err(McapError::BadChunkLength { header: wanted, available: content.len() as u64 });
    }
    let (saved, calculated) = (header.uncompressed_crc, crc32fast::hash(&content));
    if saved != 0 && saved != calculated { Err(McapError::BadChunkCrc { saved, calculated }) } else { Ok(content) }
}

/// Parses a record. mcap 0.26 reads attachments that end before their checksum out of bounds.
fn parse(opcode: u8, body: &[u8]) -> Result<Record<'_>, McapError> {
    if opcode == op::ATTACHMENT && attachment_head(body).is_none_or(|head| head + size_of::<u32>() > body.len()) {
        return Err(McapError::BadAttachmentLength { header: 0, available: body.len() as u64 });
    }
    mcap::parse_record(opcode, body)
}

/// Number of bytes of an attachment before its data: two times, the name, the media type and the length of the data.
/// `None` if `body` ends before.
fn attachment_head(body: &[u8]) -> Option<usize> {
    let mut at = 2 * size_of::<u64>();
    for _text in ["name", "media type"] {
        let length = u32::from_le_bytes(*body.get(at..)?.first_chunk()?);
        at = at.checked_add(size_of::<u32>())?.checked_add(usize::try_from(length).ok()?)?;
    }
    at.checked_add(size_of::<u64>()).filter(|&at| at <= body.len())
}
