//! Whole MCAP files of what killed recordings have left.

use crate::error::{RecordError, Result};
use crate::file::{PartFile, lock_left, part_of, remove};
use crate::mcap_file::{io_error, options};
use mcap::records::{AttachmentHeader, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{Attachment, McapError, Writer};
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Chunks are smaller by far, before they are compressed \[bytes\].
const LARGEST_CHUNK: usize = 1 << 30;

/// What was made of a recording that was killed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recovered {
    /// Messages in the file.
    pub messages: u64,
    /// What stands in the way of the rest, where that is more than a last chunk that was not written whole: then what was left
    /// is still there, for other tools.
    pub damage: Option<String>,
}

/// Makes a whole file of what a recording has left that was killed: `path` is the name that it was to have. The scene, and
/// the messages of all chunks from the beginning that are whole, are in it, and what was left is taken away, unless something in
/// it is damaged. It is read a chunk at a time: large files take no more memory than small ones.
///
/// # Errors
/// There is no such recording, somebody is writing it, there is a file called `path` already, or no message can be read.
/// What was left is as it was then.
pub fn recover(path: impl AsRef<Path>) -> Result<Recovered> {
    recover_to(&path, &path)
}

/// As [`recover`], but the whole file is called `to`.
///
/// # Errors
/// As [`recover`]; there is a file called `to` already.
pub fn recover_to(path: impl AsRef<Path>, to: impl AsRef<Path>) -> Result<Recovered> {
    let (path, to) = (path.as_ref(), to.as_ref());
    let left = part_of(path);
    let missing = || RecordError::file(&left, io::ErrorKind::NotFound.into());
    let mut locked = lock_left(&left)?.ok_or_else(missing)?;
    let failed_to_read = |error| RecordError::file(&left, error);
    let nothing =
        |why: String| RecordError::Malformed { path: left.clone(), what: format!("nothing of it can be read: {why}") };
    let mut magic = Vec::new();
    let mut head = (&mut locked).take(mcap::MAGIC.len() as u64);
    head.read_to_end(&mut magic).map_err(failed_to_read)?;
    if magic != mcap::MAGIC {
        return Err(nothing("this is no MCAP file".into()));
    }
    locked.seek(SeekFrom::Start(0)).map_err(failed_to_read)?;
    // What an earlier attempt left that was killed is of no use.
    let on_the_way = part_of(to).with_extension("recovered");
    remove(&on_the_way)?;
    let (mut part, file) = PartFile::create_as(to, on_the_way, false)?;
    let failed = |error: McapError| RecordError::file(to, io_error(error));
    let mut writer = options().create(BufWriter::new(file)).map_err(failed)?;
    let recovered = match copy(&mut locked, &mut writer) {
        Ok(recovered) => recovered,
        Err(Broken::Read(error)) => return Err(failed_to_read(error)),
        Err(Broken::Write(error)) => return Err(failed(error)),
    };
    if recovered.messages == 0 {
        return Err(nothing(recovered.damage.unwrap_or_else(|| "there is no whole message in it".into())));
    }
    writer.finish().map_err(failed)?;
    writer.into_inner().flush().map_err(|error| RecordError::file(to, error))?;
    part.commit().map_err(|error| RecordError::file(to, error))?;
    if recovered.damage.is_none() {
        remove(&left)?;
    }
    Ok(recovered)
}

/// Which of the two files could not go on.
enum Broken {
    Read(io::Error),
    Write(McapError),
}

/// Copies everything of whole and undamaged chunks from the beginning of a file. Chunks are compared with their checksums before
/// anything in them is believed: a length that is no length would be asked for as memory.
fn copy(from: &mut File, to: &mut Writer<impl Write + Seek>) -> std::result::Result<Recovered, Broken> {
    let bytes = from.metadata().map_err(Broken::Read)?.len();
    let options = LinearReaderOptions::default()
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(usize::try_from(bytes).unwrap_or(usize::MAX).max(LARGEST_CHUNK));
    let mut reader = LinearReader::new_with_options(options);
    let mut recovered = Recovered { messages: 0, damage: None };
    while let Some(event) = reader.next_event() {
        let (opcode, data) = match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let count = from.read(reader.insert(wanted)).map_err(Broken::Read)?;
                reader.notify_read(count);
                continue;
            }
            Ok(LinearReadEvent::Record { opcode, data }) => (opcode, data),
            // Where the process was killed.
            Err(McapError::UnexpectedEof) => break,
            Err(error) => {
                recovered.damage = Some(error.to_string());
                break;
            }
        };
        let copied = match mcap::parse_record(opcode, data) {
            Ok(Record::Schema { header, data }) => {
                to.add_schema_with_id(header.id, &header.name, &header.encoding, &data).map(|_| ())
            }
            Ok(Record::Channel(channel)) => {
                let mcap::records::Channel { id, schema_id, topic, message_encoding, metadata } = channel;
                to.add_channel_with_id(id, schema_id, &topic, &message_encoding, &metadata).map(|_| ())
            }
            Ok(Record::Message { header, data }) => {
                let written = to.write_to_known_channel(&header, &data);
                recovered.messages += u64::from(written.is_ok());
                written
            }
            Ok(Record::Attachment { header, data, .. }) => {
                let AttachmentHeader { log_time, create_time, name, media_type } = header;
                to.attach(&Attachment { log_time, create_time, name, media_type, data })
            }
            Ok(Record::Metadata(metadata)) => to.write_metadata(&metadata),
            Ok(_) => Ok(()),
            // The messages may be whole; that something is lost is said.
            Err(error) => {
                recovered.damage.get_or_insert(error.to_string());
                Ok(())
            }
        };
        match copied {
            Ok(()) => {}
            Err(McapError::Io(error)) => return Err(Broken::Write(McapError::Io(error))),
            // Records that contradict each other are damage.
            Err(error) => {
                recovered.damage = Some(error.to_string());
                break;
            }
        }
    }
    Ok(recovered)
}
