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
//! A new sensor is one new file; `actuator_state` is the shortest example. The parts of a sensor, for the joint state:
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
//!
//! Unsafe code is forbidden, which rules out ndarray's `s![]` (it expands to an `allow`): slice with `index_axis`,
//! `split_at` and `slice_axis`.
#![forbid(unsafe_code)]

mod actuator_state;
mod body_state;
mod cached;
pub mod camera;
mod contact_sensor;
mod delay;
mod error;
mod frame_transformer;
mod history;
mod imu;
mod joint_state;
mod joint_wrench;
mod mujoco_sensor;
mod noise;
pub mod ray;
mod sampling;
mod schedule;
mod select;
mod sensor;
mod slot;
mod state_requirements;
mod summary;

pub use actuator_state::{ActuatorState, ActuatorStateCfg};
pub use contact_sensor::{ContactSensor, ContactSensorCfg};
pub use error::SensorError;
pub use frame_transformer::{FrameTransformer, FrameTransformerCfg, TargetFrameCfg};
pub use history::History;
pub use imu::{Imu, ImuCfg};
pub use joint_state::{JointState, JointStateCfg};
pub use joint_wrench::{JointWrench, JointWrenchCfg};
pub use mujoco_sensor::{MujocoSensor, MujocoSensorCfg};
pub use noise::NoiseCfg;
pub use sampling::{SampleChannel, Sampled, Sampler, SamplingCfg, Stamp};
pub use schedule::{Phases, Schedule};
pub use sensor::{EngineSensor, Sensor, SensorCfg, SensorContext};
pub use slot::SensorSlot;
pub use state_requirements::StateRequirements;
