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
}

impl std::fmt::Debug for SensorList {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.entries.iter().map(|e| &e.uid)).finish()
    }
}

impl SensorList {
    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Builds a sensor and adds it; on an error nothing was added.
    pub(crate) fn add<C>(
        &mut self,
        uid: String,
        cfg: C,
        simulation: &Simulation,
        context: &SensorContext,
        substeps: u32,
    ) -> Result<SensorId<C::Sensor>>
    where
        C: SensorCfg + Send + 'static,
    {
        if self.entries.iter().any(|e| e.uid == uid) {
            return Err(Error::DuplicateUid(uid));
        }
        let requires = cfg.requires();
        let missing = requires.without(gather::AVAILABLE);
        if !missing.is_empty() {
            return Err(Error::SensorRequires { sensor: uid, missing: missing.to_string() });
        }
        let build: Builder = Box::new(move |context| Ok(Box::new(cfg.build(context)?) as Box<dyn Sensor>));
        let mut sensor =
            build(context).map_err(|error| Error::Sensor { sensor: uid.clone(), error: Box::new(error) })?;
        let all = self.entries.iter().fold(requires, |sum, e| sum | e.requires);
        let mut state = gather::allocate(simulation, all);
        gather::gather(simulation, substeps, &mut state);
        let envs: Vec<usize> = (0..context.num_envs).collect();
        sensor.reset(&envs, &state).map_err(|error| Error::Sensor { sensor: uid.clone(), error: Box::new(error) })?;
        self.state = state;
        self.entries.push(Entry { uid, requires, build, sensor, fault: None });
        Ok(SensorId { index: self.entries.len() - 1, sensor: PhantomData })
    }

    /// Builds all sensors anew for a simulation that was compiled again; their histories start again.
    pub(crate) fn rebuild(&mut self, simulation: &Simulation, context: &SensorContext, substeps: u32) {
        let all = self.entries.iter().fold(Requires::NONE, |sum, e| sum | e.requires);
        self.state = gather::allocate(simulation, all);
        gather::gather(simulation, substeps, &mut self.state);
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

    /// After a physics step: every sensor that is due measures.
    pub(crate) fn update(&mut self, simulation: &Simulation, substeps: u32) {
        gather::gather(simulation, substeps, &mut self.state);
        for entry in self.entries.iter_mut().filter(|e| e.fault.is_none()) {
            entry.fault = entry.sensor.update(&self.state).err();
        }
    }

    /// After a reset of `env_ids`.
    pub(crate) fn reset(&mut self, env_ids: &[usize], simulation: &Simulation, substeps: u32) {
        gather::gather(simulation, substeps, &mut self.state);
        for entry in self.entries.iter_mut().filter(|e| e.fault.is_none()) {
            entry.fault = entry.sensor.reset(env_ids, &self.state).err();
        }
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
}
