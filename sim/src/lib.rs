//! URDF to MJCF to batched MuJoCo: one type per stage, one file per arrow.
//!
//! ```text
//! URDF files -> UrdfFile -> RobotDescription -> Mjcf -> mj::Model -> Batch (N x Env)
//!  urdf::parse  urdf::merge  mjcf::robot   mj::vfs     batch
//! ```
//!
//! Any input gives a value or an error that says what was wrong and what would be right, with one exception: a handle
//! ([`RobotId`], [`ObjectId`], [`SensorId`] and the like) panics where it is given to another
//! [`SimulationManager`] than the one that made it, as an index beyond the end of a slice does, and for the same reason. No
//! input makes such a handle, only a mistake in the program that uses it, and an error could not be handled but by mending
//! the program. [`SimulationManager::robot`] and its like are then used without `?`. Names, numbers, files and environments
//! that do not exist are errors.

#![cfg_attr(
    not(feature = "internals"),
    allow(
        unreachable_pub,
        dead_code,
        unused_imports,
        reason = "public for tests and benchmarks, where the lints look"
    )
)]

#[cfg(not(feature = "internals"))]
mod batch;
#[cfg(feature = "internals")]
pub mod batch;
mod batch_error;
mod body_pose;
mod capture;
mod compile;
mod contents;
mod diverged;
#[cfg(not(feature = "internals"))]
mod drive;
#[cfg(feature = "internals")]
pub mod drive;
mod entities;
#[cfg(not(feature = "internals"))]
mod env;
#[cfg(feature = "internals")]
pub mod env;
mod error;
mod export;
mod file_format;
mod gather;
mod ids;
mod index;
pub mod inspect;
mod interactive_scene;
mod light_cfg;
mod look;
mod manager;
#[cfg(not(feature = "internals"))]
mod mjcf;
#[cfg(feature = "internals")]
pub mod mjcf;
mod named;
mod objects;
mod observer;
mod randomization;
mod rollout;
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
mod warnings;
mod wrenches;

pub use batch_error::BatchError;
pub use diverged::DivergedEnv;
pub use drive::plan::PlanError;
pub use drive::{ActuatorModel, DcMotor, DelayedPd, DriveCfg, DriveCfgError, DriveModel, DriveType, IdealPd, PerJoint};
pub use entities::Entities;
pub use error::{Error, Result};
pub use ids::{EnvId, MjcfId, ObjectId, RobotId, TerrainId};
pub use interactive_scene::{
    EntityCfg, EntityTypes, ExclusionCfg, InteractiveScene, SceneCfg, SensorEntity, SensorHandle,
};
pub(crate) use kinetoscope_scene::pattern;
pub use light_cfg::{LampKind, LightCfg};
pub use look::{BodyMotion, JointAxis, Look};
pub use manager::SimulationManager;
pub use mjcf::document::{Cone, Integrator};
pub use mjcf::error::EmitError;
pub use mjcf::part::PartError;
pub use mjcf::robot_file::RobotFileError;
pub use named::Named;
pub use objects::articulation::{Articulation, ArticulationCfg, ArticulationId, ArticulationMut};
pub use objects::kinematics::IkResult;
pub use objects::mesh_collision::MeshCollision;
pub use objects::mjcf_part::{MjcfPart, MjcfPartMut};
pub use objects::mjcf_part_data::{ActuatorIndex, MjcfCfg};
pub use objects::object_group::{RigidObjectGroup, RigidObjectGroupMut};
pub use objects::object_group_data::{GroupId, RigidObjectGroupCfg};
pub use objects::rigid_object::{RigidObject, RigidObjectMut};
pub use objects::rigid_object_data::{BodyType, RigidObjectCfg};
pub use objects::robot::{Robot, RobotCfg, RobotMut};
pub use objects::robot_data::JointIndex;
pub use objects::robot_file::MjcfFile;
pub use objects::robot_part::RobotPartMut;
pub use objects::shape::ObjectShape;
pub use objects::terrain::{Terrain, TerrainCfg};
pub use objects::weld::{Weld, WeldMut};
pub use objects::weld_data::{WeldCfg, WeldId};
pub use observer::{Moment, Observer, ObserverId, Observers, ObserversMut};
pub use randomization::{
    Draw, EnvProperties, EnvPropertiesMut, Properties, Property, Randomization, RandomizationError, Term,
};
pub use rollout::Rollout;
pub use scene_view::{SceneView, SceneViewMut};
pub use sensor_list::SensorId;
pub use shard::{Shard, ShardError};
pub use simulation_cfg::{GroundCfg, SimulationManagerCfg};
pub use snapshot::{Snapshot, SnapshotError};
pub use step_result::StepResult;
pub use surface_cfg::SurfaceCfg;
pub use viewpoint::Viewpoint;
pub use visible::{FreeCamera, MaskId, ModelCamera, Still, Visible};
pub use warnings::Warnings;
pub use wrenches::WrenchFrame;
