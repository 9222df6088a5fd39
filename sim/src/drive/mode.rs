//! Trait of drive modes.

/// Properties of a joint that a drive mode uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointInfo {
    /// Inertia that the joint feels at the initial joint positions, `1 / (M⁻¹)_ii` \[kg m² or kg\]. May be NaN unless
    /// [`DriveMode::needs_inertia`] is true.
    pub effective_inertia: f64,
}

/// Proportional and derivative gains of an actuator in torque units \[N m/rad, N m s/rad\] or \[N/m, N s/m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PdGains {
    /// Proportional gain.
    pub kp: f64,
    /// Derivative gain.
    pub kd: f64,
}

/// Meaning of stiffness and damping; one file per mode.
pub trait DriveMode: std::fmt::Debug + Sync {
    /// Name in configuration files, as in EmbodiChain.
    fn name(&self) -> &'static str;

    /// Factor that converts stiffness and damping to the torque units of [`PdGains`]; `None` for the drive type without
    /// a drive.
    fn gain_scale(&self, joint: &JointInfo) -> Option<f64>;

    /// True if [`gain_scale`](Self::gain_scale) uses [`JointInfo::effective_inertia`]. For other modes, this inertia
    /// may be NaN.
    fn needs_inertia(&self) -> bool {
        false
    }
}
