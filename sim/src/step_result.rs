//! Event of tasks: rewards and ends of a step. Tasks publish it and recorders receive it; nothing of it is kept here.

use crate::error::{Error, Result};
use crate::manager::SimulationManager;
use ndarray::Array1;

/// Rewards and ends of one step of a task, in each environment.
#[derive(Clone, Debug, PartialEq)]
pub struct StepResult {
    /// Rewards, shape (N,).
    pub rewards: Array1<f64>,
    /// True if the episode ended because the task is done, or failed, shape (N,).
    pub terminated: Array1<bool>,
    /// True if the episode was cut off, by a limit of time or from outside, shape (N,).
    pub truncated: Array1<bool>,
}

impl StepResult {
    /// Publishes it to the observers of a simulation ([`ObserversMut::publish`](crate::ObserversMut::publish)). A task does so right after the last physics
    /// step of its step, before environments whose episode ended are reset.
    ///
    /// # Errors
    /// There is not one of everything for each environment; then nothing is published.
    pub fn publish(&self, sim: &mut SimulationManager) -> Result<()> {
        for (argument, found) in [
            ("rewards", self.rewards.len()),
            ("terminated", self.terminated.len()),
            ("truncated", self.truncated.len()),
        ] {
            if found != sim.num_envs() {
                let (found, expected) = (vec![found], vec![sim.num_envs()]);
                return Err(Error::Shape { argument, found, expected, meaning: "environments" });
            }
        }
        sim.observers_mut().publish(self);
        Ok(())
    }
}
