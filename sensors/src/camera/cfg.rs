//! What a camera is, before it exists.

use super::error::CameraError;
use super::extrinsics::Extrinsics;
use super::faults::Faults;
use super::imperfection::Imperfections;
use super::memory::Memory;
use super::opening::Opening;
use super::sensor::{Camera, Lens};
use crate::error::SensorError;
use crate::noise::NoiseCfg;
use crate::schedule::Schedule;
use crate::sensor::{Requires, SensorCfg, SensorContext};
use kinetoscope_render::aperture::Aperture;
use kinetoscope_render::frame::{Channels, Pictures};
use kinetoscope_render::intrinsics::{Intrinsics, PixelIntrinsics};
use kinetoscope_render::lens;
use kinetoscope_render::lens::RaysOfRows;
use kinetoscope_render::path::film::Film;
use kinetoscope_render::rasterizer::RasterCfg;
use kinetoscope_render::renderer::Renderer;
use kinetoscope_render::shade::plan::{check_light, check_occlusion};
use kinetoscope_render::shutter::Shutter;
use kinetoscope_render::visibility::RenderError;
use kinetoscope_scene::{Light, PoseF32};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The most memory that the pictures of a camera may take \[bytes\].
const MAX_BYTES: u64 = 64 << 30;
/// What a capture takes besides poses and lamps, at most \[bytes\]: its place, its lens, its stamp, its ticket.
const CAPTURE: usize = 512;

/// What depth and distance say where nothing is hit between the near and the far plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DepthMiss {
    /// +inf.
    #[default]
    Inf,
    /// The depth of the far plane; the same number in the distance channel. What was hit is nearer, with noise too: by the last
    /// digit of single precision, at least (depth is, and distance behind lenses whose rays do not all go
    /// [forward](lens::Lens::is_forward)).
    Far,
    /// 0.
    Zero,
}

/// Configuration of a [`Camera`].
///
/// ```
/// use kinetoscope_sensors::camera::{CameraCfg, Channels, Extrinsics, Intrinsics, Placement};
///
/// let cfg = CameraCfg {
///     width: 320,
///     height: 240,
///     intrinsics: Intrinsics::Fovy { radians: 0.9 },
///     extrinsics: Extrinsics {
///         placement: Placement::LookAt { eye: [1.5, 0.0, 1.0], target: [0.0; 3], up: [0.0, 0.0, 1.0] },
///         ..Extrinsics::default()
///     },
///     channels: Channels::from_names(&["rgb", "distance_to_image_plane"])?,
///     ..CameraCfg::default()
/// };
/// assert!(cfg.channels.color && cfg.channels.depth);
/// # Ok::<(), kinetoscope_sensors::SensorError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraCfg {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal lengths and principal point.
    pub intrinsics: Intrinsics,
    /// The lens: which way the rays of pixels go. Lenses other than a pinhole need a renderer that follows rays.
    pub lens: lens::Lens,
    /// The size of the lens, for depth of field; `None` is a point. Needs [`Renderer::RayTraced`].
    pub aperture: Option<Aperture>,
    /// When light falls on which row, for rolling shutters and motion blur; by default a picture is of one instant. Needs
    /// [`Renderer::RayTraced`]. The first picture after a reset or after somebody wrote to the state is of one instant.
    pub shutter: Shutter,
    /// Nothing nearer is seen: smallest depth along the optical axis \[m\], or along the ray where rays of the lens do not all
    /// go forward ([`Lens::is_forward`](lens::Lens::is_forward)).
    pub near: f64,
    /// Nothing farther is seen: largest depth along the optical axis \[m\], or along the ray, as [`near`](Self::near).
    pub far: f64,
    /// Where it is.
    pub extrinsics: Extrinsics,
    /// Time between pictures \[s\]; 0 is every physics step.
    pub update_period: f64,
    /// Take the nearest whole number of physics steps where the period is none, instead of an error.
    pub round_period: bool,
    /// What it measures.
    pub channels: Channels,
    /// What depth and distance say where nothing is hit.
    pub depth_miss: DepthMiss,
    /// Which renderer draws pictures.
    pub renderer: Renderer,
    /// How pictures are drawn.
    pub raster: RasterCfg,
    /// The environments that it looks into, in this order; `None` is all of them.
    pub env_ids: Option<Vec<usize>>,
    /// Draw when somebody reads (and only then), not when the picture is due. The pictures are the same: what there is
    /// to see is kept when it is due.
    pub lazy: bool,
    /// Pictures to remember, the newest included: see [`Camera::history`]. Those of a lazy camera are drawn when somebody
    /// looks at the history.
    pub history_length: usize,
    /// Physics steps from the capture of a picture until it can be read. It keeps the stamp of its capture. What somebody
    /// writes to the state of an environment is seen at once there, by every sensor: nothing stale is ever read.
    pub latency_steps: u32,
    /// Probability that a picture is lost on the way, 0 to 1: the one before stays.
    pub dropout: f64,
    /// Noise of numbers by the name of the channel, at every pixel by itself: of `depth` and `distance` \[m\], which is from
    /// `near` to `far` with it too (distance from `near` on) and leaves misses what they are, and of `color` in steps of its
    /// 8 bits, red, green and blue each by itself; results are rounded to bytes.
    ///
    /// The numbers depend on the seed of the simulation, the environment, the name of the camera, which picture it is and which
    /// pixel, and on nothing else. They are looked up: whether a camera is lazy, when somebody reads, and how many threads
    /// there are change nothing. A picture that is drawn again after a setter has the same noise again. Looking up where
    /// `bias_walk` has come to takes longer, the longer it walks: as many numbers as twice the binary digits of
    /// the count of pictures since the reset.
    pub noise: BTreeMap<String, NoiseCfg>,
    /// What is not perfect about the camera itself; it comes before [`noise`](Self::noise).
    pub imperfections: Imperfections,
    /// Show where it is and what it sees: its frame, and an arrow along each edge of the picture's pyramid
    /// ([`Sensor::markers`](crate::Sensor::markers)).
    pub debug_vis: bool,
    /// Draw what the other sensors show people into the channel `color`, which is otherwise as without: ray hits, forces of
    /// contacts, frames, what cameras see ([`SensorCfg::debug_vis`] says for each whether it shows
    /// anything). All other channels stay what they are. Markers are what each sensor had measured last at
    /// the instant of the picture (of cameras that draw markers and were added later, at the instant before), things are in front of them and behind them, and they cast
    /// shadows; every renderer draws them.
    pub draw_markers: bool,
}

