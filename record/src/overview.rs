//! Overview images: all environments side by side, from a static viewpoint.

use crate::error::{RecordError, Result};
use kinetoscope_render::View;
use kinetoscope_render::frame::{Channels, Frame};
use kinetoscope_render::{Intrinsics, ParallelRenderer, RasterCfg};
use kinetoscope_scene::PoseF32;
use kinetoscope_scene::camera_fit::CameraFit;
use kinetoscope_scene::vector::{add, sub};
use kinetoscope_sensors::camera::look_at_pose;
use kinetoscope_sim::{OffscreenScene, SimulationManager};
use serde::{Deserialize, Serialize};

/// Size, rate and viewpoint of the overview image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OverviewCfg {
    /// Width and height \[pixels\].
    pub size: [usize; 2],
    /// Images per second of simulation time \[Hz\], rounded to a whole number of physics steps between two images, at
    /// least one.
    pub fps: f64,
    /// Viewpoint \[m\] in the world, where environments stand side by side
    /// ([`kinetoscope_sim::SimulationManagerCfg::env_origins`]). With `None`, everything but the ground fills two
    /// thirds of the image when the recording begins, which leaves room for motion; a given `target` only shifts this
    /// viewpoint.
    pub eye: Option<[f64; 3]>,
    /// Point in the center of the image \[m\]; `None` for the center of everything but the ground when the recording
    /// begins.
    pub target: Option<[f64; 3]>,
}

impl Default for OverviewCfg {
    fn default() -> Self {
        Self { size: [960, 540], fps: 30.0, eye: None, target: None }
    }
}

impl OverviewCfg {
    /// Number of physics steps of `dt` \[s\] between two images.
    pub(crate) fn period_steps(&self, dt: f64) -> u64 {
        (1.0 / (self.fps * dt)).round().max(1.0) as u64
    }
}

/// Vertical field of view \[rad\].
const FOVY: f64 = std::f64::consts::FRAC_PI_4;
/// Near and far clipping distance \[m\].
const CLIP: [f32; 2] = [0.05, 500.0];
/// Share of the image that the scene fills when the recording begins.
const FILL: f64 = 0.66;
/// Draws the overview image.
#[derive(Debug)]
pub(crate) struct OverviewRenderer {
    view: View,
    rasterizer: ParallelRenderer,
}

impl OverviewRenderer {
    /// Creates the renderer with the viewpoint for the current state.
    ///
    /// # Errors
    /// The rate, the size or the viewpoint is invalid.
    pub(crate) fn new(sim: &mut SimulationManager, cfg: &OverviewCfg) -> Result<Self> {
        let wrong = |what: String| RecordError::Overview { what };
        if !(cfg.fps.is_finite() && cfg.fps > 0.0) {
            return Err(wrong(format!("the rate is {} Hz; it must be above 0", cfg.fps)));
        }
        let [width, height] = cfg.size;
        if !(1..=View::MAX_SIDE).contains(&width) || !(1..=View::MAX_SIDE).contains(&height) {
            return Err(wrong(format!("{width} x {height} pixels; both must be from 1 to {}", View::MAX_SIDE)));
        }
        let still = OffscreenScene::overview(sim, None, &[])?;
        let first = still.first_view(cfg.size);
        let forward = [0, 1, 2].map(|k| first.target[k] - first.eye[k]);
        let framing = CameraFit { forward, fovy: FOVY, aspect: width as f64 / height as f64, fill: FILL };
        // An empty scene uses the first view of an empty model.
        let place = framing.fit(&[still.placed()]).map(|place| (place.eye, place.target));
        let (first_eye, first_target) = place.unwrap_or((first.eye, first.target));
        let (offset, target) = (sub(first_eye, first_target), cfg.target.unwrap_or(first_target));
        let eye = cfg.eye.unwrap_or(add(target, offset));
        let pose = look_at_pose(eye, target, [0.0, 0.0, 1.0])
            .map_err(|error| wrong(format!("from {eye:?} to {target:?}: {error}")))?;
        let pixels =
            Intrinsics::Fovy { radians: FOVY }.to_pixels(width, height).map_err(|error| wrong(error.to_string()))?;
        let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
        let [near, far] = CLIP;
        let view =
            View { parallel: false, width, height, fx, fy, cx, cy, near, far, world_from_camera: PoseF32::from(&pose) };
        let raster = RasterCfg { samples: 4, ..RasterCfg::default() };
        Ok(Self { view, rasterizer: ParallelRenderer::new(raster, sim.threads()) })
    }

    /// Draws the current state and appends it to `pixels`: RGBA, row by row from the top left.
    ///
    /// # Errors
    /// The scene has more triangles than the rasterizer supports.
    pub(crate) fn render(&mut self, sim: &mut SimulationManager, pixels: &mut Vec<u8>) -> Result<()> {
        let stage = OffscreenScene::overview(sim, None, &[])?;
        let (width, height) = (self.view.width, self.view.height);
        let mut frame = Frame::new(width, height, Channels { color: true, ..Channels::NONE });
        let mut job = [(stage.render_request(&self.view), frame.as_mut())];
        self.rasterizer.render(&mut job).map_err(|(_, error)| RecordError::Overview { what: error.to_string() })?;
        pixels.extend(frame.color.unwrap_or_default());
        Ok(())
    }
}
