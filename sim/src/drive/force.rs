//! Drive mode `force`: gains in torque (force) units.

use super::{DriveMode, JointInfo};

#[derive(Debug)]
pub(super) struct Force;

impl DriveMode for Force {
    fn name(&self) -> &'static str {
        "force"
    }

    fn gain_scale(&self, _joint: &JointInfo) -> Option<f64> {
        Some(1.0)
    }
}
