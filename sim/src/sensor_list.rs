//! The sensors of a simulation: built from their configurations, ticked after every step, read by typed handles.

use crate::capture::Capture;
use crate::compile::Simulation;
use crate::env::EnvStatus;
use crate::error::{Error, Result};
use crate::gather;
use crate::manager::EnvId;
use scene::{Marker, SceneState};
use sensors::{Requires, Sensor, SensorCfg, SensorContext, SensorError};
use std::any::Any;
use std::marker::PhantomData;
use std::sync::Arc;

/// Handle of a sensor; valid for the manager that made it.
pub struct SensorId<S> {
    index: usize,
    sensor: PhantomData<fn() -> S>,
}

impl<S> Clone for SensorId<S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<S> Copy for SensorId<S> {}

impl<S> std::fmt::Debug for SensorId<S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "SensorId({})", self.index)
    }
}

type Builder = Box<dyn Fn(&SensorContext) -> Result<Box<dyn Sensor>, SensorError> + Send>;

struct Entry {
    uid: String,
    requires: Requires,
    /// Whether its markers are shown.
    debug_vis: bool,
    build: Builder,
    sensor: Box<dyn Sensor>,
    /// Why it is not updated any more.
    fault: Option<SensorError>,
}

/// All sensors and the state they read.
#[derive(Default)]
pub(crate) struct SensorList {
    entries: Vec<Entry>,
    state: SceneState,
    /// Which of them the current steps make due.
    due: Vec<bool>,
    /// The step of every environment, [`sensors::Phases::STANDS`] for one that is put aside.
    clocks: Vec<u64>,
    /// MuJoCo steps in a physics step.
    substeps: u32,
}

impl std::fmt::Debug for SensorList {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.entries.iter().map(|e| &e.uid)).finish()
    }
}

