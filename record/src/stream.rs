//! Metadata of recorded streams: names, shapes and meaning.

pub(crate) use kinetoscope_scene::npy::ElementType;
use kinetoscope_sensors::{SampleChannel, Stamp};

/// Metadata of values that are recorded together.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamSchema {
    /// Name without the environment, such as `arm/joint_states` or `camera/color`.
    pub name: String,
    /// Meaning of the values, such as joint states, poses or an image.
    pub kind: StreamKind,
    /// Type of the values.
    pub element_type: ElementType,
    /// Fields, in their order in a row.
    pub fields: Vec<StreamField>,
    /// Recorded environments, in ascending order: for a camera, those that it observes; for the overview image and for
    /// animations of all topics, only the first one. A row has the values of one environment.
    pub env_ids: Vec<usize>,
}

impl StreamSchema {
    /// True for the pose stream of a rigid object (`uid/pose`). Datasets leave out poses of links and bodies, because
    /// joint positions determine them.
    pub(crate) fn is_object_pose(&self) -> bool {
        matches!(&self.kind, StreamKind::Poses { frames } if self.name == format!("{}/pose", frames.join("/")))
    }

    /// Number of values in the row of one environment.
    pub fn width(&self) -> usize {
        self.fields.iter().map(StreamField::width).sum()
    }

    /// Values of the field `name` in the row of an environment; empty if there is no such field.
    pub(crate) fn field<'v>(&self, row: &'v [f64], name: &str) -> &'v [f64] {
        let first: usize = self.fields.iter().take_while(|part| part.name != name).map(StreamField::width).sum();
        let width = self.fields.iter().find(|part| part.name == name).map_or(0, StreamField::width);
        row.get(first..first + width).unwrap_or(&[])
    }

    /// True if some fields, but not all, are stamped with the force time ([`StreamField::at_force_time`]).
    pub(crate) fn has_two_stamps(&self) -> bool {
        self.fields.iter().any(|part| part.at_force_time) && !self.fields.iter().all(|part| part.at_force_time)
    }
}

/// One field of a stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StreamField {
    /// Name, such as `positions`. Empty for the only field of a stream, which has the name of the stream.
    pub name: String,
    /// Shape in one environment.
    pub shape: Vec<usize>,
    /// True if a sensor measures the field at [`kinetoscope_scene::SceneState::force_time`], the beginning of the last
    /// MuJoCo step: forces, efforts and accelerations, all channels of IMUs, and all channels of contact sensors except
    /// poses. False for the efforts of [`Topic::JointStates`](crate::Topic::JointStates), which have the stamp of the
    /// positions.
    pub at_force_time: bool,
    /// Unit that a sensor reports ([`SampleChannel::unit`](kinetoscope_sensors::SampleChannel::unit)); empty without a
    /// report, and for states, images and ray casters.
    pub unit: String,
}

impl StreamField {
    pub(crate) fn new(name: &str, shape: impl Into<Vec<usize>>) -> Self {
        Self { name: name.into(), shape: shape.into(), at_force_time: false, unit: String::new() }
    }

    /// A field for the channel of a sensor.
    pub(crate) fn of_channel(channel: &SampleChannel) -> Self {
        let (at_force_time, unit) = (channel.stamp == Stamp::Force, channel.unit.to_string());
        Self { at_force_time, unit, ..Self::new(channel.name, [channel.width]) }
    }

    /// Number of values in one environment.
    pub fn width(&self) -> usize {
        self.shape.iter().product()
    }
}

/// Lens distortion in ROS's terms.
#[derive(Clone, Debug, PartialEq)]
pub struct Distortion {
    /// Model: `plumb_bob`, `rational_polynomial` or `equidistant`.
    pub model: String,
    /// Coefficients in the order of the model.
    pub coefficients: Vec<f64>,
}

/// Meaning of the values of a stream.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum StreamKind {
    /// Joint positions, velocities and efforts, or their targets.
    Joints {
        /// Names of the joints, without the name of the robot.
        names: Vec<String>,
    },
    /// Poses in the frame of the environment, rows `[x, y, z, qw, qx, qy, qz]` \[m\].
    Poses {
        /// Names of the frames: `uid/link`, `uid/body`, or the uid of an object.
        frames: Vec<String>,
    },
    /// An image, row by row from the top left.
    Image {
        /// Name of the camera: the uid of the sensor; with `/left` or `/right` for a stereo camera.
        camera: String,
        /// Name of the channel.
        channel: String,
        /// Height \[pixels\].
        height: usize,
        /// Width \[pixels\].
        width: usize,
    },
    /// Intrinsic matrix of a camera \[pixels\] and its pose in the environment, with ROS camera axes. A camera of a
    /// stereo pair that can be rectified also has `rectification` and `projection`; see
    /// [`Rectification`](kinetoscope_sensors::camera::Rectification).
    CameraInfo {
        /// Name of the camera.
        camera: String,
        /// Height of its images \[pixels\].
        height: usize,
        /// Width of its images \[pixels\].
        width: usize,
        /// Lens distortion; `None` for a lens that no distortion model of ROS describes.
        distortion: Option<Distortion>,
    },
    /// Inertial measurement unit; the fields have the names of its channels.
    Imu,
    /// Ray caster; the fields have the names of its channels. Hit points in the environment \[m\], distances \[m\],
    /// normals, mask ids, and the pose of the parent body, with the drift. A miss has infinite points and distances,
    /// and zero normals and ids.
    RayHits,
    /// Simulation time, positions and velocities of all joints in MuJoCo's order: `clock`, `qpos`, `qvel`.
    EngineState,
    /// Result of a step of a task: `reward`, and `terminated` and `truncated` as 1 or 0.
    TaskResult,
    /// Values of any other sensor, or the state of an MJCF part (without names).
    SensorValues {
        /// Names of the bodies, links, joints, actuators or frames of the rows, in order; empty without names.
        rows: Vec<String>,
        /// Contact sensors: names of the contact filters, in the order of the second axis of matrices.
        filters: Vec<String>,
    },
}

impl StreamKind {
    /// Values without names.
    pub(crate) fn unnamed() -> Self {
        Self::SensorValues { rows: Vec::new(), filters: Vec::new() }
    }

    /// Names of the columns; empty for kinds without names.
    pub(crate) fn names(&self) -> &[String] {
        match self {
            Self::Joints { names: columns }
            | Self::Poses { frames: columns }
            | Self::SensorValues { rows: columns, .. } => columns,
            _ => &[],
        }
    }
}
