//! Drive mode `none`: a passive joint.

use super::{DriveMode, JointInfo};

#[derive(Debug)]
pub(super) struct None;

impl DriveMode for None {
    fn name(&self) -> &'static str {
        "none"
    }

    fn unit(&self, _joint: &JointInfo) -> Option<f64> {
        Option::None
    }
}
