//! A loaded environment: its `mjData`, its stored state (row), and the recovery from failed steps.
//!
//! A step is `mj_step1 -> drives -> mj_step2`, and `mj_step1 -> drives -> mj_step` with RK4. The forward pass `mj_step1`
//! runs when a step or a read needs it: a state without reads between two steps gets one pass. A step that
//! overflows a buffer is repeated from its start state with doubled buffers, so its result equals that of large buffers
//! from the beginning. A step that ends in a non-finite state is undone, and the environment stays frozen until it is
//! reset.

mod step;

use crate::drive::table::{DriveState, DriveTable};
use crate::row::EnvRow;
use crate::wrenches::Wrenches;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{
    BodyInputs, Buffers, Data, EngineError, IntegrationState, Model, ModelPatch, SolvedState, UnnormalizedQuats,
    UserInputs, Warning, WarningCounts, Weld,
};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Status of an environment: running or diverged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EnvStatus {
    /// The environment runs.
    Running,
    /// A step failed, or a written state was rejected. The environment stays in its last valid state until it is reset.
    Diverged {
        /// Number of completed MuJoCo steps since the last reset.
        step: u64,
        /// Reason of the failure.
        reason: Divergence,
    },
}

/// Reason of a divergence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Divergence {
    /// A position, velocity or acceleration is not finite or too large: MuJoCo's warning.
    Warning(Warning),
    /// MuJoCo's engine reported an error.
    Engine(EngineError),
    /// Contacts or constraints need more memory than the limit of an environment, 2 GiB.
    BuffersExhausted {
        /// Sizes that the buffers would have grown to.
        buffers: Buffers,
        /// Names of the bodies with the most contacts in MuJoCo's model, at most ten, without the world. Empty in a status
        /// that was read from a file.
        bodies: Vec<String>,
    },
}

impl std::fmt::Display for Divergence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Warning(warning) => write!(f, "{}", warning.name()),
            Self::Engine(error) => write!(f, "{error}"),
            Self::BuffersExhausted { buffers, bodies } => {
                let Buffers { contacts, constraints, .. } = buffers;
                write!(f, "{contacts} contacts or {constraints} constraint rows do not fit into 2 GiB; ")?;
                write!(f, "expected fewer bodies that overlap")?;
                if bodies.is_empty() { Ok(()) } else { write!(f, "; most contacts: {}", bodies.join(", ")) }
            }
        }
    }
}

/// Lowest bit of the slot in a version of a row.
const SLOT_SHIFT: u32 = 44;

/// Part of a step that the data of an environment contains for the current state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// The state alone, with quaternions that are not normalized.
    Raw,
    /// The state, with quaternions as they are after a forward pass.
    State,
    /// Poses and velocities of bodies, and poses of geoms and sites.
    Bodies,
    /// Poses and velocities of bodies, geoms, sites, cameras, lights and tendons.
    Kinematics,
    /// All of `mj_step1`.
    Forward,
}

/// An environment in working memory: an `mjData` and the row of the environment.
///
/// A batch has one per thread, which takes one row after the other. An environment of its own keeps its row.
#[derive(Debug)]
pub struct SimEnv {
    data: Data,
    /// The compiled model with the buffer sizes of `data`, without a patch.
    base: Model,
    /// Memory of a model with a patch, while `data` has the shared model.
    patched: Option<Model>,
    row: Box<EnvRow>,
    stage: Stage,
    /// Quaternions before the last forward pass, above [`Stage::Raw`]; the rest of the state is in `data`.
    raw_quats: UnnormalizedQuats,
    /// Number of times a buffer was doubled, in all working memory of a batch.
    buffer_growths: Arc<AtomicU64>,
    /// Memory of `data` above which its buffers no longer grow \[bytes\].
    max_bytes: usize,
    /// Version of the row of which `data` still holds everything, or 0; see [`EnvRow::version`].
    held: u64,
    /// Inputs of bodies that `data` has, bit for bit, while that is known: those of the row. A step does not change them.
    loaded_inputs: Option<Arc<BodyInputs>>,
    /// Efforts of the drives in a step, which are kept only if the step succeeds.
    efforts: Vec<f64>,
    /// Last version that this environment gave to a row. The upper bits differ between the environments of a batch.
    last_version: u64,
}

