//! A scene that is declared, not built: named entities in one configuration, from Rust or from a file.
//!
//! The counterpart of Isaac Lab's `InteractiveScene`. [`SceneCfg`] says what there is, [`InteractiveScene`] is what runs;
//! everything else is done with the handles of the [`SimulationManager`] inside it.

mod entity;
mod exclusion;
mod file;
mod look_up;
mod types;
mod value;
mod yaml;

pub use entity::{EntityCfg, SensorEntity, SensorHandle};
pub use exclusion::ExclusionCfg;
pub use types::EntityTypes;

use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::manager::SimulationManager;
use crate::pattern::in_every_env;
use crate::simulation_cfg::SimulationManagerCfg;
use entity::{Handle, Turn};
use kinetoscope_scene::source::Source;
use ndarray::Array2;
use std::collections::BTreeMap;
use std::path::Path;

/// What a scene holds, in the order of its declaration.
///
/// ```
/// use kinetoscope_sim::{ObjectShape, RigidObjectCfg, SceneCfg, SimulationManagerCfg};
/// use kinetoscope_sensors::ContactSensorCfg;
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
/// Pairs that never collide have no name: [`exclude_collision`](Self::exclude_collision), and in files, above all tables,
/// `exclude_collisions = [["cube", "table"]]`.
#[derive(Clone, Debug, Default)]
pub struct SceneCfg {
    /// The simulation itself: number of environments, time step, ground, lights.
    pub simulation: SimulationManagerCfg,
    /// Names and what they are. `{ENV}/` or `{ENV_REGEX_NS}/` before a name changes nothing: every entity is in every
    /// environment.
    pub entities: Vec<(String, EntityCfg)>,
    /// Pairs that never collide.
    pub exclusions: Vec<ExclusionCfg>,
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
    /// [`RigidObjectGroupCfg`](crate::RigidObjectGroupCfg), a [`TerrainCfg`](crate::TerrainCfg), an
    /// [`MjcfCfg`](crate::MjcfCfg), a [`WeldCfg`](crate::WeldCfg), or the configuration of any sensor.
    #[must_use]
    pub fn with(mut self, name: impl Into<String>, cfg: impl Into<EntityCfg>) -> Self {
        self.entities.push((name.into(), cfg.into()));
        self
    }

    /// The scene in which two things pass through each other: names as in
    /// [`SimulationManager::exclude_collision`], with or without `{ENV}/` before them.
    #[must_use]
    pub fn exclude_collision(mut self, one: impl Into<String>, other: impl Into<String>) -> Self {
        self.exclusions.push(ExclusionCfg { between: [one.into(), other.into()], at: None });
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
    /// Builds everything that `cfg` declares. Robots, objects and terrain come first, then pairs that never collide, welds, and
    /// sensors, so that these may be declared before what they are about; within each, the order is that of the declaration.
    ///
    /// # Errors
    /// Two entities of one name, what is wrong with the simulation, and what is wrong with an entity or a pair: in
    /// [`Error::Entity`] or [`Error::Exclusion`] where it is known where it was declared.
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
        for turn in [Turn::Thing, Turn::Weld, Turn::Sensor] {
            if turn == Turn::Weld {
                cfg.exclusions.iter().try_for_each(|exclusion| exclusion.add_to(&mut sim))?;
            }
            for ((name, entity), handle) in cfg.entities.iter().zip(&mut handles) {
                if entity.turn() == turn {
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

    /// The simulation alone; names of entities stay those of robots, objects and sensors in it.
    pub fn into_sim(self) -> SimulationManager {
        self.sim
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.sim.num_envs()
    }

    /// Places of the environments in the overview \[m\], (N, 3). Poses are local to the environment: nobody adds these.
    pub fn env_origins(&self) -> Array2<f64> {
        self.sim.cfg().env_origins()
    }

    /// Clears what environments remember beside their state, all of them where `env_ids` is `None`, as Isaac Lab's `reset` does:
    /// sensors start anew from the present state, external wrenches end, and actuator models forget their past (delays, motor
    /// states). Positions, velocities, targets and time stay; a diverged environment stays as it is.
    /// [`reset_to_default`](Self::reset_to_default) puts robots and objects back.
    ///
    /// # Errors
    /// An environment does not exist; then none is reset.
    pub fn reset(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.sim.reset_buffers(env_ids)
    }

    /// Puts environments back to their initial state, all of them where `env_ids` is `None`, and revives diverged ones: see
    /// [`SimulationManager::reset`].
    ///
    /// # Errors
    /// An environment does not exist; then none is reset.
    pub fn reset_to_default(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
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
