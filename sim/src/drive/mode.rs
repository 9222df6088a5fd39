//! The trait of drive modes.

/// Properties of a joint that a drive mode uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointInfo {
    /// Inertia that the joint feels at the initial pose, `1 / (M⁻¹)_ii` \[kg m² or kg\].
    pub effective_inertia: f64,
}

/// Proportional and derivative gain of an actuator in torque units \[N m/rad, N m s/rad\] or \[N/m, N s/m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorSpec {
    /// Proportional gain.
    pub kp: f64,
    /// Derivative gain.
    pub kd: f64,
}

/// How stiffness and damping become an actuator's gains: one file per mode.
pub trait DriveMode: std::fmt::Debug + Sync {
    /// Name in configuration files (EmbodiChain's words).
    fn name(&self) -> &'static str;

    /// The actuator of a joint, or `None` where the joint stays passive.
    fn actuator(&self, stiffness: f64, damping: f64, joint: &JointInfo) -> Option<ActuatorSpec>;
}
