//! Configuration of recorders.

use crate::format::Format;
use crate::overview::OverviewCfg;
use crate::topic::Topic;
use kinetoscope_sim::EnvId;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Configuration of a recorder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecorderCfg {
    /// Output file; a folder for [`Format::Images`] and [`Format::LeRobot`].
    pub path: PathBuf,
    /// Output format; `None` to choose it by the extension of the path ([`Format::all`]). A path without an extension
    /// is a folder of images.
    pub format: Option<Format>,
    /// Recorded topics.
    pub topics: Vec<Topic>,
    /// Recorded environments, at least one, in any order without repetitions; `None` for all.
    pub envs: Option<Vec<EnvId>>,
    /// Physics steps between two rows of states, targets and poses. Sensors are recorded whenever they measure. See
    /// [`stream_periods`](Self::stream_periods) for other rates.
    pub period_steps: u64,
    /// Periods of single streams: the name of a stream, and the number of physics steps between two of its rows.
    ///
    /// A name is that of a stream in the file, such as `arm/link_poses`, or its first parts, such as `camera` for all
    /// streams of that camera. A name without a recorded stream is an error. The last entry that matches a stream
    /// applies. A sensor with a period is recorded at these steps: its last measurement, if it is new. Task results are
    /// always recorded when they are published. LeRobot datasets have a single frame rate: any entry is an error.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub stream_periods: Vec<(String, u64)>,
    /// Number of packets in the pool, at least 2. Each holds one row of everything that is recorded. If all packets
    /// wait to be written, the simulation waits. A pool larger than 16 GiB is an error.
    pub packets: usize,
    /// True to store the scene in an MCAP file or a NumPy archive; other formats do not contain it.
    ///
    /// MCAP files and NumPy archives get the scene as MJCF with its meshes, once, when the recording begins. Such a
    /// file is enough to show the recording (`kinetoscope replay`).
    ///
    /// MCAP files additionally get scene messages for viewers (Foxglove): what cameras render by default, attached to
    /// the recorded frames. A message is repeated when the appearance changes or an entity is added. Moving entities
    /// without a recorded pose and shapes that deform are left out, and so are environments beyond the limit of 64 MiB
    /// for all messages. [`RecordingSummary::left_out`](crate::RecordingSummary::left_out) lists all of these.
    pub scene: bool,
    /// Settings of the overview image, for [`Topic::Overview`], and for [`Topic::Everything`] in formats of images
    /// without a camera.
    pub overview: OverviewCfg,
    /// Description of the task in words, for all episodes of a LeRobot dataset. Other formats ignore it.
    pub task: String,
    /// True to store the cameras of a LeRobot dataset as videos, as LeRobot does by default: H.264 in MP4 files, for images
    /// of even width and height. False to store PNG images in the Parquet files: exact pixels, any size, and larger files.
    /// Other formats ignore it.
    pub use_videos: bool,
    /// True to replace an existing file when the new one is complete, and to replace the partial file of a killed
    /// recording. Without this, an existing file is an error. Folders that are not empty are replaced only if a
    /// recorder wrote them.
    pub overwrite: bool,
}

impl RecorderCfg {
    /// Creates a configuration that records [`Topic::Everything`] in all environments: states at every physics step,
    /// sensors whenever they measure.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), ..Self::default() }
    }

    /// Sets the recorded topics.
    pub fn with_topics(self, topics: impl IntoIterator<Item = Topic>) -> Self {
        Self { topics: topics.into_iter().collect(), ..self }
    }
}

impl Default for RecorderCfg {
    fn default() -> Self {
        Self {
            path: "recording.mcap".into(),
            format: None,
            topics: vec![Topic::Everything],
            envs: None,
            period_steps: 1,
            stream_periods: Vec::new(),
            packets: 8,
            scene: true,
            overview: OverviewCfg::default(),
            task: String::new(),
            use_videos: true,
            overwrite: false,
        }
    }
}
