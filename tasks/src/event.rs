//! Event terms: random initial states, property changes, pushes.

use crate::context::{EventContext, TaskState};
use crate::episode_rng::EpisodeRng;
use crate::error::{EnvError, Result, TermKind, TermResult};
use crate::guard::guard;
use kinetoscope_sim::SimulationManager;
use std::fmt;

type ApplyEvent = Box<dyn Fn(&mut EventContext<'_>, &mut [EpisodeRng]) -> TermResult + Send>;

/// Time at which an event happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum EventMode {
    /// Once, when the task is built, in all environments. Later resets undo changes of the state, but not of properties
    /// such as masses.
    Startup,
    /// When an episode begins, after the environment was reset to its initial state.
    Reset,
    /// Repeatedly during an episode, after steps in which the episode does not end. The number of steps before the
    /// first event of an episode, and between two events, is drawn anew each time, uniformly from `steps`.
    Interval {
        /// Minimum and maximum number of steps of the task, both included, at least 1.
        steps: [u64; 2],
    },
}

/// A change of the simulation besides the actions, such as a random initial state or a push.
///
/// Its random numbers come from one generator for each affected environment. They repeat with the seed that is given to
/// [`Env::reset`](crate::Env::reset); those of [`EventMode::Startup`] events repeat with the simulation's seed. To
/// randomize properties with them, use [`randomize_with`](kinetoscope_sim::EnvPropertiesMut::randomize_with).
/// [`randomize`](kinetoscope_sim::EnvPropertiesMut::randomize) instead continues the manager's own random numbers,
/// which a reset does not restart.
pub struct EventTerm {
    pub(crate) name: String,
    pub(crate) mode: EventMode,
    apply: ApplyEvent,
}

impl EventTerm {
    /// Creates an event. `act` gets one random number generator for each environment in which the event happens
    /// ([`env_ids`](crate::env_ids) returns these environments), and must change these environments only.
    pub fn new(
        name: impl Into<String>,
        mode: EventMode,
        act: impl Fn(&mut SimulationManager, &mut [EpisodeRng]) -> TermResult + Send + 'static,
    ) -> Self {
        Self::with_context(name, mode, move |now, rngs| act(now.sim_mut(), rngs))
    }

    /// Creates an event whose `act` gets an [`EventContext`]: the simulation, which it may change, and the commands and
    /// curricula of the task. The rules of [`new`](Self::new) apply to `act`.
    pub fn with_context(
        name: impl Into<String>,
        mode: EventMode,
        act: impl Fn(&mut EventContext<'_>, &mut [EpisodeRng]) -> TermResult + Send + 'static,
    ) -> Self {
        Self { name: name.into(), mode, apply: Box::new(act) }
    }

    /// Applies the event in the environments of `rngs`.
    pub(crate) fn apply(&self, state: &mut TaskState, rngs: &mut [EpisodeRng]) -> Result<()> {
        guard(TermKind::Event, &self.name, || (self.apply)(&mut EventContext { state }, rngs))
    }

    /// Creates an event that happens when an episode begins ([`EventMode::Reset`]).
    pub fn on_reset(
        name: impl Into<String>,
        act: impl Fn(&mut SimulationManager, &mut [EpisodeRng]) -> TermResult + Send + 'static,
    ) -> Self {
        Self::new(name, EventMode::Reset, act)
    }

    pub(crate) fn check(&self) -> Result<()> {
        match self.mode {
            EventMode::Interval { steps: [low, high] } if low == 0 || low > high => {
                let field = format!("the interval of the event term {:?}", self.name);
                let (value, expected) = (format!("{low} to {high} steps"), "it must be 1 step or more, in order");
                Err(EnvError::Config { field, value, expected })
            }
            _ => Ok(()),
        }
    }
}

impl fmt::Debug for EventTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("EventTerm").field("name", &self.name).field("mode", &self.mode).finish_non_exhaustive()
    }
}
