//! Entities of a scene: robots, articulations, rigid objects and groups of them, terrains, attached MJCF files, welds,
//! and sensors of any crate.

use crate::error::{Error, Result};
use crate::ids::{MjcfId, RigidObjectId, RobotId, TerrainId};
use crate::manager::SimulationManager;
use crate::objects::articulation::{ArticulationCfg, ArticulationId};
use crate::objects::mjcf_part_data::MjcfPartCfg;
use crate::objects::object_group_data::{RigidObjectGroupCfg, RigidObjectGroupId};
use crate::objects::rigid_object_data::RigidObjectCfg;
use crate::objects::robot::RobotCfg;
use crate::objects::terrain::TerrainCfg;
use crate::objects::weld_data::{WeldCfg, WeldId};
use crate::pattern::strip_env_prefix;
use crate::sensor_list::SensorId;
use kinetoscope_sensors::{Sensor, SensorCfg};
use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;

/// Configuration of one entity of a scene. The name of the entity replaces the `uid` in the configuration.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum EntityCfg {
    /// A robot.
    Robot(Box<RobotCfg>),
    /// An articulation, passive by default.
    Articulation(Box<ArticulationCfg>),
    /// A rigid object.
    RigidObject(Box<RigidObjectCfg>),
    /// A group of rigid objects. Each object is also available as a single object called `group.object`.
    Group(Box<RigidObjectGroupCfg>),
    /// A terrain.
    Terrain(Box<TerrainCfg>),
    /// An attached MJCF file.
    Mjcf(Box<MjcfPartCfg>),
    /// A weld, initially released.
    Weld(Box<WeldCfg>),
    /// A sensor of any type.
    Sensor(Box<dyn AnySensorCfg>),
}

impl From<RobotCfg> for EntityCfg {
    fn from(cfg: RobotCfg) -> Self {
        Self::Robot(Box::new(cfg))
    }
}

impl From<ArticulationCfg> for EntityCfg {
    fn from(cfg: ArticulationCfg) -> Self {
        Self::Articulation(Box::new(cfg))
    }
}

impl From<RigidObjectCfg> for EntityCfg {
    fn from(cfg: RigidObjectCfg) -> Self {
        Self::RigidObject(Box::new(cfg))
    }
}

impl From<RigidObjectGroupCfg> for EntityCfg {
    fn from(cfg: RigidObjectGroupCfg) -> Self {
        Self::Group(Box::new(cfg))
    }
}

impl From<TerrainCfg> for EntityCfg {
    fn from(cfg: TerrainCfg) -> Self {
        Self::Terrain(Box::new(cfg))
    }
}

impl From<MjcfPartCfg> for EntityCfg {
    fn from(cfg: MjcfPartCfg) -> Self {
        Self::Mjcf(Box::new(cfg))
    }
}

impl From<WeldCfg> for EntityCfg {
    fn from(cfg: WeldCfg) -> Self {
        Self::Weld(Box::new(cfg))
    }
}

impl EntityCfg {
    /// Build phase: bodies first, then the welds between them, then the sensors.
    pub(super) fn build_phase(&self) -> BuildPhase {
        match self {
            Self::Weld(_) => BuildPhase::Weld,
            Self::Sensor(_) => BuildPhase::Sensor,
            _ => BuildPhase::Body,
        }
    }
}

/// Build phases of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BuildPhase {
    /// Robots, articulations, objects, terrains, attached MJCF files.
    Body,
    /// Welds, which need two bodies.
    Weld,
    /// Sensors, which may refer to any body.
    Sensor,
}

impl<C: AnySensorCfg> From<C> for EntityCfg {
    fn from(cfg: C) -> Self {
        Self::Sensor(Box::new(cfg))
    }
}

/// Type-erased configuration of a sensor. Every [`SensorCfg`] with `Clone`, `Debug`, `Send` and `Sync` implements it.
/// `&dyn AnySensorCfg` converts to `&dyn Any`, for a downcast to the configuration.
pub trait AnySensorCfg: Any + Debug + Send + Sync {
    /// Clones the configuration into a new box.
    fn boxed_clone(&self) -> Box<dyn AnySensorCfg>;

    /// Adds the sensor to a simulation.
    ///
    /// # Errors
    /// As [`SimulationManager::add_sensor`].
    fn add_to(&self, sim: &mut SimulationManager, uid: &str) -> Result<AnySensorId>;
}

impl<C> AnySensorCfg for C
where
    C: SensorCfg + Clone + Debug + Send + Sync + 'static,
{
    fn boxed_clone(&self) -> Box<dyn AnySensorCfg> {
        Box::new(self.clone())
    }

    fn add_to(&self, sim: &mut SimulationManager, uid: &str) -> Result<AnySensorId> {
        sim.add_sensor(uid, self.clone()).map(AnySensorId::new)
    }
}

