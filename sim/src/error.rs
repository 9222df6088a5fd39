//! Error type of the public API: the failing input, its position, and the fix.

use crate::batch_error::BatchError;
use crate::drive::plan::PlanError;
use crate::entity_label::EntityLabel;
use crate::mjcf::error::RobotMjcfError;
use crate::mjcf::part::PartError;
use crate::mjcf::robot_file::RobotFileError;
use crate::pattern::PatternError;
use crate::randomization::RandomizationError;
use crate::shard::ShardError;
use crate::snapshot::SnapshotError;
use kinetoscope_mujoco::{CompileError, EngineError, LoadError, VersionError};
use kinetoscope_robot::kinematics::KinematicsError;
use kinetoscope_robot::shape_inertia::ShapeInertiaError;
use kinetoscope_robot::urdf::UrdfError;
use kinetoscope_scene::source_location::SourceLocation;
use std::path::PathBuf;

/// Result of the public API.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error of the public API.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The observer was removed, or is handling an event right now.
    #[error("this observer was removed, or is handling an event right now")]
    ObserverUnavailable,
    /// Another thread ended the call by the flag that the caller had given.
    #[error("the call was interrupted before its end")]
    Interrupted,
    /// A closure of [`with_mujoco`](crate::SceneViewMut::with_mujoco) exchanged the data for data of another model, for
    /// instance with `std::mem::swap`.
    #[error(
        "environment {env}: the closure of with_mujoco exchanged the data for that of another model; the environment \
         keeps its state; copy the arrays instead"
    )]
    ExchangedData {
        /// Index of the environment.
        env: usize,
    },
    /// The physics of a device is not available, does not support the scene, or failed.
    #[error(transparent)]
    Device(#[from] crate::device::DeviceError),
    /// A URDF file, or the assembly of several, is invalid.
    #[error(transparent)]
    Urdf(#[from] UrdfError),
    /// A collision mesh cannot be used.
    #[error("{at}: link {link:?}: {error}")]
    CollisionMesh {
        /// File and line that name the mesh.
        at: SourceLocation,
        /// The link.
        link: String,
        /// Error of the mesh file.
        #[source]
        error: Box<kinetoscope_scene::mesh::MeshError>,
    },
    /// The mesh of a rigid object cannot be used.
    #[error("object {object:?}: {error}")]
    ObjectMesh {
        /// The object.
        object: String,
        /// Error of the mesh file.
        #[source]
        error: Box<kinetoscope_scene::mesh::MeshError>,
    },
    /// Drives or start positions of a robot are invalid, or its dynamics cannot be computed.
    #[error("{robot}: {error}")]
    DrivePlan {
        /// The robot or articulation.
        robot: EntityLabel,
        /// Cause.
        #[source]
        error: Box<PlanError>,
    },
    /// The joint patterns of a control part are invalid.
    #[error("{robot}, control part {part:?}: {error}")]
    ControlPart {
        /// The robot or articulation.
        robot: EntityLabel,
        /// Name of the control part.
        part: String,
        /// Cause.
        #[source]
        error: Box<PatternError>,
    },
    /// The patterns of a payload are invalid.
    #[error("{robot}, payload: {error}")]
    Payload {
        /// The robot or articulation.
        robot: EntityLabel,
        /// Cause.
        #[source]
        error: Box<PatternError>,
    },
    /// The patterns of surfaces are invalid.
    #[error("{entity}, surfaces: {error}")]
    Surfaces {
        /// The robot, articulation or attached MJCF file.
        entity: EntityLabel,
        /// Cause.
        #[source]
        error: Box<PatternError>,
    },
    /// Kinematics of a robot cannot be computed.
    #[error("{robot}: {error}")]
    Kinematics {
        /// The robot or articulation.
        robot: EntityLabel,
        /// Cause.
        #[source]
        error: Box<KinematicsError>,
    },
    /// Heights of a terrain cannot be generated.
    #[error(transparent)]
    Terrain(#[from] kinetoscope_scene::terrain::TerrainError),
    /// Two control parts have the same name.
    #[error("{robot}: control part {part:?} is given twice; join its patterns in one list")]
    ControlPartRepeated {
        /// The robot or articulation.
        robot: EntityLabel,
        /// Name of the control part.
        part: String,
    },
    /// The robot cannot be written as MJCF.
    #[error(transparent)]
    MjcfWrite(#[from] RobotMjcfError),
    /// MuJoCo rejects the model.
    #[error(transparent)]
    Compile(#[from] CompileError),
    /// MuJoCo rejects an attached MJCF file; its message names element and line.
    #[error("{}", with_position_first(&format_args!("MJCF part {uid:?}"), .file, .error))]
    MjcfFile {
        /// Uid of the attached MJCF file.
        uid: String,
        /// The file.
        file: String,
        /// Cause.
        #[source]
        error: Box<CompileError>,
    },
    /// An MJCF file cannot be loaded as a robot.
    #[error("{}", with_position_first(.robot, .file, .error))]
    RobotFile {
        /// The robot or articulation.
        robot: EntityLabel,
        /// The file.
        file: String,
        /// Cause.
        #[source]
        error: Box<RobotFileError>,
    },
    /// An MJCF file has an element that cannot be attached to a scene.
    #[error("MJCF part {uid:?}: {file}: {error}")]
    MjcfAttach {
        /// Uid of the attached MJCF file.
        uid: String,
        /// The file.
        file: String,
        /// Cause.
        #[source]
        error: Box<PartError>,
    },
    /// Name patterns for an attached MJCF file are invalid or match nothing.
    #[error("MJCF part {uid:?}: {error}")]
    MjcfNames {
        /// Uid of the attached MJCF file.
        uid: String,
        /// Cause.
        #[source]
        error: Box<PatternError>,
    },
    /// The version of the MuJoCo library differs from the version that this program was built for.
    #[error(transparent)]
    MujocoVersion(#[from] VersionError),
    /// The batch of environments cannot be created.
    #[error(transparent)]
    Batch(#[from] BatchError),
    /// MuJoCo's engine reported an error.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A value of a configuration or an argument is invalid.
    #[error("{field} is {value}; {expected}")]
    Config {
        /// Name of the field or argument.
        field: &'static str,
        /// The value given.
        value: String,
        /// Valid values.
        expected: &'static str,
    },
    /// Implicit drives do not support the integrator.
    #[error(
        "{robot}: implicit drives need the integrator Euler{also}, not {integrator}; change the integrator or \
         use DriveModel::Actuator"
    )]
    Integrator {
        /// The robot or articulation.
        robot: EntityLabel,
        /// MuJoCo's name of the integrator.
        integrator: &'static str,
        /// Further integrators that this MuJoCo version supports.
        also: &'static str,
    },
    /// This MuJoCo version lacks the integrator.
    #[error("MuJoCo {version} has no integrator {integrator}; it has Euler, RK4 and implicit")]
    UnsupportedIntegrator {
        /// MuJoCo's name of the integrator.
        integrator: &'static str,
        /// Version of MuJoCo.
        version: String,
    },
    /// A uid is already in use, or reserved (`world`, `ground`).
    #[error(
        "the uid {0:?} is taken; give each robot, object, terrain and sensor a uid of its own (\"world\" and \"ground\" belong to the scene)"
    )]
    DuplicateUid(String),
    /// A uid is unusable as a part of MJCF or file names.
    #[error(
        "the uid {0:?} is not usable: it must have 1 to 64 characters, no slash, backslash or control character, and must not be \".\" or \"..\""
    )]
    InvalidUid(String),
    /// The overview of all environments cannot be rendered.
    #[error("the overview cannot be rendered: {0}; choose fewer environments")]
    Overview(String),
    /// The static object has no velocity, or the base of the robot is fixed and cannot be moved.
    #[error(
        "{0:?} is fixed at its init_pose; to move it, make an object BodyType::Dynamic (or Kinematic, to set its pose \
         directly), or give a robot fix_base: false"
    )]
    FixedBody(String),
    /// The operation needs a dynamic object, and this object is kinematic or static.
    #[error(
        "{argument}: {object:?} is not BodyType::Dynamic, so it has no velocity, mass or force; to move a Kinematic object, \
         set its pose"
    )]
    NotDynamic {
        /// Name of the method or argument.
        argument: &'static str,
        /// The object.
        object: String,
    },
    /// The scene has the maximum number of robots and articulations, which is the content of this error.
    #[error(
        "a scene can have at most {0} robots and articulations: MuJoCo has 31 contact bits to tell self-collisions from others"
    )]
    TooManyRobots(usize),
    /// A name does not exist.
    #[error("unknown {what} {name:?}; {}", candidates_sentence(.candidates))]
    UnknownName {
        /// Type of the item that was looked up.
        what: &'static str,
        /// The name given.
        name: String,
        /// Existing names: the most similar ones, nearest first, or all uids of the kind in insertion order.
        candidates: Vec<String>,
    },
    /// An entity of a scene has another type than requested.
    #[error("{name:?} is {}, not {}", with_article(.found), with_article(.wanted))]
    EntityType {
        /// The entity.
        name: String,
        /// Its type.
        found: String,
        /// The requested type.
        wanted: String,
    },
    /// An entity of a scene file cannot be built.
    #[error("{at}: entity {name:?}: {error}")]
    Entity {
        /// File and line of the declaration.
        at: SourceLocation,
        /// The entity.
        name: String,
        /// Cause.
        #[source]
        error: Box<Error>,
    },
    /// A collision exclusion of a scene file is invalid.
    #[error("{at}: collision exclusion: {error}")]
    Exclusion {
        /// File and line of the declaration.
        at: SourceLocation,
        /// Cause.
        #[source]
        error: Box<Error>,
    },
    /// A scene file is invalid.
    #[error("{at}: {reason}")]
    SceneFile {
        /// File and line.
        at: SourceLocation,
        /// The problem and the fix.
        reason: String,
    },
    /// A scene cannot be written as a file.
    #[error("{what} cannot be written to a scene file: {reason}")]
    SceneFileWrite {
        /// The part of the scene.
        what: String,
        /// Reason.
        reason: String,
    },
    /// An index does not exist.
    #[error("{what} {index} does not exist; there are {count} (0 to {})", count.saturating_sub(1))]
    UnknownIndex {
        /// Type of the indexed item.
        what: &'static str,
        /// The index given.
        index: usize,
        /// Number of items.
        count: usize,
    },
    /// Two columns of an array refer to the same item.
    #[error("{argument} has two columns for {item} (columns {first} and {second}); give it one")]
    RepeatedColumn {
        /// Name of the argument.
        argument: &'static str,
        /// The item: `actuator "a"`.
        item: String,
        /// First column of the item.
        first: usize,
        /// Second column of the item.
        second: usize,
    },
    /// A list contains an item twice.
    #[error("{argument} names {item} twice (positions {first} and {second} of the list); name it once")]
    RepeatedItem {
        /// Name of the argument.
        argument: &'static str,
        /// The item: `joint "a"`, `environment 3`.
        item: String,
        /// First position in the list.
        first: usize,
        /// Second position in the list.
        second: usize,
    },
    /// An array has the wrong shape.
    #[error("{argument} has shape {found:?}; expected {expected:?} ({meaning}), or one row for all environments")]
    Shape {
        /// Name of the argument.
        argument: &'static str,
        /// Shape given.
        found: Vec<usize>,
        /// Expected shape, with one row for each selected environment. A single row is accepted as well.
        expected: Vec<usize>,
        /// Meaning of the axes.
        meaning: &'static str,
    },
    /// A value is NaN or infinite.
    #[error("{argument}[{row}, {column}] ({item}) is {value}; it must be finite")]
    NotFinite {
        /// Name of the argument.
        argument: &'static str,
        /// Row of the array, from 0.
        row: usize,
        /// Column of the array, from 0.
        column: usize,
        /// The item that the value belongs to: `joint "a"`, `object "cube"`.
        item: String,
        /// The value.
        value: f64,
    },
    /// A value is outside the allowed set.
    #[error("{argument}[{row}, {column}] ({item}) is {value}; it must be {expected}")]
    OutOfRange {
        /// Name of the argument.
        argument: &'static str,
        /// Row of the array, from 0.
        row: usize,
        /// Column of the array, from 0.
        column: usize,
        /// The item that the value belongs to: `joint "a"`.
        item: String,
        /// The value.
        value: f64,
        /// Allowed values.
        expected: String,
    },
    /// The joint has no drive, because it was added as a passive joint.
    #[error(
        "{argument}: joint {joint:?} of {robot} has no drive in the model, because it was added with the drive type none, or \
         its file leaves it passive; add the entity with another drive type, and make joints passive with set_drive_type"
    )]
    NotDriven {
        /// Name of the method.
        argument: &'static str,
        /// The robot or articulation.
        robot: EntityLabel,
        /// The joint.
        joint: String,
    },
    /// Gains and effort limits of the drive are part of MuJoCo's model and cannot be changed.
    #[error(
        "{argument}: joint {joint:?} of {robot} is driven by DriveModel::Actuator, whose gains and limits are in the \
         model that all environments share; use DriveModel::Implicit or an explicit actuator model to change them"
    )]
    GainsInModel {
        /// Name of the method.
        argument: &'static str,
        /// The robot or articulation.
        robot: EntityLabel,
        /// The joint.
        joint: String,
    },
    /// The actuator model of the joint has no delay.
    #[error(
        "set_delay: joint {joint:?} of {robot} is not driven by the actuator model delayed_pd; name it for this joint \
         in drive.actuators"
    )]
    NoDelay {
        /// The robot or articulation.
        robot: EntityLabel,
        /// The joint.
        joint: String,
    },
    /// Name patterns for a robot are invalid or match nothing.
    #[error("{robot}: {error}")]
    RobotNames {
        /// The robot or articulation.
        robot: EntityLabel,
        /// Cause.
        #[source]
        error: Box<PatternError>,
    },
    /// The configuration of a sensor is invalid.
    #[error("sensor {sensor:?}: {error}")]
    Sensor {
        /// The sensor.
        sensor: String,
        /// Cause.
        #[source]
        error: Box<kinetoscope_sensors::SensorError>,
    },
    /// Segmentation labels name an unknown item, or one item twice.
    #[error("labels: {0}")]
    SegmentationLabels(#[source] Box<kinetoscope_sensors::SensorError>),
    /// A sensor needs a quantity that this crate does not gather.
    #[error("sensor {sensor:?} needs {missing}, which this simulation does not gather")]
    SensorRequires {
        /// The sensor.
        sensor: String,
        /// The missing quantities.
        missing: String,
    },
    /// A sensor failed and stopped: in an earlier step, when an added entity rebuilt it, or in its pending measurement
    /// now.
    #[error("sensor {sensor:?} stopped: {fault}")]
    SensorFault {
        /// The sensor.
        sensor: String,
        /// Reason.
        fault: String,
    },
    /// The launcher's variables for several processes are invalid.
    #[error(transparent)]
    Shard(#[from] ShardError),
    /// A property of an environment cannot be randomized or set.
    #[error(transparent)]
    Randomization(#[from] RandomizationError),
    /// A snapshot cannot be read, or belongs to another scene.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// A file cannot be read or written.
    #[error("{path}: {error}")]
    File {
        /// The file or folder.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        error: std::io::Error,
    },
    /// A texture cannot be written as PNG in an export.
    #[error("{path}: the texture cannot be written as PNG: {reason}")]
    Image {
        /// The file.
        path: PathBuf,
        /// Cause.
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

/// Formats an error of an MJCF file. A position (`file:line`) in the message moves to the front, as in all other
/// messages.
fn with_position_first(of: &dyn std::fmt::Display, file: &str, error: &dyn std::fmt::Display) -> String {
    let message = error.to_string();
    let place = message.split_once(": ").filter(|(place, _)| {
        let line = place.strip_prefix(file).and_then(|rest| rest.strip_prefix(':'));
        !file.is_empty() && line.is_some_and(|line| line.parse::<u32>().is_ok())
    });
    match place {
        Some((place, rest)) => format!("{place}: {of}: {rest}"),
        None => format!("{of}: {file}: {message}"),
    }
}

fn candidates_sentence(candidates: &[String]) -> String {
    if candidates.is_empty() {
        return "no names are defined".into();
    }
    let names: Vec<String> = candidates.iter().map(|c| format!("{c:?}")).collect();
    format!("known names: {}", names.join(", "))
}

/// Returns the noun with its indefinite article.
fn with_article(noun: &str) -> String {
    let vowel_sound = noun.starts_with(['a', 'e', 'i', 'o', 'u']) || noun.starts_with("MJCF");
    format!("{} {noun}", if vowel_sound { "an" } else { "a" })
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
