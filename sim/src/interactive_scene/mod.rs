//! Declarative scenes: named entities in one configuration, from Rust or from a file.
//!
//! The counterpart of Isaac Lab's `InteractiveScene`. [`SceneCfg`] declares the entities, and [`InteractiveScene`] is
//! the running scene. Everything else uses the handles of the [`SimulationManager`] inside it.

mod entity;
mod exclusion;
mod file;
mod lookup;
mod schema;
mod types;
mod value;
mod yaml;

pub use entity::{AnySensorCfg, AnySensorId, EntityCfg};
pub use exclusion::ExclusionCfg;
pub use types::EntityTypes;

use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::manager::SimulationManager;
use crate::pattern::strip_env_prefix;
use crate::simulation_cfg::SimulationManagerCfg;
use entity::{BuildPhase, EntityHandle};
use kinetoscope_scene::source_location::SourceLocation;
use ndarray::Array2;
use std::collections::BTreeMap;
use std::path::Path;

/// Declaration of a scene: simulation, named entities, collision exclusions.
///
/// ```
/// use kinetoscope_sim::{ObjectShape, RigidObjectCfg, SceneCfg, SimulationManagerCfg};
/// use kinetoscope_sensors::ContactSensorCfg;
///
/// let cfg = SceneCfg::new(SimulationManagerCfg { num_envs: 2, ..Default::default() })
///     .with("cube", RigidObjectCfg { shape: ObjectShape::cube(0.2), ..Default::default() })
///     .with("touch", ContactSensorCfg::for_bodies("{ENV_REGEX_NS}/cube"));
/// assert_eq!(cfg.keys().collect::<Vec<_>>(), ["cube", "touch"]);
/// ```
///
/// The same as a file, which [`from_file`](Self::from_file) reads; paths in it, except those of sensors, are relative
/// to the file:
///
/// ```toml
/// [simulation]               # fields of SimulationManagerCfg; preset = "legged" or "manipulation" sets defaults
/// num_envs = 2
///
/// [entities.cube]            # the name of the entity
/// type = "rigid_object"      # its type, see EntityTypes; all other keys are fields of its configuration, without uid
/// shape.box.size = [0.2, 0.2, 0.2]
///
/// [entities.touch]
/// type = "contact_sensor"
/// bodies = ["{ENV_REGEX_NS}/cube"]
/// ```
///
/// Collision exclusions have no name: [`exclude_collision`](Self::exclude_collision) in Rust,
/// `exclude_collisions = [["cube", "table"]]` above all tables in files.
#[derive(Clone, Debug, Default)]
pub struct SceneCfg {
    /// The simulation itself: number of environments, time step, ground, lights.
    pub simulation: SimulationManagerCfg,
    /// Names and configurations, in the order of declaration. A prefix `{ENV}/` or `{ENV_REGEX_NS}/` of a name is
    /// ignored: every entity exists in every environment.
    pub entities: Vec<(String, EntityCfg)>,
    /// Pairs of bodies or robots whose contacts are excluded.
    pub exclusions: Vec<ExclusionCfg>,
    /// File and line of the declaration by entity name, for error messages; empty for a scene from Rust.
    pub sources: BTreeMap<String, SourceLocation>,
}

impl SceneCfg {
    /// Creates a scene without entities.
    pub fn new(simulation: SimulationManagerCfg) -> Self {
        Self { simulation, ..Self::default() }
    }

    /// Adds an entity: a [`RobotCfg`](crate::RobotCfg), an [`ArticulationCfg`](crate::ArticulationCfg), a
    /// [`RigidObjectCfg`](crate::RigidObjectCfg), a [`RigidObjectGroupCfg`](crate::RigidObjectGroupCfg), a
    /// [`TerrainCfg`](crate::TerrainCfg), an [`MjcfPartCfg`](crate::MjcfPartCfg), a [`WeldCfg`](crate::WeldCfg), or the
    /// configuration of any sensor. The name replaces the `uid` in `cfg`.
    #[must_use]
    pub fn with(mut self, name: impl Into<String>, cfg: impl Into<EntityCfg>) -> Self {
        self.entities.push((name.into(), cfg.into()));
        self
    }

    /// Adds a pair of bodies or robots whose contacts are excluded. Names are as in
    /// [`SimulationManager::exclude_collision`]; a prefix `{ENV}/` or `{ENV_REGEX_NS}/` is ignored.
    /// [`InteractiveScene::new`] checks the names.
    #[must_use]
    pub fn exclude_collision(mut self, one: impl Into<String>, other: impl Into<String>) -> Self {
        self.exclusions.push(ExclusionCfg { pair: [one.into(), other.into()], at: None });
        self
    }

    /// Names of the entities without the prefix, in the order of declaration.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.entities.iter().map(|(name, _)| strip_env_prefix(name))
    }
}

