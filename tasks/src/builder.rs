//! Builder of tasks from terms.

use crate::action::ActionTerm;
use crate::cfg::EnvCfg;
use crate::command::CommandTerm;
use crate::environment::Env;
use crate::error::{EnvError, Result, TermKind};
use crate::event::EventTerm;
use crate::observation::ObservationTerm;
use crate::reward::RewardTerm;
use crate::space::Space;
use crate::termination::TerminationTerm;
use kinetoscope_sim::SimulationManager;

/// Builds an [`Env`] from terms. Terms act in the order in which they are added.
#[derive(Debug)]
pub struct EnvBuilder {
    sim: SimulationManager,
    cfg: EnvCfg,
    terms: Terms,
}

/// The terms of a task.
#[derive(Debug, Default)]
pub(crate) struct Terms {
    pub(crate) actions: Vec<ActionTerm>,
    pub(crate) commands: Vec<CommandTerm>,
    pub(crate) events: Vec<EventTerm>,
    pub(crate) observations: Vec<ObservationTerm>,
    pub(crate) rewards: Vec<RewardTerm>,
    pub(crate) terminations: Vec<TerminationTerm>,
}

impl EnvBuilder {
    /// Starts a task in the environments of `sim`, with its robots, objects and sensors.
    pub fn new(sim: SimulationManager, cfg: EnvCfg) -> Self {
        Self { sim, cfg, terms: Terms::default() }
    }

    /// Read access to the simulation, for terms that need it when they are created.
    pub fn sim(&self) -> &SimulationManager {
        &self.sim
    }

    /// Adds an action term: columns of the actions.
    #[must_use]
    pub fn action(mut self, term: ActionTerm) -> Self {
        self.terms.actions.push(term);
        self
    }

    /// Adds a command term: goals of an episode.
    #[must_use]
    pub fn command(mut self, term: CommandTerm) -> Self {
        self.terms.commands.push(term);
        self
    }

    /// Adds an event term.
    #[must_use]
    pub fn event(mut self, term: EventTerm) -> Self {
        self.terms.events.push(term);
        self
    }

    /// Adds an observation term: columns of the observations.
    #[must_use]
    pub fn observation(mut self, term: ObservationTerm) -> Self {
        self.terms.observations.push(term);
        self
    }

    /// Adds a reward term.
    #[must_use]
    pub fn reward(mut self, term: RewardTerm) -> Self {
        self.terms.rewards.push(term);
        self
    }

    /// Adds a termination term.
    #[must_use]
    pub fn termination(mut self, term: TerminationTerm) -> Self {
        self.terms.terminations.push(term);
        self
    }

    /// Checks the configuration and the terms, as [`build`](Self::build) does.
    ///
    /// # Errors
    /// The errors of [`build`](Self::build), except those of events.
    pub fn check(&self) -> Result<()> {
        self.spaces().map(drop)
    }

    /// Returns the simulation, for example if [`check`](Self::check) found an error.
    pub fn into_sim(self) -> SimulationManager {
        self.sim
    }

    /// Spaces of the observations and of the actions, of checked terms.
    fn spaces(&self) -> Result<[Space; 2]> {
        let Self { cfg, terms, .. } = self;
        cfg.check()?;
        terms.check()?;
        let observation_spaces =
            terms.observations.iter().map(ObservationTerm::space).collect::<Result<Vec<Space>>>()?;
        let observations = terms.observations.iter().map(|term| term.name.as_str()).zip(&observation_spaces);
        let actions = terms.actions.iter().map(|term| (term.name.as_str(), &term.space));
        Ok([Space::concatenate(observations), Space::concatenate(actions)])
    }

    /// Checks the terms, builds the environments, and runs the [`EventMode::Startup`](crate::EventMode::Startup)
    /// events. No episode begins: call [`Env::reset`] first.
    ///
    /// # Errors
    /// - There is no action or observation column.
    /// - Two terms of one kind have the same name, or a name is empty or contains a slash.
    /// - Two columns of a term have the same name.
    /// - A number is out of range, or an event fails.
    pub fn build(self) -> Result<Env> {
        let spaces = self.spaces()?;
        let Self { sim, cfg, terms } = self;
        Env::new(sim, cfg, terms, spaces)
    }
}

impl Terms {
    fn check(&self) -> Result<()> {
        let missing = |kind| Err(EnvError::NoTerm { kind });
        if self.actions.iter().all(|term| term.space.is_empty()) {
            return missing(TermKind::Action);
        }
        if self.observations.iter().all(|term| term.columns.is_empty()) {
            return missing(TermKind::Observation);
        }
        distinct(TermKind::Action, self.actions.iter().map(|term| &term.name))?;
        distinct(TermKind::Command, self.commands.iter().map(|term| &term.name))?;
        distinct(TermKind::Event, self.events.iter().map(|term| &term.name))?;
        distinct(TermKind::Observation, self.observations.iter().map(|term| &term.name))?;
        distinct(TermKind::Reward, self.rewards.iter().map(|term| &term.name))?;
        distinct(TermKind::Termination, self.terminations.iter().map(|term| &term.name))?;
        self.commands.iter().try_for_each(CommandTerm::check)?;
        self.events.iter().try_for_each(EventTerm::check)?;
        self.rewards.iter().try_for_each(RewardTerm::check)
    }
}

fn distinct<'n>(kind: TermKind, names: impl Iterator<Item = &'n String>) -> Result<()> {
    let mut seen: Vec<&String> = Vec::new();
    for name in names {
        // Names are parts of random number keys and of column names, with a slash as the separator.
        if name.is_empty() || name.contains('/') {
            return Err(EnvError::TermName { kind, name: name.clone() });
        }
        if seen.contains(&name) {
            return Err(EnvError::RepeatedTerm { kind, name: name.clone() });
        }
        seen.push(name);
    }
    Ok(())
}
