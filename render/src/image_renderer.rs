//! Renders single frames.

use super::aperture::Aperture;
use super::path_frame::path_trace;
use super::progress::RenderProgress;
use super::renderer::Renderer;
use super::rolling_shutter::RollingShutter;
use super::shutter::{FrameSample, Shutter, ShutterInterval};
use crate::frame::{Frame, FrameMut};
use crate::geometry::assets::RayAssetCache;
use crate::path::accumulator::Accumulator;
use crate::raster::tile::BLOCK;
use crate::request::{RasterCfg, RenderRequest};
use crate::shade::band::RasterScratch;
use crate::shade::prepared_frame::{PreparedFrame, RenderSettings};
use crate::simd::SimdLevel;
use crate::visibility::{RenderError, View};
use kinetoscope_exec::ThreadPool;
use kinetoscope_scene::{PoseF32, RenderScene};

/// Renders single frames by rasterization, ray tracing or path tracing ([`renderer`](Self::renderer)). Keeps its
/// scratch memory; use one renderer per thread.
///
/// The same request and settings give the same bits on every thread and with every instruction set.
///
/// Transparency, except in path-traced color: instances with 0 < alpha < 1 are blended into the color, back to front by
/// the depth of their origins. Of each instance, only the nearest surface is blended. All other channels contain the
/// nearest surface whatever its alpha, unless that is 0, as in MuJoCo. The opacity of textures is ignored.
#[derive(Debug)]
pub struct ImageRenderer {
    /// Options of all renderers, such as shadows, tone curve and geom groups.
    pub cfg: RasterCfg,
    /// Algorithm of color and visibility.
    pub renderer: Renderer,
    /// Aperture of the lens, for depth of field; `None` renders everything sharp. Only path tracing accepts `Some`.
    pub aperture: Option<Aperture>,
    /// Exposure time and readout of the rows. Only path tracing accepts other times than 0.
    pub shutter: Shutter,
    /// Exposure compensation in stops, -20 to 20: the light of the color channel is multiplied by 2 to this power
    /// before the tone curve. Bright areas that saturate in one image keep their detail in an image with fewer stops.
    pub exposure_compensation: f64,
    /// Progress and cancellation of path tracing.
    pub progress: RenderProgress,
    pub(super) assets: RayAssetCache,
    pub(super) prepared: PreparedFrame,
    pub(super) scratch: RasterScratch,
    /// Accumulator of path-traced images.
    pub(super) accumulator: Accumulator,
    /// Scratch memory of images whose rows show different instants.
    pub(super) rolling_shutter: RollingShutter,
}

/// Clones the settings. The clone has its own progress counter.
impl Clone for ImageRenderer {
    fn clone(&self) -> Self {
        let Self {
            cfg,
            renderer,
            aperture,
            shutter,
            exposure_compensation,
            progress: _,
            assets,
            prepared,
            scratch,
            accumulator,
            rolling_shutter,
        } = self;
        Self {
            cfg: *cfg,
            renderer: *renderer,
            aperture: *aperture,
            shutter: *shutter,
            exposure_compensation: *exposure_compensation,
            progress: RenderProgress::default(),
            assets: assets.clone(),
            prepared: prepared.clone(),
            scratch: scratch.clone(),
            accumulator: accumulator.clone(),
            rolling_shutter: rolling_shutter.clone(),
        }
    }
}

impl Default for ImageRenderer {
    fn default() -> Self {
        Self::new(RasterCfg::default())
    }
}

impl ImageRenderer {
    /// Creates a renderer with [`Renderer::Raster`], without depth of field, exposure time and exposure compensation.
    /// It uses the best instruction set of this machine.
    pub fn new(cfg: RasterCfg) -> Self {
        Self::with_level(cfg, SimdLevel::best())
    }

    /// As [`new`](Self::new), with a given SIMD level.
    pub(crate) fn with_level(cfg: RasterCfg, level: SimdLevel) -> Self {
        Self {
            cfg,
            renderer: Renderer::default(),
            aperture: None,
            shutter: Shutter::default(),
            exposure_compensation: 0.0,
            progress: RenderProgress::default(),
            assets: RayAssetCache::default(),
            prepared: PreparedFrame::default(),
            scratch: RasterScratch::new(level),
            accumulator: Accumulator::default(),
            rolling_shutter: RollingShutter::default(),
        }
    }

