//! Physics on another device: MuJoCo Warp on a GPU, behind the same scenes, drives, sensors and snapshots.
//!
//! The environments keep their rows on the CPU. Before a step, the [`DeviceMirror`] sends the device what changed in
//! them: states, targets, gains, applied forces, properties. Before rows are read again, it writes the new states to
//! them, so everything that reads rows works as before: sensors, cameras, kinematics, recordings, views. Forces of
//! contacts, accelerations and joint wrenches come from the solution on the device.
//!
//! ```text
//! rows -> DeviceMirror -> DevicePhysics (worker process, or a Python object in process) -> DeviceMirror -> rows
//! ```

mod captured;
mod inputs;
mod mirror;
mod model_writes;
mod scene;
#[cfg(test)]
mod tests;
mod worker;

pub(crate) use inputs::{Changes, SentRows};
pub(crate) use mirror::{ChunkRows, DeviceMirror, EnvRows};
pub(crate) use scene::DeviceScene;

use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::OnceLock;

/// Device of the physics.
///
/// Everything except [`Cpu`](Self::Cpu) is experimental: it computes in single precision with MuJoCo Warp, and does not
/// promise the same bits as the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Device {
    /// MuJoCo on the CPU.
    #[default]
    Cpu,
    /// MuJoCo Warp on the NVIDIA GPU with this number.
    Cuda(u32),
    /// MuJoCo Warp on the CPU: the kernels of the GPU without one, for tests.
    WarpCpu,
}

impl std::fmt::Display for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Cpu => f.write_str("cpu"),
            Self::Cuda(number) => write!(f, "cuda:{number}"),
            Self::WarpCpu => f.write_str("warp-cpu"),
        }
    }
}

impl From<Device> for String {
    fn from(device: Device) -> Self {
        device.to_string()
    }
}

/// Error of [`Device`]'s parser.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not a device of the physics: use cpu, cuda, cuda:N with the number of a GPU, or warp-cpu")]
pub struct UnknownDevice(String);

impl std::str::FromStr for Device {
    type Err = UnknownDevice;

    fn from_str(text: &str) -> Result<Self, UnknownDevice> {
        match text {
            "cpu" => Ok(Self::Cpu),
            "cuda" => Ok(Self::Cuda(0)),
            "warp-cpu" => Ok(Self::WarpCpu),
            _ => {
                let number = text.strip_prefix("cuda:").and_then(|number| number.parse().ok());
                number.map(Self::Cuda).ok_or_else(|| UnknownDevice(text.into()))
            }
        }
    }
}

impl TryFrom<String> for Device {
    type Error = UnknownDevice;

    fn try_from(text: String) -> Result<Self, UnknownDevice> {
        text.parse()
    }
}

/// Error of the physics on a device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// The device or its software is not available; the message names the repair.
    #[error("device {device}: {message}")]
    Unavailable {
        /// The device.
        device: Device,
        /// Reason and repair.
        message: String,
    },
    /// The device cannot simulate something in the scene.
    #[error("the device cannot simulate {what}: {expected}")]
    Unsupported {
        /// Element of the scene.
        what: String,
        /// Supported alternative.
        expected: String,
    },
    /// The physics on the device failed.
    #[error("the physics on the device failed: {0}")]
    Failed(String),
}

/// Physics of all environments on a device. Arrays are single precision, one row per environment.
pub trait DevicePhysics: Send + std::fmt::Debug {
    /// Loads a scene for `num_envs` environments and replaces the scene before. `folder` has `scene.xml` and the files
    /// that it names; `scene` is a JSON object with the drives, and with numbers of the compiled model.
    ///
    /// # Errors
    /// The device cannot simulate the scene, or failed.
    fn load(&mut self, folder: &Path, scene: &str, num_envs: usize) -> Result<(), DeviceError>;

    /// Writes the rows of `envs` in an array: `values` has one row for each of them.
    ///
    /// # Errors
    /// The device failed.
    fn write(&mut self, array: &str, envs: &[i32], values: &[f32]) -> Result<(), DeviceError>;

    /// Steps all environments, and captures `capture` (`contacts`, `motion`, `wrenches`) in the last step. Returns a
    /// report as JSON: `diverged`, a list of environment, step in the call and reason; `grown`, a list of constraint rows and
    /// contacts per environment that buffers grew to.
    ///
    /// # Errors
    /// The device failed.
    fn step(&mut self, steps: u32, capture: &[&str]) -> Result<String, DeviceError>;

    /// Returns an array of all environments.
    ///
    /// # Errors
    /// The device failed.
    fn read(&mut self, array: &str) -> Result<Vec<f32>, DeviceError>;

    /// This object, for code that knows its type.
    fn as_any(&self) -> &dyn std::any::Any;
}

/// Report on a step of the device.
#[derive(Debug, Deserialize)]
pub(crate) struct StepReport {
    /// Environment, step in the call, and reason of each divergence.
    diverged: Vec<(usize, u64, String)>,
    /// Sizes that buffers grew to: constraint rows and contacts per environment.
    grown: Vec<[u64; 2]>,
}

/// Function that opens the physics of a device.
pub type DeviceOpener = fn(Device) -> Result<Box<dyn DevicePhysics>, DeviceError>;

static OPENER: OnceLock<DeviceOpener> = OnceLock::new();

/// Makes simulations of this process open the physics of devices with `opener`, in place of a worker process. The first
/// call counts.
pub fn set_device_opener(opener: DeviceOpener) {
    let _ = OPENER.set(opener);
}

/// Opens the physics of a device; `None` for the CPU.
pub(crate) fn open(device: Device) -> Result<Option<Box<dyn DevicePhysics>>, DeviceError> {
    match (device, OPENER.get()) {
        (Device::Cpu, _) => Ok(None),
        (device, Some(opener)) => opener(device).map(Some),
        (device, None) => Ok(Some(Box::new(worker::Worker::start(device)?))),
    }
}
