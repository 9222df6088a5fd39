//! `SimulationManager`: robots and objects in N environments, compiled and stepped together.

use crate::batch::Batch;
use crate::compile::compile;
use crate::device::{self, DeviceError, DeviceMirror, DeviceScene};
use crate::diverged::DivergedEnv;
use crate::entity_set::EntitySet;
use crate::env::{EnvStatus, SimEnv, Stage};
use crate::error::{Error, Result};
use crate::ids::{EnvId, MjcfId, RigidObjectId, RobotId, TerrainId, env_mask};
use crate::mjcf::document::Integrator;
use crate::mjcf::scene_names::MAX_ROBOTS;
use crate::objects::mjcf_part::{MjcfPart, MjcfPartMut};
use crate::objects::mjcf_part_data::{MjcfData, MjcfPartCfg};
use crate::objects::rigid_object::{RigidObject, RigidObjectMut};
use crate::objects::rigid_object_data::{RigidObjectCfg, RigidObjectData};
use crate::objects::robot::{Robot, RobotCfg, RobotMut};
use crate::objects::robot_data::{RobotData, RobotKind};
use crate::objects::terrain::{Terrain, TerrainCfg};
use crate::observer::{ObserverList, SimEvent};
use crate::row::RowPart;
use crate::sensor_list::{SensorId, SensorList};
use crate::simulation::Simulation;
use crate::simulation_cfg::SimulationManagerCfg;
use crate::viewpoint::Viewpoint;
use crate::visible::{VisualCache, VisualScene};
use kinetoscope_exec::ThreadPool;
use kinetoscope_mujoco as mj;
use kinetoscope_render::geometry::RayAssetCache;
use kinetoscope_robot::diagnostic::Diagnostic;
use kinetoscope_scene::EnvScene;
use kinetoscope_scene::StateFields;
use kinetoscope_sensors::{Sensor, SensorCfg, SensorContext};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// Source of the serial numbers that bind a handle to the manager that created it.
static NEXT_MANAGER: AtomicU64 = AtomicU64::new(0);

/// Robots, objects and sensors in N independent environments. Dropping the manager frees all memory.
#[derive(Debug)]
pub struct SimulationManager {
    pub(crate) serial: u64,
    pub(crate) cfg: SimulationManagerCfg,
    pub(crate) entities: EntitySet,
    visuals: VisualCache,
    /// Acceleration structures shared by all ray casters.
    ray_assets: RayAssetCache,
    /// Thread pool shared by batch, sensors and renderers.
    pool: ThreadPool,
    diagnostics: Vec<Diagnostic>,
    pub(crate) simulation: Simulation,
    pub(crate) sensors: SensorList,
    pub(crate) observers: ObserverList,
    /// Number of randomization passes done in each environment.
    pub(crate) randomization_count: Vec<u64>,
    /// Point of view of windows, browser views and screenshots; `None` until the program sets one.
    pub(crate) viewpoint: Option<Viewpoint>,
}

impl SimulationManager {
    /// Creates a simulation with the configured ground and lights, without other entities.
    ///
    /// # Errors
    /// A number of the configuration is out of range, or this MuJoCo version lacks the integrator. Memory or threads
    /// cannot be allocated. The MuJoCo library differs from the version this program was built for.
    pub fn new(cfg: SimulationManagerCfg) -> Result<Self> {
        cfg.validate()?;
        mj::check_version()?;
        if cfg.integrator == Integrator::ImplicitFast && mj::BUILD_VERSION == mj::SupportedVersion::V2 {
            let version = mj::version_string();
            return Err(Error::UnsupportedIntegrator { integrator: cfg.integrator.name(), version });
        }
        let entities = EntitySet::default();
        let pool = ThreadPool::new();
        let mut simulation = compile(&cfg, &entities, &pool)?;
        if let Some(physics) = device::open(cfg.device)? {
            load_on_device(DeviceMirror::new(physics), &cfg, &entities, &mut simulation).map_err(|(error, _)| error)?;
        }
        let serial = NEXT_MANAGER.fetch_add(1, Ordering::Relaxed);
        let sensors = SensorList::new(serial, cfg.substeps);
        let visuals = VisualCache::default();
        let randomization_count = vec![0; cfg.num_envs];
        Ok(Self {
            serial,
            cfg,
            entities,
            visuals,
            ray_assets: RayAssetCache::default(),
            pool,
            diagnostics: Vec::new(),
            simulation,
            sensors,
            observers: ObserverList::default(),
            randomization_count,
            viewpoint: None,
        })
    }

