//! Modes of automatic resets.

use crate::error::{EnvError, Result};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Time at which an environment whose episode ended begins the next one: the three modes of Gymnasium's
/// `AutoresetMode`.
///
/// An episode has the same bits in all modes, except for noise of sensors: the calls that return its observations differ,
/// and [`NextStep`](Self::NextStep) does more physics steps, in which sensors draw noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum AutoresetMode {
    /// The step after the end of an episode only begins the next one (`NEXT_STEP`): its action is ignored, the reset
    /// discards its physics steps, its reward is 0, and no episode ends in it. Its observation is the first one of the
    /// new episode. The step in which the episode ended returns the last observation of that episode.
    NextStep,
    /// The step in which an episode ends also begins the next one (`SAME_STEP`). Its observation is the first one of
    /// the new episode; the last one of the old episode is in
    /// [`Step::final_observations`](crate::Step::final_observations), and its length, sums of rewards and reason are in
    /// [`StepInfo::ended`](crate::StepInfo::ended).
    #[default]
    SameStep,
    /// No automatic reset (`DISABLED`). The caller resets the environments whose episode ended, by mask, before the
    /// next step; otherwise the step is an error.
    Disabled,
}

impl AutoresetMode {
    /// All modes.
    pub const ALL: [Self; 3] = [Self::NextStep, Self::SameStep, Self::Disabled];

    /// Name in configuration files: `next_step`, `same_step` or `disabled`.
    pub fn name(self) -> &'static str {
        match self {
            Self::NextStep => "next_step",
            Self::SameStep => "same_step",
            Self::Disabled => "disabled",
        }
    }
}

impl fmt::Display for AutoresetMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for AutoresetMode {
    type Err = EnvError;

    /// Reads the name of a mode, in upper or lower case: `NEXT_STEP`, `same_step`.
    fn from_str(name: &str) -> Result<Self> {
        let modes = Self::ALL.into_iter();
        let found = modes.clone().find(|mode| mode.name().eq_ignore_ascii_case(name));
        found.ok_or_else(|| EnvError::unknown("autoreset mode", name, modes.map(Self::name)))
    }
}
