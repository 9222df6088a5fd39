//! Stepped models: Debian's humanoid and the bundled arm with its hand, from many different states.

use crate::settings::BenchResult;
use kinetoscope::exec::ThreadPool;
use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::{Data, Model};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope::sim::batch::Batch;
use kinetoscope::sim::drive::table::DriveTable;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;
use std::sync::Arc;

/// MuJoCo's humanoid, as installed by Debian's package libmujoco-samples.
pub(crate) const HUMANOID: &str = "/usr/share/mujoco/model/humanoid/humanoid.xml";

/// MuJoCo calls of a bare loop in one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Loop {
    /// `mj_step`.
    Step,
    /// `mj_step2`, then `mj_step1`, as in our own loop.
    Step21,
}

/// A model with start states.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    /// Name in the results.
    pub(crate) name: String,
    /// The model, with buffers large enough for every contact that occurs.
    pub(crate) model: Model,
    /// The calls of the bare loop.
    pub(crate) bare: Loop,
    /// The MJCF, unless the model is a file.
    pub(crate) mjcf: Option<String>,
    /// States on one trajectory, assigned to the environments in turn.
    states: Vec<State>,
}

/// A start state.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) qpos: Vec<f64>,
    pub(crate) qvel: Vec<f64>,
    pub(crate) warmstart: Vec<f64>,
}

impl State {
    /// The state of `data`.
    pub(crate) fn of(data: &Data) -> Self {
        Self { qpos: data.qpos().to_vec(), qvel: data.qvel().to_vec(), warmstart: data.qacc_warmstart().to_vec() }
    }

    /// Copies the state to `data`.
    pub(crate) fn write(&self, data: &mut Data) {
        data.qpos_mut().copy_from_slice(&self.qpos);
        data.qvel_mut().copy_from_slice(&self.qvel);
        data.qacc_warmstart_mut().copy_from_slice(&self.warmstart);
    }
}

/// Number of different start states.
const STARTS: usize = 128;
/// Steps between two restarts.
pub(crate) const STEPS: u32 = 96;

impl Case {
    /// Debian's humanoid, falling with small constant torques; `None` with a message if it is not installed.
    pub(crate) fn humanoid() -> BenchResult<Option<Self>> {
        if !Path::new(HUMANOID).exists() {
            eprintln!("skipped: {HUMANOID} is not there (Debian's package libmujoco-samples)");
            return Ok(None);
        }
        let mut compiled = mj::compile_file(Path::new(HUMANOID))?;
        compiled.prepare_for_stepping(false);
        Self::new("humanoid", compiled.into_model(), None, Loop::Step).map(Some)
    }

    /// The bundled arm and hand without active drives: the same model as with drives, but no drive writes.
    pub(crate) fn sr5() -> BenchResult<Self> {
        let (sim, _) = sr5(1, 1)?;
        Self::of_simulation("SR5 + hand", &sim)
    }

    /// The model of a simulation.
    pub(crate) fn of_simulation(name: impl Into<String>, sim: &SimulationManager) -> BenchResult<Self> {
        Self::new(name, sim.batch().model().clone(), Some(sim.scene().mjcf().into()), Loop::Step21)
    }

    fn new(name: impl Into<String>, model: Model, mjcf: Option<String>, bare: Loop) -> BenchResult<Self> {
        let model = model.with_buffers(model.small_buffers());
        let mut case = Self { name: name.into(), states: trajectory(&model)?, model, bare, mjcf };
        // Buffers that no environment has to grow, so that both sides use the same memory.
        let mut batch = case.batch(STARTS, 1)?;
        batch.step(STEPS);
        let mut grown = case.model.buffers();
        batch.for_each(|_, env| {
            let own = env.data().model().buffers();
            grown.contacts = grown.contacts.max(own.contacts);
            grown.constraints = grown.constraints.max(own.constraints);
            grown.arena_bytes = grown.arena_bytes.max(own.arena_bytes);
        });
        case.model = case.model.with_buffers(grown);
        Ok(case)
    }

    /// Environments at their start states, without drives.
    pub(crate) fn batch(&self, envs: usize, threads: usize) -> BenchResult<Batch> {
        let mut batch = Batch::new(&self.model, &Arc::new(DriveTable::default()), envs, threads, ThreadPool::new())?;
        self.restart(&mut batch);
        Ok(batch)
    }

