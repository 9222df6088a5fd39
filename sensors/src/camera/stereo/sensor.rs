//! Two cameras that move, measure and are late together.

use super::cfg::Rig;
use super::disparity::DisparityMap;
use crate::camera::error::CameraError;
use crate::camera::extrinsics::{CameraConvention, Poses};
use crate::camera::sensor::Camera;
use crate::camera::viewpoints::chosen_rows;
use crate::error::SensorError;
use crate::sensor::Sensor;
use kinetoscope_render::intrinsics::Intrinsics;
use kinetoscope_scene::pose::{from_row, to_row};
use kinetoscope_scene::{Marker, Pose, SceneState};
use ndarray::Array2;
use std::fmt;
use std::sync::{Mutex, OnceLock, PoisonError};

/// A pair of eyes in each of several environments: two [`Camera`]s on one rig.
///
/// Each eye is a camera with everything a camera has: channels of the same names, types and shapes, drawn when somebody
/// reads them, of the instant that [`Camera::stamps`] tells. `stereo.left().depth()?` is the left eye's depth,
/// `stereo.right().color()?` the right eye's colour, [`disparity`](Self::disparity) what both tell together. Eyes are moved
/// by their rig only.
pub struct StereoCamera {
    left: Camera,
    right: Camera,
    pub(super) rig: Rig,
    /// What was computed of the pictures shown now.
    pub(super) shown: OnceLock<DisparityMap>,
    /// What was computed before: its memory is kept.
    spare: Mutex<DisparityMap>,
}

impl StereoCamera {
    pub(super) fn new(left: Camera, right: Camera, rig: Rig) -> Self {
        Self { left, right, rig, shown: OnceLock::new(), spare: Mutex::default() }
    }

    /// The left eye.
    pub fn left(&self) -> &Camera {
        &self.left
    }

    /// The right eye.
    pub fn right(&self) -> &Camera {
        &self.right
    }

    /// The optical frame of the right eye in that of the left one.
    pub fn left_from_right(&self) -> Pose {
        self.rig.left_from_right
    }

