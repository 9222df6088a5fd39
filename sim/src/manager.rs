//! `SimulationManager`: robots and objects in N environments, compiled and stepped together.

use crate::batch::Batch;
use crate::compile::compile;
use crate::contents::Contents;
use crate::diverged::DivergedEnv;
use crate::env::{Env, EnvStatus};
use crate::error::{Error, Result};
use crate::ids::{EnvId, MjcfId, ObjectId, RobotId, TerrainId, env_mask};
use crate::mjcf::document::Integrator;
use crate::mjcf::scene_names::MAX_ROBOTS;
use crate::objects::mjcf_part::{MjcfPart, MjcfPartMut};
use crate::objects::mjcf_part_data::{MjcfCfg, MjcfData};
use crate::objects::rigid_object::{RigidObject, RigidObjectMut};
use crate::objects::rigid_object_data::{RigidObjectCfg, RigidObjectData};
use crate::objects::robot::{Robot, RobotCfg, RobotMut};
use crate::objects::robot_data::{RobotData, Role};
use crate::objects::terrain::{Terrain, TerrainCfg};
use crate::observer::{Moment, ObserverSlots};
use crate::sensor_list::{SensorId, SensorList};
use crate::simulation::Simulation;
use crate::simulation_cfg::SimulationManagerCfg;
use crate::viewpoint::Viewpoint;
use crate::visible::{Visible, VisualCache};
use kinetoscope_exec::ThreadPool;
use kinetoscope_mujoco as mj;
use kinetoscope_render::geometry::RayAssets;
use kinetoscope_robot::diagnostic::Diagnostic;
use kinetoscope_scene::OwnScene;
use kinetoscope_scene::Requires;
use kinetoscope_sensors::{Sensor, SensorCfg, SensorContext};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Tells managers of one process apart, so that a handle is not used with another one.
static NEXT_MANAGER: AtomicU64 = AtomicU64::new(0);

/// Robots and objects in N environments. Environments never touch each other; dropping the manager frees everything.
#[derive(Debug)]
pub struct SimulationManager {
    pub(crate) serial: u64,
    pub(crate) cfg: SimulationManagerCfg,
    pub(crate) contents: Contents,
    visuals: VisualCache,
    /// What ray casters have built.
    ray_assets: RayAssets,
    /// Threads of the sensors.
    pool: ThreadPool,
    diagnostics: Vec<Diagnostic>,
    pub(crate) simulation: Simulation,
    pub(crate) sensors: SensorList,
    pub(crate) observers: ObserverSlots,
    /// How often properties were drawn for each environment.
    pub(crate) draws: Vec<u64>,
    /// What came of the last step of the task that runs here.
    /// Point of view of windows, browser views and screenshots, where the program set one.
    pub(crate) viewpoint: Option<Viewpoint>,
}

