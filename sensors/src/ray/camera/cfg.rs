//! Ray-caster camera configuration.

use super::pixels::Pixels;
use super::sensor::RayCasterCamera;
use crate::camera::env_rows::EnvRows;
use crate::camera::viewpoints::{Viewpoint, Viewpoints};
use crate::camera::{CameraError, DepthMiss, Extrinsics};
use crate::error::SensorError;
use crate::ray::sampler::{RaySampler, RaySamplerCfg, check_memory};
use crate::ray::{HitTargets, RayError, RayPattern};
use crate::sampling::{SampleChannel, SamplingCfg};
use crate::schedule::Schedule;
use crate::sensor::{SensorCfg, SensorContext};
use kinetoscope_render::Intrinsics;
use kinetoscope_render::lens::Lens;
use kinetoscope_render::lens::LensRayTables;
use kinetoscope_scene::StateFields;
use serde::{Deserialize, Serialize};

/// Memory per ray \[bytes\]: a hit of 40 bytes; five numbers of the sampler; depth, distance, normal and mask.
const BYTES_PER_RAY: usize = 40 + 40 + 24;

/// Configuration of a [`RayCasterCamera`]: a pinhole camera that casts one ray through the center of every pixel.
///
/// Unlike [`CameraCfg`](crate::camera::CameraCfg), it measures only the geometry of the chosen targets, and every value
/// comes from an exact ray. For images of a whole scene, a [`CameraCfg`](crate::camera::CameraCfg) is faster.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RayCasterCameraCfg {
    /// Image width \[pixels\].
    pub width: usize,
    /// Image height \[pixels\].
    pub height: usize,
    /// Focal lengths and principal point.
    pub intrinsics: Intrinsics,
    /// Pose of the camera, and the body that it is attached to.
    pub extrinsics: Extrinsics,
    /// Maximum distance of a hit along the ray \[m\], above 0 and finite in single precision.
    pub max_distance: f64,
    /// Value of depth and distance where nothing is hit; [`DepthMiss::Far`] is `max_distance`.
    pub depth_miss: DepthMiss,
    /// Targets of the rays.
    pub targets: HitTargets,
    /// Geom groups of the targets: bit k is group k; by default groups 0, 1 and 2.
    pub groups: u32,
    /// Rate, history, latency, dropout and noise. Only the channel `distances` can have noise. It is the distance along
    /// the ray of each pixel \[m\]; depth and points are computed from it. Noisy distances are clamped to the range
    /// from 0 to `max_distance`.
    ///
    /// Normals, masks and misses are exact: hits stay hits and misses stay misses. With [`DepthMiss::Far`], the mask
    /// distinguishes a hit at `max_distance` from a miss. The history and images in flight are in double precision: 40
    /// bytes for each pixel and image.
    pub sampling: SamplingCfg,
    /// Shows the camera's frame and an arrow along each edge of its view frustum
    /// ([`Sensor::markers`](crate::Sensor::markers)).
    pub debug_vis: bool,
}

impl Default for RayCasterCameraCfg {
    /// 160 by 120 pixels with Isaac's default intrinsics; all targets except the parent body, up to 1000 km.
    fn default() -> Self {
        Self {
            width: 160,
            height: 120,
            intrinsics: Intrinsics::ISAAC,
            extrinsics: Extrinsics::default(),
            max_distance: 1e6,
            depth_miss: DepthMiss::Inf,
            targets: HitTargets::default(),
            groups: 0b111,
            sampling: SamplingCfg::default(),
            debug_vis: false,
        }
    }
}

impl SensorCfg for RayCasterCameraCfg {
    type Sensor = RayCasterCamera;

    /// Poses of instances; body poses only if the camera is attached to a body.
    fn requires(&self) -> StateFields {
        if self.extrinsics.parent.is_some() {
            StateFields::INSTANCES | StateFields::POSES
        } else {
            StateFields::INSTANCES
        }
    }

    fn debug_vis(&self) -> bool {
        self.debug_vis
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.sampling.lazy_schedule(dt)
    }

    /// # Errors
    ///
    /// An invalid size, intrinsics, distance or pose; an unknown parent or target; a period that is not a whole number
    /// of steps or another invalid sampling parameter; images that do not fit into memory.
    fn build(&self, context: &SensorContext) -> Result<RayCasterCamera, SensorError> {
        let parent = self.extrinsics.parent.as_deref().map(|name| context.body(name)).transpose()?;
        if !(self.max_distance > 0.0 && self.max_distance < f64::from(f32::MAX)) {
            let (what, owner, value) = ("max_distance", "ray caster camera", self.max_distance);
            return Err(
                RayError::Number { what, owner, value, allowed: "positive, and a number in single precision" }.into()
            );
        }
        let pixels = self.width.checked_mul(self.height).filter(|n| (1..=RayPattern::MAX_RAYS).contains(n));
        let Some(pixels) = pixels else {
            let count = self.width as f64 * self.height as f64;
            return Err(RayError::Count { pattern: "pixel", count, limit: RayPattern::MAX_RAYS }.into());
        };
        check_memory(context.num_envs, pixels, BYTES_PER_RAY)?;
        let viewpoint = Viewpoint {
            parent_from_camera: self.extrinsics.parent_from_camera()?,
            pixels: self.intrinsics.to_pixels(self.width, self.height)?,
        };
        let cfg = RaySamplerCfg {
            kind: "ray caster camera",
            requires: self.requires(),
            sampling: &self.sampling,
            targets: &self.targets,
            groups: self.groups,
            parent,
            rays: Pixels { width: self.width, height: self.height },
            max_distance: self.max_distance,
            frame_channels: &[SampleChannel::noiseless("poses", 7), SampleChannel::noiseless("lenses", 4)],
        };
        let rays = RaySampler::new(cfg, context)?;
        let (size, envs) = ([self.width, self.height], EnvRows::for_all(context.num_envs));
        let lens =
            LensRayTables::new(Lens::default(), &viewpoint.pixels, size, 1, envs.len()).map_err(CameraError::from)?;
        Ok(RayCasterCamera::new(self, context, rays, Viewpoints::new(viewpoint, size, lens, envs, parent)))
    }
}