    /// Settings of the next frame.
    pub(super) fn settings(&self) -> RenderSettings<'_> {
        let Self { cfg, renderer, aperture, shutter, exposure_compensation, assets, .. } = self;
        RenderSettings {
            cfg: *cfg,
            renderer: *renderer,
            aperture: aperture.as_ref(),
            shutter: *shutter,
            exposure_compensation: *exposure_compensation,
            assets,
        }
    }

    /// Scratch memory held \[bytes\], without the cache of BVHs over meshes.
    pub fn scratch_bytes(&self) -> usize {
        self.prepared.bytes() + self.scratch.bytes() + self.accumulator.bytes() + self.rolling_shutter.bytes()
    }

    /// Renders the channels of `frame`, through a pinhole, with the lights of the scene. `poses` holds the pose of each
    /// instance: world from instance. Optical flow is +inf, because there is no previous frame.
    ///
    /// # Errors
    ///
    /// For invalid settings, views, poses or buffers, and for canceled path tracing; the frame is unchanged then.
    pub fn render(
        &mut self,
        scene: &RenderScene,
        poses: &[PoseF32],
        view: &View,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        self.render_request(
            &RenderRequest { scene, poses, view, lights: None, lens: None, previous: None },
            &mut frame.as_mut(),
        )
    }

    /// Renders the channels of `frame` into borrowed buffers. All channels show one instant, that of the poses,
    /// whatever the [`shutter`](Self::shutter).
    ///
    /// # Errors
    ///
    /// For an invalid request or buffer, for invalid settings, and for canceled path tracing; the frame is unchanged
    /// then.
    pub fn render_request(
        &mut self,
        render_request: &RenderRequest<'_>,
        frame: &mut FrameMut<'_>,
    ) -> Result<(), RenderError> {
        self.render_sample(render_request, &FrameSample::default(), frame)
    }

    /// As [`render_request`](Self::render_request), with the noise number and the poses at shutter opening of `take`.
    /// Renderers other than path tracing ignore `take`.
    ///
    /// # Errors
    ///
    /// As [`render_request`](Self::render_request), and for invalid or too recent poses at shutter opening.
    pub fn render_sample(
        &mut self,
        render_request: &RenderRequest<'_>,
        take: &FrameSample<'_>,
        frame: &mut FrameMut<'_>,
    ) -> Result<(), RenderError> {
        let paths = self.renderer.path_count(render_request, frame);
        self.progress.begin(paths);
        if self.renderer.is_path_tracing() {
            let result = path_trace(&ThreadPool::serial(), std::slice::from_mut(self), render_request, take, frame);
            if result.as_ref().is_err_and(|error| !matches!(error, RenderError::Canceled { .. })) {
                self.progress.subtract(paths.saturating_sub(self.progress.samples()));
            }
            return result;
        }
        let Self { cfg, renderer, aperture, shutter, exposure_compensation, assets, prepared, scratch, .. } = self;
        let (aperture, shutter) = (aperture.as_ref(), *shutter);
        prepared.prepare(
            RenderSettings {
                cfg: *cfg,
                renderer: *renderer,
                aperture,
                shutter,
                exposure_compensation: *exposure_compensation,
                assets,
            },
            render_request,
            frame,
        )?;
        for band in prepared.shadow_bands() {
            scratch.render_shadow_band(render_request.scene, band);
        }
        scratch.render_band(prepared, render_request, frame, 0..render_request.view.height.div_ceil(BLOCK));
        Ok(())
    }

    /// Renders one row of an image, at its own instant, into a frame of that row.
    pub(super) fn render_row(
        &mut self,
        render_request: &RenderRequest<'_>,
        interval: &ShutterInterval<'_>,
        y: usize,
        row: &mut FrameMut<'_>,
    ) -> Result<(), RenderError> {
        let Self { cfg, renderer, aperture, shutter, exposure_compensation, assets, scratch, rolling_shutter, .. } =
            self;
        let (aperture, shutter) = (aperture.as_ref(), *shutter);
        let style = RenderSettings {
            cfg: *cfg,
            renderer: *renderer,
            aperture,
            shutter,
            exposure_compensation: *exposure_compensation,
            assets,
        };
        rolling_shutter.render_row(scratch, style, render_request, interval, y, row)
    }
}
