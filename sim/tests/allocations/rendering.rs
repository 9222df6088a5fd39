//! After the first frame, rendering allocates no memory, and scratch memory stays small.

use crate::{AllocationCounter, allocations, assert_settles};
use kinetoscope_render::View;
use kinetoscope_render::frame::{Channels, Frame};
use kinetoscope_render::lens::Equidistant;
use kinetoscope_render::lens::{LensRays, Optics};
use kinetoscope_render::{
    Aperture, FrameSample, ImageRenderer, ParallelRenderer, PreviousState, RasterCfg, RenderRequest, Renderer, Shutter,
    ShutterOpenState,
};
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::{Capsule, Mesh, Plane, Sphere};
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::{Instance, Light, LightKind, Material, PoseF32, RenderScene};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Capsules, a mesh and a plane under two lights.
fn scene() -> (RenderScene, Vec<PoseF32>) {
    let ball: TriMesh = Shape::from(Sphere { radius: 0.3 }).tessellate(96);
    let mesh = Arc::new(RenderMesh::new(&ball, RenderMesh::DEFAULT_CREASE_ANGLE));
    let instance = |shape: Shape, id| Instance::new(shape, Material::default(), id);
    let mut instances = vec![instance(Plane::INFINITE.into(), 1), instance(Mesh { mesh }.into(), 2)];
    let mut poses = vec![PoseF32::from_translation([0., 0., -0.5]), PoseF32::IDENTITY];
    for k in 0..12 {
        instances.push(instance(Capsule { radius: 0.05, half_length: 0.2 }.into(), 3 + k));
        poses.push(PoseF32::from_translation([0.2 * k as f32 - 1.1, 0.3, 0.1]));
    }
    let mut scene = RenderScene::new(instances).unwrap();
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 4.0 };
    scene.lights.push(Light { kind: spot, position: [1., 1., 3.], direction: [-1., -1., -3.], ..Light::default() });
    (scene, poses)
}

const FOUR: Channels = Channels { color: true, depth: true, mask: true, normal: true, ..Channels::NONE };

fn view(size: [usize; 2]) -> View {
    View::look_at(size, 0.9, [2.2, -1.4, 1.2], [0., 0., 0.], [0., 0., 1.]).unwrap()
}

fn paths(max_bounces: u32) -> Renderer {
    Renderer::RayTraced { samples: 2, max_bounces, denoise: true, seed: 0 }
}

/// Asserts that the three calls after the first allocate no memory.
#[track_caller]
fn assert_steady(what: &str, mut draw: impl FnMut()) {
    draw();
    assert_eq!(allocations(|| (0..3).for_each(|_| draw())), 0, "{what}");
}

/// Scratch memory has at most the size of three images.
#[test]
fn raster() {
    let (scene, poses) = scene();
    for size in [[64, 64], [200, 120], [640, 480]] {
        for (samples, shadows) in [(1, false), (4, false), (1, true), (4, true)] {
            let what = format!("{size:?}, {samples} samples, shadows {shadows}");
            let (view, mut frame) = (view(size), Frame::new(size[0], size[1], FOUR));
            let mut rasterizer = ImageRenderer::new(RasterCfg { samples, shadows, ..RasterCfg::default() });
            assert_steady(&what, || rasterizer.render(&scene, &poses, &view, &mut frame).unwrap());
            let (scratch, image) = (rasterizer.scratch_bytes(), 24 * size[0] * size[1]);
            assert!(scratch <= 3 * image, "{what}: {scratch} > 3 x {image}");
        }
    }
}

/// Ray tracing and path tracing, every channel of moving objects, and lens rays.
#[test]
fn renderers() {
    let (scene, poses) = scene();
    let moved: Vec<PoseF32> = poses.iter().map(|_| PoseF32::from_translation([0.1, 0.0, 0.0])).collect();
    let (small, wide) = (view([96, 64]), view([320, 240]));
    let pixels = kinetoscope_render::PixelIntrinsics { fx: 90.0, fy: 90.0, cx: 160.0, cy: 120.0 };
    let optics = Optics::new(Equidistant { max_angle: 1.9 }.into(), pixels).unwrap();
    let rays = LensRays::new(&optics, [320, 240], 4).unwrap();
    // Less than 80 bytes per block of 64 pixels for its cone, and five samples of 12 bytes per pixel.
    assert!(rays.bytes() < 320 * 240 * (60 + 2), "{}", rays.bytes());
    let static_request =
        RenderRequest { scene: &scene, poses: &poses, view: &small, lights: None, lens: None, previous: None };
    let moving = RenderRequest { previous: Some(PreviousState { poses: &moved, view: &small }), ..static_request };
    let lens = RenderRequest { view: &wide, lens: Some(&rays), ..static_request };
    for (what, request, channels, renderer) in [
        ("still", static_request, FOUR, Renderer::Hybrid),
        ("still", static_request, FOUR, Renderer::FastRayTraced),
        ("still", static_request, FOUR, paths(2)),
        ("albedo and flow", moving, Channels::ALL, Renderer::Raster),
        ("albedo and flow", moving, Channels::ALL, Renderer::FastRayTraced),
        ("lens", lens, FOUR, Renderer::FastRayTraced),
        ("lens", lens, FOUR, paths(1)),
    ] {
        let mut frame = Frame::new(request.view.width, request.view.height, channels);
        let mut rasterizer = ImageRenderer::default();
        rasterizer.renderer = renderer;
        assert_steady(&format!("{what}, {renderer:?}"), || {
            rasterizer.render_request(&request, &mut frame.as_mut()).unwrap();
        });
    }
}

