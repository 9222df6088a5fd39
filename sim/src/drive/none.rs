//! Drive mode `none`: a passive joint.

use super::{DriveMode, JointInfo};

#[derive(Debug)]
pub(super) struct Passive;

impl DriveMode for Passive {
    fn name(&self) -> &'static str {
        "none"
    }

    fn gain_scale(&self, _joint: &JointInfo) -> Option<f64> {
        Option::None
    }
}
