//! The formats, and which one a name means.

use crate::episodes::holds;
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
    /// A LeRobot dataset, version 3.0: a folder of Parquet files. Each episode, from one reset of an environment to the next, is a
    /// file; frames are the rows of the recording, from the first that has everything on, whose rate must be whole.
    LeRobot,
    /// An HDF5 file as robomimic reads them: the same episodes and frames, at any rate, as one file. Only in builds with the feature
    /// `hdf5`.
    Hdf5,
    /// An animated PNG of one camera's colour in one environment, without loss.
    Apng,
    /// An animated GIF of the same: 256 colours in a picture, times in hundredths of a second.
    Gif,
    /// An animated WebP of the same, without loss.
    Webp,
    /// An MP4 file of the same: H.264, which has colours at half the resolution. The sides must be even.
    Mp4,
}

/// What is known of a format.
struct Known {
    format: Format,
    /// The end of names that mean it; an empty one is a folder.
    end: &'static str,
    /// Its name in messages.
    name: &'static str,
    /// What it has a place for.
    holds: fn(&Stream) -> bool,
}

/// All of them.
const ALL: [Known; 9] = [
    Known { format: Format::Mcap, end: "mcap", name: "an MCAP file", holds: |_| true },
    Known { format: Format::Npz, end: "npz", name: "a NumPy archive", holds: |_| true },
    Known { format: Format::Pictures, end: "", name: "a folder of pictures", holds: is_seen },
    Known { format: Format::LeRobot, end: "lerobot", name: "a LeRobot dataset", holds },
    Known { format: Format::Hdf5, end: "hdf5", name: "an HDF5 file (robomimic)", holds: is_of_robomimic },
    Known { format: Format::Apng, end: "apng", name: "an animated PNG", holds: is_color },
    Known { format: Format::Gif, end: "gif", name: "an animated GIF", holds: is_color },
    Known { format: Format::Webp, end: "webp", name: "an animated WebP", holds: is_color },
    Known { format: Format::Mp4, end: "mp4", name: "an MP4 file", holds: is_color },
];

fn is_of_robomimic(stream: &Stream) -> bool {
    stream.kind == Kind::EngineState || holds(stream)
}

fn is_color(stream: &Stream) -> bool {
    matches!(&stream.kind, Kind::Picture { channel, .. } if channel == "color")
}

fn is_seen(stream: &Stream) -> bool {
    matches!(&stream.kind, Kind::Picture { channel, .. } if matches!(&**channel, "color" | "depth" | "distance"))
}

impl Format {
    /// All formats, with the ends of names that mean them: `mcap`, `npz`; an empty one is a folder.
    pub fn all() -> impl Iterator<Item = (Self, &'static str)> {
        ALL.iter().map(|known| (known.format, known.end))
    }

    /// The format that the end of a name means.
    ///
    /// # Errors
    /// No format is called so; the error lists those there are.
    pub fn of_path(path: &Path) -> Result<Self> {
        let end = path.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default();
        let found = ALL.iter().find(|known| known.end == end);
        found.map(|known| known.format).ok_or_else(|| RecordError::Format { path: path.into(), end })
    }

    fn known(self) -> &'static Known {
        // Each is in the list, which a test sees to.
        ALL.iter().find(|known| known.format == self).unwrap_or(&ALL[0])
    }

    /// Its name in messages.
    pub fn name(self) -> &'static str {
        self.known().name
    }

    /// Whether this build writes it: HDF5 takes a feature.
    pub fn is_built(self) -> bool {
        self.feature().is_none()
    }

    /// The feature that this build lacks for it.
    pub(crate) fn feature(self) -> Option<&'static str> {
        (self == Self::Hdf5 && !cfg!(feature = "hdf5")).then_some("hdf5")
    }

    /// Whether it has a place for a stream.
    pub(crate) fn holds(self, stream: &Stream) -> bool {
        (self.known().holds)(stream)
    }

    /// Whether it tells what happens to environments: [`Topic::Events`](crate::Topic::Events).
    pub fn has_events(self) -> bool {
        matches!(self, Self::Mcap | Self::Npz)
    }

    /// Whether it shows one camera in one environment.
    pub fn is_animation(self) -> bool {
        matches!(self, Self::Apng | Self::Gif | Self::Webp | Self::Mp4)
    }
}

/// The ends of all names, for a message.
pub(crate) fn ends() -> String {
    let ends = ALL.iter().filter(|known| !known.end.is_empty()).map(|known| format!(".{}", known.end));
    ends.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn list() {
        use Format::{Apng, Gif, Hdf5, LeRobot, Mcap, Mp4, Npz, Pictures, Webp};
        let wanted = [Mcap, Npz, Pictures, LeRobot, Hdf5, Apng, Gif, Webp, Mp4];
        assert!(Format::all().map(|(format, _)| format).eq(wanted));
        for (format, end) in Format::all() {
            // One that is missing here does not compile.
            match format {
                Mcap | Npz | Pictures | LeRobot | Hdf5 | Apng | Gif | Webp | Mp4 => {}
            }
            assert_eq!(format.known().end, end);
            assert_eq!(Format::of_path(&Path::new("a.b/run").with_extension(end)).ok(), Some(format));
        }
    }
}
