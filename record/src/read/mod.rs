//! Reading of recordings: their topics, and numbers over time.
//!
//! ```no_run
//! use kinetoscope_record::{Recording, FieldSelector};
//!
//! let recording = Recording::open("run.mcap")?;
//! let topic = recording.topic("arm/joint_states", None)?;
//! let samples = recording.time_series(&[FieldSelector::new(&topic.name, "position[J1]")])?;
//! println!("{} numbers", samples[0].values.len());
//! # Ok::<(), kinetoscope_record::RecordError>(())
//! ```

mod mcap;
mod mcap_arrays;
mod npz;

pub(crate) use mcap_arrays::{McapArrays, read_arrays};

use crate::error::{RecordError, Result};
use crate::format::Format;
use crate::recorded_arrays::RecordedArrays;
use kinetoscope_scene::pattern::closest_names;
use std::path::{Path, PathBuf};

/// A recording opened for reading: an MCAP file of ROS 2 messages from any program, or a NumPy archive (`.npz`) written
/// by a [`Recorder`](crate::Recorder).
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    topics: Vec<RecordedTopic>,
    warnings: Vec<String>,
    content: Content,
}

#[derive(Debug)]
enum Content {
    /// Read from the file on each request.
    Mcap,
    Npz(Box<RecordedArrays>),
}

/// A topic of a recording. Most topics belong to one environment, whose prefix is part of the name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedTopic {
    /// Name, such as `/env_0/arm/joint_states`, for archives too.
    pub name: String,
    /// Message type, or `numbers` or `images` for an archive.
    pub kind: String,
    /// Number of messages, or of rows of an archive. A row may repeat the last value of an environment.
    pub count: u64,
    /// Names of the numbers in its messages, such as `position[J1]`; empty for images, texts, and messages that cannot
    /// be read.
    pub fields: Vec<String>,
}

/// Selection of a number in every message of a topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldSelector {
    /// Name of the topic, or the end of its name, as for [`Recording::topic`].
    pub topic: String,
    /// Name of the number.
    pub field: String,
}

impl FieldSelector {
    /// Selects the number `field`, such as `position[J1]`, in the messages of `topic`, a topic name or its end.
    pub fn new(topic: impl Into<String>, field: impl Into<String>) -> Self {
        Self { topic: topic.into(), field: field.into() }
    }
}

/// A number over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeSeries {
    /// Times of capture \[s\], on the clock of the recording, which continues over resets.
    pub times: Vec<f64>,
    /// Values at these times.
    pub values: Vec<f64>,
}

impl Recording {
    /// Opens a recording and lists its topics. The extension decides the format: `.mcap` or `.npz`. An MCAP file is
    /// read to its end. Topics with other encodings than ROS 2 have no fields.
    ///
    /// # Errors
    /// The file does not exist, has another extension, is not an MCAP file or a NumPy archive of a recorder, or is
    /// incomplete.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let malformed = |what: &str| RecordError::Malformed { path: path.into(), what: what.into() };
        let (content, (topics, warnings)) = match Format::of_path(path) {
            Ok(Format::Mcap) => (Content::Mcap, mcap::topics(path)?),
            Ok(Format::Npz) => {
                let archive = RecordedArrays::open_npz(path)?;
                let topics = npz::topics(&archive)?;
                (Content::Npz(Box::new(archive)), (topics, Vec::new()))
            }
            _ if path.extension().is_some_and(|end| end == "part") => {
                return Err(malformed(
                    "this recording was not finished; `kinetoscope recover` (record::recover) makes a complete file of a .mcap.part",
                ));
            }
            _ => return Err(malformed("only .mcap or .npz recordings can be read")),
        };
        Ok(Self { path: path.into(), topics, warnings, content })
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Topics, sorted by name.
    pub fn topics(&self) -> &[RecordedTopic] {
        &self.topics
    }

