//! The class `SimulationManager`.

use crate::arguments::{array, envs};
use crate::cfg;
use crate::device::PythonPhysics;
use crate::errors::{Class, Failure};
use crate::objects::{MjcfPart, RigidObject, RigidObjectGroup, Terrain, Weld};
use crate::robot::Robot;
use crate::sensor::Sensor;
use crate::shared::{Entity, Shared, detached, equal_handles, guarded, interruptible};
use crate::snapshot::Snapshot;
use kinetoscope::ndarray::{Ix2, Ix3};
use kinetoscope::prelude::{ArticulationCfg, MjcfPartCfg, RigidObjectCfg, RobotCfg, SceneCfg, TerrainCfg};
use kinetoscope::robot::diagnostic::Diagnostic;
use kinetoscope::sim::{
    EntityCfg, EntityTypes, EnvId, InteractiveScene, Property, Randomization, RigidObjectGroupCfg, SimulationManager,
    WeldCfg, rollout_until,
};
use kinetoscope::viewer::ViewerExt as _;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Robots, objects and sensors in parallel environments.
///
/// ``cfg`` is a ``SimulationManagerCfg`` or a dict of its fields; keyword arguments replace fields. All methods release
/// the interpreter while they work, and ``update`` ends early with ``KeyboardInterrupt`` on Ctrl+C.
#[pyclass(frozen, name = "SimulationManager", module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Simulation {
    pub(crate) shared: Arc<Shared>,
}

equal_handles! { Simulation }

