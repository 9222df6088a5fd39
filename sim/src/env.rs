//! One environment: an `mjData`, its drives, and what to do when a step does not go well.
//!
//! The loop is `drives -> mj_step2 -> mj_step1`: after it, positions, velocities, contacts and constraints are those of
//! the new state. A step that needed more room than the buffers have is done again, from the state before it, with
//! doubled buffers: the result is what large buffers would have given from the beginning. A step that ends in a state
//! that is not finite is undone, and the environment stands still until it is reset.

use crate::drive::table::{DriveState, DriveTable};
use crate::mj::{self, Buffers, Data, EngineError, Inputs, Model, Motion, Warning, WarningCounts};
use std::cell::Cell;
use std::sync::Arc;

/// Whether an environment is being stepped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EnvStatus {
    /// Stepping.
    Running,
    /// A step failed: the environment stands in its last good state until it is reset.
    Diverged {
        /// The step that failed, counted since the start of the environment.
        step: u64,
        /// Why.
        reason: Divergence,
    },
}

/// Why an environment was taken out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Divergence {
    /// A position, velocity or acceleration was not finite or huge.
    Warning(Warning),
    /// MuJoCo's engine stopped.
    Engine(EngineError),
    /// Contacts or constraints need more room than can be given.
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

/// Growth stops when one environment would take this much memory \[bytes\].
const LARGEST_ENVIRONMENT: usize = 2 << 30;

thread_local! {
    /// The state before the running step, to go back to. It serves one step at a time: one per thread stays in the cache,
    /// one per environment would not.
    static BEFORE: Cell<Motion> = Cell::default();
}

/// One environment of a batch.
#[derive(Debug)]
pub struct Env {
    data: Data,
    /// Targets, gains and efforts of the drives.
    pub drives: DriveState,
    status: EnvStatus,
    steps: u64,
    warnings: WarningCounts,
    growths: u32,
    /// What the user set, to carry into a larger `mjData`.
    inputs: Inputs,
}

impl Env {
    /// An environment in the model's initial state, with one forward pass done.
    ///
    /// # Errors
    /// MuJoCo cannot allocate it.
    pub fn new(model: &Model, drives: &Arc<DriveTable>) -> Result<Self, EngineError> {
        let data = Data::new(model)?;
        let drives = DriveState::new(drives, model);
        let mut env = Self {
            data,
            drives,
            status: EnvStatus::Running,
            steps: 0,
            warnings: WarningCounts::default(),
            growths: 0,
            inputs: Inputs::default(),
        };
        env.refresh();
        Ok(env)
    }

    /// The MuJoCo data: the state after the last step, or after the last write.
    pub fn data(&self) -> &Data {
        &self.data
    }

    /// Writes to the state or the inputs, then does one forward pass, so that nothing stale can be read.
    pub fn write(&mut self, change: impl FnOnce(&mut Data)) {
        change(&mut self.data);
        self.refresh();
    }

    /// Back to the model's initial state; `change` then sets the state to start from. Revives a diverged environment.
    pub fn reset(&mut self, change: impl FnOnce(&mut Data, &mut DriveState)) {
        self.data.reset();
        self.data.take_warnings();
        let table = Arc::clone(self.drives.table());
        let gains = std::mem::take(&mut self.drives.gains);
        self.drives = DriveState::new(&table, self.data.model());
        self.drives.gains = gains;
        self.status = EnvStatus::Running;
        self.steps = 0;
        change(&mut self.data, &mut self.drives);
        self.refresh();
    }

    /// Positions, velocities and warm start, to carry over to another model.
    pub(crate) fn saved_arrays(&self) -> SavedArrays {
        SavedArrays {
            qpos: self.data.qpos().to_vec(),
            qvel: self.data.qvel().to_vec(),
            warmstart: self.data.qacc_warmstart().to_vec(),
        }
    }

    /// Running or diverged.
    pub fn status(&self) -> &EnvStatus {
        &self.status
    }

    /// Steps done since the last reset.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// MuJoCo's warnings since the environment was made; an overflow that was redone is not among them.
    pub fn warnings(&self) -> &WarningCounts {
        &self.warnings
    }

    /// How often the buffers were doubled.
    pub fn growths(&self) -> u32 {
        self.growths
    }

    /// Does `count` steps; a diverged environment stands still.
    pub fn step(&mut self, count: u32) {
        for _ in 0..count {
            if self.status != EnvStatus::Running {
                return;
            }
            self.step_once();
        }
    }

