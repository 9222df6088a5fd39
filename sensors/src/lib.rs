//! Sensors that have never heard of MuJoCo.
//!
//! One contract for all of them: a configuration ([`SensorCfg`]) says what it needs to see ([`kinetoscope_scene::Requires`]) and builds a
//! sensor ([`Sensor`]), which turns each [`kinetoscope_scene::SceneState`] into buffers of its own. Sensors of numbers share a
//! [`Sampler`]: rate, history, latency, lost samples and noise. A new sensor is one new file; `joint_state` is the
//! shortest example.
//!
//! Unsafe code is forbidden, which rules out ndarray's `s![]` (it expands to an `allow`): slice with `index_axis`,
//! `split_at` and `slice_axis`.
#![forbid(unsafe_code)]

mod actuator_state;
mod cached;
pub mod camera;
mod contact_sensor;
mod delay;
mod error;
mod expected;
mod frame_transformer;
mod frames;
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
mod summary;

pub use actuator_state::{ActuatorState, ActuatorStateCfg};
pub use contact_sensor::{ContactSensor, ContactSensorCfg};
pub use error::SensorError;
pub use expected::Expected;
pub use frame_transformer::{FrameTransformer, FrameTransformerCfg, TargetFrameCfg};
pub use history::History;
pub use imu::{Imu, ImuCfg};
pub use joint_state::{JointState, JointStateCfg};
pub use joint_wrench::{JointWrench, JointWrenchCfg};
pub use mujoco_sensor::{MujocoSensor, MujocoSensorCfg};
pub use noise::NoiseCfg;
pub use sampling::{Channel, Sampled, Sampler, SamplingCfg, Stamp};
pub use schedule::{Phases, Schedule};
pub use sensor::{EngineSensor, Sensor, SensorCfg, SensorContext};
pub use slot::SensorSlot;
