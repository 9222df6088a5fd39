//! `SimulationManager`: robots and objects in N environments, compiled and stepped together.

use crate::batch::Batch;
use crate::compile::{Simulation, compile};
use crate::contents::Contents;
use crate::diagnostic::{Diagnostic, count_by_name};
use crate::env::EnvStatus;
use crate::error::{Error, Result};
use crate::mj;
use crate::mjcf::document::{Cone, Integrator, PhysicsOption};
use crate::mjcf::scene::MAX_ROBOTS;
use crate::objects::mjcf_part::{MjcfCfg, MjcfData, MjcfPart, MjcfPartMut};
use crate::objects::rigid_object::{RigidObject, RigidObjectCfg, RigidObjectData, RigidObjectMut};
use crate::objects::robot::{Robot, RobotCfg, RobotData, RobotMut, Role};
use crate::objects::terrain::{Terrain, TerrainCfg};
use crate::sensor_list::{SensorId, SensorList};
use crate::shard::Shard;
use crate::visible::{MaskId, Visible, VisualCache};
use ::scene::Marker;
use nalgebra::Vector3;
use ndarray::Array2;
use sensors::ray::RayAssets;
use sensors::{Crew, Requires, Sensor, SensorCfg, SensorContext};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Configuration of a simulation. `Default` is EmbodiChain's: 100 Hz, gravity, ground and one light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationManagerCfg {
    /// Number of environments.
    pub num_envs: usize,
    /// Step of the simulation \[s\].
    pub physics_dt: f64,
    /// MuJoCo steps in one `physics_dt`.
    pub substeps: u32,
    /// Gravity \[m/s²\].
    #[serde(with = "scene::file_format::vector")]
    pub gravity: Vector3<f64>,
    /// Integrator.
    pub integrator: Integrator,
    /// Friction cone.
    pub cone: Cone,
    /// Ratio of frictional to normal impedance; larger values slip less.
    pub impratio: f64,
    /// Largest number of solver iterations in a step.
    pub solver_iterations: u32,
    /// Sliding, torsional and rolling friction of shapes that set none (MuJoCo's three coefficients).
    pub friction: [f64; 3],
    /// Seed of random numbers. The physics has none; the noise of sensors and the draws of properties are keyed by this seed,
    /// the global index of the environment and what they are for.
    pub seed: u64,
    /// Threads that step; every core where unset.
    pub threads: Option<usize>,
    /// Distance of environments in the overview \[m\].
    pub arena_space: f64,
    /// Which part of the environments this process has, where several simulate together.
    pub shard: Shard,
    /// Ground plane at z = 0; `None` for none.
    #[serde(with = "scene::file_format::or_false")]
    pub ground: Option<GroundCfg>,
    /// Lights.
    pub lights: Vec<LightCfg>,
}

/// A ground plane at z = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GroundCfg {
    /// Half of the side that is drawn \[m\]; the plane itself is infinite.
    pub half_size: f64,
    /// Colour, 0..=1.
    pub color: [f64; 3],
    /// Whether cameras see squares of half a metre, a little lighter and darker than the colour.
    pub checker: bool,
}

impl Default for GroundCfg {
    fn default() -> Self {
        Self { half_size: 50.0, color: [0.45, 0.47, 0.5], checker: true }
    }
}

/// A directional light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightCfg {
    /// Direction in which it shines.
    #[serde(with = "scene::file_format::vector")]
    pub direction: Vector3<f64>,
    /// Colour, 0..=1.
    pub color: [f64; 3],
}

impl Default for LightCfg {
    fn default() -> Self {
        Self { direction: Vector3::new(-0.3, 0.4, -1.0), color: [0.8, 0.8, 0.8] }
    }
}

impl Default for SimulationManagerCfg {
    fn default() -> Self {
        Self {
            num_envs: 1,
            physics_dt: 0.01,
            substeps: 1,
            gravity: Vector3::new(0.0, 0.0, -9.81),
            integrator: Integrator::Euler,
            cone: Cone::Pyramidal,
            impratio: 1.0,
            solver_iterations: 100,
            friction: [1.0, 0.005, 0.0001],
            seed: 0,
            threads: None,
            arena_space: 5.0,
            shard: Shard::default(),
            ground: Some(GroundCfg::default()),
            lights: vec![LightCfg::default()],
        }
    }
}

