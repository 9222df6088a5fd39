//! Cameras in a simulation, compared with MuJoCo's rays and with the poses of the simulation.

mod files;
mod first_views;
mod markers;
mod models;
mod mujoco_renderer;
mod overview;
mod placement;
mod rays;
mod renderers;
mod schedule;
mod segments;
mod stereo;
mod surfaces;

use kinetoscope::prelude::*;
use kinetoscope::render::View;
use kinetoscope::scene::PoseF32;

/// A view with this vertical field of view \[rad\] and near and far planes \[m\].
fn view([width, height]: [usize; 2], radians: f64, pose: &Pose, clip: [f64; 2]) -> View {
    let pixels = Intrinsics::Fovy { radians }.to_pixels(width, height).unwrap();
    let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
    let [near, far] = clip.map(|c| c as f32);
    View { parallel: false, width, height, fx, fy, cx, cy, near, far, world_from_camera: PoseF32::from(pose) }
}
