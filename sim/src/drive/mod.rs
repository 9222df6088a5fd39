//! Joint drives: from drive properties to an actuator, and from the actuator to torque.
//!
//! The law of every drive, with position, velocity and effort targets `q*`, `v*`, `tau_ff`:
//!
//! ```text
//! tau = clamp(kp (q* - q) + kd (v* - v) + tau_ff, -max_effort, +max_effort)
//! ```
//!
//! * [`DriveMode`] defines the meaning of stiffness and damping (`force.rs`, `acceleration.rs`, `none.rs`, listed once
//!   below).
//! * [`DriveModel`] selects the evaluation of the law: [`implicit`] (a constraint row, at the end of the step, any
//!   gains) or MuJoCo's own actuator ([`actuator`], gains within its domain of stability).
//! * [`models`] has explicit laws of real motors for selected joints: speed-dependent limits, delays.

mod acceleration;
mod cfg;
mod force;
mod gain_overrides;
mod mode;
mod none;

pub mod actuator;
pub mod gains;
pub mod implicit;
pub mod models;
pub mod plan;
pub mod table;

pub use cfg::{DriveCfg, DriveCfgError, JointGains, PerJoint, resolve};
pub use mode::{DriveMode, JointInfo, PdGains};
pub use models::{ActuatorModel, DcMotor, DelayedPd, IdealPd};

use kinetoscope_scene::pattern::{UnknownName, closest_names};
use serde::{Deserialize, Serialize};

/// List of drive modes: `Variant => the mode`.
macro_rules! drive_modes {
    ($($(#[$doc:meta])* $variant:ident => $mode:expr,)*) => {
        /// The meaning of stiffness and damping.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        #[non_exhaustive]
        pub enum DriveType {
            $($(#[$doc])* $variant,)*
        }

        impl DriveType {
            /// All drive types.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// Implementation of the drive mode.
            pub fn mode(self) -> &'static dyn DriveMode {
                match self {
                    $(Self::$variant => &$mode,)*
                }
            }
        }
    };
}

drive_modes! {
    /// Stiffness in N m/rad or N/m, damping in N m s/rad or N s/m.
    #[default]
    Force => force::Force,
    /// Stiffness in 1/s², damping in 1/s. The drive multiplies both by the inertia that the joint feels at the initial
    /// joint positions.
    Acceleration => acceleration::Acceleration,
    /// No drive: no stiffness and damping act. Efforts of [`RobotMut::set_qf_target`](crate::RobotMut::set_qf_target)
    /// and the joint's own friction, damping and limits remain.
    None => none::Passive,
}

impl std::str::FromStr for DriveType {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        Self::ALL.iter().copied().find(|known| known.mode().name() == name).ok_or_else(|| {
            let known = Self::ALL.iter().map(|known| known.mode().name());
            let candidates = closest_names(name, known).into_iter().map(String::from).collect();
            UnknownName { what: "drive type", name: name.into(), candidates }
        })
    }
}

/// Evaluation of the drive law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DriveModel {
    /// A friction-type constraint row, solved together with contacts at the end of the step: stable for any gains and
    /// exact at the effort limit. Integrators: Euler, and implicitfast on MuJoCo 4.x.
    #[default]
    Implicit,
    /// MuJoCo's own actuator: explicit, with every integrator.
    /// [`add_robot`](crate::SimulationManager::add_robot) warns if the time step is too long for stability.
    Actuator,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_modes() {
        for mode in DriveType::ALL {
            assert_eq!(mode.mode().name().parse(), Ok(*mode));
        }
        assert!("froce".parse::<DriveType>().unwrap_err().candidates.contains(&"force".into()));
    }
}
