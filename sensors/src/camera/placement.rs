//! Setters of poses and intrinsics, shared by all camera sensors.

use super::env_rows::EnvRows;
use super::extrinsics::{CameraConvention, Poses, look_at_pose};
use super::viewpoints::one_each;
use crate::error::SensorError;
use kinetoscope_render::Intrinsics;
use kinetoscope_scene::Pose;
use ndarray::Array2;

/// Reference frame of given poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseFrame {
    /// Frame of the parent; of the environment for a free camera.
    Parent,
    /// Frame of the environment.
    Environment,
}

/// Operations of [`CameraPlacement`] that differ between sensors.
pub trait PlaceRows {
    /// Environments that the sensor sees.
    fn env_rows(&self) -> &EnvRows;

    /// Sets camera poses in optical axes (for a stereo camera: poses of the rig's origin): one for each of `rows`, or
    /// one for all. `rows` are rows of [`env_rows`](Self::env_rows), not environment indices.
    ///
    /// # Errors
    ///
    /// A wrong number of poses, an invalid pose, or, with [`PoseFrame::Environment`], a parent whose pose is unknown.
    /// Nothing is changed then.
    fn place_rows(&mut self, rows: &[usize], poses: &[Pose], frame: PoseFrame) -> Result<(), SensorError>;

    /// Restores the configured poses and intrinsics.
    fn restore_rows(&mut self, rows: &[usize]);
}

/// Pose and intrinsics of a camera sensor in each environment, settable at any time.
///
/// After a change, a [`Camera`](crate::camera::Camera) or a [`StereoCamera`](crate::camera::StereoCamera) renders the
/// captured state from the new pose at the next read. A [`RayCasterCamera`](crate::ray::RayCasterCamera) uses the new
/// pose from the next image on. A stereo camera is placed by the [origin](super::StereoOrigin) of its rig. Values
/// persist over a reset, until [`restore`](Self::restore).
pub trait CameraPlacement: PlaceRows {
    /// Poses of the cameras, or of the origin of a stereo rig, in the frame of the parent (of the environment, for a
    /// free camera), rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    fn local_pose(&self, convention: CameraConvention) -> Array2<f64>;

    /// Sets intrinsics: one for each of `env_ids` (`None` is all environments of the camera), or one for all. Both
    /// cameras of a stereo camera get them.
    ///
    /// # Errors
    ///
    /// [`CameraError::Optics`](super::CameraError::Optics), also if the lens does not support them;
    /// [`CameraError::View`](super::CameraError::View), [`CameraError::Count`](super::CameraError::Count), an
    /// environment that the camera does not see or that is named twice. Nothing is changed then.
    fn set_intrinsics(&mut self, intrinsics: &[Intrinsics], env_ids: Option<&[usize]>) -> Result<(), SensorError>;

    /// Sets poses in the frame of the parent (of the environment, for a free camera).
    ///
    /// `poses` are typed or rows `[x, y, z, qw, qx, qy, qz]` \[m\]: one for each of `env_ids` (`None` is all
    /// environments of the camera), or one for all. `convention` defines their axes.
    ///
    /// # Errors
    ///
    /// [`CameraError::Pose`](super::CameraError::Pose), [`CameraError::PoseColumns`](super::CameraError::PoseColumns),
    /// [`CameraError::Count`](super::CameraError::Count), an environment that the camera does not see or that is named
    /// twice. Nothing is changed then.
    fn set_local_pose(
        &mut self,
        poses: &(impl Poses + ?Sized),
        env_ids: Option<&[usize]>,
        convention: CameraConvention,
    ) -> Result<(), SensorError> {
        place_in(self, poses, env_ids, convention, PoseFrame::Parent)
    }

    /// Sets poses in the environment, with arguments as in [`set_local_pose`](Self::set_local_pose). An attached camera
    /// gets the local pose that puts it there at the captured instant, and moves with its parent from then on. For a
    /// ray-caster camera, this is the instant of the last ray cast.
    ///
    /// # Errors
    ///
    /// Same as [`set_local_pose`](Self::set_local_pose), and
    /// [`CameraError::NothingCaptured`](super::CameraError::NothingCaptured) for an attached camera whose parent was
    /// not captured yet.
    fn set_world_poses(
        &mut self,
        poses: &(impl Poses + ?Sized),
        env_ids: Option<&[usize]>,
        convention: CameraConvention,
    ) -> Result<(), SensorError> {
        place_in(self, poses, env_ids, convention, PoseFrame::Environment)
    }

    /// Places each camera at `eye`, looking at `target`, in the frame of its parent (of the environment, for a free
    /// camera). For a stereo camera, `eye` is its origin, and the left optical axis is parallel to the line to
    /// `target`.
    ///
    /// See [`look_at_pose`] for `up`; the pose of one environment never depends on another. To point an attached camera
    /// at a point of the environment, pass [`look_at_pose`] to [`set_world_poses`](Self::set_world_poses).
    ///
    /// One `eye`, `target` and `up` for each of `env_ids` (`None` is all environments of the camera), or one for all
    /// \[m\].
    ///
    /// # Errors
    ///
    /// [`CameraError::LookAt`](super::CameraError::LookAt), [`CameraError::Count`](super::CameraError::Count), an
    /// environment that the camera does not see or that is named twice. Nothing is changed then.
    fn look_at(
        &mut self,
        eye: &[[f64; 3]],
        target: &[[f64; 3]],
        up: &[[f64; 3]],
        env_ids: Option<&[usize]>,
    ) -> Result<(), SensorError> {
        let rows = self.env_rows().selected_rows(env_ids)?;
        let n = rows.len();
        let points =
            one_each("eye positions", eye, n)?.zip(one_each("targets", target, n)?).zip(one_each("up vectors", up, n)?);
        let poses: Result<Vec<Pose>, _> = points.map(|((eye, target), up)| look_at_pose(*eye, *target, *up)).collect();
        self.place_rows(&rows, &poses?, PoseFrame::Parent)
    }

    /// Restores the configured poses and intrinsics in `env_ids` (`None` is all environments of the camera).
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see or that is named twice. Nothing is changed then.
    fn restore(&mut self, env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        let rows = self.env_rows().selected_rows(env_ids)?;
        self.restore_rows(&rows);
        Ok(())
    }
}

fn place_in(
    camera: &mut (impl PlaceRows + ?Sized),
    poses: &(impl Poses + ?Sized),
    env_ids: Option<&[usize]>,
    convention: CameraConvention,
    frame: PoseFrame,
) -> Result<(), SensorError> {
    let rows = camera.env_rows().selected_rows(env_ids)?;
    let poses: Vec<Pose> = poses.to_poses()?.iter().map(|pose| convention.to_optical(pose)).collect();
    camera.place_rows(&rows, &poses, frame)
}
