//! Lookup of the entities of a scene by name.

use super::InteractiveScene;
use super::entity::{EntityHandle, short_type_name};
use crate::error::{Error, Result};
use crate::ids::{MjcfId, RigidObjectId, RobotId, TerrainId};
use crate::objects::articulation::{Articulation, ArticulationId, ArticulationMut};
use crate::objects::mjcf_part::{MjcfPart, MjcfPartMut};
use crate::objects::object_group::{RigidObjectGroup, RigidObjectGroupMut};
use crate::objects::object_group_data::RigidObjectGroupId;
use crate::objects::rigid_object::{RigidObject, RigidObjectMut};
use crate::objects::robot::{Robot, RobotMut};
use crate::objects::terrain::Terrain;
use crate::objects::weld::{Weld, WeldMut};
use crate::objects::weld_data::WeldId;
use crate::pattern::{closest_names, strip_env_prefix};
use crate::sensor_list::SensorId;
use kinetoscope_sensors::Sensor;

impl InteractiveScene {
    fn find(&self, name: &str) -> Result<&EntityHandle> {
        let name = strip_env_prefix(name);
        let found = self.entities.iter().find(|(known, _)| known == name);
        found.map(|(_, handle)| handle).ok_or_else(|| Error::UnknownName {
            what: "scene entity",
            name: name.into(),
            candidates: closest_names(name, self.keys()).into_iter().map(String::from).collect(),
        })
    }

    /// Returns the handle of a robot by the name of its entity.
    ///
    /// # Errors
    /// The entity does not exist, or is not a robot.
    pub fn robot_id(&self, name: &str) -> Result<RobotId> {
        match self.find(name)? {
            EntityHandle::Robot(id) => Ok(*id),
            other => Err(other.type_mismatch(name, "robot".into())),
        }
    }

