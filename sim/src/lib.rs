//! Batched robot simulation on MuJoCo: robots, objects and sensors in N parallel environments.
//!
//! A [`SimulationManager`] compiles URDF and MJCF files into one MuJoCo model, steps N environments of that model on a
//! thread pool, and updates the sensors after each step. [`InteractiveScene`] builds a simulation from a declaration in
//! Rust, TOML or YAML.
//!
//! ```text
//! URDF files -> RobotDescription -> Mjcf -> Model -> Batch (N x Env) -> SceneState -> sensors
//!     kinetoscope_robot         mjcf   mujoco   compile            gather      sensor_list
//! ```
//!
//! | modules | content |
//! |---|---|
//! | `manager`, `simulation_cfg` | [`SimulationManager`] and its configuration |
//! | `interactive_scene` | declared scenes: [`SceneCfg`], scene files, entities by name |
//! | `objects` | robots, rigid objects, terrains, attached MJCF files, welds: configurations, data, views |
//! | `drive` | joint drives: gains, drive laws, actuator models |
//! | `mjcf`, `compile` | the MJCF document, its writer, and the compiled scene |
//! | `env`, `batch`, `rollout` | one environment, N environments on worker threads, rollouts on copies |
//! | `device` | the physics of all environments on a GPU |
//! | `capture`, `gather`, `sensor_list` | quantities of a step, the arrays that sensors read, the sensors themselves |
//! | `randomization`, `snapshot` | properties per environment, saved and restored states |
//! | `visible`, `scene_view` | the scene that cameras and viewers render |
//! | `observer`, `step_result` | events for viewers and recorders |
//! | [`inspect`] | report on a robot without a simulation |
//!
//! ```
//! use kinetoscope_scene::Pose;
//! use kinetoscope_sim::{RigidObjectCfg, SimulationManager, SimulationManagerCfg};
//!
//! let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() })?;
//! let cube = RigidObjectCfg { uid: "cube".into(), init_pose: Pose::translation(0.0, 0.0, 1.0), ..Default::default() };
//! let cube = sim.add_rigid_object(cube)?;
//! sim.update(10); // 0.1 s of free fall
//! let poses = sim.rigid_object(cube).pose(); // rows [x, y, z, qw, qx, qy, qz], shape (2, 7)
//! assert_eq!(poses.dim(), (2, 7));
//! assert!(poses[(0, 2)] < 1.0);
//! # Ok::<(), kinetoscope_sim::Error>(())
//! ```
//!
//! # Errors and panics
//!
//! Invalid input (names, numbers, files, environment indices) gives an [`Error`] that states the problem and the fix.
//! The only exception is a handle ([`RobotId`], [`RigidObjectId`], [`SensorId`] and the like) used with a
//! [`SimulationManager`] that did not create it. That panics, like a slice index out of bounds, because only a bug in
//! the calling program can cause it. Methods such as [`SimulationManager::robot`] therefore return no `Result`.

#![cfg_attr(
    not(feature = "internals"),
    allow(
        unreachable_pub,
        dead_code,
        unused_imports,
        reason = "public for tests and benchmarks, where the lints look"
    )
)]

mod available_memory;
#[cfg(not(feature = "internals"))]
mod batch;
#[cfg(feature = "internals")]
pub mod batch;
mod batch_error;
mod body_pose;
mod capture;
mod compile;
mod device;
mod diverged;
#[cfg(not(feature = "internals"))]
mod drive;
#[cfg(feature = "internals")]
pub mod drive;
mod entities;
mod entity_label;
mod entity_set;
#[cfg(not(feature = "internals"))]
mod env;
#[cfg(feature = "internals")]
pub mod env;
mod error;
mod export;
mod file_format;
mod gather;
mod ids;
mod indexing;
pub mod inspect;
mod interactive_scene;
mod light_cfg;
mod manager;
#[cfg(not(feature = "internals"))]
mod mjcf;
#[cfg(feature = "internals")]
pub mod mjcf;
mod objects;
mod observer;
mod randomization;
mod rollout;
mod row;
mod scene_view;
mod sensor_list;
mod shard;
mod simulation;
mod simulation_cfg;
mod snapshot;
mod step_result;
mod surface_cfg;
mod viewpoint;
mod visible;
mod visual_state;
mod warnings;
mod wrenches;

pub use batch_error::BatchError;
pub use device::{Device, DeviceError, DeviceOpener, DevicePhysics, UnknownDevice, set_device_opener};
pub use diverged::DivergedEnv;
pub use drive::plan::PlanError;
pub use drive::{ActuatorModel, DcMotor, DelayedPd, DriveCfg, DriveCfgError, DriveModel, DriveType, IdealPd, PerJoint};
pub use entities::Entities;
pub use entity_label::EntityLabel;
pub use error::{Error, Result};
pub use ids::{EnvId, MjcfId, RigidObjectId, RobotId, TerrainId};
pub use interactive_scene::{
    AnySensorCfg, AnySensorId, EntityCfg, EntityTypes, ExclusionCfg, InteractiveScene, SceneCfg,
};
pub(crate) use kinetoscope_scene::pattern;
pub use light_cfg::{LightCfg, LightKindCfg};
pub use manager::{SimulationManager, update_until};
pub use mjcf::document::{FrictionCone, Integrator};
pub use mjcf::error::RobotMjcfError;
pub use mjcf::part::PartError;
pub use mjcf::robot_file::RobotFileError;
pub use objects::articulation::{Articulation, ArticulationCfg, ArticulationId, ArticulationMut};
pub use objects::kinematics::IkResult;
pub use objects::mesh_collision::MeshCollision;
pub use objects::mjcf_file::MjcfFile;
pub use objects::mjcf_part::{MjcfPart, MjcfPartMut};
pub use objects::mjcf_part_data::{ActuatorIndex, MjcfPartCfg};
pub use objects::object_group::{RigidObjectGroup, RigidObjectGroupMut};
pub use objects::object_group_data::{RigidObjectGroupCfg, RigidObjectGroupId};
pub use objects::rigid_object::{RigidObject, RigidObjectMut};
pub use objects::rigid_object_data::{BodyType, RigidObjectCfg};
pub use objects::robot::{Robot, RobotCfg, RobotMut};
pub use objects::robot_data::JointIndex;
pub use objects::robot_gather::RobotState;
pub use objects::robot_part::RobotPartMut;
pub use objects::shape::ObjectShape;
pub use objects::terrain::{Terrain, TerrainCfg};
pub use objects::weld::{Weld, WeldMut};
pub use objects::weld_data::{WeldCfg, WeldId};
pub use observer::{Observer, ObserverId, Observers, ObserversMut, SimEvent};
pub use randomization::{
    EnvProperties, EnvPropertiesMut, Properties, Property, Randomization, RandomizationError, RandomizationOp,
    RandomizationTerm,
};
pub use rollout::{Rollout, rollout_until};
pub use scene_view::{SceneView, SceneViewMut};
pub use sensor_list::SensorId;
pub use shard::{Shard, ShardError};
pub use simulation_cfg::{GroundCfg, SimulationManagerCfg};
pub use snapshot::{Snapshot, SnapshotError};
pub use step_result::StepResult;
pub use surface_cfg::SurfaceCfg;
pub use viewpoint::Viewpoint;
pub use visible::{FreeCamera, MaskId, ModelCamera, OffscreenScene, VisualScene};
pub use visual_state::{BodyMotion, EnvVisualState, JointAxis};
pub use warnings::Warnings;
pub use wrenches::WrenchFrame;