impl std::ops::Deref for SimEnv {
    type Target = EnvRow;

    fn deref(&self) -> &EnvRow {
        &self.row
    }
}

impl std::ops::DerefMut for SimEnv {
    fn deref_mut(&mut self) -> &mut EnvRow {
        &mut self.row
    }
}

impl SimEnv {
    /// Creates an environment in the model's initial state and runs `mj_step1`.
    ///
    /// # Errors
    /// MuJoCo cannot allocate its data.
    pub fn new(model: &Model, drives: &Arc<DriveTable>) -> Result<Self, EngineError> {
        Self::with_drives(model, DriveState::new(drives, model))
    }

    /// Creates an environment as [`new`](Self::new) does, with a given drive state. Clones of one drive state share
    /// their unmodified arrays.
    pub(crate) fn with_drives(model: &Model, drives: DriveState) -> Result<Self, EngineError> {
        let mut env = Self {
            data: Data::new(model)?,
            base: model.without_patch(),
            patched: None,
            row: Box::new(EnvRow { patch: model.patch().cloned(), ..EnvRow::new(drives) }),
            stage: Stage::Raw,
            raw_quats: UnnormalizedQuats::new(model),
            buffer_growths: Arc::default(),
            max_bytes: step::MAX_ENV_BYTES,
            held: 0,
            loaded_inputs: None,
            efforts: Vec::new(),
            last_version: 0,
        };
        let initial = env.current_motion();
        env.accept(&initial);
        env.forward(&initial);
        Ok(env)
    }

    /// Creates working memory for the rows of a batch, with the row and the buffer sizes of `self`. `slot` differs from
    /// that of all others in the batch.
    pub(crate) fn for_slot(&self, slot: usize) -> Result<Self, EngineError> {
        Ok(Self {
            data: Data::new(&self.base)?,
            base: self.base.clone(),
            patched: None,
            row: self.row.clone(),
            stage: Stage::Raw,
            raw_quats: self.raw_quats.clone(),
            buffer_growths: Arc::clone(&self.buffer_growths),
            max_bytes: self.max_bytes,
            held: 0,
            loaded_inputs: None,
            efforts: Vec::new(),
            last_version: Self::first_version(slot),
        })
    }

    /// The smallest version of the working memory with this slot.
    pub(crate) fn first_version(slot: usize) -> u64 {
        (slot as u64) << SLOT_SHIFT
    }

    /// Slot of the working memory that gave `version` to a row; 0 for a row that was never in use.
    pub(crate) fn slot_of(version: u64) -> usize {
        (version >> SLOT_SHIFT) as usize
    }

    /// The row of this environment, with its current state. Further environments start as copies of it.
    pub(crate) fn saved_row(&mut self) -> &EnvRow {
        self.save_row();
        &self.row
    }

