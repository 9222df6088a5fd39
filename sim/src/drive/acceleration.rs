//! Drive mode `acceleration`: gains in acceleration units, so that one set of gains suits light and heavy joints alike.

use super::{DriveMode, JointInfo};

#[derive(Debug)]
pub(super) struct Acceleration;

impl DriveMode for Acceleration {
    fn name(&self) -> &'static str {
        "acceleration"
    }

    /// Returns the effective inertia I of the joint at the initial joint positions \[kg m² or kg\], never `None`: tau =
    /// I (k (q* - q) + d (v* - v)).
    fn gain_scale(&self, joint: &JointInfo) -> Option<f64> {
        Some(joint.effective_inertia)
    }

    fn needs_inertia(&self) -> bool {
        true
    }
}
