//! Rigid objects: props that robots see, push and hold.

use super::rigid_object_data::{RigidObjectCfg, RigidObjectData};
use crate::error::Result;
use crate::ids::EnvId;
use crate::objects::free_body::{FreeBody, FreeBodyMut};
use crate::sensor_list::SensorList;
use crate::simulation::Simulation;
use ndarray::{Array2, AsArray, Ix2};
use std::sync::Arc;

/// Read access to a rigid object. Arrays have one row per environment.
#[derive(Clone, Copy, Debug)]
pub struct RigidObject<'a> {
    pub(super) data: &'a Arc<RigidObjectData>,
    pub(super) simulation: &'a Simulation,
    pub(super) index: usize,
}

impl<'a> RigidObject<'a> {
    pub(crate) fn new(data: &'a Arc<RigidObjectData>, simulation: &'a Simulation, index: usize) -> Self {
        Self { data, simulation, index }
    }

    fn body(&self) -> FreeBody<'a> {
        FreeBody { simulation: self.simulation, index: self.simulation.objects[self.index] }
    }

    /// Name of the object.
    pub fn uid(&self) -> &'a str {
        self.data.uid()
    }

    /// Configuration that the object was added with.
    pub fn cfg(&self) -> &'a RigidObjectCfg {
        self.data.cfg()
    }

    /// Value of the mask channel of cameras for the object, the same in every environment.
    pub fn mask_id(&self) -> i32 {
        self.data.mask_id
    }

    /// Mass of the configuration \[kg\]: `mass`, else `density` times the volume. [`mass`](Self::mass) gives the mass
    /// in each environment.
    pub fn nominal_mass(&self) -> f64 {
        self.data.mass_properties.mass
    }

    /// Pose of the object's frame in the environment: rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    #[doc(alias = "get_pose")]
    pub fn pose(&self) -> Array2<f64> {
        self.body().poses()
    }

    /// Velocity of the origin of the object's frame, then angular velocity, in world axes \[m/s, rad/s\], shape (N, 6);
    /// 0 for an object that is not dynamic.
    #[doc(alias = "get_velocity")]
    pub fn velocity(&self) -> Array2<f64> {
        self.body().velocities()
    }
}

/// Write access to a rigid object.
#[derive(Debug)]
pub struct RigidObjectMut<'a> {
    pub(super) data: &'a Arc<RigidObjectData>,
    pub(super) simulation: &'a mut Simulation,
    pub(super) sensors: &'a mut SensorList,
    pub(super) index: usize,
}

impl<'a> RigidObjectMut<'a> {
    pub(crate) fn new(
        data: &'a Arc<RigidObjectData>,
        simulation: &'a mut Simulation,
        sensors: &'a mut SensorList,
        index: usize,
    ) -> Self {
        Self { data, simulation, sensors, index }
    }

    /// Read access to the object.
    pub fn read(&self) -> RigidObject<'_> {
        RigidObject::new(self.data, self.simulation, self.index)
    }

    /// Sets the pose of the object: rows `[x, y, z, qw, qx, qy, qz]` in the environment \[m\] for `env_ids` (`None` for
    /// all environments; a single row applies to all of them). Quaternions are normalized; velocities, which are in
    /// world axes, are preserved. A forward pass follows, so that later reads belong to the new state.
    ///
    /// A kinematic object stays there until the next write or reset. A static object stays there over resets, until the
    /// next write or [`EnvPropertiesMut::reset`](crate::EnvPropertiesMut::reset). Its pose is the properties `Position`
    /// and `Rotation` ([`Property`](crate::Property)), and an environment with another pose gets a model of its own. A
    /// body that touches the object at its new pose is pushed out as in any contact.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated environment, a value that is not finite, or a quaternion of length zero. A
    /// pose of a static object that MuJoCo rejects. Then nothing is written.
    pub fn write_pose<'t>(&mut self, poses: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.body().write_poses("write_pose", poses.into(), env_ids)
    }

    /// Sets the velocity of the object's frame and its angular velocity, in world axes: rows of 6 \[m/s, rad/s\], as in
    /// [`write_pose`](Self::write_pose).
    ///
    /// # Errors
    /// An object that is not dynamic; wrong shape, an unknown or repeated environment, or a value that is not finite.
    /// Then nothing is written.
    pub fn write_velocity<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.body().write_velocities("write_velocity", velocities.into(), env_ids)
    }

    fn body(&mut self) -> FreeBodyMut<'_> {
        let index = self.simulation.objects[self.index];
        FreeBodyMut { simulation: self.simulation, sensors: self.sensors, index, owner: self.data.uid() }
    }
}
