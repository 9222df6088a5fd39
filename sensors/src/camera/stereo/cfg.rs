//! Stereo camera configuration.

use super::sensor::StereoCamera;
use crate::camera::cfg::CameraCfg;
use crate::camera::error::CameraError;
use crate::camera::extrinsics::{CameraConvention, Extrinsics, Placement, Poses};
use crate::camera::image_noise::for_channels;
use crate::camera::imperfection::Imperfections;
use crate::error::SensorError;
use crate::noise::NoiseCfg;
use crate::sensor::{SensorCfg, SensorContext};
use kinetoscope_render::Intrinsics;
use kinetoscope_render::Renderer;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::lens::Lens;
use kinetoscope_scene::Pose;
use kinetoscope_scene::StateFields;
use nalgebra::{Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Point of the stereo rig that the extrinsics place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum StereoOrigin {
    /// Midpoint between the cameras, with the axes of the left camera, as in EmbodiChain.
    #[default]
    Middle,
    /// Left camera, as in stereo calibrations.
    Left,
}

/// Configuration of a [`StereoCamera`]: a camera, and the differences of its right camera.
///
/// ```
/// use kinetoscope_sensors::camera::{CameraCfg, StereoCameraCfg};
/// use kinetoscope_render::frame::Channels;
///
/// let cfg = StereoCameraCfg {
///     camera: CameraCfg { channels: Channels::from_names(&["rgb", "depth"])?, ..CameraCfg::default() },
///     left_to_right_pos: [0.12, 0.0, 0.0],
///     ..StereoCameraCfg::default()
/// };
/// # Ok::<(), kinetoscope_sensors::SensorError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StereoCameraCfg {
    /// The left camera, and everything common to both cameras: size, range, rate, renderer. Its extrinsics place
    /// [`origin`](Self::origin).
    pub camera: CameraCfg,
    /// Focal lengths and principal point of the right camera; `None` uses those of the left camera.
    pub intrinsics_right: Option<Intrinsics>,
    /// Lens of the right camera, as [`CameraCfg::lens`]; `None` uses that of the left camera.
    pub lens_right: Option<Lens>,
    /// Channels of the right camera; `None` uses those of the left camera.
    pub channels_right: Option<Channels>,
    /// Imperfections of the right camera, as [`CameraCfg::imperfections`]; `None` uses those of the left camera, for
    /// the channels that the right camera measures. The [baseline](crate::camera::imperfection::Holes::baseline) of a
    /// projector is relative to each camera.
    pub imperfections_right: Option<Imperfections>,
    /// Noise of the right camera, as [`CameraCfg::noise`]; `None` uses that of the left camera, for the channels that
    /// the right camera measures. The random numbers of both cameras are independent.
    pub noise_right: Option<BTreeMap<String, NoiseCfg>>,
    /// Position of the right camera in the optical frame of the left camera (x right, y down, z forward) \[m\],
    /// independent of the convention of the extrinsics.
    pub left_to_right_pos: [f64; 3],
    /// Orientation of the right camera in the optical frame of the left camera: the rotation maps vectors of the right
    /// optical frame to the left one.
    #[serde(with = "kinetoscope_scene::file_format::rotation")]
    pub left_to_right_rot: UnitQuaternion<f64>,
    /// Point of the rig that the extrinsics place.
    pub origin: StereoOrigin,
}

impl Default for StereoCameraCfg {
    /// EmbodiChain's stereo camera: two of its cameras side by side, 5 cm apart, placed by their midpoint.
    fn default() -> Self {
        Self {
            camera: CameraCfg::default(),
            intrinsics_right: None,
            lens_right: None,
            channels_right: None,
            imperfections_right: None,
            noise_right: None,
            left_to_right_pos: [0.05, 0.0, 0.0],
            left_to_right_rot: UnitQuaternion::identity(),
            origin: StereoOrigin::Middle,
        }
    }
}

/// Offset between the path tracing seeds of the two cameras: 2^32 over the golden ratio, far from the small steps that
/// users choose between seeds.
const RIGHT_SEED: u32 = 0x9e37_79b9;

