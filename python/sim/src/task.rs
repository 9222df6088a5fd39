//! Tasks for learning agents: the ready-made terms by name.

use crate::arguments::array;
use crate::cfg;
use crate::errors::{Class, Failure};
use crate::sensor::id_of;
use crate::shared::{Entity, Shared};
use crate::simulation::Simulation;
use crate::values::Values;
use kinetoscope::ndarray::{Array1, Ix2};
use kinetoscope::sensors::ContactSensor;
use kinetoscope::sim::{RobotId, SimulationManager};
use kinetoscope::tasks::terms::{self, RootRanges};
use kinetoscope::tasks::{
    ActionTerm, AutoresetMode, CommandTerm, EnvBuilder, EnvCfg, EnvError, EpisodeRng, EventTerm, Noise,
    ObservationTerm, RewardTerm, Space, TerminationTerm,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::sync::Arc;
use toml::{Table, Value};

/// A task for learning agents in the environments of a simulation.
///
/// ``cfg`` is a dict: ``decimation`` (physics steps in a step), ``episode_steps`` (limit of an episode), ``autoreset``
/// ("next_step", "same_step" or "disabled", as in Gymnasium), and the terms
/// ``actions``, ``commands``, ``observations``, ``rewards``, ``terminations`` and ``events``, dicts by name whose
/// ``type`` is the name of a ready-made term of Rust. The simulation is usable between steps; ``close`` ends the task.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Task {
    shared: Arc<Shared>,
    /// Number of the task, which tells it from later ones of the simulation.
    number: u64,
}

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct TaskCfg {
    decimation: u32,
    episode_steps: Option<u64>,
    autoreset: AutoresetMode,
    actions: Table,
    commands: Table,
    observations: Table,
    rewards: Table,
    terminations: Table,
    events: Table,
}

