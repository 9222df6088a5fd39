//! Rollouts: states that result from given controls, for sampling-based planners.
//!
//! The counterpart of MuJoCo's `rollout`: initial states and controls in, states out, many rows in parallel. A rollout
//! steps copies of the environments on its own threads, so environments and sensors keep their state, bit for bit. The
//! result equals that of stepping by hand: `set_qpos_target` and `set_ctrl` with the controls of a step, `update(1)`,
//! read.

use crate::drive::table::DriveState;
use crate::env::{EnvState, EnvStatus, SimEnv, Stage};
use crate::error::{Error, Result};
use crate::ids::{EnvId, env_list};
use crate::manager::SimulationManager;
use crate::simulation::Simulation;
use crate::snapshot::{EnvEntry, Snapshot};
use kinetoscope_mujoco as mj;
use ndarray::{Array3, ArrayView2, ArrayView3, ArrayViewMut2, AsArray, Ix3};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Result of a [rollout](SimulationManager::rollout). Row k belongs to the k-th selected environment.
#[derive(Clone, Debug)]
pub struct Rollout {
    /// Positions, then velocities, after every step, shape (N, T, nq + nv).
    /// [`state_names`](crate::Entities::state_names) has the column names. A diverged row repeats its last valid state.
    pub states: Array3<f64>,
    /// Final states; [`restore`](SimulationManager::restore) copies them to the environments.
    pub final_states: Snapshot,
    /// Index and error text of each diverged row. The step in the text counts MuJoCo steps since the last reset, not
    /// since the start of the rollout.
    pub diverged: Vec<(usize, String)>,
}

/// Effect of one column of the controls.
#[derive(Clone, Copy, Debug)]
enum ColumnEffect {
    /// Position target of a drive, clamped to the target range in the row's initial state.
    Target { drive: usize },
    /// No effect: the joint follows another joint or has no drive.
    Ignored,
    /// Control of an actuator of an attached MJCF file.
    Control { ctrl_index: usize },
}

/// One row of a rollout before its first step.
struct RolloutRow {
    env: usize,
    model: mj::Model,
    drives: DriveState,
    start: EnvState,
}

/// Effects of all columns: joints of all robots, then actuators of all attached MJCF files.
fn columns(simulation: &Simulation) -> Vec<ColumnEffect> {
    let joints = simulation.robots.iter().flat_map(|robot| &robot.joints);
    let target = |drive| ColumnEffect::Target { drive };
    let mut columns: Vec<ColumnEffect> =
        joints.map(|joint| joint.drive.map_or(ColumnEffect::Ignored, target)).collect();
    for part in &simulation.mjcf_models {
        columns.extend(part.controls.iter().map(|&ctrl_index| ColumnEffect::Control { ctrl_index }));
    }
    columns
}

fn apply_controls(env: &mut SimEnv, columns: &[ColumnEffect], values: impl Iterator<Item = f64>) {
    let mut controls = Vec::new();
    for (column, value) in columns.iter().zip(values) {
        match *column {
            ColumnEffect::Target { drive } => {
                let [low, high] = env.drives.ranges[drive];
                env.drives.position[drive] = value.clamp(low, high);
            }
            ColumnEffect::Ignored => {}
            ColumnEffect::Control { ctrl_index } => controls.push((ctrl_index, value)),
        }
    }
    if !controls.is_empty() {
        env.set_controls(|all| controls.iter().for_each(|&(place, value)| all[place] = value));
    }
}

/// Model of the environment without attached welds; a row attaches the welds of its own initial state.
fn without_welds(env: &SimEnv) -> mj::Model {
    let model = env.data().model();
    if env.welds().is_empty() { model.clone() } else { model.with_welds(&[]) }
}