/// Relative poses of the two cameras and of the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rig {
    pub(super) left_from_right: Pose,
    pub(super) origin_from_left: Pose,
}

impl StereoCameraCfg {
    /// Returns the relative poses.
    ///
    /// # Errors
    ///
    /// [`CameraError::Pose`] for an invalid pose of the right camera.
    pub(super) fn rig(&self) -> Result<Rig, CameraError> {
        let [x, y, z] = self.left_to_right_pos;
        let pose = Pose::from_parts(Translation3::new(x, y, z), self.left_to_right_rot);
        // Checks the pose and normalizes its quaternion.
        let left_from_right = pose.to_poses()?.first().copied().unwrap_or(pose);
        let origin_from_left = match self.origin {
            StereoOrigin::Left => Pose::identity(),
            StereoOrigin::Middle => Pose::translation(-0.5 * x, -0.5 * y, -0.5 * z),
        };
        Ok(Rig { left_from_right, origin_from_left })
    }

    /// Returns the configurations of the left and the right camera. With path tracing, the right camera gets another
    /// seed.
    ///
    /// # Errors
    ///
    /// [`CameraError::Pose`] for an invalid pose of the rig or of the right camera; [`CameraError::LookAt`] if eye and
    /// target of the rig coincide, or a number of eye, target or up is not finite.
    pub fn camera_cfgs(&self) -> Result<[CameraCfg; 2], CameraError> {
        let Rig { left_from_right, origin_from_left } = self.rig()?;
        let left = self.camera.extrinsics.parent_from_camera()? * origin_from_left;
        let at = |pose: Pose| {
            let placement = Placement::Pose { pos: pose.translation.into(), rotation: pose.rotation };
            let parent = self.camera.extrinsics.parent.clone();
            Extrinsics { parent, placement, convention: CameraConvention::Ros }
        };
        let channels = self.channels_right.unwrap_or(self.camera.channels);
        let (imperfections, noise) = (self.imperfections_right.as_ref(), self.noise_right.as_ref());
        let right = CameraCfg {
            intrinsics: self.intrinsics_right.unwrap_or(self.camera.intrinsics),
            lens: self.lens_right.unwrap_or(self.camera.lens),
            channels,
            imperfections: imperfections.cloned().unwrap_or_else(|| self.camera.imperfections.of_channels(channels)),
            noise: noise.cloned().unwrap_or_else(|| for_channels(&self.camera.noise, channels)),
            extrinsics: at(left * left_from_right),
            renderer: match self.camera.renderer {
                Renderer::RayTraced { samples, max_bounces, denoise, seed } => {
                    Renderer::RayTraced { samples, max_bounces, denoise, seed: seed.wrapping_add(RIGHT_SEED) }
                }
                other => other,
            },
            ..self.camera.clone()
        };
        Ok([CameraCfg { extrinsics: at(left), ..self.camera.clone() }, right])
    }
}

impl SensorCfg for StereoCameraCfg {
    type Sensor = StereoCamera;

    fn requires(&self) -> StateFields {
        self.camera.requires()
    }

    fn debug_vis(&self) -> bool {
        self.camera.debug_vis
    }

    /// # Errors
    ///
    /// An invalid pose of the stereo rig (`camera.extrinsics`), or of the right camera relative to the left.
    /// [`SensorError::StereoCamera`] for any other error in the configuration of one camera; it names the camera.
    fn build(&self, context: &SensorContext) -> Result<StereoCamera, SensorError> {
        let [left, right] = self.camera_cfgs()?;
        // Noise and dropout are keyed by the name of the sensor, so the cameras need different names. Path tracing
        // noise is keyed by the seed of the renderer, which `camera_cfgs` changes.
        let name = format!("{}/right", context.name).into();
        let other = SensorContext { name, ..context.clone() };
        let [left, right] = [("left", left.build(context)), ("right", right.build(&other))]
            .map(|(side, camera)| camera.map_err(SensorError::of_stereo_camera(side)));
        Ok(StereoCamera::new(left?, right?, self.rig()?))
    }
}