/// Wall time of a block of steps, after which signals are handled.
const BLOCK: Duration = Duration::from_millis(50);
/// Longest sleep while a viewer pauses or paces the simulation; commands of viewers wait as long.
const MAX_SLEEP: Duration = Duration::from_millis(10);

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (cfg=None, **fields))]
    fn new(py: Python<'_>, cfg: Option<&Bound<'_, PyAny>>, fields: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let cfg = cfg::simulation(cfg::table(cfg::SIMULATION, cfg, fields)?)?;
        let manager = detached(py, || Ok(SimulationManager::new(cfg)?))?;
        Ok(Self { shared: Shared::new(manager) })
    }

    /// Builds the scene of a scene file (TOML or YAML). Keyword arguments replace fields of ``[simulation]``.
    #[classmethod]
    #[pyo3(signature = (path, **fields))]
    fn from_file(
        _class: &Bound<'_, PyType>,
        py: Python<'_>,
        path: PathBuf,
        fields: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut scene = detached(py, || Ok(SceneCfg::from_file(path)?))?;
        let changes = cfg::table(cfg::SIMULATION, None, fields)?;
        if let Some(given) = fields {
            let names = given.keys().extract::<Vec<String>>()?;
            scene.simulation = cfg::changed_simulation(&scene.simulation, &names, changes)?;
        }
        Self::of_scene(py, scene)
    }

    /// Builds a scene from a ``SceneCfg``, or a dict of its fields. An entity may be a dict with a ``type``.
    #[classmethod]
    fn from_scene(_class: &Bound<'_, PyType>, py: Python<'_>, scene: &Bound<'_, PyAny>) -> PyResult<Self> {
        let scene = cfg::scene(&cfg::scene_table(scene)?)?;
        Self::of_scene(py, scene)
    }

    /// Adds an entity of any type under a name: a robot, object, terrain, sensor and so on. Returns its handle.
    #[pyo3(signature = (name, cfg))]
    fn add(&self, py: Python<'_>, name: String, cfg: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        let kind = cfg::type_of(cfg)?.ok_or_else(|| {
            Failure::new(
                Class::Config,
                "the configuration has no `type`: use a class such as RobotCfg, or a dict with `type`",
            )
        })?;
        let mut table = cfg::table(&kind, Some(cfg), None)?;
        table.remove("type");
        self.add_entity(py, &kind, Some(name), table)
    }

    /// Adds a robot and returns its handle. Fields of ``RobotCfg`` may be given as keyword arguments.
    #[pyo3(signature = (cfg=None, **fields))]
    fn add_robot(
        &self,
        py: Python<'_>,
        cfg: Option<&Bound<'_, PyAny>>,
        fields: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<PyAny>> {
        self.add_entity(py, "robot", None, cfg::table("robot", cfg, fields)?)
    }

    /// Adds a passive articulation, such as a cabinet, and returns its handle.
    #[pyo3(signature = (cfg=None, **fields))]
    fn add_articulation(
        &self,
        py: Python<'_>,
        cfg: Option<&Bound<'_, PyAny>>,
        fields: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<PyAny>> {
        self.add_entity(py, "articulation", None, cfg::table("articulation", cfg, fields)?)
    }

    /// Adds a rigid object and returns its handle.
    #[pyo3(signature = (cfg=None, **fields))]
    fn add_rigid_object(
        &self,
        py: Python<'_>,
        cfg: Option<&Bound<'_, PyAny>>,
        fields: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<PyAny>> {
        self.add_entity(py, "rigid_object", None, cfg::table("rigid_object", cfg, fields)?)
    }

    /// Adds a group of rigid objects and returns its handle.
    #[pyo3(signature = (cfg=None, **fields))]
    fn add_rigid_object_group(
        &self,
        py: Python<'_>,
        cfg: Option<&Bound<'_, PyAny>>,
        fields: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<PyAny>> {
        self.add_entity(py, "rigid_object_group", None, cfg::table("rigid_object_group", cfg, fields)?)
    }

    /// Adds a terrain and returns its handle.
    #[pyo3(signature = (cfg=None, **fields))]
    fn add_terrain(
        &self,
        py: Python<'_>,
        cfg: Option<&Bound<'_, PyAny>>,
        fields: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<PyAny>> {
        self.add_entity(py, "terrain", None, cfg::table("terrain", cfg, fields)?)
    }

    /// Attaches an MJCF file and returns its handle.
    #[pyo3(signature = (cfg=None, **fields))]
    fn add_mjcf(
        &self,
        py: Python<'_>,
        cfg: Option<&Bound<'_, PyAny>>,
        fields: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<PyAny>> {
        self.add_entity(py, "mjcf", None, cfg::table("mjcf", cfg, fields)?)
    }

    /// Adds a weld, initially released, and returns its handle.
    #[pyo3(signature = (cfg=None, **fields))]
    fn add_weld(
        &self,
        py: Python<'_>,
        cfg: Option<&Bound<'_, PyAny>>,
        fields: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<PyAny>> {
        self.add_entity(py, "weld", None, cfg::table("weld", cfg, fields)?)
    }

    /// Adds a sensor under a name and returns its handle. ``cfg`` is a configuration such as ``CameraCfg``, or a dict
    /// with ``type``.
    fn add_sensor(&self, py: Python<'_>, name: String, cfg: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        if let Some(kind) = cfg::type_of(cfg)? {
            cfg::check_sensor(py, &kind)?;
        }
        self.add(py, name, cfg)
    }

    /// Excludes collisions between two entities or bodies from now on: names such as ``"arm/link"``, or handles.
    fn exclude_collision(&self, py: Python<'_>, one: &Bound<'_, PyAny>, other: &Bound<'_, PyAny>) -> PyResult<()> {
        let (one, other) = (self.name_of(one)?, self.name_of(other)?);
        self.shared.write(py, |sim| Ok(sim.exclude_collision(&one, &other)?))
    }

    /// Steps all environments ``steps`` times. Ctrl+C ends the call after at most one block of steps, also while a viewer
    /// pauses the simulation or sets its speed.
    #[pyo3(signature = (steps=1))]
    fn update(&self, py: Python<'_>, steps: u32) -> PyResult<()> {
        let mut left = steps;
        let mut block = 1;
        while left > 0 {
            let started = Instant::now();
            let (now, mut wait) = self.shared.write(py, |sim| {
                let done = sim.update_without_waiting(block.min(left));
                sim.scene().device_failure().map_or(Ok(done), |error| Err(error.into()))
            })?;
            left -= now;
            // Outside the lock, so that other threads and signal handlers can use the simulation meanwhile.
            while !wait.is_zero() {
                py.check_signals()?;
                py.detach(|| std::thread::sleep(wait.min(MAX_SLEEP)));
                (_, wait) = self.shared.write(py, |sim| Ok(sim.update_without_waiting(0)))?;
            }
            if left > 0 {
                py.check_signals()?;
                // Steps per block from the time of the last block, at most twice as many.
                let per_step = started.elapsed().as_secs_f64() / f64::from(now.max(1));
                let fitting = (BLOCK.as_secs_f64() / per_step.max(1e-9)).clamp(1.0, 1000.0) as u32;
                block = fitting.min(block * 2);
            }
        }
        Ok(())
    }

    /// Steps all environments by a time [s], a whole number of ``physics_dt``. Ctrl+C ends it as it ends ``update``.
    fn update_for(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let steps = self.shared.read(py, |sim| Ok(sim.cfg().steps_in(seconds)?))?;
        self.update(py, steps)
    }

    /// Resets environments to their initial state and time 0.
    #[pyo3(signature = (env_ids=None))]
    fn reset(&self, py: Python<'_>, env_ids: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let env_ids = envs(&self.shared, env_ids)?;
        self.shared.write(py, |sim| Ok(sim.reset(env_ids.as_deref())?))
    }

    /// Clears what environments keep beside their state: histories of sensors, external wrenches, memory of actuator
    /// models. Positions, velocities, targets and time stay.
    #[pyo3(signature = (env_ids=None))]
    fn reset_buffers(&self, py: Python<'_>, env_ids: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let env_ids = envs(&self.shared, env_ids)?;
        self.shared.write(py, |sim| Ok(sim.scene_mut().reset_buffers(env_ids.as_deref())?))
    }

    /// An array of the physics on a device, without a copy: a ``warp.array`` with a row per environment, for
    /// ``warp.to_torch`` and DLPack. Names: ``qpos``, ``qvel``, ``qacc_warmstart``, ``act`` and ``qacc``. Raises ``DeviceError``
    /// on the device ``cpu``.
    fn device_array(&self, py: Python<'_>, name: &str) -> PyResult<Py<PyAny>> {
        let object = self.shared.read(py, |sim| {
            let physics = sim
                .scene()
                .with_device(|physics| physics.as_any().downcast_ref::<PythonPhysics>().map(PythonPhysics::handle));
            physics.flatten().ok_or_else(|| {
                Failure::new(Class::Device, "the device cpu has no arrays of a GPU; use qpos and the like")
            })
        })?;
        object.array(py, name)
    }

    /// Number of environments.
    #[getter]
    fn num_envs(&self, py: Python<'_>) -> PyResult<usize> {
        self.shared.read(py, |sim| Ok(sim.num_envs()))
    }

    /// Number of threads that step.
    #[getter]
    fn threads(&self, py: Python<'_>) -> PyResult<usize> {
        self.shared.read(py, |sim| Ok(sim.threads()))
    }

    /// Configuration of the simulation with all its values: a ``SimulationManagerCfg``. It is a copy: changes have no effect.
    #[getter]
    fn cfg<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.shared.read(py, |sim| Ok(toml::to_string(sim.cfg())?))?;
        let table = py.import("tomllib")?.call_method1("loads", (text,))?;
        py.import("kinetoscope._accepted")?.getattr("of_table")?.call1((cfg::SIMULATION, table))
    }

    /// Physics time step [s].
    #[getter]
    fn physics_dt(&self, py: Python<'_>) -> PyResult<f64> {
        self.shared.read(py, |sim| Ok(sim.cfg().physics_dt))
    }

    /// Simulation time of each environment since its last reset [s], shape (num_envs,).
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(self.shared.read(py, |sim| Ok(sim.time()))?.into_pyarray(py))
    }

    /// Origins of the environments in the overview [m], shape (num_envs, 3). Poses do not contain them.
    #[getter]
    fn env_origins<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.shared.read(py, |sim| Ok(sim.cfg().env_origins()))?.into_pyarray(py).into_any())
    }

    /// Everything repaired, ignored or unusual in the files and configurations of all entities: texts with the attributes
    /// ``kind``, ``message``, ``file`` and ``line``.
    #[getter]
    fn diagnostics<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        diagnostics(py, &self.shared.read(py, |sim| Ok(sim.diagnostics().to_vec()))?)
    }

    /// Counts of all warnings by name: diagnostics, and MuJoCo's warnings over all environments.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> PyResult<BTreeMap<String, u64>> {
        self.shared.read(py, |sim| Ok(sim.warnings().counts()))
    }

    /// Counts of MuJoCo's warnings in one environment, by name.
    fn env_warnings(&self, py: Python<'_>, env: usize) -> PyResult<BTreeMap<&'static str, u64>> {
        self.shared.read(py, |sim| Ok(sim.warnings().env_counts(EnvId(env))?))
    }

    /// Positions and velocities of all joints in MuJoCo's layout, shapes (num_envs, nq) and (num_envs, nv). ``state_names`` names
    /// the columns.
    #[getter]
    fn engine_states<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let [qpos, qvel] = self.shared.read(py, |sim| Ok(sim.entities().engine_states()))?;
        Ok((qpos.into_pyarray(py).into_any(), qvel.into_pyarray(py).into_any()))
    }

    /// Environments that are frozen after an invalid state, with the step and the reason.
    #[getter]
    fn diverged(&self, py: Python<'_>) -> PyResult<Vec<(usize, u64, String)>> {
        self.shared.read(py, |sim| {
            Ok(sim.diverged().into_iter().map(|diverged| (diverged.env.0, diverged.step, diverged.reason)).collect())
        })
    }

    /// The MJCF document of the simulation.
    #[getter]
    fn mjcf(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.read(py, |sim| Ok(sim.scene().mjcf().to_string()))
    }

    /// Table of the mask ids of cameras: id, entity, link (or None), semantic class.
    #[getter]
    #[expect(clippy::type_complexity, reason = "rows of a table")]
    fn mask_ids(&self, py: Python<'_>) -> PyResult<Vec<(i32, String, Option<String>, String)>> {
        self.shared.write(py, |sim| {
            sim.scene_mut().visual_scene();
            let rows = sim.scene().mask_ids().iter();
            Ok(rows.map(|row| (row.id, row.object.clone(), row.link.clone(), row.class.clone())).collect())
        })
    }

    /// Names of all bodies, in the order in which sensors and viewers number them.
    #[getter]
    fn body_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| Ok(sim.entities().body_names().to_vec()))
    }

    /// Names of the columns of controls in ``rollout``.
    #[getter]
    fn control_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| Ok(sim.entities().control_names()))
    }

    /// Names of the columns of states in ``rollout``.
    #[getter]
    fn state_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| Ok(sim.entities().state_names()))
    }

    /// Contacts of each selected environment: dicts with ``bodies`` (names; None for the world), ``point``, ``normal``,
    /// ``distance``, ``force`` on the second body, ``normal_force``.
    #[pyo3(signature = (env_ids=None))]
    fn contacts<'py>(
        &self,
        py: Python<'py>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<Vec<Bound<'py, PyDict>>>> {
        let env_ids = envs(&self.shared, env_ids)?;
        let (names, contacts) = self.shared.write(py, |sim| {
            let names = sim.entities().body_names();
            Ok((names, sim.scene_mut().contacts(env_ids.as_deref())?))
        })?;
        let row = |contact: &kinetoscope::scene::Contact| {
            let body = |index: Option<u32>| index.and_then(|index| names.get(index as usize)).cloned();
            let dict = PyDict::new(py);
            dict.set_item("bodies", (body(contact.bodies[0]), body(contact.bodies[1])))?;
            dict.set_item("point", contact.point)?;
            dict.set_item("normal", contact.normal)?;
            dict.set_item("distance", contact.distance)?;
            dict.set_item("force", contact.force)?;
            dict.set_item("normal_force", contact.normal_force)?;
            Ok(dict)
        };
        contacts.iter().map(|env| env.iter().map(row).collect()).collect()
    }

    /// Copies the states of environments.
    #[pyo3(signature = (env_ids=None))]
    fn snapshot(&self, py: Python<'_>, env_ids: Option<&Bound<'_, PyAny>>) -> PyResult<Snapshot> {
        let env_ids = envs(&self.shared, env_ids)?;
        Ok(Snapshot { inner: self.shared.read(py, |sim| Ok(sim.snapshot(env_ids.as_deref())?))? })
    }

    /// Restores states of a snapshot. With ``properties``, masses, gains and other properties are restored as well.
    #[pyo3(signature = (snapshot, env_ids=None, properties=false))]
    fn restore(
        &self,
        py: Python<'_>,
        snapshot: &Bound<'_, Snapshot>,
        env_ids: Option<&Bound<'_, PyAny>>,
        properties: bool,
    ) -> PyResult<()> {
        let (env_ids, snapshot) = (envs(&self.shared, env_ids)?, &snapshot.get().inner);
        self.shared.write(py, |sim| {
            // This includes the state.
            if properties {
                return Ok(sim.properties_mut().restore(snapshot, env_ids.as_deref())?);
            }
            Ok(sim.restore(snapshot, env_ids.as_deref())?)
        })
    }

    /// Simulates copies of environments: controls, shape (num_envs, steps, columns of ``control_names``). Returns the
    /// states after each step, shape (num_envs, steps, columns of ``state_names``), the final states as a snapshot, and
    /// the diverged rows with their reasons. The simulation does not change. Ctrl+C ends the call after the current step.
    #[pyo3(signature = (controls, start=None, env_ids=None))]
    #[expect(clippy::type_complexity, reason = "a tuple of Python")]
    fn rollout<'py>(
        &self,
        py: Python<'py>,
        controls: &Bound<'_, PyAny>,
        start: Option<&Bound<'_, Snapshot>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, Snapshot, Vec<(usize, String)>)> {
        let (controls, env_ids) = (array::<Ix3>(controls, "rollout, controls")?, envs(&self.shared, env_ids)?);
        let start = start.map(|start| &start.get().inner);
        let rollout = interruptible(py, |stop| {
            self.shared.read_detached(stop, |sim| Ok(rollout_until(sim, stop, &controls, start, env_ids.as_deref())?))
        })?;
        let final_states = Snapshot { inner: rollout.final_states };
        Ok((rollout.states.into_pyarray(py).into_any(), final_states, rollout.diverged))
    }

    /// Randomizes properties of environments: a ``Randomization``, or a list of its terms.
    #[pyo3(signature = (randomization, env_ids=None))]
    fn randomize(
        &self,
        py: Python<'_>,
        randomization: &Bound<'_, PyAny>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let terms = PyDict::new(py);
        let is_list = randomization.try_iter().is_ok() && !randomization.is_instance_of::<PyDict>();
        let randomization: Randomization = if is_list {
            terms.set_item("terms", randomization.try_iter()?.collect::<PyResult<Vec<_>>>()?)?;
            cfg::read("Randomization", Some(terms.as_any()))?
        } else {
            cfg::read("Randomization", Some(randomization))?
        };
        let env_ids = envs(&self.shared, env_ids)?;
        self.shared.write(py, |sim| Ok(sim.properties_mut().randomize(&randomization, env_ids.as_deref())?))
    }

    /// Names that have a property, such as the links and objects with a ``"mass"``.
    fn property_names(&self, py: Python<'_>, property: &str) -> PyResult<Vec<String>> {
        let property = property_of(property)?;
        self.shared
            .read(py, |sim| Ok(sim.properties().of(EnvId(0))?.names(property).into_iter().map(String::from).collect()))
    }

    /// Values of a property of a link, object or joint in every environment, shape (num_envs, values).
    fn property<'py>(&self, py: Python<'py>, property: &str, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let property = property_of(property)?;
        let rows = self.shared.read(py, |sim| {
            let mut rows = kinetoscope::ndarray::Array2::zeros((sim.num_envs(), property.width()));
            for (env, mut row) in rows.rows_mut().into_iter().enumerate() {
                let properties = sim.properties().of(EnvId(env))?;
                row.iter_mut().zip(properties.get(property, name)?).for_each(|(to, from)| *to = *from);
            }
            Ok(rows)
        })?;
        Ok(rows.into_pyarray(py).into_any())
    }

    /// Value of a property of a link, object or joint in the model as it was compiled, which ``reset_properties`` returns to.
    fn nominal_property(&self, py: Python<'_>, property: &str, name: &str) -> PyResult<Vec<f64>> {
        let property = property_of(property)?;
        self.shared.read(py, |sim| Ok(sim.properties().of(EnvId(0))?.nominal(property, name)?.to_vec()))
    }

    /// Sets a property of a link, object or joint: one row for each of ``env_ids``, or one for all.
    #[pyo3(signature = (property, name, values, env_ids=None))]
    fn set_property(
        &self,
        py: Python<'_>,
        property: &str,
        name: &str,
        values: &Bound<'_, PyAny>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let property = property_of(property)?;
        let (values, env_ids) = (array::<Ix2>(values, "set_property")?, envs(&self.shared, env_ids)?);
        self.shared.write(py, |sim| Ok(sim.properties_mut().set(property, name, &values, env_ids.as_deref())?))
    }

    /// Resets all properties of environments to their nominal values.
    #[pyo3(signature = (env_ids=None))]
    fn reset_properties(&self, py: Python<'_>, env_ids: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let env_ids = envs(&self.shared, env_ids)?;
        self.shared.write(py, |sim| Ok(sim.properties_mut().reset(env_ids.as_deref())?))
    }

    /// Sets the view of windows, browser views and screenshots [m].
    fn set_camera_view(&self, py: Python<'_>, eye: [f64; 3], target: [f64; 3]) -> PyResult<()> {
        self.shared.write(py, |sim| Ok(sim.scene_mut().set_camera_view(eye, target)?))
    }

    /// Writes the merged robots, the MJCF documents for both MuJoCo versions and the meshes to a folder. Returns
    /// diagnostics for everything left out.
    fn dump<'py>(&self, py: Python<'py>, folder: PathBuf) -> PyResult<Vec<Bound<'py, PyAny>>> {
        diagnostics(py, &self.shared.read(py, |sim| Ok(sim.dump(folder)?))?)
    }

    /// Names of the entities, in the order in which they were added.
    fn keys(&self) -> Vec<String> {
        self.shared.keys()
    }

    /// The entity of this name.
    fn __getitem__(&self, py: Python<'_>, name: &str) -> PyResult<Py<PyAny>> {
        let entity = self.shared.find(name)?;
        self.handle(py, name, entity)
    }

    /// True for the name of an entity, and for a handle of this simulation.
    fn __contains__(&self, name: &Bound<'_, PyAny>) -> bool {
        self.name_of(name).is_ok_and(|name| self.shared.keys().contains(&name))
    }

    fn __iter__(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(self.shared.keys().into_pyobject(py)?.into_any().try_iter()?.into_any().unbind())
    }

    fn __len__(&self) -> usize {
        self.shared.keys().len()
    }

    /// Frees the simulation. Later calls of it and of its handles raise ``DestroyedError``.
    fn destroy(&self, py: Python<'_>) -> PyResult<()> {
        self.shared.destroy(py)
    }

    fn __enter__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, pyo3::types::PyTuple>) -> PyResult<()> {
        self.destroy(py)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let keys = self.shared.keys();
        self.shared.describe(py, "SimulationManager", |sim| {
            let names = if keys.is_empty() { "no entities".into() } else { keys.join(", ") };
            Ok(format!("<SimulationManager: {} envs, dt {} s, {names}>", sim.num_envs(), sim.cfg().physics_dt))
        })
    }

    /// Table of the entities, for notebooks.
    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        let py = slf.py();
        py.import("kinetoscope.notebook")?.getattr("simulation_html")?.call1((slf,)).map(Bound::unbind)
    }
}