impl SimulationManagerCfg {
    /// For hands that hold things: elliptic cones that do not slip.
    pub fn manipulation() -> Self {
        Self { cone: Cone::Elliptic, impratio: 10.0, ..Self::default() }
    }

    /// For robots on legs: 200 Hz, and elliptic friction cones that are a hundred times as stiff along the ground as the
    /// default, where loaded feet creep apart until the robot kneels.
    pub fn legged() -> Self {
        Self { physics_dt: 0.005, cone: Cone::Elliptic, impratio: 100.0, ..Self::default() }
    }

    /// Checks every number.
    ///
    /// # Errors
    /// The first field that is out of range.
    pub fn validate(&self) -> Result<()> {
        let fail = |field, value: &dyn std::fmt::Display, expected| {
            Err(Error::Config { field, value: value.to_string(), expected })
        };
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if self.num_envs == 0 {
            return fail("num_envs", &0, "a simulation needs at least 1 environment");
        }
        if self.num_envs > MAX_ENVS {
            return fail("num_envs", &self.num_envs, "one process can hold at most 1048576 environments");
        }
        let Shard { rank, world } = self.shard;
        if rank >= world || world.checked_mul(self.num_envs).is_none() {
            return fail(
                "shard",
                &format!("rank {rank} of {world}"),
                "the rank must be 0 to the number of processes - 1",
            );
        }
        if !positive(self.physics_dt) || self.physics_dt > 1.0 {
            return fail("physics_dt", &self.physics_dt, "it must be above 0 and at most 1 second, such as 0.01");
        }
        if self.substeps == 0 || self.substeps > 10_000 {
            return fail("substeps", &self.substeps, "it must be 1 to 10000");
        }
        if self.physics_dt / f64::from(self.substeps) < 1e-9 {
            return fail("physics_dt", &self.physics_dt, "physics_dt / substeps must be at least 1e-9 seconds");
        }
        if !self.gravity.iter().all(|g| g.is_finite()) {
            return fail(
                "gravity",
                &format!("{:?}", self.gravity.as_slice()),
                "it must be finite, such as (0, 0, -9.81)",
            );
        }
        if !positive(self.impratio) {
            return fail("impratio", &self.impratio, "it must be above 0");
        }
        if self.solver_iterations == 0 || self.solver_iterations > 1_000_000 {
            return fail("solver_iterations", &self.solver_iterations, "it must be 1 to 1000000");
        }
        if !self.friction.iter().all(|f| f.is_finite() && *f >= 0.0) {
            return fail("friction", &format!("{:?}", self.friction), "the three coefficients must be >= 0");
        }
        if let Some(threads) = self.threads
            && !(1..=1024).contains(&threads)
        {
            return fail("threads", &threads, "it must be 1 to 1024; leave it out to use every core");
        }
        if !(self.arena_space.is_finite() && self.arena_space >= 0.0) {
            return fail("arena_space", &self.arena_space, "it must be a distance >= 0 in metres");
        }
        if let Some(ground) = &self.ground
            && !positive(ground.half_size)
        {
            return fail("ground.half_size", &ground.half_size, "it must be above 0 metres");
        }
        if let Some(ground) = &self.ground
            && !ground.color.iter().all(|c| (0.0..=1.0).contains(c))
        {
            return fail("ground.color", &format!("{:?}", ground.color), "each component must be 0 to 1");
        }
        for light in &self.lights {
            if !(light.direction.iter().all(|x| x.is_finite()) && light.direction.norm() > 0.0) {
                return fail(
                    "lights.direction",
                    &format!("{:?}", light.direction.as_slice()),
                    "it must be a finite vector other than zero",
                );
            }
            if !light.color.iter().all(|c| (0.0..=1.0).contains(c)) {
                return fail("lights.color", &format!("{:?}", light.color), "each component must be 0 to 1");
            }
        }
        Ok(())
    }

    /// Global index of the first environment of this process.
    pub fn first_env(&self) -> usize {
        self.shard.rank * self.num_envs
    }

