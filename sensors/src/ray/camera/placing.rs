//! Placing cameras of rays, and changing their lenses: as with [`Camera`](crate::Camera), by the same code.

use super::sensor::RayCasterCamera;
use crate::camera::viewpoints::chosen_rows;
use crate::camera::{CameraConvention, CameraError, Intrinsics, Poses};
use crate::error::SensorError;
use ndarray::Array2;

impl RayCasterCamera {
    /// Poses that the next pictures are taken from, in the frame of the parent (of the environment, for a free camera), rows
    /// `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    pub fn local_pose(&self, convention: CameraConvention) -> Array2<f64> {
        self.viewpoints.local_pose(convention)
    }

    /// Places cameras in the frame of their parent (of the environment, for free ones), from the next picture on.
    ///
    /// `poses` are typed or rows `[x, y, z, qw, qx, qy, qz]`: one for each of `env_ids` (`None` is all environments), or one
    /// for all. `convention` says what their axes mean.
    ///
    /// # Errors
    ///
    /// [`CameraError::Pose`], [`CameraError::Count`], an environment that does not exist or that is named twice; nothing is
    /// changed then.
    pub fn set_local_pose(
        &mut self,
        poses: &(impl Poses + ?Sized),
        env_ids: Option<&[usize]>,
        convention: CameraConvention,
    ) -> Result<(), SensorError> {
        let rows = self.chosen_rows(env_ids)?;
        Ok(self.viewpoints.set_local(&rows, poses, convention)?)
    }

    /// Places cameras in the environment, as [`set_local_pose`](Self::set_local_pose). An attached camera gets the local
    /// pose that puts it there with its parent where rays were cast last, and moves with its parent from then on.
    ///
    /// # Errors
    ///
    /// As [`set_local_pose`](Self::set_local_pose), and [`CameraError::NothingCaptured`] for an attached camera whose
    /// parent was not seen yet.
    pub fn set_world_poses(
        &mut self,
        poses: &(impl Poses + ?Sized),
        env_ids: Option<&[usize]>,
        convention: CameraConvention,
    ) -> Result<(), SensorError> {
        let rows = self.chosen_rows(env_ids)?;
        let (attached, seen) = (self.is_attached(), &self.world_from_parent);
        Ok(self.viewpoints.set_world(&rows, poses, convention, |env| match seen[env] {
            None if attached => Err(CameraError::NothingCaptured { env }),
            world_from_parent => Ok(world_from_parent),
        })?)
    }

    /// Turns cameras to something: places each at `eye`, looking at `target`, in the frame of its parent (of the
    /// environment, for free ones), from the next picture on. See [`look_at_pose`](crate::camera::look_at_pose) for `up`;
    /// to look from an attached camera at a point of the environment, give what it makes to
    /// [`set_world_poses`](Self::set_world_poses).
    ///
    /// One `eye`, `target` and `up` for each of `env_ids` (`None` is all environments), or one for all \[m\].
    ///
    /// # Errors
    ///
    /// [`CameraError::LookAt`], [`CameraError::Count`], an environment that does not exist or that is named twice; nothing
    /// is changed then.
    pub fn look_at(
        &mut self,
        eye: &[[f64; 3]],
        target: &[[f64; 3]],
        up: &[[f64; 3]],
        env_ids: Option<&[usize]>,
    ) -> Result<(), SensorError> {
        let rows = self.chosen_rows(env_ids)?;
        Ok(self.viewpoints.look_at(&rows, eye, target, up)?)
    }

    /// Changes lenses from the next picture on: one for each of `env_ids` (`None` is all environments), or one for all.
    ///
    /// # Errors
    ///
    /// [`CameraError::Optics`], [`CameraError::Count`], an environment that does not exist or that is named twice; nothing is
    /// changed then.
    pub fn set_intrinsics(&mut self, intrinsics: &[Intrinsics], env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        let rows = self.chosen_rows(env_ids)?;
        let (height, width) = self.image_shape();
        Ok(self.viewpoints.set_intrinsics(&rows, intrinsics, (width, height), |_| Ok(()))?)
    }

    /// Places and lenses as they were configured, in `env_ids` (`None` is all environments), from the next picture on.
    ///
    /// # Errors
    ///
    /// An environment that does not exist or that is named twice; nothing is changed then.
    pub fn restore(&mut self, env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        let rows = self.chosen_rows(env_ids)?;
        self.viewpoints.restore(&rows);
        Ok(())
    }

    fn chosen_rows(&self, env_ids: Option<&[usize]>) -> Result<Vec<usize>, SensorError> {
        chosen_rows(self.viewpoints.len(), env_ids, |env| self.expected.check_envs(&[env]).map(|()| env))
    }
}