impl Clone for Box<dyn AnySensorCfg> {
    fn clone(&self) -> Self {
        (**self).boxed_clone()
    }
}

/// Type-erased [`SensorId`].
#[derive(Clone, Debug)]
pub struct AnySensorId {
    id: Arc<dyn Any + Send + Sync>,
    index: usize,
    type_name: &'static str,
}

impl AnySensorId {
    fn new<S: Sensor>(id: SensorId<S>) -> Self {
        Self { id: Arc::new(id), index: id.index(), type_name: short_type_name::<S>() }
    }

    /// The handle; `None` if the sensor does not have type `S`.
    pub fn get<S: Sensor>(&self) -> Option<SensorId<S>> {
        self.id.downcast_ref().copied()
    }

    pub(super) fn index(&self) -> usize {
        self.index
    }

    /// Name of the sensor's type, such as `Camera`.
    pub fn type_name(&self) -> &'static str {
        self.type_name
    }
}

/// Name of a type without its module path.
pub(super) fn short_type_name<T>() -> &'static str {
    let full = std::any::type_name::<T>();
    // Arguments of a generic type have paths of their own.
    let end = full.find('<').unwrap_or(full.len());
    let start = full[..end].rfind("::").map_or(0, |at| at + 2);
    &full[start..]
}

/// Handle of an entity of a scene.
#[derive(Debug)]
pub(super) enum EntityHandle {
    Robot(RobotId),
    Articulation(ArticulationId),
    RigidObject(RigidObjectId),
    Group(RigidObjectGroupId),
    Terrain(TerrainId),
    Mjcf(MjcfId),
    Weld(WeldId),
    Sensor(AnySensorId),
}

impl EntityHandle {
    /// Adds the entity to a simulation, under the name `uid`.
    pub(super) fn add(sim: &mut SimulationManager, uid: &str, cfg: &EntityCfg) -> Result<Self> {
        match cfg {
            EntityCfg::Robot(cfg) => sim.add_robot(RobotCfg { uid: uid.into(), ..(**cfg).clone() }).map(Self::Robot),
            EntityCfg::Articulation(cfg) => {
                sim.add_articulation(ArticulationCfg { uid: uid.into(), ..(**cfg).clone() }).map(Self::Articulation)
            }
            EntityCfg::RigidObject(cfg) => {
                sim.add_rigid_object(RigidObjectCfg { uid: uid.into(), ..(**cfg).clone() }).map(Self::RigidObject)
            }
            EntityCfg::Group(cfg) => {
                sim.add_rigid_object_group(RigidObjectGroupCfg { uid: uid.into(), ..(**cfg).clone() }).map(Self::Group)
            }
            EntityCfg::Terrain(cfg) => {
                sim.add_terrain(TerrainCfg { uid: uid.into(), ..(**cfg).clone() }).map(Self::Terrain)
            }
            EntityCfg::Mjcf(cfg) => sim.add_mjcf(MjcfPartCfg { uid: uid.into(), ..(**cfg).clone() }).map(Self::Mjcf),
            EntityCfg::Weld(cfg) => {
                let [first, second] = [&cfg.first, &cfg.second].map(|name| strip_env_prefix(name).into());
                sim.add_weld(WeldCfg { uid: uid.into(), first, second }).map(Self::Weld)
            }
            EntityCfg::Sensor(cfg) => cfg.add_to(sim, uid).map(Self::Sensor),
        }
    }

    /// Error for a lookup of the entity `name` as a `wanted`.
    pub(super) fn type_mismatch(&self, name: &str, wanted: String) -> Error {
        let found = match self {
            Self::Robot(_) => "robot".into(),
            Self::Articulation(_) => "articulation".into(),
            Self::RigidObject(_) => "rigid object".into(),
            Self::Group(_) => "group of rigid objects".into(),
            Self::Terrain(_) => "terrain".into(),
            Self::Mjcf(_) => "MJCF part".into(),
            Self::Weld(_) => "weld".into(),
            Self::Sensor(handle) => format!("sensor of type {}", handle.type_name),
        };
        Error::EntityType { name: name.into(), found, wanted }
    }
}

#[cfg(test)]
mod tests {
    use super::short_type_name;

    #[test]
    fn names_of_types() {
        assert_eq!(short_type_name::<kinetoscope_sensors::camera::Camera>(), "Camera");
        assert_eq!(short_type_name::<Vec<std::cell::Cell<u8>>>(), "Vec<core::cell::Cell<u8>>");
    }
}