impl Default for TaskCfg {
    fn default() -> Self {
        let EnvCfg { decimation, episode_steps, autoreset } = EnvCfg::default();
        let none = Table::new;
        Self {
            decimation,
            episode_steps,
            autoreset,
            actions: none(),
            commands: none(),
            observations: none(),
            rewards: none(),
            terminations: none(),
            events: none(),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
enum Action {
    JointEfforts { robot: String, joints: Vec<String>, bound: f64 },
    RelativeJointPositions { robot: String, joints: Vec<String>, step: f64 },
}

/// Ranges of the columns of a command, in their order.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Command {
    columns: Table,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
enum Observation {
    JointPosRel { robot: String, joints: Vec<String> },
    JointVel { robot: String, joints: Vec<String> },
    BaseLinVel { robot: String },
    BaseAngVel { robot: String },
    ProjectedGravity { robot: String },
    LastAction {},
    GeneratedCommands { command: String },
}

/// Fields of every observation term.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Processing {
    /// Standard deviation.
    noise: Option<f64>,
    clip: Option<[f64; 2]>,
    scale: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
enum Reward {
    IsAlive { weight: f64 },
    ActionRate { weight: f64 },
    FlatOrientation { weight: f64, robot: String },
    JointTorquesL2 { weight: f64, robot: String, joints: Vec<String> },
    TrackLinVel { weight: f64, robot: String, command: String, std: f64 },
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
enum Termination {
    TimeOut { steps: u64 },
    BadOrientation { robot: String, angle: f64 },
    RootHeightBelowMinimum { robot: String, height: f64 },
    JointOutOfLimits { robot: String, joints: Vec<String> },
    IllegalContact { sensor: String, force: f64 },
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
enum Event {
    ResetJointsByOffset {
        robot: String,
        joints: Vec<String>,
        #[serde(default)]
        positions: [f64; 2],
        #[serde(default)]
        velocities: [f64; 2],
    },
    ResetRootUniform {
        robot: String,
        #[serde(default)]
        position: [[f64; 2]; 3],
        #[serde(default)]
        rpy: [[f64; 2]; 3],
        #[serde(default)]
        linear: [[f64; 2]; 3],
        #[serde(default)]
        angular: [[f64; 2]; 3],
    },
}

/// The terms of one kind, in their order.
fn read<T: DeserializeOwned>(kind: &str, terms: &Table) -> Result<Vec<(String, T)>, Failure> {
    let one = |(name, value): (&String, &Value)| {
        let invalid =
            |error: toml::de::Error| Failure::new(Class::Config, format!("{kind}.{name}: {}", error.message()));
        Ok((name.clone(), value.clone().try_into().map_err(invalid)?))
    };
    terms.iter().map(one).collect()
}

/// Robots by name, and the simulation, while terms are created.
struct Names<'s> {
    shared: &'s Shared,
    sim: &'s SimulationManager,
}

impl Names<'_> {
    fn robot(&self, name: &str) -> Result<RobotId, Failure> {
        match self.shared.find(name)? {
            Entity::Robot(id) => Ok(id),
            _ => Err(Failure::new(Class::UnknownName, format!("{name:?} is not a robot or an articulation"))),
        }
    }

    fn action(&self, name: &str, cfg: &Action) -> Result<(ActionTerm, Vec<String>), Failure> {
        let (Action::JointEfforts { robot, joints, .. } | Action::RelativeJointPositions { robot, joints, .. }) = cfg;
        let (robot, joints) = (self.robot(robot)?, texts(joints));
        let term = match cfg {
            Action::JointEfforts { bound, .. } => terms::joint_efforts(self.sim, name, robot, &joints, *bound)?,
            Action::RelativeJointPositions { step, .. } => {
                terms::relative_joint_positions(self.sim, name, robot, &joints, *step)?
            }
        };
        let robot = self.sim.robot(robot);
        let columns =
            robot.find_joints(&joints)?.into_iter().map(|joint| format!("{name}/{}", robot.joint_names()[joint.0]));
        Ok((term, columns.collect()))
    }

    fn observation(
        &self,
        name: &str,
        cfg: &Observation,
        actions: &[String],
        commands: &[(String, Vec<String>)],
    ) -> Result<ObservationTerm, Failure> {
        Ok(match cfg {
            Observation::JointPosRel { robot, joints } => {
                terms::joint_pos_rel(self.sim, name, self.robot(robot)?, &texts(joints))?
            }
            Observation::JointVel { robot, joints } => {
                terms::joint_vel(self.sim, name, self.robot(robot)?, &texts(joints))?
            }
            Observation::BaseLinVel { robot } => terms::base_lin_vel(name, self.robot(robot)?),
            Observation::BaseAngVel { robot } => terms::base_ang_vel(name, self.robot(robot)?),
            Observation::ProjectedGravity { robot } => terms::projected_gravity(name, self.robot(robot)?),
            Observation::LastAction {} => terms::last_action(name, actions),
            Observation::GeneratedCommands { command } => {
                let columns = commands.iter().find(|(known, _)| known == command).map(|(_, columns)| columns.clone());
                let known: Vec<&str> = commands.iter().map(|(name, _)| name.as_str()).collect();
                let unknown = || {
                    let message =
                        format!("observations.{name}: unknown command {command:?}; known names: {}", known.join(", "));
                    Failure::new(Class::UnknownName, message)
                };
                terms::generated_commands(name, command.as_str(), columns.ok_or_else(unknown)?)
            }
        })
    }

    fn reward(&self, name: &str, cfg: &Reward) -> Result<RewardTerm, Failure> {
        Ok(match cfg {
            Reward::IsAlive { weight } => terms::is_alive(name, *weight),
            Reward::ActionRate { weight } => terms::action_rate(name, *weight),
            Reward::FlatOrientation { weight, robot } => terms::flat_orientation(name, *weight, self.robot(robot)?),
            Reward::JointTorquesL2 { weight, robot, joints } => {
                terms::joint_torques_l2(self.sim, name, *weight, self.robot(robot)?, &texts(joints))?
            }
            Reward::TrackLinVel { weight, robot, command, std } => {
                terms::track_lin_vel(name, *weight, self.robot(robot)?, command.as_str(), *std)
            }
        })
    }

    fn termination(&self, name: &str, cfg: &Termination) -> Result<TerminationTerm, Failure> {
        Ok(match cfg {
            Termination::TimeOut { steps } => terms::time_out(name, *steps),
            Termination::BadOrientation { robot, angle } => terms::bad_orientation(name, self.robot(robot)?, *angle),
            Termination::RootHeightBelowMinimum { robot, height } => {
                terms::root_height_below_minimum(name, self.robot(robot)?, *height)
            }
            Termination::JointOutOfLimits { robot, joints } => {
                terms::joint_out_of_limits(self.sim, name, self.robot(robot)?, &texts(joints))?
            }
            Termination::IllegalContact { sensor, force } => {
                let missing = || {
                    Failure::new(Class::UnknownName, format!("terminations.{name}: {sensor:?} is not a contact sensor"))
                };
                let id = id_of::<ContactSensor>(self.sim, sensor).ok_or_else(missing)?;
                terms::illegal_contact(name, id, *force)
            }
        })
    }

    fn event(&self, name: &str, cfg: &Event) -> Result<EventTerm, Failure> {
        Ok(match cfg {
            Event::ResetJointsByOffset { robot, joints, positions, velocities } => terms::reset_joints_by_offset(
                self.sim,
                name,
                self.robot(robot)?,
                &texts(joints),
                *positions,
                *velocities,
            )?,
            Event::ResetRootUniform { robot, position, rpy, linear, angular } => {
                let ranges = RootRanges { position: *position, rpy: *rpy, linear: *linear, angular: *angular };
                terms::reset_root_uniform(name, self.robot(robot)?, ranges)
            }
        })
    }
}

fn texts(items: &[String]) -> Vec<&str> {
    items.iter().map(String::as_str).collect()
}

/// A command with uniformly distributed columns.
fn command(name: &str, columns: &[(String, [f64; 2])]) -> Result<CommandTerm, Failure> {
    fn of<const K: usize>(name: &str, columns: &[(String, [f64; 2])]) -> CommandTerm {
        let names = std::array::from_fn(|k| columns[k].0.as_str());
        let ranges: [[f64; 2]; K] = std::array::from_fn(|k| columns[k].1);
        CommandTerm::new(name, names, move |rng: &mut EpisodeRng| {
            ranges.map(|[low, high]| rng.uniform_range(low, high))
        })
    }
    match columns.len() {
        1 => Ok(of::<1>(name, columns)),
        2 => Ok(of::<2>(name, columns)),
        3 => Ok(of::<3>(name, columns)),
        4 => Ok(of::<4>(name, columns)),
        6 => Ok(of::<6>(name, columns)),
        7 => Ok(of::<7>(name, columns)),
        count => {
            Err(Failure::new(Class::Config, format!("commands.{name}: {count} columns; a command has 1 to 4, 6 or 7")))
        }
    }
}

/// Adds the terms of a configuration. The simulation comes back with an error.
fn builder(
    shared: &Shared,
    sim: SimulationManager,
    cfg: &TaskCfg,
) -> Result<EnvBuilder, (Failure, Option<Box<SimulationManager>>)> {
    let lengths = EnvCfg { decimation: cfg.decimation, episode_steps: cfg.episode_steps, autoreset: cfg.autoreset };
    let mut builder = EnvBuilder::new(sim, lengths);
    match add_terms(shared, &builder, cfg) {
        Err(failure) => Err((failure, Some(Box::new(builder.into_sim())))),
        Ok(terms) => {
            for term in terms {
                builder = term(builder);
            }
            match builder.check() {
                Ok(()) => Ok(builder),
                Err(error) => Err((error.into(), Some(Box::new(builder.into_sim())))),
            }
        }
    }
}

/// Observations, rewards, terminated, truncated, and the dict of everything else.
type StepResult<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyDict>);

type AddTerm = Box<dyn FnOnce(EnvBuilder) -> EnvBuilder>;

fn add_terms(shared: &Shared, builder: &EnvBuilder, cfg: &TaskCfg) -> Result<Vec<AddTerm>, Failure> {
    let names = Names { shared, sim: builder.sim() };
    let (mut terms, mut actions, mut commands): (Vec<AddTerm>, _, _) = (Vec::new(), Vec::new(), Vec::new());
    for (name, cfg) in read::<Action>("actions", &cfg.actions)? {
        let (term, columns) = names.action(&name, &cfg)?;
        actions.extend(columns);
        terms.push(Box::new(move |builder| builder.action(term)));
    }
    for (name, cfg) in read::<Command>("commands", &cfg.commands)? {
        let columns = read::<[f64; 2]>(&format!("commands.{name}.columns"), &cfg.columns)?;
        let term = command(&name, &columns)?;
        commands.push((name, columns.into_iter().map(|(column, _)| column).collect()));
        terms.push(Box::new(move |builder| builder.command(term)));
    }
    let (mut kinds, mut processing) = (cfg.observations.clone(), Table::new());
    for (name, fields) in &mut kinds {
        let mut own = Table::new();
        if let Value::Table(fields) = fields {
            own.extend(["noise", "clip", "scale"].into_iter().filter_map(|field| fields.remove_entry(field)));
        }
        processing.insert(name.clone(), Value::Table(own));
    }
    let processing = read::<Processing>("observations", &processing)?;
    for ((name, kind), (_, values)) in read::<Observation>("observations", &kinds)?.into_iter().zip(processing) {
        let mut term = names.observation(&name, &kind, &actions, &commands)?;
        if let Some(std) = values.noise {
            term = term.with_noise(Noise::Normal { std });
        }
        if let Some(clip) = values.clip {
            term = term.clipped(clip);
        }
        if let Some(scale) = values.scale {
            term = term.scaled(scale);
        }
        terms.push(Box::new(move |builder| builder.observation(term)));
    }
    for (name, cfg) in read::<Reward>("rewards", &cfg.rewards)? {
        let term = names.reward(&name, &cfg)?;
        terms.push(Box::new(move |builder| builder.reward(term)));
    }
    for (name, cfg) in read::<Termination>("terminations", &cfg.terminations)? {
        let term = names.termination(&name, &cfg)?;
        terms.push(Box::new(move |builder| builder.termination(term)));
    }
    for (name, cfg) in read::<Event>("events", &cfg.events)? {
        let term = names.event(&name, &cfg)?;
        terms.push(Box::new(move |builder| builder.event(term)));
    }
    Ok(terms)
}

#[pymethods]
impl Task {
    #[new]
    fn new(py: Python<'_>, sim: &Bound<'_, Simulation>, cfg: &Bound<'_, PyAny>) -> PyResult<Self> {
        let cfg: TaskCfg = cfg::read("task", Some(cfg))?;
        let shared = sim.get().shared.clone();
        let make = |sim| builder(&shared, sim, &cfg)?.build().map_err(|error| (error.into(), None));
        let number = shared.start_task(py, make)?;
        Ok(Self { shared, number })
    }

    /// The simulation, to serve, record or change it between steps.
    #[getter]
    fn sim(&self) -> Simulation {
        Simulation { shared: self.shared.clone() }
    }

    /// Number of environments.
    #[getter]
    fn num_envs(&self) -> usize {
        self.shared.num_envs()
    }

    /// Duration of a step [s].
    #[getter]
    fn step_dt(&self, py: Python<'_>) -> PyResult<f64> {
        self.shared.task(py, self.number, |env| Ok(env.step_dt()))
    }

    /// Columns of the observations: names ``term/column``, lower and upper bounds.
    #[getter]
    fn observation_space(&self, py: Python<'_>) -> PyResult<(Vec<String>, Vec<f64>, Vec<f64>)> {
        self.shared.task(py, self.number, |env| Ok(columns(env.observation_space())))
    }

    /// Columns of the actions: names ``term/column``, lower and upper bounds.
    #[getter]
    fn action_space(&self, py: Python<'_>) -> PyResult<(Vec<String>, Vec<f64>, Vec<f64>)> {
        self.shared.task(py, self.number, |env| Ok(columns(env.action_space())))
    }

    /// Names of the reward terms.
    #[getter]
    fn reward_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.task(py, self.number, |env| Ok(env.reward_names().into_iter().map(String::from).collect()))
    }

    /// Begins new episodes, in the environments of ``mask`` or in all. Returns the observations, shape (num_envs, columns),
    /// and an empty dict. The same seed gives the same episodes.
    #[pyo3(signature = (seed=None, mask=None))]
    fn reset<'py>(
        &self,
        py: Python<'py>,
        seed: Option<u64>,
        mask: Option<Vec<bool>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyDict>)> {
        let observations = self.shared.task(py, self.number, |env| Ok(env.reset(mask.as_deref(), seed)?))?;
        Ok((Values::from(observations).into_python(py), PyDict::new(py)))
    }