    /// Exchanges the row of this environment, which is not used, for `other`, and restores the latter into the data
    /// unless the data still belongs to it. Results of the last solve are restored only if `with_results`: a step
    /// replaces them.
    pub(crate) fn load(&mut self, other: &mut Box<EnvRow>, with_results: bool) {
        std::mem::swap(&mut self.row, other);
        let row = &mut *self.row;
        let edited = std::mem::take(&mut row.inputs_are_edited);
        if self.held != 0 && self.held == row.version {
            if edited {
                row.restore_inputs(&mut self.data);
                self.renew_version();
            }
            return;
        }
        self.apply_patch();
        let row = &mut *self.row;
        row.joint_inputs.restore(&mut self.data);
        if !self.loaded_inputs.as_ref().is_some_and(|loaded| Arc::ptr_eq(loaded, &row.body_inputs)) {
            self.loaded_inputs = None;
            row.body_inputs.restore(&mut self.data);
            // MuJoCo normalizes the orientations of mocap bodies in place, and wrenches are written in every step.
            let is_constant = self.data.mocap_quat().is_empty() && row.wrenches.is_none();
            self.loaded_inputs = is_constant.then(|| Arc::clone(&row.body_inputs));
        }
        row.motion.restore(&mut self.data);
        if with_results || self.data.model().has_history() {
            row.solved.restore(&mut self.data);
        }
        self.stage = Stage::Raw;
        if edited || row.version == 0 {
            self.renew_version();
        } else {
            self.held = row.version;
        }
    }

    /// Gives the row a new version, which the data belongs to.
    fn renew_version(&mut self) {
        self.last_version += 1;
        (self.row.version, self.held) = (self.last_version, self.last_version);
    }

    /// Ends a [`load`](Self::load) in which the environment may have changed: saves the row under a new version, and
    /// returns it to `other`.
    pub(crate) fn store(&mut self, other: &mut Box<EnvRow>) {
        self.save_row();
        self.renew_version();
        std::mem::swap(&mut self.row, other);
    }

    /// Ends a [`load`](Self::load) in which only quantities were computed.
    pub(crate) fn put_back(&mut self, other: &mut Box<EnvRow>) {
        if self.held != self.row.version {
            // The forward pass changed the data.
            self.save_row();
            self.renew_version();
        }
        std::mem::swap(&mut self.row, other);
    }

    /// Saves the state in the row.
    fn save_row(&mut self) {
        self.save_motion();
        self.row.solved.save(&self.data);
        self.row.joint_inputs.save(&self.data);
        match &self.loaded_inputs {
            None => self.row.save_body_inputs(&self.data),
            Some(loaded) => debug_assert!(
                Arc::ptr_eq(loaded, &self.row.body_inputs) && loaded.matches(&self.data),
                "inputs of bodies changed without `disown`"
            ),
        }
    }

    /// Notes that the data no longer belongs to the row, and that its inputs may have changed.
    fn disown(&mut self) {
        self.held = 0;
        self.loaded_inputs = None;
    }

    /// Sets results of the last solve that the row does not have to zero.
    pub(crate) fn clear_unsaved_results(&mut self) {
        self.data.clear_unsaved_results();
    }

    /// MuJoCo data: the state after the last step or the last write.
    pub fn data(&self) -> &Data {
        &self.data
    }

    /// Writes state or inputs, then runs `mj_step1`, which updates all quantities that depend on positions and
    /// velocities. Accelerations and forces keep the values of the last step. A state that is not finite, too large, or
    /// fails in `mj_step1` is rejected. Then the state before the write is restored, and the environment is marked as
    /// diverged. Every step overwrites `qfrc_applied` and the controls of drives from [`DriveState`].
    pub fn write(&mut self, change: impl FnOnce(&mut Data)) {
        let good = self.change(change);
        self.forward(&good);
    }

    /// Writes state or inputs as [`write`](Self::write) does, without the forward pass: derived quantities are those
    /// before the write until the next [`reach`](Self::reach).
    pub(crate) fn write_state(&mut self, change: impl FnOnce(&mut Data)) {
        self.change(change);
    }

    /// Writes and checks a state. Returns the state before.
    fn change(&mut self, change: impl FnOnce(&mut Data)) -> IntegrationState {
        // Quaternions that `change` leaves alone must be normalized once, not twice.
        self.make_raw();
        let good = self.current_motion();
        change(&mut self.data);
        self.row.solved_current = true;
        self.accept(&good);
        good
    }

