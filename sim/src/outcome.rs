//! What comes of the steps of a task, for those who look at its simulation.

use crate::error::{Error, Result};
use crate::manager::SimulationManager;
use crate::observer::Moment;
use ndarray::Array1;

/// What came of one step of a task, in each environment.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// What was earned.
    pub rewards: Array1<f64>,
    /// Whether the episode ended because the task is done, or failed.
    pub terminated: Array1<bool>,
    /// Whether it was cut off, by a limit of time or from outside.
    pub truncated: Array1<bool>,
}

impl Outcome {
    /// Nothing was earned, and nothing ended.
    fn nothing(num_envs: usize) -> Self {
        let none = Array1::from_elem(num_envs, false);
        Self { rewards: Array1::zeros(num_envs), terminated: none.clone(), truncated: none }
    }
}

impl SimulationManager {
    /// What came of the last step of the task that runs in this simulation; before the first, that nothing was earned. `None` where
    /// there is no task.
    pub fn outcome(&self) -> Option<&Outcome> {
        self.outcome.as_ref()
    }

    /// A task runs in this simulation from now on: it will tell what comes of its steps ([`judge`](Self::judge)).
    pub fn begin_task(&mut self) {
        self.outcome = Some(Outcome::nothing(self.num_envs()));
    }

    /// No task runs here any more.
    pub fn end_task(&mut self) {
        self.outcome = None;
    }

    /// Tells observers what came of a step of a task ([`Moment::Judged`]): right after its last physics step, before environments
    /// whose episode ended are reset.
    ///
    /// # Errors
    /// There is not one of everything for each environment; then nothing is told.
    pub fn judge(&mut self, outcome: Outcome) -> Result<()> {
        let Outcome { rewards, terminated, truncated } = &outcome;
        for (argument, found) in
            [("rewards", rewards.len()), ("terminated", terminated.len()), ("truncated", truncated.len())]
        {
            if found != self.num_envs() {
                let (found, expected) = (vec![found], vec![self.num_envs()]);
                return Err(Error::Shape { argument, found, expected, meaning: "environments" });
            }
        }
        self.outcome = Some(outcome);
        self.tell_all(&Moment::Judged);
        Ok(())
    }
}