impl Simulation {
    /// Name of an entity: a text, or the uid of a handle of this simulation.
    fn name_of(&self, entity: &Bound<'_, PyAny>) -> PyResult<String> {
        if let Ok(name) = entity.extract::<String>() {
            return Ok(name);
        }
        macro_rules! owner {
            ($($Type:ty),*) => {
                None$(.or_else(|| entity.cast::<$Type>().ok().map(|handle| &handle.get().shared)))*
            };
        }
        let owner: Option<&Arc<Shared>> = owner!(Robot, RigidObject, RigidObjectGroup, Terrain, MjcfPart, Weld, Sensor);
        match owner {
            Some(owner) if Arc::ptr_eq(owner, &self.shared) => entity.getattr("uid")?.extract(),
            Some(_) => {
                let message = format!("{} belongs to another simulation", entity.repr()?);
                Err(Failure::new(Class::ForeignHandle, message).into())
            }
            None => Err(Failure::argument(
                "entity",
                format!("expected a name or a handle, not {}", entity.get_type().name()?),
            )
            .into()),
        }
    }

    fn of_scene(py: Python<'_>, cfg: SceneCfg) -> PyResult<Self> {
        let names: Vec<String> = cfg.keys().map(String::from).collect();
        let (manager, entities) = detached(py, || {
            let scene = InteractiveScene::new(cfg)?;
            let entities: Vec<(String, Entity)> = names
                .into_iter()
                .map(|name| entity_of(&scene, &name).map(|entity| (name, entity)))
                .collect::<Result<_, _>>()?;
            Ok((scene.into_sim(), entities))
        })?;
        let shared = Shared::new(manager);
        entities.into_iter().for_each(|(name, entity)| shared.register(&name, entity));
        Ok(Self { shared })
    }

