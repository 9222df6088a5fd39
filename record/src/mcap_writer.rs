//! MCAP files of ROS 2 messages ([`ros_writer`](crate::ros_writer) lists the topics).
//!
//! | content | place |
//! |---|---|
//! | names of mask ids | metadata `mask_ids`, `mask_classes`: maps from the id to the name and the class |
//! | the scene | attachment `scene.zip`: MJCF with meshes, see `scene_file.rs` |
//! | metadata, initial state | attachments `recording.json`, `start.snapshot`, as in NumPy archives |

use crate::file::{PartialFile, Storage};
use crate::packet::Packet;
use crate::ros::{ENCODING, SCHEMA_ENCODING, Schema};
use crate::ros_writer::{MessageLifetime, MessageSink, RosWriter, nanos};
use crate::stream::StreamSchema;
use crate::writer::{FormatWriter, WriteResult};
use kinetoscope_sim::MaskId;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use ndarray::Array2;
use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

/// Size of the messages that are compressed together \[bytes\].
const CHUNK: u64 = 1 << 20;
const PROFILE: &str = "ros2";

/// Writer of an MCAP file.
pub(crate) struct McapWriter {
    part: PartialFile,
    messages: RosWriter<McapSink>,
}

/// The file that gets messages.
struct McapSink {
    /// `None` once the file is complete.
    writer: Option<Writer<BufWriter<Box<dyn Storage>>>>,
    schemas: BTreeMap<Schema, u16>,
    /// Number of messages in each channel.
    counts: BTreeMap<u16, u32>,
}

impl MessageSink for McapSink {
    fn add_channel(
        &mut self,
        topic: &str,
        schema: Schema,
        metadata: BTreeMap<String, String>,
        _: MessageLifetime,
    ) -> io::Result<u16> {
        let writer = self.writer.as_mut().ok_or_else(finished)?;
        let schema_id = match self.schemas.get(&schema) {
            Some(id) => *id,
            None => {
                let id =
                    writer.add_schema(schema.name(), SCHEMA_ENCODING, schema.text().as_bytes()).map_err(io_error)?;
                self.schemas.insert(schema, id);
                id
            }
        };
        writer.add_channel(schema_id, topic, ENCODING, &metadata).map_err(io_error)
    }

    fn wants(&self, _: u16) -> bool {
        true
    }

    fn write(&mut self, channel: u16, nanos: u64, data: &[u8]) -> io::Result<()> {
        let writer = self.writer.as_mut().ok_or_else(finished)?;
        let sequence = self.counts.entry(channel).or_insert(0);
        let header = MessageHeader { channel_id: channel, sequence: *sequence, log_time: nanos, publish_time: nanos };
        *sequence = sequence.wrapping_add(1);
        writer.write_to_known_channel(&header, data).map_err(io_error)
    }
}

pub(crate) fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

fn finished() -> io::Error {
    io::Error::other("the file was finished already")
}

pub(crate) fn options() -> WriteOptions {
    WriteOptions::new()
        .compression(Some(Compression::Lz4))
        .chunk_size(Some(CHUNK))
        // Chunks are assembled in memory and written with their lengths, so that a kill leaves no wrong length.
        .disable_seeking(true)
        .profile(PROFILE)
        .library(concat!("kinetoscope ", env!("CARGO_PKG_VERSION")))
}

impl McapWriter {
    /// Creates a file. `origins` are the origins of all environments in the world \[m\], shape (N, 3). `start` is the
    /// time at which the recording begins \[s\]. `attachments` has the name, media type and content of each.
    pub(crate) fn create(
        mut part: PartialFile,
        storage: Box<dyn Storage>,
        streams: &[StreamSchema],
        origins: &Array2<f64>,
        masks: &[MaskId],
        start: f64,
        attachments: &[(&str, &str, Vec<u8>)],
    ) -> io::Result<Self> {
        let to = BufWriter::with_capacity(1 << 16, storage);
        let mut writer = options().create(to).map_err(io_error)?;
        for (name, media_type, data) in attachments {
            let (name, media_type, data) = ((*name).into(), (*media_type).into(), data.into());
            let at = nanos(start);
            writer.attach(&Attachment { log_time: at, create_time: at, name, media_type, data }).map_err(io_error)?;
        }
        let class = |id: &MaskId| id.class.clone();
        for (name, of) in [("mask_ids", MaskId::name as fn(&MaskId) -> String), ("mask_classes", class)] {
            let metadata = masks.iter().map(|id| (id.id.to_string(), of(id))).collect();
            writer.write_metadata(&Metadata { name: name.into(), metadata }).map_err(io_error)?;
        }
        let sink = McapSink { writer: Some(writer), schemas: BTreeMap::new(), counts: BTreeMap::new() };
        let messages = RosWriter::create(sink, streams, origins, start)?;
        part.keep();
        Ok(Self { part, messages })
    }
}

impl FormatWriter for McapWriter {
    fn write(&mut self, streams: &[StreamSchema], packet: &Packet) -> WriteResult {
        self.messages.write(streams, packet)
    }

    /// Ends the chunk. The remainder of a killed process ends with a complete chunk.
    fn flush(&mut self) -> WriteResult {
        Ok(self.messages.sink.writer.as_mut().ok_or_else(finished)?.flush().map_err(io_error)?)
    }

    fn finish(&mut self, _streams: &[StreamSchema]) -> WriteResult<u64> {
        let mut writer = self.messages.sink.writer.take().ok_or_else(finished)?;
        writer.finish().map_err(io_error)?;
        writer.into_inner().flush()?;
        Ok(self.part.commit()?)
    }

    fn partial_path(&self) -> Option<PathBuf> {
        self.part.kept_path()
    }
}
