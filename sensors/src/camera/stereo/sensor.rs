//! Stereo camera sensor.

use super::cfg::Rig;
use super::disparity::DisparityMap;
use crate::cached::Cached;
use crate::camera::env_rows::EnvRows;
use crate::camera::extrinsics::{CameraConvention, Poses};
use crate::camera::placement::{CameraPlacement, PlaceRows, PoseFrame};
use crate::camera::sensor::Camera;
use crate::error::SensorError;
use crate::sensor::Sensor;
use kinetoscope_render::Intrinsics;
use kinetoscope_scene::pose::{from_row, to_row};
use kinetoscope_scene::{Marker, Pose, SceneState};
use ndarray::Array2;
use std::fmt;

/// A stereo camera in each of several environments: two [`Camera`]s on one rig.
///
/// Each is a complete camera, with channels of the same names, types and shapes. Images are rendered on read and show
/// the instant of [`Camera::stamps`]. `stereo.left().depth()?` is the depth of the left camera,
/// `stereo.right().color()?` the color of the right camera, and [`disparity`](Self::disparity) combines both. The
/// cameras are placed by their rig only.
pub struct StereoCamera {
    left: Camera,
    right: Camera,
    pub(super) rig: Rig,
    pub(super) disparities: Cached<DisparityMap>,
}

impl StereoCamera {
    pub(super) fn new(left: Camera, right: Camera, rig: Rig) -> Self {
        Self { left, right, rig, disparities: Cached::outdated(DisparityMap::default()) }
    }

    /// The left camera, whose optical frame is the reference of the stereo pair.
    pub fn left(&self) -> &Camera {
        &self.left
    }

    /// The right camera.
    pub fn right(&self) -> &Camera {
        &self.right
    }

    /// Pose of the right optical frame in the left optical frame, as configured.
    pub fn left_from_right(&self) -> Pose {
        self.rig.left_from_right
    }

    /// Poses of the rig's [origin](super::StereoOrigin) in the environment at the captured instant, as
    /// [`Camera::pose_w`]. The poses of the cameras are `left().pose_w(..)` and `right().pose_w(..)`.
    pub fn pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        self.rig_origins(&self.left.pose_w(CameraConvention::Ros), convention)
    }

    /// Returns the poses of the origins from poses of the left cameras in optical axes; NaN for unknown poses.
    fn rig_origins(&self, left: &Array2<f64>, convention: CameraConvention) -> Array2<f64> {
        let left_from_origin = self.rig.origin_from_left.inverse();
        let rows = left.rows().into_iter().map(|row| {
            let pose: [f64; 7] = std::array::from_fn(|k| row[k]);
            // NaN marks an unknown pose.
            if pose.iter().any(|x| x.is_nan()) {
                return [f64::NAN; 7];
            }
            to_row(&convention.pose_from_optical(&(from_row(&pose) * left_from_origin)))
        });
        Array2::from(rows.collect::<Vec<[f64; 7]>>())
    }

    /// Sets different intrinsics for the left and the right camera, with arguments as in
    /// [`CameraPlacement::set_intrinsics`].
    ///
    /// # Errors
    ///
    /// [`SensorError::StereoCamera`] with the errors of [`CameraPlacement::set_intrinsics`]. Nothing is changed then.
    pub fn set_left_right_intrinsics(
        &mut self,
        left: &[Intrinsics],
        right: &[Intrinsics],
        env_ids: Option<&[usize]>,
    ) -> Result<(), SensorError> {
        self.change_both(|left_eye, right_eye| {
            left_eye.set_intrinsics(left, env_ids).map_err(SensorError::of_stereo_camera("left"))?;
            right_eye.set_intrinsics(right, env_ids).map_err(SensorError::of_stereo_camera("right"))
        })
    }

    /// Changes both cameras; an error restores both.
    fn change_both(
        &mut self,
        change: impl FnOnce(&mut Camera, &mut Camera) -> Result<(), SensorError>,
    ) -> Result<(), SensorError> {
        let eyes = [&self.left, &self.right];
        let before = eyes.map(|eye| eye.viewpoints.clone());
        let result = change(&mut self.left, &mut self.right);
        if result.is_err() {
            [self.left.viewpoints, self.right.viewpoints] = before;
        } else {
            // The copies for the error case are not needed any more.
            drop(before);
            self.left.viewpoints.free_unused_rays();
            self.right.viewpoints.free_unused_rays();
        }
        self.invalidate();
        result
    }

    /// Marks the disparities as outdated, because other images may be shown.
    fn invalidate(&mut self) {
        self.disparities.invalidate();
    }
}

/// Places the rig by its origin. An error changes neither camera.
impl PlaceRows for StereoCamera {
    fn env_rows(&self) -> &EnvRows {
        self.left.env_rows()
    }

    fn place_rows(&mut self, rows: &[usize], poses: &[Pose], frame: PoseFrame) -> Result<(), SensorError> {
        let Rig { left_from_right, origin_from_left } = self.rig;
        let lefts: Vec<Pose> = poses.iter().map(|origin| origin * origin_from_left).collect();
        let rights: Vec<Pose> = lefts.iter().map(|left| left * left_from_right).collect();
        let (lefts, rights) = (lefts.to_poses()?, rights.to_poses()?);
        self.change_both(|left, right| {
            left.place_rows(rows, &lefts, frame)?;
            right.place_rows(rows, &rights, frame)
        })
    }

    fn restore_rows(&mut self, rows: &[usize]) {
        self.left.restore_rows(rows);
        self.right.restore_rows(rows);
        self.invalidate();
    }
}

impl CameraPlacement for StereoCamera {
    fn local_pose(&self, convention: CameraConvention) -> Array2<f64> {
        self.rig_origins(&self.left.local_pose(CameraConvention::Ros), convention)
    }

    fn set_intrinsics(&mut self, intrinsics: &[Intrinsics], env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        self.set_left_right_intrinsics(intrinsics, intrinsics, env_ids)
    }
}

impl Sensor for StereoCamera {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.invalidate();
        self.left.update(state)?;
        self.right.update(state)
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.invalidate();
        self.left.reset(env_ids, state)?;
        self.right.reset(env_ids, state)
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.invalidate();
        self.left.refresh(env_ids, state)?;
        self.right.refresh(env_ids, state)
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.left.due_in(step).min(self.right.due_in(step))
    }

    /// Markers of both cameras.
    fn markers(&self, env: usize, pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let mut markers = self.left.markers(env, pose);
        markers.extend(self.right.markers(env, pose));
        markers
    }
}

/// Short, as for a camera.
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
        writeln!(
            f,
            "Stereo camera, the right camera at [{x}, {y}, {z}] m in the frame of the left one, rotated by {angle} degrees"
        )?;
        writeln!(f, "left:  {}", self.left)?;
        write!(f, "right: {}", self.right)
    }
}
