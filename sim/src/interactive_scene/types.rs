//! Entity types of scene files. `EntityTypes::default` lists the built-in types; the built-in sensors are listed in
//! `kinetoscope-sensors`.

use super::entity::{AnySensorCfg, EntityCfg};
use super::schema;
use super::value::{Value, ValueError};
use crate::objects::articulation::ArticulationCfg;
use crate::objects::mjcf_part_data::MjcfPartCfg;
use crate::objects::object_group_data::RigidObjectGroupCfg;
use crate::objects::rigid_object_data::RigidObjectCfg;
use crate::objects::robot::RobotCfg;
use crate::objects::terrain::TerrainCfg;
use crate::objects::weld_data::WeldCfg;
use kinetoscope_sensors::{SensorCfg, SensorTypeVisitor};
use serde::de::DeserializeOwned;
use serde::{Deserialize as _, Serialize};
use std::any::Any;
use std::fmt::Debug;

/// Entity types that a scene file can select by `type`: the built-in ones and those of other crates.
///
/// ```
/// use kinetoscope_sim::EntityTypes;
///
/// let types = EntityTypes::default();
/// assert!(types.names().any(|name| name == "ray_caster"));
/// // Any SensorCfg with serde's two traits; here, a built-in sensor under another name.
/// let types = types.with_sensor::<kinetoscope_sensors::ImuCfg>("accelerometer");
/// ```
#[derive(Clone, Debug)]
pub struct EntityTypes {
    entries: Vec<EntityType>,
}

/// One entity type: its name in files, its reader and its writer.
#[derive(Clone, Debug)]
pub(super) struct EntityType {
    pub(super) name: String,
    pub(super) read: fn(Value<'_>) -> Result<EntityCfg, ValueError>,
    /// JSON Schema of the table without `type`.
    pub(super) schema: fn() -> serde_json::Value,
    /// Returns `None` for entities of other types.
    pub(super) write: fn(&EntityCfg) -> Option<Result<toml::Table, toml::ser::Error>>,
}

impl Default for EntityTypes {
    /// Robots, articulations, rigid objects and groups of them, terrains, attached MJCF files, welds and the built-in
    /// sensors.
    fn default() -> Self {
        let types = Self { entries: Vec::new() }
            .with::<RobotCfg>("robot")
            .with::<ArticulationCfg>("articulation")
            .with::<RigidObjectCfg>("rigid_object")
            .with::<RigidObjectGroupCfg>("rigid_object_group")
            .with::<TerrainCfg>("terrain")
            .with::<MjcfPartCfg>("mjcf")
            .with::<WeldCfg>("weld");
        let mut with_sensors = WithBuiltInSensors(types);
        kinetoscope_sensors::visit_sensor_types(&mut with_sensors);
        with_sensors.0
    }
}

impl EntityTypes {
    /// Adds a sensor type under a name; a type of the same name is replaced. Paths in its configuration are not made
    /// relative to the file, because only the sensor knows which of its strings are paths. A configuration type with
    /// several names is written under the first one.
    #[must_use]
    pub fn with_sensor<C>(self, name: impl Into<String>) -> Self
    where
        C: AnySensorCfg + Serialize + DeserializeOwned,
    {
        self.with::<SensorKind<C>>(name)
    }

    /// Names of the types, in insertion order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| entry.name.as_str())
    }

    fn with<K: EntityKind>(mut self, name: impl Into<String>) -> Self {
        self.insert::<K>(name.into());
        self
    }

    fn insert<K: EntityKind>(&mut self, name: String) {
        let entry = EntityType {
            name,
            read: |value| K::Cfg::deserialize(value).map(Into::into),
            schema: || {
                let mut schema = schema::of::<K::Cfg>();
                if let Some(properties) = schema["properties"].as_object_mut().filter(|_| !K::IS_SENSOR) {
                    // The name of the entity is the key of its table.
                    properties.remove("uid");
                }
                schema
            },
            write: |entity| K::from_entity(entity).map(toml::Table::try_from),
        };
        self.entries.retain(|other| other.name != entry.name);
        self.entries.push(entry);
    }

