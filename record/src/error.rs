//! What can be wrong with a recording.

use crate::format::{Format, ends};
use std::path::PathBuf;
use std::sync::Arc;

/// A result of this crate.
pub type Result<T, E = RecordError> = std::result::Result<T, E>;

/// A recording cannot be begun, or not be finished.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// There is a file of that name.
    #[error("{path}: there is such a file already; choose another name, or set `overwrite`")]
    Exists {
        /// The file or folder.
        path: PathBuf,
    },
    /// A recording that was killed has left a file.
    #[error("{part}: an earlier recording was not finished; {}", advice(.recoverable))]
    Unfinished {
        /// What it left.
        part: PathBuf,
        /// Whether [`recover`](crate::recover) makes a whole file of it.
        recoverable: bool,
    },
    /// Somebody is recording there.
    #[error("{part}: another recorder is writing this; choose another name")]
    Busy {
        /// What it writes.
        part: PathBuf,
    },
    /// The end of the name is of no format.
    #[error(
        "{path}: nothing is recorded as .{end}; known are {}, and a name without end for a folder of PNG files",
        ends()
    )]
    Format {
        /// The file.
        path: PathBuf,
        /// The end of its name.
        end: String,
    },
    /// This build does not write the format.
    #[error("{path}: this build does not write {}: build with the feature `{feature}` (`--features {feature}`)", .format.name())]
    NotBuilt {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: Format,
        /// What to build with.
        feature: &'static str,
    },
    /// The format has no place for something that was asked for by name.
    #[error("{path}: {} has no place for {topic}", .format.name())]
    NoPlace {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: Format,
        /// What has no place in it.
        topic: String,
    },
    /// Nobody tells what comes of steps.
    #[error(
        "{path}: no task runs in this simulation, so there are no rewards: record the simulation of an Env (Env::sim_mut)"
    )]
    NoTask {
        /// The file.
        path: PathBuf,
    },
    /// The stage cannot be drawn.
    #[error("the picture of the stage: {what}")]
    Stage {
        /// Why, or which number is wrong.
        what: String,
    },
    /// There is nothing to record.
    #[error("{path}: there is nothing to record for {}", .format.name())]
    Nothing {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: Format,
    },
    /// More than one picture at a time for a file that shows one.
    #[error(
        "{path}: an animation shows one camera in one environment; these are {found}: choose a topic and an environment"
    )]
    TooMany {
        /// The file.
        path: PathBuf,
        /// What was chosen.
        found: String,
    },
    /// Pictures of a size that the format does not have.
    #[error("{path}: {} has no pictures of {width} x {height} pixels: {fits}", .format.name())]
    Size {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: Format,
        /// Pixels per row.
        width: usize,
        /// Rows.
        height: usize,
        /// Which it has.
        fits: String,
    },
    /// Rows of a rate that the format does not have.
    #[error("{path}: with `every` {every} there are {found:.3} rows per second, which is no whole number; {}", whole(.near))]
    Rate {
        /// The file.
        path: PathBuf,
        /// [`RecorderCfg::every`](crate::RecorderCfg::every).
        every: u64,
        /// Rows in a second \[Hz\].
        found: f64,
        /// Values of `every` that would do, the nearest first.
        near: Vec<u64>,
    },
    /// A dataset in which every row has everything, and something that is not measured in every environment.
    #[error(
        "{path}: every row of a dataset has everything, but {stream} is not in environment {env}; record environments and topics \
         that go together"
    )]
    NotEverywhere {
        /// The folder.
        path: PathBuf,
        /// What is missing, such as `camera/color`.
        stream: String,
        /// Where.
        env: usize,
    },
    /// Something is not called so.
    #[error("there is no {what} {name:?}{}", known(.candidates))]
    UnknownName {
        /// What was looked for.
        what: &'static str,
        /// The name.
        name: String,
        /// The names there are.
        candidates: Vec<String>,
    },
    /// More than one is called so.
    #[error("there is more than one {what} {name:?}: {}; say which", .found.join(", "))]
    Ambiguous {
        /// What was looked for.
        what: &'static str,
        /// The name.
        name: String,
        /// Those that are called so.
        found: Vec<String>,
    },
    /// A sensor that tells nobody its numbers.
    #[error("sensor {sensor:?} cannot be recorded: its type says nothing of its channels (Sensor::sampled)")]
    Unreadable {
        /// Its name.
        sensor: String,
    },
    /// A camera that looks into other environments.
    #[error("sensor {sensor:?} is in none of the environments that are recorded")]
    Elsewhere {
        /// Its name.
        sensor: String,
    },
    /// Two things would have the same name in the file.
    #[error("{path}: two things that are recorded are called {name:?} there; choose topics, or rename one of them")]
    SameName {
        /// The file.
        path: PathBuf,
        /// The name.
        name: String,
    },
    /// The pool does not fit into memory.
    #[error(
        "{packets} packets of {bytes} bytes are more than the {most} bytes that a pool may have; choose fewer packets"
    )]
    TooLarge {
        /// [`RecorderCfg::packets`](crate::RecorderCfg::packets).
        packets: usize,
        /// What each of them takes.
        bytes: u64,
        /// What all may take.
        most: u64,
    },
    /// An environment that does not exist, or is named twice.
    #[error("environment {env} is not one of {count}, or is named twice")]
    Env {
        /// Its index.
        env: usize,
        /// How many there are.
        count: usize,
    },
    /// A number of the configuration is out of range.
    #[error("{field} is {value}: it must be at least {least}")]
    OutOfRange {
        /// Which.
        field: &'static str,
        /// Its value.
        value: u64,
        /// The least one.
        least: u64,
    },
    /// Something that is recorded is not there any more, or has another shape.
    #[error("{path}: {stream} is not what it was when the recording began: something was added to the scene")]
    Changed {
        /// The file.
        path: PathBuf,
        /// What has changed.
        stream: String,
    },
    /// The file cannot be written.
    #[error("{path}: {error}{}", left(.kept))]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        error: Arc<std::io::Error>,
        /// What was written until then, where it can be read.
        kept: Option<PathBuf>,
    },
    /// The recording was broken off.
    #[error("{error}{}{}", unwritten(.also), left(.kept))]
    BrokenOff {
        /// Why.
        error: Box<RecordError>,
        /// Why the file could not be written either, if so.
        also: Option<String>,
        /// What was written until then, where it can be read.
        kept: Option<PathBuf>,
    },
    /// There is more of something than the format has a place for.
    #[error("{path}: {what}")]
    Limit {
        /// The file or folder.
        path: PathBuf,
        /// Of what, how much there may be, and what would help.
        what: String,
    },
    /// An animation or a dataset without a frame.
    #[error("{path}: there is no frame: {why}")]
    NoFrame {
        /// The file or folder.
        path: PathBuf,
        /// What never came, and every frame needs.
        why: &'static str,
    },
    /// The thread that writes has ended by a fault of the program.
    #[error("{path}: the thread that writes has panicked")]
    Panicked {
        /// The file or folder.
        path: PathBuf,
    },
    /// The simulation said no.
    #[error("{0}")]
    Sim(Arc<kinetoscope_sim::Error>),
    /// What is read is not a recording of this program, or not whole.
    #[error("{path}: {what}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
}