    fn add_entity(&self, py: Python<'_>, kind: &str, name: Option<String>, fields: toml::Table) -> PyResult<Py<PyAny>> {
        let (name, cfg) = cfg::entity(kind, name, fields)?;
        let entity = self.shared.write(py, |sim| add(sim, &name, cfg))?;
        self.shared.register(&name, entity.clone());
        self.handle(py, &name, entity)
    }

    /// Python object of an entity.
    fn handle(&self, py: Python<'_>, name: &str, entity: Entity) -> PyResult<Py<PyAny>> {
        let shared = Arc::clone(&self.shared);
        Ok(match entity {
            Entity::Robot(id) => {
                let passive = self.shared.read(py, |sim| Ok(sim.entities().articulation_id(name).is_ok()))?;
                let kind = if passive { "articulation" } else { "robot" };
                Py::new(py, Robot { shared, id, kind })?.into_any()
            }
            Entity::RigidObject(id) => Py::new(py, RigidObject { shared, id })?.into_any(),
            Entity::Group(id) => Py::new(py, RigidObjectGroup { shared, id })?.into_any(),
            Entity::Terrain(id) => Py::new(py, Terrain { shared, id })?.into_any(),
            Entity::Mjcf(id) => Py::new(py, MjcfPart { shared, id })?.into_any(),
            Entity::Weld(id) => Py::new(py, Weld { shared, id })?.into_any(),
            Entity::Sensor => Py::new(py, Sensor { shared, uid: name.into() })?.into_any(),
        })
    }
}

