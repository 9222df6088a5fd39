//! Drive mode `none`: a passive joint.

use super::{ActuatorSpec, DriveMode, JointInfo};

#[derive(Debug)]
pub(super) struct None;

impl DriveMode for None {
    fn name(&self) -> &'static str {
        "none"
    }

    fn actuator(&self, _stiffness: f64, _damping: f64, _joint: &JointInfo) -> Option<ActuatorSpec> {
        Option::None
    }
}