    /// Lends the data to code that may call any function of MuJoCo, with a forward pass done. Then checks the state that
    /// it wrote, as [`write_state`](Self::write_state) does. Results of the last solve that the row does not have are
    /// zero. Nothing that the code leaves behind besides state, inputs and results of the solve reaches other
    /// environments: neither another model, nor a failed call of MuJoCo.
    ///
    /// Returns `None` if the code exchanged the data for data of another scene or other buffer sizes; then nothing is
    /// written.
    ///
    /// # Panics
    /// `write` panics; then nothing is written.
    pub(crate) fn lend<T>(&mut self, write: impl FnOnce(&mut Data) -> T) -> Option<T> {
        self.reach(Stage::Forward);
        self.data.clear_unsaved_results();
        self.make_raw();
        let before = SavedData::of(self);
        let model = self.data.model().clone();
        let written = catch_unwind(AssertUnwindSafe(|| write(&mut self.data)));
        if !self.data.model().is_compatible_with(&model) {
            // The data that this thread had is gone.
            self.data = Data::new(&model).expect("MuJoCo allocated data of this model before");
            before.restore(&mut self.data);
            return written.map_or_else(|panic| resume_unwind(panic), |_| None);
        }
        self.data.set_model(model);
        let raised = self.data.take_warnings();
        let after = SavedData::of(self);
        // Ends the effects of a failed call.
        self.data.reset();
        let written = written.unwrap_or_else(|panic| {
            before.restore(&mut self.data);
            resume_unwind(panic)
        });
        after.restore(&mut self.data);
        self.row.solved_current = true;
        self.accept_after(&before.motion, raised);
        Some(written)
    }

    /// Removes the normalization of quaternions. Derived quantities stay until the next forward pass.
    fn make_raw(&mut self) {
        if self.stage > Stage::Raw {
            self.raw_quats.restore(&mut self.data);
            self.stage = Stage::Raw;
        }
        self.disown();
    }

    /// Sets the differences of the environment's model from the compiled one. Welds stay.
    #[cfg(test)]
    pub(crate) fn set_patch(&mut self, patch: Option<&Arc<ModelPatch>>) {
        self.make_raw();
        self.row.set_patch(patch, &self.base);
        self.apply_patch();
        self.row.save_written(&self.data);
    }

    /// Gives the data the model of the row: the shared one, or one with the patch of the row. The memory of the last
    /// model with a patch is reused, so only the words that differ are written.
    fn apply_patch(&mut self) {
        let current = self.data.model().patch();
        let Some(patch) = &self.row.patch else {
            if current.is_some() {
                self.patched = Some(self.data.replace_model(self.base.clone()));
            }
            return;
        };
        if current.is_some_and(|current| Arc::ptr_eq(current, patch)) {
            return;
        }
        let memory = match self.patched.take() {
            Some(model) => model,
            None if current.is_some() => self.data.replace_model(self.base.clone()),
            None => self.base.clone(),
        };
        self.data.set_model(memory.patched(patch));
    }

    /// Attaches these welds, and releases all others.
    pub(crate) fn set_welds(&mut self, welds: Vec<Weld>) {
        if welds == self.row.cold.welds {
            return;
        }
        self.make_raw();
        let good = self.current_motion();
        self.replace_welds(welds);
        self.row.solved_current = true;
        self.accept(&good);
    }

    /// Attaches these welds and releases all others, without a forward pass.
    fn replace_welds(&mut self, welds: Vec<Weld>) {
        if welds == self.row.cold.welds {
            return;
        }
        for weld in &self.row.cold.welds {
            self.data.set_equality_active(weld.equality, false);
        }
        self.row.patch = ModelPatch::with_welds(self.row.patch.as_ref(), &self.base, &welds);
        self.apply_patch();
        for weld in &welds {
            self.data.set_equality_active(weld.equality, true);
        }
        self.row.cold.welds = welds;
    }

    /// Sets controls. They are not part of the state, so no forward pass is needed.
    pub(crate) fn set_controls(&mut self, change: impl FnOnce(&mut [f64])) {
        self.disown();
        change(self.data.ctrl_mut());
        self.row.save_written(&self.data);
    }

