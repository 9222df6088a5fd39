//! Entities of a scene by their names.

use super::InteractiveScene;
use super::entity::{Handle, short_name};
use crate::error::{Error, Result};
use crate::ids::{MjcfId, ObjectId, RobotId, TerrainId};
use crate::objects::articulation::{Articulation, ArticulationId, ArticulationMut};
use crate::objects::mjcf_part::{MjcfPart, MjcfPartMut};
use crate::objects::object_group::{RigidObjectGroup, RigidObjectGroupMut};
use crate::objects::object_group_data::GroupId;
use crate::objects::rigid_object::{RigidObject, RigidObjectMut};
use crate::objects::robot::{Robot, RobotMut};
use crate::objects::terrain::Terrain;
use crate::objects::weld::{Weld, WeldMut};
use crate::objects::weld_data::WeldId;
use crate::pattern::{closest, in_every_env};
use crate::sensor_list::SensorId;
use kinetoscope_sensors::Sensor;

impl InteractiveScene {
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

    /// The handle of a group of rigid objects.
    ///
    /// # Errors
    /// There is no such entity, or it is no group.
    pub fn rigid_object_group_id(&self, name: &str) -> Result<GroupId> {
        match self.find(name)? {
            Handle::Group(id) => Ok(*id),
            other => Err(other.is_no(name, "group of rigid objects".into())),
        }
    }

    /// A group of rigid objects, to read.
    ///
    /// # Errors
    /// As [`rigid_object_group_id`](Self::rigid_object_group_id).
    pub fn rigid_object_group(&self, name: &str) -> Result<RigidObjectGroup<'_>> {
        Ok(self.sim.rigid_object_group(self.rigid_object_group_id(name)?))
    }

    /// A group of rigid objects, to write.
    ///
    /// # Errors
    /// As [`rigid_object_group_id`](Self::rigid_object_group_id).
    pub fn rigid_object_group_mut(&mut self, name: &str) -> Result<RigidObjectGroupMut<'_>> {
        let id = self.rigid_object_group_id(name)?;
        Ok(self.sim.rigid_object_group_mut(id))
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
        Ok(self.sim.entities().terrain(self.terrain_id(name)?))
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

    /// The handle of a weld.
    ///
    /// # Errors
    /// There is no such entity, or it is no weld.
    pub fn weld_id(&self, name: &str) -> Result<WeldId> {
        match self.find(name)? {
            Handle::Weld(id) => Ok(*id),
            other => Err(other.is_no(name, "weld".into())),
        }
    }

    /// A weld, to read.
    ///
    /// # Errors
    /// As [`weld_id`](Self::weld_id).
    pub fn weld(&self, name: &str) -> Result<Weld<'_>> {
        Ok(self.sim.weld(self.weld_id(name)?))
    }

    /// A weld, to make and to release.
    ///
    /// # Errors
    /// As [`weld_id`](Self::weld_id).
    pub fn weld_mut(&mut self, name: &str) -> Result<WeldMut<'_>> {
        let id = self.weld_id(name)?;
        Ok(self.sim.weld_mut(id))
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
    /// [`SceneViewMut::set_debug_vis`](crate::SceneViewMut::set_debug_vis).
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
}