    /// Returns a robot for reading.
    ///
    /// # Errors
    /// As [`robot_id`](Self::robot_id).
    pub fn robot(&self, name: &str) -> Result<Robot<'_>> {
        Ok(self.sim.robot(self.robot_id(name)?))
    }

    /// Returns a robot for commands and writes. Writes act at once, so there is no counterpart to Isaac Lab's
    /// `write_data_to_sim`.
    ///
    /// # Errors
    /// As [`robot_id`](Self::robot_id).
    pub fn robot_mut(&mut self, name: &str) -> Result<RobotMut<'_>> {
        let id = self.robot_id(name)?;
        Ok(self.sim.robot_mut(id))
    }

    /// Returns the handle of a passive articulation by the name of its entity.
    ///
    /// # Errors
    /// The entity does not exist, or is not a passive articulation.
    pub fn articulation_id(&self, name: &str) -> Result<ArticulationId> {
        match self.find(name)? {
            EntityHandle::Articulation(id) => Ok(*id),
            other => Err(other.type_mismatch(name, "articulation".into())),
        }
    }

    /// Returns an articulation for reading.
    ///
    /// # Errors
    /// As [`articulation_id`](Self::articulation_id).
    pub fn articulation(&self, name: &str) -> Result<Articulation<'_>> {
        Ok(self.sim.articulation(self.articulation_id(name)?))
    }

    /// Returns an articulation for writing.
    ///
    /// # Errors
    /// As [`articulation_id`](Self::articulation_id).
    pub fn articulation_mut(&mut self, name: &str) -> Result<ArticulationMut<'_>> {
        let id = self.articulation_id(name)?;
        Ok(self.sim.articulation_mut(id))
    }

    /// Returns the handle of a rigid object by the name of its entity.
    ///
    /// # Errors
    /// The entity does not exist, or is not a rigid object.
    pub fn rigid_object_id(&self, name: &str) -> Result<RigidObjectId> {
        match self.find(name)? {
            EntityHandle::RigidObject(id) => Ok(*id),
            other => Err(other.type_mismatch(name, "rigid object".into())),
        }
    }

    /// Returns a rigid object for reading.
    ///
    /// # Errors
    /// As [`rigid_object_id`](Self::rigid_object_id).
    pub fn rigid_object(&self, name: &str) -> Result<RigidObject<'_>> {
        Ok(self.sim.rigid_object(self.rigid_object_id(name)?))
    }

    /// Returns a rigid object for writing.
    ///
    /// # Errors
    /// As [`rigid_object_id`](Self::rigid_object_id).
    pub fn rigid_object_mut(&mut self, name: &str) -> Result<RigidObjectMut<'_>> {
        let id = self.rigid_object_id(name)?;
        Ok(self.sim.rigid_object_mut(id))
    }

    /// Returns the handle of a group of rigid objects by the name of its entity.
    ///
    /// # Errors
    /// The entity does not exist, or is not a group.
    pub fn rigid_object_group_id(&self, name: &str) -> Result<RigidObjectGroupId> {
        match self.find(name)? {
            EntityHandle::Group(id) => Ok(*id),
            other => Err(other.type_mismatch(name, "group of rigid objects".into())),
        }
    }

    /// Returns a group of rigid objects for reading.
    ///
    /// # Errors
    /// As [`rigid_object_group_id`](Self::rigid_object_group_id).
    pub fn rigid_object_group(&self, name: &str) -> Result<RigidObjectGroup<'_>> {
        Ok(self.sim.rigid_object_group(self.rigid_object_group_id(name)?))
    }

    /// Returns a group of rigid objects for writing.
    ///
    /// # Errors
    /// As [`rigid_object_group_id`](Self::rigid_object_group_id).
    pub fn rigid_object_group_mut(&mut self, name: &str) -> Result<RigidObjectGroupMut<'_>> {
        let id = self.rigid_object_group_id(name)?;
        Ok(self.sim.rigid_object_group_mut(id))
    }

    /// Returns the handle of a terrain by the name of its entity.
    ///
    /// # Errors
    /// The entity does not exist, or is not a terrain.
    pub fn terrain_id(&self, name: &str) -> Result<TerrainId> {
        match self.find(name)? {
            EntityHandle::Terrain(id) => Ok(*id),
            other => Err(other.type_mismatch(name, "terrain".into())),
        }
    }

    /// Returns a terrain.
    ///
    /// # Errors
    /// As [`terrain_id`](Self::terrain_id).
    pub fn terrain(&self, name: &str) -> Result<&Terrain> {
        Ok(self.sim.entities().terrain(self.terrain_id(name)?))
    }

    /// Returns the handle of an MJCF part (an attached MJCF file) by the name of its entity.
    ///
    /// # Errors
    /// The entity does not exist, or is not an MJCF part.
    pub fn mjcf_id(&self, name: &str) -> Result<MjcfId> {
        match self.find(name)? {
            EntityHandle::Mjcf(id) => Ok(*id),
            other => Err(other.type_mismatch(name, "MJCF part".into())),
        }
    }

    /// Returns an MJCF part for reading.
    ///
    /// # Errors
    /// As [`mjcf_id`](Self::mjcf_id).
    pub fn mjcf_part(&self, name: &str) -> Result<MjcfPart<'_>> {
        Ok(self.sim.mjcf_part(self.mjcf_id(name)?))
    }

    /// Returns an MJCF part for commands and writes.
    ///
    /// # Errors
    /// As [`mjcf_id`](Self::mjcf_id).
    pub fn mjcf_part_mut(&mut self, name: &str) -> Result<MjcfPartMut<'_>> {
        let id = self.mjcf_id(name)?;
        Ok(self.sim.mjcf_part_mut(id))
    }

    /// Returns the handle of a weld by the name of its entity.
    ///
    /// # Errors
    /// The entity does not exist, or is not a weld.
    pub fn weld_id(&self, name: &str) -> Result<WeldId> {
        match self.find(name)? {
            EntityHandle::Weld(id) => Ok(*id),
            other => Err(other.type_mismatch(name, "weld".into())),
        }
    }

    /// Returns a weld for reading.
    ///
    /// # Errors
    /// As [`weld_id`](Self::weld_id).
    pub fn weld(&self, name: &str) -> Result<Weld<'_>> {
        Ok(self.sim.weld(self.weld_id(name)?))
    }

    /// Returns a weld for attaching and releasing.
    ///
    /// # Errors
    /// As [`weld_id`](Self::weld_id).
    pub fn weld_mut(&mut self, name: &str) -> Result<WeldMut<'_>> {
        let id = self.weld_id(name)?;
        Ok(self.sim.weld_mut(id))
    }

    /// Returns the handle of a sensor of type `S`, such as `Camera`, by the name of its entity.
    ///
    /// # Errors
    /// The entity does not exist, or is not a sensor of this type.
    pub fn sensor_id<S: Sensor>(&self, name: &str) -> Result<SensorId<S>> {
        let handle = self.find(name)?;
        let id = if let EntityHandle::Sensor(sensor) = handle { sensor.get() } else { None };
        id.ok_or_else(|| handle.type_mismatch(name, format!("sensor of type {}", short_type_name::<S>())))
    }

    /// Returns a sensor of type `S` for reading. A [lazy](kinetoscope_sensors::SensorCfg::lazy) sensor runs its pending
    /// measurement now.
    ///
    /// # Errors
    /// As [`sensor_id`](Self::sensor_id), or the sensor failed, in an earlier step or now.
    pub fn sensor<S: Sensor>(&self, name: &str) -> Result<&S> {
        self.sim.sensor(self.sensor_id(name)?)
    }

    /// Returns a sensor of type `S` for changes.
    ///
    /// # Errors
    /// As [`sensor`](Self::sensor).
    pub fn sensor_mut<S: Sensor>(&mut self, name: &str) -> Result<&mut S> {
        let id = self.sensor_id(name)?;
        self.sim.sensor_mut(id)
    }

    /// Enables or disables the markers of a sensor of any type; see
    /// [`SceneViewMut::set_debug_vis`](crate::SceneViewMut::set_debug_vis).
    ///
    /// # Errors
    /// The entity does not exist, or is not a sensor.
    pub fn set_debug_vis(&mut self, name: &str, shown: bool) -> Result<()> {
        let index = match self.find(name)? {
            EntityHandle::Sensor(sensor) => sensor.index(),
            other => return Err(other.type_mismatch(name, "sensor".into())),
        };
        self.sim.sensors.set_debug_vis(index, shown)
    }
}
