//! A scene that is declared, not built: named entities in one configuration, from Rust or from a file.
//!
//! The counterpart of Isaac Lab's `InteractiveScene`. [`SceneCfg`] says what there is, [`InteractiveScene`] is what runs;
//! everything else is done with the handles of the [`SimulationManager`] inside it.

mod entity;
mod file;
mod types;
mod value;

pub use entity::{EntityCfg, SensorEntity, SensorHandle};
pub use types::EntityTypes;

use crate::error::{Error, Result};
use crate::manager::{EnvId, MjcfId, ObjectId, RobotId, SimulationManager, TerrainId};
use crate::objects::articulation::{Articulation, ArticulationId, ArticulationMut};
use crate::objects::mjcf_part::{MjcfPart, MjcfPartMut};
use crate::objects::rigid_object::{RigidObject, RigidObjectMut};
use crate::objects::robot::{Robot, RobotMut};
use crate::objects::terrain::Terrain;
use crate::pattern::{closest, in_every_env};
use crate::sensor_list::SensorId;
use crate::simulation_cfg::SimulationManagerCfg;
use crate::source::Source;
use entity::{Handle, short_name};
use ndarray::Array2;
use sensors::Sensor;
use std::collections::BTreeMap;
use std::path::Path;

/// What a scene holds, in the order of its declaration.
///
/// ```
/// use sim::{ObjectShape, RigidObjectCfg, SceneCfg, SimulationManagerCfg};
/// use sensors::ContactSensorCfg;
///
/// let cfg = SceneCfg::new(SimulationManagerCfg { num_envs: 2, ..Default::default() })
///     .with("cube", RigidObjectCfg { shape: ObjectShape::cube(0.2), ..Default::default() })
///     .with("touch", ContactSensorCfg::of("{ENV_REGEX_NS}/cube"));
/// assert_eq!(cfg.keys().collect::<Vec<_>>(), ["cube", "touch"]);
/// ```
///
/// The same in a file, which [`from_file`](Self::from_file) reads; paths in it are relative to the file:
///
/// ```toml
/// [simulation]               # the fields of SimulationManagerCfg; preset = "legged" or "manipulation" changes the defaults
/// num_envs = 2
///
/// [entities.cube]            # the name of the entity
/// type = "rigid_object"      # its kind, see EntityTypes; all else are the fields of its configuration
/// shape.box.size = [0.2, 0.2, 0.2]
///
/// [entities.touch]
/// type = "contact_sensor"
/// bodies = ["{ENV_REGEX_NS}/cube"]
/// ```
///
/// Groups of objects, welds and pairs that never collide are no entities: add them to the simulation of the scene that runs
/// ([`add_weld`](SimulationManager::add_weld), [`exclude_collision`](SimulationManager::exclude_collision)).
#[derive(Clone, Debug, Default)]
pub struct SceneCfg {
    /// The simulation itself: number of environments, time step, ground, lights.
    pub simulation: SimulationManagerCfg,
    /// Names and what they are. `{ENV}/` or `{ENV_REGEX_NS}/` before a name changes nothing: every entity is in every
    /// environment.
    pub entities: Vec<(String, EntityCfg)>,
    /// Where entities were declared, by name: errors say it. A scene of Rust needs none.
    pub sources: BTreeMap<String, Source>,
}

impl SceneCfg {
    /// A scene without entities.
    pub fn new(simulation: SimulationManagerCfg) -> Self {
        Self { simulation, ..Self::default() }
    }

    /// The scene with one more entity: a [`RobotCfg`](crate::RobotCfg), an
    /// [`ArticulationCfg`](crate::ArticulationCfg), a [`RigidObjectCfg`](crate::RigidObjectCfg), a
    /// [`TerrainCfg`](crate::TerrainCfg), or the configuration of any sensor.
    #[must_use]
    pub fn with(mut self, name: impl Into<String>, cfg: impl Into<EntityCfg>) -> Self {
        self.entities.push((name.into(), cfg.into()));
        self
    }

    /// The names of the entities, in the order of their declaration.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.entities.iter().map(|(name, _)| in_every_env(name))
    }
}

/// A scene that runs: a simulation, and the names of what is in it.
#[derive(Debug)]
pub struct InteractiveScene {
    sim: SimulationManager,
    entities: Vec<(String, Handle)>,
}