/// Simulates one row in `env`, which has the model of the row: one physics step (`substeps` MuJoCo steps) for each row
/// of `controls`. Writes qpos and qvel after that step to the same row of `states`. Returns the final state, and the
/// error text of a diverged row; `None` if `stop` was set.
fn step_row(
    env: &mut SimEnv,
    row: &RolloutRow,
    columns: &[ColumnEffect],
    substeps: u32,
    controls: ArrayView2<'_, f64>,
    mut states: ArrayViewMut2<'_, f64>,
    stop: &AtomicBool,
) -> Option<(EnvEntry, Option<String>)> {
    env.drives = row.drives.clone();
    env.load_state(&row.start);
    for (values, mut state) in controls.rows().into_iter().zip(states.rows_mut()) {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        apply_controls(env, columns, values.iter().copied());
        env.advance(substeps, None);
        env.reach(Stage::State);
        let now = env.data().qpos().iter().chain(env.data().qvel());
        state.iter_mut().zip(now).for_each(|(to, from)| *to = *from);
    }
    let reason = match env.status() {
        EnvStatus::Running => None,
        EnvStatus::Diverged { step, reason } => Some(format!("step {step}: {reason}")),
    };
    Some((EnvEntry { env: row.env, state: env.save_state(), overrides: Arc::default() }, reason))
}

/// [Rollout](SimulationManager::rollout) that another thread can end by setting `stop`, after the steps that are running.
///
/// # Errors
/// Same as [`SimulationManager::rollout`], and [`Error::Interrupted`] if `stop` was set before the last step.
pub fn rollout_until<'c>(
    sim: &SimulationManager,
    stop: &AtomicBool,
    controls: impl AsArray<'c, f64, Ix3>,
    start: Option<&Snapshot>,
    env_ids: Option<&[EnvId]>,
) -> Result<Rollout> {
    sim.run_rollout(stop, controls.into(), start, env_ids)
}

impl SimulationManager {
    /// Simulates copies of environments under `controls`, shape (N, T, C): N rows with the controls of T physics steps.
    /// [`control_names`](crate::Entities::control_names) has the names of the C columns.
    ///
    /// The controls of a robot are position targets \[rad or m\], clamped to the target range in the row's initial
    /// state, as [`set_qpos_target`](crate::RobotMut::set_qpos_target) does. Columns of joints that follow others or
    /// have no drive are ignored. The controls of an attached MJCF file are those of
    /// [`set_ctrl`](crate::MjcfPartMut::set_ctrl). Other targets and inputs stay as they are in the initial state.
    ///
    /// Row k runs in a copy of the k-th of `env_ids` (all environments for `None`), with its model. An environment can
    /// be named several times, to try several controls from its state. If `controls` has a single row, all environments
    /// use it. Row k starts in the k-th state of `start`, or in the current state of its environment for `None`.
    /// A single state in `start` is used for all rows.
    ///
    /// The environments keep their state, bit for bit. To continue from the end of a rollout,
    /// [`restore`](Self::restore) its [`Rollout::final_states`].
    ///
    /// # Errors
    /// The shape is wrong, a control is not finite, an environment does not exist, the snapshot belongs to another
    /// scene or has another number of states, or the memory for a copy cannot be allocated.
    pub fn rollout<'c>(
        &self,
        controls: impl AsArray<'c, f64, Ix3>,
        start: Option<&Snapshot>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<Rollout> {
        self.run_rollout(&AtomicBool::new(false), controls.into(), start, env_ids)
    }

