//! Lengths of steps and episodes, and the mode of automatic resets.

use crate::autoreset::AutoresetMode;
use crate::error::{EnvError, Result};
use serde::{Deserialize, Serialize};

/// Configuration of a task: lengths of steps and episodes, and the mode of automatic resets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EnvCfg {
    /// Physics steps in one step of the task, at least 1.
    pub decimation: u32,
    /// Steps of the task after which an episode is truncated, at least 1; `None` for no limit.
    pub episode_steps: Option<u64>,
    /// Time at which an environment whose episode ended begins the next one.
    pub autoreset: AutoresetMode,
}

impl Default for EnvCfg {
    /// One physics step in a step of the task, episodes without a limit, and resets in the step in which an episode
    /// ends.
    fn default() -> Self {
        Self { decimation: 1, episode_steps: None, autoreset: AutoresetMode::SameStep }
    }
}

impl EnvCfg {
    pub(crate) fn check(&self) -> Result<()> {
        let wrong = |field: &str, expected| Err(EnvError::Config { field: field.into(), value: "0".into(), expected });
        if self.decimation == 0 {
            return wrong("decimation", "a step has at least 1 physics step");
        }
        if self.episode_steps == Some(0) {
            return wrong("episode_steps", "an episode has at least 1 step; leave it out for no limit");
        }
        Ok(())
    }
}