    pub(super) fn get(&self, name: &str) -> Option<&EntityType> {
        self.entries.iter().find(|entry| entry.name == name)
    }

    /// Names of the types with the JSON Schemas of their tables, without `type`.
    pub(super) fn schemas(&self) -> impl Iterator<Item = (&str, serde_json::Value)> {
        self.entries.iter().map(|entry| (entry.name.as_str(), (entry.schema)()))
    }

    /// Returns the type name and the TOML table of an entity, or `None` for an unknown type.
    pub(super) fn write(&self, entity: &EntityCfg) -> Option<(&str, Result<toml::Table, toml::ser::Error>)> {
        self.entries.iter().find_map(|entry| Some((entry.name.as_str(), (entry.write)(entity)?)))
    }
}

/// Adds the built-in sensors.
struct WithBuiltInSensors(EntityTypes);

impl SensorTypeVisitor for WithBuiltInSensors {
    fn visit<C>(&mut self, name: &'static str)
    where
        C: SensorCfg + Clone + Debug + Send + Sync + Serialize + DeserializeOwned + 'static,
    {
        self.0.insert::<SensorKind<C>>(name.into());
    }
}

/// An entity type that can be read and recognized among entities.
trait EntityKind {
    type Cfg: Serialize + DeserializeOwned + Into<EntityCfg>;

    /// True for sensors, which have no `uid` of their own.
    const IS_SENSOR: bool = false;

    fn from_entity(entity: &EntityCfg) -> Option<&Self::Cfg>;
}

impl EntityKind for RobotCfg {
    type Cfg = Self;

    fn from_entity(entity: &EntityCfg) -> Option<&Self> {
        if let EntityCfg::Robot(cfg) = entity { Some(cfg) } else { None }
    }
}

impl EntityKind for ArticulationCfg {
    type Cfg = Self;

    fn from_entity(entity: &EntityCfg) -> Option<&Self> {
        if let EntityCfg::Articulation(cfg) = entity { Some(cfg) } else { None }
    }
}

impl EntityKind for RigidObjectCfg {
    type Cfg = Self;

    fn from_entity(entity: &EntityCfg) -> Option<&Self> {
        if let EntityCfg::RigidObject(cfg) = entity { Some(cfg) } else { None }
    }
}

impl EntityKind for RigidObjectGroupCfg {
    type Cfg = Self;

    fn from_entity(entity: &EntityCfg) -> Option<&Self> {
        if let EntityCfg::Group(cfg) = entity { Some(cfg) } else { None }
    }
}

impl EntityKind for TerrainCfg {
    type Cfg = Self;

    fn from_entity(entity: &EntityCfg) -> Option<&Self> {
        if let EntityCfg::Terrain(cfg) = entity { Some(cfg) } else { None }
    }
}

impl EntityKind for MjcfPartCfg {
    type Cfg = Self;

    fn from_entity(entity: &EntityCfg) -> Option<&Self> {
        if let EntityCfg::Mjcf(cfg) = entity { Some(cfg) } else { None }
    }
}

impl EntityKind for WeldCfg {
    type Cfg = Self;

    fn from_entity(entity: &EntityCfg) -> Option<&Self> {
        if let EntityCfg::Weld(cfg) = entity { Some(cfg) } else { None }
    }
}

/// Entity type of a sensor with configuration `C`.
struct SensorKind<C>(std::marker::PhantomData<C>);

impl<C: AnySensorCfg + Serialize + DeserializeOwned> EntityKind for SensorKind<C> {
    type Cfg = C;

    const IS_SENSOR: bool = true;

    fn from_entity(entity: &EntityCfg) -> Option<&C> {
        let EntityCfg::Sensor(sensor) = entity else { return None };
        let any: &dyn Any = sensor.as_ref();
        any.downcast_ref()
    }
}
