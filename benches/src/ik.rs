//! Inverse kinematics: arm poses at random joint positions, solved one after the other on one core from the default
//! positions.
//!
//! The baseline is a solver on bare MuJoCo: damped least squares on `mj_jac` with constant damping, positions clamped
//! at the limits, and the same number of restarts. MuJoCo verifies the solutions of both. A second comparison solves
//! one pose for each of 64 environments in one call.

use crate::interleave::{Contender, MeasurementCfg, measure, median};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::mujoco::{Data, ObjectKind};
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::robot::kinematics::{IkCfg, TipFrame};
use kinetoscope::scene::KeyedRng;
use kinetoscope::scene::pose::from_row;
use nalgebra::{Matrix6, Vector6};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const TARGETS: usize = 1000;
/// Environments solved in one call.
const ENVS: usize = 64;
/// Number of solves of an unreachable pose.
const UNREACHABLE_SOLVES: usize = 21;
/// Square of the baseline's damping factor.
const DAMPING: f64 = 1e-3;

/// Name, file, and link moved by the last joint.
fn arms() -> BenchResult<[(&'static str, PathBuf, &'static str); 3]> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/arms");
    Ok([
        ("SR5, 6 joints", assets::path("sr5/SR5.urdf")?, "link6"),
        ("Panda's axes, 7 joints", folder.join("seven_axes.urdf"), "link7"),
        ("UR5e's axes, 6 joints", folder.join("six_axes.urdf"), "wrist_3_link"),
    ])
}

/// Target poses of a frame.
struct Task {
    link: &'static str,
    limits: Vec<[f64; 2]>,
    start: Vec<f64>,
    targets: Vec<Pose>,
    cfg: IkCfg,
}

/// Our solver.
struct Ours<'t> {
    task: &'t Task,
    sim: SimulationManager,
    robot: RobotId,
    next: usize,
}

impl Ours<'_> {
    fn solve(&self, target: &Pose) -> BenchResult<Option<Vec<f64>>> {
        let tip = TipFrame::of_part("arm").at(self.task.link);
        let found = self.sim.robot(self.robot).compute_ik(target, tip, &self.task.cfg, None, None)?;
        Ok(found.success[0].then(|| found.qpos.row(0).to_vec()))
    }
}

/// Our solver, with one pose per environment in each call.
struct Batched<'t> {
    task: &'t Task,
    sim: SimulationManager,
    robot: RobotId,
    /// The poses of the successive calls.
    targets: Vec<Vec<Pose>>,
    next: usize,
}

/// The baseline: a loop on bare MuJoCo.
struct MujocoLoop<'t> {
    task: &'t Task,
    /// Poses per step.
    poses_per_step: usize,
    data: Data,
    body: usize,
    qpos: Vec<usize>,
    dofs: Vec<usize>,
    linear: Vec<f64>,
    angular: Vec<f64>,
    next: usize,
}

impl<'t> MujocoLoop<'t> {
    fn new(task: &'t Task, sim: &SimulationManager, robot: RobotId) -> BenchResult<Self> {
        let (model, view) = (sim.batch().model(), sim.robot(robot));
        let body = model.id(ObjectKind::Body, &format!("{}/{}", view.uid(), task.link)).ok_or("no body of the link")?;
        let joint = |name: &String| model.id(ObjectKind::Joint, &format!("{}/{name}", view.uid())).ok_or("no joint");
        let joints = view.joint_names().iter().map(joint).collect::<Result<Vec<usize>, _>>()?;
        Ok(Self {
            task,
            poses_per_step: 1,
            data: Data::new(model)?,
            body,
            qpos: joints.iter().map(|&j| model.jnt_qposadr()[j] as usize).collect(),
            dofs: joints.iter().map(|&j| model.jnt_dofadr()[j] as usize).collect(),
            linear: vec![0.0; 3 * model.nv()],
            angular: vec![0.0; 3 * model.nv()],
            next: 0,
        })
    }

