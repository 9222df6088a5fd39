//! Test scene of the camera sensor: a ground, and a ball at a different position in every environment.

use super::super::{Camera, CameraCfg, CameraConvention, Extrinsics, Placement};
use crate::sensor::{SensorCfg, SensorContext};
use kinetoscope_render::View;
use kinetoscope_render::frame::{Channels, Frame};
use kinetoscope_render::{
    FrameSample, ImageRenderer, Intrinsics, RasterCfg, RenderRequest, Renderer, Shutter, ShutterOpenState,
};
use kinetoscope_scene::pose::{from_row, to_row};
use kinetoscope_scene::shape::{Plane, Sphere};
use kinetoscope_scene::{Instance, Light, Material, Pose, PoseF32, RenderScene, SceneState, VisibleState};
use nalgebra::Point3;
use ndarray::{Array2, Array3};
use std::sync::Arc;

pub(super) const DT: f64 = 0.005;
pub(super) const RADIUS: f64 = 0.3;
pub(super) const SIZE: [usize; 2] = [48, 32];
/// Intrinsics of a camera that is neither square nor centered.
pub(super) const LENS: Intrinsics = Intrinsics::Pixels { fx: 40.0, fy: 52.0, cx: 22.25, cy: 17.5 };
pub(super) const GROUND: i32 = 7;
pub(super) const BALL: i32 = 9;

pub(super) fn context(num_envs: usize) -> SensorContext {
    let gray = Material::from_rgba([0.5, 0.5, 0.5, 1.0]);
    let red = Material::from_rgba([0.8, 0.1, 0.1, 1.0]);
    let instances =
        vec![Instance::new(Plane::INFINITE, gray, GROUND), Instance::new(Sphere { radius: RADIUS as f32 }, red, BALL)];
    SensorContext {
        num_envs,
        dt: DT,
        bodies: ["arm/base", "arm/tip", "ball"].map(String::from).into(),
        joints: Vec::new().into(),
        scene: Some(Arc::new(RenderScene::new(instances).unwrap())),
        threads: 1,
        ..SensorContext::default()
    }
}

/// Position of the ball in environment `env` at step `step`.
pub(super) fn ball(env: usize, step: u64) -> [f64; 3] {
    [0.1 * env as f64, 0.01 * step as f64, 0.5]
}

/// Pose of the link `arm/tip` in environment `env` at step `step`.
pub(super) fn tip(env: usize, step: u64) -> Pose {
    let (k, s) = (env as f64, step as f64);
    kinetoscope_scene::pose::from_xyz_rpy([-1.0 - 0.1 * k, 0.05 * s, 0.8], [0.1 * k, 0.2 - 0.03 * s, 0.15])
}

/// A state with the given step in each environment.
pub(super) fn state(steps: &[u64]) -> SceneState {
    let n = steps.len();
    let mut poses = Array3::zeros((n, 3, 7));
    let mut instances = Array2::from_elem((n, 2), PoseF32::IDENTITY);
    let mut lights = Array2::from_elem((n, 1), Light::default());
    for (env, &step) in steps.iter().enumerate() {
        let at = ball(env, step);
        let rows = [[0., 0., 0., 1., 0., 0., 0.], to_row(&tip(env, step)), [at[0], at[1], at[2], 1., 0., 0., 0.]];
        for (body, row) in rows.iter().enumerate() {
            row.iter().enumerate().for_each(|(k, x)| poses[(env, body, k)] = *x);
        }
        instances[(env, 1)] = PoseF32::from_translation(at.map(|x| x as f32));
        lights[(env, 0)].direction = [0.1 * env as f32, 0.3, -1.0];
    }
    SceneState {
        step: steps.to_vec(),
        time: steps.iter().map(|&s| s as f64 * DT).collect(),
        force_time: steps.iter().map(|&s| s.saturating_sub(1) as f64 * DT).collect(),
        body_poses: Some(poses),
        visible: Some(VisibleState { instance_poses: instances, lights, scenes: Vec::new() }),
        ..SceneState::default()
    }
}

/// A small camera with every channel, 1.6 m away from the ball.
pub(super) fn cfg() -> CameraCfg {
    let placement = Placement::LookAt { eye: [-1.6, 0.0, 0.9], target: [0.0, 0.0, 0.5], up: [0.0, 0.0, 1.0] };
    CameraCfg {
        width: SIZE[0],
        height: SIZE[1],
        intrinsics: LENS,
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        channels: Channels { flow: false, ..Channels::ALL },
        ..CameraCfg::default()
    }
}

/// Builds a camera and resets it at step 0, as its owner does.
pub(super) fn built(cfg: &CameraCfg, context: &SensorContext) -> Camera {
    use crate::sensor::Sensor;
    let mut camera = cfg.build(context).unwrap();
    let envs: Vec<usize> = (0..context.num_envs).collect();
    camera.reset(&envs, &state(&vec![0; context.num_envs])).unwrap();
    camera
}

/// Pose of the camera of a row.
pub(super) fn pose_of(camera: &Camera, row: usize) -> Pose {
    let poses = camera.pose_w(CameraConvention::Ros);
    from_row(&std::array::from_fn(|k| poses[(row, k)]))
}

/// All channels as bits, for some rows of the camera.
pub(super) fn bits(camera: &Camera, rows: impl IntoIterator<Item = usize>) -> Vec<u32> {
    let all = ndarray::Axis(0);
    let mut out = Vec::new();
    for row in rows {
        out.extend(camera.color().unwrap().index_axis(all, row).iter().map(|&x| u32::from(x)));
        out.extend(camera.mask().unwrap().index_axis(all, row).iter().map(|&x| x as u32));
        for image in [camera.depth().unwrap(), camera.distance().unwrap()] {
            out.extend(image.index_axis(all, row).iter().map(|x| x.to_bits()));
        }
        for image in [camera.normal().unwrap(), camera.shading_normal().unwrap(), camera.position().unwrap()] {
            out.extend(image.index_axis(all, row).iter().map(|x| x.to_bits()));
        }
    }
    out
}

/// The pixel of a point in the frame of a pinhole camera.
pub(super) fn pinhole(camera: &Camera, row: usize, p: Point3<f64>) -> [f64; 2] {
    let k = camera.intrinsic_matrices();
    [0, 1].map(|axis| k[(row, axis, axis)] * p[axis] / p.z + k[(row, axis, 2)])
}

/// The point that a pixel of a camera shows.
pub(super) fn point(camera: &Camera, [row, v, u]: [usize; 3]) -> Point3<f64> {
    let position = camera.position().unwrap();
    Point3::from([0, 1, 2].map(|axis| f64::from(position[(row, v, u, axis)])))
}

/// Renders a request with a separate rasterizer.
pub(super) fn frame_of(
    cfg: RasterCfg,
    (renderer, shutter): (Renderer, Shutter),
    channels: Channels,
    (scene, poses, view): (&RenderScene, &[PoseF32], &View),
    shutter_open: Option<ShutterOpenState<'_>>,
) -> Frame {
    let mut rasterizer = ImageRenderer::new(cfg);
    (rasterizer.renderer, rasterizer.shutter) = (renderer, shutter);
    let mut frame = Frame::new(view.width, view.height, channels);
    let request = RenderRequest { scene, poses, view, lights: None, lens: None, previous: None };
    rasterizer.render_sample(&request, &FrameSample { noise: 0, shutter_open }, &mut frame.as_mut()).unwrap();
    frame
}
