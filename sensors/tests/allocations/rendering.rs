//! After the first frame, drawing allocates nothing, and keeps little.

use scene::mesh::TriMesh;
use scene::shape::{Capsule, Mesh, Plane, Sphere};
use scene::{Instance, Light, LightKind, Material, PoseF32, RenderMesh, RenderScene, Shape};
use sensors::camera::lens::Equidistant;
use sensors::camera::{
    Aperture, Before, Channels, Frame, LensRays, Opened, Optics, ParallelRasterizer, RasterCfg, Rasterizer, Renderer,
    Shot, Shutter, Take,
};
use sensors::visibility::View;
use sensors::{Crew, ScopedThreads, Threads};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Capsules, a mesh and a plane under two lamps.
fn scene() -> (RenderScene, Vec<PoseF32>) {
    let ball: TriMesh = Shape::from(Sphere { radius: 0.3 }).tessellate(96);
    let mesh = Arc::new(RenderMesh::new(&ball, RenderMesh::CREASE));
    let mut instances = vec![
        Instance::new(Plane::INFINITE, Material::default(), 1),
        Instance::new(Mesh { mesh }, Material::default(), 2),
    ];
    let mut poses = vec![PoseF32::from_translation([0., 0., -0.5]), PoseF32::IDENTITY];
    for k in 0..12 {
        instances.push(Instance::new(Capsule { radius: 0.05, half_length: 0.2 }, Material::default(), 3 + k));
        poses.push(PoseF32::from_translation([0.2 * k as f32 - 1.1, 0.3, 0.1]));
    }
    let mut scene = RenderScene::new(instances).expect("a good scene");
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 4.0 };
    scene.lights.push(Light { kind: spot, position: [1., 1., 3.], direction: [-1., -1., -3.], ..Light::default() });
    (scene, poses)
}

const FOUR: Channels = Channels { color: true, depth: true, mask: true, normal: true, ..Channels::NONE };

fn view(size: [usize; 2]) -> View {
    View::look_at(size, 0.9, [2.2, -1.4, 1.2], [0., 0., 0.], [0., 0., 1.]).expect("a good view")
}

#[test]
fn frames_allocate_nothing_and_scratch_memory_is_three_pictures_at_most() {
    let (scene, poses) = scene();
    for size in [[64, 64], [200, 120], [640, 480]] {
        for (samples, shadows) in [(1, false), (4, false), (1, true), (4, true)] {
            let view = view(size);
            let mut frame = Frame::new(view.width, view.height, FOUR);
            let mut rasterizer = Rasterizer::new(RasterCfg { samples, shadows, ..RasterCfg::default() });
            let mut draw = || rasterizer.render(&scene, &poses, &view, &mut frame).expect("a good frame");
            draw();
            let allocations = allocation_counter::measure(|| (0..3).for_each(|_| draw())).count_total;
            assert_eq!(allocations, 0, "{size:?}, {samples} samples, shadows {shadows}");
            let (scratch, picture) = (rasterizer.scratch_bytes(), 24 * size[0] * size[1]);
            println!("{size:?}, {samples} samples, shadows {shadows}: {scratch} bytes, picture {picture}");
            assert!(
                scratch <= 3 * picture,
                "{size:?}, {samples} samples, shadows {shadows}: {scratch} > 3 x {picture}"
            );
        }
    }
}

#[test]
fn pictures_by_rays_allocate_nothing() {
    let (scene, poses) = scene();
    let view = view([96, 64]);
    let paths = Renderer::RayTraced { samples: 2, max_bounces: 2, denoise: true, seed: 0 };
    for renderer in [Renderer::Hybrid, Renderer::FastRayTraced, paths] {
        let mut frame = Frame::new(view.width, view.height, FOUR);
        let mut rasterizer = Rasterizer::default();
        rasterizer.renderer = renderer;
        let mut draw = || rasterizer.render(&scene, &poses, &view, &mut frame).expect("a good frame");
        draw();
        let allocations = allocation_counter::measure(|| (0..2).for_each(|_| draw())).count_total;
        assert_eq!(allocations, 0, "{renderer:?}");
    }
}

