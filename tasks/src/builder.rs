//! Builder of tasks from terms.

use crate::action::ActionTerm;
use crate::cfg::EnvCfg;
use crate::command::CommandTerm;
use crate::curriculum::CurriculumTerm;
use crate::environment::Env;
use crate::error::{EnvError, Result, TermKind};
use crate::event::EventTerm;
use crate::group::{Group, POLICY_GROUP};
use crate::image::ImageTerm;
use crate::observation::ObservationTerm;
use crate::registry::TaskColumns;
use crate::reward::RewardTerm;
use crate::space::Space;
use crate::termination::TerminationTerm;
use kinetoscope_sim::SimulationManager;

/// Builds an [`Env`] from terms. Terms act in the order in which they are added.
#[derive(Debug)]
pub struct EnvBuilder {
    pub(crate) sim: SimulationManager,
    cfg: EnvCfg,
    pub(crate) terms: Terms,
}

/// The terms of a task.
#[derive(Debug)]
pub(crate) struct Terms {
    pub(crate) actions: Vec<ActionTerm>,
    pub(crate) commands: Vec<CommandTerm>,
    pub(crate) curricula: Vec<CurriculumTerm>,
    pub(crate) events: Vec<EventTerm>,
    /// The first one is the group of the policy.
    pub(crate) groups: Vec<Group>,
    pub(crate) rewards: Vec<RewardTerm>,
    pub(crate) terminations: Vec<TerminationTerm>,
}

impl Default for Terms {
    fn default() -> Self {
        Self {
            actions: Vec::new(),
            commands: Vec::new(),
            curricula: Vec::new(),
            events: Vec::new(),
            groups: vec![Group::new(POLICY_GROUP)],
            rewards: Vec::new(),
            terminations: Vec::new(),
        }
    }
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

    /// Adds a curriculum term: a number for each environment.
    #[must_use]
    pub fn curriculum(mut self, term: CurriculumTerm) -> Self {
        self.terms.curricula.push(term);
        self
    }

    /// Adds an observation term to the group [`POLICY_GROUP`]: columns of
    /// [`Step::observations`](crate::Step::observations).
    #[must_use]
    pub fn observation(self, term: ObservationTerm) -> Self {
        self.observation_in(POLICY_GROUP, term)
    }

    /// Adds an observation term to a group, such as `critic`. Read the observations of a group with [`Env::group`].
    #[must_use]
    pub fn observation_in(mut self, group: &str, term: ObservationTerm) -> Self {
        self.terms.group(group).terms.push(term);
        self
    }

    /// Adds images to the group [`POLICY_GROUP`]. Read the images of a group with [`Env::group`].
    #[must_use]
    pub fn image(self, term: ImageTerm) -> Self {
        self.image_in(POLICY_GROUP, term)
    }

    /// Adds images to a group.
    #[must_use]
    pub fn image_in(mut self, group: &str, term: ImageTerm) -> Self {
        self.terms.group(group).images.push(term);
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

    /// Columns of the action and command terms that were added so far.
    pub(crate) fn columns(&self) -> TaskColumns {
        let actions = self.terms.actions.iter().map(|term| (term.name.as_str(), &term.space));
        let commands = self.terms.commands.iter().map(|term| (term.name.clone(), term.columns.clone())).collect();
        TaskColumns { actions: Space::concatenate(actions).names().to_vec(), commands }
    }

    /// Checks the configuration and the terms, as [`build`](Self::build) does.
    ///
    /// # Errors
    /// The errors of [`build`](Self::build), except failures of startup events and of the initial numbers of curricula.
    pub fn check(&self) -> Result<()> {
        self.spaces().map(drop)
    }

    /// Returns the simulation, for example if [`check`](Self::check) found an error.
    pub fn into_sim(self) -> SimulationManager {
        self.sim
    }

    /// Checks the configuration and the terms, and returns the spaces of the observation groups and of the actions.
    fn spaces(&self) -> Result<(Vec<Space>, Space)> {
        let Self { cfg, terms, .. } = self;
        cfg.check()?;
        terms.check()?;
        let mut groups = Vec::new();
        for group in &terms.groups {
            let spaces = group.terms.iter().map(ObservationTerm::space).collect::<Result<Vec<Space>>>()?;
            groups.push(Space::concatenate(group.terms.iter().map(|term| term.name.as_str()).zip(&spaces)));
        }
        let actions = terms.actions.iter().map(|term| (term.name.as_str(), &term.space));
        Ok((groups, Space::concatenate(actions)))
    }

    /// Checks the terms, builds the environments, and runs the [`EventMode::Startup`](crate::EventMode::Startup)
    /// events. No episode begins: call [`Env::reset`] first.
    ///
    /// # Errors
    /// - There is no action column, or the group [`POLICY_GROUP`] has neither a column nor images.
    /// - Two terms of one kind or of one group have the same name, or a name is empty or contains a slash.
    /// - Two columns of a term have the same name.
    /// - A number is out of range, or a startup event or the initial number of a curriculum term fails.
    pub fn build(self) -> Result<Env> {
        let (groups, action_space) = self.spaces()?;
        let Self { sim, cfg, mut terms } = self;
        for (group, space) in terms.groups.iter_mut().zip(groups) {
            group.space = space;
        }
        Env::new(sim, cfg, terms, action_space)
    }
}

impl Terms {
    /// Returns the group called `name`, which is added if it is new.
    pub(crate) fn group(&mut self, name: &str) -> &mut Group {
        let index = self.groups.iter().position(|group| group.name == name).unwrap_or_else(|| {
            self.groups.push(Group::new(name));
            self.groups.len() - 1
        });
        &mut self.groups[index]
    }

    fn check(&self) -> Result<()> {
        let missing = |kind| Err(EnvError::NoTerm { kind });
        if self.actions.iter().all(|term| term.space.is_empty()) {
            return missing(TermKind::Action);
        }
        if self.groups[0].images.is_empty() && self.groups[0].terms.iter().all(|term| term.columns.is_empty()) {
            return missing(TermKind::Observation);
        }
        distinct(TermKind::Action, self.actions.iter().map(|term| &term.name))?;
        distinct(TermKind::Command, self.commands.iter().map(|term| &term.name))?;
        distinct(TermKind::Event, self.events.iter().map(|term| &term.name))?;
        distinct(TermKind::Curriculum, self.curricula.iter().map(|term| &term.name))?;
        for group in &self.groups {
            if group.name.is_empty() || group.name.contains('/') {
                let (field, value) = ("the name of an observation group".into(), format!("{:?}", group.name));
                return Err(EnvError::Config { field, value, expected: "it must not be empty or contain a slash" });
            }
            let columns = group.terms.iter().map(|term| &term.name);
            distinct(TermKind::Observation, columns.chain(group.images.iter().map(|term| &term.name)))?;
            group.images.iter().try_for_each(ImageTerm::check)?;
        }
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