impl Default for CameraCfg {
    /// EmbodiChain's camera: 640 x 480 pixels, f = 600 pixels ([`Intrinsics::EMBODICHAIN`]: what other sizes see is the
    /// same), from 5 mm to 100 m, colour only. Geom groups 0, 1 and 2 are
    /// drawn, as in MuJoCo's own viewers.
    fn default() -> Self {
        Self {
            width: 640,
            height: 480,
            intrinsics: Intrinsics::EMBODICHAIN,
            lens: lens::Lens::default(),
            aperture: None,
            shutter: Shutter::default(),
            near: 0.005,
            far: 100.0,
            extrinsics: Extrinsics::default(),
            update_period: 0.0,
            round_period: false,
            channels: Channels { color: true, ..Channels::default() },
            depth_miss: DepthMiss::Inf,
            renderer: Renderer::default(),
            raster: RasterCfg::default(),
            env_ids: None,
            lazy: true,
            history_length: 0,
            latency_steps: 0,
            dropout: 0.0,
            noise: BTreeMap::new(),
            imperfections: Imperfections::default(),
            debug_vis: false,
            draw_markers: false,
        }
    }
}

impl SensorCfg for CameraCfg {
    type Sensor = Camera;

    /// What can be seen; the poses of bodies only where it hangs on one.
    fn requires(&self) -> Requires {
        Camera::requires(self.extrinsics.parent.is_some(), self.draw_markers)
    }

    fn debug_vis(&self) -> bool {
        self.debug_vis
    }

    /// # Errors
    ///
    /// Sizes, lens, depth range or placement that are no good, an unknown parent, environments that do not exist or are
    /// named twice, a period that is no whole number of steps, a dropout that is no probability, noise of a channel that is not
    /// there or has none, numbers of noise or of imperfections that are no good, pictures, history or latency that do not fit into
    /// memory.
    fn build(&self, context: &SensorContext) -> Result<Camera, SensorError> {
        let schedule = Schedule::new(self.update_period, context.dt, self.round_period)?;
        let scene = context.scene.clone().ok_or(CameraError::NoScene)?;
        let parent = self.extrinsics.parent.as_deref().map(|name| context.body(name)).transpose()?;
        if self.channels == Channels::default() {
            return Err(CameraError::NoChannels.into());
        }
        if !matches!(self.raster.samples, 1 | 4) {
            return Err(CameraError::View(RenderError::Samples { samples: self.raster.samples }).into());
        }
        self.renderer.validate().map_err(CameraError::View)?;
        self.aperture.as_ref().map_or(Ok(()), Aperture::check).map_err(CameraError::View)?;
        self.shutter.check().map_err(CameraError::View)?;
        check_light(self.renderer, self.aperture.as_ref(), self.shutter).map_err(CameraError::View)?;
        check_occlusion(self.raster, self.renderer).map_err(CameraError::View)?;
        self.check_flow()?;
        self.check_lens()?;
        let lens = Lens::new(self)?;
        let pixels = self.intrinsics.to_pixels(self.width, self.height)?;
        lens.view(&pixels, PoseF32::IDENTITY).validate().map_err(CameraError::View)?;
        let env_ids = self.env_ids.clone().unwrap_or_else(|| (0..context.num_envs).collect());
        check_env_ids(&env_ids, context.num_envs)?;
        self.check_memory(env_ids.len(), scene.instances().len(), scene.lights.len(), schedule)?;
        let opening = Opening::new(self, schedule, context.dt, env_ids.len(), &scene)?;
        let rays = self.lens_rays(&pixels, env_ids.len())?;
        let faults = Faults::new(self, context, schedule.period_steps() as f64 * context.dt)?;
        let mount = self.extrinsics.parent_from_camera()?;
        let pictures = Pictures::new(self.channels, env_ids.len(), self.width, self.height);
        let optics = (lens, pixels, mount);
        Ok(Camera::new(self, context, scene, (schedule, opening), parent, optics, rays, env_ids, (pictures, faults)))
    }
}