    /// Warnings about messages that cannot be read because they do not match their type. Their topics lack these
    /// messages. A topic without any readable message has no fields.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Finds a topic by its full name, whatever `env` is, or by the end of its name in environment `env`.
    /// `arm/joint_states` and `/joint_states` find `/env_0/arm/joint_states` if there is one arm. For `None`, the first
    /// environment with such a topic is used.
    ///
    /// # Errors
    /// No topic or more than one matches. The error lists the nearest or the matching names.
    pub fn topic(&self, name: &str, env: Option<usize>) -> Result<&RecordedTopic> {
        if let Some(topic) = self.topics.iter().find(|topic| topic.name == name) {
            return Ok(topic);
        }
        let end = format!("/{}", name.trim_start_matches('/'));
        let of = |topic: &RecordedTopic| env_of(&topic.name);
        let ends: Vec<&RecordedTopic> = self.topics.iter().filter(|topic| topic.name.ends_with(&end)).collect();
        let first = env.or_else(|| ends.iter().filter_map(|topic| of(topic)).min());
        let found: Vec<&RecordedTopic> = ends.into_iter().filter(|topic| of(topic) == first).collect();
        match found[..] {
            [topic] => Ok(topic),
            [] => {
                let inside = |topic: &&RecordedTopic| env.is_none() || of(topic) == env;
                let short = |topic: &RecordedTopic| match (name.starts_with("/env_"), of(topic)) {
                    (false, Some(env)) => topic.name.trim_start_matches(&format!("/env_{env}")).to_string(),
                    _ => topic.name.clone(),
                };
                let mut known: Vec<String> = self.topics.iter().filter(inside).map(short).collect();
                known.sort_unstable();
                known.dedup();
                let name = env.map_or_else(|| name.to_string(), |env| format!("{name} of environment {env}"));
                Err(RecordError::UnknownName { what: "topic", candidates: nearest(&name, &known), name })
            }
            _ => Err(RecordError::Ambiguous {
                what: "topic",
                name: name.into(),
                found: found.iter().map(|topic| topic.name.clone()).collect(),
            }),
        }
    }

    /// Environments with topics, in ascending order.
    pub fn env_ids(&self) -> Vec<usize> {
        let mut envs: Vec<usize> = self.topics.iter().filter_map(|topic| env_of(&topic.name)).collect();
        envs.sort_unstable();
        envs.dedup();
        envs
    }

    /// Reads numbers over time: one series for each of `wanted`, with its samples in the order of the file. A topic
    /// that is given by the end of its name is that of the first environment, as in [`topic`](Self::topic).
    ///
    /// A message without the number, such as a transform message of other frames, has no sample, nor has an unreadable
    /// message ([`warnings`](Self::warnings)).
    ///
    /// # Errors
    /// A topic or a field is unknown (the error lists the nearest ones), or the file has changed since it was opened.
    pub fn time_series(&self, wanted: &[FieldSelector]) -> Result<Vec<TimeSeries>> {
        let with_full_name = |FieldSelector { topic, field }: &FieldSelector| {
            let topic = self.topic(topic, None)?;
            if topic.fields.contains(field) {
                return Ok(FieldSelector::new(&topic.name, field));
            }
            let (what, candidates) = ("field", nearest(field, &topic.fields));
            Err(RecordError::UnknownName { what, name: format!("{field} in {}", topic.name), candidates })
        };
        let wanted = wanted.iter().map(with_full_name).collect::<Result<Vec<_>>>()?;
        match &self.content {
            Content::Mcap => mcap::samples(&self.path, &wanted),
            Content::Npz(archive) => npz::samples(archive, &wanted),
        }
    }

    /// Content of an attached file, such as the scene; `None` if there is no such file.
    pub(crate) fn attachment(&self, name: &str) -> Result<Option<Vec<u8>>> {
        match &self.content {
            Content::Mcap => mcap::attachment(&self.path, name),
            Content::Npz(archive) => archive.member(name),
        }
    }

    /// True for a NumPy archive.
    pub(crate) fn is_archive(&self) -> bool {
        matches!(self.content, Content::Npz(_))
    }
}

/// Environment of a topic from its prefix `/env_K`; `None` without this prefix.
fn env_of(topic: &str) -> Option<usize> {
    topic.strip_prefix("/env_")?.split('/').next()?.parse().ok()
}

fn nearest(name: &str, known: &[String]) -> Vec<String> {
    closest_names(name, known.iter().map(String::as_str)).into_iter().map(String::from).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