impl SensorList {
    /// No sensors yet, in a simulation of `substeps` MuJoCo steps in a physics step.
    pub(crate) fn new(substeps: u32) -> Self {
        Self { substeps, ..Self::default() }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// What all sensors together need to see.
    pub(crate) fn requires(&self) -> Requires {
        self.entries.iter().fold(Requires::NONE, |sum, e| sum | e.requires)
    }

    /// Checks that a sensor can be called `uid` and gets what it needs.
    pub(crate) fn check(&self, uid: &str, requires: Requires) -> Result<()> {
        if self.entries.iter().any(|e| e.uid == uid) {
            return Err(Error::DuplicateUid(uid.into()));
        }
        let missing = requires.without(gather::AVAILABLE);
        if missing.is_empty() {
            Ok(())
        } else {
            Err(Error::SensorRequires { sensor: uid.into(), missing: missing.to_string() })
        }
    }

    /// Builds a sensor, checked before, and adds it; on an error nothing was added.
    pub(crate) fn add<C>(
        &mut self,
        uid: String,
        cfg: C,
        simulation: &mut Simulation,
        context: &SensorContext,
    ) -> Result<SensorId<C::Sensor>>
    where
        C: SensorCfg + Send + 'static,
    {
        let (requires, debug_vis) = (cfg.requires(), cfg.debug_vis());
        let build: Builder = Box::new(move |context| Ok(Box::new(cfg.build(context)?) as Box<dyn Sensor>));
        let mut sensor =
            build(context).map_err(|error| Error::Sensor { sensor: uid.clone(), error: Box::new(error) })?;
        let all = self.requires() | requires;
        let envs: Vec<usize> = (0..context.num_envs).collect();
        let mut state = gather::allocate(simulation, all);
        solve(simulation, all, &envs);
        gather::gather(simulation, self.substeps, all, &mut state);
        sensor.reset(&envs, &state).map_err(|error| Error::Sensor { sensor: uid.clone(), error: Box::new(error) })?;
        self.state = state;
        self.entries.push(Entry { uid, requires, debug_vis, build, sensor, fault: None });
        Ok(SensorId { index: self.entries.len() - 1, sensor: PhantomData })
    }

    /// Builds all sensors anew for a simulation that was compiled again; their histories start again.
    pub(crate) fn rebuild(&mut self, simulation: &mut Simulation, context: &SensorContext) {
        let all = self.requires();
        let envs: Vec<usize> = (0..context.num_envs).collect();
        self.state = gather::allocate(simulation, all);
        solve(simulation, all, &envs);
        gather::gather(simulation, self.substeps, all, &mut self.state);
        for entry in &mut self.entries {
            let context = SensorContext { name: entry.uid.as_str().into(), ..context.clone() };
            entry.fault = match (entry.build)(&context) {
                Ok(sensor) => {
                    entry.sensor = sensor;
                    entry.sensor.reset(&envs, &self.state).err()
                }
                Err(error) => Some(error),
            };
        }
    }

    /// Does as many of `steps` physics steps as until a sensor is due, at least 1; those that are due then measure. Gives
    /// the number of steps done.
    pub(crate) fn advance(&mut self, simulation: &mut Simulation, steps: u32) -> u32 {
        gather::gather_clocks(simulation, self.substeps, &mut self.clocks);
        let now = &self.clocks;
        let wait = |e: &Entry| e.sensor.due_in(now).max(1);
        let running = self.entries.iter().filter(|e| e.fault.is_none());
        let block = running.map(wait).min().map_or(steps, |due| u32::try_from(due).unwrap_or(u32::MAX).min(steps));
        self.due.clear();
        self.due.extend(self.entries.iter().map(|e| e.fault.is_none() && wait(e) <= u64::from(block)));
        let due = self.entries.iter().zip(&self.due).filter(|(_, due)| **due);
        let requires = due.fold(Requires::NONE, |all, (e, _)| all | e.requires);
        match capture(simulation, requires) {
            None => simulation.batch.step(block * self.substeps),
            Some(capture) => simulation.batch.step_and_capture(block * self.substeps, capture),
        }
        if self.due.contains(&true) {
            gather::gather(simulation, self.substeps, requires, &mut self.state);
        }
        for (entry, _) in self.entries.iter_mut().zip(&self.due).filter(|(_, due)| **due) {
            entry.fault = entry.sensor.update(&self.state).err();
        }
        block
    }

    /// After a reset of `env_ids`.
    pub(crate) fn reset(&mut self, env_ids: &[usize], simulation: &mut Simulation) {
        self.renew(simulation, env_ids);
        for entry in self.entries.iter_mut().filter(|e| e.fault.is_none()) {
            entry.fault = entry.sensor.reset(env_ids, &self.state).err();
        }
    }

    /// After somebody wrote to the state of `env_ids`.
    pub(crate) fn refresh(&mut self, env_ids: &[usize], simulation: &mut Simulation) {
        // One that is put aside keeps what was measured last.
        let runs = |env: &usize| simulation.batch.read(*env, |env| *env.status() == EnvStatus::Running);
        let running: Vec<usize> = env_ids.iter().copied().filter(runs).collect();
        if self.entries.is_empty() || running.is_empty() {
            return;
        }
        self.renew(simulation, &running);
        for entry in self.entries.iter_mut().filter(|e| e.fault.is_none()) {
            entry.fault = entry.sensor.refresh(&running, &self.state).err();
        }
    }

    /// Gathers the state after `env_ids` were written to.
    fn renew(&mut self, simulation: &mut Simulation, env_ids: &[usize]) {
        let all = self.requires();
        solve(simulation, all, env_ids);
        gather::gather(simulation, self.substeps, all, &mut self.state);
    }

    /// What they show of their last measurements.
    pub(crate) fn markers(&self, num_envs: usize) -> Vec<(EnvId, Marker)> {
        let shown = || self.entries.iter().filter(|e| e.debug_vis && e.fault.is_none());
        let of = |env| shown().flat_map(move |e| e.sensor.markers(env)).map(move |marker| (EnvId(env), marker));
        (0..num_envs).flat_map(of).collect()
    }

    /// The sensor of a handle.
    pub(crate) fn get<S: Sensor>(&self, id: SensorId<S>) -> Result<&S> {
        let unknown = Error::UnknownIndex { what: "sensor", index: id.index, count: self.entries.len() };
        let entry = self.entries.get(id.index).ok_or(unknown)?;
        if let Some(fault) = &entry.fault {
            return Err(Error::SensorFault { sensor: entry.uid.clone(), fault: fault.to_string() });
        }
        let any: &dyn Any = entry.sensor.as_ref();
        any.downcast_ref::<S>().ok_or_else(|| Error::UnknownName {
            what: "sensor of this type called",
            name: entry.uid.clone(),
            candidates: Vec::new(),
        })
    }

    /// The sensor of a handle, to change.
    pub(crate) fn get_mut<S: Sensor>(&mut self, id: SensorId<S>) -> Result<&mut S> {
        self.get(id)?;
        let count = self.entries.len();
        let any: Option<&mut dyn Any> = self.entries.get_mut(id.index).map(|e| e.sensor.as_mut() as &mut dyn Any);
        any.and_then(|any| any.downcast_mut::<S>()).ok_or(Error::UnknownIndex {
            what: "sensor",
            index: id.index,
            count,
        })
    }
}

/// What must be captured inside the step for those who require `requires`.
fn capture(simulation: &Simulation, requires: Requires) -> Option<Capture> {
    let fields = requires.intersection(Requires::SOLVED);
    (!fields.is_empty()).then(|| Capture { plan: Arc::clone(&simulation.plan), fields })
}

/// Solves and captures the present state of `envs`, where somebody requires what is solved.
fn solve(simulation: &mut Simulation, requires: Requires, envs: &[usize]) {
    let fields = requires.intersection(Requires::SOLVED);
    // MuJoCo's own sensors of what is solved are evaluated where it is solved.
    if !fields.is_empty() || requires.contains(Requires::SENSORDATA) {
        simulation.batch.capture_present(envs, Capture { plan: Arc::clone(&simulation.plan), fields });
    }
}
