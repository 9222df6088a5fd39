#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod assets;
#[cfg(doctest)]
mod book;
#[cfg(all(feature = "record", feature = "viewer"))]
mod file_recording;
#[cfg(feature = "record")]
mod foxglove_stream;
#[cfg(all(feature = "record", feature = "viewer"))]
mod recording_playback;

#[cfg(all(feature = "record", feature = "viewer"))]
pub use file_recording::FileRecording;
#[cfg(feature = "record")]
pub use foxglove_stream::FoxgloveStream;
pub use kinetoscope_exec as exec;
pub use kinetoscope_look as look;
pub use kinetoscope_mujoco as mujoco;
#[cfg(feature = "record")]
pub use kinetoscope_record as record;
pub use kinetoscope_render as render;
pub use kinetoscope_robot as robot;
pub use kinetoscope_scene as scene;
pub use kinetoscope_sensors as sensors;
pub use kinetoscope_sim as sim;
#[cfg(feature = "tasks")]
pub use kinetoscope_tasks as tasks;
#[cfg(feature = "viewer")]
pub use kinetoscope_viewer as viewer;
pub use nalgebra;
pub use ndarray;
#[cfg(all(feature = "record", feature = "viewer"))]
pub use recording_playback::RecordingPlayback;

/// Names that most programs need (at most 45), and the traits of their methods: `use kinetoscope::prelude::*;`.
pub mod prelude {
    pub use crate::assets;
    #[cfg(feature = "record")]
    pub use kinetoscope_record::Record;
    pub use kinetoscope_render::frame::Channels;
    pub use kinetoscope_render::{Intrinsics, RasterCfg, Renderer};
    pub use kinetoscope_robot::urdf::{ComponentCfg, UrdfCfg};
    pub use kinetoscope_scene::Pose;
    pub use kinetoscope_sensors::camera::{CameraCfg, CameraPlacement, Extrinsics, Placement};
    pub use kinetoscope_sensors::ray::{RayCasterCfg, RayPattern};
    pub use kinetoscope_sensors::{ContactSensorCfg, ImuCfg, Sampled, SamplingCfg};
    pub use kinetoscope_sim::{
        ArticulationCfg, BodyType, DriveCfg, EntityCfg, EnvId, GroundCfg, InteractiveScene, JointIndex, LightCfg,
        MjcfFile, MjcfPartCfg, ObjectShape, Property, Randomization, RandomizationOp, RigidObjectCfg, RobotCfg,
        RobotId, SceneCfg, SensorId, SimulationManager, SimulationManagerCfg, TerrainCfg,
    };
    #[cfg(feature = "viewer")]
    pub use kinetoscope_viewer::{OpenWindow, Screenshot, Serve};
}
