//! Types of terms by name.

use crate::action::ActionTerm;
use crate::command::CommandTerm;
use crate::curriculum::CurriculumTerm;
use crate::error::{EnvError, Result, TermKind};
use crate::event::EventTerm;
use crate::image::ImageTerm;
use crate::observation::ObservationTerm;
use crate::reward::RewardTerm;
use crate::termination::TerminationTerm;
use kinetoscope_sensors::Sensor;
use kinetoscope_sim::{RobotId, SensorId, SimulationManager};
use serde::de::DeserializeOwned;
use std::fmt;
use toml::Table;

/// Name and numbers of a term in a [`TaskCfg`](crate::TaskCfg), for the function that creates it.
#[derive(Debug)]
pub struct TermArgs<'a> {
    sim: &'a SimulationManager,
    name: &'a str,
    place: &'a str,
    weight: f64,
    table: Table,
    columns: &'a TaskColumns,
}

/// Columns of the terms that are already part of a task.
#[derive(Debug, Default)]
pub(crate) struct TaskColumns {
    /// Columns of the actions, named `term/column`.
    pub(crate) actions: Vec<String>,
    /// Name and columns of each command term.
    pub(crate) commands: Vec<(String, Vec<String>)>,
}

impl<'a> TermArgs<'a> {
    pub(crate) fn new(
        sim: &'a SimulationManager,
        columns: &'a TaskColumns,
        (name, place): (&'a str, &'a str),
        weight: f64,
        table: Table,
    ) -> Self {
        Self { sim, name, place, weight, table, columns }
    }

    /// Columns of the action terms, named `term/column`; for an action term, those of the action terms before it.
    pub fn action_columns(&self) -> &'a [String] {
        &self.columns.actions
    }

    /// Columns of the command term called `name`.
    ///
    /// # Errors
    /// There is no such command term, or it is created after this term (action terms come before commands); the error
    /// lists the existing ones.
    pub fn command_columns(&self, name: &str) -> Result<&'a [String]> {
        let commands = &self.columns.commands;
        let found = commands.iter().find(|(of, _)| of == name).map(|(_, columns)| columns.as_slice());
        let names = || commands.iter().map(|(of, _)| of.as_str());
        found.ok_or_else(|| self.at(EnvError::unknown("command", name, names())))
    }

    /// The simulation.
    pub fn sim(&self) -> &'a SimulationManager {
        self.sim
    }

    /// Name of the term.
    pub fn name(&self) -> &'a str {
        self.name
    }

    /// Weight of a reward term; 1 for other kinds.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// Reads the numbers of the term. `P` should reject unknown keys (`#[serde(deny_unknown_fields)]`).
    ///
    /// # Errors
    /// A key is unknown or missing, or a value has another type. The error names the term.
    pub fn params<P: DeserializeOwned>(&self) -> Result<P> {
        self.table.clone().try_into().map_err(|error: toml::de::Error| self.error(error.message()))
    }

    /// The robot called `uid`, or the only robot of the simulation if it is `None`.
    ///
    /// # Errors
    /// There is no such robot, or several and no name; the error lists their names.
    pub fn robot(&self, uid: Option<&str>) -> Result<RobotId> {
        let robots = self.sim.entities().robot_ids();
        match (uid, &robots[..]) {
            (Some(uid), _) => {
                let found = robots.iter().find(|(name, _)| *name == uid).map(|(_, id)| *id);
                found.ok_or_else(|| self.at(EnvError::unknown("robot", uid, robots.iter().map(|(name, _)| *name))))
            }
            (None, [(_, id)]) => Ok(*id),
            (None, []) => Err(self.error("the simulation has no robot")),
            (None, _) => {
                let names: Vec<&str> = robots.iter().map(|(name, _)| *name).collect();
                Err(self.error(format!("the key `robot` is missing; the robots are {}", names.join(", "))))
            }
        }
    }

    /// The sensor called `uid`, of type `S`.
    ///
    /// # Errors
    /// There is no such sensor; the error lists those of this type.
    pub fn sensor<S: Sensor>(&self, uid: &str) -> Result<SensorId<S>> {
        let mut sensors = self.sim.entities().sensor_ids::<S>();
        match sensors.iter().position(|(name, _)| name == uid) {
            Some(index) => Ok(sensors.swap_remove(index).1),
            None => {
                let names = sensors.iter().map(|(name, _)| name.as_str());
                Err(self.at(EnvError::unknown("sensor of the required type", uid, names)))
            }
        }
    }

    /// Creates an error at the place of this term.
    pub fn error(&self, error: impl fmt::Display) -> EnvError {
        EnvError::TaskText { place: self.place.into(), error: error.to_string() }
    }

    /// Adds the place of this term to an error, unless it has a place.
    fn at(&self, error: EnvError) -> EnvError {
        at(self.place, error)
    }
}

fn at(place: &str, error: EnvError) -> EnvError {
    match error {
        EnvError::TaskText { .. } | EnvError::TaskTerm { .. } => error,
        error => EnvError::TaskTerm { place: place.into(), error: Box::new(error) },
    }
}