    /// Poses of the rig's [origin](super::StereoOrigin) in the environment at the captured instant, as
    /// [`Camera::pose_w`]. Those of the eyes are `left().pose_w(..)` and `right().pose_w(..)`.
    pub fn pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        self.origins(&self.left.pose_w(CameraConvention::Ros), convention)
    }

    /// Poses of the rig's [origin](super::StereoOrigin) in the frame of the parent, as [`Camera::local_pose`].
    pub fn local_pose(&self, convention: CameraConvention) -> Array2<f64> {
        self.origins(&self.left.local_pose(CameraConvention::Ros), convention)
    }

    /// Where origins are, given where left eyes are.
    fn origins(&self, left: &Array2<f64>, convention: CameraConvention) -> Array2<f64> {
        let left_from_origin = self.rig.origin_from_left.inverse();
        let rows = left.rows().into_iter().map(|row| {
            let pose: [f64; 7] = std::array::from_fn(|k| row[k]);
            // No pose yet is no pose here either.
            if pose.iter().any(|x| x.is_nan()) {
                return [f64::NAN; 7];
            }
            to_row(&convention.of_optical(&(from_row(&pose) * left_from_origin)))
        });
        Array2::from(rows.collect::<Vec<[f64; 7]>>())
    }

    /// Places rigs in the frame of their parent (of the environment, for free ones), by their
    /// [origin](super::StereoOrigin): as [`Camera::set_local_pose`].
    ///
    /// # Errors
    ///
    /// As [`Camera::set_local_pose`]; nothing is changed then.
    pub fn set_local_pose(
        &mut self,
        poses: &(impl Poses + ?Sized),
        env_ids: Option<&[usize]>,
        convention: CameraConvention,
    ) -> Result<(), SensorError> {
        let [lefts, rights] = self.eyes_of(poses, convention)?;
        self.both(|left, right| {
            left.set_local_pose(&lefts, env_ids, CameraConvention::Ros)?;
            right.set_local_pose(&rights, env_ids, CameraConvention::Ros)
        })
    }

    /// Places rigs in the environment, by their [origin](super::StereoOrigin): as [`Camera::set_world_poses`].
    ///
    /// # Errors
    ///
    /// As [`Camera::set_world_poses`]; nothing is changed then.
    pub fn set_world_poses(
        &mut self,
        poses: &(impl Poses + ?Sized),
        env_ids: Option<&[usize]>,
        convention: CameraConvention,
    ) -> Result<(), SensorError> {
        let [lefts, rights] = self.eyes_of(poses, convention)?;
        self.both(|left, right| {
            left.set_world_poses(&lefts, env_ids, CameraConvention::Ros)?;
            right.set_world_poses(&rights, env_ids, CameraConvention::Ros)
        })
    }

    /// Turns rigs to something: places the [origin](super::StereoOrigin) of each at `eye`, the left eye's optical axis
    /// parallel to the line from there to `target`: as [`Camera::look_at`].
    ///
    /// # Errors
    ///
    /// As [`Camera::look_at`]; nothing is changed then.
    pub fn look_at(
        &mut self,
        eye: &[[f64; 3]],
        target: &[[f64; 3]],
        up: &[[f64; 3]],
        env_ids: Option<&[usize]>,
    ) -> Result<(), SensorError> {
        let Rig { left_from_right, origin_from_left } = self.rig;
        self.both(|left, right| {
            left.look_at(eye, target, up, env_ids)?;
            let rows = chosen_rows(left.env_ids().len(), env_ids, |env| left.row(env))?;
            let lefts: Vec<Pose> =
                rows.iter().map(|&row| left.viewpoints.row(row).parent_from_camera * origin_from_left).collect();
            let rights: Vec<Pose> = lefts.iter().map(|pose| pose * left_from_right).collect();
            left.set_local_pose(&lefts, env_ids, CameraConvention::Ros)?;
            right.set_local_pose(&rights, env_ids, CameraConvention::Ros)
        })
    }

    /// Changes lenses, `right` of the right eyes (`None`: as the left ones): as [`Camera::set_intrinsics`].
    ///
    /// # Errors
    ///
    /// [`SensorError::Eye`] with those of [`Camera::set_intrinsics`]; nothing is changed then.
    pub fn set_intrinsics(
        &mut self,
        left: &[Intrinsics],
        right: Option<&[Intrinsics]>,
        env_ids: Option<&[usize]>,
    ) -> Result<(), SensorError> {
        self.both(|left_eye, right_eye| {
            left_eye.set_intrinsics(left, env_ids).map_err(SensorError::of_eye("left"))?;
            right_eye.set_intrinsics(right.unwrap_or(left), env_ids).map_err(SensorError::of_eye("right"))
        })
    }

    /// Places and lenses as they were configured: as [`Camera::restore`].
    ///
    /// # Errors
    ///
    /// As [`Camera::restore`]; nothing is changed then.
    pub fn restore(&mut self, env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        self.both(|left, right| {
            left.restore(env_ids)?;
            right.restore(env_ids)
        })
    }

    /// Where the eyes of rigs are, left and right, given where their origins are.
    fn eyes_of(
        &self,
        origins: &(impl Poses + ?Sized),
        convention: CameraConvention,
    ) -> Result<[Vec<Pose>; 2], CameraError> {
        let Rig { left_from_right, origin_from_left } = self.rig;
        let origins = origins.to_poses()?;
        let lefts: Vec<Pose> = origins.iter().map(|pose| convention.to_optical(pose) * origin_from_left).collect();
        let rights = lefts.iter().map(|pose| pose * left_from_right).collect();
        Ok([lefts, rights])
    }

    /// Changes both eyes, or none.
    fn both(
        &mut self,
        change: impl FnOnce(&mut Camera, &mut Camera) -> Result<(), SensorError>,
    ) -> Result<(), SensorError> {
        let eyes = [&self.left, &self.right];
        let before = eyes.map(|eye| (eye.viewpoints.clone(), eye.rays.clone()));
        let result = change(&mut self.left, &mut self.right);
        if result.is_err() {
            [(self.left.viewpoints, self.left.rays), (self.right.viewpoints, self.right.rays)] = before;
        } else {
            // What was held for the case of failure is not needed any more.
            drop(before);
            self.left.rays.forget();
            self.right.rays.forget();
        }
        self.outdate();
        result
    }

    /// What was computed may be of other pictures than those shown.
    fn outdate(&mut self) {
        if let Some(map) = self.shown.take() {
            *self.spare.get_mut().unwrap_or_else(PoisonError::into_inner) = map;
        }
    }

    /// The memory of what was computed before.
    pub(super) fn take_spare(&self) -> DisparityMap {
        std::mem::take(&mut *self.spare.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Sensor for StereoCamera {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.outdate();
        self.left.update(state)?;
        self.right.update(state)
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.outdate();
        self.left.reset(env_ids, state)?;
        self.right.reset(env_ids, state)
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.outdate();
        self.left.refresh(env_ids, state)?;
        self.right.refresh(env_ids, state)
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.left.due_in(step).min(self.right.due_in(step))
    }

    /// Those of both eyes.
    fn markers(&self, env: usize, pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let mut markers = self.left.markers(env, pose);
        markers.extend(self.right.markers(env, pose));
        markers
    }
}

/// Short, as that of a camera.
impl fmt::Debug for StereoCamera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StereoCamera")
            .field("left", &self.left)
            .field("right", &self.right)
            .field("left_from_right", &self.rig.left_from_right)
            .finish_non_exhaustive()
    }
}

impl fmt::Display for StereoCamera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.rig.left_from_right.translation.into();
        let angle = self.rig.left_from_right.rotation.angle().to_degrees();
        writeln!(f, "Stereo pair, the right eye at [{x}, {y}, {z}] m of the left one, turned by {angle} degrees")?;
        writeln!(f, "left:  {}", self.left)?;
        write!(f, "right: {}", self.right)
    }
}