/// A running scene: a simulation and the names of its entities. A prefix `{ENV}/` or `{ENV_REGEX_NS}/` of a name is
/// ignored in lookups.
#[derive(Debug)]
pub struct InteractiveScene {
    sim: SimulationManager,
    entities: Vec<(String, EntityHandle)>,
}

impl InteractiveScene {
    /// Builds all entities that `cfg` declares. The order is bodies (robots, objects, terrains), collision exclusions,
    /// welds, sensors, so welds and sensors may be declared before the bodies they refer to. Within each phase, the
    /// order is that of the declaration.
    ///
    /// # Errors
    /// Two entities have the same name, or the configuration of the simulation, of an entity or of an exclusion is
    /// invalid. For an entity or an exclusion from a file, the error is [`Error::Entity`] or [`Error::Exclusion`].
    pub fn new(cfg: SceneCfg) -> Result<Self> {
        let mut taken: Vec<&str> = Vec::new();
        for name in cfg.keys() {
            if taken.contains(&name) {
                return Err(Error::DuplicateUid(name.into()));
            }
            taken.push(name);
        }
        let mut sim = SimulationManager::new(cfg.simulation.clone())?;
        let mut handles: Vec<Option<EntityHandle>> = cfg.entities.iter().map(|_| None).collect();
        for turn in [BuildPhase::Body, BuildPhase::Weld, BuildPhase::Sensor] {
            if turn == BuildPhase::Weld {
                cfg.exclusions.iter().try_for_each(|exclusion| exclusion.add_to(&mut sim))?;
            }
            for ((name, entity), handle) in cfg.entities.iter().zip(&mut handles) {
                if entity.build_phase() == turn {
                    let name = strip_env_prefix(name);
                    *handle =
                        Some(EntityHandle::add(&mut sim, name, entity).map_err(
                            |error| match cfg.sources.get(name) {
                                Some(at) => Error::Entity { at: at.clone(), name: name.into(), error: Box::new(error) },
                                None => error,
                            },
                        )?);
                }
            }
        }
        let named = |((name, _), handle): ((String, _), Option<EntityHandle>)| {
            Some((strip_env_prefix(&name).to_owned(), handle?))
        };
        let entities = cfg.entities.into_iter().zip(handles).filter_map(named).collect();
        Ok(Self { sim, entities })
    }

    /// Builds the scene that a file declares.
    ///
    /// # Errors
    /// As [`SceneCfg::from_file`] and [`new`](Self::new).
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self> {
        Self::new(SceneCfg::from_file(path)?)
    }

    /// Names of the entities, in the order of declaration.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.entities.iter().map(|(name, _)| name.as_str())
    }

    /// The simulation, for reading.
    pub fn sim(&self) -> &SimulationManager {
        &self.sim
    }

    /// The simulation, for changes. Entities added here have no name in the scene.
    pub fn sim_mut(&mut self) -> &mut SimulationManager {
        &mut self.sim
    }

    /// Returns the simulation; its robots, objects and sensors keep their names as uids.
    pub fn into_sim(self) -> SimulationManager {
        self.sim
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.sim.num_envs()
    }

    /// Origins of the environments in the overview \[m\], shape (N, 3). Poses are local to the environment and do not
    /// contain them.
    pub fn env_origins(&self) -> Array2<f64> {
        self.sim.cfg().env_origins()
    }

    /// Clears the buffers that environments keep beside their state, in all of them for `env_ids = None`, as Isaac
    /// Lab's `reset` does. Sensors restart from the current state, external wrenches end, and actuator models lose
    /// their memory (delays, motor states). Positions, velocities, targets and time stay; a diverged environment stays
    /// diverged. Observers receive no event. [`reset_to_default`](Self::reset_to_default) resets robots and objects.
    ///
    /// # Errors
    /// An environment does not exist; then no environment is reset.
    pub fn reset(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.sim.reset_buffers(env_ids)
    }

    /// Resets environments to their initial state, all of them for `env_ids = None`; see [`SimulationManager::reset`].
    /// Diverged environments run again.
    ///
    /// # Errors
    /// An environment does not exist; then no environment is reset.
    pub fn reset_to_default(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.sim.reset(env_ids)
    }

    /// Steps all environments `steps` times by `physics_dt`; due sensors measure after each step.
    pub fn update(&mut self, steps: u32) {
        self.sim.update(steps);
    }

    /// Steps all environments by a time \[s\], which must be a whole number of `physics_dt`.
    ///
    /// # Errors
    /// The time is negative, is not a whole number of steps, or is more than `u32::MAX` steps; then nothing is done.
    pub fn update_for(&mut self, seconds: f64) -> Result<()> {
        let steps = self.sim.cfg().steps_in(seconds)?;
        self.update(steps);
        Ok(())
    }
}
