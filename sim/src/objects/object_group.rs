//! Groups: several rigid objects behind one name, written and read together.

use super::free_body::{FreeBody, FreeBodyMut};
use super::object_group_data::{GroupData, GroupId, RigidObjectGroupCfg};
use super::rows::distinct_envs;
use crate::contents::Contents;
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::manager::SimulationManager;
use crate::objects::rigid_object_data::RigidObjectData;
use crate::sensor_list::SensorList;
use crate::simulation::Simulation;
use nalgebra::Vector3;
use ndarray::{Array2, Array3, ArrayView3, AsArray, Axis, Ix3};
use std::sync::Arc;

/// A group of rigid objects, to read. Arrays have one row per environment and object.
#[derive(Clone, Copy, Debug)]
pub struct RigidObjectGroup<'a> {
    data: &'a GroupData,
    contents: &'a Contents,
    simulation: &'a Simulation,
}

impl<'a> RigidObjectGroup<'a> {
    pub(crate) fn new(data: &'a GroupData, contents: &'a Contents, simulation: &'a Simulation) -> Self {
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

    /// Whether it has no objects, which no group that was added is.
    pub fn is_empty(&self) -> bool {
        self.data.objects.is_empty()
    }

    /// Names of the objects in the simulation, `group.object`, in order.
    pub fn names(&self) -> Vec<&'a str> {
        self.contents.objects[self.data.objects.clone()].iter().map(|object| object.uid()).collect()
    }

    /// Poses of the objects in the environment: `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, K, 7).
    #[doc(alias = "get_pose")]
    pub fn pose(&self) -> Array3<f64> {
        self.gather(|body| body.poses())
    }

    /// Velocities of the objects' frames, then angular velocities, in world axes \[m/s, rad/s\], shape (N, K, 6).
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

/// A group of rigid objects, to write.
#[derive(Debug)]
pub struct RigidObjectGroupMut<'a> {
    data: &'a GroupData,
    contents: &'a Contents,
    simulation: &'a mut Simulation,
    sensors: &'a mut SensorList,
}

impl<'a> RigidObjectGroupMut<'a> {
    pub(crate) fn new(
        data: &'a GroupData,
        contents: &'a Contents,
        simulation: &'a mut Simulation,
        sensors: &'a mut SensorList,
    ) -> Self {
        Self { data, contents, simulation, sensors }
    }

    /// The group, to read.
    pub fn read(&self) -> RigidObjectGroup<'_> {
        RigidObjectGroup::new(self.data, self.contents, self.simulation)
    }

    /// Puts the objects somewhere, as [`RigidObjectMut::write_pose`](crate::RigidObjectMut::write_pose) does one: poses
    /// `[x, y, z, qw, qx, qy, qz]` in the environment \[m\], shape (environments, K, 7), for `env_ids` (all where `None`; a
    /// single row is for all of them).
    ///
    /// # Errors
    /// Wrong shape, unknown environment, or one that is named twice, a value that is not finite,
    /// a quaternion of length zero; then nothing is written. Where MuJoCo itself refuses the pose of an object that stands, those
    /// of objects before it in the group are written.
    pub fn write_pose<'t>(&mut self, poses: impl AsArray<'t, f64, Ix3>, env_ids: Option<&[EnvId]>) -> Result<()> {
        let (argument, poses): (_, ArrayView3<'_, f64>) = ("write_pose", poses.into());
        let envs = self.check_shape(argument, poses, 7, "environments, objects, x y z qw qx qy qz", env_ids)?;
        let mut checked = Vec::new();
        for k in 0..self.data.objects.len() {
            checked.push(self.body(k).check_poses(argument, poses.index_axis(Axis(1), k), env_ids)?);
        }
        let written = checked.iter().enumerate().try_for_each(|(k, poses)| self.body(k).put_poses(poses));
        self.sensors.refresh(&envs, self.simulation);
        written
    }

    /// Sets the velocities of the objects' frames and their angular velocities, in world axes: `[vx, vy, vz, wx, wy, wz]`
    /// \[m/s, rad/s\], shape (environments, K, 6), as in [`write_pose`](Self::write_pose).
    ///
    /// # Errors
    /// One of the objects is not dynamic; wrong shape, unknown environment, or one that is named twice, a value that is not
    /// finite; then nothing is written.
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
            self.body(k).put_velocities(velocities, |_| Vector3::zeros());
        }
        self.sensors.refresh(&envs, self.simulation);
        Ok(())
    }

    /// The environments that are meant, where the array has a place for `numbers` of every object.
    fn check_shape(
        &self,
        argument: &'static str,
        values: ArrayView3<'_, f64>,
        numbers: usize,
        meaning: &'static str,
        env_ids: Option<&[EnvId]>,
    ) -> Result<Vec<usize>> {
        let envs = distinct_envs(argument, env_ids, self.simulation.batch.num_envs())?;
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
    /// Adds several rigid objects that are read and written together, compiled as [`add_robot`](Self::add_robot) does; by
    /// [`rigid_object_id`](crate::Entities::rigid_object_id) each of them is an object as any other, called `group.object`.
    ///
    /// # Errors
    /// There are none, a name is taken or used twice, or something is wrong with one of them; then none is added.
    pub fn add_rigid_object_group(&mut self, cfg: RigidObjectGroupCfg) -> Result<GroupId> {
        self.check_world_uid(&cfg.uid)?;
        if cfg.objects.is_empty() {
            let expected = "a group needs at least 1 object";
            return Err(Error::Config { field: "objects", value: "[]".into(), expected });
        }
        let (mut contents, mut diagnostics) = (self.contents.clone(), Vec::new());
        let first = contents.objects.len();
        for mut object in cfg.objects {
            object.uid = format!("{}.{}", cfg.uid, object.uid);
            contents.check_uid(&object.uid)?;
            let object = RigidObjectData::new(object, contents.next_mask_id(), &mut diagnostics)?;
            contents.objects.push(Arc::new(object));
        }
        contents.groups.push(GroupData { uid: cfg.uid, objects: first..contents.objects.len() });
        self.replace_contents(contents, diagnostics)?;
        Ok(GroupId { manager: self.serial, index: self.contents.groups.len() - 1 })
    }

    /// A group of rigid objects, to read.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn rigid_object_group(&self, id: GroupId) -> RigidObjectGroup<'_> {
        let index = self.index_of(id.manager, id.index);
        RigidObjectGroup::new(&self.contents.groups[index], &self.contents, &self.simulation)
    }

    /// A group of rigid objects, to write.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn rigid_object_group_mut(&mut self, id: GroupId) -> RigidObjectGroupMut<'_> {
        let index = self.index_of(id.manager, id.index);
        let group = &self.contents.groups[index];
        RigidObjectGroupMut::new(group, &self.contents, &mut self.simulation, &mut self.sensors)
    }
}
