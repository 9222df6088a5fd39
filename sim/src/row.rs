//! Rows: the stored states of environments that no `mjData` holds at the moment.
//!
//! A batch holds one row per environment and one `mjData` per thread. A row has everything that determines future
//! steps, and what readers see of the last step. Everything else is computed from it when it is needed. Quaternions are
//! stored as they were before a forward pass, which may normalize them.

use crate::capture::CapturedStep;
use crate::drive::table::DriveState;
use crate::env::{EnvStats, EnvStatus};
use crate::wrenches::Wrenches;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{
    BodyInputs, Data, IntegrationState, JointInputs, Model, ModelPatch, NumberArray, SolvedState, UserInputs,
    WarningCounts, Weld,
};
use std::sync::Arc;

/// Row of one environment.
#[derive(Clone, Debug)]
pub struct EnvRow {
    /// Targets, gains and efforts of the drives.
    pub drives: DriveState,
    /// State of the environment. While it is in working memory, the state as last saved: during a step, that before it.
    pub(crate) motion: IntegrationState,
    /// Results of the last solve.
    pub(crate) solved: SolvedState,
    /// Controls and applied joint forces as of the last save of this row, or as set in it since.
    pub(crate) joint_inputs: JointInputs,
    /// Other inputs as of the last save of this row, shared until an environment has its own.
    pub(crate) body_inputs: Arc<BodyInputs>,
    /// Inputs as of the last write. MuJoCo 2.2.2 clears inputs in its automatic reset after a failed step.
    pub(crate) written: Arc<UserInputs>,
    /// Differences of the environment's model from the compiled one, of its properties and welds; `None` for the shared
    /// model. After a change, the version must be another one.
    pub(crate) patch: Option<Arc<ModelPatch>>,
    pub(crate) steps: u64,
    /// Divergence status; `None` while the environment runs.
    pub(crate) diverged: Option<Box<EnvStatus>>,
    /// False if forces and accelerations belong to the state before the last step. True after a write, a reset or a
    /// capture of the current state.
    pub(crate) solved_current: bool,
    /// True if the warnings of the forward pass of the current state are counted.
    pub(crate) is_forward_counted: bool,
    /// True if the forward pass of the current state fails in the largest buffers. Then readers get poses and
    /// velocities, and no contacts.
    pub(crate) is_pass_impossible: bool,
    /// External wrenches of the user; `None` without any.
    pub(crate) wrenches: Option<Box<Wrenches>>,
    /// Number that identifies this content of the row. A thread whose `mjData` still belongs to it does not restore it.
    pub(crate) version: u64,
    /// True if `joint_inputs` changed since the row was last in working memory.
    pub(crate) inputs_are_edited: bool,
    pub(crate) cold: Box<ColdState>,
}

/// Fields that a successful step does not touch.
#[derive(Clone, Debug, Default)]
pub(crate) struct ColdState {
    /// Index of the environment in its batch, for events; `None` outside of a batch.
    pub(crate) env: Option<usize>,
    pub(crate) warnings: WarningCounts,
    /// Quantities captured in the last step for which sensors needed them.
    pub(crate) captured: CapturedStep,
    /// Attached welds; their relative poses are in the model.
    pub(crate) welds: Vec<Weld>,
}

impl EnvRow {
    /// Creates a row without a state.
    pub(crate) fn new(drives: DriveState) -> Self {
        Self {
            drives,
            motion: IntegrationState::EMPTY,
            solved: SolvedState::default(),
            joint_inputs: JointInputs::default(),
            body_inputs: Arc::default(),
            written: Arc::default(),
            patch: None,
            steps: 0,
            diverged: None,
            solved_current: true,
            is_forward_counted: false,
            is_pass_impossible: false,
            wrenches: None,
            version: 0,
            inputs_are_edited: false,
            cold: Box::default(),
        }
    }