    /// Changes external wrenches. They are not part of the state, so no forward pass is needed. A wrench in link axes
    /// needs the poses of the current state.
    pub(crate) fn set_wrenches(&mut self, change: impl FnOnce(&mut Wrenches)) {
        self.disown();
        let Self { data, row, .. } = self;
        let wrenches = row.wrenches.get_or_insert_default();
        wrenches.clear(data);
        change(wrenches);
        wrenches.apply(data);
        if **wrenches == Wrenches::default() {
            row.wrenches = None;
        }
        row.save_written(data);
    }

    /// Writes the efforts of drives and the wrenches to `data`, for the next `mj_step2`.
    fn apply_inputs(&mut self) {
        let Self { data, row, loaded_inputs, .. } = self;
        row.drives.apply(data);
        if let Some(wrenches) = &row.wrenches {
            *loaded_inputs = None;
            wrenches.apply(data);
        }
    }

    /// Resets to the model's initial state, modified by `change`. Targets, controls, wrenches and welds are reset;
    /// gains, limits and gravity compensation stay. A diverged environment runs again.
    pub fn reset(&mut self, change: impl FnOnce(&mut Data, &mut DriveState)) {
        let initial = self.reset_state(change);
        self.forward(&initial);
    }

    /// Resets as [`reset`](Self::reset) does, without the forward pass. Returns the model's initial state.
    pub(crate) fn reset_state(&mut self, change: impl FnOnce(&mut Data, &mut DriveState)) -> IntegrationState {
        self.disown();
        self.stage = Stage::Raw;
        self.data.reset();
        self.data.take_warnings();
        self.row.drives.reset();
        if let Some(wrenches) = &mut self.row.wrenches {
            wrenches.list.clear();
        }
        self.replace_welds(Vec::new());
        self.row.diverged = None;
        self.row.steps = 0;
        self.row.solved_current = true;
        let initial = self.current_motion();
        change(&mut self.data, &mut self.row.drives);
        self.row.drives.reset_memory();
        self.accept(&initial);
        initial
    }

    /// Ends external wrenches and clears the memory of actuator models (delays, motor states). The state stays.
    pub(crate) fn reset_buffers(&mut self) {
        self.set_wrenches(|wrenches| wrenches.list.clear());
        self.row.drives.reset_memory();
    }

    /// Copy of the current state, with quaternions as they were before the forward pass.
    fn current_motion(&self) -> IntegrationState {
        let mut motion = IntegrationState::default();
        self.copy_motion(&mut motion);
        motion
    }

    /// Saves the current state in `motion`, with quaternions as they were before the forward pass.
    fn copy_motion(&self, motion: &mut IntegrationState) {
        motion.save(&self.data);
        if self.stage > Stage::Raw {
            motion.undo_normalization(&self.raw_quats);
        }
    }

    /// Saves the current state in the row.
    fn save_motion(&mut self) {
        let mut motion = std::mem::take(&mut self.row.motion);
        self.copy_motion(&mut motion);
        self.row.motion = motion;
    }

    /// Restores `motion`, which is without a forward pass, and the inputs as of the last write.
    fn restore_motion(&mut self, motion: &IntegrationState) {
        self.disown();
        self.row.written.restore(&mut self.data);
        motion.restore(&mut self.data);
        self.stage = Stage::Raw;
    }

    /// Saves everything that determines future steps.
    pub(crate) fn save_state(&self) -> EnvState {
        let (motion, mut inputs) = (self.current_motion(), UserInputs::default());
        inputs.save(&self.data);
        let (drives, diverged) = (self.drives.to_flat(), self.diverged.clone());
        let (wrenches, welds) = (self.wrenches().clone(), self.cold.welds.clone());
        EnvState { motion, inputs, drives, wrenches, welds, steps: self.steps, diverged }
    }

