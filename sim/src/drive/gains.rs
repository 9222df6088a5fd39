//! Gains, settings and targets of drives.

use super::{DriveType, JointInfo, PdGains};

/// Drive type, stiffness and damping of one drive in the unit of the drive type; [`Gains`] has the values that the
/// drive law uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveSetting {
    /// Meaning of stiffness and damping.
    pub drive_type: DriveType,
    /// Stiffness, in the unit of the drive type.
    pub stiffness: f64,
    /// Damping, in the unit of the drive type.
    pub damping: f64,
    /// Inertia that the joint feels at the initial joint positions \[kg m² or kg\]; `None` until a drive type needs it.
    pub inertia: Option<f64>,
}

impl DriveSetting {
    /// Factor from stiffness and damping to torque units; `None` for [`DriveType::None`]. NaN if the drive type needs
    /// an inertia and `inertia` is `None`.
    pub fn gain_scale(&self) -> Option<f64> {
        self.drive_type.mode().gain_scale(&JointInfo { effective_inertia: self.inertia.unwrap_or(f64::NAN) })
    }

    /// Gains in torque units; `None` for [`DriveType::None`].
    pub fn torque_gains(&self) -> Option<PdGains> {
        self.gain_scale().map(|unit| PdGains { kp: self.stiffness * unit, kd: self.damping * unit })
    }
}

/// Gains in torque units, and limits, of one drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Proportional gain \[N m/rad or N/m\].
    pub kp: f64,
    /// Derivative gain \[N m s/rad or N s/m\].
    pub kd: f64,
    /// Effort limit \[N m or N\]; infinite without a limit.
    pub max_effort: f64,
    /// Velocity limit \[rad/s or m/s\]; infinite without a limit. Only [`DcMotor`](super::DcMotor) uses it; other
    /// drives do not enforce it.
    pub max_velocity: f64,
}

/// The targets of one drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Position target \[rad or m\].
    pub position: f64,
    /// Velocity target \[rad/s or m/s\].
    pub velocity: f64,
    /// Feedforward effort, added to the PD effort before the clamp \[N m or N\].
    pub feedforward: f64,
}
