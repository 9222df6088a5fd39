//! Movements of an arm and a hand: planned by inverse kinematics, played as position targets in all environments.

use super::{MainLoop, Result, trial};
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::robot::kinematics::{IkCfg, TipFrame};

/// Distance between the inverse-kinematics waypoints of a straight line \[m\].
const WAYPOINT_SPACING: f64 = 0.02;
/// Largest joint change between two waypoints of a line \[rad\]. A larger one means that the joints leave the line.
const MAX_JOINT_JUMP: f64 = 0.5;

/// Moves one robot in all environments at once, through its drives only: nothing is written into the state.
#[derive(Debug)]
pub(crate) struct MotionPlayer<'a> {
    pub(crate) sim: &'a mut SimulationManager,
    robot: RobotId,
    tip: TipFrame<'a>,
    arm: Vec<JointIndex>,
    progress: &'a MainLoop,
    step: u64,
    reachable: Vec<bool>,
}

impl<'a> MotionPlayer<'a> {
    /// Creates a motion player of the frame `tip`, moved by the joints of the control part `arm`.
    ///
    /// # Errors
    /// The robot has no such control part.
    pub(crate) fn new(
        sim: &'a mut SimulationManager,
        robot: RobotId,
        arm: &str,
        tip: TipFrame<'a>,
        progress: &'a MainLoop,
    ) -> Result<Self> {
        let (arm, reachable) = (sim.robot(robot).joint_ids(arm)?, vec![true; sim.num_envs()]);
        Ok(Self { sim, robot, tip, arm, progress, step: 0, reachable })
    }

    /// Steps so far.
    pub(crate) fn step(&self) -> u64 {
        self.step
    }

    /// True for each environment in which every pose so far was reachable, and every line without a jump of the joints.
    pub(crate) fn planned(&self) -> &[bool] {
        &self.reachable
    }

    /// Moves the tip to one pose per environment along a joint-space interpolation.
    pub(crate) fn move_joint_space(&mut self, poses: &[Pose], seconds: f64) -> Result {
        let start = self.targets(&self.arm);
        let end = self.solve(poses, &start, f64::INFINITY)?;
        self.play(&self.arm.clone(), &[start, end], seconds, |_| ())
    }

    /// Moves the tip to one pose per environment on a straight line, starting at its pose for the current targets.
    pub(crate) fn move_linear(&mut self, poses: &[Pose], seconds: f64) -> Result {
        let start = self.targets(&self.arm);
        let from = trial::poses(&self.sim.robot(self.robot).compute_fk(&start, self.tip, None)?);
        let length = from.iter().zip(poses).map(|(a, b)| (a.translation.vector - b.translation.vector).norm());
        let points = (length.fold(0.0, f64::max) / WAYPOINT_SPACING).ceil().max(1.0) as usize;
        let mut waypoints = vec![start];
        for k in 1..=points {
            let fraction = k as f64 / points as f64;
            let between: Vec<Pose> = from.iter().zip(poses).map(|(a, b)| a.lerp_slerp(b, fraction)).collect();
            waypoints.push(self.solve(&between, &waypoints[k - 1], MAX_JOINT_JUMP)?);
        }
        self.play(&self.arm.clone(), &waypoints, seconds, |_| ())
    }

    /// Moves joints to positions \[rad or m\] by name, the same in every environment.
    pub(crate) fn move_joints(&mut self, positions: &[(&str, f64)], seconds: f64) -> Result {
        let robot = self.sim.robot(self.robot);
        let joints =
            positions.iter().map(|(name, _)| robot.joint_id(name)).collect::<std::result::Result<Vec<_>, _>>()?;
        let start = self.targets(&joints);
        let end = Array2::from_shape_fn(start.dim(), |(_, k)| positions[k].1);
        self.play(&joints, &[start, end], seconds, |_| ())
    }

    /// Holds the targets and calls `watch` after every step.
    pub(crate) fn wait(&mut self, seconds: f64, watch: impl FnMut(&SimulationManager)) -> Result {
        self.play(&[], &[], seconds, watch)
    }

    fn targets(&self, joints: &[JointIndex]) -> Array2<f64> {
        let columns: Vec<usize> = joints.iter().map(|joint| joint.0).collect();
        self.sim.robot(self.robot).qpos_target().select(Axis(1), &columns)
    }

    /// Inverse-kinematics solutions for poses, started from the joint positions `near`. A joint that moves by more than
    /// `leap` \[rad\] counts as no solution. After a pose without a solution, an environment keeps its positions for
    /// the rest of the run.
    fn solve(&mut self, poses: &[Pose], near: &Array2<f64>, leap: f64) -> Result<Array2<f64>> {
        let found =
            self.sim.robot(self.robot).compute_ik(poses, self.tip, &IkCfg::default(), Some(near.view()), None)?;
        let mut positions = near.clone();
        for (env, planned) in self.reachable.iter_mut().enumerate() {
            let moved = (&found.qpos.row(env) - &near.row(env)).iter().fold(0.0, |most: f64, d| most.max(d.abs()));
            *planned &= found.success[env] && moved <= leap;
            if *planned {
                positions.row_mut(env).assign(&found.qpos.row(env));
            }
        }
        Ok(positions)
    }

    /// Sets the targets of `joints` along waypoints, with a smooth start and end, and calls `watch` after every step.
    /// Ends early if the example should stop.
    fn play(
        &mut self,
        joints: &[JointIndex],
        way: &[Array2<f64>],
        seconds: f64,
        mut watch: impl FnMut(&SimulationManager),
    ) -> Result {
        let steps = (seconds / self.sim.cfg().physics_dt).round() as u64;
        for k in 1..=steps {
            if self.progress.should_stop(self.step) {
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