/// Adds an entity to a simulation.
fn add(sim: &mut SimulationManager, name: &str, cfg: EntityCfg) -> Result<Entity, Failure> {
    let uid = name.to_string();
    Ok(match cfg {
        EntityCfg::Robot(cfg) => Entity::Robot(sim.add_robot(RobotCfg { uid, ..*cfg })?),
        EntityCfg::Articulation(cfg) => {
            sim.add_articulation(ArticulationCfg { uid, ..*cfg })?;
            Entity::Robot(sim.entities().articulated_id(name)?)
        }
        EntityCfg::RigidObject(cfg) => Entity::RigidObject(sim.add_rigid_object(RigidObjectCfg { uid, ..*cfg })?),
        EntityCfg::Group(cfg) => Entity::Group(sim.add_rigid_object_group(RigidObjectGroupCfg { uid, ..*cfg })?),
        EntityCfg::Terrain(cfg) => Entity::Terrain(sim.add_terrain(TerrainCfg { uid, ..*cfg })?),
        EntityCfg::Mjcf(cfg) => Entity::Mjcf(sim.add_mjcf(MjcfPartCfg { uid, ..*cfg })?),
        EntityCfg::Weld(cfg) => Entity::Weld(sim.add_weld(WeldCfg { uid, ..*cfg })?),
        EntityCfg::Sensor(cfg) => {
            cfg.add_to(sim, name)?;
            Entity::Sensor
        }
        _ => return Err(Failure::new(Class::Internal, "this package does not have the type of the entity")),
    })
}

