//! One environment: an `mjData`, its drives, and what to do when a step does not go well.
//!
//! The loop is `drives -> mj_step2 -> mj_step1` (with RK4 `drives -> mj_step -> mj_step1`): after it, positions,
//! velocities, contacts and constraints are those of the new state. A step that needed more room than the buffers have is
//! done again, from the state before it, with doubled buffers: the result is what large buffers would have given from the
//! beginning. A step that ends in a state that is not finite is undone, and the environment stands still until it is
//! reset.

use crate::drive::table::{DriveState, DriveTable};
use crate::mj::{self, Buffers, Data, EngineError, Inputs, Model, Motion, Overflow, Warning, WarningCounts};
use std::cell::Cell;
use std::sync::Arc;

/// Whether an environment is being stepped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EnvStatus {
    /// Stepping.
    Running,
    /// A step failed: the environment stands in its last good state until it is reset.
    Diverged {
        /// The step that failed, counted since the last reset.
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
    /// The present state as it was before its forward pass, to go back to. The pass of 2.2.2 normalises quaternions in
    /// place, and a second one would change their last bits.
    state: Motion,
    /// What the user set, as of the last write: MuJoCo's automatic reset (2.2.2) clears it in a step that fails.
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
            state: Motion::default(),
            inputs: Inputs::default(),
        };
        let initial = env.saved();
        env.refresh(initial);
        Ok(env)
    }

    /// The MuJoCo data: the state after the last step, or after the last write.
    pub fn data(&self) -> &Data {
        &self.data
    }

    /// Writes to the state or the inputs, then does one forward pass, so that nothing stale can be read. A state that
    /// is not finite is not kept: the environment diverges, in the state before the write. `qfrc_applied` and the
    /// controls of drives are not inputs here: [`DriveState`] sets them in every step.
    pub fn write(&mut self, change: impl FnOnce(&mut Data)) {
        self.state.restore(&mut self.data);
        let good = self.saved();
        change(&mut self.data);
        self.refresh(good);
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
        let initial = self.saved();
        change(&mut self.data, &mut self.drives);
        self.refresh(initial);
    }

    fn saved(&self) -> Motion {
        let mut motion = Motion::default();
        motion.save(&self.data);
        motion
    }

    /// Takes over what happened to `other`, whose state this one was given: steps, warnings, divergence.
    pub(crate) fn take_history(&mut self, other: &History) {
        self.steps = other.steps;
        self.warnings.add(&other.warnings);
        self.growths += other.growths;
        if self.status == EnvStatus::Running {
            self.status = other.status.clone();
        }
    }

    /// What happened since the environment was made.
    pub(crate) fn history(&self) -> History {
        History { status: self.status.clone(), steps: self.steps, warnings: self.warnings, growths: self.growths }
    }

    /// Positions, velocities and warm start, to carry over to another model.
    pub(crate) fn saved_arrays(&self) -> SavedArrays {
        SavedArrays {
            qpos: self.state.qpos(self.data.model()).to_vec(),
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
        let mut end = END.take();
        self.step_to(&mut end);
        END.set(end);
    }

    fn step_to(&mut self, end: &mut End) {
        loop {
            let done = self.attempt(end);
            let raised = self.data.take_warnings();
            match judge(done, &raised) {
                Verdict::Good => {
                    // Nearly always there are none, and then this memory need not come into the cache.
                    if raised != WarningCounts::default() {
                        self.warnings.add(&raised);
                    }
                    self.state.copy_from(&end.state);
                    self.drives.effort.clone_from(&end.efforts);
                    self.steps += 1;
                    return;
                }
                Verdict::NeedsRoom(what) => {
                    if let Err(reason) = self.grow(what) {
                        return self.quarantine(reason);
                    }
                }
                Verdict::Bad(reason) => {
                    self.warnings.add(&raised);
                    return self.quarantine(reason);
                }
            }
        }
    }

    fn attempt(&mut self, end: &mut End) -> Result<(), EngineError> {
        self.drives.apply(&mut self.data);
        if self.data.model().integrator() == mj::mjINT_RK4 {
            // mj_step2 would integrate with Euler, whatever the model says.
            self.data.step()?;
        } else {
            self.data.step2()?;
        }
        // Before mj_step1 lays out the constraints of the new state: 4.x puts them elsewhere in its arena.
        self.drives.read_efforts(&self.data, &mut end.efforts);
        end.state.save(&self.data);
        self.data.step1()
    }

    /// One forward pass over positions and velocities, growing the buffers as needed; back to `good` if it fails.
    fn refresh(&mut self, good: Motion) {
        self.state.save(&self.data);
        self.inputs.save(&self.data);
        loop {
            let done = self.data.step1();
            let raised = self.data.take_warnings();
            match judge(done, &raised) {
                Verdict::Good => {
                    self.warnings.add(&raised);
                    return;
                }
                Verdict::NeedsRoom(what) => {
                    if let Err(reason) = self.enlarge(what) {
                        self.state = good;
                        return self.quarantine(reason);
                    }
                }
                Verdict::Bad(reason) => {
                    self.warnings.add(&raised);
                    self.state = good;
                    return self.quarantine(reason);
                }
            }
        }
    }

    /// Goes back to the state before the step, with larger buffers and a forward pass done.
    fn grow(&mut self, mut what: Overflow) -> Result<(), Divergence> {
        loop {
            self.enlarge(what)?;
            let done = self.data.step1();
            let raised = self.data.take_warnings();
            match judge(done, &raised) {
                Verdict::Good => return Ok(()),
                Verdict::NeedsRoom(next) => what = next,
                Verdict::Bad(reason) => return Err(reason),
            }
        }
    }

    /// Replaces the data by one with twice as much of `what`, in the state before the step.
    fn enlarge(&mut self, what: Overflow) -> Result<(), Divergence> {
        let buffers = self.data.model().buffers().enlarged(what);
        if self.data.bytes() > LARGEST_ENVIRONMENT {
            return Err(Divergence::BuffersExhausted(buffers));
        }
        let model = self.data.model().with_buffers(buffers);
        let mut larger = Data::new(&model).map_err(Divergence::Engine)?;
        self.inputs.restore(&mut larger);
        self.state.restore(&mut larger);
        self.data = larger;
        self.growths += 1;
        Ok(())
    }

    fn quarantine(&mut self, reason: Divergence) {
        self.status = EnvStatus::Diverged { step: self.steps, reason };
        self.data.reset();
        self.inputs.restore(&mut self.data);
        self.state.restore(&mut self.data);
        // The last good state had a forward pass before, with this data or a smaller one.
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

/// What happened to an environment.
#[derive(Clone, Debug)]
pub(crate) struct History {
    status: EnvStatus,
    steps: u64,
    warnings: WarningCounts,
    growths: u32,
}

/// What a step leads to, kept only where the step is good.
#[derive(Default)]
struct End {
    /// The new state before its forward pass.
    state: Motion,
    /// Efforts of the drives in the step.
    efforts: Vec<f64>,
}

thread_local! {
    /// One per thread, not per environment: a thousand of them would not stay in the cache.
    static END: Cell<End> = const { Cell::new(End { state: Motion::EMPTY, efforts: Vec::new() }) };
}

enum Verdict {
    Good,
    NeedsRoom(Overflow),
    Bad(Divergence),
}

fn judge(done: Result<(), EngineError>, raised: &WarningCounts) -> Verdict {
    match done {
        Err(error) if error.is_out_of_memory() => Verdict::NeedsRoom(raised.overflow().unwrap_or(Overflow::Stack)),
        Err(error) => Verdict::Bad(Divergence::Engine(error)),
        Ok(()) => match (raised.overflow(), raised.diverged()) {
            (Some(what), _) => Verdict::NeedsRoom(what),
            (None, Some(warning)) => Verdict::Bad(Divergence::Warning(warning)),
            (None, None) => Verdict::Good,
        },
    }
}

/// The model with buffers for [`Env`] to start with: small, they grow on demand.
pub fn with_small_buffers(model: &mj::Model) -> mj::Model {
    model.with_buffers(model.small_buffers())
}
