//! Tasks for learning agents, read as tasks in files are.

use crate::arguments::array;
use crate::cfg;
use crate::errors::{Class, Failure};
use crate::shared::{Shared, equal_handles, interruptible};
use crate::simulation::Simulation;
use crate::values::Values;
use kinetoscope::ndarray::{Array1, Ix1, Ix2};
use kinetoscope::sim::SimulationManager;
use kinetoscope::tasks::{
    AutoresetMode, Env, EnvBuilder, EnvError, ImageBatch, ImageElement, ObservationGroup, POLICY_GROUP, Space, TaskCfg,
    TermRegistry,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A task for learning agents in the environments of a simulation.
///
/// ``cfg`` is a ``TaskCfg`` or a dict of its fields: ``decimation`` (physics steps in a step), ``episode_steps`` (limit of an episode), ``autoreset``
/// ("next_step", "same_step" or "disabled", as in Gymnasium), and the terms ``actions``, ``commands``, ``curricula``,
/// ``events``, ``rewards`` and ``terminations``, dicts by name whose ``type`` is the name of a ready-made term of Rust.
/// ``observations`` is a dict of groups of terms; the group ``policy`` is that of ``reset`` and ``step``. ``dtype`` is
/// the type of observations, "float64" or "float32". The simulation is usable between steps; ``close`` ends the task.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Task {
    shared: Arc<Shared>,
    /// Number of the task, which tells it from later ones of the simulation.
    number: u64,
    /// True for observations in single precision.
    is_single: bool,
    /// True if steps take so long that a step must handle signals; at the first step, which is not known.
    is_slow: AtomicBool,
}

/// Wall time of a step from which on it handles signals itself. It costs a thread, and physics steps in smaller blocks.
const SLOW_STEP: Duration = Duration::from_millis(100);

equal_handles! { Task: number }

/// Observations, rewards, terminated, truncated, and the dict of everything else.
type StepResult<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyDict>);

/// Names, lower and upper bounds of columns.
type Columns = (Vec<String>, Vec<f64>, Vec<f64>);

/// Builds a task. The simulation comes back with an error of the configuration.
fn build(sim: SimulationManager, cfg: &TaskCfg) -> Result<Env, (Failure, Option<Box<SimulationManager>>)> {
    let lengths = match cfg.env_cfg() {
        Ok(lengths) => lengths,
        Err(error) => return Err((error.into(), Some(Box::new(sim)))),
    };
    let mut builder = EnvBuilder::new(sim, lengths);
    match builder.add_terms(cfg, &TermRegistry::default()).and_then(|()| builder.check()) {
        Ok(()) => builder.build().map_err(|error| (error.into(), None)),
        Err(error) => Err((error.into(), Some(Box::new(builder.into_sim())))),
    }
}

/// Present or final observations of a group.
fn observations(group: ObservationGroup<'_>, is_final: bool, is_single: bool) -> Result<Values<'static>, Failure> {
    Ok(match (is_final, is_single) {
        (false, false) => group.observations().to_owned().into(),
        (false, true) => group.observations_f32()?.into(),
        (true, false) => group.final_observations().to_owned().into(),
        (true, true) => group.final_observations_f32()?.into(),
    })
}

fn images(batch: &ImageBatch) -> Result<Values<'static>, Failure> {
    Ok(match batch {
        ImageBatch::U8(images) => images.clone().into(),
        ImageBatch::F32(images) => images.clone().into(),
        ImageBatch::I32(images) => images.clone().into(),
        other => return Err(Failure::new(Class::Internal, format!("images of type {:?}", other.element()))),
    })
}