    /// Forward kinematics of the link in MuJoCo.
    fn link_pose(&mut self, positions: &[f64]) -> BenchResult<Pose> {
        for (&address, &q) in self.qpos.iter().zip(positions) {
            self.data.qpos_mut()[address] = q;
        }
        self.data.kinematics()?;
        let (p, q) = (&self.data.xpos()[3 * self.body..], &self.data.xquat()[4 * self.body..]);
        Ok(from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]]))
    }

    /// Twist from a pose to the target, its translation \[m\] and its angle \[rad\].
    fn error(pose: &Pose, target: &Pose) -> (Vector6<f64>, f64, f64) {
        let way = target.translation.vector - pose.translation.vector;
        let turn = (target.rotation * pose.rotation.inverse()).scaled_axis();
        (Vector6::new(way.x, way.y, way.z, turn.x, turn.y, turn.z), way.norm(), turn.norm())
    }

    fn reaches(&mut self, positions: &[f64], target: &Pose) -> BenchResult<bool> {
        let (_, way, turn) = Self::error(&self.link_pose(positions)?, target);
        Ok(way <= self.task.cfg.position_tolerance && turn <= self.task.cfg.rotation_tolerance)
    }

    fn solve(&mut self, target: &Pose) -> BenchResult<Option<Vec<f64>>> {
        let task = self.task;
        let mut random = KeyedRng::keyed(0, 0, "starts");
        for start in 0..task.cfg.num_seeds {
            let mut q = task.start.clone();
            if start > 0 {
                q = task.limits.iter().map(|&[low, high]| random.uniform_range(low, high)).collect();
            }
            for _ in 0..task.cfg.max_iterations {
                let pose = self.link_pose(&q)?;
                let (error, way, turn) = Self::error(&pose, target);
                if way <= task.cfg.position_tolerance && turn <= task.cfg.rotation_tolerance {
                    return Ok(Some(q));
                }
                let at = pose.translation.vector;
                self.data.jacobian(self.body, [at.x, at.y, at.z], &mut self.linear, &mut self.angular)?;
                let nv = self.linear.len() / 3;
                let column = |dof: usize| {
                    let (l, a) = (&self.linear, &self.angular);
                    Vector6::new(l[dof], l[nv + dof], l[2 * nv + dof], a[dof], a[nv + dof], a[2 * nv + dof])
                };
                let mut gram = Matrix6::from_diagonal_element(DAMPING);
                self.dofs.iter().for_each(|&dof| gram.ger(1.0, &column(dof), &column(dof), 1.0));
                let y = gram.cholesky().ok_or("not positive definite")?.solve(&error);
                for ((q, &dof), [low, high]) in q.iter_mut().zip(&self.dofs).zip(&task.limits) {
                    *q = (*q + column(dof).dot(&y)).clamp(*low, *high);
                }
            }
        }
        Ok(None)
    }
}

impl Contender for Ours<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        self.next = 0;
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            self.solve(&self.task.targets[self.next % TARGETS])?;
            self.next += 1;
        }
        Ok(start.elapsed())
    }
}

impl Contender for Batched<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        self.next = 0;
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let tip = TipFrame::of_part("arm").at(self.task.link);
        let start = Instant::now();
        for _ in 0..steps {
            let targets = &self.targets[self.next % self.targets.len()];
            let found = self.sim.robot(self.robot).compute_ik(targets, tip, &self.task.cfg, None, None)?;
            if found.success.len() != ENVS {
                return Err("not all poses were tried".into());
            }
            self.next += 1;
        }
        Ok(start.elapsed())
    }
}

impl Contender for MujocoLoop<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        self.next = 0;
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps as usize * self.poses_per_step {
            self.solve(&self.task.targets[self.next % TARGETS])?;
            self.next += 1;
        }
        Ok(start.elapsed())
    }
}

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let mut rows = Vec::new();
    for (name, urdf, link) in arms()? {
        rows.extend(one_arm(settings, name, urdf, link)?);
    }
    Ok(rows)
}

fn simulation(num_envs: usize, urdf: &Path) -> BenchResult<(SimulationManager, RobotId)> {
    let cfg = SimulationManagerCfg { num_envs, threads: Some(1), ground: None, ..SimulationManagerCfg::default() };
    let mut sim = SimulationManager::new(cfg)?;
    let robot = sim.add_robot(RobotCfg {
        urdf: UrdfCfg::single(urdf),
        control_parts: vec![("arm".into(), vec![".*".into()])],
        ..RobotCfg::default()
    })?;
    Ok((sim, robot))
}

