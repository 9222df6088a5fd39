//! What goes down a slope: a plane that gravity is tilted against, which is the same and needs no second shape.

use crate::lab::*;

/// Mean accelerations of a link \[m/s²\].
#[derive(Clone, Copy, Debug)]
pub(super) struct Descent {
    /// Down the slope.
    pub(super) along: f64,
    /// Away from it: soft contacts let what slides hop.
    pub(super) across: f64,
}

/// When the means begin and end, after a start at rest \[s\].
pub(super) const FROM: f64 = 0.5;
pub(super) const UNTIL: f64 = 1.5;

/// What a link does that starts in `pose` at rest: means from [`FROM`] to [`UNTIL`].
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

/// Mean acceleration down the slope, as [`descent`] has it \[m/s²\].
pub(super) fn acceleration(cfg: SimulationManagerCfg, link: Link, pose: Pose) -> f64 {
    descent(cfg, link, pose).along
}