#[pymethods]
impl Task {
    #[new]
    #[pyo3(signature = (sim, cfg, *, dtype="float64"))]
    fn new(py: Python<'_>, sim: &Bound<'_, Simulation>, cfg: &Bound<'_, PyAny>, dtype: &str) -> PyResult<Self> {
        let is_single = match dtype {
            "float32" => true,
            "float64" => false,
            other => {
                let problem = format!("{other:?} is not a type of observations; expected \"float64\" or \"float32\"");
                return Err(Failure::argument("dtype", problem).into());
            }
        };
        let cfg: TaskCfg = cfg::read("TaskCfg", Some(cfg))?;
        let shared = sim.get().shared.clone();
        let number = shared.start_task(py, |sim| build(sim, &cfg))?;
        Ok(Self { shared, number, is_single, is_slow: AtomicBool::new(true) })
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

    /// Type of observations: "float64" or "float32".
    #[getter]
    fn dtype(&self) -> &'static str {
        if self.is_single { "float32" } else { "float64" }
    }

    /// Mode of automatic resets: "next_step", "same_step" or "disabled".
    #[getter]
    fn autoreset(&self, py: Python<'_>) -> PyResult<&'static str> {
        self.shared.task(py, self.number, |env| {
            Ok(match env.cfg().autoreset {
                AutoresetMode::NextStep => "next_step",
                AutoresetMode::SameStep => "same_step",
                AutoresetMode::Disabled => "disabled",
                other => {
                    return Err(Failure::new(Class::Internal, format!("the autoreset mode {other:?} has no name")));
                }
            })
        })
    }

    /// Limit of an episode in steps, or None.
    #[getter]
    fn episode_steps(&self, py: Python<'_>) -> PyResult<Option<u64>> {
        self.shared.task(py, self.number, |env| Ok(env.cfg().episode_steps))
    }

    /// Duration of a step [s].
    #[getter]
    fn step_dt(&self, py: Python<'_>) -> PyResult<f64> {
        self.shared.task(py, self.number, |env| Ok(env.step_dt()))
    }

    /// Columns of the observations of the group ``policy``: names ``term/column``, lower and upper bounds.
    #[getter]
    fn observation_space(&self, py: Python<'_>) -> PyResult<Columns> {
        self.group_space(py, POLICY_GROUP)
    }

    /// Columns of the actions: names ``term/column``, lower and upper bounds.
    #[getter]
    fn action_space(&self, py: Python<'_>) -> PyResult<Columns> {
        self.shared.task(py, self.number, |env| Ok(columns(env.action_space())))
    }

    /// Names of the reward terms.
    #[getter]
    fn reward_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.task(py, self.number, |env| Ok(env.reward_names().into_iter().map(String::from).collect()))
    }

