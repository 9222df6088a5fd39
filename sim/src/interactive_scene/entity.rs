//! Entities of a scene: robots, articulations, rigid objects and groups of them, terrains, attached MJCF files, welds,
//! and sensors of any crate.

use crate::error::{Error, Result};
use crate::ids::{MjcfId, ObjectId, RobotId, TerrainId};
use crate::manager::SimulationManager;
use crate::objects::articulation::{ArticulationCfg, ArticulationId};
use crate::objects::mjcf_part_data::MjcfCfg;
use crate::objects::object_group_data::{GroupId, RigidObjectGroupCfg};
use crate::objects::rigid_object_data::RigidObjectCfg;
use crate::objects::robot::RobotCfg;
use crate::objects::terrain::TerrainCfg;
use crate::objects::weld_data::{WeldCfg, WeldId};
use crate::pattern::in_every_env;
use crate::sensor_list::SensorId;
use kinetoscope_sensors::{Sensor, SensorCfg};
use std::any::Any;
use std::fmt::Debug;

/// Configuration of one entity of a scene.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum EntityCfg {
    /// A robot. Its uid is the name of the entity.
    Robot(Box<RobotCfg>),
    /// A passive articulation. Its uid is the name of the entity.
    Articulation(Box<ArticulationCfg>),
    /// A rigid object. Its uid is the name of the entity.
    RigidObject(Box<RigidObjectCfg>),
    /// A group of rigid objects. Its uid is the name of the entity; the uid of each object is `group.object`.
    Group(Box<RigidObjectGroupCfg>),
    /// A terrain. Its uid is the name of the entity.
    Terrain(Box<TerrainCfg>),
    /// An attached MJCF file. Its uid is the name of the entity.
    Mjcf(Box<MjcfCfg>),
    /// A weld, initially released. Its uid is the name of the entity.
    Weld(Box<WeldCfg>),
    /// A sensor of any type.
    Sensor(Box<dyn SensorEntity>),
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

impl From<MjcfCfg> for EntityCfg {
    fn from(cfg: MjcfCfg) -> Self {
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
    pub(super) fn turn(&self) -> Turn {
        match self {
            Self::Weld(_) => Turn::Weld,
            Self::Sensor(_) => Turn::Sensor,
            _ => Turn::Thing,
        }
    }
}

/// Build phases of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// Robots, articulations, objects, terrains, attached MJCF files.
    Thing,
    /// Welds, which need two bodies.
    Weld,
    /// Sensors, which may refer to any body.
    Sensor,
}

impl<C: SensorEntity> From<C> for EntityCfg {
    fn from(cfg: C) -> Self {
        Self::Sensor(Box::new(cfg))
    }
}

/// Type-erased configuration of a sensor. Every [`SensorCfg`] with `Clone`, `Debug`, `Send` and `Sync` implements it.
/// `&dyn SensorEntity` converts to `&dyn Any`, for a downcast to the configuration.
pub trait SensorEntity: Any + Debug + Send + Sync {
    /// Clones the configuration into a new box.
    fn boxed_clone(&self) -> Box<dyn SensorEntity>;

    /// Adds the sensor to a simulation.
    ///
    /// # Errors
    /// As [`SimulationManager::add_sensor`].
    fn add_to(&self, sim: &mut SimulationManager, uid: &str) -> Result<SensorHandle>;
}

impl<C> SensorEntity for C
where
    C: SensorCfg + Clone + Debug + Send + Sync + 'static,
{
    fn boxed_clone(&self) -> Box<dyn SensorEntity> {
        Box::new(self.clone())
    }

    fn add_to(&self, sim: &mut SimulationManager, uid: &str) -> Result<SensorHandle> {
        sim.add_sensor(uid, self.clone()).map(SensorHandle::new)
    }
}

impl Clone for Box<dyn SensorEntity> {
    fn clone(&self) -> Self {
        (**self).boxed_clone()
    }
}

/// Type-erased [`SensorId`].
#[derive(Debug)]
pub struct SensorHandle {
    id: Box<dyn Any + Send + Sync>,
    index: usize,
    type_name: &'static str,
}

impl SensorHandle {
    fn new<S: Sensor>(id: SensorId<S>) -> Self {
        Self { id: Box::new(id), index: id.index(), type_name: short_name::<S>() }
    }

    /// The handle, if the sensor has type `S`.
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
pub(super) fn short_name<T>() -> &'static str {
    let full = std::any::type_name::<T>();
    // Arguments of a generic type have paths of their own.
    let end = full.find('<').unwrap_or(full.len());
    let start = full[..end].rfind("::").map_or(0, |at| at + 2);
    &full[start..]
}

/// Handle of an entity of a scene.
#[derive(Debug)]
pub(super) enum Handle {
    Robot(RobotId),
    Articulation(ArticulationId),
    RigidObject(ObjectId),
    Group(GroupId),
    Terrain(TerrainId),
    Mjcf(MjcfId),
    Weld(WeldId),
    Sensor(SensorHandle),
}

impl Handle {
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
            EntityCfg::Mjcf(cfg) => sim.add_mjcf(MjcfCfg { uid: uid.into(), ..(**cfg).clone() }).map(Self::Mjcf),
            EntityCfg::Weld(cfg) => {
                let [first, second] = [&cfg.first, &cfg.second].map(|name| in_every_env(name).into());
                sim.add_weld(WeldCfg { uid: uid.into(), first, second }).map(Self::Weld)
            }
            EntityCfg::Sensor(cfg) => cfg.add_to(sim, uid).map(Self::Sensor),
        }
    }

    /// Error for a lookup of the entity `name` as a `wanted`.
    pub(super) fn is_no(&self, name: &str, wanted: String) -> Error {
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
    use super::short_name;

    #[test]
    fn names_of_types() {
        assert_eq!(short_name::<kinetoscope_sensors::camera::Camera>(), "Camera");
        assert_eq!(short_name::<Vec<std::cell::Cell<u8>>>(), "Vec<core::cell::Cell<u8>>");
    }
}
