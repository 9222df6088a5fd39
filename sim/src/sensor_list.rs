//! The sensors of a simulation: built from configurations, updated after steps, read through typed handles.

use crate::capture::CaptureRequest;
use crate::entity_set::check_uid_syntax;
use crate::env::EnvStatus;
use crate::error::{Error, Result};
use crate::gather::{self, GatherMemory};
use crate::ids::EnvId;
use crate::simulation::Simulation;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::{Marker, Pose, SceneState};
use kinetoscope_sensors::{Schedule, Sensor, SensorCfg, SensorContext, SensorError, SensorSlot};
use std::any::Any;
use std::collections::BTreeSet;
use std::marker::PhantomData;
use std::sync::Arc;

/// Handle of a sensor of type `S`, valid for the manager that created it.
pub struct SensorId<S> {
    manager: u64,
    index: usize,
    sensor: PhantomData<fn() -> S>,
}

impl<S> SensorId<S> {
    /// Index of the sensor in the list.
    pub(crate) fn index(self) -> usize {
        self.index
    }
}

impl<S> Clone for SensorId<S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<S> Copy for SensorId<S> {}

impl<S> PartialEq for SensorId<S> {
    fn eq(&self, other: &Self) -> bool {
        (self.manager, self.index) == (other.manager, other.index)
    }
}

impl<S> Eq for SensorId<S> {}

impl<S> std::hash::Hash for SensorId<S> {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        (self.manager, self.index).hash(state);
    }
}

impl<S> std::fmt::Debug for SensorId<S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "SensorId({})", self.index)
    }
}

type Builder = Box<dyn Fn(&SensorContext) -> Result<Box<dyn Sensor>, SensorError> + Send>;

struct SensorEntry {
    uid: String,
    requires: StateFields,
    /// True if the markers of the sensor are enabled.
    debug_vis: bool,
    lazy: Option<Schedule>,
    build: Builder,
    /// The sensor, or the error of its last rebuild.
    slot: Result<SensorSlot, SensorError>,
}

impl SensorEntry {
    /// The sensor; `None` if it has failed.
    fn running(&self) -> Option<&SensorSlot> {
        self.slot.as_ref().ok().filter(|slot| !slot.has_failed())
    }

    fn fault_error(&self, fault: &SensorError) -> Error {
        Error::SensorFault { sensor: self.uid.clone(), fault: fault.to_string() }
    }
}

/// All sensors and the state that they read.
#[derive(Default)]
pub(crate) struct SensorList {
    /// Serial number of the manager.
    manager: u64,
    entries: Vec<SensorEntry>,
    state: SceneState,
    gather_memory: GatherMemory,
    /// Flags of the sensors that are due after the current block of physics steps.
    due: Vec<bool>,
    /// Physics steps of every environment since its last reset; [`kinetoscope_sensors::Phases::QUARANTINED`] for a
    /// diverged environment.
    step_counts: Vec<u64>,
    /// Environments with a written state since the last [`take_written`](Self::take_written).
    written: BTreeSet<usize>,
    /// MuJoCo steps per physics step.
    substeps: u32,
}

impl std::fmt::Debug for SensorList {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.entries.iter().map(|e| &e.uid)).finish()
    }
}

