//! Recovery of MCAP files from killed recordings.

use crate::error::{RecordError, Result};
use crate::file::{PartialFile, lock_partial_file, partial_path_of, remove_file_if_exists};
use crate::mcap_records::{ReadError, visit_records};
use crate::mcap_writer::{io_error, options};
use mcap::records::{AttachmentHeader, Record};
use mcap::{Attachment, McapError, Writer};
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Number of recovered messages, and damage of the partial file, from [`recover`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recovered {
    /// Number of messages in the recovered file.
    pub messages: u64,
    /// Damage other than an incomplete last chunk; `None` if there is no such damage. After such damage, the partial
    /// file is kept for other tools.
    pub damage: Option<String>,
}

/// Makes a complete MCAP file from the partial file of a killed recording. `path` is the intended name of the
/// recording, without `.part`.
///
/// The new file contains the scene and the messages of all chunks before the first incomplete or damaged one. The
/// partial file is then deleted. It is kept if it has damage other than an incomplete last chunk
/// ([`Recovered::damage`]). It is read chunk by chunk, so the memory does not depend on its size.
///
/// # Errors
/// There is no partial file, it is not an MCAP file, a recorder is writing it, the file `path` exists, no message can
/// be read, or a file cannot be read or written. On an error, the partial file is kept.
pub fn recover(path: impl AsRef<Path>) -> Result<Recovered> {
    recover_to(&path, &path)
}

/// Recovers the partial file of the recording `path` into the file `to`, as [`recover`] does.
///
/// # Errors
/// There is no partial file, it is not an MCAP file, a recorder is writing it, the file `to` exists, no message can be
/// read, or a file cannot be read or written. On an error, the partial file is kept.
pub fn recover_to(path: impl AsRef<Path>, to: impl AsRef<Path>) -> Result<Recovered> {
    let (path, to) = (path.as_ref(), to.as_ref());
    let left = partial_path_of(path);
    let missing = || RecordError::file(&left, io::ErrorKind::NotFound.into());
    let mut locked = lock_partial_file(&left)?.ok_or_else(missing)?;
    let failed_to_read = |error| RecordError::file(&left, error);
    let nothing =
        |why: String| RecordError::Malformed { path: left.clone(), what: format!("it cannot be recovered: {why}") };
    let mut magic = Vec::new();
    let mut head = (&mut locked).take(mcap::MAGIC.len() as u64);
    head.read_to_end(&mut magic).map_err(failed_to_read)?;
    if magic != mcap::MAGIC {
        return Err(nothing("this is not an MCAP file".into()));
    }
    locked.seek(SeekFrom::Start(0)).map_err(failed_to_read)?;
    // Removes the remainder of an earlier attempt that was killed.
    let on_the_way = partial_path_of(to).with_extension("recovered");
    remove_file_if_exists(&on_the_way)?;
    let (mut part, file) = PartialFile::create_as(to, on_the_way, false)?;
    let failed = |error: McapError| RecordError::file(to, io_error(error));
    let mut writer = options().create(BufWriter::new(file)).map_err(failed)?;
    let recovered = match copy(&locked, &mut writer) {
        Ok(recovered) => recovered,
        Err(CopyError::Read(error)) => return Err(failed_to_read(error)),
        Err(CopyError::Write(error)) => return Err(failed(error)),
    };
    if recovered.messages == 0 {
        return Err(nothing(recovered.damage.unwrap_or_else(|| "it has no complete message".into())));
    }
    writer.finish().map_err(failed)?;
    writer.into_inner().flush().map_err(|error| RecordError::file(to, error))?;
    part.commit().map_err(|error| RecordError::file(to, error))?;
    if recovered.damage.is_none() {
        remove_file_if_exists(&left)?;
    }
    Ok(recovered)
}

/// Error of one of the two files.
enum CopyError {
    Read(io::Error),
    Write(McapError),
}

/// Copies everything from complete and undamaged chunks at the beginning of a file.
fn copy(from: &File, to: &mut Writer<impl Write + Seek>) -> std::result::Result<Recovered, CopyError> {
    let mut recovered = Recovered { messages: 0, damage: None };
    let read = visit_records(from, false, |record| match record {
        Ok(record) => copy_record(record, to, &mut recovered.messages),
        // Other messages may be complete. The damage is reported.
        Err(error) => {
            recovered.damage.get_or_insert(error.to_string());
            Ok(())
        }
    });
    match read {
        // The process was killed here.
        Ok(()) | Err(ReadError::Format(McapError::UnexpectedEof)) => {}
        Err(ReadError::File(error)) => return Err(CopyError::Read(error)),
        Err(ReadError::Visitor(McapError::Io(error))) => return Err(CopyError::Write(McapError::Io(error))),
        // Contradicting records are damage.
        Err(ReadError::Format(error) | ReadError::Visitor(error)) => recovered.damage = Some(error.to_string()),
    }
    Ok(recovered)
}

fn copy_record(
    record: Record<'_>,
    to: &mut Writer<impl Write + Seek>,
    messages: &mut u64,
) -> std::result::Result<(), McapError> {
    match record {
        Record::Schema { header, data } => {
            to.add_schema_with_id(header.id, &header.name, &header.encoding, &data).map(|_| ())
        }
        Record::Channel(channel) => {
            let mcap::records::Channel { id, schema_id, topic, message_encoding, metadata } = channel;
            to.add_channel_with_id(id, schema_id, &topic, &message_encoding, &metadata).map(|_| ())
        }
        Record::Message { header, data } => {
            to.write_to_known_channel(&header, &data)?;
            *messages += 1;
            Ok(())
        }
        Record::Attachment { header, data, .. } => {
            let AttachmentHeader { log_time, create_time, name, media_type } = header;
            to.attach(&Attachment { log_time, create_time, name, media_type, data })
        }
        Record::Metadata(metadata) => to.write_metadata(&metadata),
        _ => Ok(()),
    }
}