impl InteractiveScene {
    /// Builds everything that `cfg` declares. Robots, objects and terrain come first, so that sensors may be declared before
    /// what they look at; within both, the order is that of the declaration.
    ///
    /// # Errors
    /// Two entities of one name, what is wrong with the simulation, and what is wrong with an entity: in
    /// [`Error::Entity`] where it is known where it was declared.
    pub fn new(cfg: SceneCfg) -> Result<Self> {
        let mut taken: Vec<&str> = Vec::new();
        for name in cfg.keys() {
            if taken.contains(&name) {
                return Err(Error::DuplicateUid(name.into()));
            }
            taken.push(name);
        }
        let mut sim = SimulationManager::new(cfg.simulation.clone())?;
        let mut handles: Vec<Option<Handle>> = cfg.entities.iter().map(|_| None).collect();
        for sensors in [false, true] {
            for ((name, entity), handle) in cfg.entities.iter().zip(&mut handles) {
                if matches!(entity, EntityCfg::Sensor(_)) == sensors {
                    let name = in_every_env(name);
                    *handle =
                        Some(Handle::add(&mut sim, name, entity).map_err(|error| match cfg.sources.get(name) {
                            Some(at) => Error::Entity { at: at.clone(), name: name.into(), error: Box::new(error) },
                            None => error,
                        })?);
                }
            }
        }
        let named =
            |((name, _), handle): ((String, _), Option<Handle>)| Some((in_every_env(&name).to_owned(), handle?));
        let entities = cfg.entities.into_iter().zip(handles).filter_map(named).collect();
        Ok(Self { sim, entities })
    }

    /// Builds what a scene file declares.
    ///
    /// # Errors
    /// As [`SceneCfg::from_file`] and [`new`](Self::new).
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self> {
        Self::new(SceneCfg::from_file(path)?)
    }