fn one_arm(settings: &Settings, name: &str, urdf: PathBuf, link: &'static str) -> BenchResult<Vec<Row>> {
    let (sim, robot) = simulation(1, &urdf)?;
    let view = sim.robot(robot);
    let limits: Vec<[f64; 2]> =
        view.qpos_limits().index_axis(Axis(0), 0).rows().into_iter().map(|limit| [limit[0], limit[1]]).collect();
    let mut random = KeyedRng::keyed(1, 0, "targets");
    let reachable = Array2::from_shape_fn((TARGETS, limits.len()), |(_, j)| {
        limits[j][0] + (limits[j][1] - limits[j][0]) * random.uniform()
    });
    let start = view.default_qpos().row(0).to_vec();
    let mut task = Task { link, limits, start, targets: Vec::new(), cfg: IkCfg::default() };
    let mut judge = MujocoLoop::new(&task, &sim, robot)?;
    let targets = reachable.rows().into_iter().map(|row| judge.link_pose(&row.to_vec())).collect::<BenchResult<_>>()?;
    drop(judge);
    task.targets = targets;

    let mut bare = MujocoLoop::new(&task, &sim, robot)?;
    let mut ours = Ours { task: &task, sim, robot, next: 0 };
    let (mut micros, mut solved) = ([Vec::new(), Vec::new()], [0.0, 0.0]);
    for target in &task.targets {
        let clock = Instant::now();
        let found = ours.solve(target)?;
        micros[0].push(1e6 * clock.elapsed().as_secs_f64());
        let clock = Instant::now();
        let theirs = bare.solve(target)?;
        micros[1].push(1e6 * clock.elapsed().as_secs_f64());
        for (side, found) in [found, theirs].into_iter().enumerate() {
            if let Some(positions) = found {
                solved[side] += f64::from(u8::from(bare.reaches(&positions, target)?)) * 100.0 / TARGETS as f64;
            }
        }
    }
    let beyond = Pose::translation(10.0, 0.0, 0.0) * task.targets[0];
    let far: Vec<f64> = (0..UNREACHABLE_SOLVES)
        .map(|_| {
            let clock = Instant::now();
            let found = ours.solve(&beyond)?;
            let micros = 1e6 * clock.elapsed().as_secs_f64();
            if found.is_some() { Err("a pose out of reach was reached".into()) } else { Ok(micros) }
        })
        .collect::<BenchResult<_>>()?;
    let plan = MeasurementCfg { seconds: settings.seconds, restart_after: 1 << 20 };
    let times = measure(plan, &mut [&mut ours, &mut bare])?;
    let (many, its_robot) = simulation(ENVS, &urdf)?;
    // All targets; the last call is padded with the first targets.
    let rounds = task.targets.len().div_ceil(ENVS);
    let filled: Vec<Pose> = task.targets.iter().copied().cycle().take(rounds * ENVS).collect();
    let targets = filled.chunks_exact(ENVS).map(<[Pose]>::to_vec).collect();
    let mut batched = Batched { task: &task, sim: many, robot: its_robot, targets, next: 0 };
    (bare.poses_per_step, bare.next) = (ENVS, 0);
    let together = measure(plan, &mut [&mut batched, &mut bare])?;
    let each = |side| 1e6 * together.per_step(side) / ENVS as f64;
    let [our_median, their_median] = micros.map(median);
    let baseline = "DLS on mj_jac";
    Ok(vec![
        Row::new("ik", format!("{name}, mean"), "us/solve", 1, 1e6 * times.per_step(0)).against(
            baseline,
            1e6 * times.per_step(1),
            times.ratio(0, 1),
        ),
        Row::new("ik", format!("{name}, median"), "us/solve", 1, our_median).against(
            baseline,
            their_median,
            their_median / our_median,
        ),
        Row::new("ik", format!("{name}, mean of {ENVS} environments in one call"), "us/solve", 1, each(0)).against(
            baseline,
            each(1),
            together.ratio(0, 1),
        ),
        Row::new("ik", format!("{name}, median out of reach"), "us/solve", 1, median(far)),
        Row::new("ik", format!("{name}, solved"), "%", 1, solved[0]).against(
            baseline,
            solved[1],
            solved[0] / solved[1],
        ),
    ])
}
