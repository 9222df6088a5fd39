//! Groups of rigid objects with one name, read and written together.

use super::free_body::{FreeBody, FreeBodyMut};
use super::object_group_data::{RigidObjectGroupCfg, RigidObjectGroupData, RigidObjectGroupId};
use super::rows::unique_envs;
use crate::entity_set::EntitySet;
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::manager::SimulationManager;
use crate::objects::rigid_object_data::RigidObjectData;
use crate::sensor_list::SensorList;
use crate::simulation::Simulation;
use nalgebra::Vector3;
use ndarray::{Array2, Array3, ArrayView3, AsArray, Axis, Ix3};
use std::sync::Arc;

/// Read access to a group of rigid objects. Arrays have one row per environment and object.
#[derive(Clone, Copy, Debug)]
pub struct RigidObjectGroup<'a> {
    data: &'a RigidObjectGroupData,
    contents: &'a EntitySet,
    simulation: &'a Simulation,
}

impl<'a> RigidObjectGroup<'a> {
    pub(crate) fn new(data: &'a RigidObjectGroupData, contents: &'a EntitySet, simulation: &'a Simulation) -> Self {
        Self { data, contents, simulation }
    }

    /// Name of the group.
    pub fn uid(&self) -> &'a str {
        &self.data.uid
    }

    /// Number of objects.
    pub fn len(&self) -> usize {
        self.data.objects.len()
    }

    /// True for a group without objects, which cannot be added to a simulation.
    pub fn is_empty(&self) -> bool {
        self.data.objects.is_empty()
    }

    /// Names of the objects in the simulation, `group.object`, in the order of the configuration.
    pub fn names(&self) -> Vec<&'a str> {
        self.contents.objects[self.data.objects.clone()].iter().map(|object| object.uid()).collect()
    }

    /// Poses of the objects in the environment: `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, K, 7).
    #[doc(alias = "get_pose")]
    pub fn pose(&self) -> Array3<f64> {
        self.gather(|body| body.poses())
    }

    /// Velocities of the objects' frames, then angular velocities, in world axes \[m/s, rad/s\], shape (N, K, 6); 0 for
    /// objects that are not dynamic.
    #[doc(alias = "get_velocity")]
    pub fn velocity(&self) -> Array3<f64> {
        self.gather(|body| body.velocities())
    }

    fn gather(&self, read: impl Fn(FreeBody<'_>) -> Array2<f64>) -> Array3<f64> {
        let indices = &self.simulation.objects[self.data.objects.clone()];
        let each: Vec<Array2<f64>> =
            indices.iter().map(|&index| read(FreeBody { simulation: self.simulation, index })).collect();
        let width = each.first().map_or(0, Array2::ncols);
        Array3::from_shape_fn((self.simulation.batch.num_envs(), each.len(), width), |(i, k, c)| each[k][(i, c)])
    }
}

/// Write access to a group of rigid objects.
#[derive(Debug)]
pub struct RigidObjectGroupMut<'a> {
    data: &'a RigidObjectGroupData,
    contents: &'a EntitySet,
    simulation: &'a mut Simulation,
    sensors: &'a mut SensorList,
}

impl<'a> RigidObjectGroupMut<'a> {
    pub(crate) fn new(
        data: &'a RigidObjectGroupData,
        contents: &'a EntitySet,
        simulation: &'a mut Simulation,
        sensors: &'a mut SensorList,
    ) -> Self {
        Self { data, contents, simulation, sensors }
    }

