//! The rows of all environments and their copies on a device.
//!
//! A step reads nothing back: the rows are then behind the device, and [`DeviceMirror::receive`] brings them up to date
//! as far as a reader needs. Rows are visited on the threads of the batch, each by one thread, so that results do not
//! depend on the number of threads. Calls of the device are made on the calling thread alone.

use super::captured::{DeviceBodies, DeviceContacts};
use super::inputs::{Changes, Layout, STATE, SentRows, Write};
use super::model_writes::{ModelWrites, add_model_writes};
use super::{DeviceError, DevicePhysics, StepReport};
use crate::capture::CaptureRequest;
use crate::drive::table::DriveTable;
use crate::env::{Divergence, EnvStatus};
use crate::row::{EnvRow, RowPart, StateArray, StoredRow, prefetch_after};
use kinetoscope_mujoco::{EngineError, Model, Warning};
use kinetoscope_scene::StateFields;
use std::path::Path;
use std::sync::Arc;

/// Rows of a chunk of environments of a batch.
pub(crate) struct ChunkRows<'a> {
    /// Index of the first environment.
    pub(crate) first: usize,
    pub(crate) rows: &'a mut [Box<EnvRow>],
    pub(crate) changes: &'a mut Changes,
    pub(crate) sent: &'a mut SentRows,
}

