//! The error of the public API: what the user did, where, and what would be right.

use crate::batch_error::BatchError;
use crate::drive::plan::PlanError;
use crate::mjcf::error::EmitError;
use crate::mjcf::part::PartError;
use crate::mjcf::robot_file::RobotFileError;
use crate::named::Named;
use crate::pattern::PatternError;
use crate::randomization::RandomizationError;
use crate::shard::ShardError;
use crate::snapshot::SnapshotError;
use kinetoscope_mujoco::{CompileError, EngineError, LoadError, VersionError};
use kinetoscope_robot::kinematics::KinematicsError;
use kinetoscope_robot::shape_inertia::ShapeInertiaError;
use kinetoscope_robot::urdf::UrdfError;
use kinetoscope_scene::source::Source;
use std::path::PathBuf;

/// Result of the public API.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error of the public API.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An observer is not there.
    #[error("this observer was taken away, or is being told of something right now")]
    NoObserver,
    /// A URDF file or an assembly of them is wrong.
    #[error(transparent)]
    Urdf(#[from] UrdfError),
    /// A mesh that collides cannot be used.
    #[error("{at}: link {link:?}: {error}")]
    CollisionMesh {
        /// Where the mesh is named.
        at: Source,
        /// The link.
        link: String,
        /// What is wrong with the file.
        #[source]
        error: Box<kinetoscope_scene::mesh::MeshError>,
    },
    /// The mesh of a rigid object cannot be used.
    #[error("object {object:?}: {error}")]
    ObjectMesh {
        /// The object.
        object: String,
        /// What is wrong with the file.
        #[source]
        error: Box<kinetoscope_scene::mesh::MeshError>,
    },
    /// A drive property or a start position is wrong.
    #[error("{robot}: {error}")]
    Plan {
        /// The robot or articulation.
        robot: Named,
        /// What is wrong.
        #[source]
        error: Box<PlanError>,
    },
    /// A control part's patterns are wrong.
    #[error("{robot}, control part {part:?}: {error}")]
    ControlPart {
        /// The robot or articulation.
        robot: Named,
        /// The part.
        part: String,
        /// What is wrong.
        #[source]
        error: Box<PatternError>,
    },
    /// The patterns of a payload are wrong.
    #[error("{robot}, payload: {error}")]
    Payload {
        /// The robot or articulation.
        robot: Named,
        /// What is wrong.
        #[source]
        error: Box<PatternError>,
    },
    /// The patterns of surfaces are wrong.
    #[error("{of}, surfaces: {error}")]
    Surfaces {
        /// The robot, the articulation or the MJCF file.
        of: Named,
        /// What is wrong.
        #[source]
        error: Box<PatternError>,
    },
    /// Kinematics of a robot cannot be computed.
    #[error("{robot}: {error}")]
    Kinematics {
        /// The robot or articulation.
        robot: Named,
        /// What is wrong.
        #[source]
        error: Box<KinematicsError>,
    },
    /// Heights of a terrain cannot be made.
    #[error(transparent)]
    Terrain(#[from] kinetoscope_scene::terrain::TerrainError),
    /// Two control parts have the same name.
    #[error("{robot}: control part {part:?} is given twice; join its patterns in one list")]
    ControlPartRepeated {
        /// The robot or articulation.
        robot: Named,
        /// The part.
        part: String,
    },
    /// The robot cannot be written as MJCF.
    #[error(transparent)]
    Emit(#[from] EmitError),
    /// MuJoCo refuses the model.
    #[error(transparent)]
    Compile(#[from] CompileError),
    /// MuJoCo refuses an MJCF file; its words name element and line.
    #[error("{}", in_file(&format_args!("part {part:?}"), .file, .error))]
    MjcfFile {
        /// The part.
        part: String,
        /// The file.
        file: String,
        /// What is wrong.
        #[source]
        error: Box<CompileError>,
    },
    /// An MJCF file is no robot.
    #[error("{}", in_file(.robot, .file, .error))]
    RobotFile {
        /// The robot or articulation.
        robot: Named,
        /// The file.
        file: String,
        /// What is wrong.
        #[source]
        error: Box<RobotFileError>,
    },
    /// Something of an MJCF file cannot be in a scene.
    #[error("part {part:?}: {file}: {error}")]
    MjcfPart {
        /// The part.
        part: String,
        /// The file.
        file: String,
        /// What it is.
        #[source]
        error: Box<PartError>,
    },
    /// Patterns of names of a part match nothing, or are none.
    #[error("part {part:?}: {error}")]
    MjcfNames {
        /// The part.
        part: String,
        /// What is wrong.
        #[source]
        error: Box<PatternError>,
    },
    /// The MuJoCo library is not of the version of the headers.
    #[error(transparent)]
    MujocoVersion(#[from] VersionError),
    /// Environments cannot be made.
    #[error(transparent)]
    Batch(#[from] BatchError),
    /// MuJoCo's engine stopped.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A number of the configuration is out of range.
    #[error("{field} is {value}; {expected}")]
    Config {
        /// The field.
        field: &'static str,
        /// The value given.
        value: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The combination of integrator and drives does not work.
    #[error(
        "{robot}: implicit drives need the integrator Euler{also}, not {integrator}; change the integrator or \
         use DriveModel::Actuator"
    )]
    Integrator {
        /// The robot or articulation.
        robot: Named,
        /// MuJoCo's word for the integrator.
        integrator: &'static str,
        /// Further integrators that this MuJoCo offers.
        also: &'static str,
    },
    /// This MuJoCo does not know the integrator.
    #[error("MuJoCo {version} has no integrator {integrator}; it has Euler, RK4 and implicit")]
    IntegratorUnknown {
        /// MuJoCo's word.
        integrator: &'static str,
        /// MuJoCo's version.
        version: String,
    },
    /// A name is used already.
    #[error(
        "the uid {0:?} is taken; give each robot, object, terrain and sensor a uid of its own (for objects and terrains, \"world\" and \"ground\" are taken)"
    )]
    DuplicateUid(String),
    /// A name that cannot be written to MJCF, or be a part of the names of files.
    #[error(
        "the uid {0:?} is not usable: it must have 1 to 64 characters, no slash, backslash or control character, and not be a dot or two"
    )]
    InvalidUid(String),
    /// The environments together are too much to draw.
    #[error("the overview cannot be drawn: {0}; choose fewer environments")]
    Overview(String),
    /// The object or the base of the robot stands fixed.
    #[error(
        "{0:?} is fixed where its init_pose says; make an object BodyType::Dynamic (or Kinematic, to move it by hand), give \
         a robot fix_base: false, to move it"
    )]
    FixedBody(String),
    /// What a body must move for by itself.
    #[error(
        "{argument}: {object:?} is not BodyType::Dynamic: it has no velocity, mass or force of its own; write the pose of one \
         that is Kinematic"
    )]
    NotDynamic {
        /// The method.
        argument: &'static str,
        /// The object.
        object: String,
    },
    /// More robots than contact bits.
    #[error(
        "{0} robots and articulations are the most that can tell their own contacts from others' (MuJoCo has 31 contact bits)"
    )]
    TooManyRobots(usize),
    /// No such name.
    #[error("there is no {what} {name:?}; {}", candidates_sentence(.candidates))]
    UnknownName {
        /// What kind of thing was looked for.
        what: &'static str,
        /// The name given.
        name: String,
        /// Names that exist, nearest first.
        candidates: Vec<String>,
    },
    /// An entity of a scene is something else.
    #[error("{name:?} is a {found}, not a {wanted}")]
    EntityType {
        /// The entity.
        name: String,
        /// What it is.
        found: String,
        /// What it was taken for.
        wanted: String,
    },
    /// An entity of a scene file cannot be built.
    #[error("{at}: entity {name:?}: {error}")]
    Entity {
        /// Where it is declared.
        at: Source,
        /// The entity.
        name: String,
        /// What is wrong.
        #[source]
        error: Box<Error>,
    },
    /// A pair that a scene file keeps apart is none.
    #[error("{at}: pair that never collides: {error}")]
    Exclusion {
        /// Where it is declared.
        at: Source,
        /// What is wrong.
        #[source]
        error: Box<Error>,
    },
    /// A scene file is wrong.
    #[error("{at}: {reason}")]
    SceneFile {
        /// Where.
        at: Source,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// A scene cannot be written as a file.
    #[error("{what} cannot be written to a scene file: {reason}")]
    SceneFileWrite {
        /// The part of the scene.
        what: String,
        /// Why.
        reason: String,
    },
    /// No such index.
    #[error("{what} {index} does not exist; there are {count} (0 to {})", count.saturating_sub(1))]
    UnknownIndex {
        /// What kind of index.
        what: &'static str,
        /// The index given.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// Two columns of an array are of one thing.
    #[error("{argument} has two columns for {of} (columns {first} and {second}); give it one")]
    RepeatedColumn {
        /// The argument.
        argument: &'static str,
        /// Whose columns they are: `actuator "a"`.
        of: String,
        /// The first column of it.
        first: usize,
        /// The second one.
        second: usize,
    },
    /// A list names one thing twice.
    #[error("{argument} names {of} twice (places {first} and {second} of its list); name it once")]
    Repeated {
        /// The argument.
        argument: &'static str,
        /// What is named twice: `joint "a"`, `environment 3`.
        of: String,
        /// Its first place in the list.
        first: usize,
        /// The second one.
        second: usize,
    },
    /// An array has the wrong shape.
    #[error("{argument} has shape {found:?}; expected {expected:?} ({meaning}), or one row for all environments")]
    Shape {
        /// The argument.
        argument: &'static str,
        /// Shape given.
        found: Vec<usize>,
        /// Shape that would be right.
        expected: Vec<usize>,
        /// What the axes are.
        meaning: &'static str,
    },
    /// A value is NaN or infinite.
    #[error("{argument}[{row}, {column}] ({of}) is {value}; it must be finite")]
    NotFinite {
        /// The argument.
        argument: &'static str,
        /// Row of the array.
        row: usize,
        /// Column of the array.
        column: usize,
        /// Whose value it is: `joint "a"`, `object "cube"`.
        of: String,
        /// The value.
        value: f64,
    },
    /// A value is not one of those that are allowed.
    #[error("{argument}[{row}, {column}] ({of}) is {value}; it must be {expected}")]
    OutOfRange {
        /// The argument.
        argument: &'static str,
        /// Row of the array.
        row: usize,
        /// Column of the array.
        column: usize,
        /// Whose value it is: `joint "a"`.
        of: String,
        /// The value.
        value: f64,
        /// What would be right.
        expected: String,
    },
    /// A joint has no drive to change.
    #[error(
        "{argument}: joint {joint:?} of {robot} has no drive in the model, since it was added with the drive type none, or \
         its file says that nothing drives the joint; add it with another one, and call set_drive_type where joints shall be \
         passive"
    )]
    NotDriven {
        /// The method.
        argument: &'static str,
        /// The robot or articulation.
        robot: Named,
        /// The joint.
        joint: String,
    },
    /// The gains of a drive are in MuJoCo's model.
    #[error(
        "{argument}: joint {joint:?} of {robot} is driven by DriveModel::Actuator, whose gains and limits are in the \
         model that all environments share; use DriveModel::Implicit or an explicit actuator model to change them"
    )]
    GainsInModel {
        /// The method.
        argument: &'static str,
        /// The robot or articulation.
        robot: Named,
        /// The joint.
        joint: String,
    },
    /// A joint's drive delays nothing.
    #[error(
        "set_delay: joint {joint:?} of {robot} is not driven by the actuator model delayed_pd; name it for this joint \
         in drive.actuators"
    )]
    NoDelay {
        /// The robot or articulation.
        robot: Named,
        /// The joint.
        joint: String,
    },
    /// Patterns of names of a robot match nothing, or are none.
    #[error("{robot}: {error}")]
    RobotNames {
        /// The robot or articulation.
        robot: Named,
        /// What is wrong.
        #[source]
        error: Box<PatternError>,
    },
    /// A sensor's configuration is wrong.
    #[error("sensor {sensor:?}: {error}")]
    Sensor {
        /// The sensor.
        sensor: String,
        /// What is wrong.
        #[source]
        error: Box<kinetoscope_sensors::SensorError>,
    },
    /// Labels of a segmentation name what is not there, or one thing twice.
    #[error("labels: {0}")]
    Labels(#[source] Box<kinetoscope_sensors::SensorError>),
    /// A sensor needs a quantity that is not gathered.
    #[error("sensor {sensor:?} needs {missing}, which this simulation does not gather")]
    SensorRequires {
        /// The sensor.
        sensor: String,
        /// What it needs.
        missing: String,
    },
    /// A sensor failed in an earlier step and was not updated since.
    #[error("sensor {sensor:?} stopped: {fault}")]
    SensorFault {
        /// The sensor.
        sensor: String,
        /// Why.
        fault: String,
    },
    /// The launcher's variables say no part of several processes.
    #[error(transparent)]
    Shard(#[from] ShardError),
    /// A property of an environment cannot be drawn or set.
    #[error(transparent)]
    Randomization(#[from] RandomizationError),
    /// A snapshot cannot be read, or is of something else.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// A file cannot be read or written.
    #[error("{path}: {error}")]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        #[source]
        error: std::io::Error,
    },
    /// A texture cannot be converted.
    #[error("{path}: not a readable PNG or JPEG image: {reason}")]
    Image {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

impl From<LoadError> for Error {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::Version(e) => Self::MujocoVersion(e),
            LoadError::Compile(e) => Self::Compile(e),
        }
    }
}

/// An error of a file: the place comes first where it has one, as in all messages that have a place.
fn in_file(of: &dyn std::fmt::Display, file: &str, error: &dyn std::fmt::Display) -> String {
    let said = error.to_string();
    let place = said.split_once(": ").filter(|(place, _)| {
        let line = place.strip_prefix(file).and_then(|rest| rest.strip_prefix(':'));
        !file.is_empty() && line.is_some_and(|line| line.parse::<u32>().is_ok())
    });
    match place {
        Some((place, rest)) => format!("{place}: {of}: {rest}"),
        None => format!("{of}: {file}: {said}"),
    }
}

fn candidates_sentence(candidates: &[String]) -> String {
    if candidates.is_empty() {
        return "there are none".into();
    }
    let names: Vec<String> = candidates.iter().map(|c| format!("{c:?}")).collect();
    format!("known are {}", names.join(", "))
}

impl From<ShapeInertiaError> for Error {
    fn from(error: ShapeInertiaError) -> Self {
        match error {
            ShapeInertiaError::Density { value, expected } => {
                Self::Config { field: "missing_inertia", value: value.to_string(), expected }
            }
            ShapeInertiaError::Mesh { at, link, error } => Self::CollisionMesh { at, link, error },
        }
    }
}
