//! Errors of recording, reading and replay.

use crate::format::{Format, extensions_text};
use std::path::PathBuf;
use std::sync::Arc;

/// Result of this crate.
pub type Result<T, E = RecordError> = std::result::Result<T, E>;

/// Error of recording, reading or replaying.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The output path exists already.
    #[error("{path}: this path exists already; choose another name, or set `overwrite`")]
    Exists {
        /// The file or folder.
        path: PathBuf,
    },
    /// The partial file of a killed recording exists.
    #[error("{partial_file}: an earlier recording was not finished; {}", advice(.recoverable))]
    Unfinished {
        /// The partial file.
        partial_file: PathBuf,
        /// True if [`recover`](crate::recover) can make a complete file of it.
        recoverable: bool,
    },
    /// Another recorder writes to this path.
    #[error("{partial_file}: another recorder is writing this; choose another name")]
    Busy {
        /// The partial file or folder that it writes.
        partial_file: PathBuf,
    },
    /// No format has this file name extension.
    #[error(
        "{path}: unknown format .{extension}; known formats: {}, and a name without extension for a folder of PNG files",
        extensions_text()
    )]
    Format {
        /// The file.
        path: PathBuf,
        /// Extension of its name.
        extension: String,
    },
    /// This build does not support the format.
    #[error("{path}: this build does not write {}: build with the feature `{feature}` (`--features {feature}`)", .format.name())]
    NotBuilt {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: Format,
        /// Cargo feature that adds the format.
        feature: &'static str,
    },
    /// The format does not support a topic, a selection of topics, a stream period or a note that was requested.
    #[error("{path}: {} does not support {topic}", .format.name())]
    UnsupportedTopic {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: Format,
        /// The unsupported topic or request.
        topic: String,
    },
    /// Rewards were requested, but no task publishes them.
    #[error(
        "{path}: no task runs in this simulation, so there are no rewards: record the simulation of an Env (Env::sim_mut)"
    )]
    NoTask {
        /// The file.
        path: PathBuf,
    },
    /// The overview image cannot be drawn.
    #[error("the overview image: {what}")]
    Overview {
        /// Reason, or the invalid number.
        what: String,
    },
    /// The configuration selects no existing stream that the format supports.
    #[error("{path}: there is nothing to record for {}", .format.name())]
    NothingToRecord {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: Format,
    },
    /// An animation was requested for more than one camera or environment.
    #[error(
        "{path}: an animation shows one camera in one environment; these are {found}: choose a topic and an environment"
    )]
    NotSingleImage {
        /// The file.
        path: PathBuf,
        /// The selected streams.
        found: String,
    },
    /// The format does not support images of this size.
    #[error("{path}: {} does not support images of {width} x {height} pixels: {supported}", .format.name())]
    UnsupportedSize {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: Format,
        /// Width \[pixels\].
        width: usize,
        /// Height \[pixels\].
        height: usize,
        /// Supported sizes.
        supported: String,
    },
    /// The format requires a whole number of rows per second.
    #[error(
        "{path}: with `period_steps` {period_steps} there are {found:.3} rows per second, but the format needs a whole number; {}",
        rate_advice(.candidates)
    )]
    UnsupportedRate {
        /// The file.
        path: PathBuf,
        /// [`RecorderCfg::period_steps`](crate::RecorderCfg::period_steps).
        period_steps: u64,
        /// Rows per second \[Hz\].
        found: f64,
        /// Values of [`RecorderCfg::period_steps`](crate::RecorderCfg::period_steps) that give a whole rate, at most
        /// three, the nearest first; empty if there is no such value up to 1000.
        candidates: Vec<u64>,
    },
    /// A stream is missing in an environment of a dataset, whose rows must be complete.
    #[error(
        "{path}: every row of a dataset must be complete, but {stream} is not in environment {env}; record environments and \
         topics that match"
    )]
    MissingStream {
        /// The folder or file of the dataset.
        path: PathBuf,
        /// The missing stream, such as `camera/color`.
        stream: String,
        /// The environment.
        env: usize,
    },
    /// There is no channel, topic or field of this name.
    #[error("unknown {what} {name:?}{}", candidates_text(.candidates))]
    UnknownName {
        /// Kind of name.
        what: &'static str,
        /// The name.
        name: String,
        /// Existing names, or the 12 nearest of them.
        candidates: Vec<String>,
    },
    /// A name is ambiguous.
    #[error("{what} {name:?} is ambiguous: it may be any of {}; give the full name", .found.join(", "))]
    Ambiguous {
        /// Kind of name.
        what: &'static str,
        /// The name.
        name: String,
        /// Full names that match.
        found: Vec<String>,
    },
    /// The type of a sensor does not provide its channels.
    #[error("sensor {sensor:?} cannot be recorded: its type provides no channels (Sensor::sampled)")]
    NoChannels {
        /// Name of the sensor.
        sensor: String,
    },
    /// A camera sensor exists in none of the recorded environments.
    #[error("sensor {sensor:?} is not in any recorded environment")]
    SensorNotInEnvs {
        /// Name of the sensor.
        sensor: String,
    },
    /// Two streams would have the same name in the file.
    #[error("{path}: two recorded streams have the name {name:?}; choose topics, or rename one of them")]
    DuplicateName {
        /// The file.
        path: PathBuf,
        /// The name.
        name: String,
    },
    /// The packet pool is larger than the limit.
    #[error(
        "{packets} packets of {bytes} bytes exceed the limit of the packet pool, {max_bytes} bytes; choose fewer packets"
    )]
    PoolTooLarge {
        /// [`RecorderCfg::packets`](crate::RecorderCfg::packets).
        packets: usize,
        /// Size of a packet \[bytes\].
        bytes: u64,
        /// Largest size of the pool \[bytes\].
        max_bytes: u64,
    },
    /// An environment does not exist, or is listed twice.
    #[error("environment {env} does not exist or is named twice; there are {count} environments")]
    Env {
        /// Index of the environment in the simulation.
        env: usize,
        /// Number of environments.
        count: usize,
    },
    /// A number of the configuration is out of range.
    #[error("{field} is {value}: it must be at least {min}")]
    OutOfRange {
        /// The field.
        field: &'static str,
        /// Its value.
        value: u64,
        /// Its smallest valid value.
        min: u64,
    },
    /// A recorded stream was removed or has another shape.
    #[error("{path}: {stream} has changed since the recording began, because the scene has changed")]
    StreamChanged {
        /// The file.
        path: PathBuf,
        /// The changed stream.
        stream: String,
    },
    /// The file cannot be read or written.
    #[error("{path}: {error}{}", partial_file_text(.partial_file))]
    File {
        /// The file.
        path: PathBuf,
        /// Cause.
        error: Arc<std::io::Error>,
        /// The partial file, if it can be read.
        partial_file: Option<PathBuf>,
    },
    /// The recording was aborted.
    #[error("{error}{}{}", write_error_text(.write_error), partial_file_text(.partial_file))]
    Aborted {
        /// Cause.
        error: Box<RecordError>,
        /// Error of writing the rest of the file, if any.
        write_error: Option<String>,
        /// The partial file, if it can be read.
        partial_file: Option<PathBuf>,
    },
    /// This build does not stream to Foxglove.
    #[error("this build does not stream to Foxglove: build with the feature `foxglove` (`--features foxglove`)")]
    NoFoxglove,
    /// A server cannot be started.
    #[cfg(feature = "foxglove")]
    #[error(transparent)]
    Serve(Arc<kinetoscope_http::ServeError>),
    /// A limit of the format is exceeded.
    #[error("{path}: {what}")]
    Limit {
        /// The file or folder.
        path: PathBuf,
        /// The limit, and what to change.
        what: String,
    },
    /// An animation or a dataset has no frame.
    #[error("{path}: the recording has no frame: {why}")]
    NoFrame {
        /// The file or folder.
        path: PathBuf,
        /// Reason, such as data that every frame needs.
        why: &'static str,
    },
    /// The writer thread panicked.
    #[error("{path}: the writer thread panicked")]
    Panicked {
        /// The file or folder.
        path: PathBuf,
    },
    /// The simulation returned an error.
    #[error("{0}")]
    Sim(Arc<kinetoscope_sim::Error>),
    /// The file is not a recording of this program, or is damaged.
    #[error("{path}: {what}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Problem.
        what: String,
    },
}