    /// The configuration.
    pub fn cfg(&self) -> &SimulationManagerCfg {
        &self.cfg
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.cfg.num_envs
    }

    /// Number of threads that step, the calling thread included: at most that of the configuration, fewer for few
    /// environments.
    pub fn threads(&self) -> usize {
        self.simulation.batch.threads()
    }

    /// Adds a robot to every environment, from URDF files ([`RobotCfg::urdf`]) or an MJCF file ([`RobotCfg::mjcf`]).
    ///
    /// The model is compiled in this call, so all errors are reported here. On an error the simulation is unchanged.
    /// Existing entities keep their state, bit for bit.
    ///
    /// Adding an entity changes the later motion of existing entities only within solver tolerance. Without constraint
    /// rows the motion is the same up to rounding. Implicit drives
    /// ([`DriveModel::Implicit`](crate::DriveModel::Implicit)), friction, limits and contacts are rows, which MuJoCo
    /// solves for the whole scene at once. The solver stops at a residual below 1e-8 of the mean inertia times the
    /// number of degrees of freedom, and a larger scene leaves another residual. For an arm with a hand the difference
    /// is below 1e-6 rad after 1 s.
    ///
    /// # Errors
    /// The name is taken, the simulation has 30 robots and articulations already, or the files, names, drives or meshes
    /// of the robot are invalid.
    pub fn add_robot(&mut self, cfg: RobotCfg) -> Result<RobotId> {
        self.add_with_role(cfg, RobotKind::Robot)
    }

    /// Adds a robot or a passive articulation.
    pub(crate) fn add_with_role(&mut self, cfg: RobotCfg, role: RobotKind) -> Result<RobotId> {
        self.check_world_uid(&cfg.uid)?;
        if self.entities.robots.len() >= MAX_ROBOTS {
            return Err(Error::TooManyRobots(MAX_ROBOTS));
        }
        let mut diagnostics = Vec::new();
        let (index, mask_id) = (self.entities.robots.len(), self.entities.next_mask_id());
        let scene = self.simulation.batch.model();
        let robot = RobotData::load(cfg, role, &self.cfg, index, scene, mask_id, &mut diagnostics)?;
        let robot = robot.with_clearance(&self.cfg, &self.entities, &mut diagnostics)?;
        let mut contents = self.entities.clone();
        contents.robots.push(Arc::new(robot));
        self.recompile_with(contents, diagnostics)?;
        Ok(RobotId { manager: self.serial, index: self.entities.robots.len() - 1 })
    }

    /// Adds a rigid object to every environment and compiles the model, as [`add_robot`](Self::add_robot) does.
    ///
    /// # Errors
    /// The name is taken, a number is out of range, or a mesh file cannot be used.
    pub fn add_rigid_object(&mut self, cfg: RigidObjectCfg) -> Result<RigidObjectId> {
        self.check_world_uid(&cfg.uid)?;
        let mut diagnostics = Vec::new();
        let object = RigidObjectData::new(cfg, self.entities.next_mask_id(), &mut diagnostics)?;
        let mut contents = self.entities.clone();
        contents.objects.push(Arc::new(object));
        self.recompile_with(contents, diagnostics)?;
        Ok(RigidObjectId { manager: self.serial, index: self.entities.objects.len() - 1 })
    }

    /// Adds a terrain to every environment and compiles the model, as [`add_robot`](Self::add_robot) does. A terrain is
    /// static and collides with robots and objects. Cameras and ray casters see it under its uid.
    ///
    /// # Errors
    /// The name is taken, a height is not finite, there are fewer than two rows or columns, or a number is out of
    /// range.
    pub fn add_terrain(&mut self, cfg: TerrainCfg) -> Result<TerrainId> {
        self.check_world_uid(&cfg.uid)?;
        let terrain = Terrain::new(cfg, self.entities.next_mask_id())?;
        let mut contents = self.entities.clone();
        contents.terrains.push(Arc::new(terrain));
        self.recompile_with(contents, Vec::new())?;
        Ok(TerrainId { manager: self.serial, index: self.entities.terrains.len() - 1 })
    }

