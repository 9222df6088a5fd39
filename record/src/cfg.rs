//! What a recorder is, before it exists.

use crate::format::Format;
use crate::stage::StageCfg;
use crate::topic::Topic;
use kinetoscope_sim::EnvId;
use std::path::PathBuf;

/// Configuration of a recorder: plain data.
#[derive(Clone, Debug, PartialEq)]
pub struct RecorderCfg {
    /// The file, or for [`Format::Pictures`] and [`Format::LeRobot`] the folder.
    pub path: PathBuf,
    /// How it is written; `None` for what the end of the name says: [`Format::all`] lists them, nothing is a folder of
    /// pictures.
    pub format: Option<Format>,
    /// What is recorded.
    pub topics: Vec<Topic>,
    /// Of which environments; `None` for all.
    pub envs: Option<Vec<EnvId>>,
    /// Physics steps from one row of states, targets and poses to the next. Sensors are recorded whenever they measure. Where
    /// something has a rate of its own, see [`rates`](Self::rates).
    pub every: u64,
    /// Physics steps from one row to the next of what has a rate of its own: the names that things have in files, such as
    /// `arm/link_poses`, or `camera` for everything of it, and numbers of steps; the last one counts that names something. Of
    /// sensors, what was measured last is recorded at these steps, if it is new. Not of datasets of episodes, whose frames have
    /// one rate.
    pub rates: Vec<(String, u64)>,
    /// Packets of the pool, at least 2: each has room for one row of everything that is recorded. When all of them wait to be
    /// written, the simulation waits too. All together may take 16 GiB.
    pub packets: usize,
    /// Whether the scene is put into the file. As MJCF with its meshes, so that the file is enough to show the recording
    /// (`kinetoscope replay`): of MCAP files and NumPy archives, taken once, when the recording begins. And in MCAP files for viewers
    /// (Foxglove): what cameras draw by default, in the frames whose poses are recorded, and again whenever it looks otherwise or
    /// something is added. What moves and has no recorded pose is left out there; so are environments for which the 64 MiB of all
    /// such messages do not suffice. Both are told ([`Recorded::left_out`](crate::Recorded::left_out)).
    pub scene: bool,
    /// How the stage is drawn, where that is recorded ([`Topic::Stage`]).
    pub stage: StageCfg,
    /// What is being done, in words: the task of all episodes of a LeRobot dataset. Other formats do not say it.
    pub task: String,
    /// Whether a file of that name may be replaced, when the new one is whole; and what an earlier recording that was killed
    /// has left. Of folders, only those of a recorder are replaced.
    pub overwrite: bool,
}

impl RecorderCfg {
    /// Everything that the format can hold, in all environments, at every step.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), ..Self::default() }
    }

    /// The same with these topics.
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
            every: 1,
            rates: Vec::new(),
            packets: 8,
            scene: true,
            stage: StageCfg::default(),
            task: String::new(),
            overwrite: false,
        }
    }
}
