//! What a camera made of rays is, before it exists.

use super::pixels::Pixels;
use super::sensor::RayCasterCamera;
use crate::camera::env_rows::EnvRows;
use crate::camera::viewpoints::{Viewpoint, Viewpoints};
use crate::camera::{CameraError, DepthMiss, Extrinsics};
use crate::error::SensorError;
use crate::ray::sampler::{RaySampler, RaySamplerCfg, check_memory};
use crate::ray::{HitTargets, RayError, RayPattern};
use crate::sampling::{Channel, SamplingCfg};
use crate::schedule::Schedule;
use crate::sensor::{SensorCfg, SensorContext};
use kinetoscope_render::Intrinsics;
use kinetoscope_render::lens::Lens;
use kinetoscope_render::lens::RaysOfRows;
use kinetoscope_scene::Requires;
use serde::{Deserialize, Serialize};

/// A hit of 40 bytes; five numbers of the sampler; depth, distance, normal and mask.
const BYTES_PER_RAY: usize = 40 + 40 + 24;

/// Configuration of a [`RayCasterCamera`]: a pinhole camera that casts one ray through the centre of every pixel.
///
/// Unlike [`CameraCfg`](crate::camera::CameraCfg) it measures only geometry, of the chosen targets, and every number is that of
/// an exact ray. Where all of a scene is to be seen, the rasterizer is faster.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RayCasterCameraCfg {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The lens.
    pub intrinsics: Intrinsics,
    /// Where it is.
    pub extrinsics: Extrinsics,
    /// Nothing farther away is seen, along the ray \[m\].
    pub max_distance: f64,
    /// What depth and distance say where nothing is hit; [`DepthMiss::Far`] is `max_distance`.
    pub depth_miss: DepthMiss,
    /// What is hit.
    pub targets: HitTargets,
    /// Geom groups that are hit: bit k is group k.
    pub groups: u32,
    /// Rate, history, latency and noise. The channel that may have noise is `distances`: the distance along the ray of each
    /// pixel \[m\], from which depth and points follow. With noise it is from 0 to `max_distance` still: what comes out beyond
    /// saturates. Normals, masks and misses are exact: what is hit stays a hit, what is missed a miss, and the mask tells a hit
    /// at `max_distance` from a [`DepthMiss::Far`]. The numbers of the history and of pictures on their way are in double
    /// precision: 40 bytes for each pixel and picture.
    pub sampling: SamplingCfg,
    /// Show where it is and what it sees: its frame, and an arrow along each edge of the picture's pyramid
    /// ([`Sensor::markers`](crate::Sensor::markers)).
    pub debug_vis: bool,
}

impl Default for RayCasterCameraCfg {
    /// 160 by 120 pixels behind Isaac's default lens; everything but what it hangs on, up to 1000 km.
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

    /// Where things are; the poses of bodies only where it hangs on one.
    fn requires(&self) -> Requires {
        if self.extrinsics.parent.is_some() { Requires::INSTANCES | Requires::POSES } else { Requires::INSTANCES }
    }

    fn debug_vis(&self) -> bool {
        self.debug_vis
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.sampling.lazy_schedule(dt)
    }

    /// # Errors
    ///
    /// Sizes, lens, distance or placement that are no good; an unknown parent or target; a period that is no whole number
    /// of steps and what else is wrong with the sampling; pictures that do not fit into memory.
    fn build(&self, context: &SensorContext) -> Result<RayCasterCamera, SensorError> {
        let parent = self.extrinsics.parent.as_deref().map(|name| context.body(name)).transpose()?;
        if !(self.max_distance > 0.0 && self.max_distance < f64::from(f32::MAX)) {
            let (what, of, value) = ("max_distance", "ray caster camera", self.max_distance);
            return Err(
                RayError::Number { what, of, value, allowed: "positive, and a number in single precision" }.into()
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
            frame_channels: &[Channel::exact("poses", 7), Channel::exact("lenses", 4)],
        };
        let rays = RaySampler::new(cfg, context)?;
        let (size, envs) = ([self.width, self.height], EnvRows::all(context.num_envs));
        let lens =
            RaysOfRows::new(Lens::default(), &viewpoint.pixels, size, 1, envs.len()).map_err(CameraError::from)?;
        Ok(RayCasterCamera::new(self, context, rays, Viewpoints::new(viewpoint, size, lens, envs, parent)))
    }
}