#[cfg(feature = "foxglove")]
impl From<kinetoscope_http::ServeError> for RecordError {
    fn from(error: kinetoscope_http::ServeError) -> Self {
        Self::Serve(Arc::new(error))
    }
}

impl From<kinetoscope_sim::Error> for RecordError {
    fn from(error: kinetoscope_sim::Error) -> Self {
        Self::Sim(Arc::new(error))
    }
}

impl RecordError {
    /// Creates [`File`](Self::File) without a partial file.
    pub(crate) fn file(path: &std::path::Path, error: std::io::Error) -> Self {
        Self::File { path: path.into(), error: Arc::new(error), partial_file: None }
    }
}

fn candidates_text(candidates: &[String]) -> String {
    if candidates.is_empty() { String::new() } else { format!("; known names: {}", candidates.join(", ")) }
}

fn advice(recoverable: &bool) -> &'static str {
    match recoverable {
        true => "`kinetoscope recover` (record::recover) makes a complete file of it, or set `overwrite`",
        false => "rename it to keep it, delete it, or set `overwrite`",
    }
}

fn write_error_text(error: &Option<String>) -> String {
    error.as_ref().map_or_else(String::new, |error| format!("; the file cannot be written either: {error}"))
}

fn partial_file_text(kept: &Option<PathBuf>) -> String {
    kept.as_ref().map_or_else(String::new, |kept| format!("; the recording up to that point is in {}", kept.display()))
}

fn rate_advice(near: &[u64]) -> String {
    let near: Vec<String> = near.iter().map(u64::to_string).collect();
    match near.is_empty() {
        true => "choose another physics_dt".into(),
        false => format!("valid values of `period_steps`: {}", near.join(", ")),
    }
}