impl SensorList {
    /// Creates an empty list for the manager with serial number `manager`, with `substeps` MuJoCo steps per physics
    /// step.
    pub(crate) fn new(manager: u64, substeps: u32) -> Self {
        Self { manager, substeps, ..Self::default() }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Union of the quantities that all sensors need.
    pub(crate) fn requires(&self) -> StateFields {
        self.entries.iter().fold(StateFields::NONE, |sum, e| sum | e.requires)
    }

    /// Checks that no sensor has the name `uid`, that it is usable, and that the needed quantities are available.
    pub(crate) fn check(&self, uid: &str, requires: StateFields) -> Result<()> {
        if self.entries.iter().any(|e| e.uid == uid) {
            return Err(Error::DuplicateUid(uid.into()));
        }
        check_uid_syntax(uid)?;
        let missing = requires.without(gather::AVAILABLE);
        if missing.is_empty() {
            Ok(())
        } else {
            Err(Error::SensorRequires { sensor: uid.into(), missing: missing.to_string() })
        }
    }

    /// Builds a checked sensor and adds it. On an error nothing is added.
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
        let (requires, debug_vis, lazy) = (cfg.requires(), cfg.debug_vis(), cfg.lazy(context.dt));
        let build: Builder = Box::new(move |context| Ok(Box::new(cfg.build(context)?) as Box<dyn Sensor>));
        let wrong = |error: SensorError| Error::Sensor { sensor: uid.clone(), error: Box::new(error) };
        let sensor = build(context).map_err(wrong)?;
        let all = self.requires() | requires;
        let envs: Vec<usize> = (0..context.num_envs).collect();
        let mut state = gather::allocate(simulation, all);
        solve_and_capture(simulation, all, &envs);
        gather::gather(simulation, &envs, self.substeps, all, &mut state, &mut self.gather_memory);
        if requires.contains(StateFields::MARKERS) {
            state.markers = Some(self.markers_except(simulation, None));
        }
        let mut slot = SensorSlot::new(sensor, requires, lazy, context.num_envs);
        slot.reset(&envs, &state);
        slot.sensor().map_err(|error| wrong(error.clone()))?;
        self.state = SceneState { markers: None, ..state };
        self.entries.push(SensorEntry { uid, requires, debug_vis, lazy, build, slot: Ok(slot) });
        Ok(SensorId { manager: self.manager, index: self.entries.len() - 1, sensor: PhantomData })
    }

    /// Rebuilds all sensors for a newly compiled simulation; their histories restart.
    pub(crate) fn rebuild(&mut self, simulation: &mut Simulation, context: &SensorContext) {
        let all = self.requires();
        let envs: Vec<usize> = (0..context.num_envs).collect();
        self.state = gather::allocate(simulation, all);
        solve_and_capture(simulation, all, &envs);
        gather::gather(simulation, &envs, self.substeps, all, &mut self.state, &mut self.gather_memory);
        for entry in &mut self.entries {
            let context = SensorContext { name: entry.uid.as_str().into(), rebuilt: true, ..context.clone() };
            let sensor = (entry.build)(&context);
            entry.slot = sensor.map(|sensor| SensorSlot::new(sensor, entry.requires, entry.lazy, context.num_envs));
        }
        self.update_slots(simulation, |_| true, |slot, state| slot.reset(&envs, state));
    }

    /// Passes the state to the `chosen` sensors: first to those that measure, then to those that render the markers of
    /// the others.
    fn update_slots(
        &mut self,
        simulation: &Simulation,
        chosen: impl Fn(usize) -> bool,
        mut act: impl FnMut(&mut SensorSlot, &SceneState),
    ) {
        let renders_markers = |entry: &SensorEntry| entry.requires.contains(StateFields::MARKERS);
        let Self { entries, state, .. } = self;
        for (_, entry) in
            entries.iter_mut().enumerate().filter(|(index, entry)| chosen(*index) && !renders_markers(entry))
        {
            entry.slot.iter_mut().for_each(|slot| act(slot, state));
        }
        for index in (0..self.entries.len()).filter(|&index| chosen(index)) {
            if renders_markers(&self.entries[index]) {
                self.state.markers = Some(self.markers_except(simulation, Some(index)));
                let Self { entries, state, .. } = self;
                entries[index].slot.iter_mut().for_each(|slot| act(slot, state));
            }
        }
        // The markers belong to the last sensor that rendered them.
        self.state.markers = None;
    }

    /// Does `steps` physics steps, or fewer until a sensor is due, at least 1. Updates the due sensors. Returns the
    /// number of steps done.
    pub(crate) fn advance(&mut self, simulation: &mut Simulation, steps: u32) -> u32 {
        gather::gather_step_counts(simulation, self.substeps, &mut self.step_counts);
        let now = &self.step_counts;
        let wait = |e: &SensorEntry| Some(e.running()?.due_in(now).max(1));
        let block = self
            .entries
            .iter()
            .filter_map(wait)
            .min()
            .map_or(steps, |due| u32::try_from(due).unwrap_or(u32::MAX).min(steps));
        self.due.clear();
        self.due.extend(self.entries.iter().map(|e| wait(e).is_some_and(|wait| wait <= u64::from(block))));
        let due = self.entries.iter().zip(&self.due).filter(|(_, due)| **due);
        let requires = due.fold(StateFields::NONE, |all, (e, _)| all | e.requires);
        if self.due.contains(&true) {
            let capture = capture_request(simulation, requires);
            let (state, memory) = (&mut self.state, &mut self.gather_memory);
            gather::step_and_gather(simulation, block, self.substeps, capture.as_ref(), requires, state, memory);
        } else {
            simulation.batch.step(block * self.substeps);
        }
        let due = std::mem::take(&mut self.due);
        self.update_slots(simulation, |index| due[index], SensorSlot::update);
        self.due = due;
        block
    }