impl From<kinetoscope_sim::Error> for RecordError {
    fn from(error: kinetoscope_sim::Error) -> Self {
        Self::Sim(Arc::new(error))
    }
}

impl RecordError {
    /// A file that cannot be written or read.
    pub(crate) fn file(path: &std::path::Path, error: std::io::Error) -> Self {
        Self::File { path: path.into(), error: Arc::new(error), kept: None }
    }
}

fn known(candidates: &[String]) -> String {
    if candidates.is_empty() { String::new() } else { format!("; known are {}", candidates.join(", ")) }
}

fn advice(recoverable: &bool) -> &'static str {
    match recoverable {
        true => "`kinetoscope recover` (record::recover) makes a whole file of it, or set `overwrite`",
        false => "keep what you need of it under another name, delete it, or set `overwrite`",
    }
}

fn unwritten(error: &Option<String>) -> String {
    error.as_ref().map_or_else(String::new, |error| format!("; nor can the file be written: {error}"))
}

fn left(kept: &Option<PathBuf>) -> String {
    kept.as_ref().map_or_else(String::new, |kept| format!("; what was recorded until then is in {}", kept.display()))
}

fn whole(near: &[u64]) -> String {
    let near: Vec<String> = near.iter().map(u64::to_string).collect();
    match near.is_empty() {
        true => "choose another physics_dt".into(),
        false => format!("{} would do", near.join(", ")),
    }
}
