//! Drive mode `force`: gains in torque (force) units.

use super::{ActuatorSpec, DriveMode, JointInfo};

#[derive(Debug)]
pub(super) struct Force;

impl DriveMode for Force {
    fn name(&self) -> &'static str {
        "force"
    }

    fn actuator(&self, stiffness: f64, damping: f64, _joint: &JointInfo) -> Option<ActuatorSpec> {
        Some(ActuatorSpec { kp: stiffness, kd: damping })
    }
}
