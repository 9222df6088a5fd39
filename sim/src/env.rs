//! One environment: an `mjData`, its drives, and the recovery from failed steps.
//!
//! A step is `drives -> mj_step2 -> mj_step1`, and `drives -> mj_step -> mj_step1` with RK4. After it, positions,
//! velocities, contacts and constraints belong to the new state. A step that overflows a buffer is repeated from its
//! start state with doubled buffers, so its result equals that of large buffers from the beginning. A step that ends in
//! a non-finite state is undone, and the environment stays frozen until it is reset.
//!
//! A batch steps its environments in turn, so the memory of an environment has left the core's cache when its turn
//! comes. Every cache line that a step touches beside MuJoCo's then costs a miss. Scratch memory of a step is therefore
//! per thread, and rarely used fields are stored apart from the hot ones.

use crate::capture::{CaptureRequest, CapturedStep};
use crate::drive::table::{DriveState, DriveTable};
use crate::wrenches::Wrenches;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{
    Buffers, Data, EngineError, IntegrationState, Model, Overflow, UnnormalizedQuats, UserInputs, Warning,
    WarningCounts, Weld,
};
use kinetoscope_scene::Contact;
use std::cell::Cell;
use std::sync::Arc;

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
    /// Contacts or constraints need more memory than the limit of an environment, 2 GiB. Contains the sizes that the
    /// buffers would have grown to.
    BuffersExhausted(Buffers),
}

impl std::fmt::Display for Divergence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Warning(warning) => write!(f, "{}", warning.name()),
            Self::Engine(error) => write!(f, "{error}"),
            Self::BuffersExhausted(buffers) => write!(f, "contacts and constraints do not fit into {buffers:?}"),
        }
    }
}

/// Memory of one environment above which its buffers no longer grow \[bytes\].
const MAX_ENV_BYTES: usize = 2 << 30;

/// One environment of a batch.
#[derive(Debug)]
pub struct SimEnv {
    data: Data,
    /// Targets, gains and efforts of the drives.
    pub drives: DriveState,
    steps: u64,
    /// Divergence status; `None` while the environment runs.
    diverged: Option<Box<EnvStatus>>,
    /// Quaternions before the last forward pass; the rest of the state is in `data`.
    raw_quats: UnnormalizedQuats,
    /// True if forces and accelerations were solved for the current state, false if for the state before the last step.
    solved_current: bool,
    /// True after the model was replaced and before the next forward pass. The pass is deferred to the next read or
    /// step, so that several property changes and a reset share one pass. Until then, quaternions in `qpos` are those
    /// before a pass.
    dirty: bool,
    cold: Box<ColdState>,
    /// External wrenches of the user; `None` without any.
    wrenches: Option<Box<Wrenches>>,
}

