//! File formats and their file name extensions.

use crate::error::{RecordError, Result};
use crate::stream::{StreamKind, StreamSchema};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// File format of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Format {
    /// MCAP file of ROS 2 messages, for Foxglove and Rerun. After the process is killed, [`recover`](crate::recover)
    /// restores what the writer thread had received half a second before. Rows that waited for that thread are lost.
    Mcap,
    /// NumPy archive: arrays (T, N, ...), one for each field, and their times. A killed process leaves no data.
    Npz,
    /// Folder of PNG files: color as 8-bit RGB, depth and distance as 16-bit millimeters (0 for a miss, 65535 from
    /// 65.535 m on), and `times.csv` with their times. Other channels are not supported.
    Images,
    /// LeRobot dataset, version 3.0: a folder of Parquet files, one for each episode, and of MP4 videos of the cameras
    /// ([`RecorderCfg::use_videos`](crate::RecorderCfg::use_videos)). An episode lasts from one reset of an environment
    /// to the next. Frames are the rows of the recording, from the first complete one on. Their rate must be a whole
    /// number per second. Requires the feature `lerobot`.
    LeRobot,
    /// Animated GIF of the color of one camera in one environment: 256 colors per frame, times in 1/100 s.
    Gif,
    /// MP4 video of the color of one camera in one environment: H.264 with 4:2:0 chroma subsampling. Width and height
    /// must be even.
    Mp4,
}

/// Properties of a format.
struct FormatInfo {
    format: Format,
    /// File name extension; empty for a folder of images.
    extension: &'static str,
    /// Name in messages.
    name: &'static str,
    /// True for the streams that the format supports.
    supports: fn(&StreamSchema) -> bool,
}

/// All formats.
const ALL: [FormatInfo; 6] = [
    FormatInfo { format: Format::Mcap, extension: "mcap", name: "an MCAP file", supports: |_| true },
    FormatInfo { format: Format::Npz, extension: "npz", name: "a NumPy archive", supports: |_| true },
    FormatInfo { format: Format::Images, extension: "", name: "a folder of images", supports: is_png_image },
    FormatInfo {
        format: Format::LeRobot,
        extension: "lerobot",
        name: "a LeRobot dataset",
        supports: is_dataset_stream,
    },
    FormatInfo { format: Format::Gif, extension: "gif", name: "an animated GIF", supports: is_color },
    FormatInfo { format: Format::Mp4, extension: "mp4", name: "an MP4 file", supports: is_color },
];

fn is_dataset_stream(stream: &StreamSchema) -> bool {
    match &stream.kind {
        StreamKind::Joints { .. } | StreamKind::Imu | StreamKind::SensorValues { .. } | StreamKind::TaskResult => true,
        StreamKind::Poses { .. } => stream.is_object_pose(),
        StreamKind::Image { channel, .. } => channel == "color",
        StreamKind::CameraInfo { .. } | StreamKind::RayHits | StreamKind::EngineState => false,
    }
}

fn is_color(stream: &StreamSchema) -> bool {
    matches!(&stream.kind, StreamKind::Image { channel, .. } if channel == "color")
}

fn is_png_image(stream: &StreamSchema) -> bool {
    matches!(&stream.kind, StreamKind::Image { channel, .. } if matches!(&**channel, "color" | "depth" | "distance"))
}

impl Format {
    /// All formats with their file name extensions, such as `mcap`. The extension is empty for a folder of images.
    /// Formats that this build does not support are included.
    pub fn all() -> impl Iterator<Item = (Self, &'static str)> {
        ALL.iter().map(|known| (known.format, known.extension))
    }

    /// Format of a path, by its extension in upper or lower case. A path without an extension is a folder of images.
    ///
    /// # Errors
    /// No format has this extension; the error lists the known ones.
    pub fn of_path(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let extension = path.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default();
        let found = ALL.iter().find(|known| known.extension == extension);
        found.map(|known| known.format).ok_or_else(|| RecordError::Format { path: path.into(), extension })
    }

    fn info(self) -> &'static FormatInfo {
        // A test checks that the list is complete.
        ALL.iter().find(|known| known.format == self).unwrap_or(&ALL[0])
    }

    /// Name in messages, with its article, such as `an MCAP file`.
    pub fn name(self) -> &'static str {
        self.info().name
    }

    /// True if this build supports the format: LeRobot datasets require a feature.
    pub fn is_built(self) -> bool {
        self.missing_feature().is_none()
    }

    /// Cargo feature that this build lacks for the format; `None` if the build can write the format.
    pub(crate) fn missing_feature(self) -> Option<&'static str> {
        (self == Self::LeRobot && !cfg!(feature = "lerobot")).then_some("lerobot")
    }

    /// True if the format supports a stream.
    pub(crate) fn supports(self, stream: &StreamSchema) -> bool {
        (self.info().supports)(stream)
    }

    /// True if the format contains events of environments ([`Topic::Events`](crate::Topic::Events)).
    pub fn supports_events(self) -> bool {
        matches!(self, Self::Mcap | Self::Npz)
    }

    /// True if the format shows one camera in one environment.
    pub fn is_animation(self) -> bool {
        matches!(self, Self::Gif | Self::Mp4)
    }
}

/// All file name extensions, for a message.
pub(crate) fn extensions_text() -> String {
    let ends = ALL.iter().filter(|known| !known.extension.is_empty()).map(|known| format!(".{}", known.extension));
    ends.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn list() {
        use Format::{Gif, Images, LeRobot, Mcap, Mp4, Npz};
        let wanted = [Mcap, Npz, Images, LeRobot, Gif, Mp4];
        assert!(Format::all().map(|(format, _)| format).eq(wanted));
        for (format, end) in Format::all() {
            // A missing variant is a compile error here.
            match format {
                Mcap | Npz | Images | LeRobot | Gif | Mp4 => {}
            }
            assert_eq!(format.info().extension, end);
            assert_eq!(Format::of_path(Path::new("a.b/run").with_extension(end)).ok(), Some(format));
        }
    }
}
