//! What a pair of eyes is, before it exists.

use super::sensor::StereoCamera;
use crate::camera::cfg::CameraCfg;
use crate::camera::error::CameraError;
use crate::camera::extrinsics::{CameraConvention, Extrinsics, Placement, Poses};
use crate::camera::imperfection::Imperfections;
use crate::camera::picture_noise::of_channels;
use crate::error::SensorError;
use crate::noise::NoiseCfg;
use crate::sensor::{SensorCfg, SensorContext};
use kinetoscope_render::Intrinsics;
use kinetoscope_render::Renderer;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::lens::Lens;
use kinetoscope_scene::Pose;
use kinetoscope_scene::Requires;
use nalgebra::{Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Which point of the pair the extrinsics place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum StereoOrigin {
    /// The middle between the eyes, with the axes of the left eye: EmbodiChain's.
    #[default]
    Middle,
    /// The left eye: what calibrations of real pairs say.
    Left,
}

/// Configuration of a [`StereoCamera`]: a camera, and how its right eye differs from its left one.
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
    /// The left eye, and everything that both have in common: size, range, rate, renderer... Its extrinsics place
    /// [`origin`](Self::origin).
    pub camera: CameraCfg,
    /// Focal lengths and principal point of the right eye; `None` is the left one's.
    pub intrinsics_right: Option<Intrinsics>,
    /// The right eye's lens, as [`CameraCfg::lens`]; `None` is the left one's.
    pub lens_right: Option<Lens>,
    /// What the right eye measures; `None` is what the left one does.
    pub channels_right: Option<Channels>,
    /// What is not perfect about the right eye, as [`CameraCfg::imperfections`]; `None` is what the left one has, of the channels
    /// that the right one measures. A projector's [place](crate::camera::imperfection::Holes::baseline) is counted from each
    /// eye.
    pub imperfections_right: Option<Imperfections>,
    /// Noise of the right eye, as [`CameraCfg::noise`]; `None` is the left one's, of the channels that the right one measures.
    pub noise_right: Option<BTreeMap<String, NoiseCfg>>,
    /// Where the right eye is in the optical frame of the left one (x right, y down, z forward), whatever the convention of
    /// the extrinsics \[m\].
    pub left_to_right_pos: [f64; 3],
    /// How the right eye is turned against the left one: axes of its optical frame in that of the left eye.
    #[serde(with = "kinetoscope_scene::file_format::rotation")]
    pub left_to_right_rot: UnitQuaternion<f64>,
    /// What the extrinsics place.
    pub origin: StereoOrigin,
}

impl Default for StereoCameraCfg {
    /// EmbodiChain's pair: two of its cameras side by side, 5 cm apart, placed by their middle.
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

/// Between the seeds of paths of the eyes: 2^32 over the golden ratio, far from the small steps between seeds that people
/// choose.
const RIGHT_SEED: u32 = 0x9e37_79b9;

/// How the eyes of a pair stand to each other and to what places them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rig {
    pub(super) left_from_right: Pose,
    pub(super) origin_from_left: Pose,
}

impl StereoCameraCfg {
    /// The rig.
    ///
    /// # Errors
    ///
    /// [`CameraError::Pose`] for a pose of the right eye that is none.
    pub(super) fn rig(&self) -> Result<Rig, CameraError> {
        let [x, y, z] = self.left_to_right_pos;
        let pose = Pose::from_parts(Translation3::new(x, y, z), self.left_to_right_rot);
        // Checked, and its quaternion normalised.
        let left_from_right = pose.to_poses()?.first().copied().unwrap_or(pose);
        let origin_from_left = match self.origin {
            StereoOrigin::Left => Pose::identity(),
            StereoOrigin::Middle => Pose::translation(-0.5 * x, -0.5 * y, -0.5 * z),
        };
        Ok(Rig { left_from_right, origin_from_left })
    }

    /// The eyes as cameras of their own: left, right. Where paths are traced, the right one has a seed of its own.
    ///
    /// # Errors
    ///
    /// [`CameraError::Pose`] or [`CameraError::LookAt`] for places that are none.
    pub fn eyes(&self) -> Result<[CameraCfg; 2], CameraError> {
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
            noise: noise.cloned().unwrap_or_else(|| of_channels(&self.camera.noise, channels)),
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

    fn requires(&self) -> Requires {
        self.camera.requires()
    }

    fn debug_vis(&self) -> bool {
        self.camera.debug_vis
    }

    /// # Errors
    ///
    /// A place of the right eye that is none, and [`SensorError::Eye`] with what is wrong with either eye as a [`CameraCfg`].
    fn build(&self, context: &SensorContext) -> Result<StereoCamera, SensorError> {
        let [left, right] = self.eyes()?;
        // Noise and dropout are drawn by the name of the sensor: they must not be the same in both eyes. That of paths is by
        // the seed of the renderer, which `eyes` makes another one.
        let name = format!("{}/right", context.name).into();
        let other = SensorContext { name, ..context.clone() };
        let [left, right] = [("left", left.build(context)), ("right", right.build(&other))]
            .map(|(eye, camera)| camera.map_err(SensorError::of_eye(eye)));
        Ok(StereoCamera::new(left?, right?, self.rig()?))
    }
}
