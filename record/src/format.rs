//! The formats, and which one a name means.

use crate::error::{RecordError, Result};
use crate::stream::{Kind, Stream};
use std::path::Path;

/// How a recording is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// An MCAP file of ROS 2 messages, which Foxglove and Rerun open. If the process is killed, [`recover`](crate::recover) reads
    /// what the thread of the file had got half a second before; rows that waited for it are lost.
    Mcap,
    /// A NumPy archive: arrays (T, N, ...), one for each quantity, and their times.
    Npz,
    /// A folder of PNG files: colour as 8-bit RGB, depth and distance as 16-bit millimetres, and `times.csv` with their times.
    Pictures,
    /// An animated PNG of one camera's colour in one environment.
    Apng,
}

impl Format {
    /// All of them with the ends of names that mean them; an empty one is a folder.
    const ENDS: [(&'static str, Self); 4] =
        [("mcap", Self::Mcap), ("npz", Self::Npz), ("", Self::Pictures), ("apng", Self::Apng)];

    /// The format that the end of a name means.
    ///
    /// # Errors
    /// No format is called so; the error lists those there are.
    pub fn of_path(path: &Path) -> Result<Self> {
        let end = path.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default();
        let found = Self::ENDS.iter().find(|(known, _)| *known == end);
        found.map(|(_, format)| *format).ok_or_else(|| RecordError::Format { path: path.into(), end })
    }

    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mcap => "an MCAP file",
            Self::Npz => "a NumPy archive",
            Self::Pictures => "a folder of pictures",
            Self::Apng => "an animated PNG",
        }
    }

    /// Whether it has a place for a stream.
    pub(crate) fn holds(self, stream: &Stream) -> bool {
        match (self, &stream.kind) {
            (Self::Mcap | Self::Npz, _) => true,
            (Self::Pictures, Kind::Picture { channel, .. }) => matches!(&**channel, "color" | "depth" | "distance"),
            (Self::Apng, Kind::Picture { channel, .. }) => channel == "color",
            (Self::Pictures | Self::Apng, _) => false,
        }
    }
}
