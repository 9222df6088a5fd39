//! Renders single frames.

use super::aperture::Aperture;
use super::exposure::expose;
use super::progress::RenderProgress;
use super::renderer::Renderer;
use super::rolling::Roll;
use super::shutter::{Shutter, ShutterInterval, Take};
use crate::frame::{Frame, FrameMut};
use crate::geometry::assets::RayAssets;
use crate::path::film::Film;
use crate::raster::tile::BLOCK;
use crate::request::{RasterCfg, Shot};
use crate::shade::band::Brush;
use crate::shade::plan::{Plan, Style};
use crate::simd::Level;
use crate::visibility::{RenderError, View};
use kinetoscope_exec::ThreadPool;
use kinetoscope_scene::{PoseF32, RenderScene};

/// Renders frames, one at a time; keeps its scratch memory. Use one per thread.
///
/// The same request gives the same bits on every thread and with every instruction set.
///
/// Transparency: instances with 0 < alpha < 1 are blended into the color, back to front by the depth of their origins.
/// Only the nearest surface of each is blended. All other channels contain the nearest surface whatever its alpha,
/// unless that is 0, as in MuJoCo. The opacity of textures is ignored.
#[derive(Debug)]
pub struct Rasterizer {
    /// Options of the rasterizer.
    pub cfg: RasterCfg,
    /// The renderer that is used.
    pub renderer: Renderer,
    /// Aperture of the lens, for depth of field; `None` is a pinhole.
    pub aperture: Option<Aperture>,
    /// Exposure time and readout of the rows.
    pub shutter: Shutter,
    /// Exposure compensation in stops, -20 to 20: light is multiplied by 2 to this power before the tone curve. Bright
    /// areas that saturate in one image keep their detail in an image with fewer stops.
    pub stops: f64,
    /// Progress of path tracing.
    pub progress: RenderProgress,
    pub(super) assets: RayAssets,
    pub(super) plan: Plan,
    pub(super) brush: Brush,
    /// Accumulator of path-traced images.
    pub(super) film: Film,
    /// Scratch memory of images whose rows show different instants.
    pub(super) roll: Roll,
}

/// Clones the settings. The clone has its own progress counter.
impl Clone for Rasterizer {
    fn clone(&self) -> Self {
        let Self { cfg, renderer, aperture, shutter, stops, progress: _, assets, plan, brush, film, roll } = self;
        Self {
            cfg: *cfg,
            renderer: *renderer,
            aperture: *aperture,
            shutter: *shutter,
            stops: *stops,
            progress: RenderProgress::default(),
            assets: assets.clone(),
            plan: plan.clone(),
            brush: brush.clone(),
            film: film.clone(),
            roll: roll.clone(),
        }
    }
}

impl Default for Rasterizer {
    fn default() -> Self {
        Self::new(RasterCfg::default())
    }
}

impl Rasterizer {
    /// Creates a rasterizer with the best SIMD level of this machine.
    pub fn new(cfg: RasterCfg) -> Self {
        Self::with_level(cfg, Level::best())
    }

    /// Creates a rasterizer with a given SIMD level.
    pub(crate) fn with_level(cfg: RasterCfg, level: Level) -> Self {
        Self {
            cfg,
            renderer: Renderer::default(),
            aperture: None,
            shutter: Shutter::default(),
            stops: 0.0,
            progress: RenderProgress::default(),
            assets: RayAssets::default(),
            plan: Plan::default(),
            brush: Brush::new(level),
            film: Film::default(),
            roll: Roll::default(),
        }
    }

    /// Current settings of all frames.
    pub(super) fn style(&self) -> Style<'_> {
        let Self { cfg, renderer, aperture, shutter, stops, assets, .. } = self;
        Style { cfg: *cfg, renderer: *renderer, aperture: aperture.as_ref(), shutter: *shutter, stops: *stops, assets }
    }

    /// Scratch memory held \[bytes\].
    pub fn scratch_bytes(&self) -> usize {
        self.plan.bytes() + self.brush.bytes() + self.film.bytes() + self.roll.bytes()
    }

    /// Renders the channels of `frame`.
    ///
    /// # Errors
    ///
    /// For an invalid view, pose or buffer; the frame is unchanged then.
    pub fn render(
        &mut self,
        scene: &RenderScene,
        poses: &[PoseF32],
        view: &View,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        self.render_shot(&Shot { scene, poses, view, lights: None, lens: None, before: None }, &mut frame.as_mut())
    }

    /// Renders the channels of `frame` into borrowed buffers.
    ///
    /// # Errors
    ///
    /// For an invalid view, pose or buffer; the frame is unchanged then.
    pub fn render_shot(&mut self, shot: &Shot<'_>, frame: &mut FrameMut<'_>) -> Result<(), RenderError> {
        self.render_take(shot, &Take::default(), frame)
    }

    /// As [`render_shot`](Self::render_shot), with noise and motion for path tracing: `take` holds the noise number and
    /// the poses at shutter opening.
    ///
    /// # Errors
    ///
    /// As [`render_shot`](Self::render_shot), and for invalid or too recent poses at shutter opening.
    pub fn render_take(
        &mut self,
        shot: &Shot<'_>,
        take: &Take<'_>,
        frame: &mut FrameMut<'_>,
    ) -> Result<(), RenderError> {
        let paths = self.renderer.paths(shot, frame);
        self.progress.begin(paths);
        if self.renderer.follows_paths() {
            let result = expose(&ThreadPool::serial(), std::slice::from_mut(self), shot, take, frame);
            if result.as_ref().is_err_and(|error| !matches!(error, RenderError::Cancelled { .. })) {
                self.progress.refuse(paths.saturating_sub(self.progress.samples()));
            }
            return result;
        }
        let Self { cfg, renderer, aperture, shutter, stops, assets, plan, brush, .. } = self;
        let (aperture, shutter) = (aperture.as_ref(), *shutter);
        plan.prepare(Style { cfg: *cfg, renderer: *renderer, aperture, shutter, stops: *stops, assets }, shot, frame)?;
        for band in plan.shadow_bands() {
            brush.shadow(shot.scene, band);
        }
        brush.paint(plan, shot, frame, 0..shot.view.height.div_ceil(BLOCK));
        Ok(())
    }

    /// Renders one row of an image, at its own instant, into a frame of that row.
    pub(super) fn draw_row(
        &mut self,
        shot: &Shot<'_>,
        interval: &ShutterInterval<'_>,
        y: usize,
        row: &mut FrameMut<'_>,
    ) -> Result<(), RenderError> {
        let Self { cfg, renderer, aperture, shutter, stops, assets, brush, roll, .. } = self;
        let (aperture, shutter) = (aperture.as_ref(), *shutter);
        let style = Style { cfg: *cfg, renderer: *renderer, aperture, shutter, stops: *stops, assets };
        roll.draw(brush, style, shot, interval, y, row)
    }
}
