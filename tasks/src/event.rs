//! What happens to environments beside what agents do: starts at random places, other masses, pushes.

use crate::dice::Dice;
use crate::error::{EnvError, Result, TermResult};
use kinetoscope_sim::SimulationManager;
use std::fmt;

type Act = Box<dyn Fn(&mut SimulationManager, &mut [Dice]) -> TermResult + Send>;

/// When an event happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum When {
    /// Once, when the task is built, in all environments.
    Startup,
    /// When an episode begins, after the simulation went back to the initial state there.
    Reset,
    /// Again and again in an episode, after steps; from one time to the next there are as many steps as were drawn.
    Interval {
        /// Fewest and most steps, at least 1.
        steps: [u64; 2],
    },
}

/// Something that happens to environments.
///
/// Its random numbers are those of the dice, one for each environment that is concerned; draws from these repeat with the seed
/// that [`Env::reset`](crate::Env::reset) is given. To set properties by them, use
/// [`randomize_with`](kinetoscope_sim::EnvPropertiesMut::randomize_with): [`randomize`](kinetoscope_sim::EnvPropertiesMut::randomize) draws by the seed of the
/// manager, and goes on drawing where it is.
pub struct EventTerm {
    pub(crate) name: String,
    pub(crate) when: When,
    pub(crate) act: Act,
}

impl EventTerm {
    /// Something that happens at a time: `act` gets one die for each environment in which it happens.
    pub fn new(
        name: impl Into<String>,
        when: When,
        act: impl Fn(&mut SimulationManager, &mut [Dice]) -> TermResult + Send + 'static,
    ) -> Self {
        Self { name: name.into(), when, act: Box::new(act) }
    }

    /// Something that happens when an episode begins.
    pub fn on_reset(
        name: impl Into<String>,
        act: impl Fn(&mut SimulationManager, &mut [Dice]) -> TermResult + Send + 'static,
    ) -> Self {
        Self::new(name, When::Reset, act)
    }

    pub(crate) fn check(&self) -> Result<()> {
        match self.when {
            When::Interval { steps: [low, high] } if low == 0 || low > high => {
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
        f.debug_struct("EventTerm").field("name", &self.name).field("when", &self.when).finish_non_exhaustive()
    }
}