    /// One step with actions, shape (num_envs, columns). Returns observations, rewards, terminated, truncated and a dict
    /// of ``final_observations``, ``reward_terms`` (num_envs, terms) and ``ended`` (episodes that ended: dicts). By
    /// default, an environment whose episode ends begins the next one in the same step (``autoreset``).
    fn step<'py>(&self, py: Python<'py>, actions: &Bound<'_, PyAny>) -> PyResult<StepResult<'py>> {
        let actions = array::<Ix2>(actions, "step, actions")?;
        let step = self.shared.task(py, self.number, |env| Ok(env.step(&actions)?))?;
        let info = PyDict::new(py);
        info.set_item("final_observations", Values::from(step.final_observations).into_python(py))?;
        info.set_item("reward_terms", Values::from(step.info.reward_terms).into_python(py))?;
        let mut ended = Vec::new();
        for episode in step.info.ended {
            let dict = PyDict::new(py);
            dict.set_item("env", episode.env.0)?;
            dict.set_item("reason", episode.reason.to_string())?;
            dict.set_item("steps", episode.steps)?;
            dict.set_item("reward_sums", Values::from(Array1::from_vec(episode.reward_sums)).into_python(py))?;
            ended.push(dict);
        }
        info.set_item("ended", ended)?;
        Ok((
            Values::from(step.observations).into_python(py),
            Values::from(step.rewards).into_python(py),
            Values::from(step.terminated).into_python(py),
            Values::from(step.truncated).into_python(py),
            info,
        ))
    }

    /// Ends the task; its simulation goes on.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.shared.end_task(py, self.number)
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let described = self.shared.task(py, self.number, |env| {
            let (observations, actions) = (env.observation_space().len(), env.action_space().len());
            Ok(format!("<Task: {actions} action and {observations} observation columns, {} envs>", env.num_envs()))
        });
        described.unwrap_or_else(|_| "<Task: closed>".into())
    }
}

fn columns(space: &Space) -> (Vec<String>, Vec<f64>, Vec<f64>) {
    (space.names().to_vec(), space.low().to_vec(), space.high().to_vec())
}

impl From<EnvError> for Failure {
    fn from(error: EnvError) -> Self {
        let class = match &error {
            EnvError::UnknownName { .. } => Class::UnknownName,
            EnvError::Shape { .. } | EnvError::NotFinite { .. } | EnvError::ResetFirst { .. } => Class::Argument,
            _ => Class::Config,
        };
        Self::caused(class, &error)
    }
}