    /// The names of the entities, in the order of their declaration.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.entities.iter().map(|(name, _)| name.as_str())
    }

    /// The simulation, to read.
    pub fn sim(&self) -> &SimulationManager {
        &self.sim
    }

    /// The simulation, to change. What is added to it here has no name in the scene.
    pub fn sim_mut(&mut self) -> &mut SimulationManager {
        &mut self.sim
    }

    fn find(&self, name: &str) -> Result<&Handle> {
        let name = in_every_env(name);
        let found = self.entities.iter().find(|(known, _)| known == name);
        found.map(|(_, handle)| handle).ok_or_else(|| Error::UnknownName {
            what: "entity of the scene called",
            name: name.into(),
            candidates: closest(name, self.keys()).into_iter().map(String::from).collect(),
        })
    }

    /// The handle of a robot.
    ///
    /// # Errors
    /// There is no such entity, or it is no robot.
    pub fn robot_id(&self, name: &str) -> Result<RobotId> {
        match self.find(name)? {
            Handle::Robot(id) => Ok(*id),
            other => Err(other.is_no(name, "robot".into())),
        }
    }

    /// A robot, to read.
    ///
    /// # Errors
    /// As [`robot_id`](Self::robot_id).
    pub fn robot(&self, name: &str) -> Result<Robot<'_>> {
        Ok(self.sim.robot(self.robot_id(name)?))
    }

    /// A robot, to command and to write. What is written acts at once: there is no `write_data_to_sim` to forget.
    ///
    /// # Errors
    /// As [`robot_id`](Self::robot_id).
    pub fn robot_mut(&mut self, name: &str) -> Result<RobotMut<'_>> {
        let id = self.robot_id(name)?;
        Ok(self.sim.robot_mut(id))
    }

    /// The handle of an articulation that is no robot.
    ///
    /// # Errors
    /// There is no such entity, or it is no such articulation.
    pub fn articulation_id(&self, name: &str) -> Result<ArticulationId> {
        match self.find(name)? {
            Handle::Articulation(id) => Ok(*id),
            other => Err(other.is_no(name, "articulation".into())),
        }
    }

    /// An articulation, to read.
    ///
    /// # Errors
    /// As [`articulation_id`](Self::articulation_id).
    pub fn articulation(&self, name: &str) -> Result<Articulation<'_>> {
        Ok(self.sim.articulation(self.articulation_id(name)?))
    }

    /// An articulation, to write.
    ///
    /// # Errors
    /// As [`articulation_id`](Self::articulation_id).
    pub fn articulation_mut(&mut self, name: &str) -> Result<ArticulationMut<'_>> {
        let id = self.articulation_id(name)?;
        Ok(self.sim.articulation_mut(id))
    }

    /// The handle of a rigid object.
    ///
    /// # Errors
    /// There is no such entity, or it is no rigid object.
    pub fn rigid_object_id(&self, name: &str) -> Result<ObjectId> {
        match self.find(name)? {
            Handle::RigidObject(id) => Ok(*id),
            other => Err(other.is_no(name, "rigid object".into())),
        }
    }

    /// A rigid object, to read.
    ///
    /// # Errors
    /// As [`rigid_object_id`](Self::rigid_object_id).
    pub fn rigid_object(&self, name: &str) -> Result<RigidObject<'_>> {
        Ok(self.sim.rigid_object(self.rigid_object_id(name)?))
    }

    /// A rigid object, to write.
    ///
    /// # Errors
    /// As [`rigid_object_id`](Self::rigid_object_id).
    pub fn rigid_object_mut(&mut self, name: &str) -> Result<RigidObjectMut<'_>> {
        let id = self.rigid_object_id(name)?;
        Ok(self.sim.rigid_object_mut(id))
    }

    /// The handle of a terrain.
    ///
    /// # Errors
    /// There is no such entity, or it is no terrain.
    pub fn terrain_id(&self, name: &str) -> Result<TerrainId> {
        match self.find(name)? {
            Handle::Terrain(id) => Ok(*id),
            other => Err(other.is_no(name, "terrain".into())),
        }
    }

    /// A terrain.
    ///
    /// # Errors
    /// As [`terrain_id`](Self::terrain_id).
    pub fn terrain(&self, name: &str) -> Result<&Terrain> {
        Ok(self.sim.terrain(self.terrain_id(name)?))
    }

    /// The handle of an MJCF file that is a part of the scene.
    ///
    /// # Errors
    /// There is no such entity, or it is no MJCF file.
    pub fn mjcf_id(&self, name: &str) -> Result<MjcfId> {
        match self.find(name)? {
            Handle::Mjcf(id) => Ok(*id),
            other => Err(other.is_no(name, "MJCF part".into())),
        }
    }

    /// An MJCF file that is a part of the scene, to read.
    ///
    /// # Errors
    /// As [`mjcf_id`](Self::mjcf_id).
    pub fn mjcf_part(&self, name: &str) -> Result<MjcfPart<'_>> {
        Ok(self.sim.mjcf_part(self.mjcf_id(name)?))
    }

    /// An MJCF file that is a part of the scene, to command and to write.
    ///
    /// # Errors
    /// As [`mjcf_id`](Self::mjcf_id).
    pub fn mjcf_part_mut(&mut self, name: &str) -> Result<MjcfPartMut<'_>> {
        let id = self.mjcf_id(name)?;
        Ok(self.sim.mjcf_part_mut(id))
    }

    /// The handle of a sensor of type `S`, such as `Camera`.
    ///
    /// # Errors
    /// There is no such entity, or it is no such sensor.
    pub fn sensor_id<S: Sensor>(&self, name: &str) -> Result<SensorId<S>> {
        let handle = self.find(name)?;
        let id = if let Handle::Sensor(sensor) = handle { sensor.get() } else { None };
        id.ok_or_else(|| handle.is_no(name, format!("sensor of type {}", short_name::<S>())))
    }

    /// A sensor of type `S`, to read.
    ///
    /// # Errors
    /// As [`sensor_id`](Self::sensor_id), and where it failed in an earlier step.
    pub fn sensor<S: Sensor>(&self, name: &str) -> Result<&S> {
        self.sim.sensor(self.sensor_id(name)?)
    }

    /// A sensor of type `S`, to change.
    ///
    /// # Errors
    /// As [`sensor`](Self::sensor).
    pub fn sensor_mut<S: Sensor>(&mut self, name: &str) -> Result<&mut S> {
        let id = self.sensor_id(name)?;
        self.sim.sensor_mut(id)
    }

    /// Shows the markers of a sensor from now on, or does not, whatever kind of sensor it is: see
    /// [`SimulationManager::set_debug_vis`].
    ///
    /// # Errors
    /// There is no such entity, or it is no sensor.
    pub fn set_debug_vis(&mut self, name: &str, shown: bool) -> Result<()> {
        let index = match self.find(name)? {
            Handle::Sensor(sensor) => sensor.index(),
            other => return Err(other.is_no(name, "sensor".into())),
        };
        self.sim.sensors.set_debug_vis(index, shown)
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.sim.num_envs()
    }

    /// Places of the environments in the overview \[m\], (N, 3). Poses are local to the environment: nobody adds these.
    pub fn env_origins(&self) -> Array2<f64> {
        self.sim.env_origins()
    }

    /// Puts environments back to their initial state, all of them where `env_ids` is `None`: robots and objects move, which
    /// Isaac Lab's `reset` leaves to the caller, and sensors start anew.
    ///
    /// # Errors
    /// An environment does not exist; then none is reset.
    pub fn reset(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.sim.reset(env_ids)
    }

    /// Steps all environments by `steps` times `physics_dt`; sensors tick after every step.
    pub fn update(&mut self, steps: u32) {
        self.sim.update(steps);
    }

    /// Steps all environments by a time \[s\], which must be a whole number of `physics_dt`.
    ///
    /// # Errors
    /// The time is no whole number of steps; nothing is done then.
    pub fn update_for(&mut self, seconds: f64) -> Result<()> {
        let steps = seconds / self.sim.cfg().physics_dt;
        let whole = steps.round();
        // The quotient of two rounded numbers: 0.1 / 0.005 need not be 20.
        if !((steps - whole).abs() <= 1e-6 && (0.0..=f64::from(u32::MAX)).contains(&whole)) {
            return Err(Error::Config {
                field: "seconds",
                value: seconds.to_string(),
                expected: "it must be a whole number of physics_dt, at most 4294967295 of them",
            });
        }
        self.update(whole as u32);
        Ok(())
    }
}
