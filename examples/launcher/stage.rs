//! All environments in one image, with the debug markers of the sensors.

use super::{Result, image_file};
use kinetoscope::prelude::*;
use kinetoscope::render::ParallelRenderer;
use kinetoscope::render::View;
use kinetoscope::render::frame::Frame;
use kinetoscope::scene::{Marker, PoseF32};
use kinetoscope::sensors::camera::look_at_pose;
use kinetoscope::sim::OffscreenScene;
use std::path::Path;

/// Renders all environments side by side, with markers in the frames of their environments, and writes a PNG of 1280 by
/// 720 pixels. `eye` and `target` are the position of the camera and its target in the frame of the overview \[m\].
///
/// # Errors
/// The scene is too large to render, the points coincide, or the file cannot be written.
pub(crate) fn write(
    sim: &mut SimulationManager,
    markers: &[(EnvId, Marker)],
    eye: [f64; 3],
    target: [f64; 3],
    path: &Path,
) -> Result {
    let stage = OffscreenScene::overview(sim, None, markers)?;
    let pose = look_at_pose(eye, target, [0.0, 0.0, 1.0])?;
    let (width, height) = (1280, 720);
    let pixels = Intrinsics::Fovy { radians: 45f64.to_radians() }.to_pixels(width, height)?;
    let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
    let world_from_camera = PoseF32::from(&pose);
    let view = View { parallel: false, width, height, fx, fy, cx, cy, near: 0.05, far: 500.0, world_from_camera };
    let mut frame = Frame::new(width, height, Channels { color: true, ..Channels::default() });
    let mut job = [(stage.render_request(&view), frame.as_mut())];
    let cfg = RasterCfg { samples: 4, ..RasterCfg::default() };
    ParallelRenderer::new(cfg, sim.threads()).render(&mut job).map_err(|(_, error)| error)?;
    let color = frame.color.unwrap_or_default();
    image_file::write_png(path, &image_file::color_image([width, height], &color))
}