    /// Prefetches the arrays that rows never share, without waiting for them.
    pub(crate) fn prefetch(&self) {
        self.prefetch_results();
        self.prefetch_inputs();
        if let Some(patch) = &self.patch {
            patch.prefetch();
        }
    }

    /// Prefetches the state and the results of the last solve.
    pub(crate) fn prefetch_results(&self) {
        mj::prefetch(self.motion.values());
        mj::prefetch(self.solved.values());
    }

    /// Prefetches the inputs and the efforts.
    pub(crate) fn prefetch_inputs(&self) {
        mj::prefetch(self.joint_inputs.values());
        self.drives.prefetch();
    }

    /// Sets the differences of the environment's model from the compiled one, outside of working memory. Welds stay.
    pub(crate) fn set_patch(&mut self, patch: Option<&Arc<ModelPatch>>, model: &Model) {
        self.patch = ModelPatch::with_welds(patch, model, &self.cold.welds);
        self.solved_current = true;
        self.is_forward_counted = false;
        self.is_pass_impossible = false;
        if !self.written.equals_parts(&self.joint_inputs, &self.body_inputs) {
            own(&mut self.written).copy_parts(&self.joint_inputs, &self.body_inputs);
        }
        // No `mjData` holds this row any longer.
        self.version = 0;
    }

    /// Memory that this row takes in a running batch without randomized properties \[bytes\]: with inputs of its own,
    /// which environments get when their controls differ.
    pub(crate) fn bytes(&self) -> usize {
        // Header and padding of a block of the allocator.
        const BLOCK: usize = 16;
        // The row, its cold state, state, results, joint inputs, inputs as of the last write, and three arrays of the
        // drives.
        const BLOCKS: usize = 9;
        let numbers = self.motion.values().len()
            + self.solved.values().len()
            + self.joint_inputs.values().len()
            + self.written.values().0.len()
            + self.drives.own_numbers();
        size_of::<Self>() + size_of::<ColdState>() + size_of::<f64>() * numbers + BLOCKS * BLOCK
    }

    /// Saves the inputs of `data` as those of the last write.
    pub(crate) fn save_written(&mut self, data: &Data) {
        if !self.written.matches(data) {
            own(&mut self.written).save(data);
        }
    }

    /// Saves the inputs of bodies of `data` in the row.
    pub(crate) fn save_body_inputs(&mut self, data: &Data) {
        if !self.body_inputs.matches(data) {
            own(&mut self.body_inputs).save(data);
        }
    }

    /// Restores the inputs saved in the row.
    pub(crate) fn restore_inputs(&self, data: &mut Data) {
        self.joint_inputs.restore(data);
        self.body_inputs.restore(data);
    }

    /// Sets controls of a row outside of working memory.
    pub(crate) fn set_controls(&mut self, change: impl FnOnce(&mut [f64]), model: &Model) {
        change(self.joint_inputs.ctrl_mut(model));
        own(&mut self.written).copy_parts(&self.joint_inputs, &self.body_inputs);
        self.inputs_are_edited = true;
    }

    /// Attached welds.
    pub(crate) fn welds(&self) -> &[Weld] {
        &self.cold.welds
    }

    /// External wrenches, and bodies with gravity compensation.
    pub(crate) fn wrenches(&self) -> &Wrenches {
        static NONE: Wrenches = Wrenches { list: Vec::new(), gravity_compensated: Vec::new() };
        self.wrenches.as_deref().unwrap_or(&NONE)
    }

    /// Quantities of the last capture.
    pub(crate) fn captured(&self) -> &CapturedStep {
        &self.cold.captured
    }

    /// Takes over the number of steps of `other`, whose state was copied to this environment, and adds its warnings.
    /// Its divergence is taken over unless this environment diverged itself.
    pub(crate) fn add_stats(&mut self, other: &EnvStats) {
        self.steps = other.steps;
        self.cold.warnings.add(&other.warnings);
        if self.diverged.is_none() {
            self.diverged.clone_from(&other.diverged);
        }
    }