/// Diagnostics as values of Python.
pub(crate) fn diagnostics<'py>(py: Python<'py>, diagnostics: &[Diagnostic]) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let class = py.import("kinetoscope.diagnostics")?.getattr("Diagnostic")?;
    let value = |diagnostic: &Diagnostic| {
        let source = diagnostic.source.as_ref();
        let file = source.map(|source| source.file.as_path());
        let line = source.map(|source| source.line);
        class.call1((diagnostic.to_string(), diagnostic.kind.name(), &diagnostic.message, file, line))
    };
    diagnostics.iter().map(value).collect()
}

/// Handle of an entity of a scene.
fn entity_of(scene: &InteractiveScene, name: &str) -> Result<Entity, Failure> {
    if let Ok(id) = scene.robot_id(name) {
        return Ok(Entity::Robot(id));
    }
    if scene.articulation_id(name).is_ok() {
        return Ok(Entity::Robot(scene.sim().entities().articulated_id(name)?));
    }
    let found = scene.rigid_object_id(name).map(Entity::RigidObject);
    let found = found.or_else(|_| scene.rigid_object_group_id(name).map(Entity::Group));
    let found = found.or_else(|_| scene.terrain_id(name).map(Entity::Terrain));
    let found = found.or_else(|_| scene.mjcf_id(name).map(Entity::Mjcf));
    let found = found.or_else(|_| scene.weld_id(name).map(Entity::Weld));
    Ok(found.unwrap_or(Entity::Sensor))
}

/// The property of a name in configurations.
fn property_of(name: &str) -> PyResult<Property> {
    Property::ALL.into_iter().find(|property| property.name() == name).ok_or_else(|| {
        let known = kinetoscope::scene::pattern::closest_names(name, Property::ALL.map(Property::name));
        let message = format!("unknown property {name:?}; known names: {}", known.join(", "));
        Failure::new(Class::UnknownName, message).into()
    })
}

/// Text of a scene file: the scene as Rust reads it, with all fields. ``scene`` is a ``SceneCfg``, or a dict of its fields.
#[pyfunction]
pub(crate) fn to_toml(scene: &Bound<'_, PyAny>) -> PyResult<String> {
    let scene = cfg::scene(&cfg::scene_table(scene)?)?;
    Ok(guarded(|| Ok(scene.to_toml(&EntityTypes::default())?))?)
}