impl CameraCfg {
    /// Flow is of two pictures that follow each other.
    fn check_flow(&self) -> Result<(), CameraError> {
        let past = self.latency_steps > 0 || self.dropout > 0.0 || self.history_length > 0;
        match self.channels.flow {
            true if past => Err(CameraError::FlowOfThePast),
            true if !self.shutter.is_instant() => Err(CameraError::FlowOfRows),
            _ => Ok(()),
        }
    }

    /// What some lenses do not have.
    fn check_lens(&self) -> Result<(), CameraError> {
        let (lens, Imperfections { vignetting, holes, .. }) = (self.lens.name(), &self.imperfections);
        if vignetting.is_some() && !self.lens.has_axis() {
            return Err(CameraError::NoAxis { what: "vignetting", lens });
        }
        if holes.as_ref().is_some_and(|holes| holes.baseline != 0.0) && !self.lens.is_pinhole() {
            return Err(CameraError::PinholeOnly {
                what: "shadows of a projector (holes with a baseline other than 0)",
                lens,
            });
        }
        Ok(())
    }

    /// The rays of the lens in every row.
    fn lens_rays(&self, pixels: &PixelIntrinsics, rows: usize) -> Result<RaysOfRows, CameraError> {
        if !self.lens.is_pinhole() && !self.renderer.sees_by_rays(true) {
            let (lens, renderer) = (self.lens.name(), self.renderer.name());
            return Err(CameraError::View(RenderError::LensRenderer { lens, renderer }));
        }
        // Paths have rays of their own; only colours without them have more samples than a pixel's centre.
        let samples = if self.channels.color && !self.renderer.follows_paths() { self.raster.samples } else { 1 };
        Ok(RaysOfRows::new(self.lens, pixels, [self.width, self.height], samples, rows)?)
    }

    /// Refuses what would end the process: an allocation that fails.
    fn check_memory(
        &self,
        views: usize,
        instances: usize,
        lamps: usize,
        schedule: Schedule,
    ) -> Result<(), CameraError> {
        let bytes_per_pixel = self.channels.bytes_per_pixel();
        // A shutter that takes time is twice a moment.
        let moments = if self.shutter.is_instant() { 1 } else { 2 };
        let capture = moments * instances * size_of::<PoseF32>() + lamps * size_of::<Light>();
        // What paths find is kept for one picture at a time.
        let film = match self.renderer {
            Renderer::RayTraced { denoise, .. } if self.channels.color => {
                self.width.saturating_mul(self.height).saturating_mul(Film::bytes_per_pixel(denoise))
            }
            _ => 0,
        };
        let picture = self.width.checked_mul(self.height).and_then(|pixels| pixels.checked_mul(bytes_per_pixel));
        let fits = |pictures: usize, captures: usize| {
            let captures = captures.checked_mul(capture.saturating_add(CAPTURE));
            let pictures = picture.and_then(|bytes| bytes.checked_mul(pictures));
            let bytes = pictures
                .zip(captures)
                .and_then(|(pictures, captures)| pictures.checked_add(captures)?.checked_mul(views)?.checked_add(film))
                .filter(|&bytes| bytes as u64 <= MAX_BYTES);
            // Asks for the memory, and gives it back untouched: that may fail, an array's own request must not.
            bytes.is_some_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok())
        };
        if !fits(1, 1) {
            let (width, height) = (self.width, self.height);
            return Err(CameraError::Memory { views, width, height, bytes_per_pixel, paths: film, limit: MAX_BYTES });
        }
        let (pictures, captures) = (self.history_length, Memory::waiting(self, schedule));
        let all = pictures.saturating_add(captures).saturating_add(1);
        if !fits(pictures.saturating_add(1), all) {
            return Err(CameraError::Past { pictures, captures, views, limit: MAX_BYTES });
        }
        Ok(())
    }
}

fn check_env_ids(env_ids: &[usize], count: usize) -> Result<(), SensorError> {
    if env_ids.is_empty() {
        return Err(CameraError::NoEnvironments.into());
    }
    let mut seen = vec![false; count];
    for &env in env_ids {
        let Some(seen) = seen.get_mut(env) else {
            return Err(SensorError::IndexOutOfRange { what: "environment", index: env, count });
        };
        if std::mem::replace(seen, true) {
            return Err(CameraError::DuplicateEnvironment { env }.into());
        }
    }
    Ok(())
}