    /// Restores `state`, which comes from a model of the same layout and [fits](EnvState::has_same_lengths), without a
    /// forward pass.
    pub(crate) fn load_state(&mut self, state: &EnvState) {
        self.row.drives.set_from_flat(&state.drives);
        // A hand-made file may name a body that does not exist.
        let bodies = self.data.model().nbody();
        let mut wrenches = state.wrenches.clone();
        wrenches.list.retain(|wrench| wrench.body < bodies);
        wrenches.gravity_compensated.retain(|body| *body < bodies);
        self.row.wrenches = (wrenches != Wrenches::default()).then(|| Box::new(wrenches));
        let welds = state.welds.iter().filter(|weld| self.data.model().is_weld(weld.equality)).copied().collect();
        self.replace_welds(welds);
        self.row.diverged.clone_from(&state.diverged);
        self.row.steps = state.steps;
        self.row.solved_current = true;
        self.row.cold.captured.clear();
        self.row.written = Arc::new(state.inputs.clone());
        self.restore_motion(&state.motion);
        self.accept(&state.motion);
    }

    /// Positions, velocities and warm start, for a transfer to another model.
    pub(crate) fn state_arrays(&self) -> StateArrays {
        let state = self.current_motion();
        StateArrays {
            qpos: state.qpos(self.data.model()).to_vec(),
            qvel: self.data.qvel().to_vec(),
            warmstart: self.data.qacc_warmstart().to_vec(),
        }
    }

    /// Number of times a buffer was doubled: that of this `mjData`, or of all `mjData` of a batch.
    pub fn buffer_growths(&self) -> u64 {
        self.buffer_growths.load(Ordering::Relaxed)
    }
}

/// State that determines future steps. Quaternions are those before the last forward pass.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EnvState {
    pub motion: IntegrationState,
    pub inputs: UserInputs,
    /// Flat array of [`DriveState::to_flat`].
    pub drives: Vec<f64>,
    pub wrenches: Wrenches,
    pub welds: Vec<Weld>,
    pub steps: u64,
    pub diverged: Option<Box<EnvStatus>>,
}

impl EnvState {
    /// True if all arrays have the same lengths as those of `other`.
    pub(crate) fn has_same_lengths(&self, other: &Self) -> bool {
        let lengths = |state: &Self| {
            let (inputs, active) = state.inputs.values();
            [state.motion.values().len(), inputs.len(), active.len(), state.drives.len()]
        };
        lengths(self) == lengths(other)
    }
}

/// Everything of an `mjData` that a row keeps.
struct SavedData {
    motion: IntegrationState,
    inputs: UserInputs,
    solved: SolvedState,
}

impl SavedData {
    /// Copies the data of `env`, whose quaternions are raw.
    fn of(env: &SimEnv) -> Self {
        let (mut inputs, mut solved) = (UserInputs::default(), SolvedState::default());
        inputs.save(&env.data);
        solved.save(&env.data);
        Self { motion: env.current_motion(), inputs, solved }
    }

    fn restore(&self, data: &mut Data) {
        self.inputs.restore(data);
        self.motion.restore(data);
        self.solved.restore(data);
    }
}

/// Copies of the arrays that carry a state to another model.
#[derive(Clone, Debug)]
pub(crate) struct StateArrays {
    pub qpos: Vec<f64>,
    pub qvel: Vec<f64>,
    pub warmstart: Vec<f64>,
}

/// Steps since the last reset, warnings since the creation, and divergence of an environment.
#[derive(Clone, Debug)]
pub(crate) struct EnvStats {
    pub(crate) diverged: Option<Box<EnvStatus>>,
    pub(crate) steps: u64,
    pub(crate) warnings: WarningCounts,
}