type Make<T> = Box<dyn Fn(&TermArgs<'_>) -> Result<T> + Send + Sync>;

/// Types of one kind of terms.
pub(crate) struct TypeList<T>(Vec<(String, Make<T>)>);

impl<T> Default for TypeList<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> TypeList<T> {
    /// Adds a type, which replaces an earlier one of the same name.
    pub(crate) fn add(&mut self, name: &str, make: impl Fn(&TermArgs<'_>) -> Result<T> + Send + Sync + 'static) {
        self.0.retain(|(of, _)| of != name);
        self.0.push((name.into(), Box::new(make)));
    }

    pub(crate) fn names(&self) -> Vec<&str> {
        self.0.iter().map(|(name, _)| name.as_str()).collect()
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|(of, _)| of == name)
    }

    /// Creates a term of the type `name`.
    pub(crate) fn make(&self, kind: TermKind, name: &str, args: TermArgs<'_>) -> Result<T> {
        self.make_or(kind, name, args, &[])
    }

    /// Creates a term of the type `name`; `more` are further names for the error.
    pub(crate) fn make_or(&self, kind: TermKind, name: &str, args: TermArgs<'_>, more: &[&str]) -> Result<T> {
        let place = args.place;
        match self.0.iter().find(|(of, _)| of == name) {
            Some((_, make)) => make(&args).map_err(|error| at(place, error)),
            None => {
                let what = match kind {
                    TermKind::Action => "type of action term",
                    TermKind::Command => "type of command term",
                    TermKind::Curriculum => "type of curriculum term",
                    TermKind::Event => "type of event term",
                    TermKind::Observation => "type of observation term",
                    TermKind::Reward => "type of reward term",
                    TermKind::Termination => "type of termination term",
                };
                Err(at(place, EnvError::unknown(what, name, self.names().into_iter().chain(more.iter().copied()))))
            }
        }
    }
}

/// Types of terms by name, for tasks as text. The default has the ready-made terms of [`terms`](mod@crate::terms); add
/// the terms of your own crate:
///
/// ```
/// use kinetoscope_tasks::{RewardTerm, TermRegistry};
///
/// #[derive(serde::Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Params {
///     robot: Option<String>,
/// }
///
/// let mut registry = TermRegistry::default();
/// registry.add_reward("root_height", |args| {
///     let robot = args.robot(args.params::<Params>()?.robot.as_deref())?;
///     Ok(RewardTerm::new(args.name(), args.weight(), move |now| {
///         Ok(now.sim().robot(robot).root_pose().column(2).to_owned())
///     }))
/// });
/// assert!(registry.names(kinetoscope_tasks::TermKind::Reward).contains(&"root_height"));
/// ```
pub struct TermRegistry {
    pub(crate) actions: TypeList<ActionTerm>,
    pub(crate) commands: TypeList<CommandTerm>,
    pub(crate) curricula: TypeList<CurriculumTerm>,
    pub(crate) events: TypeList<EventTerm>,
    pub(crate) images: TypeList<ImageTerm>,
    pub(crate) observations: TypeList<ObservationTerm>,
    pub(crate) rewards: TypeList<RewardTerm>,
    pub(crate) terminations: TypeList<TerminationTerm>,
}

impl TermRegistry {
    /// A registry without any type.
    pub fn empty() -> Self {
        Self {
            actions: TypeList::default(),
            commands: TypeList::default(),
            curricula: TypeList::default(),
            events: TypeList::default(),
            images: TypeList::default(),
            observations: TypeList::default(),
            rewards: TypeList::default(),
            terminations: TypeList::default(),
        }
    }

    /// Names of the types of a kind. Those of observations include images.
    pub fn names(&self, kind: TermKind) -> Vec<&str> {
        match kind {
            TermKind::Action => self.actions.names(),
            TermKind::Command => self.commands.names(),
            TermKind::Curriculum => self.curricula.names(),
            TermKind::Event => self.events.names(),
            TermKind::Observation => [self.observations.names(), self.images.names()].concat(),
            TermKind::Reward => self.rewards.names(),
            TermKind::Termination => self.terminations.names(),
        }
    }
}

/// Declares the methods that add a type.
macro_rules! add_methods {
    ($($(#[$doc:meta])* $add:ident: $list:ident, $Term:ty;)*) => {
        impl TermRegistry {
            $($(#[$doc])*
            pub fn $add(&mut self, name: &str, make: impl Fn(&TermArgs<'_>) -> Result<$Term> + Send + Sync + 'static) {
                self.$list.add(name, make);
            })*
        }
    };
}

add_methods! {
    /// Adds a type of action terms, which replaces an earlier one of the same name.
    add_action: actions, ActionTerm;
    /// Adds a type of command terms, which replaces an earlier one of the same name.
    add_command: commands, CommandTerm;
    /// Adds a type of curriculum terms, which replaces an earlier one of the same name.
    add_curriculum: curricula, CurriculumTerm;
    /// Adds a type of event terms, which replaces an earlier one of the same name.
    add_event: events, EventTerm;
    /// Adds a type of images, which replaces an earlier one of the same name. A type of images has precedence over a
    /// type of observations.
    add_image: images, ImageTerm;
    /// Adds a type of observation terms, which replaces an earlier one of the same name.
    add_observation: observations, ObservationTerm;
    /// Adds a type of reward terms, which replaces an earlier one of the same name.
    add_reward: rewards, RewardTerm;
    /// Adds a type of termination terms, which replaces an earlier one of the same name.
    add_termination: terminations, TerminationTerm;
}

impl fmt::Debug for TermRegistry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("TermRegistry");
        out.field("actions", &self.actions.names()).field("commands", &self.commands.names());
        out.field("curricula", &self.curricula.names()).field("events", &self.events.names());
        out.field("observations", &self.names(TermKind::Observation)).field("rewards", &self.rewards.names());
        out.field("terminations", &self.terminations.names()).finish()
    }
}
