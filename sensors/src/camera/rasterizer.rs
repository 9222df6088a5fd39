//! Draws frames.

use super::channel::{Frame, FrameMut};
use crate::lanes::Level;
use crate::resolve::band::Brush;
use crate::resolve::plan::Plan;
use crate::visibility::raster::tile::BLOCK;
use crate::visibility::{RenderError, View};
use scene::{Light, PoseF32, RenderScene};
use serde::{Deserialize, Serialize};

/// How frames are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default = "RasterCfg::of_cameras", deny_unknown_fields)]
pub struct RasterCfg {
    /// Samples per pixel for the colour: 1 or 4. All other channels see the pixel's centre.
    pub samples: u8,
    /// Whether lamps cast shadows (directional lamps and spots, the first four of them).
    pub shadows: bool,
    /// Texels along the side of a shadow map; 0 chooses by the picture's size.
    pub shadow_size: usize,
    /// Geom groups that are drawn: bit k is group k.
    pub groups: u32,
}

impl Default for RasterCfg {
    fn default() -> Self {
        Self { samples: 4, shadows: true, shadow_size: 0, groups: u32::MAX }
    }
}

impl RasterCfg {
    /// What cameras have by default, in files too: geom groups 0, 1 and 2, as in MuJoCo's own viewers.
    pub fn of_cameras() -> Self {
        Self { groups: 0b111, ..Self::default() }
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
}

/// Draws frames, one at a time; keeps its scratch memory. Use one per thread.
///
/// The same shot gives the same bits on every thread and with every instruction set.
///
/// Transparency: things with 0 < alpha < 1 are blended into the colour, back to front by the depth of their origins, each
/// with its nearest surface only; they are not seen by things behind them twice. All other channels see the nearest
/// surface with alpha of at least 0.5. Opacity of textures is not used.
#[derive(Clone, Debug)]
pub struct Rasterizer {
    /// How frames are drawn.
    pub cfg: RasterCfg,
    pub(super) level: Level,
    plan: Plan,
    pub(super) brush: Brush,
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

    pub(crate) fn with_level(cfg: RasterCfg, level: Level) -> Self {
        Self { cfg, level, plan: Plan::default(), brush: Brush::default() }
    }

    /// The instruction set in use.
    pub fn simd_level(&self) -> String {
        format!("{:?}", self.level)
    }

    /// Scratch memory held \[bytes\].
    pub fn scratch_bytes(&self) -> usize {
        self.plan.bytes() + self.brush.bytes()
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
        self.render_shot(&Shot { scene, poses, view, lights: None }, &mut frame.as_mut())
    }

    /// Draws the channels that `frame` has, into borrowed memory.
    ///
    /// # Errors
    ///
    /// A view, a pose or a buffer that is no good; nothing is drawn then.
    pub fn render_shot(&mut self, shot: &Shot<'_>, frame: &mut FrameMut<'_>) -> Result<(), RenderError> {
        let Self { cfg, level, plan, brush } = self;
        plan.prepare(*cfg, shot, frame)?;
        for band in plan.shadow_bands() {
            brush.shadow(*level, shot.scene, band);
        }
        brush.paint(*level, plan, shot, frame, 0..shot.view.height.div_ceil(BLOCK));
        Ok(())
    }
}
