//! Draws frames.

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

/// Draws frames, one at a time; keeps its scratch memory. Use one per thread.
///
/// The same shot gives the same bits on every thread and with every instruction set.
///
/// Transparency: things with 0 < alpha < 1 are blended into the color, back to front by the depth of their origins, each
/// with its nearest surface only; they are not seen by things behind them twice. All other channels see the nearest
/// surface whatever its alpha, unless that is 0, as in MuJoCo. Opacity of textures is not used.
#[derive(Debug)]
pub struct Rasterizer {
    /// How frames are drawn.
    pub cfg: RasterCfg,
    /// Which renderer draws them.
    pub renderer: Renderer,
    /// The size of the lens; `None` is a point.
    pub aperture: Option<Aperture>,
    /// When light falls on which row.
    pub shutter: Shutter,
    /// Stops, -20 to 20: light is multiplied by 2 to this power before the tone curve, so that what is brighter than white in
    /// one image is told apart in a shorter one.
    pub stops: f64,
    /// How far the paths of a image are.
    pub progress: RenderProgress,
    pub(super) assets: RayAssets,
    pub(super) plan: Plan,
    pub(super) brush: Brush,
    /// Of images by path tracing.
    pub(super) film: Film,
    /// Of images whose rows are of several instants.
    pub(super) roll: Roll,
}

/// Draws as the other does, and counts its own progress.
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
    /// A rasterizer for this machine.
    pub fn new(cfg: RasterCfg) -> Self {
        Self::with_level(cfg, Level::best())
    }

    /// A rasterizer that uses a SIMD level of its own.
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

    /// How shots are drawn.
    pub(super) fn style(&self) -> Style<'_> {
        let Self { cfg, renderer, aperture, shutter, stops, assets, .. } = self;
        Style { cfg: *cfg, renderer: *renderer, aperture: aperture.as_ref(), shutter: *shutter, stops: *stops, assets }
    }

    /// Scratch memory held \[bytes\].
    pub fn scratch_bytes(&self) -> usize {
        self.plan.bytes() + self.brush.bytes() + self.film.bytes() + self.roll.bytes()
    }

    /// Draws the channels that `frame` has.
    ///
    /// # Errors
    ///
    /// A view, a pose or a buffer that is no good; nothing is drawn then.
    pub fn render(
        &mut self,
        scene: &RenderScene,
        poses: &[PoseF32],
        view: &View,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        self.render_shot(&Shot { scene, poses, view, lights: None, lens: None, before: None }, &mut frame.as_mut())
    }

    /// Draws the channels that `frame` has, into borrowed memory.
    ///
    /// # Errors
    ///
    /// A view, a pose or a buffer that is no good; nothing is drawn then.
    pub fn render_shot(&mut self, shot: &Shot<'_>, frame: &mut FrameMut<'_>) -> Result<(), RenderError> {
        self.render_take(shot, &Take::default(), frame)
    }

    /// As [`render_shot`](Self::render_shot), of images by path tracing with noise of their own and with things that moved
    /// while the shutter was open.
    ///
    /// # Errors
    ///
    /// As [`render_shot`](Self::render_shot), and where things were that is no good or not long enough ago.
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

    /// Draws a row of a image, at its own instant, into a frame of that row.
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