    pub(crate) fn physics_option(&self) -> PhysicsOption {
        PhysicsOption {
            timestep: self.physics_dt / f64::from(self.substeps),
            gravity: self.gravity,
            integrator: self.integrator,
            cone: self.cone,
            impratio: self.impratio,
            iterations: self.solver_iterations,
            friction: self.friction,
        }
    }
}

/// More environments than any machine steps; keeps a typing error from filling the memory.
const MAX_ENVS: usize = 1 << 20;

/// Index of an environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EnvId(pub usize);

/// Handle of a robot; valid for the manager that made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RobotId {
    manager: u64,
    index: usize,
}

/// Handle of a rigid object; valid for the manager that made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ObjectId {
    manager: u64,
    index: usize,
}

/// Handle of an MJCF file that is a part of the scene; valid for the manager that made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MjcfId {
    manager: u64,
    index: usize,
}

/// Handle of a terrain; valid for the manager that made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TerrainId {
    manager: u64,
    index: usize,
}

/// Tells managers of one process apart, so that a handle is not used with another one.
static NEXT_MANAGER: AtomicU64 = AtomicU64::new(0);

/// Robots and objects in N environments. Environments never touch each other; dropping the manager frees everything.
#[derive(Debug)]
pub struct SimulationManager {
    serial: u64,
    pub(crate) cfg: SimulationManagerCfg,
    pub(crate) contents: Contents,
    visuals: VisualCache,
    /// What ray casters have built.
    ray_assets: RayAssets,
    /// Threads of the sensors.
    crew: Crew,
    diagnostics: Vec<Diagnostic>,
    pub(crate) simulation: Simulation,
    pub(crate) sensors: SensorList,
    /// How often properties were drawn for each environment.
    pub(crate) draws: Vec<u64>,
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
        let simulation = compile(&cfg, &contents)?;
        let serial = NEXT_MANAGER.fetch_add(1, Ordering::Relaxed);
        let sensors = SensorList::new(cfg.substeps);
        let visuals = VisualCache::default();
        let draws = vec![0; cfg.num_envs];
        Ok(Self {
            serial,
            cfg,
            contents,
            visuals,
            ray_assets: RayAssets::default(),
            crew: Crew::default(),
            diagnostics: Vec::new(),
            simulation,
            sensors,
            draws,
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
    /// error the simulation is as it was. What exists already keeps its state.
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
        let robot = RobotData::load(cfg, role, &self.cfg, self.contents.next_mask_id(), &mut diagnostics)?;
        let mut contents = self.contents.clone();
        contents.robots.push(Arc::new(robot));
        self.replace_contents(contents, diagnostics)?;
        Ok(RobotId { manager: self.serial, index: self.contents.robots.len() - 1 })
    }

    /// Adds a rigid object to every environment, compiled as [`add_robot`](Self::add_robot) does.
    ///
    /// # Errors
    /// The name is taken or a number is out of range.
    pub fn add_rigid_object(&mut self, cfg: RigidObjectCfg) -> Result<ObjectId> {
        self.check_world_uid(&cfg.uid)?;
        let object = RigidObjectData::new(cfg, self.contents.next_mask_id())?;
        let mut contents = self.contents.clone();
        contents.objects.push(Arc::new(object));
        self.replace_contents(contents, Vec::new())?;
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
    fn check_world_uid(&self, uid: &str) -> Result<()> {
        self.contents.check_uid(uid)?;
        // MuJoCo's world body and our ground are called so.
        if matches!(uid, "world" | "ground") { Err(Error::DuplicateUid(uid.into())) } else { Ok(()) }
    }

    /// Compiles `contents` and goes on with them; on an error nothing has changed.
    fn replace_contents(&mut self, contents: Contents, mut diagnostics: Vec<Diagnostic>) -> Result<()> {
        let mut simulation = compile(&self.cfg, &contents)?;
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
        Ok(())
    }

    /// Adds a sensor of all environments; `sensors` has the built-in ones, and a crate of yours may bring its own. The
    /// sensor sees links and movable joints of all robots, in the order in which they were added. Adding a robot later
    /// starts its history again.
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

    /// A sensor, to read.
    ///
    /// # Errors
    /// The sensor failed in an earlier step.
    pub fn sensor<S: Sensor>(&self, id: SensorId<S>) -> Result<&S> {
        self.sensors.get(id)
    }

    /// A sensor, to change: a camera's pose, for instance.
    ///
    /// # Errors
    /// The sensor failed in an earlier step.
    pub fn sensor_mut<S: Sensor>(&mut self, id: SensorId<S>) -> Result<&mut S> {
        self.sensors.get_mut(id)
    }

    /// What all sensors show of their last measurements, for [`Still::overview`](crate::Still::overview).
    pub fn markers(&self) -> Vec<(EnvId, Marker)> {
        self.sensors.markers(self.num_envs())
    }

    /// The scene for a sensor that requires `requires`. What cameras draw is made when the first asks for it.
    fn sensor_context(&mut self, requires: Requires) -> SensorContext {
        let sees = !requires.intersection(Requires::VISIBLE | Requires::INSTANCES).is_empty();
        let scene = sees.then(|| Arc::clone(self.visible().scene()));
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
            engine_sensors: self.contents.engine_sensors(),
            scene,
            ray_assets: self.ray_assets.clone(),
            threads: self.cfg.threads.unwrap_or_else(crate::compile::all_cores),
            crew: self.crew.clone(),
        }
    }

    /// What can be seen: made at the first call, which reads the visual meshes. What cannot be read is left out, with a
    /// diagnostic.
    pub fn visible(&mut self) -> Arc<Visible> {
        let visible = self.simulation.make_visible(&self.cfg, &self.contents, &mut self.visuals);
        self.diagnostics.extend(self.visuals.take_diagnostics());
        visible
    }

    /// What each number of the mask channel of cameras stands for, the same in every environment. Numbers stay when more
    /// is added.
    pub fn mask_ids(&self) -> &[MaskId] {
        self.simulation.mask_ids()
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

    /// A terrain.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn terrain(&self, id: TerrainId) -> &Terrain {
        &self.contents.terrains[self.index_of(id.manager, id.index)]
    }

    #[track_caller]
    fn index_of(&self, manager: u64, index: usize) -> usize {
        assert!(manager == self.serial, "this handle is of another SimulationManager");
        index
    }

    /// The robot called `uid`.
    ///
    /// # Errors
    /// There is none; the error lists those there are.
    pub fn robot_id(&self, uid: &str) -> Result<RobotId> {
        self.find_robot(uid, "robot", RobotData::is_robot)
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

    /// The rigid object called `uid`.
    ///
    /// # Errors
    /// There is none; the error lists those there are.
    pub fn rigid_object_id(&self, uid: &str) -> Result<ObjectId> {
        let index = self.contents.objects.iter().position(|o| o.uid() == uid);
        index.map(|index| ObjectId { manager: self.serial, index }).ok_or_else(|| Error::UnknownName {
            what: "rigid object",
            name: uid.into(),
            candidates: self.contents.objects.iter().map(|o| o.uid().to_string()).collect(),
        })
    }

    /// The MJCF file that is a part called `uid`.
    ///
    /// # Errors
    /// There is none; the error lists those there are.
    pub fn mjcf_id(&self, uid: &str) -> Result<MjcfId> {
        let index = self.contents.parts.iter().position(|p| p.uid() == uid);
        index.map(|index| MjcfId { manager: self.serial, index }).ok_or_else(|| Error::UnknownName {
            what: "MJCF part",
            name: uid.into(),
            candidates: self.contents.parts.iter().map(|p| p.uid().to_string()).collect(),
        })
    }

    /// Steps all environments by `steps` times `physics_dt`: `update(n)` equals n times `update(1)`, bit for bit.
    /// Sensors tick after every step.
    pub fn update(&mut self, steps: u32) {
        let mut left = steps;
        while left > 0 {
            let block = left.min(BLOCK);
            left -= if self.sensors.is_empty() {
                self.simulation.batch.step(block * self.cfg.substeps);
                block
            } else {
                self.sensors.advance(&mut self.simulation, block)
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
        Ok(())
    }

    /// Simulation time of each environment \[s\].
    pub fn time(&self) -> Vec<f64> {
        let mut times = Vec::with_capacity(self.num_envs());
        self.simulation.batch.for_each(|_, env| times.push(env.data().time()));
        times
    }

    /// Places of the environments in the overview \[m\], (N, 3): a grid with `arena_space` between neighbours.
    ///
    /// rows = ceil(n / floor(sqrt n)), cols = ceil(n / rows); environment k stands in row k div cols, column k mod cols.
    pub fn env_origins(&self) -> Array2<f64> {
        let n = self.num_envs();
        let rows = n.div_ceil(n.isqrt().max(1));
        let cols = n.div_ceil(rows);
        let space = self.cfg.arena_space;
        let mut origins = Array2::zeros((n, 3));
        for (k, mut origin) in origins.rows_mut().into_iter().enumerate() {
            let (i, j) = ((k / cols) as f64, (k % cols) as f64);
            origin[0] = -(i - (rows - 1) as f64 / 2.0) * space;
            origin[1] = (j - (cols - 1) as f64 / 2.0) * space;
        }
        origins
    }

    /// Environments that a step could not be done in, with the reason; they stand in their last good state.
    pub fn diverged(&self) -> Vec<(EnvId, String)> {
        let mut diverged = Vec::new();
        self.simulation.batch.for_each(|i, env| {
            if let EnvStatus::Diverged { step, reason } = env.status() {
                diverged.push((EnvId(i), format!("step {step}: {reason}")));
            }
        });
        diverged
    }

    /// Everything that was repaired, ignored or unusual when robots were added.
    pub fn diagnostics(&self) -> &[Diagnostic] {
        &self.diagnostics
    }

    /// Counts of all warnings by name: diagnostics, MuJoCo's warnings over all environments, diverged environments.
    pub fn warning_counts(&self) -> BTreeMap<String, u64> {
        let mut counts: BTreeMap<String, u64> =
            count_by_name(&self.diagnostics).into_iter().map(|(name, n)| (name.to_string(), n as u64)).collect();
        let mut mujoco = mj::WarningCounts::default();
        let mut diverged = 0;
        self.simulation.batch.for_each(|_, env| {
            mujoco.add(env.warnings());
            diverged += u64::from(*env.status() != EnvStatus::Running);
        });
        for (warning, n) in mj::Warning::ALL.iter().zip(mujoco.0) {
            if n > 0 {
                counts.insert(warning.name().into(), n);
            }
        }
        if diverged > 0 {
            counts.insert("environment-diverged".into(), diverged);
        }
        counts
    }

    /// Counts of MuJoCo's warnings in one environment, by name.
    ///
    /// # Errors
    /// There is no such environment.
    pub fn env_warning_counts(&self, env: EnvId) -> Result<BTreeMap<&'static str, u64>> {
        env_mask(Some(&[env]), self.num_envs())?;
        let counts = self.simulation.batch.read(env.0, |env| *env.warnings());
        Ok(mj::Warning::ALL.iter().map(|w| (w.name(), counts.get(*w))).filter(|(_, n)| *n > 0).collect())
    }

    /// How often contact and constraint buffers were doubled, over all environments.
    pub fn buffer_growths(&self) -> u64 {
        let mut growths = 0;
        self.simulation.batch.for_each(|_, env| growths += u64::from(env.growths()));
        growths
    }

    /// The MJCF that is being stepped.
    pub fn mjcf(&self) -> &str {
        &self.simulation.xml
    }

    /// The batch of environments, for work below this API.
    pub fn batch(&self) -> &Batch {
        &self.simulation.batch
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

/// Which environments are meant, as a mask.
pub(crate) fn env_mask(env_ids: Option<&[EnvId]>, num_envs: usize) -> Result<Vec<bool>> {
    let Some(ids) = env_ids else { return Ok(vec![true; num_envs]) };
    let mut mask = vec![false; num_envs];
    for &EnvId(index) in ids {
        *mask.get_mut(index).ok_or(Error::UnknownIndex { what: "environment", index, count: num_envs })? = true;
    }
    Ok(mask)
}

/// Which environments are meant, in the order given; all of them where `None`.
pub(crate) fn env_list(env_ids: Option<&[EnvId]>, num_envs: usize) -> Result<Vec<usize>> {
    env_mask(env_ids, num_envs)?;
    Ok(env_ids.map_or_else(|| (0..num_envs).collect(), |ids| ids.iter().map(|id| id.0).collect()))
}