    /// Updates the sensors after a reset of `env_ids`.
    pub(crate) fn reset(&mut self, env_ids: &[usize], simulation: &mut Simulation) {
        self.gather_after_write(simulation, env_ids);
        self.update_slots(simulation, |_| true, |slot, state| slot.reset(env_ids, state));
    }

    /// Updates the sensors after a write to the state of `env_ids`.
    pub(crate) fn refresh(&mut self, env_ids: &[usize], simulation: &mut Simulation) {
        self.mark_written(env_ids);
        // A read runs the deferred forward pass; without sensors it is not needed here.
        if self.entries.is_empty() {
            return;
        }
        // A diverged environment keeps its last measurements.
        let runs = |env: &usize| simulation.batch.read_row(*env, |row| *row.status() == EnvStatus::Running);
        let running: Vec<usize> = env_ids.iter().copied().filter(runs).collect();
        if running.is_empty() {
            return;
        }
        self.gather_after_write(simulation, &running);
        self.update_slots(simulation, |_| true, |slot, state| slot.refresh(&running, state));
    }

    /// Marks the state of `env_ids` as written.
    pub(crate) fn mark_written(&mut self, env_ids: &[usize]) {
        self.written.extend(env_ids);
    }

    /// Returns the environments with a written state since the last call.
    pub(crate) fn take_written(&mut self) -> Vec<EnvId> {
        std::mem::take(&mut self.written).into_iter().map(EnvId).collect()
    }

    /// Gathers the state after a write to `env_ids`.
    fn gather_after_write(&mut self, simulation: &mut Simulation, env_ids: &[usize]) {
        let all = self.requires();
        solve_and_capture(simulation, all, env_ids);
        gather::gather(simulation, env_ids, self.substeps, all, &mut self.state, &mut self.gather_memory);
    }

    /// Markers of the last measurements of all sensors with enabled markers, except the sensor at index `own`.
    pub(crate) fn markers(&self, simulation: &Simulation, own: Option<usize>) -> Vec<(EnvId, Marker)> {
        let markers = self.markers_except(simulation, own).into_iter().enumerate();
        markers.flat_map(|(env, markers)| markers.into_iter().map(move |marker| (EnvId(env), marker))).collect()
    }

    /// Markers as in [`markers`](Self::markers), grouped by environment.
    fn markers_except(&self, simulation: &Simulation, own: Option<usize>) -> Vec<Vec<Marker>> {
        let others = self.entries.iter().enumerate().filter(|(index, entry)| entry.debug_vis && Some(*index) != own);
        let shown: Vec<&dyn Sensor> = others.filter_map(|(_, entry)| entry.slot.as_ref().ok()?.sensor().ok()).collect();
        let mut markers = vec![Vec::new(); simulation.batch.num_envs()];
        if shown.is_empty() {
            return markers;
        }
        simulation.batch.read_bodies(&mut markers, |i, bodies, markers| {
            let pose = |body: usize| {
                let frame = simulation.body_axis.bodies().get(body);
                frame.map_or_else(Pose::identity, |frame| frame.pose(bodies))
            };
            markers[0].extend(shown.iter().flat_map(|sensor| sensor.markers(i, &pose)));
        });
        markers
    }

    /// True if the markers of a sensor are enabled.
    pub(crate) fn debug_vis(&self, index: usize) -> Result<bool> {
        self.entry(index).map(|entry| entry.debug_vis)
    }

    /// Enables or disables the markers of a sensor.
    pub(crate) fn set_debug_vis(&mut self, index: usize, shown: bool) -> Result<()> {
        self.entry(index)?;
        self.entries.get_mut(index).into_iter().for_each(|entry| entry.debug_vis = shown);
        Ok(())
    }

    fn entry(&self, index: usize) -> Result<&SensorEntry> {
        let count = self.entries.len();
        self.entries.get(index).ok_or(Error::UnknownIndex { what: "sensor", index, count })
    }

