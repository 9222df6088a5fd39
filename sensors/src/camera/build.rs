//! Construction of cameras from their configurations, with validation.

use super::cfg::CameraCfg;
use super::delivered::HistoryImages;
use super::env_rows::EnvRows;
use super::error::CameraError;
use super::frame_buffer::FrameBuffer;
use super::imperfection::Imperfections;
use super::motion::Motion;
use super::noise_model::SensorNoiseModel;
use super::sensor::rendering::{FrameRenderer, RenderedImages};
use super::sensor::{Camera, ViewTemplate};
use super::viewpoints::{Viewpoint, Viewpoints};
use crate::cached::Cached;
use crate::error::SensorError;
use crate::schedule::Schedule;
use crate::sensor::{SensorCfg, SensorContext};
use crate::summary;
use kinetoscope_render::Accumulator;
use kinetoscope_render::Aperture;
use kinetoscope_render::ParallelRenderer;
use kinetoscope_render::PixelIntrinsics;
use kinetoscope_render::RasterCfg;
use kinetoscope_render::RenderError;
use kinetoscope_render::Renderer;
use kinetoscope_render::RngKey;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::lens::LensRayTables;
use kinetoscope_render::{check_exposure_optics, check_occlusion};
use kinetoscope_scene::StateFields;
use kinetoscope_scene::{Light, Marker, PoseF32};
use std::sync::Mutex;
use std::sync::atomic::AtomicU64;

/// Limit of the memory of the images of a camera \[bytes\].
const MAX_BYTES: u64 = 64 << 30;
/// Upper bound of the memory of a captured frame besides poses and lights \[bytes\]: viewpoint, lens, stamp and random
/// key.
const FRAME_OVERHEAD: usize = 512;

impl SensorCfg for CameraCfg {
    type Sensor = Camera;

    /// Visual state; body poses only if the camera is attached to a body; markers only if the camera renders them.
    fn requires(&self) -> StateFields {
        Camera::requires(self.extrinsics.parent.is_some(), self.draw_markers)
    }

    fn debug_vis(&self) -> bool {
        self.debug_vis
    }

    /// # Errors
    ///
    /// No scene or no channels; an invalid size, lens, depth range or pose; a renderer, aperture, shutter, imperfection
    /// or flow that does not fit the other settings; an unknown parent; environments that do not exist or are named
    /// twice; a period that is not a whole number of steps; a dropout that is not a probability; noise of a channel
    /// that is off or cannot have noise; invalid numbers of noise or imperfections; images, history or latency that do
    /// not fit into memory.
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
        check_exposure_optics(self.renderer, self.aperture.as_ref(), self.shutter).map_err(CameraError::View)?;
        check_occlusion(self.raster, self.renderer).map_err(CameraError::View)?;
        self.check_flow()?;
        self.check_lens()?;
        let lens = ViewTemplate::new(self)?;
        let pixels = self.intrinsics.to_pixels(self.width, self.height)?;
        lens.view(&pixels, PoseF32::IDENTITY).validate().map_err(CameraError::View)?;
        let envs = EnvRows::new(self.env_ids.as_deref(), context.num_envs)?;
        self.check_memory(envs.len(), scene.instances().len(), scene.lights.len(), schedule)?;
        let motion = Motion::new(self, schedule, context.dt, envs.len(), &scene)?;
        let rays = self.lens_rays(&pixels, envs.len())?;
        let faults = SensorNoiseModel::new(self, context, schedule.period_steps() as f64 * context.dt)?;
        let viewpoint = Viewpoint { parent_from_camera: self.extrinsics.parent_from_camera()?, pixels };
        let viewpoints = Viewpoints::new(viewpoint, [self.width, self.height], rays, envs, parent);
        let rows = viewpoints.len();
        let key = |env: &usize| RngKey::new(context.seed, (context.first_env + env) as u64, &context.name);
        let rng_keys: Vec<RngKey> = viewpoints.envs.env_ids().iter().map(key).collect();
        let rasterizer = self.rasterizer(context);
        Ok(Camera {
            path: summary::path(context, parent),
            num_bodies: context.bodies.len(),
            dt: context.dt,
            lens,
            phases: schedule.phases(rows),
            frames: FrameBuffer::new(self, schedule, &scene, &viewpoints, rng_keys[0]),
            motion,
            images: Cached::outdated(RenderedImages::new(self, rows)),
            latest_images: Cached::empty(),
            past_images: Cached::outdated(HistoryImages::new(self, rows, |_| 0)),
            progress: rasterizer.progress().clone(),
            renderer: Mutex::new(FrameRenderer::new(rasterizer, faults)),
            render_count: AtomicU64::new(0),
            changed: Vec::with_capacity(rows),
            cfg: self.clone(),
            scene,
            viewpoints,
            rng_keys,
        })
    }
}