impl SimulationManager {
    /// An empty simulation.
    ///
    /// # Errors
    /// A number of the configuration is out of range, or MuJoCo is not the one this program was built for.
    pub fn new(cfg: SimulationManagerCfg) -> Result<Self> {
        cfg.validate()?;
        mj::check_version()?;
        if cfg.integrator == Integrator::ImplicitFast && mj::TARGET == mj::Target::V2 {
            let version = mj::version_string();
            return Err(Error::IntegratorUnknown { integrator: cfg.integrator.name(), version });
        }
        let contents = Contents::default();
        let pool = ThreadPool::new();
        let simulation = compile(&cfg, &contents, &pool)?;
        let serial = NEXT_MANAGER.fetch_add(1, Ordering::Relaxed);
        let sensors = SensorList::new(serial, cfg.substeps);
        let visuals = VisualCache::default();
        let draws = vec![0; cfg.num_envs];
        Ok(Self {
            serial,
            cfg,
            contents,
            visuals,
            ray_assets: RayAssets::default(),
            pool,
            diagnostics: Vec::new(),
            simulation,
            sensors,
            observers: ObserverSlots::default(),
            draws,
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

    /// Number of threads that step.
    pub fn threads(&self) -> usize {
        self.simulation.batch.threads()
    }

    /// Adds a robot to every environment. The model is compiled here, so that whatever is wrong is said here; on an
    /// error the simulation is as it was. What exists already keeps its state, to the last bit.
    ///
    /// Where it goes from there, as if nothing had been added, is the same to rounding where the scene has no rows of
    /// constraints. Rows, and implicit drives ([`DriveModel::Implicit`](crate::DriveModel::Implicit)), friction, limits and
    /// contacts are rows, are solved for the whole scene at once, until what is left is below the solver's tolerance, 1e-8 of
    /// the mean inertia times the number of degrees of freedom: more in the scene leaves something else. An arm with a hand
    /// goes on to 1e-6 rad over 1 s.
    ///
    /// It is made of URDF files ([`RobotCfg::urdf`]), or is an MJCF file ([`RobotCfg::mjcf`]).
    ///
    /// # Errors
    /// Anything wrong with the files, names, drives or meshes of the robot.
    pub fn add_robot(&mut self, cfg: RobotCfg) -> Result<RobotId> {
        self.add_as(cfg, Role::Robot)
    }

    /// Adds a robot, or an articulation that is none.
    pub(crate) fn add_as(&mut self, cfg: RobotCfg, role: Role) -> Result<RobotId> {
        self.contents.check_uid(&cfg.uid)?;
        if self.contents.robots.len() >= MAX_ROBOTS {
            return Err(Error::TooManyRobots(MAX_ROBOTS));
        }
        let mut diagnostics = Vec::new();
        let (index, mask_id) = (self.contents.robots.len(), self.contents.next_mask_id());
        let scene = self.simulation.batch.model();
        let robot = RobotData::load(cfg, role, &self.cfg, index, scene, mask_id, &mut diagnostics)?;
        let robot = robot.with_clearance(&self.cfg, &self.contents, &mut diagnostics)?;
        let mut contents = self.contents.clone();
        contents.robots.push(Arc::new(robot));
        self.replace_contents(contents, diagnostics)?;
        Ok(RobotId { manager: self.serial, index: self.contents.robots.len() - 1 })
    }

    /// Adds a rigid object to every environment, compiled as [`add_robot`](Self::add_robot) does.
    ///
    /// # Errors
    /// The name is taken, a number is out of range, or a mesh file cannot be used.
    pub fn add_rigid_object(&mut self, cfg: RigidObjectCfg) -> Result<ObjectId> {
        self.check_world_uid(&cfg.uid)?;
        let mut diagnostics = Vec::new();
        let object = RigidObjectData::new(cfg, self.contents.next_mask_id(), &mut diagnostics)?;
        let mut contents = self.contents.clone();
        contents.objects.push(Arc::new(object));
        self.replace_contents(contents, diagnostics)?;
        Ok(ObjectId { manager: self.serial, index: self.contents.objects.len() - 1 })
    }

    /// Adds a terrain to every environment, compiled as [`add_robot`](Self::add_robot) does. It stands fixed, collides with
    /// robots and objects, and is seen by cameras and ray casters, for which it is called by its uid.
    ///
    /// # Errors
    /// The name is taken, a height is not finite, there are fewer than two rows or columns, or a number is out of range.
    pub fn add_terrain(&mut self, cfg: TerrainCfg) -> Result<TerrainId> {
        self.check_world_uid(&cfg.uid)?;
        let terrain = Terrain::new(cfg, self.contents.next_mask_id())?;
        let mut contents = self.contents.clone();
        contents.terrains.push(Arc::new(terrain));
        self.replace_contents(contents, Vec::new())?;
        Ok(TerrainId { manager: self.serial, index: self.contents.terrains.len() - 1 })
    }

    /// Adds an MJCF file to every environment, compiled as [`add_robot`](Self::add_robot) does: its bodies, joints, contacts,
    /// couplings, tendons, actuators and sensors, every name with `uid/` before it. Its bodies and named sites are frames that
    /// cameras and sensors can be attached to. Its geoms collide by the bits that the file gives them: the ground, terrains and
    /// objects collide with every geom whose `contype` is not 0, robots with every geom that has the lowest bit in its
    /// `contype`, as MuJoCo's default has.
    ///
    /// Settings of the file for its whole model, keyframes and skins are not taken over, nor are sensors that a part cannot
    /// have (those of the whole world, of a user's own type, and what only 4.x has and nobody writes back): nothing moves
    /// otherwise without them. [`diagnostics`](Self::diagnostics) names each.
    ///
    /// # Errors
    /// The name is taken, MuJoCo refuses the file (with its words, which name element and line), or the file has something
    /// that a part cannot have, such as flexible bodies and plugins of 4.x.
    pub fn add_mjcf(&mut self, cfg: MjcfCfg) -> Result<MjcfId> {
        self.check_world_uid(&cfg.uid)?;
        let mut diagnostics = Vec::new();
        let (index, scene) = (self.contents.parts.len(), self.simulation.batch.model());
        let part = MjcfData::load(cfg, index, self.contents.next_mask_id(), scene, &mut diagnostics)?;
        let mut contents = self.contents.clone();
        contents.parts.push(Arc::new(part));
        self.replace_contents(contents, diagnostics)?;
        Ok(MjcfId { manager: self.serial, index })
    }

    /// Checks that nothing in the world is called `uid` yet.
    pub(crate) fn check_world_uid(&self, uid: &str) -> Result<()> {
        self.contents.check_uid(uid)?;
        // MuJoCo's world body and our ground are called so.
        if matches!(uid, "world" | "ground") { Err(Error::DuplicateUid(uid.into())) } else { Ok(()) }
    }

    /// Compiles `contents` and goes on with them; on an error nothing has changed.
    pub(crate) fn replace_contents(&mut self, contents: Contents, mut diagnostics: Vec<Diagnostic>) -> Result<()> {
        let mut simulation = compile(&self.cfg, &contents, &self.pool)?;
        // Compiling says again what it said of the robots before.
        let mut known = self.simulation.diagnostics.clone();
        for diagnostic in &simulation.diagnostics {
            match known.iter().position(|d| d == diagnostic) {
                Some(again) => drop(known.swap_remove(again)),
                None => diagnostics.push(diagnostic.clone()),
            }
        }
        simulation.carry_properties(&self.simulation)?;
        simulation.carry_over(&self.simulation);
        self.simulation = simulation;
        mj::release_freed();
        self.contents = contents;
        self.diagnostics.extend(diagnostics);
        if !self.sensors.is_empty() {
            let context = self.sensor_context(self.sensors.requires());
            self.sensors.rebuild(&mut self.simulation, &context);
        }
        self.tell_all(&Moment::Compiled);
        Ok(())
    }

    /// Adds a sensor of all environments; `sensors` has the built-in ones, and a crate of yours may bring its own. The
    /// sensor sees links, movable joints and drives of all robots, in the order in which they were added, then what MJCF files
    /// have of these. Adding a robot later starts its history again.
    ///
    /// # Errors
    /// The configuration is wrong, the name is taken, or the sensor needs a quantity that is not gathered.
    pub fn add_sensor<C>(&mut self, uid: impl Into<String>, cfg: C) -> Result<SensorId<C::Sensor>>
    where
        C: SensorCfg + Send + 'static,
    {
        let uid = uid.into();
        self.sensors.check(&uid, cfg.requires())?;
        let context = SensorContext { name: uid.as_str().into(), ..self.sensor_context(cfg.requires()) };
        self.sensors.add(uid, cfg, &mut self.simulation, &context)
    }

    /// A sensor, to read. A [lazy](SensorCfg::lazy) one measures now what was due.
    ///
    /// # Errors
    /// The sensor failed, in an earlier step or now.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn sensor<S: Sensor>(&self, id: SensorId<S>) -> Result<&S> {
        self.sensors.get(id)
    }

    /// A sensor, to change: a camera's pose, for instance.
    ///
    /// # Errors
    /// The sensor failed in an earlier step.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn sensor_mut<S: Sensor>(&mut self, id: SensorId<S>) -> Result<&mut S> {
        self.sensors.get_mut(id)
    }

    /// The scene for a sensor that requires `requires`. What cameras draw is made when the first asks for it.
    fn sensor_context(&mut self, requires: Requires) -> SensorContext {
        let sees = !requires.intersection(Requires::VISIBLE | Requires::INSTANCES).is_empty();
        let scene = sees.then(|| Arc::clone(self.visible().scene()));
        let own_scenes = if sees { self.simulation.own_scenes.clone() } else { Vec::new() };
        SensorContext {
            num_envs: self.cfg.num_envs,
            dt: self.cfg.physics_dt,
            gravity: self.cfg.gravity,
            name: "".into(),
            seed: self.cfg.seed,
            first_env: self.cfg.first_env(),
            bodies: self.contents.body_names(),
            carriers: self.contents.carriers(),
            joints: self.contents.joint_names(),
            actuators: self.contents.actuator_names(),
            engine_sensors: self.contents.engine_sensors(),
            scene,
            own_scenes,
            rebuilt: false,
            ray_assets: self.ray_assets.clone(),
            threads: self.cfg.num_threads(),
            pool: self.pool.clone(),
        }
    }

    /// The visual scene, made at the first call, which reads the visual meshes. Meshes that cannot be read are left out, with a
    /// diagnostic.
    pub(crate) fn visible(&mut self) -> Arc<Visible> {
        let visible = self.simulation.make_visible(&self.cfg, &self.contents, &mut self.visuals);
        self.diagnostics.extend(self.visuals.take_diagnostics());
        visible
    }

    /// What an environment looks like, where its sizes or colours are its own.
    pub(crate) fn own_scene(&self, env: EnvId) -> &OwnScene {
        static AS_ALL: OwnScene = OwnScene(None);
        self.simulation.own_scenes.get(env.0).unwrap_or(&AS_ALL)
    }

    /// A robot, to read.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn robot(&self, id: RobotId) -> Robot<'_> {
        let index = self.index_of(id.manager, id.index);
        Robot::new(&self.contents.robots[index], &self.simulation, index)
    }

