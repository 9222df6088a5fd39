//! The rows of all environments and their copies on a device.

use super::captured::{CONTACT_NUMBERS, DeviceBodies, contacts_by_env};
use super::inputs::Input;
use super::model_writes::{ModelWrites, add_model_writes};
use super::{DeviceError, DevicePhysics, DeviceScene, StepReport};
use crate::capture::CaptureRequest;
use crate::drive::table::{DriveTable, Realization};
use crate::env::{Divergence, EnvStatus};
use crate::row::{EnvRow, StoredRow};
use kinetoscope_mujoco::{EngineError, Model, ModelPatch, Warning};
use kinetoscope_scene::StateFields;
use std::sync::Arc;

/// An input, with the values that the device has.
#[derive(Debug)]
struct Sent {
    input: Input,
    width: usize,
    /// Values on the device, environment by environment; NaN before the first write.
    values: Vec<f32>,
    /// Environments whose values changed, and the new values.
    changed: (Vec<i32>, Vec<f32>),
}

/// Rows of the environments of a batch.
pub(crate) trait EnvRows {
    /// Calls `visit` for all environments in order.
    fn for_each(&self, visit: &mut dyn FnMut(usize, &mut EnvRow));

    /// Calls `visit` in order for environments that may have changed since [`set_unchanged`](Self::set_unchanged).
    fn for_each_changed(&self, visit: &mut dyn FnMut(usize, &mut EnvRow));

    /// Notes that the device has all rows.
    fn set_unchanged(&self);
}

/// The environments of a batch on a device.
#[derive(Debug)]
pub(crate) struct DeviceMirror {
    physics: Box<dyn DevicePhysics>,
    sent: Vec<Sent>,
    /// Differences of the models of environments that the device has.
    patches: Vec<Option<Arc<ModelPatch>>>,
    /// Drives with a constraint row.
    row_drives: Vec<usize>,
    table: Arc<DriveTable>,
    /// Error after which the device does not step again.
    failed: Option<DeviceError>,
    /// Number of times buffers of the device grew.
    growths: u64,
}

impl DeviceMirror {
    /// Creates the mirror of a device without a scene.
    pub(crate) fn new(physics: Box<dyn DevicePhysics>) -> Self {
        Self {
            physics,
            sent: Vec::new(),
            patches: Vec::new(),
            row_drives: Vec::new(),
            table: Arc::default(),
            failed: None,
            growths: 0,
        }
    }

    /// Loads a scene, unless nothing moves in it. All rows are sent before the next step.
    ///
    /// # Errors
    /// The device cannot simulate the scene, failed, or the files of the scene cannot be written to a temporary folder.
    pub(crate) fn load(
        &mut self,
        scene: &DeviceScene<'_>,
        table: &Arc<DriveTable>,
        num_envs: usize,
    ) -> Result<(), DeviceError> {
        let failed = |error: std::io::Error| DeviceError::Failed(format!("the scene cannot be written: {error}"));
        if scene.moves() {
            let folder = tempfile::tempdir().map_err(failed)?;
            scene.write_to(folder.path()).map_err(failed)?;
            self.physics.load(folder.path(), scene.json(), num_envs)?;
        }
        self.reset_for(table, num_envs);
        Ok(())
    }

