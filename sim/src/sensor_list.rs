//! The sensors of a simulation: built from their configurations, ticked after every step, read by typed handles.

use crate::compile::Simulation;
use crate::error::{Error, Result};
use crate::gather;
use scene::SceneState;
use sensors::{Requires, Sensor, SensorCfg, SensorContext, SensorError};
use std::any::Any;
use std::marker::PhantomData;

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
        simulation: &Simulation,
        context: &SensorContext,
    ) -> Result<SensorId<C::Sensor>>
    where
        C: SensorCfg + Send + 'static,
    {
        let requires = cfg.requires();
        let build: Builder = Box::new(move |context| Ok(Box::new(cfg.build(context)?) as Box<dyn Sensor>));
        let mut sensor =
            build(context).map_err(|error| Error::Sensor { sensor: uid.clone(), error: Box::new(error) })?;
        let all = self.requires() | requires;
        let mut state = gather::allocate(simulation, all);
        gather::gather(simulation, self.substeps, all, &mut state);
        let envs: Vec<usize> = (0..context.num_envs).collect();
        sensor.reset(&envs, &state).map_err(|error| Error::Sensor { sensor: uid.clone(), error: Box::new(error) })?;
        self.state = state;
        self.entries.push(Entry { uid, requires, build, sensor, fault: None });
        Ok(SensorId { index: self.entries.len() - 1, sensor: PhantomData })
    }

    /// Builds all sensors anew for a simulation that was compiled again; their histories start again.
    pub(crate) fn rebuild(&mut self, simulation: &Simulation, context: &SensorContext) {
        let all = self.requires();
        self.state = gather::allocate(simulation, all);
        gather::gather(simulation, self.substeps, all, &mut self.state);
        let envs: Vec<usize> = (0..context.num_envs).collect();
        for entry in &mut self.entries {
            entry.fault = match (entry.build)(context) {
                Ok(sensor) => {
                    entry.sensor = sensor;
                    entry.sensor.reset(&envs, &self.state).err()
                }
                Err(error) => Some(error),
            };
        }
    }

    /// Physics steps until a sensor is due, at least 1.
    pub(crate) fn due_in(&mut self, simulation: &Simulation) -> u64 {
        gather::gather_steps(simulation, self.substeps, &mut self.state);
        let steps = &self.state.step;
        let due = self.running().map(|e| e.sensor.due_in(steps).max(1));
        due.min().unwrap_or(u64::MAX)
    }

    /// After `steps` physics steps, of which at most the last made sensors due, those that are due measure. `before` are
    /// the step counts of the environments before.
    pub(crate) fn update(&mut self, simulation: &Simulation, steps: u64) {
        // The state still holds the step counts before: `due_in` asked for them.
        let due: Vec<bool> =
            self.entries.iter().map(|e| e.fault.is_none() && e.sensor.due_in(&self.state.step) <= steps).collect();
        let requires =
            self.entries.iter().zip(&due).filter(|(_, due)| **due).fold(Requires::NONE, |r, (e, _)| r | e.requires);
        gather::gather(simulation, self.substeps, requires, &mut self.state);
        for (entry, _) in self.entries.iter_mut().zip(due).filter(|(_, due)| *due) {
            entry.fault = entry.sensor.update(&self.state).err();
        }
    }

    /// After a reset of `env_ids`.
    pub(crate) fn reset(&mut self, env_ids: &[usize], simulation: &Simulation) {
        gather::gather(simulation, self.substeps, self.requires(), &mut self.state);
        for entry in self.entries.iter_mut().filter(|e| e.fault.is_none()) {
            entry.fault = entry.sensor.reset(env_ids, &self.state).err();
        }
    }

    /// After somebody wrote to the state of `env_ids`.
    pub(crate) fn refresh(&mut self, env_ids: &[usize], simulation: &Simulation) {
        if self.entries.is_empty() || env_ids.is_empty() {
            return;
        }
        gather::gather(simulation, self.substeps, self.requires(), &mut self.state);
        for entry in self.entries.iter_mut().filter(|e| e.fault.is_none()) {
            entry.fault = entry.sensor.refresh(env_ids, &self.state).err();
        }
    }

    fn running(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(|e| e.fault.is_none())
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