    /// Names of the observation groups, ``policy`` first.
    #[getter]
    fn group_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.task(py, self.number, |env| Ok(env.groups().map(|group| group.name().to_string()).collect()))
    }

    /// Columns of a group: names ``term/column``, lower and upper bounds.
    fn group_space(&self, py: Python<'_>, group: &str) -> PyResult<Columns> {
        self.shared.task(py, self.number, |env| Ok(columns(env.group(group)?.space())))
    }

    /// Images of a group, by name: shape of one environment (height, width, components), type, lowest and highest value.
    fn image_spaces<'py>(&self, py: Python<'py>, group: &str) -> PyResult<Bound<'py, PyDict>> {
        let spaces = self.shared.task(py, self.number, |env| {
            let spaces = env.group(group)?.image_spaces();
            Ok(spaces.map(|(name, space)| (name.to_string(), space)).collect::<Vec<_>>())
        })?;
        let dict = PyDict::new(py);
        for (name, space) in spaces {
            let element = match space.element {
                ImageElement::U8 => "uint8",
                ImageElement::F32 => "float32",
                _ => "int32",
            };
            let [low, high] = space.bounds;
            dict.set_item(name, ((space.height, space.width, space.components), element, low, high))?;
        }
        Ok(dict)
    }

    /// Observations of a group after the last reset or step, shape (num_envs, columns). With ``final``, those that the
    /// step led to: in an environment whose episode ended, its last ones.
    #[pyo3(signature = (group, *, r#final=false))]
    fn observations<'py>(&self, py: Python<'py>, group: &str, r#final: bool) -> PyResult<Bound<'py, PyAny>> {
        let read = |env: &mut Env| observations(env.group(group)?, r#final, self.is_single);
        Ok(self.shared.task(py, self.number, read)?.into_python(py))
    }

    /// Images of a group after the last reset or step, shape (num_envs, height, width, components). With ``final``, those
    /// that the step led to: in an environment whose episode ended, its last ones.
    #[pyo3(signature = (group, name, *, r#final=false))]
    fn images<'py>(&self, py: Python<'py>, group: &str, name: &str, r#final: bool) -> PyResult<Bound<'py, PyAny>> {
        let read = |env: &mut Env| {
            let group = env.group(group)?;
            images(if r#final { group.final_image(name)? } else { group.image(name)? })
        };
        Ok(self.shared.task(py, self.number, read)?.into_python(py))
    }

    /// Names of the curriculum terms.
    #[getter]
    fn curriculum_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.task(py, self.number, |env| Ok(env.curriculum_names().into_iter().map(String::from).collect()))
    }

    /// Numbers of a curriculum, such as the levels of terrain, shape (num_envs,).
    fn curriculum<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let read = |env: &mut Env| Ok(Values::from(env.context().curriculum(name)?.to_owned()));
        Ok(self.shared.task(py, self.number, read)?.into_python(py))
    }

    /// Sets the numbers of a curriculum, shape (num_envs,), to continue an earlier run. They take effect at the next
    /// resets.
    fn set_curriculum(&self, py: Python<'_>, name: &str, values: &Bound<'_, PyAny>) -> PyResult<()> {
        let values = array::<Ix1>(values, "set_curriculum, values")?.to_vec();
        self.shared.task(py, self.number, |env| Ok(env.set_curriculum(name, &values)?))
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
        let values = self.shared.task(py, self.number, |env| {
            env.reset(mask.as_deref(), seed)?;
            observations(env.group(POLICY_GROUP)?, false, self.is_single)
        })?;
        Ok((values.into_python(py), PyDict::new(py)))
    }

    /// One step with actions, shape (num_envs, columns). Returns observations, rewards, terminated, truncated and a dict
    /// of ``final_observations``, ``reward_terms`` (num_envs, terms) and ``ended`` (episodes that ended: dicts). By
    /// default, an environment whose episode ends begins the next one in the same step (``autoreset``). Ctrl+C ends a long step,
    /// after which all environments have to be reset.
    fn step<'py>(&self, py: Python<'py>, actions: &Bound<'_, PyAny>) -> PyResult<StepResult<'py>> {
        let actions = array::<Ix2>(actions, "step, actions")?;
        let started = Instant::now();
        let results = |env: &mut Env, step| {
            let values = |is_final| observations(env.group(POLICY_GROUP)?, is_final, self.is_single);
            Ok((step, values(false)?, values(true)?))
        };
        let (step, present, last) = if self.is_slow.load(Ordering::Relaxed) {
            interruptible(py, |stop| {
                self.shared.task_detached(stop, self.number, |env| {
                    let step = env.step_until(stop, &actions)?;
                    results(env, step)
                })
            })?
        } else {
            self.shared.task(py, self.number, |env| {
                let step = env.step(&actions)?;
                results(env, step)
            })?
        };
        self.is_slow.store(started.elapsed() > SLOW_STEP, Ordering::Relaxed);
        let info = PyDict::new(py);
        info.set_item("final_observations", last.into_python(py))?;
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
            present.into_python(py),
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

fn columns(space: &Space) -> Columns {
    (space.names().to_vec(), space.low().to_vec(), space.high().to_vec())
}

impl From<EnvError> for Failure {
    fn from(error: EnvError) -> Self {
        fn class(error: &EnvError) -> Class {
            match error {
                EnvError::Sim(error) => Class::of(error),
                EnvError::TaskTerm { error, .. } => class(error),
                EnvError::UnknownName { .. } => Class::UnknownName,
                EnvError::Shape { .. }
                | EnvError::NotFinite { .. }
                | EnvError::ResetFirst { .. }
                | EnvError::EpisodeEnded { .. } => Class::Argument,
                _ => Class::Config,
            }
        }
        Self::caused(class(&error), &error)
    }
}