    /// Steps since the last reset, warnings since the environment was created, and divergence status.
    pub(crate) fn stats(&self) -> EnvStats {
        EnvStats { diverged: self.diverged.clone(), steps: self.steps, warnings: self.cold.warnings }
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
}

/// Prefetches what a thread needs after the row with index `k`: arrays of the next row by `arrays`, and the row after it.
pub(crate) fn prefetch_after(rows: &[Box<EnvRow>], k: usize, arrays: impl FnOnce(&EnvRow)) {
    if let Some(next) = rows.get(k + 1) {
        arrays(next);
    }
    if let Some(after) = rows.get(k + 2) {
        mj::prefetch(std::slice::from_ref(&**after));
    }
}

/// Part of a row that a reader needs. Each part contains the ones before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum RowPart {
    /// Inputs and properties, which no device changes.
    Inputs,
    /// Steps, time, divergence and captured quantities.
    Clock,
    /// The state, and results of the last solve: accelerations, forces and efforts.
    All,
}

/// Array of the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StateArray {
    /// Positions, with quaternions as they were before a forward pass.
    Positions,
    /// Velocities.
    Velocities,
    /// Accelerations of the last step, from which the next solve starts.
    Accelerations,
}

impl StateArray {
    /// The array in a row.
    pub(crate) fn of<'a>(self, row: &'a StoredRow<'_>) -> &'a [f64] {
        match self {
            Self::Positions => row.raw_qpos(),
            Self::Velocities => row.qvel(),
            Self::Accelerations => row.qacc_warmstart(),
        }
    }
}

/// Row outside of working memory, for reads that need no `mjData`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StoredRow<'a> {
    pub(crate) row: &'a EnvRow,
    pub(crate) model: &'a Model,
}

impl std::ops::Deref for StoredRow<'_> {
    type Target = EnvRow;

    fn deref(&self) -> &EnvRow {
        self.row
    }
}

impl StoredRow<'_> {
    /// Simulation time \[s\].
    pub(crate) fn time(&self) -> f64 {
        self.row.motion.values().first().copied().unwrap_or(0.0)
    }

    /// Time of the state for which forces and accelerations were last solved \[s\]: the start of the last step, or the
    /// current time after a write or reset.
    pub(crate) fn solved_time(&self) -> f64 {
        if self.row.solved_current { self.time() } else { self.time() - self.model.timestep() }
    }

    /// Positions, with quaternions as they were before a forward pass.
    pub(crate) fn raw_qpos(&self) -> &[f64] {
        self.row.motion.qpos(self.model)
    }

    /// Velocities.
    pub(crate) fn qvel(&self) -> &[f64] {
        self.row.motion.qvel(self.model)
    }

    /// Accelerations of the last step, from which the next solve starts.
    pub(crate) fn qacc_warmstart(&self) -> &[f64] {
        self.row.motion.qacc_warmstart(self.model)
    }

    /// Controls.
    pub(crate) fn ctrl(&self) -> &[f64] {
        self.row.joint_inputs.ctrl(self.model)
    }

    /// Numbers of an array of the environment's model, from index `first` on.
    pub(crate) fn model_numbers<const K: usize>(&self, array: NumberArray, first: usize) -> [f64; K] {
        array.some(self.model, self.row.patch.as_deref(), first)
    }

    /// Gravity of the environment in world axes \[m/s²\].
    pub(crate) fn gravity(&self) -> [f64; 3] {
        self.row.patch.as_ref().map_or_else(|| self.model.gravity(), |patch| patch.gravity())
    }
}

/// Inputs to write to: those of this environment alone, or new, empty ones if other environments share them.
fn own<T: Default>(inputs: &mut Arc<T>) -> &mut T {
    if Arc::get_mut(inputs).is_none() {
        *inputs = Arc::default();
    }
    Arc::get_mut(inputs).expect("new inputs have one owner")
}
