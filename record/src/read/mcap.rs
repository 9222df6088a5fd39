//! MCAP files of ROS 2 messages, read sequentially by chunks.

use super::{FieldSelector, RecordedTopic, TimeSeries};
use crate::error::{RecordError, Result};
use crate::mcap_records::{ReadError, visit_records};
use crate::ros::{MessageType, PathSegment, SCENE_UPDATE, Value};
use mcap::records::Record;
use mcap::{Attachment, McapError};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// A channel with its message type; `None` for types that cannot be read.
pub(super) struct McapChannel {
    pub(super) topic: String,
    type_name: String,
    pub(super) message_type: Option<Arc<MessageType>>,
}

/// Record of a file that is passed to the visitor.
pub(super) enum McapItem<'r> {
    Message { channel: &'r McapChannel, time: u64, data: &'r [u8] },
    Attachment(Attachment<'r>),
}

/// Reads a whole MCAP file and calls `visit` for each message and attachment, in file order. The first error ends the
/// reading.
pub(super) fn visit_items(path: &Path, mut visit: impl FnMut(McapItem<'_>) -> Result<()>) -> Result<()> {
    let failed = |error: std::io::Error| RecordError::file(path, error);
    let file = File::open(path).map_err(failed)?;
    let malformed = |what: String| RecordError::Malformed { path: path.into(), what };
    let truncated = || {
        let text = "it is truncated; `kinetoscope recover` (record::recover) makes a complete file of the partial file of a \
                    killed recorder";
        malformed(text.into())
    };
    let mut schemas: BTreeMap<u16, (String, Option<Arc<MessageType>>)> = BTreeMap::new();
    let mut channels: BTreeMap<u16, McapChannel> = BTreeMap::new();
    let read = visit_records(&file, true, |record| {
        match record.map_err(|error| malformed(error.to_string()))? {
            Record::Schema { header, data } => {
                // Scene messages have no numbers over time.
                let numbers = header.encoding == "ros2msg" && header.name != SCENE_UPDATE;
                let text = numbers.then(|| std::str::from_utf8(&data).ok()).flatten();
                let reads = text.and_then(MessageType::parse).map(Arc::new);
                schemas.insert(header.id, (header.name, reads));
            }
            Record::Channel(channel) => {
                let (type_name, reads) = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let message_type = reads.filter(|_| channel.message_encoding == "cdr");
                channels.insert(channel.id, McapChannel { topic: channel.topic, type_name, message_type });
            }
            Record::Message { header, data } => {
                let Some(channel) = channels.get(&header.channel_id) else {
                    let what = format!("a message refers to channel {}, which does not exist", header.channel_id);
                    return Err(malformed(what));
                };
                visit(McapItem::Message { channel, time: header.log_time, data: &data })?;
            }
            Record::Attachment { header, data, .. } => {
                let mcap::records::AttachmentHeader { log_time, create_time, name, media_type } = header;
                visit(McapItem::Attachment(Attachment { log_time, create_time, name, media_type, data }))?;
            }
            _ => {}
        }
        Ok(())
    });
    read.map_err(|error| match error {
        ReadError::File(error) => failed(error),
        ReadError::Format(McapError::UnexpectedEof) => truncated(),
        ReadError::Format(McapError::BadMagic) => malformed("this is not an MCAP file, or it is incomplete".into()),
        ReadError::Format(error) => malformed(error.to_string()),
        ReadError::Visitor(error) => error,
    })
}

/// Lists the topics, and warnings about unreadable messages.
pub(super) fn topics(path: &Path) -> Result<(Vec<RecordedTopic>, Vec<String>)> {
    /// A topic while its messages are read; fields are in the order of their first appearance.
    #[derive(Default)]
    struct TopicScan {
        kind: String,
        count: u64,
        fields: Vec<String>,
        known: BTreeSet<String>,
        /// The last message, if it was readable.
        last: Option<Value>,
        /// Number of unreadable messages.
        unread: u64,
        /// Number of the first unreadable message, counted from 1; 0 without one.
        first_unread: u64,
    }
    let mut all: BTreeMap<String, TopicScan> = BTreeMap::new();
    visit_items(path, |told| {
        let McapItem::Message { channel, data, .. } = told else { return Ok(()) };
        if !all.contains_key(&channel.topic) {
            all.insert(channel.topic.clone(), TopicScan { kind: channel.type_name.clone(), ..TopicScan::default() });
        }
        let Some(found) = all.get_mut(&channel.topic) else { return Ok(()) };
        found.count += 1;
        let Some(reads) = &channel.message_type else { return Ok(()) };
        let Some(value) = reads.read(data) else {
            // Other messages of the topic may be readable.
            if found.unread == 0 {
                found.first_unread = found.count;
            }
            found.unread += 1;
            return Ok(());
        };
        if !found.last.as_ref().is_some_and(|last| value.has_fields_of(last)) {
            let mut fields = Vec::new();
            value.fields("", &mut fields);
            let known = &mut found.known;
            found.fields.extend(fields.into_iter().filter(|field| known.insert(field.clone())));
        }
        found.last = Some(value);
        Ok(())
    })?;
    let mut warnings = Vec::new();
    let mut topic = |(name, TopicScan { kind, count, fields, unread, first_unread, .. })| {
        if unread == count {
            warnings.push(format!("{name} is left out: none of its {count} messages can be read as {kind}"));
        } else if unread > 0 {
            warnings.push(format!(
                "{name} lacks {unread} of its {count} messages, which cannot be read as {kind}; the first is message {first_unread}"
            ));
        }
        RecordedTopic { name, kind, count, fields }
    };
    let topics = all.into_iter().map(&mut topic).collect();
    Ok((topics, warnings))
}

/// Reads the selected numbers; topics are given by their full names.
pub(super) fn samples(path: &Path, wanted: &[FieldSelector]) -> Result<Vec<TimeSeries>> {
    let mut by_topic: BTreeMap<&str, Vec<(usize, Vec<PathSegment>)>> = BTreeMap::new();
    for (place, FieldSelector { topic, field }) in wanted.iter().enumerate() {
        by_topic.entry(topic).or_default().push((place, PathSegment::parse_path(field)));
    }
    let mut samples = vec![TimeSeries::default(); wanted.len()];
    visit_items(path, |told| {
        let McapItem::Message { channel, time, data } = told else { return Ok(()) };
        let (Some(of_topic), Some(reads)) = (by_topic.get(channel.topic.as_str()), &channel.message_type) else {
            return Ok(());
        };
        // `topics` has reported unreadable messages.
        let Some(value) = reads.read(data) else { return Ok(()) };
        for (place, steps) in of_topic {
            if let Some(number) = value.number(steps) {
                samples[*place].times.push(time as f64 / 1e9);
                samples[*place].values.push(number);
            }
        }
        Ok(())
    })?;
    Ok(samples)
}

/// Reads the last attachment of this name; `None` without one.
pub(super) fn attachment(path: &Path, name: &str) -> Result<Option<Vec<u8>>> {
    let mut found = None;
    visit_items(path, |told| {
        if let McapItem::Attachment(attachment) = told
            && attachment.name == name
        {
            found = Some(attachment.data.into_owned());
        }
        Ok(())
    })?;
    Ok(found)
}
