//! Rewards and episode ends of a task step. Tasks publish this event, recorders receive it, and the simulation does not
//! store it.

use crate::error::{Error, Result};
use crate::manager::SimulationManager;
use ndarray::Array1;

/// Rewards and episode ends of one task step, in each environment.
#[derive(Clone, Debug, PartialEq)]
pub struct StepResult {
    /// Rewards, shape (N,).
    pub rewards: Array1<f64>,
    /// True if the episode ended by success or failure of the task, or by divergence, shape (N,).
    pub terminated: Array1<bool>,
    /// True if the episode was cut off, by a time limit or from outside, shape (N,).
    pub truncated: Array1<bool>,
}

impl StepResult {
    /// Publishes the result to the observers of a simulation ([`ObserversMut::publish`](crate::ObserversMut::publish)).
    /// Tasks call it after the last physics step of a task step, before finished environments are reset.
    ///
    /// # Errors
    /// An array does not have one element per environment; then nothing is published.
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