/// What glows, a lens with an opening, a shutter that takes time: the second picture finds all its memory.
#[test]
fn pictures_of_rolling_shutters_allocate_nothing() {
    let (scene, poses) = scene();
    let mut instances = scene.instances().to_vec();
    instances.iter_mut().for_each(|instance| instance.material.emission = 0.5);
    let scene = RenderScene::new(instances).expect("a good scene");
    let view = view([64, 48]);
    let moved: Vec<PoseF32> = poses.iter().map(|_| PoseF32::from_translation([0.1, 0.0, 0.0])).collect();
    let opened = Opened { poses: &moved, world_from_camera: view.world_from_camera, before: 0.1 };
    let take = Take { noise: 1, opened: Some(opened) };
    let mut frame = Frame::new(view.width, view.height, FOUR);
    let mut rasterizer = Rasterizer::default();
    rasterizer.renderer = Renderer::RayTraced { samples: 2, max_bounces: 2, denoise: true, seed: 0 };
    rasterizer.aperture = Some(Aperture { focal_length: 0.05, f_number: 2.0, focus_distance: 2.0 });
    rasterizer.shutter = Shutter { row_time: 1e-3, exposure_time: 0.01 };
    let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, before: None };
    let mut draw = || rasterizer.render_take(&shot, &take, &mut frame.as_mut()).expect("a good frame");
    draw();
    let allocations = allocation_counter::measure(|| (0..3).for_each(|_| draw())).count_total;
    assert_eq!(allocations, 0);
}

/// Every channel there is, of things that moved since the picture before.
#[test]
fn albedo_and_flow_allocate_nothing() {
    let (scene, poses) = scene();
    let view = view([96, 64]);
    let moved: Vec<PoseF32> = poses.iter().map(|_| PoseF32::from_translation([0.1, 0.0, 0.0])).collect();
    let before = Some(Before { poses: &moved, view: &view });
    for renderer in [Renderer::Raster, Renderer::FastRayTraced] {
        let mut frame = Frame::new(view.width, view.height, Channels::ALL);
        let mut rasterizer = Rasterizer::default();
        rasterizer.renderer = renderer;
        let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, before };
        let mut draw = || rasterizer.render_shot(&shot, &mut frame.as_mut()).expect("a good frame");
        draw();
        let allocations = allocation_counter::measure(|| (0..3).for_each(|_| draw())).count_total;
        assert_eq!(allocations, 0, "{renderer:?}");
    }
}

/// Things come into the light and into the picture, come near and go apart: nothing of that takes memory.
#[test]
fn moving_things_allocate_nothing() {
    let ball = || Instance::new(Sphere { radius: 0.3 }, Material::default(), 2);
    let instances = vec![Instance::new(Plane::INFINITE, Material::default(), 1), ball(), ball()];
    let mut scene = RenderScene::new(instances).expect("a good scene");
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 1.0 };
    scene.lights = vec![Light { kind: spot, ..Light::default() }];
    let places =
        |a: [f32; 3], b: [f32; 3]| [PoseF32::IDENTITY, PoseF32::from_translation(a), PoseF32::from_translation(b)];
    let far = [50.0, 0.0, 0.3];
    let moments = [
        places(far, far),
        places([0.0, 0.0, 0.4], far),
        places([-1.8, 0.0, 0.4], [1.8, 0.0, 0.4]),
        places([-1.2, -1.2, 0.4], [1.2, 1.2, 0.4]),
        places([0.0, 0.0, 2.6], [0.0, 0.0, 0.4]),
    ];
    for size in [[320, 240], [640, 480]] {
        let view = View::look_at(size, 0.9, [0.1, 0.0, 5.0], [0.; 3], [0., 0., 1.]).expect("a good view");
        let mut frame = Frame::new(view.width, view.height, FOUR);
        let mut rasterizer = Rasterizer::default();
        rasterizer.render(&scene, &moments[0], &view, &mut frame).expect("a good frame");
        for (k, poses) in moments.iter().enumerate() {
            let draw = || rasterizer.render(&scene, poses, &view, &mut frame).expect("a good frame");
            let allocations = allocation_counter::measure(draw).count_total;
            assert_eq!(allocations, 0, "{size:?}, moment {k}");
        }
    }
}

