//! The task of the example `train_reach` passes the task checks.

#[allow(dead_code, unused_imports, reason = "only its task is used")]
#[path = "../../../examples/train_reach.rs"]
mod example;

use super::checks::{Broken, Fault};
use clap::Parser;
use example::{Args, TARGETS, task};
use kinetoscope::tasks::{Finding, check};
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

#[test]
fn passes_checks() {
    let args = Args::parse_from(["train_reach", "--headless", "--num-envs", "16"]);
    let mut env = task(&args, Arc::new(AtomicUsize::new(TARGETS))).unwrap();
    let findings = check(&mut env, 7);
    assert!(findings.is_empty(), "{}", findings.iter().map(|finding| format!("{finding}\n")).collect::<String>());
    // Control: NaN rewards are found.
    let findings = check(&mut Broken::around(env, Fault::NanReward), 7);
    assert!(findings.iter().any(|finding| matches!(finding, Finding::Reward { .. })), "{findings:?}");
}
