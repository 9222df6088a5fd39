#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

/// The programs of the page are compiled as those of the README are.
#[cfg(all(doctest, feature = "record"))]
#[doc = include_str!("../docs/recording.md")]
struct PageOfRecordings;

/// So are those of this page.
#[cfg(doctest)]
#[doc = include_str!("../docs/cameras.md")]
struct PageOfCameras;

pub mod assets;
#[cfg(all(feature = "record", feature = "viewer"))]
mod record_button;
#[cfg(all(feature = "record", feature = "viewer"))]
mod recorded_film;

pub use kinetoscope_exec as exec;
pub use kinetoscope_mujoco as mujoco;
#[cfg(feature = "record")]
pub use kinetoscope_record as record;
pub use kinetoscope_render as render;
pub use kinetoscope_robot as robot;
pub use kinetoscope_scene as scene;
pub use kinetoscope_sensors as sensors;
pub use kinetoscope_sim as sim;
pub use kinetoscope_tasks as tasks;
#[cfg(feature = "viewer")]
pub use kinetoscope_viewer as viewer;
pub use ndarray;
#[cfg(all(feature = "record", feature = "viewer"))]
pub use record_button::FileRecording;
#[cfg(all(feature = "record", feature = "viewer"))]
pub use recorded_film::RecordedFilm;

/// What most programs need: `use kinetoscope::prelude::*;`.
pub mod prelude {
    #[cfg(all(feature = "record", feature = "viewer"))]
    pub use crate::FileRecording;
    pub use crate::assets;
    #[cfg(feature = "record")]
    pub use kinetoscope_record::{Record, RecordError, Recorded, Recorder, RecorderCfg, RecorderId, Topic};
    pub use kinetoscope_scene::Pose;
    pub use kinetoscope_sensors::camera::{
        Aperture, Camera, CameraCfg, CameraConvention, CameraInfo, CameraPlacement, Channels, DepthMiss, Extrinsics,
        Imperfections, Intrinsics, Lens, Placement, RasterCfg, Renderer, SegmentLevel, Segmentation, SegmentationCfg,
        Shutter, StereoCamera, StereoCameraCfg, StereoOrigin, ToneCurve,
    };
    pub use kinetoscope_sensors::ray::{
        HitTargets, RayAlignment, RayCaster, RayCasterCamera, RayCasterCameraCfg, RayCasterCfg, RayPattern,
    };
    pub use kinetoscope_sensors::{
        ActuatorState, ActuatorStateCfg, ContactSensor, ContactSensorCfg, FrameTransformer, FrameTransformerCfg, Imu,
        ImuCfg, JointState, JointStateCfg, JointWrench, JointWrenchCfg, MujocoSensor, MujocoSensorCfg, NoiseCfg,
        Sampled, SamplingCfg, TargetFrameCfg,
    };
    pub use kinetoscope_sim::{
        ActuatorIndex, ActuatorModel, ArticulationCfg, ArticulationId, BodyType, ComponentCfg, DcMotor, DelayedPd,
        Diagnostic, Draw, DriveCfg, DriveModel, DriveType, EntityCfg, EntityTypes, EnvId, Error, ExclusionCfg,
        GroundCfg, GroupId, IdealPd, IkCfg, IkResult, IkTask, Integrator, InteractiveScene, JointIndex, LampKind,
        LightCfg, LinkId, MaskId, MeshCollision, MissingInertia, MjcfCfg, MjcfFile, MjcfId, Moment, NameCase,
        NameCaseCfg, ObjectId, ObjectShape, Observer, ObserverId, PerJoint, Posture, Properties, Property,
        Randomization, RandomizationError, Result, RigidObjectCfg, RigidObjectGroupCfg, RobotCfg, RobotId, Rollout,
        SceneCfg, SensorId, Shard, ShardError, SimulationManager, SimulationManagerCfg, Snapshot, SnapshotError, Still,
        Strictness, SurfaceCfg, TerrainCfg, TerrainId, Tip, UrdfCfg, WeldCfg, WeldId, WrenchFrame,
    };
    #[cfg(feature = "viewer")]
    pub use kinetoscope_viewer::{
        ImageWindow, ImageWindowCfg, OpenWindow, RecordButton, Screenshot, ScreenshotCfg, ScreenshotError, Serve,
        ServeCfg, ServeError, Served, Viewing, Window, WindowCfg, WindowError,
    };
}