    /// Attaches an MJCF file to every environment and compiles the model, as [`add_robot`](Self::add_robot) does.
    /// Bodies, joints, contacts, couplings, tendons, actuators and sensors of the file are added, with the prefix
    /// `uid/` on every name. Cameras and sensors can be attached to its bodies and named sites.
    ///
    /// Geoms of the file collide by their own contact bits. The ground, terrains and objects collide with every geom
    /// with a nonzero `contype`. Robots collide with every geom that has the lowest bit in its `contype`, which is
    /// MuJoCo's default.
    ///
    /// Global settings, keyframes and skins of the file are not imported. The same holds for sensors that cannot be
    /// attached: sensors of the whole world, user sensors, and sensors of 4.x that MuJoCo cannot write back. None of
    /// these changes how the bodies move. [`diagnostics`](Self::diagnostics) lists each.
    ///
    /// # Errors
    /// The name is taken, MuJoCo rejects the file (its message names element and line), or the file has something that
    /// cannot be attached, such as flexible bodies and plugins of 4.x.
    pub fn add_mjcf(&mut self, cfg: MjcfPartCfg) -> Result<MjcfId> {
        self.check_world_uid(&cfg.uid)?;
        let mut diagnostics = Vec::new();
        let (index, scene) = (self.entities.mjcf_models.len(), self.simulation.batch.model());
        let part = MjcfData::load(cfg, index, self.entities.next_mask_id(), scene, &mut diagnostics)?;
        let mut contents = self.entities.clone();
        contents.mjcf_models.push(Arc::new(part));
        self.recompile_with(contents, diagnostics)?;
        Ok(MjcfId { manager: self.serial, index })
    }

    /// Checks that the name `uid` is free, in the scene and in MuJoCo's world.
    pub(crate) fn check_world_uid(&self, uid: &str) -> Result<()> {
        self.entities.check_uid_free(uid)?;
        // Names of MuJoCo's world body and of the ground geom.
        if matches!(uid, "world" | "ground") { Err(Error::DuplicateUid(uid.into())) } else { Ok(()) }
    }

    /// Compiles `contents` and replaces the simulation. On an error nothing changes.
    pub(crate) fn recompile_with(&mut self, contents: EntitySet, mut diagnostics: Vec<Diagnostic>) -> Result<()> {
        let mut simulation = compile(&self.cfg, &contents, &self.pool)?;
        simulation.carry_properties(&self.simulation)?;
        if let Some(device) = self.simulation.batch.take_device()
            && let Err((error, device)) = load_on_device(device, &self.cfg, &contents, &mut simulation)
        {
            // The scene before is still there, and the device needs it again.
            let restored = load_on_device(device, &self.cfg, &self.entities, &mut self.simulation);
            return Err(restored.map_or_else(|(error, _)| error, |()| error).into());
        }
        // Compiling repeats the earlier diagnostics of the robots: report only the new ones.
        let mut known = self.simulation.diagnostics.clone();
        for diagnostic in &simulation.diagnostics {
            match known.iter().position(|d| d == diagnostic) {
                Some(again) => drop(known.swap_remove(again)),
                None => diagnostics.push(diagnostic.clone()),
            }
        }
        simulation.transfer_state_from(&self.simulation);
        self.simulation = simulation;
        mj::trim_heap();
        self.entities = contents;
        self.add_diagnostics(diagnostics);
        if !self.sensors.is_empty() {
            let context = self.sensor_context(self.sensors.requires());
            self.sensors.rebuild(&mut self.simulation, &context);
        }
        self.notify_all(&SimEvent::Compiled);
        Ok(())
    }

    /// Adds a sensor to all environments. The crate `kinetoscope_sensors` has the built-in sensors; other crates can
    /// add their own. A sensor sees links, movable joints and drives of all robots and articulations in insertion
    /// order, then rigid objects, then bodies, joints and actuators of attached MJCF files. Adding an entity later
    /// rebuilds the sensor and clears its history.
    ///
    /// # Errors
    /// The configuration is invalid, another sensor has the name, or the sensor needs a quantity that the simulation
    /// does not gather.
    pub fn add_sensor<C>(&mut self, uid: impl Into<String>, cfg: C) -> Result<SensorId<C::Sensor>>
    where
        C: SensorCfg + Send + 'static,
    {
        let uid = uid.into();
        self.sensors.check(&uid, cfg.requires())?;
        if self.simulation.batch.is_on_device() && cfg.requires().contains(StateFields::SENSORDATA) {
            let (what, expected) =
                (format!("sensor {uid:?}, which reads MuJoCo's own sensors"), "it needs the device cpu");
            return Err(DeviceError::Unsupported { what, expected: expected.into() }.into());
        }
        let context = SensorContext { name: uid.as_str().into(), ..self.sensor_context(cfg.requires()) };
        self.sensors.add(uid, cfg, &mut self.simulation, &context)
    }

