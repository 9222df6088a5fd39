//! Inputs of the device, and what the device has of them for the environments of a chunk.

use crate::drive::actuator;
use crate::drive::gains::Gains;
use crate::drive::table::{CowArray, DriveTable, Realization};
use crate::row::{EnvRow, StoredRow, prefetch_after};
use kinetoscope_mujoco::{BodyInputs, Model, ModelPatch};
use std::ops::Range;
use std::sync::Arc;

/// Largest effort in single precision, for drives without a limit: products with it stay finite.
const UNLIMITED: f64 = 1e9;

/// Input of the device with a row per environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Input {
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
    /// All inputs, in the order in which they are written.
    pub(super) const ALL: [Self; 16] = [
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
    pub(super) fn name(self) -> &'static str {
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

    /// Index in [`STATE`] of an array of the state, which steps of the device change.
    fn state_index(self) -> Option<usize> {
        STATE.iter().position(|state| *state == self)
    }

    /// Numbers per environment.
    fn width(self, model: &Model, table: &DriveTable, row_drives: &[usize]) -> usize {
        match self {
            Self::Positions => model.nq(),
            Self::Velocities | Self::WarmStart | Self::JointForces => model.nv(),
            Self::Activations => model.na(),
            Self::Controls => model.nu(),
            Self::BodyForces => 6 * model.nbody(),
            Self::MocapPositions => 3 * model.nmocap(),
            Self::MocapOrientations => 4 * model.nmocap(),
            Self::Stiffness
            | Self::Damping
            | Self::MaxEffort
            | Self::TargetPosition
            | Self::TargetVelocity
            | Self::Feedforward => row_drives.len(),
            Self::ViscousDamping => table.damped.len(),
        }
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

/// The state, in the order of [`IntegrationState::parts_mut`](kinetoscope_mujoco::IntegrationState::parts_mut).
pub(super) const STATE: [Input; 4] = [Input::Positions, Input::Velocities, Input::Activations, Input::WarmStart];

/// Inputs that a scene has, with their places among the numbers of an environment.
#[derive(Debug, Default)]
pub(super) struct Layout {
    inputs: Vec<(Input, Range<usize>)>,
    /// Drives with a constraint row.
    row_drives: Vec<usize>,
}

impl Layout {
    pub(super) fn new(model: &Model, table: &DriveTable) -> Self {
        let drives = table.drives.iter().enumerate();
        let rows = drives.filter(|(_, drive)| drive.realization == Realization::ConstraintRow);
        let row_drives: Vec<usize> = rows.map(|(index, _)| index).collect();
        let mut inputs = Vec::new();
        let mut first = 0;
        for input in Input::ALL {
            let last = first + input.width(model, table, &row_drives);
            if last > first {
                inputs.push((input, first..last));
            }
            first = last;
        }
        Self { inputs, row_drives }
    }

    /// The inputs, in the order in which they are written.
    pub(super) fn inputs(&self) -> impl ExactSizeIterator<Item = Input> {
        self.inputs.iter().map(|(input, _)| *input)
    }

    /// Drives with a constraint row.
    pub(super) fn row_drives(&self) -> &[usize] {
        &self.row_drives
    }

    /// Numbers of an environment.
    fn width(&self) -> usize {
        self.inputs.last().map_or(0, |(_, places)| places.end)
    }
}

/// Extent to which rows may have changed since the device got them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Changes {
    /// Nothing changed.
    #[default]
    None,
    /// Everything but the state may have changed.
    Inputs,
    /// Everything may have changed.
    All,
}

/// Inputs of the environments of a chunk that the device has. Empty before the first step.
#[derive(Debug, Default)]
pub(crate) struct SentRows {
    /// Inputs, except states, that the device has: input by input, with a row per environment. NaN before the first write.
    /// States are those that changed.
    values: Vec<f32>,
    envs: Vec<SentEnv>,
    scratch: Vec<f32>,
}

/// Bit of [`SentEnv::changed`] for the model.
const MODEL: u32 = 1 << 31;

/// State of the copy of an environment on the device.
#[derive(Debug, Default)]
pub(super) struct SentEnv {
    /// Bit k: the input with index k in the layout changed and is not yet sent. The bit [`MODEL`]: so did the model.
    changed: u32,
    /// True if the state on the device is that of the row. False for an environment that was never sent, or that diverged
    /// and which the device steps on or froze.
    has_state: bool,
    /// Arrays of the last write that other environments have too.
    shared: SharedInputs,
    /// Differences of the model of the environment.
    patch: Option<Arc<ModelPatch>>,
    /// Time \[s\] and steps of the state in the row, while those of the row are newer.
    clock: Option<(f64, u64)>,
}

/// Arrays that several environments have. An array in this list cannot change in place, because it has another owner.
#[derive(Debug, Default)]
struct SharedInputs {
    gains: Option<CowArray<Gains>>,
    velocity: Option<CowArray<f64>>,
    feedforward: Option<CowArray<f64>>,
    applied: Option<CowArray<f64>>,
    damping: Option<CowArray<f64>>,
    bodies: Option<Arc<BodyInputs>>,
}

impl SharedInputs {
    /// True if the array of an input in `row` is the one in this list, so that its numbers need no comparison.
    fn has(&self, input: Input, row: &EnvRow) -> bool {
        fn is<T>(own: Option<&CowArray<T>>, other: &CowArray<T>) -> bool {
            own.is_some_and(|own| own.is_same(other))
        }
        let drives = &row.drives;
        match input {
            Input::Stiffness | Input::Damping | Input::MaxEffort => is(self.gains.as_ref(), &drives.gains),
            Input::TargetVelocity => is(self.velocity.as_ref(), &drives.velocity),
            Input::Feedforward => is(self.feedforward.as_ref(), &drives.feedforward),
            Input::JointForces => is(self.applied.as_ref(), &drives.applied),
            Input::ViscousDamping => is(self.damping.as_ref(), drives.damping()),
            Input::BodyForces | Input::MocapPositions | Input::MocapOrientations => {
                is_same(self.bodies.as_ref(), Some(&row.body_inputs))
            }
            Input::Positions
            | Input::Velocities
            | Input::Activations
            | Input::WarmStart
            | Input::Controls
            | Input::TargetPosition => false,
        }
    }

    /// Takes over the shared arrays of `row`. An array that the environment has alone is left out: with another owner, the
    /// next write would copy it.
    fn update(&mut self, row: &EnvRow) {
        fn keep<T: Clone>(own: &mut Option<CowArray<T>>, other: &CowArray<T>) {
            if !own.as_ref().is_some_and(|own| own.is_same(other)) {
                *own = other.is_shared().then(|| other.clone());
            }
        }
        let drives = &row.drives;
        keep(&mut self.gains, &drives.gains);
        keep(&mut self.velocity, &drives.velocity);
        keep(&mut self.feedforward, &drives.feedforward);
        keep(&mut self.applied, &drives.applied);
        keep(&mut self.damping, drives.damping());
        if !is_same(self.bodies.as_ref(), Some(&row.body_inputs)) {
            self.bodies = (Arc::strong_count(&row.body_inputs) > 1).then(|| Arc::clone(&row.body_inputs));
        }
    }
}

/// Rows of an input to be written to the device.
#[derive(Debug, Default)]
pub(super) struct Write {
    pub(super) envs: Vec<i32>,
    pub(super) values: Vec<f32>,
}

impl Write {
    pub(super) fn clear(&mut self) {
        self.envs.clear();
        self.values.clear();
    }
}

impl SentRows {
    /// Compares the rows of the chunk with what the device has, and notes what is to be sent. `states` are the arrays of
    /// [`STATE`] on the device, of which `first` is the first environment of the chunk.
    pub(super) fn compare(
        &mut self,
        layout: &Layout,
        model: &Model,
        rows: &[Box<EnvRow>],
        first: usize,
        changes: Changes,
        states: &[Vec<f32>; 4],
    ) {
        if self.envs.is_empty() {
            self.envs.resize_with(rows.len(), SentEnv::default);
            self.values.resize(layout.width() * rows.len(), f32::NAN);
        }
        for (k, row) in rows.iter().enumerate() {
            prefetch_after(rows, k, EnvRow::prefetch_inputs);
            let env = &mut self.envs[k];
            if row.diverged.is_some() {
                env.has_state = false;
                continue;
            }
            let row = StoredRow { row, model };
            for (index, (input, places)) in layout.inputs.iter().enumerate() {
                let state = input.state_index();
                let is_known = match state {
                    Some(_) => env.has_state && changes < Changes::All,
                    None => env.shared.has(*input, row.row),
                };
                if is_known {
                    continue;
                }
                self.scratch.clear();
                input.append(&row, &layout.row_drives, &mut self.scratch);
                let width = places.len();
                let mine = &mut self.values[places.start * rows.len() + k * width..][..width];
                let known = match state {
                    Some(state) if env.has_state => states[state].get((first + k) * width..(first + k + 1) * width),
                    Some(_) => None,
                    None => Some(&*mine),
                };
                if !known.is_some_and(|known| has_bits(known, &self.scratch)) {
                    mine.copy_from_slice(&self.scratch);
                    env.changed |= 1 << index;
                }
            }
            env.has_state = true;
            env.shared.update(row.row);
            if !is_same(env.patch.as_ref(), row.row.patch.as_ref()) {
                env.changed |= MODEL;
            }
        }
    }

    /// Appends what is to be sent to `writes`, in the order of the inputs of `layout`. `first` is the first environment of
    /// the chunk.
    pub(super) fn take_writes(&mut self, layout: &Layout, first: usize, writes: &mut [Write]) {
        let count = self.envs.len();
        let (mut any, mut all) = (0, u32::MAX);
        for env in &self.envs {
            any |= env.changed;
            all &= env.changed;
        }
        for (index, ((_, places), write)) in layout.inputs.iter().zip(writes).enumerate() {
            let (bit, width) = (1 << index, places.len());
            let rows = &self.values[places.start * count..places.end * count];
            if all & bit != 0 {
                write.envs.extend((first..first + count).map(|env| env as i32));
                write.values.extend_from_slice(rows);
            } else if any & bit != 0 {
                for (k, _) in self.envs.iter().enumerate().filter(|(_, env)| env.changed & bit != 0) {
                    write.envs.push((first + k) as i32);
                    write.values.extend_from_slice(&rows[k * width..(k + 1) * width]);
                }
            }
        }
        self.envs.iter_mut().for_each(|env| env.changed = 0);
    }

    /// Indices, in the chunk, of the environments whose model changed.
    pub(super) fn changed_models(&self) -> Vec<usize> {
        self.envs.iter().enumerate().filter(|(_, env)| env.changed & MODEL != 0).map(|(k, _)| k).collect()
    }

    /// Takes over the model of the environment at index `k` of the chunk. Returns that of the last call.
    pub(super) fn replace_patch(&mut self, k: usize, patch: Option<&Arc<ModelPatch>>) -> Option<Arc<ModelPatch>> {
        std::mem::replace(&mut self.envs[k].patch, patch.cloned())
    }

    /// True if the device has the state of the environment at index `k` of the chunk.
    pub(crate) fn has_state(&self, k: usize) -> bool {
        self.envs.get(k).is_some_and(|env| env.has_state)
    }

    /// Keeps the time \[s\] and the steps of the state in the row at index `k` of the chunk, unless older ones are kept.
    pub(super) fn keep_clock(&mut self, k: usize, time: f64, steps: u64) {
        if let Some(env) = self.envs.get_mut(k) {
            env.clock.get_or_insert((time, steps));
        }
    }

    /// Takes what [`keep_clock`](Self::keep_clock) kept.
    pub(super) fn take_clock(&mut self, k: usize) -> Option<(f64, u64)> {
        self.envs.get_mut(k).and_then(|env| env.clock.take())
    }

    /// Makes the step that follows the next change of the environment at index `k` of the chunk send its state.
    pub(super) fn forget_state(&mut self, k: usize) {
        if let Some(env) = self.envs.get_mut(k) {
            env.has_state = false;
        }
    }
}

/// True if both are the same object, or absent.
fn is_same<T>(one: Option<&Arc<T>>, other: Option<&Arc<T>>) -> bool {
    match (one, other) {
        (None, None) => true,
        (Some(one), Some(other)) => Arc::ptr_eq(one, other),
        _ => false,
    }
}

/// True if the numbers are equal, bit for bit.
fn has_bits(one: &[f32], other: &[f32]) -> bool {
    one.iter().map(|x| x.to_bits()).eq(other.iter().map(|x| x.to_bits()))
}
