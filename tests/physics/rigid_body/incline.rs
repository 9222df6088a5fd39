//! Descent on a slope, modeled as a plane with tilted gravity, which is equivalent and needs no second shape.

use crate::lab::*;

/// Mean accelerations of a link \[m/s²\].
#[derive(Clone, Copy, Debug)]
pub(super) struct Descent {
    /// Down the slope.
    pub(super) along: f64,
    /// Perpendicular to the slope, because bodies that slide on soft contacts hop.
    pub(super) across: f64,
}

/// Start and end of the averaging, after a start at rest \[s\].
pub(super) const FROM: f64 = 0.5;
pub(super) const UNTIL: f64 = 1.5;

/// Mean accelerations of a link that starts at rest in `pose`, from [`FROM`] to [`UNTIL`].
pub(super) fn descent(cfg: SimulationManagerCfg, link: Link, pose: Pose) -> Descent {
    let mut lab = Lab::new(cfg);
    let cfg = RobotCfg { drive: passive(), fix_base: false, init_pose: pose, ..RobotCfg::default() };
    let robot = lab.robot(&urdf(&[link], &[]), cfg);
    lab.run(FROM);
    let before = lab.root(robot).velocity;
    lab.run(UNTIL - FROM);
    let gained = (lab.root(robot).velocity - before) / (UNTIL - FROM);
    Descent { along: gained.x, across: gained.z }
}

/// Mean acceleration down the slope, averaged as in [`descent`] \[m/s²\].
pub(super) fn acceleration(cfg: SimulationManagerCfg, link: Link, pose: Pose) -> f64 {
    descent(cfg, link, pose).along
}