    /// Returns a sensor for reading. A [lazy](SensorCfg::lazy) sensor runs its pending measurement now.
    ///
    /// # Errors
    /// The sensor failed, in an earlier step or now.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn sensor<S: Sensor>(&self, id: SensorId<S>) -> Result<&S> {
        self.sensors.get(id)
    }

    /// Returns a sensor for changes, for instance to the pose of a camera. A lazy sensor runs its pending measurement
    /// first.
    ///
    /// # Errors
    /// The sensor failed, in an earlier step or now.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn sensor_mut<S: Sensor>(&mut self, id: SensorId<S>) -> Result<&mut S> {
        self.sensors.get_mut(id)
    }

    /// Context for sensors that need the quantities `requires`. Builds the visual scene on the first call that needs
    /// it.
    fn sensor_context(&mut self, requires: StateFields) -> SensorContext {
        let sees = !requires.intersection(StateFields::VISIBLE | StateFields::INSTANCES).is_empty();
        let scene = sees.then(|| Arc::clone(self.visual_scene().scene()));
        let own_scenes = if sees { self.simulation.env_scenes.clone() } else { Vec::new() };
        SensorContext {
            num_envs: self.cfg.num_envs,
            dt: self.cfg.physics_dt,
            gravity: self.cfg.gravity,
            name: "".into(),
            seed: self.cfg.seed,
            first_env: self.cfg.first_env(),
            bodies: self.entities.body_names(),
            moving_bodies: self.entities.moving_bodies(),
            joints: self.entities.joint_names(),
            actuators: self.entities.actuator_names(),
            engine_sensors: self.entities.engine_sensors(),
            scene,
            own_scenes,
            rebuilt: false,
            ray_assets: self.ray_assets.clone(),
            threads: self.cfg.num_threads(),
            pool: self.pool.clone(),
        }
    }

    /// Returns the visual scene. The first call after a change of the scene builds it and reads the visual meshes. An
    /// unreadable mesh is omitted with a diagnostic.
    pub(crate) fn visual_scene(&mut self) -> Arc<VisualScene> {
        let visible = self.simulation.build_visual_scene(&self.cfg, &self.entities, &mut self.visuals);
        let diagnostics = self.visuals.take_diagnostics();
        self.add_diagnostics(diagnostics);
        visible
    }

    /// Adds diagnostics, each of which is also an event.
    fn add_diagnostics(&mut self, diagnostics: Vec<Diagnostic>) {
        for diagnostic in &diagnostics {
            tracing::warn!(target: "kinetoscope_sim", kind = diagnostic.kind.name(), "{diagnostic}");
        }
        self.diagnostics.extend(diagnostics);
    }

    /// Render scene of an environment with its own sizes or colors; `EnvScene(None)` for the shared scene.
    pub(crate) fn env_scene(&self, env: EnvId) -> &EnvScene {
        static SHARED_SCENE: EnvScene = EnvScene(None);
        self.simulation.env_scenes.get(env.0).unwrap_or(&SHARED_SCENE)
    }

    /// Returns a robot for reading.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn robot(&self, id: RobotId) -> Robot<'_> {
        let index = self.index_of(id.manager, id.index);
        Robot::new(&self.entities.robots[index], &self.simulation, index)
    }

    /// Returns a robot for commands and writes.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn robot_mut(&mut self, id: RobotId) -> RobotMut<'_> {
        let index = self.index_of(id.manager, id.index);
        RobotMut::new(&self.entities.robots[index], &mut self.simulation, &mut self.sensors, index)
    }

    /// Returns a rigid object for reading.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn rigid_object(&self, id: RigidObjectId) -> RigidObject<'_> {
        let index = self.index_of(id.manager, id.index);
        RigidObject::new(&self.entities.objects[index], &self.simulation, index)
    }

    /// Returns a rigid object for writing.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn rigid_object_mut(&mut self, id: RigidObjectId) -> RigidObjectMut<'_> {
        let index = self.index_of(id.manager, id.index);
        RigidObjectMut::new(&self.entities.objects[index], &mut self.simulation, &mut self.sensors, index)
    }

    /// Returns an attached MJCF file for reading.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn mjcf_part(&self, id: MjcfId) -> MjcfPart<'_> {
        let index = self.index_of(id.manager, id.index);
        MjcfPart::new(&self.entities.mjcf_models[index], &self.simulation, index)
    }

    /// Returns an attached MJCF file for commands and writes.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn mjcf_part_mut(&mut self, id: MjcfId) -> MjcfPartMut<'_> {
        let index = self.index_of(id.manager, id.index);
        MjcfPartMut::new(&self.entities.mjcf_models[index], &mut self.simulation, &mut self.sensors, index)
    }

    /// Reads MuJoCo's model and data of one environment directly, for quantities outside this API. An environment with
    /// randomized properties has a model of its own.
    ///
    /// The data is as after `mj_step1` in the current state: poses, velocities, contacts without forces, bias forces.
    /// Of the results of the last solve, it has `qacc`, `qfrc_actuator`, `qfrc_constraint`, `actuator_force` and
    /// `sensordata`. The others are 0, because environments do not keep them: `efc_force` (with
    /// [`contact_force`](kinetoscope_mujoco::Data::contact_force)), `cacc`, `cfrc_int`, `cfrc_ext`, `act_dot`,
    /// `qfrc_smooth`, `qacc_smooth` and `qfrc_inverse`. [`SceneViewMut::contacts`](crate::SceneViewMut::contacts) has
    /// contacts with forces.
    ///
    /// # Errors
    /// The environment does not exist.
    pub fn with_mujoco<T>(&self, env: EnvId, read: impl FnOnce(&mj::Model, &mj::Data) -> T) -> Result<T> {
        env_mask(Some(&[env]), self.num_envs())?;
        Ok(self.simulation.batch.read_data(env.0, |data| read(data.model(), data)))
    }

    /// Finds the robot or articulation `uid` among those that satisfy `wanted`.
    pub(crate) fn find_robot(
        &self,
        uid: &str,
        what: &'static str,
        wanted: impl Fn(&RobotData) -> bool,
    ) -> Result<RobotId> {
        let robots = self.entities.robots.iter();
        let among: Vec<(usize, &str)> =
            robots.enumerate().filter(|(_, robot)| wanted(robot)).map(|(index, robot)| (index, robot.uid())).collect();
        let found = among.iter().find(|(_, of)| *of == uid);
        found.map(|&(index, _)| RobotId { manager: self.serial, index }).ok_or_else(|| Error::UnknownName {
            what,
            name: uid.into(),
            candidates: among.iter().map(|(_, uid)| (*uid).into()).collect(),
        })
    }

    /// The batch of environments.
    #[cfg(feature = "internals")]
    pub fn batch(&self) -> &Batch {
        &self.simulation.batch
    }

    #[track_caller]
    pub(crate) fn index_of(&self, manager: u64, index: usize) -> usize {
        assert!(manager == self.serial, "this handle belongs to another SimulationManager");
        index
    }

    /// Steps all environments `steps` times by `physics_dt`. `update(n)` equals n calls of `update(1)`, bit for bit.
    /// Sensors measure and [observers](crate::Observer) are called after the steps at which they are due. Diverged
    /// environments do not step.
    pub fn update(&mut self, steps: u32) {
        let mut left = steps;
        while left > 0 {
            left -= self.step_until_due(left.min(MAX_BLOCK_STEPS), Self::advance);
        }
    }

    /// Does `steps` physics steps and updates the sensors; does not notify observers.
    fn advance(&mut self, steps: u32) {
        let mut left = steps;
        while left > 0 {
            left -= if self.sensors.is_empty() {
                self.simulation.batch.step(left * self.cfg.substeps);
                left
            } else {
                self.sensors.advance(&mut self.simulation, left)
            };
        }
    }

    /// Resets environments to their initial state and time 0 (`None` for all environments). Targets and controls return
    /// to their initial values, external wrenches end, welds are released, and actuator models lose their memory.
    /// Sensors are reset too: they show the initial state at once, and their histories are empty. Properties, gains,
    /// limits and gravity compensation stay. Diverged environments run again. Ids may repeat.
    ///
    /// # Errors
    /// An environment does not exist; then no environment is reset.
    pub fn reset(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        let chosen = env_mask(env_ids, self.num_envs())?;
        self.simulation.reset(&chosen);
        if !self.sensors.is_empty() {
            let envs: Vec<usize> = chosen.iter().enumerate().filter(|(_, c)| **c).map(|(i, _)| i).collect();
            self.sensors.reset(&envs, &mut self.simulation);
        }
        let env_ids = chosen.iter().enumerate().filter(|(_, c)| **c).map(|(i, _)| EnvId(i)).collect();
        self.notify_all(&SimEvent::Reset { env_ids });
        Ok(())
    }

    /// Clears the buffers that environments keep beside their state, in all of them for `env_ids = None`. Sensors
    /// restart from the current state, external wrenches end, and actuator models lose their memory (delays, motor
    /// states). Positions, velocities, targets and time stay. A diverged environment stays diverged.
    ///
    /// # Errors
    /// An environment does not exist; then no environment is cleared.
    pub(crate) fn reset_buffers(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        let chosen = env_mask(env_ids, self.num_envs())?;
        let envs: Vec<usize> = chosen.iter().enumerate().filter(|(_, c)| **c).map(|(i, _)| i).collect();
        envs.iter().for_each(|&env| self.simulation.batch.write_at(env, Stage::Kinematics, SimEnv::reset_buffers));
        if !self.sensors.is_empty() {
            self.sensors.reset(&envs, &mut self.simulation);
        }
        Ok(())
    }

    /// Simulation time of each environment since its last reset \[s\].
    pub fn time(&self) -> Vec<f64> {
        let mut times = Vec::with_capacity(self.num_envs());
        self.simulation.batch.for_each_row(RowPart::Clock, |_, row| times.push(row.time()));
        times
    }

    /// Environments in which a step failed or a written state was rejected, with the reason. They stay frozen in their
    /// last valid state until reset.
    pub fn diverged(&self) -> Vec<DivergedEnv> {
        let mut diverged = Vec::new();
        self.simulation.batch.for_each_row(RowPart::Clock, |i, env| {
            if let EnvStatus::Diverged { step, reason } = env.status() {
                diverged.push(DivergedEnv { env: EnvId(i), step: *step, reason: reason.to_string() });
            }
        });
        diverged
    }

    /// Diagnostics of all entities added so far: everything repaired, ignored or unusual. Diagnostics of visual meshes
    /// are added when the visual scene is first built.
    pub fn diagnostics(&self) -> &[Diagnostic] {
        &self.diagnostics
    }

    /// Writes every stage of the pipeline to `dir`: the merged robots as URDF, the descriptions, and the MJCF with
    /// meshes for both supported MuJoCo versions.
    ///
    /// Returns diagnostics for everything left out: unreadable visual meshes and textures, and elements of MJCF files
    /// compiled by MuJoCo 4.x that 2.2.2 lacks. A comment in `robot.mjcf2.xml` lists those elements. Armature that the
    /// export adds to drives for stability gives a diagnostic, too. `diagnostics.txt` in `dir` holds the earlier
    /// diagnostics followed by these.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn dump(&self, dir: impl AsRef<std::path::Path>) -> Result<Vec<Diagnostic>> {
        crate::export::dump(&self.cfg, &self.entities, &self.simulation, &self.diagnostics, dir.as_ref())
    }
}

