//! Draws frames.

use super::aperture::Aperture;
use super::exposure::expose;
use super::lens::LensRays;
use super::progress::RenderProgress;
use super::renderer::Renderer;
use super::rolling::Roll;
use super::shutter::{Clock, Opened, Shutter, Take};
use crate::frame::{Frame, FrameMut};
use crate::geometry::assets::RayAssets;
use crate::path::film::Film;
use crate::raster::tile::BLOCK;
use crate::shade::band::Brush;
use crate::shade::plan::{Plan, Style};
use crate::shade::tone::ToneCurve;
use crate::simd::Level;
use crate::visibility::{RenderError, View};
use kinetoscope_exec::ThreadPool;
use kinetoscope_scene::{Light, PoseF32, RenderScene};
use serde::{Deserialize, Serialize};

/// How frames are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RasterCfg {
    /// Samples per pixel for the colour: 1 or 4. All other channels see the pixel's centre.
    pub samples: u8,
    /// Whether lamps cast shadows (directional lamps and spots, the first four of them).
    pub shadows: bool,
    /// Texels along the side of a shadow map; 0 chooses by the picture's size.
    pub shadow_size: usize,
    /// Rays from each sample of a colour for ambient occlusion, of [`Renderer::Hybrid`] only; 0 is none. Ambient light is then
    /// what arrives of [`RenderScene::ambient`] past what is in the way, as [`Renderer::RayTraced`] has it without bounces:
    /// exact where nothing is in the way of flat surfaces (of a mesh with smooth normals, what lies below a facet is in the way),
    /// with the noise of so many rays elsewhere, which depends on the point and nothing else.
    pub occlusion_rays: u16,
    /// How light becomes the bytes of the colour.
    pub tone: ToneCurve,
    /// Geom groups that are drawn: bit k is group k.
    pub groups: u32,
    /// Draw dense meshes coarser where that is hardly seen (level of detail).
    ///
    /// The surface that is drawn instead of a mesh is joined to it by a continuous map that moves no point by more than
    /// 1 mm, nor by more than half a pixel anywhere in the picture (both are proven, see [`kinetoscope_scene::RenderMesh::levels`];
    /// vertices are snapped to 1/256 pixel besides, with or without levels). So:
    /// - what is seen at a pixel is seen within half a pixel of it without levels; of things that are less than 2 mm
    ///   behind each other, either may be seen;
    /// - depth, distance and position are those of a point not farther than 1 mm from a point of the mesh that is seen
    ///   within half a pixel; where a surface is seen at a slant, or near a silhouette, depth changes by more than that
    ///   within half a pixel, and may differ by as much;
    /// - flat normals are those of the larger triangles: on smooth surfaces within some degrees of the mesh's, and
    ///   arbitrary on features that are smaller than half a pixel or 1 mm. Shading normals are blended from normals of the
    ///   mesh's own vertices, and no new triangle faces more than 40° away from them;
    /// - shadow maps follow the same rule in texels.
    ///
    /// The level depends on the mesh, its pose and the view, on nothing else in the picture. Meshes of fewer than 1000
    /// triangles, with texture coordinates, that reach behind the near plane, and terrain are drawn as they are. The
    /// levels of a mesh are made when a picture first needs one, and shared by all environments.
    pub lod: bool,
}

impl Default for RasterCfg {
    /// Four samples and shadows; geom groups 0, 1 and 2, as in MuJoCo's own viewers: collision shapes are in group 3.
    fn default() -> Self {
        Self {
            samples: 4,
            shadows: true,
            shadow_size: 0,
            occlusion_rays: 0,
            tone: ToneCurve::Soft,
            groups: 0b111,
            lod: true,
        }
    }
}

/// Everything in a picture.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// What can be seen.
    pub scene: &'a RenderScene,
    /// Where each instance is: world from instance.
    pub poses: &'a [PoseF32],
    /// The camera.
    pub view: &'a View,
    /// Lamps instead of the scene's, for those that move.
    pub lights: Option<&'a [Light]>,
    /// The rays of a lens, instead of the view's focal lengths and principal point; `None` is a pinhole.
    pub lens: Option<&'a LensRays>,
    /// What the picture before showed, for [`Flow`](crate::frame::Flow); nothing else looks at it.
    pub before: Option<Before<'a>>,
}

