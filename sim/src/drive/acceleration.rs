//! Drive mode `acceleration`: gains in acceleration units, so that one set of gains moves light and heavy joints alike.

use super::{ActuatorSpec, DriveMode, JointInfo};

#[derive(Debug)]
pub(super) struct Acceleration;

impl DriveMode for Acceleration {
    fn name(&self) -> &'static str {
        "acceleration"
    }

    /// tau = I (k (q* - q) + d (v* - v)), with I the inertia the joint feels at the initial pose.
    fn actuator(&self, stiffness: f64, damping: f64, joint: &JointInfo) -> Option<ActuatorSpec> {
        Some(ActuatorSpec { kp: stiffness * joint.effective_inertia, kd: damping * joint.effective_inertia })
    }
}