    /// Read access to the group.
    pub fn read(&self) -> RigidObjectGroup<'_> {
        RigidObjectGroup::new(self.data, self.contents, self.simulation)
    }

    /// Sets the poses of the objects, as [`RigidObjectMut::write_pose`](crate::RigidObjectMut::write_pose) does for one
    /// object: poses `[x, y, z, qw, qx, qy, qz]` in the environment \[m\], shape (environments, K, 7), for `env_ids`
    /// (`None` for all environments; a single row applies to all of them).
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated environment, a value that is not finite, or a quaternion of length zero;
    /// then nothing is written. If MuJoCo itself rejects the pose of a static object, the poses of earlier objects of
    /// the group are already written.
    pub fn write_pose<'t>(&mut self, poses: impl AsArray<'t, f64, Ix3>, env_ids: Option<&[EnvId]>) -> Result<()> {
        let (argument, poses): (_, ArrayView3<'_, f64>) = ("write_pose", poses.into());
        let envs = self.check_shape(argument, poses, 7, "environments, objects, x y z qw qx qy qz", env_ids)?;
        let mut checked = Vec::new();
        for k in 0..self.data.objects.len() {
            checked.push(self.body(k).check_poses(argument, poses.index_axis(Axis(1), k), env_ids)?);
        }
        let written = checked.iter().enumerate().try_for_each(|(k, poses)| self.body(k).write_checked_poses(poses));
        self.sensors.refresh(&envs, self.simulation);
        written
    }

    /// Sets the velocities of the objects' frames and their angular velocities, in world axes: `[vx, vy, vz, wx, wy,
    /// wz]` \[m/s, rad/s\], shape (environments, K, 6), as in [`write_pose`](Self::write_pose).
    ///
    /// # Errors
    /// An object is not dynamic; wrong shape, an unknown or repeated environment, or a value that is not finite. Then
    /// nothing is written.
    pub fn write_velocity<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix3>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let (argument, velocities): (_, ArrayView3<'_, f64>) = ("write_velocity", velocities.into());
        let envs = self.check_shape(argument, velocities, 6, "environments, objects, vx vy vz wx wy wz", env_ids)?;
        let mut checked = Vec::new();
        for k in 0..self.data.objects.len() {
            checked.push(self.body(k).check_velocities(argument, velocities.index_axis(Axis(1), k), env_ids)?);
        }
        for (k, velocities) in checked.iter().enumerate() {
            self.body(k).write_checked_velocities(velocities, |_| Vector3::zeros());
        }
        self.sensors.refresh(&envs, self.simulation);
        Ok(())
    }

    /// Checks that an array has shape (selected environments or 1, objects, `numbers`), and returns the indices of the
    /// selected environments. `meaning` names the axes in errors.
    fn check_shape(
        &self,
        argument: &'static str,
        values: ArrayView3<'_, f64>,
        numbers: usize,
        meaning: &'static str,
        env_ids: Option<&[EnvId]>,
    ) -> Result<Vec<usize>> {
        let envs = unique_envs(argument, env_ids, self.simulation.batch.num_envs())?;
        let (rows, objects, width) = values.dim();
        if ![1, envs.len()].contains(&rows) || objects != self.data.objects.len() || width != numbers {
            let (found, expected) = (values.shape().to_vec(), vec![envs.len(), self.data.objects.len(), numbers]);
            return Err(Error::Shape { argument, found, expected, meaning });
        }
        Ok(envs)
    }

    fn body(&mut self, k: usize) -> FreeBodyMut<'_> {
        let object = self.data.objects.start + k;
        let index = self.simulation.objects[object];
        let owner = self.contents.objects[object].uid();
        FreeBodyMut { simulation: self.simulation, sensors: self.sensors, index, owner }
    }
}

impl SimulationManager {
    /// Adds several rigid objects that are read and written together. The model is compiled in this call, as in
    /// [`add_robot`](Self::add_robot). Each is also available as a single object, called `group.object`, by
    /// [`rigid_object_id`](crate::Entities::rigid_object_id).
    ///
    /// # Errors
    /// The group is empty, a name is taken or used twice, or the configuration of an object is invalid; then nothing is
    /// added.
    pub fn add_rigid_object_group(&mut self, cfg: RigidObjectGroupCfg) -> Result<RigidObjectGroupId> {
        self.check_world_uid(&cfg.uid)?;
        if cfg.objects.is_empty() {
            let expected = "a group needs at least 1 object";
            return Err(Error::Config { field: "objects", value: "[]".into(), expected });
        }
        let (mut contents, mut diagnostics) = (self.entities.clone(), Vec::new());
        let first = contents.objects.len();
        for mut object in cfg.objects {
            object.uid = format!("{}.{}", cfg.uid, object.uid);
            contents.check_uid_free(&object.uid)?;
            let object = RigidObjectData::new(object, contents.next_mask_id(), &mut diagnostics)?;
            contents.objects.push(Arc::new(object));
        }
        contents.groups.push(RigidObjectGroupData { uid: cfg.uid, objects: first..contents.objects.len() });
        self.recompile_with(contents, diagnostics)?;
        Ok(RigidObjectGroupId { manager: self.serial, index: self.entities.groups.len() - 1 })
    }

    /// Read access to a group of rigid objects.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn rigid_object_group(&self, id: RigidObjectGroupId) -> RigidObjectGroup<'_> {
        let index = self.index_of(id.manager, id.index);
        RigidObjectGroup::new(&self.entities.groups[index], &self.entities, &self.simulation)
    }

    /// Write access to a group of rigid objects.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn rigid_object_group_mut(&mut self, id: RigidObjectGroupId) -> RigidObjectGroupMut<'_> {
        let index = self.index_of(id.manager, id.index);
        let group = &self.entities.groups[index];
        RigidObjectGroupMut::new(group, &self.entities, &mut self.simulation, &mut self.sensors)
    }
}