/// What the picture before showed.
#[derive(Clone, Copy, Debug)]
pub struct Before<'a> {
    /// Where each instance was: world from instance.
    pub poses: &'a [PoseF32],
    /// The camera. Behind a lens, its focal lengths and principal point tell the intrinsics from those of
    /// [`Shot::view`]: where both are the same, the lens had the same ones.
    pub view: &'a View,
}

/// Draws frames, one at a time; keeps its scratch memory. Use one per thread.
///
/// The same shot gives the same bits on every thread and with every instruction set.
///
/// Transparency: things with 0 < alpha < 1 are blended into the colour, back to front by the depth of their origins, each
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
    /// one picture is told apart in a shorter one.
    pub stops: f64,
    /// How far the paths of a picture are.
    pub progress: RenderProgress,
    pub(super) assets: RayAssets,
    pub(super) level: Level,
    pub(super) plan: Plan,
    pub(super) brush: Brush,
    /// Of pictures by path tracing.
    pub(super) film: Film,
    /// Of pictures whose rows are of several instants.
    pub(super) roll: Roll,
}

/// Draws as the other does, and counts its own progress.
impl Clone for Rasterizer {
    fn clone(&self) -> Self {
        let Self { cfg, renderer, aperture, shutter, stops, progress: _, assets, level, plan, brush, film, roll } =
            self;
        Self {
            cfg: *cfg,
            renderer: *renderer,
            aperture: *aperture,
            shutter: *shutter,
            stops: *stops,
            progress: RenderProgress::default(),
            assets: assets.clone(),
            level: *level,
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

    pub fn with_level(cfg: RasterCfg, level: Level) -> Self {
        Self {
            cfg,
            renderer: Renderer::default(),
            aperture: None,
            shutter: Shutter::default(),
            stops: 0.0,
            progress: RenderProgress::default(),
            assets: RayAssets::default(),
            level,
            plan: Plan::default(),
            brush: Brush::default(),
            film: Film::default(),
            roll: Roll::default(),
        }
    }

    /// How shots are drawn.
    pub(super) fn style(&self) -> Style<'_> {
        let Self { cfg, renderer, aperture, shutter, stops, assets, .. } = self;
        Style { cfg: *cfg, renderer: *renderer, aperture: aperture.as_ref(), shutter: *shutter, stops: *stops, assets }
    }

    /// The instruction set in use.
    pub fn simd_level(&self) -> String {
        format!("{:?}", self.level)
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

    /// As [`render_shot`](Self::render_shot), of pictures by path tracing with noise of their own and with things that moved
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
            let result = expose(&ThreadPool::serial(), std::slice::from_mut(self), (shot, take), frame);
            if result.as_ref().is_err_and(|error| !matches!(error, RenderError::Cancelled { .. })) {
                self.progress.refuse(paths.saturating_sub(self.progress.samples()));
            }
            return result;
        }
        let Self { cfg, renderer, aperture, shutter, stops, assets, level, plan, brush, .. } = self;
        let (aperture, shutter) = (aperture.as_ref(), *shutter);
        plan.prepare(Style { cfg: *cfg, renderer: *renderer, aperture, shutter, stops: *stops, assets }, shot, frame)?;
        for band in plan.shadow_bands() {
            brush.shadow(*level, shot.scene, band);
        }
        brush.paint(*level, plan, shot, frame, 0..shot.view.height.div_ceil(BLOCK));
        Ok(())
    }

    /// Draws a row of a picture, at its own instant, into a frame of that row.
    pub(super) fn draw_row(
        &mut self,
        shot: &Shot<'_>,
        when: (&Opened<'_>, &Clock),
        y: usize,
        row: &mut FrameMut<'_>,
    ) -> Result<(), RenderError> {
        let Self { cfg, renderer, aperture, shutter, stops, assets, level, brush, roll, .. } = self;
        let (aperture, shutter) = (aperture.as_ref(), *shutter);
        let style = Style { cfg: *cfg, renderer: *renderer, aperture, shutter, stops: *stops, assets };
        roll.draw((brush, style, *level), shot, when, y, row)
    }
}
