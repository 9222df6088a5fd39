//! Recorded topics.

use serde::{Deserialize, Serialize};

/// A selection of what is recorded, by name.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Topic {
    /// All topics below that exist when the recording begins and that the format supports, with the exceptions noted at
    /// [`EngineStates`](Self::EngineStates) and [`Overview`](Self::Overview). An animation gets the first camera only,
    /// in its first recorded environment.
    Everything,
    /// Joint positions, velocities and efforts of the robot or articulation of this name. The efforts are those of the
    /// step that led to the positions.
    JointStates(String),
    /// Joint position, velocity and effort targets of the robot or articulation of this name: the actions.
    Targets(String),
    /// Link poses, in the environment, of the robot or articulation of this name.
    LinkPoses(String),
    /// Pose, in the environment, of the rigid object of this name.
    ObjectPose(String),
    /// Positions, velocities and controls of the MJCF part of this name.
    MjcfState(String),
    /// Body poses, in the environment, of the MJCF part of this name.
    BodyPoses(String),
    /// Simulation time, positions and velocities of all joints of the scene in MuJoCo's order, named `clock`, `qpos`
    /// and `qvel` ([`kinetoscope_sim::Entities::engine_states`](kinetoscope_sim::Entities::engine_states)).
    ///
    /// [`Everything`](Self::Everything) leaves them out. Datasets and formats of images do not support them.
    EngineStates,
    /// Rewards and episode ends of the task in the simulation. A task such as an `Env` publishes them after each of its
    /// steps ([`StepResult`](kinetoscope_sim::StepResult)).
    TaskResults,
    /// Overview image of all environments, also of those that are not recorded, rendered with the settings of
    /// [`RecorderCfg::overview`](crate::RecorderCfg::overview). Its name is that of a camera `stage` in the first
    /// recorded environment.
    ///
    /// [`Everything`](Self::Everything) includes it only in formats of images, and only if there is no camera.
    Overview,
    /// All channels of the sensor of this name that the format supports, at each arrival of a measurement. Cameras and
    /// ray-caster cameras also record their intrinsics and pose.
    ///
    /// A measurement with a latency has the values and the time stamp of its capture. Measurements that were pending
    /// during a write to the state are recorded, although the sensor itself does not show them.
    Sensor(String),
    /// One channel of a camera, such as `depth`, without intrinsics and pose.
    Channel {
        /// Name of the camera.
        sensor: String,
        /// Name of the channel or an alias such as `rgb`. For a stereo camera `left/depth`, `right/depth` or
        /// `disparity`.
        channel: String,
    },
    /// Events of environments: resets, writes to the state, divergence, and notes
    /// ([`Record::note`](crate::Record::note)). MCAP files and NumPy archives always contain events. Use this topic to
    /// record nothing else.
    Events,
}

impl Topic {
    /// Topics of a robot: [`JointStates`](Self::JointStates), [`Targets`](Self::Targets) and
    /// [`LinkPoses`](Self::LinkPoses).
    pub fn robot(uid: &str) -> [Self; 3] {
        [Self::JointStates(uid.into()), Self::Targets(uid.into()), Self::LinkPoses(uid.into())]
    }

    /// One channel of a camera: see [`Channel`](Self::Channel).
    pub fn channel(sensor: impl Into<String>, channel: impl Into<String>) -> Self {
        Self::Channel { sensor: sensor.into(), channel: channel.into() }
    }
}