/// Returns the model with small initial buffers for [`SimEnv`], which grow on demand.
pub fn with_small_buffers(model: &mj::Model) -> mj::Model {
    model.with_buffers(model.small_buffers())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Free and ball joints at increasing heights above the ground, so that contacts appear one after another.
    fn falling() -> Model {
        let mut bodies = String::new();
        for i in 0..9 {
            let (x, z) = (0.5 * f64::from(i), 0.2 + 0.03 * f64::from(i));
            bodies += &format!(
                r#"<body pos="{x} 0 {z}"><freejoint/><geom type="box" size="0.1 0.05 0.03"/>
                   <body pos="0.15 0 0"><joint type="ball"/><geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.02"/></body>
                   </body>"#
            );
        }
        let xml = format!(
            r#"<mujoco><option timestep="0.004"/><worldbody><geom type="plane" size="9 9 1"/>{bodies}</worldbody></mujoco>"#
        );
        mj::compile(&xml, &[]).expect("compiles").into_model()
    }

    /// An environment with quaternions far from unit length.
    fn tumbling(model: &Model, buffers: Buffers) -> SimEnv {
        let mut env = SimEnv::new(&model.with_buffers(buffers), &Arc::default()).expect("small");
        env.reset(|data, _| {
            for (body, qpos) in data.qpos_mut().chunks_exact_mut(11).enumerate() {
                for (k, q) in qpos[3..].iter_mut().enumerate() {
                    *q = 1.3 * *q + 0.11 * ((body + 1) as f64) - 0.07 * k as f64;
                }
            }
            data.qvel_mut().iter_mut().enumerate().for_each(|(i, v)| *v = (1.7 * i as f64).sin());
        });
        env
    }

    fn bits(env: &SimEnv) -> Vec<u64> {
        let data = env.data();
        let saved = env.state_arrays();
        let raw = [&[data.time()], &saved.qpos[..], &saved.qvel, &saved.warmstart];
        raw.into_iter().chain([data.qpos(), data.xquat()]).flatten().map(|x| x.to_bits()).collect()
    }

    const TINY: Buffers = Buffers { contacts: 1, constraints: 1, arena_bytes: 1 << 14 };
    const HUGE: Buffers = Buffers { contacts: 500, constraints: 2000, arena_bytes: 64 << 20 };

    #[test]
    fn repeated_steps() {
        let model = falling();
        let (mut tiny, mut huge) = (tumbling(&model, TINY), tumbling(&model, HUGE));
        let at_first = tiny.buffer_growths();
        for step in 0..150 {
            assert!(bits(&tiny) == bits(&huge), "before step {step}");
            tiny.step(1);
            huge.step(1);
            if step % 40 == 20 {
                // A write must keep everything it does not set.
                tiny.write(|data| data.xfrc_applied_mut()[6] = 0.1);
                huge.write(|data| data.xfrc_applied_mut()[6] = 0.1);
            }
        }
        assert!(bits(&tiny) == bits(&huge));
        assert!(tiny.buffer_growths() > at_first && huge.buffer_growths() == 0);
        assert_eq!((tiny.status(), huge.status()), (&EnvStatus::Running, &EnvStatus::Running));
    }

    #[test]
    fn failed_step() {
        let mut env = tumbling(&falling(), HUGE);
        for steps in [0, 30] {
            env.step(steps);
            let mut other = tumbling(&falling(), HUGE);
            other.step(steps);
            other.write(|data| data.xfrc_applied_mut()[6] = 1e300);
            assert_eq!(bits(&other), bits(&env), "a write of a force changes no state");
            other.step(1);
            assert!(matches!(other.status(), EnvStatus::Diverged { step, .. } if *step == u64::from(steps)));
            assert_eq!(bits(&other), bits(&env));
            assert_eq!(other.data().xfrc_applied()[6], 1e300, "inputs are those of the write");
            // A rejected write is undone as well.
            env.write(|data| data.qpos_mut()[0] = f64::NAN);
            assert_eq!(bits(&other), bits(&env));
            env = tumbling(&falling(), HUGE);
        }
    }
}
