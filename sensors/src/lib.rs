//! Sensors of a robot simulation, independent of the physics engine.
//!
//! A configuration ([`SensorCfg`]) states the fields of the simulation state that a sensor needs
//! ([`kinetoscope_scene::StateFields`]) and builds the sensor ([`Sensor`]). The sensor reads each
//! [`kinetoscope_scene::SceneState`] and writes its measurements to its own buffers, with the environment as first
//! axis. Numeric sensors share a [`Sampler`]: rate, history, latency, dropout and noise.
//!
//! | module | contents |
//! |---|---|
//! | [`camera`] | cameras: calibration, imperfections, segmentation, bounding boxes, stereo |
//! | [`ray`] | ray casters, ray patterns and ray-caster cameras |
//! | `contact_sensor`, `imu`, `joint_state`, `joint_wrench`, `actuator_state`, `frame_transformer` | numeric sensors |
//! | `mujoco_sensor` | sensors that the physics engine evaluates itself |
//! | `sensor`, `slot` | the traits of all sensors; owner of a lazy or eager sensor |
//! | `sampling`, `schedule`, `history`, `delay`, `noise` | the sampler and its parts |
//!
//! A new numeric sensor needs one new file and one line of the macro call `numeric_sensors!` in `lib.rs`;
//! `actuator_state` is the shortest example. A joint state sensor without a simulation:
//!
//! ```
//! use kinetoscope_scene::SceneState;
//! use kinetoscope_sensors::{JointStateCfg, SamplingCfg, Sensor, SensorCfg, SensorContext};
//! use ndarray::array;
//!
//! let joints = ["arm/elbow".to_string()];
//! let context = SensorContext { num_envs: 1, dt: 0.005, joints: joints.into(), ..SensorContext::default() };
//! let cfg = JointStateCfg { sampling: SamplingCfg::every(0.02), ..JointStateCfg::default() };
//! let mut sensor = cfg.build(&context)?;
//! let state = SceneState {
//!     joint_positions: Some(array![[0.5]]),
//!     joint_velocities: Some(array![[0.0]]),
//!     joint_efforts: Some(array![[1.5]]),
//!     ..SceneState::new(1)
//! };
//! sensor.reset(&[0], &state)?;
//! assert_eq!(sensor.positions(), array![[0.5]]);
//! # Ok::<(), kinetoscope_sensors::SensorError>(())
//! ```

// This attribute rules out ndarray's `s![]`, which expands to an `allow`: slice with `index_axis`, `split_at` and
// `slice_axis`.
#![forbid(unsafe_code)]

mod body_state;
mod cached;
pub mod camera;
mod delay;
mod error;
mod history;
mod noise;
pub mod ray;
mod sampling;
mod schedule;
mod select;
mod sensor;
mod slot;
mod state_requirements;
mod summary;

pub use error::SensorError;
pub use history::History;
pub use noise::NoiseCfg;
pub use sampling::{SampleChannel, Sampled, Sampler, SamplingCfg, Stamp};
pub use schedule::{Phases, Schedule};
pub use sensor::{EngineSensor, Sensor, SensorCfg, SensorContext};
pub use slot::SensorSlot;
pub use state_requirements::StateRequirements;

use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Debug;

/// Declares the numeric sensors: their modules, their public types and their names in scene files.
macro_rules! numeric_sensors {
    ($($name:literal => $module:ident :: { $Cfg:ident, $($item:ident),+ },)*) => {
        $(
            mod $module;
            pub use $module::{$Cfg, $($item),+};
        )*

        /// Visits the configurations of all built-in sensors, with their names in scene files.
        pub fn visit_sensor_types(visitor: &mut impl SensorTypeVisitor) {
            visitor.visit::<camera::CameraCfg>("camera");
            visitor.visit::<camera::StereoCameraCfg>("stereo_camera");
            visitor.visit::<ray::RayCasterCfg>("ray_caster");
            visitor.visit::<ray::RayCasterCameraCfg>("ray_caster_camera");
            $(visitor.visit::<$Cfg>($name);)*
        }
    };
}

numeric_sensors! {
    "contact_sensor" => contact_sensor::{ContactSensorCfg, ContactSensor},
    "imu" => imu::{ImuCfg, Imu},
    "frame_transformer" => frame_transformer::{FrameTransformerCfg, FrameTransformer, TargetFrameCfg},
    "joint_state" => joint_state::{JointStateCfg, JointState},
    "actuator_state" => actuator_state::{ActuatorStateCfg, ActuatorState},
    "joint_wrench" => joint_wrench::{JointWrenchCfg, JointWrench},
    "mujoco_sensor" => mujoco_sensor::{MujocoSensorCfg, MujocoSensor},
}

/// Callback of [`visit_sensor_types`], which receives the configuration type of each built-in sensor.
pub trait SensorTypeVisitor {
    /// Receives one configuration type, with its name in scene files.
    fn visit<C>(&mut self, name: &'static str)
    where
        C: SensorCfg + Clone + Debug + Send + Sync + Serialize + DeserializeOwned + 'static;
}
