//! What goes down a slope: a plane that gravity is tilted against, which is the same and needs no second shape.

use crate::lab::*;
use crate::urdf::{Link, urdf};
use kinetoscope::prelude::*;

/// Mean acceleration down the slope from 0.5 s to 1.5 s \[m/s²\] of a link that starts at `height` above the plane, at rest.
pub(super) fn acceleration(cfg: SimulationManagerCfg, link: Link, pose: Pose) -> f64 {
    let mut lab = Lab::new(cfg);
    let cfg = RobotCfg { drive: passive(), fix_base: false, init_pose: pose, ..RobotCfg::default() };
    let robot = lab.robot(&urdf(&[link], &[]), cfg);
    lab.run(0.5);
    let before = lab.root(robot).velocity.x;
    lab.run(1.0);
    lab.root(robot).velocity.x - before
}