    /// Forgets what the device has, which is a new scene with the drives of `table`.
    pub(super) fn reset_for(&mut self, table: &Arc<DriveTable>, num_envs: usize) {
        self.sent.clear();
        self.patches = vec![None; num_envs];
        self.table = Arc::clone(table);
        let drives = table.drives.iter().enumerate();
        let rows = drives.filter(|(_, drive)| drive.realization == Realization::ConstraintRow);
        self.row_drives = rows.map(|(index, _)| index).collect();
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

    /// Steps all environments and writes their new states to the rows in `rows`. After an error, all
    /// environments count as diverged.
    pub(crate) fn step(&mut self, model: &Model, count: u32, capture: Option<&CaptureRequest>, rows: &dyn EnvRows) {
        let done = match &self.failed {
            Some(error) => Err(error.clone()),
            None => self.try_step(model, count, capture, rows),
        };
        if let Err(error) = done {
            tracing::error!(target: "kinetoscope_sim", %error, "the physics of the device failed");
            rows.for_each(&mut |_, row| {
                if row.diverged.is_none() {
                    let reason = Divergence::Engine(EngineError { message: error.to_string() });
                    row.diverged = Some(Box::new(EnvStatus::Diverged { step: row.steps, reason }));
                }
            });
            self.failed = Some(error);
        }
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
        self.receive(model, count, &report, rows)?;
        if let Some(capture) = capture {
            self.receive_capture(model, capture, rows)?;
        }
        rows.set_unchanged();
        Ok(())
    }

    /// Sends everything that changed in the rows.
    fn send(&mut self, model: &Model, rows: &dyn EnvRows) -> Result<(), DeviceError> {
        let num_envs = self.patches.len();
        let (row_drives, patches) = (&self.row_drives, &mut self.patches);
        let sent = &mut self.sent;
        let mut writes = ModelWrites::new();
        let (mut scratch, mut unsupported) = (Vec::new(), None);
        rows.for_each_changed(&mut |env, row| {
            let row = StoredRow { row, model };
            if sent.is_empty() {
                for input in Input::ALL {
                    scratch.clear();
                    input.append(&row, row_drives, &mut scratch);
                    let width = scratch.len();
                    let values = vec![f32::NAN; width * num_envs];
                    sent.push(Sent { input, width, values, changed: Default::default() });
                }
                sent.retain(|array| array.width > 0);
            }
            if row.row.diverged.is_some() {
                return;
            }
            for array in sent.iter_mut() {
                scratch.clear();
                array.input.append(&row, row_drives, &mut scratch);
                let mine = &mut array.values[env * array.width..(env + 1) * array.width];
                if mine.iter().map(|x| x.to_bits()).ne(scratch.iter().map(|x| x.to_bits())) {
                    mine.copy_from_slice(&scratch);
                    array.changed.0.push(env as i32);
                    array.changed.1.extend_from_slice(&scratch);
                }
            }
            let same = |one: &Option<Arc<ModelPatch>>, other: &Option<Arc<ModelPatch>>| match (one, other) {
                (None, None) => true,
                (Some(one), Some(other)) => Arc::ptr_eq(one, other),
                _ => false,
            };
            if !same(&patches[env], &row.row.patch) {
                let before = std::mem::replace(&mut patches[env], row.row.patch.clone());
                if let Err(error) = add_model_writes(env, &row, before.as_deref(), &mut writes) {
                    unsupported = Some(error);
                }
            }
        });
        if let Some(error) = unsupported {
            return Err(error);
        }
        for (name, (envs, values)) in &writes {
            self.physics.write(name, envs, values)?;
        }
        for array in &mut self.sent {
            if !array.changed.0.is_empty() {
                self.physics.write(array.input.name(), &array.changed.0, &array.changed.1)?;
                array.changed.0.clear();
                array.changed.1.clear();
            }
        }
        Ok(())
    }

    /// Reads an array with a row per environment.
    fn read(&mut self, name: &str, width: usize) -> Result<Vec<f32>, DeviceError> {
        let values = self.physics.read(name)?;
        let expected = width * self.patches.len();
        if values.len() == expected {
            Ok(values)
        } else {
            Err(DeviceError::Failed(format!("{name} has {} numbers, expected {expected}", values.len())))
        }
    }

    /// Writes the states after a step to the rows.
    fn receive(
        &mut self,
        model: &Model,
        count: u32,
        report: &StepReport,
        rows: &dyn EnvRows,
    ) -> Result<(), DeviceError> {
        let (nv, na) = (model.nv(), model.na());
        for k in 0..self.sent.len() {
            let (input, width) = (self.sent[k].input, self.sent[k].width);
            if input.is_state() {
                self.sent[k].values = self.read(input.name(), width)?;
            }
        }
        let solved = ["qacc", "qfrc_actuator", "qfrc_constraint"].map(|name| self.read(name, nv));
        let [qacc, actuator, constraint] = solved;
        let solved = [qacc?, actuator?, constraint?];
        let forces = if model.nu() > 0 { self.physics.read("actuator_force")? } else { Vec::new() };
        let efforts = match self.row_drives.len() {
            0 => Vec::new(),
            width => self.read("effort", width)?,
        };
        let num_envs = self.patches.len();
        let actuators = forces.len() / num_envs;
        if forces.len() % num_envs > 0 || table_width(&self.table) > actuators {
            return Err(DeviceError::Failed(format!("actuator_force has {} numbers", forces.len())));
        }
        let mut ended = vec![None; num_envs];
        for (env, step, reason) in &report.diverged {
            if let Some(ended) = ended.get_mut(*env) {
                *ended = Some((*step, reason));
            }
        }
        let (sent, table, row_drives) = (&mut self.sent, &self.table, &self.row_drives);
        let mut effort = Vec::new();
        rows.for_each(&mut |env, row| {
            if row.diverged.is_some() {
                // The device steps on. The row is sent again once the environment runs.
                forget(sent, env);
                return;
            }
            let done = ended[env].map_or(u64::from(count), |(step, _)| step);
            let [time, qpos, qvel, act, warm_start] = row.motion.parts_mut(model);
            for _ in 0..done {
                time[0] += model.timestep();
            }
            for array in sent.iter().filter(|array| array.input.is_state()) {
                let to = match array.input {
                    Input::Positions => &mut *qpos,
                    Input::Velocities => &mut *qvel,
                    Input::Activations => &mut *act,
                    _ => &mut *warm_start,
                };
                copy(&array.values, env, to);
            }
            debug_assert_eq!(act.len(), na);
            let [to_qacc, to_actuator, to_constraint, to_forces] = row.solved.parts_mut(model);
            for (from, to) in solved.iter().zip([to_qacc, to_actuator, to_constraint]) {
                copy(from, env, to);
            }
            if to_forces.len() == actuators {
                copy(&forces, env, to_forces);
            }
            effort.clear();
            effort.extend(table.drives.iter().map(|drive| f64::from(forces[env * actuators + drive.ctrl])));
            for (k, &drive) in row_drives.iter().enumerate() {
                effort[drive] = f64::from(efforts[env * row_drives.len() + k]);
            }
            row.drives.finish_step(&effort);
            row.steps = row.steps.saturating_add(done);
            row.solved_current = false;
            row.is_forward_counted = false;
            row.is_pass_impossible = false;
            // No `mjData` holds this row any longer.
            row.version = 0;
            row.cold.captured.clear();
            if let Some((_, reason)) = ended[env] {
                row.diverged = Some(Box::new(EnvStatus::Diverged { step: row.steps, reason: divergence(reason) }));
                forget(sent, env);
            }
        });
        Ok(())
    }

    /// Writes what the device captured to the rows.
    fn receive_capture(
        &mut self,
        model: &Model,
        capture: &CaptureRequest,
        rows: &dyn EnvRows,
    ) -> Result<(), DeviceError> {
        let nbody = model.nbody();
        let contacts = if capture.fields.contains(StateFields::CONTACTS) {
            let numbers = self.physics.read("contacts")?;
            contacts_by_env(numbers.as_chunks::<CONTACT_NUMBERS>().0, self.patches.len())
        } else {
            Vec::new()
        };
        let motion = !capture.fields.intersection(StateFields::ACCELERATIONS | StateFields::JOINT_WRENCHES).is_empty();
        let names = [("xpos", 3), ("xquat", 4), ("cvel", 6), ("subtree_com", 3), ("cacc", 6), ("cfrc_int", 6)];
        let mut arrays = Vec::new();
        for (name, width) in names.into_iter().filter(|_| motion) {
            let needed = name != "cfrc_int" || capture.fields.contains(StateFields::JOINT_WRENCHES);
            arrays.push(if needed { self.read(name, width * nbody)? } else { Vec::new() });
        }
        rows.for_each(&mut |env, row| {
            if row.diverged.is_some() {
                return;
            }
            let gravity = StoredRow { row, model }.gravity();
            let solved = &mut row.cold.captured;
            if let Some(contacts) = contacts.get(env) {
                capture.capture_contacts(contacts, solved);
            }
            if motion {
                let bodies = DeviceBodies::new(&arrays, env, model);
                capture.capture_motion(&bodies, gravity, solved);
            }
        });
        Ok(())
    }
}

/// Number of controls that drives have.
fn table_width(table: &DriveTable) -> usize {
    table.drives.iter().map(|drive| drive.ctrl + 1).max().unwrap_or(0)
}

/// Makes the next step send the state of an environment.
fn forget(sent: &mut [Sent], env: usize) {
    for array in sent.iter_mut().filter(|array| array.input.is_state()) {
        array.values[env * array.width..(env + 1) * array.width].fill(f32::NAN);
    }
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