/// The rays of a lens are there before the first picture.
#[test]
fn frames_through_a_lens_allocate_nothing() {
    let (scene, poses) = scene();
    let (size, view) = ([320, 240], view([320, 240]));
    let pixels = sensors::camera::PixelIntrinsics { fx: 90.0, fy: 90.0, cx: 160.0, cy: 120.0 };
    let optics = Optics::new(Equidistant { max_angle: 1.9 }.into(), pixels).expect("a good lens");
    let rays = LensRays::new(&optics, size, 4).expect("good rays");
    // A cone of less than 80 bytes for each block of 64 pixels, and five samples of 12 bytes.
    assert!(rays.bytes() < 320 * 240 * (60 + 2), "{}", rays.bytes());
    for renderer in
        [Renderer::FastRayTraced, Renderer::RayTraced { samples: 2, max_bounces: 1, denoise: true, seed: 0 }]
    {
        let mut frame = Frame::new(size[0], size[1], FOUR);
        let mut rasterizer = Rasterizer::default();
        rasterizer.renderer = renderer;
        let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: Some(&rays), before: None };
        let mut draw = || rasterizer.render_shot(&shot, &mut frame.as_mut()).expect("a good frame");
        draw();
        let allocations = allocation_counter::measure(|| (0..3).for_each(|_| draw())).count_total;
        assert_eq!(allocations, 0, "{renderer:?}");
    }
}

/// Threads that count what is allocated at the desks of others than the caller.
#[derive(Debug, Default)]
struct Counting(AtomicU64);

impl Threads for Counting {
    fn run(&self, desks: usize, work: &(dyn Fn(usize) + Sync)) {
        ScopedThreads.run(desks, &|desk| {
            let allocations = allocation_counter::measure(|| work(desk)).count_total;
            self.0.fetch_add(allocations, Ordering::Relaxed);
        });
    }
}

/// What comes to which thread is chance, and each thread's memory grows to what its largest share needs: there are at most
/// 400 batches until twenty in a row allocate nothing, whether there are few large pictures or many.
#[test]
fn batches_allocate_nothing_on_any_thread() {
    let (scene, poses) = scene();
    for (size, frames) in [([320, 240], 1), ([160, 120], 3), ([160, 120], 37)] {
        let view = view(size);
        let counting = Arc::new(Counting::default());
        let crew = Crew::new(Arc::<Counting>::clone(&counting));
        let mut rasterizer = ParallelRasterizer::new(RasterCfg::default(), 3).with_crew(crew);
        let mut frames = vec![Frame::new(view.width, view.height, FOUR); frames];
        let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, before: None };
        let mut jobs: Vec<_> = frames.iter_mut().map(|frame| (shot, frame.as_mut())).collect();
        let mut draw = || {
            rasterizer.render(&mut jobs).expect("good frames");
            counting.0.swap(0, Ordering::Relaxed)
        };
        let first = draw();
        let mut in_a_row = 0;
        for _ in 0..400 {
            in_a_row = if draw() == 0 { in_a_row + 1 } else { 0 };
            if in_a_row == 20 {
                break;
            }
        }
        assert!(first > 0, "the control: the first batch finds no memory yet");
        assert_eq!(in_a_row, 20, "{size:?}, {} frames", jobs.len());
    }
}