    /// Resets all environments to their start states.
    pub(crate) fn restart(&self, batch: &mut Batch) {
        let case = self.clone();
        batch.run(|i, env| env.reset(|data, _| case.write(i, data)));
    }

    /// The start state of environment `index`.
    pub(crate) fn state(&self, index: usize) -> &State {
        &self.states[index * 37 % STARTS]
    }

    /// Constant controls of environment `index`.
    pub(crate) fn controls(&self, index: usize) -> Vec<f64> {
        let phase = 0.7 * (index % STARTS) as f64;
        (0..self.model.nu()).map(|k| 0.2 * (1.3 * k as f64 + phase).sin()).collect()
    }

    /// Writes start state and controls of environment `index`.
    pub(crate) fn write(&self, index: usize, data: &mut Data) {
        self.state(index).write(data);
        data.ctrl_mut().copy_from_slice(&self.controls(index));
    }
}

/// Every second state of one environment, beginning two steps after its initial state.
fn trajectory(model: &Model) -> BenchResult<Vec<State>> {
    let mut batch = Batch::new(model, &Arc::new(DriveTable::default()), 1, 1, ThreadPool::new())?;
    let mut states = Vec::new();
    for _ in 0..STARTS {
        batch.step(2);
        states.push(batch.read(0, |env| State::of(env.data())));
    }
    Ok(states)
}

/// The bundled arm and hand as in the example `create_robot`.
pub(crate) fn sr5(envs: usize, threads: usize) -> BenchResult<(SimulationManager, RobotId)> {
    arm_with_hand(&assets::path("sr5/SR5.urdf")?, "JOINT[1-6]", envs, threads)
}

/// An arm from a file, with these joints, and the bundled hand.
pub(crate) fn arm_with_hand(
    arm: &Path,
    joints: &str,
    envs: usize,
    threads: usize,
) -> BenchResult<(SimulationManager, RobotId)> {
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        num_envs: envs,
        threads: Some(threads),
        ..SimulationManagerCfg::default()
    })?;
    let robot = sim.add_robot(arm_and_hand_cfg(arm, joints)?)?;
    Ok((sim, robot))
}

/// An arm from a file, with these joints, and the bundled hand on its flange.
pub(crate) fn arm_and_hand_cfg(arm: &Path, joints: &str) -> BenchResult<RobotCfg> {
    let hand = ComponentCfg {
        transform: from_xyz_rpy([0.0, 0.0, 0.02], [FRAC_PI_2, 0.0, 0.0]),
        ..ComponentCfg::new("hand", assets::path("revo1_left/revo1_left.urdf")?)
    };
    Ok(RobotCfg {
        uid: "sr5".into(),
        urdf: UrdfCfg { components: vec![ComponentCfg::new("arm", arm), hand], ..UrdfCfg::default() },
        control_parts: vec![("arm".into(), vec![joints.into()]), ("hand".into(), vec!["LEFT_HAND_.*".into()])],
        drive: DriveCfg {
            stiffness: [("arm", 1e4), ("hand", 1e3)].into(),
            damping: [("arm", 1e3), ("hand", 1e2)].into(),
            ..DriveCfg::default()
        },
        ..RobotCfg::default()
    })
}

/// Sets the targets of arm and hand to one of two poses, which differ in the wrist and in the opening of the hand.
pub(crate) fn drive_sr5(sim: &mut SimulationManager, robot: RobotId, closed: bool) -> BenchResult<()> {
    let arm = sim.robot(robot).joint_ids("arm")?;
    let hand = sim.robot(robot).joint_ids("hand")?;
    let limits = sim.robot(robot).qpos_limits();
    let wrist = if closed { 0.3 } else { -0.3 };
    let pose = [0.0, 0.5, -1.5, wrist, -0.5, 0.0];
    let envs = sim.num_envs();
    let arm_targets = Array2::from_shape_fn((envs, arm.len()), |(_, j)| pose[j]);
    let hand_targets = Array2::from_shape_fn((envs, hand.len()), |(_, j)| limits[(0, hand[j].0, usize::from(closed))]);
    sim.robot_mut(robot).set_qpos_target(&arm_targets, Some(&arm), None)?;
    sim.robot_mut(robot).set_qpos_target(&hand_targets, Some(&hand), None)?;
    Ok(())
}