impl CameraCfg {
    /// Creates the renderer of all views.
    fn rasterizer(&self, context: &SensorContext) -> ParallelRenderer {
        let marked = u32::from(self.draw_markers) << Marker::GROUP;
        let raster = RasterCfg { groups: self.raster.groups | marked, ..self.raster };
        let mut rasterizer = ParallelRenderer::new(raster, context.threads).with_pool(context.pool.clone());
        rasterizer.set_renderer(self.renderer);
        rasterizer.set_exposure_optics(self.aperture, self.shutter);
        rasterizer.set_exposure_compensation(self.imperfections.exposure.map_or(0.0, |exposure| exposure.stops));
        rasterizer.share_assets(&context.ray_assets);
        rasterizer
    }

    /// Rejects flow together with latency, dropout, a history or a shutter of nonzero span.
    fn check_flow(&self) -> Result<(), CameraError> {
        let past = self.latency_steps > 0 || self.dropout > 0.0 || self.history_length > 0;
        match self.channels.flow {
            true if past => Err(CameraError::FlowWithLatency),
            true if !self.shutter.is_instant() => Err(CameraError::FlowWithShutterSpan),
            _ => Ok(()),
        }
    }

    /// Rejects imperfections that the lens does not support.
    fn check_lens(&self) -> Result<(), CameraError> {
        let (lens, Imperfections { vignetting, holes, .. }) = (self.lens.name(), &self.imperfections);
        if vignetting.is_some() && !self.lens.has_axis() {
            return Err(CameraError::NoAxis { what: "vignetting", lens });
        }
        if holes.as_ref().is_some_and(|holes| holes.baseline != 0.0) && !self.lens.is_pinhole() {
            return Err(CameraError::PinholeOnly {
                what: "projector shadows (holes with a baseline other than 0)",
                lens,
            });
        }
        Ok(())
    }

    /// Creates the lens rays of all views; `rows` is their number, one per environment of the camera.
    fn lens_rays(&self, pixels: &PixelIntrinsics, rows: usize) -> Result<LensRayTables, CameraError> {
        if !self.lens.is_pinhole() && !self.renderer.traces_visibility(true) {
            let (lens, renderer) = (self.lens.name(), self.renderer.name());
            return Err(CameraError::View(RenderError::LensRenderer { lens, renderer }));
        }
        // Path tracing generates its own rays. Without it, only color takes more samples than the pixel center.
        let samples = if self.channels.color && !self.renderer.is_path_tracing() { self.raster.samples } else { 1 };
        Ok(LensRayTables::new(self.lens, pixels, [self.width, self.height], samples, rows)?)
    }

    /// Rejects sizes above [`MAX_BYTES`], or whose allocation would fail and abort the process; `views` is the number
    /// of environments.
    fn check_memory(
        &self,
        views: usize,
        instances: usize,
        lights: usize,
        schedule: Schedule,
    ) -> Result<(), CameraError> {
        let bytes_per_pixel = self.channels.bytes_per_pixel();
        // A shutter of nonzero span keeps two sets of poses.
        let pose_sets = if self.shutter.is_instant() { 1 } else { 2 };
        let capture = pose_sets * instances * size_of::<PoseF32>() + lights * size_of::<Light>();
        // The path tracer accumulates one image at a time.
        let accumulator = match self.renderer {
            Renderer::RayTraced { denoise, .. } if self.channels.color => {
                self.width.saturating_mul(self.height).saturating_mul(Accumulator::bytes_per_pixel(denoise))
            }
            _ => 0,
        };
        let image = self.width.checked_mul(self.height).and_then(|pixels| pixels.checked_mul(bytes_per_pixel));
        let fits = |images: usize, captures: usize| {
            let captures = captures.checked_mul(capture.saturating_add(FRAME_OVERHEAD));
            let images = image.and_then(|bytes| bytes.checked_mul(images));
            let bytes = images
                .zip(captures)
                .and_then(|(images, captures)| {
                    images.checked_add(captures)?.checked_mul(views)?.checked_add(accumulator)
                })
                .filter(|&bytes| bytes as u64 <= MAX_BYTES);
            // Reserves the memory and returns it untouched. A failed reservation is an error; a failed array allocation
            // would abort.
            bytes.is_some_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok())
        };
        if !fits(1, 1) {
            let (width, height) = (self.width, self.height);
            return Err(CameraError::Memory {
                views,
                width,
                height,
                bytes_per_pixel,
                path_tracing_bytes: accumulator,
                limit: MAX_BYTES,
            });
        }
        let (images, pending_frames) = (self.history_length, FrameBuffer::max_pending(self, schedule));
        let all = images.saturating_add(pending_frames).saturating_add(1);
        if !fits(images.saturating_add(1), all) {
            return Err(CameraError::HistoryMemory { images, pending_frames, views, limit: MAX_BYTES });
        }
        Ok(())
    }
}