    /// A robot, to command and to write.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn robot_mut(&mut self, id: RobotId) -> RobotMut<'_> {
        let index = self.index_of(id.manager, id.index);
        RobotMut::new(&self.contents.robots[index], &mut self.simulation, &mut self.sensors, index)
    }

    /// A rigid object, to read.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn rigid_object(&self, id: ObjectId) -> RigidObject<'_> {
        let index = self.index_of(id.manager, id.index);
        RigidObject::new(&self.contents.objects[index], &self.simulation, index)
    }

    /// A rigid object, to write.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn rigid_object_mut(&mut self, id: ObjectId) -> RigidObjectMut<'_> {
        let index = self.index_of(id.manager, id.index);
        RigidObjectMut::new(&self.contents.objects[index], &mut self.simulation, &mut self.sensors, index)
    }

    /// An MJCF file that is a part of the scene, to read.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn mjcf_part(&self, id: MjcfId) -> MjcfPart<'_> {
        let index = self.index_of(id.manager, id.index);
        MjcfPart::new(&self.contents.parts[index], &self.simulation, index)
    }

    /// An MJCF file that is a part of the scene, to command and to write.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn mjcf_part_mut(&mut self, id: MjcfId) -> MjcfPartMut<'_> {
        let index = self.index_of(id.manager, id.index);
        MjcfPartMut::new(&self.contents.parts[index], &mut self.simulation, &mut self.sensors, index)
    }

    /// MuJoCo's model and the data of one environment, to read: for what this API does not have. The model is the environment's
    /// own where some of its properties are.
    ///
    /// # Errors
    /// There is no such environment.
    pub fn with_mujoco<T>(&self, env: EnvId, read: impl FnOnce(&mj::Model, &mj::Data) -> T) -> Result<T> {
        env_mask(Some(&[env]), self.num_envs())?;
        Ok(self.simulation.batch.read(env.0, |env| read(env.data().model(), env.data())))
    }

    /// Of those robots that are `wanted`, the one called `uid`.
    pub(crate) fn find_robot(
        &self,
        uid: &str,
        what: &'static str,
        wanted: impl Fn(&RobotData) -> bool,
    ) -> Result<RobotId> {
        let robots = self.contents.robots.iter();
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
        assert!(manager == self.serial, "this handle is of another SimulationManager");
        index
    }

    /// Steps all environments by `steps` times `physics_dt`: `update(n)` equals n times `update(1)`, bit for bit.
    /// Sensors tick after every step; [observers](crate::Observer) are called where they are due.
    pub fn update(&mut self, steps: u32) {
        let mut left = steps;
        while left > 0 {
            left -= self.step_observed(left.min(BLOCK), Self::advance);
        }
    }

    /// Steps, and lets sensors measure.
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

    /// Puts environments back to their initial state, all of them where `env_ids` is `None`; revives diverged ones.
    ///
    /// # Errors
    /// An environment does not exist; then none is reset.
    pub fn reset(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        let chosen = env_mask(env_ids, self.num_envs())?;
        self.simulation.reset(&chosen);
        if !self.sensors.is_empty() {
            let envs: Vec<usize> = chosen.iter().enumerate().filter(|(_, c)| **c).map(|(i, _)| i).collect();
            self.sensors.reset(&envs, &mut self.simulation);
        }
        let env_ids = chosen.iter().enumerate().filter(|(_, c)| **c).map(|(i, _)| EnvId(i)).collect();
        self.tell_all(&Moment::Reset { env_ids });
        Ok(())
    }

    /// Clears what environments remember beside their state, all of them where `env_ids` is `None`: sensors start anew from the
    /// present state, external wrenches end, and actuator models forget their past (delays, motor states). Positions,
    /// velocities, targets and time stay; a diverged environment stays put aside.
    ///
    /// # Errors
    /// An environment does not exist; then none is cleared.
    pub(crate) fn reset_buffers(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        let chosen = env_mask(env_ids, self.num_envs())?;
        let envs: Vec<usize> = chosen.iter().enumerate().filter(|(_, c)| **c).map(|(i, _)| i).collect();
        envs.iter().for_each(|&env| self.simulation.batch.write(env, Env::reset_buffers));
        if !self.sensors.is_empty() {
            self.sensors.reset(&envs, &mut self.simulation);
        }
        Ok(())
    }

    /// Simulation time of each environment \[s\].
    pub fn time(&self) -> Vec<f64> {
        let mut times = Vec::with_capacity(self.num_envs());
        self.simulation.batch.for_each(|_, env| times.push(env.data().time()));
        times
    }

    /// Environments that a step could not be done in, with the reason; they stand in their last good state.
    pub fn diverged(&self) -> Vec<DivergedEnv> {
        let mut diverged = Vec::new();
        self.simulation.batch.for_each(|i, env| {
            if let EnvStatus::Diverged { step, reason } = env.status() {
                diverged.push(DivergedEnv { env: EnvId(i), step: *step, reason: reason.to_string() });
            }
        });
        diverged
    }

    /// Everything that was repaired, ignored or unusual when robots were added.
    pub fn diagnostics(&self) -> &[Diagnostic] {
        &self.diagnostics
    }

    /// Writes every stage of the pipeline to `dir`: the merged robots as URDF, the descriptions, the MJCF for both
    /// MuJoCo lines with its meshes. Returns what had to be left out: visual meshes and textures that cannot be read, and
    /// what MJCF files compiled by MuJoCo 4.x have that 2.2.2 does not know (a comment in `robot.mjcf2.xml` says it too, and
    /// `diagnostics.txt` in `dir` has everything, after what was said before).
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn dump(&self, dir: impl AsRef<std::path::Path>) -> Result<Vec<Diagnostic>> {
        crate::export::dump(&self.cfg, &self.contents, &self.simulation, &self.diagnostics, dir.as_ref())
    }
}

/// Steps done in one go: a caller's Ctrl+C and other environments wait no longer.
const BLOCK: u32 = 1000;