    /// Uids of all sensors, in insertion order.
    pub(crate) fn uids(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| entry.uid.as_str())
    }

    /// The sensor `uid` as a trait object.
    pub(crate) fn by_uid(&self, uid: &str) -> Result<&dyn Sensor> {
        let entry = self.entry_by_uid(uid)?;
        entry.slot.as_ref().and_then(SensorSlot::sensor).map_err(|fault| entry.fault_error(fault))
    }

    /// Physics steps until the sensor `uid` next measures, delivers a delayed measurement or opens its shutter in any
    /// environment, at least 1; `u64::MAX` for a failed sensor.
    pub(crate) fn due_in(&self, uid: &str, simulation: &Simulation) -> Result<u64> {
        let entry = self.entry_by_uid(uid)?;
        let mut clocks = Vec::with_capacity(simulation.batch.num_envs());
        gather::gather_step_counts(simulation, self.substeps, &mut clocks);
        Ok(entry.running().map_or(u64::MAX, |slot| slot.due_in(&clocks).max(1)))
    }

    fn entry_by_uid(&self, uid: &str) -> Result<&SensorEntry> {
        self.entries.iter().find(|entry| entry.uid == uid).ok_or_else(|| Error::UnknownName {
            what: "sensor",
            name: uid.into(),
            candidates: self.uids().map(String::from).collect(),
        })
    }

    /// Index of a sensor in the list.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub(crate) fn index_of<S>(&self, id: SensorId<S>) -> usize {
        assert!(id.manager == self.manager, "this handle belongs to another SimulationManager");
        id.index
    }

    /// Uids and handles of all sensors of type `S`, without failed sensors.
    pub(crate) fn ids<S: Sensor>(&self) -> Vec<(String, SensorId<S>)> {
        let is = |entry: &SensorEntry| {
            let sensor = entry.slot.as_ref().ok().and_then(|slot| slot.sensor().ok());
            let any: Option<&dyn Any> = sensor.map(|sensor| sensor as &dyn Any);
            any.is_some_and(|any| any.is::<S>())
        };
        let id = |index| SensorId { manager: self.manager, index, sensor: PhantomData };
        let all = self.entries.iter().enumerate().filter(|(_, entry)| is(entry));
        all.map(|(index, entry)| (entry.uid.clone(), id(index))).collect()
    }

    /// Returns the sensor of a handle.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub(crate) fn get<S: Sensor>(&self, id: SensorId<S>) -> Result<&S> {
        let entry = self.entry(self.index_of(id))?;
        let sensor = entry.slot.as_ref().and_then(SensorSlot::sensor).map_err(|fault| entry.fault_error(fault))?;
        let any: &dyn Any = sensor;
        any.downcast_ref::<S>().ok_or_else(|| Error::UnknownName {
            what: "sensor of the requested type",
            name: entry.uid.clone(),
            candidates: Vec::new(),
        })
    }

    /// Returns the sensor of a handle for changes.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub(crate) fn get_mut<S: Sensor>(&mut self, id: SensorId<S>) -> Result<&mut S> {
        self.get(id)?;
        let count = self.entries.len();
        let sensor = self.entries.get_mut(id.index).and_then(|e| e.slot.as_mut().ok()?.sensor_mut().ok());
        let any: Option<&mut dyn Any> = sensor.map(|sensor| sensor as &mut dyn Any);
        any.and_then(|any| any.downcast_mut::<S>()).ok_or(Error::UnknownIndex {
            what: "sensor",
            index: id.index,
            count,
        })
    }
}

/// Quantities to capture inside the step for sensors that require `requires`; `None` if no quantity needs a capture.
fn capture_request(simulation: &Simulation, requires: StateFields) -> Option<CaptureRequest> {
    let fields = requires.intersection(StateFields::FORCE_STAGE);
    (!fields.is_empty()).then(|| CaptureRequest { body_axis: Arc::clone(&simulation.body_axis), fields })
}

/// Solves and captures the current state of `envs`, if `requires` contains a solved quantity.
fn solve_and_capture(simulation: &mut Simulation, requires: StateFields, envs: &[usize]) {
    let fields = requires.intersection(StateFields::FORCE_STAGE);
    // MuJoCo evaluates its own sensors of solved quantities in the same solve.
    if !fields.is_empty() || requires.contains(StateFields::SENSORDATA) {
        simulation.batch.capture_present(envs, CaptureRequest { body_axis: Arc::clone(&simulation.body_axis), fields });
    }
}
