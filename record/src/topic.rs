//! What can be recorded.

/// Something that can be recorded, by name.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Topic {
    /// Everything below that the simulation has when the recording begins and the format has a place for.
    Everything,
    /// Positions, velocities and efforts of the joints of the robot or articulation of this name.
    JointStates(String),
    /// Targets of positions, velocities and efforts of its joints: the actions.
    Targets(String),
    /// Poses of its links.
    LinkPoses(String),
    /// The pose of the rigid object of this name.
    ObjectPose(String),
    /// Positions, velocities and controls of the MJCF part of this name.
    MjcfState(String),
    /// Poses of the bodies of the MJCF part of this name.
    BodyPoses(String),
    /// Simulation time, positions and velocities of all joints of the scene as MuJoCo has them
    /// ([`kinetoscope_sim::Entities::engine_states`](kinetoscope_sim::Entities::engine_states)), called `clock`, `qpos` and `qvel`.
    /// [`Everything`](Self::Everything) has them in HDF5 files only.
    EngineStates,
    /// Rewards and ends of the task that runs in the simulation, which it publishes after each of its steps
    /// ([`StepResult`](kinetoscope_sim::StepResult)), as an `Env` does by itself.
    Outcomes,
    /// All environments in one picture, as `RecorderCfg::stage` says; it is called as a camera `stage` of the first environment that is
    /// recorded. [`Everything`](Self::Everything) has it only where the file shows pictures and there is no camera.
    Stage,
    /// All channels of the sensor of this name, whenever a measurement arrives: with a latency as it was captured, with that
    /// stamp, also what was on its way when somebody wrote to the state, which the sensor itself does not show any more. Of cameras
    /// and ray casters that draw pictures also the lens and the pose.
    Sensor(String),
    /// One channel of a camera, such as `depth`, without lens and pose.
    Channel {
        /// The camera.
        sensor: String,
        /// The channel; aliases such as `rgb` are known. Of a pair of eyes `left/depth`, `right/depth` or `disparity`.
        channel: String,
    },
    /// What happens to environments: resets, writes to their states, divergence, and what somebody has to say
    /// ([`Record::note`](crate::Record::note)). MCAP files and NumPy archives have them whatever else is recorded; this is for
    /// recordings of nothing else.
    Events,
}

impl Topic {
    /// Everything about the joints of a robot: [`JointStates`](Self::JointStates), [`Targets`](Self::Targets) and
    /// [`LinkPoses`](Self::LinkPoses).
    pub fn robot(uid: &str) -> [Self; 3] {
        [Self::JointStates(uid.into()), Self::Targets(uid.into()), Self::LinkPoses(uid.into())]
    }

    /// One channel of a camera.
    pub fn channel(sensor: impl Into<String>, channel: impl Into<String>) -> Self {
        Self::Channel { sensor: sensor.into(), channel: channel.into() }
    }
}
