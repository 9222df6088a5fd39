//! What a file is told of the numbers that it gets.

use kinetoscope_sensors::{Channel, Stamp};

/// Numbers that are recorded together: their names, shapes and meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct Stream {
    /// Such as `arm/joint_states` or `camera/color`.
    pub name: String,
    /// What they mean.
    pub kind: Kind,
    /// The type of the numbers.
    pub element: Element,
    /// The quantities, one after the other in a row.
    pub parts: Vec<Part>,
    /// The environments, one row each.
    pub env_ids: Vec<usize>,
}

impl Stream {
    /// Numbers in the row of an environment.
    pub fn width(&self) -> usize {
        self.parts.iter().map(Part::width).sum()
    }

    /// The numbers of a part in the row of an environment; nothing where there is no such part.
    pub(crate) fn part<'v>(&self, row: &'v [f64], name: &str) -> &'v [f64] {
        let first: usize = self.parts.iter().take_while(|part| part.name != name).map(Part::width).sum();
        let width = self.parts.iter().find(|part| part.name == name).map_or(0, Part::width);
        row.get(first..first + width).unwrap_or(&[])
    }

    /// Whether its parts are of two instants: see [`Part::of_forces`].
    pub(crate) fn is_mixed(&self) -> bool {
        self.parts.iter().any(|part| part.of_forces) && !self.parts.iter().all(|part| part.of_forces)
    }
}

/// One quantity of a stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Such as `positions`; empty where the stream has one quantity only, which is called as the stream.
    pub name: String,
    /// Its shape in one environment.
    pub shape: Vec<usize>,
    /// Whether a sensor measures it at [`kinetoscope_scene::SceneState::force_time`]: forces, efforts and accelerations, which the engine
    /// solves for at the beginning of the step that leads to positions and velocities.
    pub of_forces: bool,
    /// Unit that the sensor gives it ([`Channel::unit`](kinetoscope_sensors::Channel::unit)); empty where it gives none.
    pub unit: String,
}

impl Part {
    pub(crate) fn new(name: &str, shape: impl Into<Vec<usize>>) -> Self {
        Self { name: name.into(), shape: shape.into(), of_forces: false, unit: String::new() }
    }

    /// A channel of a sensor.
    pub(crate) fn of_channel(channel: &Channel) -> Self {
        let (of_forces, unit) = (channel.stamp == Stamp::Force, channel.unit.to_string());
        Self { of_forces, unit, ..Self::new(channel.name, [channel.width]) }
    }

    /// How many numbers it has in one environment.
    pub fn width(&self) -> usize {
        self.shape.iter().product()
    }
}

/// The type of the numbers of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Element {
    /// Bytes.
    U8,
    /// Whole numbers.
    I32,
    /// Numbers of pictures.
    F32,
    /// Numbers of states.
    F64,
}

/// How a lens distorts pictures, in ROS's words.
#[derive(Clone, Debug, PartialEq)]
pub struct Distortion {
    /// `plumb_bob`, `rational_polynomial` or `equidistant`.
    pub model: String,
    /// Its coefficients, in the order of the model.
    pub coefficients: Vec<f64>,
}

/// What the numbers of a stream mean.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Kind {
    /// Positions, velocities and efforts, of joints or wanted of them.
    Joints {
        /// Names of the joints.
        names: Vec<String>,
    },
    /// Poses in the environment, rows `[x, y, z, qw, qx, qy, qz]` \[m\].
    Poses {
        /// Names of what is there.
        frames: Vec<String>,
    },
    /// A picture, row by row from the top left.
    Picture {
        /// The camera.
        camera: String,
        /// What it shows.
        channel: String,
        /// Rows.
        height: usize,
        /// Pixels per row.
        width: usize,
    },
    /// The intrinsic matrix of a camera \[pixels\] and its pose in the environment, Ros axes. Of an eye of a pair also what rectifies
    /// its pictures: `rectification` and `projection`, see [`Rectification`](kinetoscope_sensors::camera::Rectification).
    Lens {
        /// The camera.
        camera: String,
        /// Rows of its pictures.
        height: usize,
        /// Pixels per row of its pictures.
        width: usize,
        /// What its lens does to them; `None` for a lens that ROS has no words for.
        distortion: Option<Distortion>,
    },
    /// An inertial measurement unit; the quantities are called as its channels.
    Imu,
    /// What rays hit, the quantities called as the channels of a ray caster: points in the environment \[m\] and distances
    /// \[m\], infinite for a miss, normals and mask ids, 0 for a miss, and the pose of the body that the sensor hangs on.
    Points,
    /// Simulation time, positions and velocities of all joints as MuJoCo has them: `clock`, `qpos`, `qvel`.
    EngineState,
    /// What came of a step of a task: `reward`, and 1 for an episode that was `terminated` or `truncated`, else 0.
    Outcome,
    /// Numbers of a sensor.
    Numbers {
        /// What they are of, in order: bodies, links, joints, actuators, frames; empty where they have no names.
        rows: Vec<String>,
        /// What each of the bodies may touch, in the order of the second axis of matrices; of sensors of contacts.
        filters: Vec<String>,
    },
}

impl Kind {
    /// Numbers without names.
    pub(crate) fn unnamed() -> Self {
        Self::Numbers { rows: Vec::new(), filters: Vec::new() }
    }

    /// What the columns of its quantities are of.
    pub(crate) fn names(&self) -> &[String] {
        match self {
            Self::Joints { names: columns } | Self::Poses { frames: columns } | Self::Numbers { rows: columns, .. } => {
                columns
            }
            _ => &[],
        }
    }
}
