//! The rows of all environments and their copies on a device.

use super::captured::{CONTACT_NUMBERS, DeviceBodies, contacts_by_env};
use super::{DeviceError, DevicePhysics, DeviceScene, StepReport};
use crate::capture::CaptureRequest;
use crate::drive::actuator;
use crate::drive::table::{DriveTable, Realization};
use crate::env::{Divergence, EnvStatus};
use crate::row::{EnvRow, StoredRow};
use kinetoscope_mujoco::{EngineError, Model, ModelPatch, NumberArray, Warning};
use kinetoscope_scene::StateFields;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest effort in single precision, for drives without a limit: products with it stay finite.
const UNLIMITED: f64 = 1e9;

/// Arrays of the model that can differ between the environments of a device.
const MODEL_ARRAYS: [NumberArray; 15] = [
    NumberArray::BODY_MASS,
    NumberArray::BODY_SUBTREEMASS,
    NumberArray::BODY_INERTIA,
    NumberArray::BODY_IPOS,
    NumberArray::BODY_IQUAT,
    NumberArray::BODY_POS,
    NumberArray::BODY_QUAT,
    NumberArray::BODY_INVWEIGHT0,
    NumberArray::DOF_ARMATURE,
    NumberArray::DOF_DAMPING,
    NumberArray::DOF_FRICTIONLOSS,
    NumberArray::DOF_INVWEIGHT0,
    NumberArray::TENDON_FRICTIONLOSS,
    NumberArray::TENDON_INVWEIGHT0,
    NumberArray::GEOM_FRICTION,
];

/// Arrays that change together with properties and that the physics of the device does not read.
const UNREAD_ARRAYS: [&str; 8] = [
    "actuator_acc0",
    "actuator_length0",
    "cam_pos0",
    "cam_poscom0",
    "dof_M0",
    "geom_rgba",
    "light_pos0",
    "light_poscom0",
];

/// Input of the device with a row per environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Input {
    Positions,
    Velocities,
    Activations,
    WarmStart,
    Controls,
    JointForces,
    BodyForces,
    MocapPositions,
    MocapOrientations,
    Stiffness,
    Damping,
    MaxEffort,
    TargetPosition,
    TargetVelocity,
    Feedforward,
    ViscousDamping,
}

impl Input {
    const ALL: [Self; 16] = [
        Self::Positions,
        Self::Velocities,
        Self::Activations,
        Self::WarmStart,
        Self::Controls,
        Self::JointForces,
        Self::BodyForces,
        Self::MocapPositions,
        Self::MocapOrientations,
        Self::Stiffness,
        Self::Damping,
        Self::MaxEffort,
        Self::TargetPosition,
        Self::TargetVelocity,
        Self::Feedforward,
        Self::ViscousDamping,
    ];

    /// Name of the array on the device.
    fn name(self) -> &'static str {
        match self {
            Self::Positions => "qpos",
            Self::Velocities => "qvel",
            Self::Activations => "act",
            Self::WarmStart => "qacc_warmstart",
            Self::Controls => "ctrl",
            Self::JointForces => "qfrc_applied",
            Self::BodyForces => "xfrc_applied",
            Self::MocapPositions => "mocap_pos",
            Self::MocapOrientations => "mocap_quat",
            Self::Stiffness => "stiffness",
            Self::Damping => "damping",
            Self::MaxEffort => "max_effort",
            Self::TargetPosition => "target_position",
            Self::TargetVelocity => "target_velocity",
            Self::Feedforward => "feedforward",
            Self::ViscousDamping => "viscous_damping",
        }
    }

    /// True for the state, which steps of the device change.
    fn is_state(self) -> bool {
        matches!(self, Self::Positions | Self::Velocities | Self::Activations | Self::WarmStart)
    }

    /// Appends the values in a row of the batch to `out`.
    fn append(self, row: &StoredRow<'_>, rows: &[usize], out: &mut Vec<f32>) {
        let (drives, model) = (&row.row.drives, row.model);
        let mut put = |values: &[f64]| out.extend(values.iter().map(|x| *x as f32));
        match self {
            Self::Positions => put(row.raw_qpos()),
            Self::Velocities => put(row.qvel()),
            Self::Activations => put(row.row.motion.act(model)),
            Self::WarmStart => put(row.qacc_warmstart()),
            Self::JointForces => put(&drives.applied),
            Self::BodyForces => put(row.row.body_inputs.xfrc_applied(model)),
            Self::MocapPositions => put(row.row.body_inputs.mocap(model).0),
            Self::MocapOrientations => put(row.row.body_inputs.mocap(model).1),
            Self::Controls => {
                let first = out.len();
                out.extend(row.ctrl().iter().map(|x| *x as f32));
                for (i, drive) in drives.table().drives.iter().enumerate() {
                    let target = drives.target(i);
                    out[first + drive.ctrl] = match drive.realization {
                        Realization::Actuator => actuator::control(&drives.gains[i], &target),
                        Realization::ConstraintRow | Realization::Explicit { .. } => target.position,
                    } as f32;
                }
            }
            Self::Stiffness => out.extend(rows.iter().map(|&i| drives.gains[i].kp as f32)),
            Self::Damping => out.extend(rows.iter().map(|&i| drives.gains[i].kd as f32)),
            Self::MaxEffort => out.extend(rows.iter().map(|&i| drives.gains[i].max_effort.min(UNLIMITED) as f32)),
            Self::TargetPosition => out.extend(rows.iter().map(|&i| drives.position[i] as f32)),
            Self::TargetVelocity => out.extend(rows.iter().map(|&i| drives.velocity[i] as f32)),
            Self::Feedforward => out.extend(rows.iter().map(|&i| drives.feedforward[i] as f32)),
            Self::ViscousDamping => put(drives.damping()),
        }
    }
}

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

/// Writes of arrays of the model: environments and their rows, by the name of the array.
type ModelWrites = BTreeMap<&'static str, (Vec<i32>, Vec<f32>)>;

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

/// Adds the arrays in which the model of an environment changed.
fn add_model_writes(
    env: usize,
    row: &StoredRow<'_>,
    before: Option<&ModelPatch>,
    writes: &mut ModelWrites,
) -> Result<(), DeviceError> {
    let now = row.row.patch.as_deref();
    let mut names: Vec<&str> =
        before.into_iter().chain(now).flat_map(|patch| patch.arrays().map(|(name, _)| name)).collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        if let Some(array) = MODEL_ARRAYS.into_iter().find(|array| array.name() == name) {
            let (envs, values) = writes.entry(array.name()).or_default();
            envs.push(env as i32);
            values.extend(array.all(row.model, now).iter().map(|x| *x as f32));
        } else if !UNREAD_ARRAYS.contains(&name) {
            let names: Vec<&str> = MODEL_ARRAYS.iter().map(|array| array.name()).collect();
            return Err(DeviceError::Unsupported {
                what: format!("own values of `{name}` in environment {env}"),
                expected: format!("it can randomize {} and gravity", names.join(", ")),
            });
        }
    }
    let gravity = |patch: Option<&ModelPatch>| patch.map_or_else(|| row.model.gravity(), ModelPatch::gravity);
    if gravity(before) != gravity(now) {
        let (envs, values) = writes.entry("gravity").or_default();
        envs.push(env as i32);
        values.extend(gravity(now).map(|x| x as f32));
    }
    Ok(())
}