/// Emissive objects, a lens with an aperture, and a rolling shutter.
#[test]
fn rolling_shutter() {
    let (scene, poses) = scene();
    let mut instances = scene.instances().to_vec();
    instances.iter_mut().for_each(|instance| instance.material.emission = 0.5);
    let (scene, view) = (RenderScene::new(instances).unwrap(), view([64, 48]));
    let moved: Vec<PoseF32> = poses.iter().map(|_| PoseF32::from_translation([0.1, 0.0, 0.0])).collect();
    let opened = ShutterOpenState { poses: &moved, world_from_camera: view.world_from_camera, age: 0.1 };
    let take = FrameSample { noise: 1, shutter_open: Some(opened) };
    let mut frame = Frame::new(view.width, view.height, FOUR);
    let mut rasterizer = ImageRenderer::default();
    rasterizer.renderer = paths(2);
    rasterizer.aperture = Some(Aperture { focal_length: 0.05, f_number: 2.0, focus_distance: 2.0 });
    rasterizer.shutter = Shutter { row_time: 1e-3, exposure_time: 0.01 };
    let request = RenderRequest { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, previous: None };
    assert_steady("paths", || rasterizer.render_sample(&request, &take, &mut frame.as_mut()).unwrap());
}

/// Objects that enter the light and the image, approach and separate cause no further allocation.
#[test]
fn moving_objects() {
    let ball = || Instance::new(Sphere { radius: 0.3 }, Material::default(), 2);
    let instances = vec![Instance::new(Plane::INFINITE, Material::default(), 1), ball(), ball()];
    let mut scene = RenderScene::new(instances).unwrap();
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 1.0 };
    scene.lights = vec![Light { kind: spot, ..Light::default() }];
    let far = [50.0, 0.0, 0.3];
    let ball_positions = [
        [far, far],
        [[0.0, 0.0, 0.4], far],
        [[-1.8, 0.0, 0.4], [1.8, 0.0, 0.4]],
        [[-1.2, -1.2, 0.4], [1.2, 1.2, 0.4]],
        [[0.0, 0.0, 2.6], [0.0, 0.0, 0.4]],
    ];
    let moments =
        ball_positions.map(|[a, b]| [PoseF32::IDENTITY, PoseF32::from_translation(a), PoseF32::from_translation(b)]);
    for size in [[320, 240], [640, 480]] {
        let view = View::look_at(size, 0.9, [0.1, 0.0, 5.0], [0.; 3], [0., 0., 1.]).unwrap();
        let (mut frame, mut rasterizer) = (Frame::new(size[0], size[1], FOUR), ImageRenderer::default());
        rasterizer.render(&scene, &moments[0], &view, &mut frame).unwrap();
        for (k, poses) in moments.iter().enumerate() {
            let draw = || rasterizer.render(&scene, poses, &view, &mut frame).unwrap();
            assert_eq!(allocations(draw), 0, "{size:?}, moment {k}");
        }
    }
}

/// Few large images and many small ones, on three threads.
#[test]
fn batches() {
    let (scene, poses) = scene();
    for (size, frames) in [([320, 240], 1), ([160, 120], 3), ([160, 120], 37)] {
        let view = view(size);
        let counting = Arc::new(AllocationCounter::default());
        let mut rasterizer = ParallelRenderer::new(RasterCfg::default(), 3).with_pool(counting.pool(3));
        let mut images = vec![Frame::new(view.width, view.height, FOUR); frames];
        let request =
            RenderRequest { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, previous: None };
        let mut jobs: Vec<_> = images.iter_mut().map(|frame| (request, frame.as_mut())).collect();
        let mut draw = || {
            rasterizer.render(&mut jobs).unwrap();
            counting.allocations.swap(0, Ordering::Relaxed)
        };
        assert!(draw() > 0, "the control: the first batch allocates memory");
        assert_settles(&format!("{size:?}, {frames} frames"), draw);
    }
}
