//! Movements of an arm and a hand: planned by inverse kinematics, played as position targets in all environments.

use super::{Progress, Result, trial};
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::robot::kinematics::{IkCfg, Tip};

/// Distance of points on a straight line that inverse kinematics are solved for \[m\].
const SPACING: f64 = 0.02;
/// Joints that turn further than this between two points of a line do not follow it \[rad\].
const LEAP: f64 = 0.5;

/// Moves one robot in all environments at once. Whatever moves does so through its drives: nothing is written into the
/// state.
#[derive(Debug)]
pub(crate) struct Motion<'a> {
    pub(crate) sim: &'a mut SimulationManager,
    robot: RobotId,
    tip: Tip<'a>,
    arm: Vec<JointIndex>,
    progress: &'a Progress,
    step: u64,
    planned: Vec<bool>,
}

impl<'a> Motion<'a> {
    /// Movements of the frame `tip`, by the joints of the control part `arm`.
    ///
    /// # Errors
    /// There is no such part.
    pub(crate) fn new(
        sim: &'a mut SimulationManager,
        robot: RobotId,
        arm: &str,
        tip: Tip<'a>,
        progress: &'a Progress,
    ) -> Result<Self> {
        let (arm, planned) = (sim.robot(robot).joint_ids(arm)?, vec![true; sim.num_envs()]);
        Ok(Self { sim, robot, tip, arm, progress, step: 0, planned })
    }

    /// Steps so far.
    pub(crate) fn step(&self) -> u64 {
        self.step
    }

    /// For each environment, whether every pose so far could be reached by the plan.
    pub(crate) fn planned(&self) -> &[bool] {
        &self.planned
    }

    /// Goes to one pose per environment, on whatever way that the joints take.
    pub(crate) fn reach(&mut self, poses: &[Pose], seconds: f64) -> Result {
        let start = self.targets(&self.arm);
        let end = self.solve(poses, &start, f64::INFINITY)?;
        self.play(&self.arm.clone(), &[start, end], seconds, |_| ())
    }

    /// Goes to one pose per environment on a straight line from where the targets put the frame now.
    pub(crate) fn line(&mut self, poses: &[Pose], seconds: f64) -> Result {
        let start = self.targets(&self.arm);
        let from = trial::poses(&self.sim.robot(self.robot).compute_fk(&start, self.tip, None)?);
        let length = from.iter().zip(poses).map(|(a, b)| (a.translation.vector - b.translation.vector).norm());
        let points = (length.fold(0.0, f64::max) / SPACING).ceil().max(1.0) as usize;
        let mut way = vec![start];
        for k in 1..=points {
            let part = k as f64 / points as f64;
            let between: Vec<Pose> = from.iter().zip(poses).map(|(a, b)| a.lerp_slerp(b, part)).collect();
            way.push(self.solve(&between, &way[k - 1], LEAP)?);
        }
        self.play(&self.arm.clone(), &way, seconds, |_| ())
    }

    /// Moves joints to positions, the same in every environment.
    pub(crate) fn joints(&mut self, positions: &[(&str, f64)], seconds: f64) -> Result {
        let robot = self.sim.robot(self.robot);
        let joints =
            positions.iter().map(|(name, _)| robot.joint_id(name)).collect::<std::result::Result<Vec<_>, _>>()?;
        let start = self.targets(&joints);
        let end = Array2::from_shape_fn(start.dim(), |(_, k)| positions[k].1);
        self.play(&joints, &[start, end], seconds, |_| ())
    }

    /// Stays; `watch` looks at every step.
    pub(crate) fn wait(&mut self, seconds: f64, watch: impl FnMut(&SimulationManager)) -> Result {
        self.play(&[], &[], seconds, watch)
    }

    fn targets(&self, joints: &[JointIndex]) -> Array2<f64> {
        let columns: Vec<usize> = joints.iter().map(|joint| joint.0).collect();
        self.sim.robot(self.robot).qpos_target().select(Axis(1), &columns)
    }

    /// Joint positions for poses, from positions near them; an environment without a solution stays where it is.
    fn solve(&mut self, poses: &[Pose], near: &Array2<f64>, leap: f64) -> Result<Array2<f64>> {
        let found =
            self.sim.robot(self.robot).compute_ik(poses, self.tip, &IkCfg::default(), Some(near.view()), None)?;
        let mut positions = near.clone();
        for (env, planned) in self.planned.iter_mut().enumerate() {
            let moved = (&found.qpos.row(env) - &near.row(env)).iter().fold(0.0, |most: f64, d| most.max(d.abs()));
            *planned &= found.success[env] && moved <= leap;
            if *planned {
                positions.row_mut(env).assign(&found.qpos.row(env));
            }
        }
        Ok(positions)
    }

    /// Plays points of a way in even times, starting and ending gently.
    fn play(
        &mut self,
        joints: &[JointIndex],
        way: &[Array2<f64>],
        seconds: f64,
        mut watch: impl FnMut(&SimulationManager),
    ) -> Result {
        let steps = (seconds / self.sim.cfg().physics_dt).round() as u64;
        for k in 1..=steps {
            if self.progress.stop(self.step) {
                return Ok(());
            }
            if let Some(last) = way.len().checked_sub(2) {
                let time = k as f64 / steps as f64;
                let along = time * time * (3.0 - 2.0 * time) * (last + 1) as f64;
                let point = (along as usize).min(last);
                let part = along - point as f64;
                let target = &way[point] * (1.0 - part) + &way[point + 1] * part;
                self.sim.robot_mut(self.robot).set_qpos_target(&target, Some(joints), None)?;
            }
            self.sim.update(1);
            self.step += 1;
            self.progress.advance(self.step);
            watch(self.sim);
        }
        Ok(())
    }
}
