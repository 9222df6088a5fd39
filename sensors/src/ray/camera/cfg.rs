//! What a camera made of rays is, before it exists.

use super::sensor::{Lens, RayCasterCamera};
use crate::camera::{DepthMiss, Extrinsics, Intrinsics};
use crate::error::SensorError;
use crate::ray::caster::scan::Scan;
use crate::ray::{HitTargets, Ray, RayError, RayPattern, RayTargets};
use crate::schedule::Schedule;
use crate::sensor::{Requires, SensorCfg, SensorContext};

/// The most memory that the pictures may take \[bytes\].
const MAX_BYTES: u64 = 64 << 30;

/// Configuration of a [`RayCasterCamera`]: a pinhole camera that casts one ray through the centre of every pixel.
///
/// Against [`CameraCfg`](crate::CameraCfg) it measures only geometry, sees only what it is told to, and every number is
/// that of an exact ray. Where all of a scene is to be seen, the rasterizer is faster.
#[derive(Clone, Debug, PartialEq)]
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
    /// Time between pictures \[s\]; 0 is every physics step.
    pub update_period: f64,
    /// Take the nearest whole number of physics steps where the period is none, instead of an error.
    pub round_period: bool,
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
            update_period: 0.0,
            round_period: false,
        }
    }
}

impl SensorCfg for RayCasterCameraCfg {
    type Sensor = RayCasterCamera;

    /// Where things are; the poses of bodies only where it hangs on one.
    fn requires(&self) -> Requires {
        if self.extrinsics.parent.is_some() { Requires::INSTANCES | Requires::POSES } else { Requires::INSTANCES }
    }

    /// # Errors
    ///
    /// Sizes, lens, distance or placement that are no good; an unknown parent or target; a period that is no whole number
    /// of steps; pictures that do not fit into memory.
    fn build(&self, context: &SensorContext) -> Result<RayCasterCamera, SensorError> {
        let scene = context.scene.as_ref().ok_or(RayError::NoScene)?;
        let schedule = Schedule::new(self.update_period, context.dt, self.round_period)?;
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
        check_memory(context.num_envs, pixels)?;
        let lens = self.intrinsics.to_pixels(self.width, self.height)?;
        let parent_from_camera = self.extrinsics.parent_from_camera()?;
        let ray = |k: usize| {
            let (u, v) = ((k % self.width) as f64 + 0.5, (k / self.width) as f64 + 0.5);
            let d = nalgebra::Vector3::new((u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0).normalize();
            Ray { origin: [0.0; 3], direction: d.into() }
        };
        let rays = (0..pixels).map(ray).collect();
        let wanted = self.targets.select(scene, self.groups, parent, context)?;
        let scan = Scan::new(RayTargets::new(scene, wanted, &context.ray_assets), context.num_envs, context.threads);
        let lens = Lens { width: self.width, height: self.height, pixels: lens };
        Ok(RayCasterCamera::new(
            self,
            context,
            parent,
            (parent_from_camera, lens),
            rays,
            scan,
            schedule.phases(context.num_envs),
        ))
    }
}

/// Refuses what would end the process: an allocation that fails.
fn check_memory(envs: usize, rays: usize) -> Result<(), RayError> {
    // A hit of 40 bytes; depth, distance, normal and mask.
    const BYTES_PER_RAY: usize = 40 + 24;
    let bytes = rays.checked_mul(envs).and_then(|n| n.checked_mul(BYTES_PER_RAY)).filter(|&b| b as u64 <= MAX_BYTES);
    let granted = bytes.is_some_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok());
    if granted { Ok(()) } else { Err(RayError::Memory { envs, rays, limit: MAX_BYTES }) }
}