    fn step_once(&mut self) {
        let mut before = BEFORE.take();
        before.save(&self.data);
        self.step_from(&before);
        BEFORE.set(before);
    }

    fn step_from(&mut self, before: &Motion) {
        loop {
            let done = self.attempt();
            let raised = self.data.take_warnings();
            match judge(done, &raised) {
                Verdict::Good => {
                    self.warnings.add(&raised);
                    self.drives.read_efforts(&self.data);
                    self.steps += 1;
                    return;
                }
                Verdict::NeedsRoom => {
                    if let Err(reason) = self.grow(before) {
                        return self.quarantine(before, reason);
                    }
                }
                Verdict::Bad(reason) => {
                    self.warnings.add(&raised);
                    return self.quarantine(before, reason);
                }
            }
        }
    }

    fn attempt(&mut self) -> Result<(), EngineError> {
        self.drives.apply(&mut self.data);
        self.data.step2()?;
        self.data.step1()
    }

    /// One forward pass over positions and velocities, growing the buffers as needed.
    fn refresh(&mut self) {
        let mut before = BEFORE.take();
        before.save(&self.data);
        self.refresh_from(&before);
        BEFORE.set(before);
    }

    fn refresh_from(&mut self, before: &Motion) {
        loop {
            let done = self.data.step1();
            let raised = self.data.take_warnings();
            match judge(done, &raised) {
                Verdict::Good => {
                    self.warnings.add(&raised);
                    return;
                }
                Verdict::NeedsRoom => {
                    if let Err(reason) = self.enlarge(before) {
                        return self.quarantine(before, reason);
                    }
                }
                Verdict::Bad(reason) => {
                    self.warnings.add(&raised);
                    return self.quarantine(before, reason);
                }
            }
        }
    }

    /// Goes back to the state before the step, with doubled buffers and a forward pass done.
    fn grow(&mut self, before: &Motion) -> Result<(), Divergence> {
        loop {
            self.enlarge(before)?;
            let done = self.data.step1();
            let raised = self.data.take_warnings();
            match judge(done, &raised) {
                Verdict::Good => return Ok(()),
                Verdict::NeedsRoom => {}
                Verdict::Bad(reason) => return Err(reason),
            }
        }
    }

    /// Replaces the data by one with doubled buffers, in the state before the step.
    fn enlarge(&mut self, before: &Motion) -> Result<(), Divergence> {
        let buffers = self.data.model().buffers().doubled();
        if self.data.bytes() > LARGEST_ENVIRONMENT {
            return Err(Divergence::BuffersExhausted(buffers));
        }
        let model = self.data.model().with_buffers(buffers);
        let mut larger = Data::new(&model).map_err(Divergence::Engine)?;
        self.inputs.save(&self.data);
        self.inputs.restore(&mut larger);
        before.restore(&mut larger);
        self.data = larger;
        self.growths += 1;
        Ok(())
    }

    fn quarantine(&mut self, before: &Motion, reason: Divergence) {
        self.status = EnvStatus::Diverged { step: self.steps, reason };
        self.inputs.save(&self.data);
        self.data.reset();
        self.inputs.restore(&mut self.data);
        before.restore(&mut self.data);
        // The last good state had a forward pass before; it may only fail where `before` itself is bad (a state that a
        // user wrote), and then its derived quantities stay those of the initial state.
        let _ = self.data.step1();
        self.data.take_warnings();
    }
}

/// Copies of the arrays that carry a state from one model to another.
#[derive(Clone, Debug)]
pub(crate) struct SavedArrays {
    pub qpos: Vec<f64>,
    pub qvel: Vec<f64>,
    pub warmstart: Vec<f64>,
}

enum Verdict {
    Good,
    NeedsRoom,
    Bad(Divergence),
}

fn judge(done: Result<(), EngineError>, raised: &WarningCounts) -> Verdict {
    match done {
        Err(error) if error.is_out_of_memory() => Verdict::NeedsRoom,
        Err(error) => Verdict::Bad(Divergence::Engine(error)),
        Ok(()) if raised.overflow().is_some() => Verdict::NeedsRoom,
        Ok(()) => match raised.diverged() {
            Some(warning) => Verdict::Bad(Divergence::Warning(warning)),
            None => Verdict::Good,
        },
    }
}

/// The model with buffers for [`Env`] to start with: small, they grow on demand.
pub fn with_small_buffers(model: &mj::Model) -> mj::Model {
    model.with_buffers(model.small_buffers())
}