/// Largest number of steps in one block: it bounds the response time of the caller (Ctrl+C) and the lead of one
/// environment over the others.
const MAX_BLOCK_STEPS: u32 = 1000;

/// Loads a compiled scene on a device, which then steps its environments. On an error, returns the device too.
#[expect(clippy::result_large_err, reason = "the error returns the device")]
fn load_on_device(
    mut device: DeviceMirror,
    cfg: &SimulationManagerCfg,
    contents: &EntitySet,
    simulation: &mut Simulation,
) -> std::result::Result<(), (DeviceError, DeviceMirror)> {
    let table = simulation.batch.read_row(0, |row| Arc::clone(row.drives.table()));
    let loaded =
        DeviceScene::new(cfg, contents, simulation).and_then(|scene| scene.load_on(&mut device, &table, cfg.num_envs));
    match loaded {
        Ok(()) => {
            simulation.batch.set_device(device);
            Ok(())
        }
        Err(error) => Err((error, device)),
    }
}

/// [Steps](SimulationManager::update) all environments until another thread sets `stop`. Returns the number of steps done:
/// all of them, or fewer if the flag was set. It is read before blocks of steps, each of about 50 ms or one step.
pub fn update_until(sim: &mut SimulationManager, stop: &AtomicBool, steps: u32) -> u32 {
    const LONGEST_BLOCK: f64 = 0.05;
    let (mut done, mut block) = (0, 1);
    while done < steps && !stop.load(Ordering::Relaxed) {
        let (started, now) = (Instant::now(), block.min(steps - done));
        sim.update(now);
        done += now;
        // At most twice as many steps as before, so that one fast block does not lead to a long one.
        let per_step = started.elapsed().as_secs_f64() / f64::from(now);
        block = ((LONGEST_BLOCK / per_step.max(1e-9)) as u32).clamp(1, block.saturating_mul(2));
    }
    done
}
