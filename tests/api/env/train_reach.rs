//! The task of the example `train_reach` keeps what tasks promise.

#[allow(dead_code, unused_imports, reason = "only its task is used")]
#[path = "../../../examples/train_reach.rs"]
mod example;

use clap::Parser;
use example::{Args, TARGETS, task};
use kinetoscope::env::{Env, EnvError, Finding, Info, Space, Step, VectorEnv, check};
use kinetoscope::ndarray::{Array2, ArrayView2};
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

/// Says that nobody knows what was earned.
struct Unsure(Env);

impl VectorEnv for Unsure {
    type Error = EnvError;
    type Info = Info;

    fn num_envs(&self) -> usize {
        self.0.num_envs()
    }

    fn observation_space(&self) -> &Space {
        self.0.observation_space()
    }

    fn action_space(&self) -> &Space {
        self.0.action_space()
    }

    fn reset(&mut self, mask: Option<&[bool]>, seed: Option<u64>) -> Result<Array2<f64>, EnvError> {
        self.0.reset(mask, seed)
    }

    fn step(&mut self, actions: ArrayView2<'_, f64>) -> Result<Step, EnvError> {
        let mut step = self.0.step(actions)?;
        step.rewards.fill(f64::NAN);
        Ok(step)
    }
}

#[test]
fn the_task_keeps_what_tasks_promise() {
    let args = Args::parse_from(["train_reach", "--headless", "--num-envs", "16"]);
    let mut env = task(&args, Arc::new(AtomicUsize::new(TARGETS))).unwrap();
    let findings = check(&mut env, 7);
    assert!(findings.is_empty(), "{}", findings.iter().map(|finding| format!("{finding}\n")).collect::<String>());
    // The control.
    let findings = check(&mut Unsure(env), 7);
    assert!(findings.iter().any(|finding| matches!(finding, Finding::Reward { .. })), "{findings:?}");
}