/// Rows of the environments of a batch.
pub(crate) trait EnvRows {
    /// Calls `visit` once for every chunk, on the threads of the batch and in any order.
    fn visit(&self, visit: &(dyn Fn(ChunkRows<'_>) + Sync));

    /// Calls `visit` for every chunk that may have changed, in order, on the calling thread.
    fn visit_changed(&self, visit: &mut dyn FnMut(ChunkRows<'_>));
}

/// The environments of a batch on a device.
#[derive(Debug)]
pub(crate) struct DeviceMirror {
    physics: Box<dyn DevicePhysics>,
    table: Arc<DriveTable>,
    num_envs: usize,
    /// Inputs of the scene; `None` before its first step.
    layout: Option<Layout>,
    /// Rows to send in a step, for each input of the layout.
    writes: Vec<Write>,
    /// Arrays of [`STATE`] as last read.
    states: [Vec<f32>; 4],
    /// True for each of `states` that was read after the last step.
    are_states_read: [bool; 4],
    /// Largest part that is up to date in all rows.
    current: RowPart,
    /// Steps since clocks were last up to date.
    unread_steps: u64,
    /// Error after which the device does not step again.
    failed: Option<DeviceError>,
    /// Number of times buffers of the device grew.
    growths: u64,
}

/// Arrays of the device that [`DeviceMirror::receive`] writes to rows.
#[derive(Default)]
struct Results {
    /// `qacc`, `qfrc_actuator` and `qfrc_constraint`.
    solved: [Vec<f32>; 3],
    forces: Vec<f32>,
    efforts: Vec<f32>,
}

impl DeviceMirror {
    /// Creates the mirror of a device without a scene.
    pub(crate) fn new(physics: Box<dyn DevicePhysics>) -> Self {
        Self {
            physics,
            table: Arc::default(),
            num_envs: 0,
            layout: None,
            writes: Vec::new(),
            states: Default::default(),
            are_states_read: [false; 4],
            current: RowPart::All,
            unread_steps: 0,
            failed: None,
            growths: 0,
        }
    }

    /// Loads a scene from its files, as [`DevicePhysics::load`] does.
    pub(super) fn load(&mut self, folder: &Path, scene: &str, num_envs: usize) -> Result<(), DeviceError> {
        self.physics.load(folder, scene, num_envs)
    }

    /// Forgets what the device has, which is a new scene with the drives of `table`.
    pub(super) fn reset_for(&mut self, table: &Arc<DriveTable>, num_envs: usize) {
        self.table = Arc::clone(table);
        self.num_envs = num_envs;
        self.layout = None;
        self.states = Default::default();
        self.are_states_read = [false; 4];
        (self.current, self.unread_steps) = (RowPart::All, 0);
        self.failed = None;
    }

    /// Error after which the device does not step again.
    pub(crate) fn failure(&self) -> Option<&DeviceError> {
        self.failed.as_ref()
    }

    /// The physics of the device.
    pub(crate) fn physics(&self) -> &dyn DevicePhysics {
        &*self.physics
    }

    /// Number of times buffers of the device grew.
    pub(crate) fn growths(&self) -> u64 {
        self.growths
    }

    /// Largest part that is up to date in all rows.
    pub(crate) fn current(&self) -> RowPart {
        self.current
    }

    /// Steps all environments. The rows are then behind the device. After an error, all environments count as diverged,
    /// in the state that their rows have.
    pub(crate) fn step(&mut self, model: &Model, count: u32, capture: Option<&CaptureRequest>, rows: &dyn EnvRows) {
        let done = match &self.failed {
            Some(error) => Err(error.clone()),
            None => self.try_step(model, count, capture, rows),
        };
        self.end(done, model, rows);
    }

    /// Brings all rows up to date as far as `part`. If the device fails, all environments count as diverged.
    pub(crate) fn receive(&mut self, model: &Model, part: RowPart, rows: &dyn EnvRows) {
        let done = self.try_receive(model, part, &[], rows);
        self.end(done, model, rows);
    }

    /// Freezes all environments after an error, with the time of their states.
    fn end(&mut self, done: Result<(), DeviceError>, model: &Model, rows: &dyn EnvRows) {
        let Err(error) = done else { return };
        tracing::error!(target: "kinetoscope_sim", %error, "the physics of the device failed");
        rows.visit(&|chunk| {
            for (k, row) in chunk.rows.iter_mut().enumerate().filter(|(_, row)| row.diverged.is_none()) {
                if let Some((time, steps)) = chunk.sent.take_clock(k) {
                    row.motion.parts_mut(model)[0][0] = time;
                    row.steps = steps;
                }
                let reason = Divergence::Engine(EngineError { message: error.to_string() });
                row.diverged = Some(Box::new(EnvStatus::Diverged { step: row.steps, reason }));
            }
        });
        self.failed = Some(error);
        // The device is not read again.
        (self.current, self.unread_steps) = (RowPart::All, 0);
    }

    fn try_step(
        &mut self,
        model: &Model,
        count: u32,
        capture: Option<&CaptureRequest>,
        rows: &dyn EnvRows,
    ) -> Result<(), DeviceError> {
        self.send(model, rows)?;
        let fields = capture.map_or(StateFields::NONE, |capture| capture.fields);
        let wanted: Vec<&str> = [
            (StateFields::CONTACTS, "contacts"),
            (StateFields::ACCELERATIONS, "motion"),
            (StateFields::JOINT_WRENCHES, "wrenches"),
        ]
        .into_iter()
        .filter_map(|(field, name)| fields.contains(field).then_some(name))
        .collect();
        let report = self.physics.step(count, &wanted)?;
        let report: StepReport = serde_json::from_str(&report)
            .map_err(|error| DeviceError::Failed(format!("its report is invalid: {error}")))?;
        for [rows, contacts] in &report.grown {
            self.growths += 1;
            tracing::info!(target: "kinetoscope_sim", rows, contacts, "buffers of the device grew");
        }
        self.current = RowPart::Inputs;
        self.are_states_read = [false; 4];
        self.unread_steps += u64::from(count);
        if !report.diverged.is_empty() {
            let ended: Vec<(usize, u64, &str)> = report
                .diverged
                .iter()
                .map(|(env, step, reason)| (*env, self.unread_steps - u64::from(count) + step, reason.as_str()))
                .collect();
            self.try_receive(model, RowPart::All, &ended, rows)?;
        }
        match capture {
            Some(capture) => self.receive_capture(model, capture, rows),
            None => Ok(()),
        }
    }

    /// Sends everything that changed in the rows.
    fn send(&mut self, model: &Model, rows: &dyn EnvRows) -> Result<(), DeviceError> {
        let table = &self.table;
        let layout = &*self.layout.get_or_insert_with(|| Layout::new(model, table));
        self.writes.resize_with(layout.inputs().len(), Write::default);
        let mut changed = false;
        rows.visit_changed(&mut |_| changed = true);
        if !changed {
            return Ok(());
        }
        let states = &self.states;
        rows.visit(&|chunk| {
            if *chunk.changes != Changes::None {
                chunk.sent.compare(layout, model, chunk.rows, chunk.first, *chunk.changes, states);
            }
        });
        let writes = &mut self.writes;
        writes.iter_mut().for_each(Write::clear);
        let mut of_models = ModelWrites::new();
        let mut unsupported = None;
        rows.visit_changed(&mut |chunk| {
            for k in chunk.sent.changed_models() {
                let row = StoredRow { row: &chunk.rows[k], model };
                let before = chunk.sent.replace_patch(k, row.row.patch.as_ref());
                if let Err(error) = add_model_writes(chunk.first + k, &row, before.as_deref(), &mut of_models) {
                    unsupported.get_or_insert(error);
                }
            }
            chunk.sent.take_writes(layout, chunk.first, writes);
            *chunk.changes = Changes::None;
        });
        if let Some(error) = unsupported {
            return Err(error);
        }
        for (name, (envs, values)) in &of_models {
            self.physics.write(name, envs, values)?;
        }
        for (input, write) in layout.inputs().zip(&self.writes).filter(|(_, write)| !write.envs.is_empty()) {
            self.physics.write(input.name(), &write.envs, &write.values)?;
        }
        Ok(())
    }

    /// Reads an array with `width` numbers per environment.
    fn read(&mut self, name: &str, width: usize) -> Result<Vec<f32>, DeviceError> {
        if width == 0 {
            return Ok(Vec::new());
        }
        let values = self.physics.read(name)?;
        let expected = width * self.num_envs;
        if values.len() == expected {
            Ok(values)
        } else {
            Err(DeviceError::Failed(format!("{name} has {} numbers, expected {expected}", values.len())))
        }
    }

    /// Reads the array of [`STATE`] with index `k`, unless it was read after the last step.
    fn update_state(&mut self, model: &Model, k: usize) -> Result<(), DeviceError> {
        if !self.are_states_read[k] {
            let widths = [model.nq(), model.nv(), model.na(), model.nv()];
            self.states[k] = self.read(STATE[k].name(), widths[k])?;
            self.are_states_read[k] = true;
        }
        Ok(())
    }

    /// Array of the state after the last step, with a row per environment.
    ///
    /// # Errors
    /// The device failed. The next call of [`receive`](Self::receive) freezes the environments.
    pub(crate) fn read_state(&mut self, model: &Model, array: StateArray) -> Result<&[f32], DeviceError> {
        let k = match array {
            StateArray::Positions => 0,
            StateArray::Velocities => 1,
            StateArray::Accelerations => 3,
        };
        self.update_state(model, k)?;
        Ok(&self.states[k])
    }

    /// Brings all rows up to date as far as `part`. `ended` lists environments that diverged: environment, steps that it
    /// did since clocks were up to date, and reason.
    fn try_receive(
        &mut self,
        model: &Model,
        part: RowPart,
        ended: &[(usize, u64, &str)],
        rows: &dyn EnvRows,
    ) -> Result<(), DeviceError> {
        if part <= self.current {
            return Ok(());
        }
        let (nv, nu) = (model.nv(), model.nu());
        let (clock, all) = (self.current < RowPart::Clock, part == RowPart::All);
        let row_drives = self.layout.as_ref().map_or(0, |layout| layout.row_drives().len());
        let mut read = Results::default();
        if all {
            (0..STATE.len()).try_for_each(|k| self.update_state(model, k))?;
            for (array, name) in read.solved.iter_mut().zip(["qacc", "qfrc_actuator", "qfrc_constraint"]) {
                *array = self.read(name, nv)?;
            }
            read.forces = self.read("actuator_force", nu)?;
            read.efforts = self.read("effort", row_drives)?;
        }
        let mut ends = vec![None; if ended.is_empty() { 0 } else { self.num_envs }];
        for (env, steps, reason) in ended {
            if let Some(end) = ends.get_mut(*env) {
                *end = Some((*steps, *reason));
            }
        }
        let (unread, states, table) = (self.unread_steps, &self.states, &*self.table);
        let row_drives = self.layout.as_ref().map_or(&[][..], Layout::row_drives);
        rows.visit(&|chunk| {
            let mut effort = Vec::with_capacity(table.drives.len());
            for k in 0..chunk.rows.len() {
                prefetch_after(chunk.rows, k, EnvRow::prefetch_results);
                let (env, row) = (chunk.first + k, &mut *chunk.rows[k]);
                // The device steps on without a diverged environment. The row is sent again once the environment runs.
                if row.diverged.is_some() {
                    continue;
                }
                let end = ends.get(env).copied().flatten();
                if clock {
                    let done = end.map_or(unread, |(steps, _)| steps);
                    let [time, ..] = row.motion.parts_mut(model);
                    chunk.sent.keep_clock(k, time[0], row.steps);
                    for _ in 0..done {
                        time[0] += model.timestep();
                    }
                    note_steps(row, done);
                }
                if all {
                    chunk.sent.take_clock(k);
                    let [_, motion @ ..] = row.motion.parts_mut(model);
                    for (to, from) in motion.into_iter().zip(states) {
                        copy(from, env, to);
                    }
                    read.write_to(row, env, model, table, row_drives, &mut effort);
                }
                if let Some((_, reason)) = end {
                    row.diverged = Some(Box::new(EnvStatus::Diverged { step: row.steps, reason: divergence(reason) }));
                    chunk.sent.forget_state(k);
                }
            }
        });
        self.current = part;
        self.unread_steps = 0;
        Ok(())
    }

    /// Writes what the device captured to the rows.
    fn receive_capture(
        &mut self,
        model: &Model,
        capture: &CaptureRequest,
        rows: &dyn EnvRows,
    ) -> Result<(), DeviceError> {
        // Clocks of rows that are behind would clear the capture later.
        self.try_receive(model, RowPart::Clock, &[], rows)?;
        let nbody = model.nbody();
        let contacts = match capture.fields.contains(StateFields::CONTACTS) {
            true => Some(DeviceContacts::new(self.physics.read("contacts")?, self.num_envs)),
            false => None,
        };
        let motion = !capture.fields.intersection(StateFields::ACCELERATIONS | StateFields::JOINT_WRENCHES).is_empty();
        let names = [("xpos", 3), ("xquat", 4), ("cvel", 6), ("subtree_com", 3), ("cacc", 6), ("cfrc_int", 6)];
        let mut arrays = Vec::new();
        for (name, width) in names.into_iter().filter(|_| motion) {
            let needed = name != "cfrc_int" || capture.fields.contains(StateFields::JOINT_WRENCHES);
            arrays.push(if needed { self.read(name, width * nbody)? } else { Vec::new() });
        }
        rows.visit(&|chunk| {
            let mut bodies = DeviceBodies::new(model);
            for (k, row) in chunk.rows.iter_mut().enumerate().filter(|(_, row)| row.diverged.is_none()) {
                let env = chunk.first + k;
                let gravity = StoredRow { row, model }.gravity();
                let solved = &mut row.cold.captured;
                if let Some(contacts) = &contacts {
                    capture.capture_contacts(contacts.of_env(env), solved);
                }
                if motion {
                    bodies.load(&arrays, env);
                    capture.capture_motion(&bodies, gravity, solved);
                }
            }
        });
        Ok(())
    }
}

impl Results {
    /// Writes the results of environment `env` to its row.
    fn write_to(
        &self,
        row: &mut EnvRow,
        env: usize,
        model: &Model,
        table: &DriveTable,
        row_drives: &[usize],
        effort: &mut Vec<f64>,
    ) {
        let [qacc, actuator, constraint, forces] = row.solved.parts_mut(model);
        for (from, to) in self.solved.iter().zip([qacc, actuator, constraint]) {
            copy(from, env, to);
        }
        let nu = model.nu();
        if forces.len() == nu {
            copy(&self.forces, env, forces);
        }
        effort.clear();
        effort.extend(table.drives.iter().map(|drive| f64::from(self.forces[env * nu + drive.ctrl])));
        for (k, &drive) in row_drives.iter().enumerate() {
            effort[drive] = f64::from(self.efforts[env * row_drives.len() + k]);
        }
        row.drives.finish_step(effort);
    }
}

/// Notes `steps` steps in a row whose time has them.
fn note_steps(row: &mut EnvRow, steps: u64) {
    row.steps = row.steps.saturating_add(steps);
    row.solved_current = false;
    row.is_forward_counted = false;
    row.is_pass_impossible = false;
    // No `mjData` holds this row any longer.
    row.version = 0;
    row.cold.captured.clear();
}

/// Copies the row of an environment.
fn copy(from: &[f32], env: usize, to: &mut [f64]) {
    let from = &from[env * to.len()..(env + 1) * to.len()];
    to.iter_mut().zip(from).for_each(|(to, from)| *to = f64::from(*from));
}

/// Reason of a divergence that the device names by the array that is not finite.
fn divergence(reason: &str) -> Divergence {
    match reason {
        "qpos" => Divergence::Warning(Warning::BadPosition),
        "qvel" => Divergence::Warning(Warning::BadVelocity),
        "qacc" => Divergence::Warning(Warning::BadAcceleration),
        other => Divergence::Engine(EngineError { message: other.into() }),
    }
}