    fn run_rollout(
        &self,
        stop: &AtomicBool,
        controls: ArrayView3<'_, f64>,
        start: Option<&Snapshot>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<Rollout> {
        let envs = env_list(env_ids, self.num_envs())?;
        let columns = columns(&self.simulation);
        self.check_controls(controls, envs.len(), columns.len())?;
        let rows = self.rows(&envs, start)?;
        let (steps, substeps, model) = (controls.shape()[1], self.cfg.substeps, self.simulation.batch.model());
        let mut states = Array3::zeros((envs.len(), steps, model.nq() + model.nv()));
        let mut results: Vec<Option<(EnvEntry, Option<String>)>> = vec![None; envs.len()];
        let threads = self.threads().clamp(1, envs.len().max(1));
        let work = Mutex::new(rows.iter().zip(states.outer_iter_mut()).zip(&mut results).enumerate());
        let next = || work.lock().unwrap_or_else(PoisonError::into_inner).next();
        let run = || -> Result<()> {
            // With the model the copy was made of: a row with welds changes the model of the copy.
            let mut copy: Option<(&mj::Model, SimEnv)> = None;
            while let Some((k, ((row, states), result))) = next() {
                if stop.load(Ordering::Relaxed) {
                    return Ok(());
                }
                let mut env = match copy.take().filter(|(model, _)| model.ptr_eq(&row.model)) {
                    Some((_, env)) => env,
                    None => SimEnv::with_drives(&row.model, row.drives.clone())?,
                };
                let mine = controls.index_axis(ndarray::Axis(0), if controls.shape()[0] == 1 { 0 } else { k });
                *result = step_row(&mut env, row, &columns, substeps, mine, states, stop);
                // A row that needed larger buffers drops its copy, so that the next row starts with small ones.
                copy = (env.buffer_growths() == 0).then_some((&row.model, env));
            }
            Ok(())
        };
        std::thread::scope(|scope| -> Result<()> {
            // If the system refuses a thread, fewer threads do the same work.
            let start = |_| std::thread::Builder::new().spawn_scoped(scope, run).ok();
            let others: Vec<_> = (1..threads).map_while(start).collect();
            let mine = run();
            others.into_iter().try_for_each(|other| match other.join() {
                Ok(done) => done,
                Err(panic) => std::panic::resume_unwind(panic),
            })?;
            mine
        })?;
        if results.iter().any(Option::is_none) {
            return Err(Error::Interrupted);
        }
        let (mut entries, mut diverged) = (Vec::with_capacity(envs.len()), Vec::new());
        for (k, (entry, reason)) in results.into_iter().flatten().enumerate() {
            let overrides = self.simulation.own_properties(entry.env, self.randomization_count[entry.env]);
            entries.push(EnvEntry { overrides, ..entry });
            diverged.extend(reason.map(|reason| (k, reason)));
        }
        Ok(Rollout { states, final_states: Snapshot::new(&self.simulation, entries), diverged })
    }

    fn check_controls(&self, controls: ArrayView3<'_, f64>, rows: usize, columns: usize) -> Result<()> {
        let (found, steps) = (controls.shape().to_vec(), controls.shape()[1]);
        if found[2] != columns || (found[0] != rows && found[0] != 1) {
            let meaning = "rows, steps, control_names";
            return Err(Error::Shape { argument: "rollout", found, expected: vec![rows, steps, columns], meaning });
        }
        match controls.indexed_iter().find(|(_, value)| !value.is_finite()) {
            None => Ok(()),
            Some(((row, step, column), &value)) => {
                let item = format!("control {:?} of step {step}", self.entities().control_names()[column]);
                Err(Error::NotFinite { argument: "rollout", row, column, item, value })
            }
        }
    }

    fn rows(&self, envs: &[usize], start: Option<&Snapshot>) -> Result<Vec<RolloutRow>> {
        let states = start.map(|start| start.states_for(envs.len(), &self.simulation)).transpose()?;
        // One model for all rows of an environment, so that they share a copy.
        let mut models: Vec<Option<mj::Model>> = vec![None; self.num_envs()];
        let row = |(k, &env): (usize, &usize)| {
            self.simulation.batch.read_at(env, Stage::Raw, |here| {
                let start = match (start, &states) {
                    (Some(start), Some(states)) => start.entries()[states[k]].state.clone(),
                    _ => here.save_state(),
                };
                let model = models[env].get_or_insert_with(|| without_welds(here)).clone();
                RolloutRow { env, model, drives: here.drives.clone(), start }
            })
        };
        Ok(envs.iter().enumerate().map(row).collect())
    }
}