/// Fields that a successful step does not touch.
#[derive(Debug, Default)]
struct ColdState {
    warnings: WarningCounts,
    buffer_growths: u32,
    /// User inputs as of the last write. MuJoCo 2.2.2 clears inputs in its automatic reset after a failed step.
    inputs: UserInputs,
    /// Quantities captured in the last step for which sensors needed them.
    captured: CapturedStep,
    /// Attached welds; their relative poses are in the model.
    welds: Vec<Weld>,
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
            drives,
            steps: 0,
            diverged: None,
            raw_quats: UnnormalizedQuats::new(model),
            solved_current: true,
            dirty: false,
            cold: Box::default(),
            wrenches: None,
        };
        let initial = env.current_motion();
        env.forward(&initial);
        Ok(env)
    }

    /// MuJoCo data: the state after the last step or the last write.
    pub fn data(&self) -> &Data {
        &self.data
    }

    /// Writes state or inputs, then runs `mj_step1`, which updates all quantities that depend on positions and
    /// velocities. Accelerations and forces keep the values of the last step. A non-finite state is rejected: the state
    /// before the write is restored, and the environment is marked as diverged. Every step overwrites `qfrc_applied`
    /// and the controls of drives from [`DriveState`].
    pub fn write(&mut self, change: impl FnOnce(&mut Data)) {
        // Quaternions that `change` leaves alone must be normalized once, not twice.
        self.raw_quats.restore(&mut self.data);
        let good = self.current_motion();
        change(&mut self.data);
        self.solved_current = true;
        self.forward(&good);
    }

    /// Replaces the model by one of the same sizes. The forward pass is deferred:
    /// [`forward_if_dirty`](Self::forward_if_dirty) must follow before any other use except another replacement.
    pub(crate) fn set_model(&mut self, model: Model) {
        if !self.dirty {
            self.raw_quats.restore(&mut self.data);
        }
        let welds = &self.cold.welds;
        self.data.set_model(if welds.is_empty() { model } else { model.with_welds(welds) });
        self.solved_current = true;
        self.dirty = true;
    }

    /// Runs the forward pass that a replaced model needs.
    pub(crate) fn forward_if_dirty(&mut self) {
        if self.dirty {
            self.dirty = false;
            let good = self.current_motion();
            self.forward(&good);
        }
    }

    /// Attached welds.
    pub(crate) fn welds(&self) -> &[Weld] {
        &self.cold.welds
    }

    /// Attaches these welds, releases all others, and runs a forward pass.
    pub(crate) fn set_welds(&mut self, welds: Vec<Weld>) {
        if welds == self.cold.welds {
            return;
        }
        self.raw_quats.restore(&mut self.data);
        let good = self.current_motion();
        self.replace_welds(welds);
        self.solved_current = true;
        self.forward(&good);
    }

    /// Attaches these welds and releases all others, without a forward pass.
    fn replace_welds(&mut self, welds: Vec<Weld>) {
        if welds == self.cold.welds {
            return;
        }
        for weld in &self.cold.welds {
            self.data.set_equality_active(weld.equality, false);
        }
        let model = self.data.model().with_welds(&welds);
        self.data.set_model(model);
        for weld in &welds {
            self.data.set_equality_active(weld.equality, true);
        }
        self.cold.welds = welds;
    }

    /// Sets controls. They are not part of the state, so no forward pass is needed.
    pub(crate) fn set_controls(&mut self, change: impl FnOnce(&mut [f64])) {
        change(self.data.ctrl_mut());
        self.cold.inputs.save(&self.data);
    }

    /// External wrenches, and bodies with gravity compensation.
    pub(crate) fn wrenches(&self) -> &Wrenches {
        static NONE: Wrenches = Wrenches { list: Vec::new(), gravity_compensated: Vec::new() };
        self.wrenches.as_deref().unwrap_or(&NONE)
    }

    /// Changes external wrenches. They are not part of the state, so no forward pass is needed.
    pub(crate) fn set_wrenches(&mut self, change: impl FnOnce(&mut Wrenches)) {
        let wrenches = self.wrenches.get_or_insert_default();
        wrenches.clear(&mut self.data);
        change(wrenches);
        wrenches.apply(&mut self.data);
        if **wrenches == Wrenches::default() {
            self.wrenches = None;
        }
        self.cold.inputs.save(&self.data);
    }

    /// Writes the efforts of drives and the wrenches to `data`, for the next `mj_step2`.
    fn apply_inputs(&mut self) {
        self.drives.apply(&mut self.data);
        if let Some(wrenches) = &self.wrenches {
            wrenches.apply(&mut self.data);
        }
    }

    /// Announces a [`reset`](Self::reset), which makes a deferred forward pass unnecessary.
    pub(crate) fn expect_reset(&mut self) {
        self.dirty = false;
    }

    /// Resets to the model's initial state, modified by `change`. Targets, controls, wrenches and welds are reset;
    /// gains, limits and gravity compensation stay. A diverged environment runs again.
    pub fn reset(&mut self, change: impl FnOnce(&mut Data, &mut DriveState)) {
        self.dirty = false;
        self.data.reset();
        self.data.take_warnings();
        self.drives.reset();
        if let Some(wrenches) = &mut self.wrenches {
            wrenches.list.clear();
        }
        self.replace_welds(Vec::new());
        self.diverged = None;
        self.steps = 0;
        self.solved_current = true;
        let initial = self.current_motion();
        change(&mut self.data, &mut self.drives);
        self.drives.reset_memory();
        self.forward(&initial);
    }

    /// Ends external wrenches and clears the memory of actuator models (delays, motor states). The state stays.
    pub(crate) fn reset_buffers(&mut self) {
        self.set_wrenches(|wrenches| wrenches.list.clear());
        self.drives.reset_memory();
    }

    /// Copy of the current state in `data`.
    fn current_motion(&self) -> IntegrationState {
        let mut motion = IntegrationState::default();
        motion.save(&self.data);
        motion
    }

    /// Saves the current state with its quaternions as they were before the forward pass.
    fn save_raw_motion(&self, state: &mut IntegrationState) {
        state.save(&self.data);
        state.undo_normalization(&self.raw_quats);
    }

    /// Restores a state and the user inputs; the caller must run the forward pass.
    fn restore_motion(&mut self, state: &IntegrationState) {
        self.cold.inputs.restore(&mut self.data);
        state.restore(&mut self.data);
        self.raw_quats.save(&self.data);
    }

    /// Adds steps, warnings and divergence of `other`, whose state was copied to this environment.
    pub(crate) fn add_stats(&mut self, other: &EnvStats) {
        self.steps = other.steps;
        self.cold.warnings.add(&other.warnings);
        self.cold.buffer_growths += other.growths;
        if self.diverged.is_none() {
            self.diverged.clone_from(&other.diverged);
        }
    }

    /// Counters and divergence since the environment was created.
    pub(crate) fn stats(&self) -> EnvStats {
        EnvStats {
            diverged: self.diverged.clone(),
            steps: self.steps,
            warnings: self.cold.warnings,
            growths: self.cold.buffer_growths,
        }
    }

    /// Saves everything that determines future steps.
    pub(crate) fn save_state(&self) -> EnvState {
        let (mut motion, mut inputs) = (IntegrationState::default(), UserInputs::default());
        self.save_raw_motion(&mut motion);
        inputs.save(&self.data);
        let (drives, diverged) = (self.drives.to_flat(), self.diverged.clone());
        let (wrenches, welds) = (self.wrenches().clone(), self.cold.welds.clone());
        EnvState { motion, inputs, drives, wrenches, welds, steps: self.steps, diverged }
    }

    /// Restores `state`, which comes from a model of the same layout and [fits](EnvState::has_same_lengths).
    pub(crate) fn load_state(&mut self, state: &EnvState) {
        self.drives.set_from_flat(&state.drives);
        // A hand-made file may name a body that does not exist.
        let bodies = self.data.model().nbody();
        let mut wrenches = state.wrenches.clone();
        wrenches.list.retain(|wrench| wrench.body < bodies);
        wrenches.gravity_compensated.retain(|body| *body < bodies);
        self.wrenches = (wrenches != Wrenches::default()).then(|| Box::new(wrenches));
        let welds = state.welds.iter().filter(|weld| self.data.model().is_weld(weld.equality)).copied().collect();
        self.replace_welds(welds);
        self.diverged.clone_from(&state.diverged);
        self.steps = state.steps;
        self.solved_current = true;
        self.cold.captured.clear();
        self.cold.inputs.clone_from(&state.inputs);
        self.restore_motion(&state.motion);
        self.forward(&state.motion);
    }

    /// Positions, velocities and warm start, for a transfer to another model.
    pub(crate) fn state_arrays(&self) -> StateArrays {
        let mut state = IntegrationState::default();
        self.save_raw_motion(&mut state);
        StateArrays {
            qpos: state.qpos(self.data.model()).to_vec(),
            qvel: self.data.qvel().to_vec(),
            warmstart: self.data.qacc_warmstart().to_vec(),
        }
    }

    /// `Running`, or `Diverged` with the number of completed steps and the reason. A diverged environment keeps its
    /// last valid state until it is reset.
    pub fn status(&self) -> &EnvStatus {
        self.diverged.as_deref().unwrap_or(&EnvStatus::Running)
    }

    /// Number of MuJoCo steps since the last reset.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Counts of MuJoCo's warnings since the environment was created, without overflows that a repeated step resolved.
    pub fn warnings(&self) -> &WarningCounts {
        &self.cold.warnings
    }

    /// Number of times a buffer was doubled since the environment was created.
    pub fn buffer_growths(&self) -> u32 {
        self.cold.buffer_growths
    }

    /// Prefetches memory for the next step without waiting; `arrays` includes the large arrays.
    pub(crate) fn prefetch(&self, arrays: bool) {
        if arrays {
            self.data.prefetch_arrays()
        } else {
            self.data.prefetch()
        }
        self.drives.prefetch();
    }

    /// Does `count` MuJoCo steps. A diverged environment does not step.
    pub fn step(&mut self, count: u32) {
        self.step_and_capture(count, None);
    }

    /// Steps as [`step`](Self::step) does, and captures the quantities of `capture` in the last step.
    pub(crate) fn step_and_capture(&mut self, count: u32, capture: Option<&CaptureRequest>) {
        for left in (0..count).rev() {
            if self.diverged.is_some() {
                return;
            }
            self.step_once(capture.filter(|_| left == 0));
        }
    }

    fn step_once(&mut self, mut capture: Option<&CaptureRequest>) {
        if let Some(wanted) = capture.take_if(|_| self.data.model().integrator() == mj::mjINT_RK4) {
            // RK4 ends with the solution of an intermediate state, so the state before the step is captured.
            self.capture_current(wanted);
        }
        let mut scratch = SCRATCH.take();
        self.step_with(&mut scratch, capture);
        SCRATCH.set(scratch);
    }

    fn step_with(&mut self, scratch: &mut Scratch, capture: Option<&CaptureRequest>) {
        let Scratch { before, efforts } = scratch;
        self.save_raw_motion(before);
        loop {
            let done = self.try_step(before, efforts, capture);
            let raised = self.data.take_warnings();
            match classify_step(done, &raised) {
                StepOutcome::Succeeded => {
                    if raised != WarningCounts::default() {
                        self.cold.warnings.add(&raised);
                    }
                    self.drives.finish_step(efforts);
                    self.steps = self.steps.saturating_add(1);
                    self.solved_current = false;
                    return;
                }
                StepOutcome::Overflowed(what) => {
                    if let Err(reason) = self.grow_and_restore(what, before) {
                        return self.mark_diverged(reason, before);
                    }
                }
                StepOutcome::Diverged(reason) => {
                    self.cold.warnings.add(&raised);
                    return self.mark_diverged(reason, before);
                }
            }
        }
    }

    /// Does one step from `before` and reads the efforts that the drives applied.
    fn try_step(
        &mut self,
        before: &IntegrationState,
        efforts: &mut Vec<f64>,
        capture: Option<&CaptureRequest>,
    ) -> Result<(), EngineError> {
        self.apply_inputs();
        if self.data.model().integrator() == mj::mjINT_RK4 {
            // mj_step2 integrates with Euler even if the model says RK4.
            self.data.step()?;
        } else {
            self.data.step2()?;
        }
        // Must precede mj_step1, which lays out the constraints of the new state: 4.x moves them within its arena.
        self.drives.read_efforts(&self.data, efforts);
        if let Some(capture) = capture {
            self.capture(before, capture)?;
        }
        self.raw_quats.save(&self.data);
        self.data.step1()
    }

    /// Captures quantities after `mj_step2` of a step from `before`.
    fn capture(&mut self, before: &IntegrationState, capture: &CaptureRequest) -> Result<(), EngineError> {
        let qvel = before.qvel(self.data.model());
        capture.capture(&mut self.data, qvel, &mut self.cold.captured)
    }

    /// Captures the solution of the current state with the current drives; the state stays the same, bit for bit. The
    /// capture is empty for a diverged environment and for one whose next step will fail.
    pub(crate) fn capture_current(&mut self, capture: &CaptureRequest) {
        self.cold.captured.clear();
        self.solved_current = true;
        if !self.with_solved_state(|env, before| env.capture(before, capture)) {
            self.cold.captured.clear();
        }
    }

    /// Writes the contacts of the current state with their solved forces to `contacts`; empty if the solve fails.
    /// Earlier captures and later steps are not affected.
    pub(crate) fn current_contacts(&mut self, capture: &CaptureRequest, contacts: &mut Vec<Contact>) {
        let mut solved = CapturedStep::default();
        let take = |env: &mut Self, before: &IntegrationState| {
            let qvel = before.qvel(env.data.model());
            capture.capture(&mut env.data, qvel, &mut solved)
        };
        let done = self.with_solved_state(take);
        contacts.clear();
        contacts.extend(solved.contacts.iter().filter(|_| done));
    }

    /// Solves the current state, passes the solution to `take`, and restores the state. Returns true if the solve
    /// succeeded.
    fn with_solved_state(
        &mut self,
        mut take: impl FnMut(&mut Self, &IntegrationState) -> Result<(), EngineError>,
    ) -> bool {
        if self.diverged.is_some() {
            return false;
        }
        let mut scratch = SCRATCH.take();
        let before = &mut scratch.before;
        self.save_raw_motion(before);
        let good = loop {
            self.apply_inputs();
            let done = self.data.step2().and_then(|()| take(self, before));
            match classify_step(done, &self.data.take_warnings()) {
                StepOutcome::Succeeded => break true,
                StepOutcome::Overflowed(what) if self.grow_and_restore(what, before).is_ok() => {}
                StepOutcome::Overflowed(_) | StepOutcome::Diverged(_) => {
                    self.data.reset();
                    break false;
                }
            }
        };
        self.restore_motion(before);
        // Cannot fail: this state had a forward pass before, with these or smaller buffers.
        let _ = self.data.step1();
        self.data.take_warnings();
        SCRATCH.set(scratch);
        good
    }

    /// Quantities of the last capture.
    pub(crate) fn captured(&self) -> &CapturedStep {
        &self.cold.captured
    }

    /// Time of the state for which forces and accelerations were last solved \[s\]: the start of the last step, or the
    /// current time after a write or reset.
    pub(crate) fn solved_time(&self) -> f64 {
        if self.solved_current { self.data.time() } else { self.data.time() - self.data.model().timestep() }
    }

    /// Runs one forward pass (`mj_step1`), growing the buffers as needed. On failure, restores `good` and marks the
    /// environment as diverged.
    fn forward(&mut self, good: &IntegrationState) {
        let state = self.current_motion();
        self.raw_quats.save(&self.data);
        self.cold.inputs.save(&self.data);
        loop {
            let done = self.data.step1();
            let raised = self.data.take_warnings();
            match classify_step(done, &raised) {
                StepOutcome::Succeeded => {
                    self.cold.warnings.add(&raised);
                    return;
                }
                StepOutcome::Overflowed(what) => {
                    if let Err(reason) = self.grow_buffers(what, &state) {
                        return self.mark_diverged(reason, good);
                    }
                }
                StepOutcome::Diverged(reason) => {
                    self.cold.warnings.add(&raised);
                    return self.mark_diverged(reason, good);
                }
            }
        }
    }

    /// Restores the state before the step, with larger buffers and a forward pass done.
    fn grow_and_restore(&mut self, mut what: Overflow, before: &IntegrationState) -> Result<(), Divergence> {
        loop {
            self.grow_buffers(what, before)?;
            let done = self.data.step1();
            let raised = self.data.take_warnings();
            match classify_step(done, &raised) {
                StepOutcome::Succeeded => return Ok(()),
                StepOutcome::Overflowed(next) => what = next,
                StepOutcome::Diverged(reason) => return Err(reason),
            }
        }
    }

    /// Replaces the data by data with twice the buffer size of `what`, in `state`.
    fn grow_buffers(&mut self, what: Overflow, state: &IntegrationState) -> Result<(), Divergence> {
        let buffers = self.data.model().buffers().enlarged(what);
        if self.data.bytes() > MAX_ENV_BYTES {
            return Err(Divergence::BuffersExhausted(buffers));
        }
        let model = self.data.model().with_buffers(buffers);
        self.data = Data::new(&model).map_err(Divergence::Engine)?;
        self.restore_motion(state);
        self.cold.buffer_growths += 1;
        Ok(())
    }

    /// Marks the environment as diverged and restores `good`, the last valid state.
    fn mark_diverged(&mut self, reason: Divergence, good: &IntegrationState) {
        self.diverged = Some(Box::new(EnvStatus::Diverged { step: self.steps, reason }));
        self.cold.captured.clear();
        self.data.reset();
        self.restore_motion(good);
        // Cannot fail: the last valid state had a forward pass before, with these or smaller buffers.
        let _ = self.data.step1();
        self.data.take_warnings();
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

/// Copies of the arrays that carry a state to another model.
#[derive(Clone, Debug)]
pub(crate) struct StateArrays {
    pub qpos: Vec<f64>,
    pub qvel: Vec<f64>,
    pub warmstart: Vec<f64>,
}

/// Counters and divergence of an environment.
#[derive(Clone, Debug)]
pub(crate) struct EnvStats {
    diverged: Option<Box<EnvStatus>>,
    steps: u64,
    warnings: WarningCounts,
    growths: u32,
}

/// Scratch memory of a step.
#[derive(Default)]
struct Scratch {
    /// The state before the step.
    before: IntegrationState,
    /// Efforts of the drives in the step; kept only if the step succeeds.
    efforts: Vec<f64>,
}

thread_local! {
    /// One per thread, not per environment: a thousand copies would not stay in the cache.
    static SCRATCH: Cell<Scratch> = const { Cell::new(Scratch { before: IntegrationState::EMPTY, efforts: Vec::new() }) };
}

enum StepOutcome {
    Succeeded,
    Overflowed(Overflow),
    Diverged(Divergence),
}

fn classify_step(done: Result<(), EngineError>, raised: &WarningCounts) -> StepOutcome {
    match done {
        Err(error) if error.is_out_of_memory() => StepOutcome::Overflowed(raised.overflow().unwrap_or(Overflow::Stack)),
        Err(error) => StepOutcome::Diverged(Divergence::Engine(error)),
        Ok(()) => match (raised.overflow(), raised.diverged()) {
            (Some(what), _) => StepOutcome::Overflowed(what),
            (None, Some(warning)) => StepOutcome::Diverged(Divergence::Warning(warning)),
            (None, None) => StepOutcome::Succeeded,
        },
    }
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
