//! Pictures through lenses: against closed forms, and against pictures without a lens of the same rays.

use super::super::lens::{Equidistant, OpenCv, Panorama};
use super::super::{
    Camera, CameraCfg, CameraError, Channels, DepthMiss, Frame, Intrinsics, Lens, LensRays, Optics, ParallelRasterizer,
    PixelIntrinsics, PointFrame, RasterCfg, Rasterizer, Renderer, Shot,
};
use super::determinism::bits;
use super::lenses::{FISHEYE, WARPED, all};
use super::scenes::{Random, figure, random};
use super::stage::{self, BALL, GROUND, RADIUS, built, context};
use super::traced::{Comparison, compare};
use crate::SensorError;
use crate::camera::rasterizer::Before;
use crate::lanes::{Level, levels};
use crate::sensor::{Sensor, SensorCfg};
use crate::visibility::raster::tile::SAMPLES;
use crate::visibility::{RenderError, View};
use nalgebra::{Point3, Vector3};
use scene::shape::{Plane, Sphere};
use scene::{Instance, Material, PoseF32, RenderScene};
use std::f64::consts::FRAC_PI_2;

const FEW_PATHS: Renderer = Renderer::RayTraced { samples: 4, max_bounces: 1, denoise: false, seed: 3 };
const SIZE: [usize; 2] = [64, 48];

/// A picture through a lens.
fn draw(renderer: Renderer, scene: &RenderScene, poses: &[PoseF32], view: &View, rays: Option<&LensRays>) -> Frame {
    let mut rasterizer = Rasterizer::new(RasterCfg::default());
    rasterizer.renderer = renderer;
    let mut frame = Frame::new(view.width, view.height, Channels::ALL);
    rasterizer
        .render_shot(&Shot { scene, poses, view, lights: None, lens: rays, before: None }, &mut frame.as_mut())
        .unwrap();
    frame
}

fn rays_of(lens: Lens, pixels: PixelIntrinsics, size: [usize; 2]) -> LensRays {
    LensRays::new(&Optics::new(lens, pixels).unwrap(), size, 4).unwrap()
}

/// The stage's camera behind a lens.
fn cfg_of(lens: Lens, pixels: PixelIntrinsics) -> CameraCfg {
    CameraCfg {
        width: SIZE[0],
        height: SIZE[1],
        intrinsics: pixels.into(),
        lens,
        renderer: Renderer::FastRayTraced,
        near: 0.3,
        far: 4.0,
        ..stage::cfg()
    }
}

/// Which of the stage's things a ray of any length meets between two numbers of its lengths: which number, id, and normal.
fn meets(eye: Point3<f64>, ray: Vector3<f64>, range: [f64; 2]) -> Option<(f64, i32, Vector3<f64>)> {
    let inside = |t: &f64| *t >= range[0] && *t <= range[1];
    let middle = Point3::from(stage::ball(0, 0));
    let (a, b, c) = (ray.norm_squared(), (eye - middle).dot(&ray), (eye - middle).norm_squared() - RADIUS * RADIUS);
    let root = (b * b - a * c).max(0.0).sqrt();
    let ball = [(-b - root) / a, (-b + root) / a].into_iter().filter(|_| b * b > a * c).find(inside);
    let ground = Some(-eye.z / ray.z).filter(|t| ray.z < 0.0 && inside(t));
    let of_ball = |t: f64| (t, BALL, (eye + ray * t - middle) / RADIUS);
    match (ball, ground) {
        (Some(b), Some(g)) if g < b => Some((g, GROUND, Vector3::z())),
        (Some(b), _) => Some(of_ball(b)),
        (None, g) => g.map(|g| (g, GROUND, Vector3::z())),
    }
}

/// A ball on an endless ground, by formulas along the double-precision ray of each pixel: depth, distance, mask, normal,
/// position, and the point cloud. Directions are single precision (6e-8), and so is the sum of some ten products of numbers
/// near 4 m: 1e-5 m at most, more where the ray grazes the surface.
#[test]
fn every_channel_is_what_the_ray_of_the_lens_meets() {
    for (lens, pixels) in all() {
        let cfg = cfg_of(lens, pixels);
        let camera = built(&cfg, &context(1));
        let optics = camera.optics(0).unwrap();
        let pose = camera.world_from_camera(0).unwrap();
        let eye = Point3::from(pose.translation.vector);
        let (depth, distance, mask) = (camera.depth().unwrap(), camera.distance().unwrap(), camera.mask().unwrap());
        let (normal, position, color) = (camera.normal().unwrap(), camera.position().unwrap(), camera.color().unwrap());
        let points = camera.point_map(0, PointFrame::World).unwrap();
        let (mut hits, mut misses, mut dark, mut edges, mut behind) = (0, 0, 0, 0, 0);
        for k in 0..SIZE[0] * SIZE[1] {
            let (x, y) = (k % SIZE[0], k / SIZE[0]);
            let number = |array: &ndarray::ArrayView4<'_, f32>| {
                Vector3::from([0, 1, 2].map(|axis| f64::from(array[(0, y, x, axis)])))
            };
            let Some(ray) = optics.ray([x as f64 + 0.5, y as f64 + 0.5]) else {
                dark += 1;
                assert!(
                    mask[(0, y, x)] == 0 && depth[(0, y, x)] == f32::INFINITY && points[(y, x, 0)] == f32::INFINITY
                );
                assert_eq!(distance[(0, y, x)], f32::INFINITY);
                let samples = SAMPLES[1..].iter().map(|offset| offset.map(|o| f64::from(o) / 256.0 + 0.5));
                if samples.into_iter().all(|[dx, dy]| optics.ray([x as f64 + dx, y as f64 + dy]).is_none()) {
                    assert_eq!([0, 1, 2, 3].map(|c| color[(0, y, x, c)]), [0, 0, 0, 255], "{}", lens.name());
                }
                continue;
            };
            let ray = Vector3::from(ray);
            let world = pose.rotation * ray;
            let range = [cfg.near, cfg.far];
            let met = meets(eye, world, range);
            // Where a ray a ten-thousandth beside, or a range as much longer, sees something else, single precision may.
            let others = (0..8).map(|n| {
                let beside = Vector3::from([n & 1, n >> 1 & 1, n >> 2 & 1].map(|b| f64::from(b) - 0.5)) * 2e-4;
                let by = 1.0 + f64::from(n & 1) * 2e-4 - 1e-4;
                meets(eye, world + beside * world.norm(), range.map(|r| r * by)).map_or(0, |m| m.1)
            });
            if others.into_iter().any(|id| id != met.map_or(0, |m| m.1)) {
                edges += 1;
                continue;
            }
            let Some((t, id, n)) = met else {
                misses += 1;
                assert!(mask[(0, y, x)] == 0 && depth[(0, y, x)] == f32::INFINITY, "{} at {x}, {y}", lens.name());
                assert!(distance[(0, y, x)] == f32::INFINITY && points[(y, x, 0)] == f32::INFINITY);
                continue;
            };
            hits += 1;
            behind += usize::from(ray.z <= 0.0);
            assert_eq!(mask[(0, y, x)], id, "{} at {x}, {y}", lens.name());
            let length = world.norm();
            let slant = (n.dot(&world) / length).abs();
            let tolerance = 1e-5 / slant;
            let near = |a: f32, b: f64| (f64::from(a) - b).abs() <= tolerance;
            assert!(near(depth[(0, y, x)], t * ray.z), "{} {} {}", lens.name(), depth[(0, y, x)], t * ray.z);
            assert!(near(distance[(0, y, x)], t * length), "{} {}", lens.name(), distance[(0, y, x)]);
            let at = eye + world * t;
            assert!((number(&position) - at.coords).norm() <= tolerance, "{} {at}", lens.name());
            let point = Vector3::from([0, 1, 2].map(|axis| f64::from(points[(y, x, axis)])));
            assert!((point - at.coords).norm() <= tolerance, "{} {at} {point}", lens.name());
            assert!((number(&normal) - if n.dot(&world) > 0.0 { -n } else { n }).norm() <= 1e-4 / slant);
        }
        println!("{}: {hits} hits ({behind} behind), {misses} misses, {dark} dark, {edges} edges", lens.name());
        assert!(hits > 300 && edges * 5 < SIZE[0] * SIZE[1], "{}: {hits} hits, {edges} edges", lens.name());
        let angle = lens.domain().unwrap().angle;
        assert!(if angle > 1.75 { behind > 0 } else { behind == 0 || angle > FRAC_PI_2 }, "{}: {behind}", lens.name());
        let cloud = camera.point_cloud(0, PointFrame::Camera).unwrap();
        assert_eq!(cloud.nrows(), mask.iter().filter(|&&id| id != 0).count());
    }
}

/// What a pixel shows is what a picture of one pixel of a pinhole shows that looks the same way: of meshes, boxes and all else.
#[test]
fn a_pixel_shows_what_a_pinhole_shows_that_looks_there() {
    let (mut compared, mut different, mut seen) = (0, 0, 0);
    for (k, (lens, pixels)) in all().into_iter().enumerate() {
        let (scene, poses) = if k % 2 == 0 { figure() } else { random(&mut Random(k as u64), 1.5) };
        let view = View::look_at(SIZE, 0.9, [1.3, -0.8, 0.9], [0.1, 0., 0.4], [0., 0., 1.]).unwrap();
        let rays = rays_of(lens, pixels, SIZE);
        let frame = draw(Renderer::FastRayTraced, &scene, &poses, &view, Some(&rays));
        let r = view.world_from_camera.rotation.map(|r| Vector3::from(r.map(f64::from)));
        for at in (0..SIZE[0] * SIZE[1]).step_by(13) {
            let Some(ray) = rays.optics().unproject([(at % SIZE[0]) as f64 + 0.5, (at / SIZE[0]) as f64 + 0.5]) else {
                continue;
            };
            let z = Vector3::from([0, 1, 2].map(|i| r[i].dot(&Vector3::from(ray))));
            let x = z.cross(&if z.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() }).normalize();
            let y = z.cross(&x);
            let rotation = [0, 1, 2].map(|i| [x[i] as f32, y[i] as f32, z[i] as f32]);
            let there = PoseF32 { rotation, ..view.world_from_camera };
            let one =
                View { width: 1, height: 1, fx: 1e6, fy: 1e6, cx: 0.5, cy: 0.5, world_from_camera: there, ..view };
            let alone = draw(Renderer::FastRayTraced, &scene, &poses, &one, None);
            compared += 1;
            let (a, b) = (frame.distance.as_ref().unwrap()[at], alone.depth.as_ref().unwrap()[0]);
            let (m, n) = (frame.mask.as_ref().unwrap()[at], alone.mask.as_ref().unwrap()[0]);
            let vector =
                |f: &Option<Vec<f32>>, k: usize| Vector3::from_row_slice(&f.as_ref().unwrap()[3 * k..3 * k + 3]);
            let cosine = vector(&frame.normal, at).dot(&vector(&alone.normal, 0));
            // Forward lenses have near and far along their axis: nothing here is near either.
            let same = m == n && (a == b || (a - b).abs() <= 1e-4 * b && cosine > 0.9999);
            seen += usize::from(n != 0);
            different += usize::from(!same);
        }
    }
    println!("{different} of {compared} differ, {seen} see something");
    // Rays that are 1e-7 apart see different triangles within that of an edge: one pixel in thousands.
    assert!(compared > 1500 && seen > compared / 4 && different * 500 <= compared, "{different} of {compared}");
}

#[test]
fn a_lens_that_bends_nothing_is_no_lens() {
    let cfg = |lens, renderer| CameraCfg { lens, renderer, ..stage::cfg() };
    for renderer in [Renderer::FastRayTraced, FEW_PATHS, Renderer::Raster, Renderer::Hybrid] {
        let [none, zero] = [Lens::default(), OpenCv::default().into()]
            .map(|lens| stage::bits(&built(&cfg(lens, renderer), &context(1)), 0..1));
        assert!(none == zero, "{renderer:?}");
    }
    // A control: a little bends.
    let [none, little] = [Lens::default(), OpenCv { k1: 1e-3, ..OpenCv::default() }.into()]
        .map(|lens| stage::bits(&built(&cfg(lens, Renderer::FastRayTraced), &context(1)), 0..1));
    assert!(none != little);
    // Its rays from a table show the same too, where no silhouette is.
    let (mut compared, mut different) = (0, 0);
    for seed in 0..6 {
        let r = &mut Random(seed);
        let (scene, poses) = random(r, 1.2);
        let view = View::look_at([101, 75], 1.0, [2.0, 0.5, 1.0], [0.; 3], [0., 0., 1.]).unwrap();
        let view = View { cx: 44.25, fy: 80.5, ..view };
        let [fx, fy, cx, cy] = [view.fx, view.fy, view.cx, view.cy].map(f64::from);
        let rays = rays_of(OpenCv::default().into(), PixelIntrinsics { fx, fy, cx, cy }, [101, 75]);
        for renderer in [Renderer::FastRayTraced, Renderer::Hybrid] {
            let [a, b] = [None, Some(&rays)].map(|rays| draw(renderer, &scene, &poses, &view, rays));
            let Comparison { compared: all, different: other, .. } = compare(&a, &b, 101);
            (compared, different) = (compared + all, different + other);
            let pixels = a.color.as_ref().unwrap().chunks(4).zip(b.color.as_ref().unwrap().chunks(4));
            let far_apart = pixels.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 3)).count();
            assert!(far_apart * 100 < 101 * 75, "{far_apart} pixels look different by {renderer:?}");
        }
    }
    assert!(compared > 2 * 6 * 101 * 75 / 2 && different * 1000 <= compared, "{different} of {compared}");
}

/// Samples of colours go through the lens, each where it is in the pixel.
#[test]
fn samples_have_rays_of_their_own() {
    use crate::lanes::{Level, at_level, load};
    let (lens, pixels) = (Lens::from(FISHEYE), PixelIntrinsics { fx: 20.0, fy: 22.0, cx: 30.25, cy: 25.5 });
    let rays = rays_of(lens, pixels, SIZE);
    for (k, offset) in SAMPLES.iter().enumerate() {
        let at = [31.5 + offset[0] as f32 / 256.0, 17.5 + offset[1] as f32 / 256.0];
        let expected = rays.optics().ray(at.map(f64::from)).unwrap().map(|x| x as f32);
        assert_eq!(rays.direction(k, [31, 17]), expected);
        let found = at_level!(Level::best(), s => {
            let found = rays.of_points(s, load(s, &[at[0]; 16]), load(s, &[at[1]; 16]));
            [found.x, found.y, found.z].map(|x| x.array()[7])
        });
        assert_eq!(found, expected);
    }
    // A white ball before a black sky: a bright pixel, a dark one, or as many quarters as of its samples see the ball.
    let white = Material { emission: 1.0, specular: 0.0, ..Material::from_rgba([1.0; 4]) };
    let mut scene = RenderScene::new(vec![Instance::new(Sphere { radius: 0.4 }, white, 1)]).unwrap();
    scene.lights.clear();
    scene.headlight.active = false;
    scene.sky = scene::Sky::uniform([0.0; 3]);
    scene.ambient = scene::Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
    let view = View::look_at(SIZE, 0.9, [1.0, 0.2, 0.3], [0.0; 3], [0., 0., 1.]).unwrap();
    let frame = draw(Renderer::FastRayTraced, &scene, &[PoseF32::IDENTITY], &view, Some(&rays));
    let color = frame.color.unwrap();
    let shades: std::collections::BTreeSet<u8> = color.chunks(4).map(|c| c[0]).collect();
    println!("{shades:?}");
    assert_eq!(shades.len(), 5, "{shades:?}");
    let eye = Vector3::from(view.world_from_camera.translation.map(f64::from));
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let mut margin = f64::INFINITY;
            let hits = SAMPLES[1..].iter().filter(|offset| {
                let at = [x as f64 + 0.5 + f64::from(offset[0]) / 256.0, y as f64 + 0.5 + f64::from(offset[1]) / 256.0];
                let Some(ray) = rays.optics().unproject(at) else { return false };
                let rotation = view.world_from_camera.rotation;
                let d = Vector3::from(rotation.map(|r| (0..3).map(|k| f64::from(r[k]) * ray[k]).sum::<f64>()));
                let beside = (eye - d * eye.dot(&d)).norm() - 0.4;
                margin = margin.min(beside.abs());
                beside < 0.0 && eye.dot(&d) < 0.0
            });
            let hits = hits.count();
            let shade = color[4 * (y * SIZE[0] + x)];
            let rank = shades.iter().position(|s| *s == shade).unwrap();
            assert!(rank == hits || margin < 1e-5, "{x}, {y}: {hits} samples, shade {rank}");
        }
    }
}

/// Paths change no channel but the colour, and leave black what is outside of the image circle; the sky is as bright as
/// without a lens.
#[test]
fn paths_go_through_the_lens() {
    let (lens, pixels) =
        (Lens::from(Equidistant { max_angle: 1.2 }), PixelIntrinsics { fx: 16.0, fy: 16.0, cx: 32.0, cy: 24.0 });
    let (scene, poses) = figure();
    let view = View::look_at(SIZE, 0.9, [1.6, -0.9, 1.0], [0.1, 0., 0.7], [0., 0., 1.]).unwrap();
    let rays = rays_of(lens, pixels, SIZE);
    let [fast, paths] = [Renderer::FastRayTraced, FEW_PATHS].map(|r| draw(r, &scene, &poses, &view, Some(&rays)));
    let without = |frame: &Frame| bits(&Frame { color: None, ..frame.clone() });
    assert!(without(&fast) == without(&paths) && fast.color != paths.color);
    let gray = [0.25, 0.5, 0.75];
    let mut empty = RenderScene::new(vec![Instance::new(Plane { half: [1e-3; 2] }, Material::default(), 1)]).unwrap();
    empty.sky = scene::Sky::uniform(gray);
    let below = [PoseF32::from_translation([0.0, 0.0, -50.0])];
    let plain = draw(FEW_PATHS, &empty, &below, &view, None).color.unwrap();
    for renderer in [Renderer::FastRayTraced, FEW_PATHS] {
        let color = draw(renderer, &empty, &below, &view, Some(&rays)).color.unwrap();
        for (k, pixel) in color.chunks(4).enumerate() {
            let at = [(k % SIZE[0]) as f64 + 0.5 - 32.0, (k / SIZE[0]) as f64 + 0.5 - 24.0];
            let radius = at[0].hypot(at[1]) / 16.0;
            // A pixel's corners are 0.71 pixels from its middle.
            if radius < 1.2 - 0.75 / 16.0 {
                assert_eq!(pixel, &plain[..4], "{renderer:?} {k}");
            } else if radius > 1.2 + 0.75 / 16.0 {
                assert_eq!(pixel, [0, 0, 0, 255], "{renderer:?} {k}");
            }
        }
    }
}

/// Behind lenses, the hybrid's rays see what all rays see. Its shadows are sharp: the light of pixels with no shadow's edge and
/// no silhouette beside them is that of shadow maps too.
#[test]
fn the_hybrid_sees_through_lenses() {
    const BESIDE: usize = 2;
    let mut all_shadowed = 0;
    for (lens, pixels) in all().into_iter().filter(|(lens, _)| !lens.is_pinhole()) {
        let rays = rays_of(lens, pixels, SIZE);
        let (scene, poses) = figure();
        let view = View::look_at(SIZE, 0.9, [1.6, -0.9, 1.0], [0.1, 0., 0.7], [0., 0., 1.]).unwrap();
        let [fast, hybrid] =
            [Renderer::FastRayTraced, Renderer::Hybrid].map(|r| draw(r, &scene, &poses, &view, Some(&rays)));
        let without = |frame: &Frame| bits(&Frame { color: None, ..frame.clone() });
        assert!(without(&fast) == without(&hybrid), "{}", lens.name());
        let mut bright = Rasterizer::new(RasterCfg { shadows: false, ..RasterCfg::default() });
        bright.renderer = Renderer::Hybrid;
        let mut lit = Frame::new(SIZE[0], SIZE[1], Channels::ALL);
        let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: Some(&rays), before: None };
        bright.render_shot(&shot, &mut lit.as_mut()).unwrap();
        let color =
            |frame: &Frame, k: usize| <[u8; 4]>::try_from(&frame.color.as_ref().unwrap()[4 * k..][..4]).unwrap();
        // What is there, and whether it is in a shadow.
        let kind = |k: usize| (hybrid.mask.as_ref().unwrap()[k], color(&hybrid, k) == color(&lit, k));
        let (mut judged, mut shadowed, mut other) = (0, 0, 0);
        for k in 0..SIZE[0] * SIZE[1] {
            let different = color(&fast, k).iter().zip(color(&hybrid, k)).any(|(a, b)| a.abs_diff(b) > 2);
            other += usize::from(different);
            let around = |size: usize, at: usize| at.saturating_sub(BESIDE)..(at + BESIDE + 1).min(size);
            let (x, y) = (k % SIZE[0], k / SIZE[0]);
            let mut beside = around(SIZE[1], y).flat_map(|y| around(SIZE[0], x).map(move |x| y * SIZE[0] + x));
            if beside.all(|there| kind(there) == kind(k)) {
                assert!(!different, "{} {x} {y}: {:?} {:?}", lens.name(), color(&fast, k), color(&hybrid, k));
                judged += 1;
                shadowed += usize::from(!kind(k).1);
            }
        }
        println!("{}: {judged} judged, {shadowed} of them in a shadow, {other} are others", lens.name());
        // Edges of shadows are others: the control.
        assert!(judged > 500 && other > 0, "{}: {judged} {other}", lens.name());
        all_shadowed += shadowed;
    }
    assert!(all_shadowed > 0);
}

#[test]
fn the_rasterizer_draws_straight_lines_and_refuses_lenses() {
    let (lens, pixels) = (Lens::from(WARPED), PixelIntrinsics { fx: 50.0, fy: 50.0, cx: 32.0, cy: 24.0 });
    let error = CameraCfg { renderer: Renderer::Raster, ..cfg_of(lens, pixels) }.build(&context(1)).unwrap_err();
    let expected = RenderError::LensRenderer { lens: "opencv", renderer: "raster" };
    assert_eq!(error, SensorError::Camera(CameraError::View(expected.clone())));
    assert!(error.to_string().contains("renderer: FastRayTraced"), "{error}");
    // And so do pictures without a camera.
    let (scene, poses) = figure();
    let view = View::look_at(SIZE, 0.9, [1.6, -0.9, 1.0], [0.; 3], [0., 0., 1.]).unwrap();
    let rays = rays_of(lens, pixels, SIZE);
    let mut rasterizer = Rasterizer::default();
    let mut frame = Frame::new(SIZE[0], SIZE[1], Channels::ALL);
    let shot = |lens| Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: Some(lens), before: None };
    assert_eq!(rasterizer.render_shot(&shot(&rays), &mut frame.as_mut()).unwrap_err(), expected);
    // Rays of another picture, or of too few samples.
    let few = LensRays::new(rays.optics(), SIZE, 1).unwrap();
    let other = LensRays::new(rays.optics(), [32, 48], 4).unwrap();
    for renderer in [Renderer::FastRayTraced, Renderer::Hybrid] {
        rasterizer.renderer = renderer;
        for (rays, found, found_samples) in [(&few, SIZE, 1), (&other, [32, 48], 4)] {
            let error = rasterizer.render_shot(&shot(rays), &mut frame.as_mut()).unwrap_err();
            assert_eq!(error, RenderError::LensRays { expected: SIZE, samples: 4, found, found_samples });
        }
    }
    let folds = OpenCv { k1: -0.9, ..OpenCv::default() };
    let error = cfg_of(folds.into(), pixels).build(&context(1)).unwrap_err();
    assert!(matches!(error, SensorError::Camera(CameraError::LensFolds { .. })), "{error}");
}

/// Intrinsics of one environment behind a lens: the others keep theirs, and all come back.
#[test]
fn environments_have_intrinsics_of_their_own_behind_a_lens() {
    let lens = Lens::from(Equidistant::default());
    let pixels = PixelIntrinsics { fx: 18.0, fy: 20.0, cx: 32.0, cy: 24.0 };
    let cfg = cfg_of(lens, pixels);
    let mut camera = built(&cfg, &context(3));
    let before: Vec<Vec<u32>> = (0..3).map(|row| stage::bits(&camera, row..row + 1)).collect();
    let bytes = camera.lens_bytes();
    assert_eq!(bytes, rays_of(lens, pixels, SIZE).bytes(), "all environments share one table");
    let other = Intrinsics::Pixels { fx: 25.0, fy: 22.0, cx: 30.0, cy: 20.0 };
    camera.set_intrinsics(&[other], Some(&[1])).unwrap();
    assert_eq!(camera.lens_bytes(), 2 * bytes);
    let now: Vec<Vec<u32>> = (0..3).map(|row| stage::bits(&camera, row..row + 1)).collect();
    assert!(now[0] == before[0] && now[1] != before[1] && now[2] == before[2]);
    // As a camera that was built so.
    let alone = built(&CameraCfg { intrinsics: other, ..cfg }, &context(3));
    assert!(stage::bits(&alone, 1..2) == now[1]);
    assert_eq!(camera.optics(1).unwrap().pixels(), other.to_pixels(64, 48).unwrap());
    // A mistake changes nothing.
    let bad = Intrinsics::Pixels { fx: 25.0, fy: 22.0, cx: 3000.0, cy: 20.0 };
    let error = camera.set_intrinsics(&[bad], Some(&[0])).unwrap_err();
    assert!(matches!(error, SensorError::Camera(CameraError::LensBlind { .. })), "{error}");
    assert!(camera.set_intrinsics(&[other; 2], None).is_err());
    assert!((0..3).all(|row| stage::bits(&camera, row..row + 1) == now[row]));
    camera.restore(None).unwrap();
    assert!((0..3).all(|row| stage::bits(&camera, row..row + 1) == before[row]));
    assert_eq!(camera.lens_bytes(), bytes);
}

/// Points need distances where depth says nothing, and misses are none however they are written.
#[test]
fn point_clouds_of_wide_lenses_need_distances() {
    let pixels = Panorama::intrinsics(64, 48).to_pixels(64, 48).unwrap();
    let cfg = cfg_of(Panorama {}.into(), pixels);
    let count = |camera: &Camera| camera.point_cloud(0, PointFrame::World).map(|cloud| cloud.nrows());
    let all = count(&built(&cfg, &context(1))).unwrap();
    for depth_miss in [DepthMiss::Far, DepthMiss::Zero] {
        assert_eq!(count(&built(&CameraCfg { depth_miss, ..cfg.clone() }, &context(1))).unwrap(), all);
    }
    let channels = Channels { depth: true, ..Channels::default() };
    let error = count(&built(&CameraCfg { channels, ..cfg }, &context(1))).unwrap_err();
    assert!(matches!(error, SensorError::Camera(CameraError::ChannelOff { channel: "distance", .. })), "{error}");
}

#[test]
fn lens_pictures_have_the_same_bits_on_every_level_and_for_any_number_of_threads() {
    let (scene, poses) = figure();
    let view = View::look_at(SIZE, 0.9, [1.6, -0.9, 1.0], [0.1, 0., 0.7], [0., 0., 1.]).unwrap();
    for (lens, pixels) in all().into_iter().filter(|(lens, _)| !lens.is_pinhole()) {
        let rays = rays_of(lens, pixels, SIZE);
        // Farther to the side, and of other intrinsics.
        let old = View::look_at(SIZE, 0.8, [1.5, -1.0, 1.1], [0.1, 0., 0.7], [0., 0., 1.]).unwrap();
        let before = Some(Before { poses: &poses, view: &old });
        let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: Some(&rays), before };
        for renderer in [Renderer::FastRayTraced, Renderer::Hybrid, FEW_PATHS] {
            let frame = |level| {
                let mut rasterizer = Rasterizer::with_level(RasterCfg::default(), level);
                rasterizer.renderer = renderer;
                let mut frame = Frame::new(SIZE[0], SIZE[1], Channels::ALL);
                rasterizer.render_shot(&shot, &mut frame.as_mut()).unwrap();
                frame
            };
            let alone = frame(Level::best());
            assert!(alone.flow.as_ref().unwrap().iter().any(|x| x.is_finite() && *x != 0.0), "things move");
            let alone = bits(&alone);
            for level in levels() {
                let frame = frame(level);
                assert!(bits(&frame) == alone, "{} {renderer:?} {level:?}", lens.name());
            }
            for threads in [2, 3] {
                let mut parallel = ParallelRasterizer::new(RasterCfg::default(), threads);
                parallel.set_renderer(renderer);
                let mut frame = Frame::new(SIZE[0], SIZE[1], Channels::ALL);
                parallel.render(&mut [(shot, frame.as_mut())]).unwrap();
                assert!(bits(&frame) == alone, "{} {renderer:?} {threads} threads", lens.name());
            }
        }
    }
}

/// The arrows along the edges go where the corners look; corners that show nothing have none.
#[test]
fn markers_follow_the_lens() {
    let pixels = PixelIntrinsics { fx: 20.0, fy: 20.0, cx: 32.0, cy: 24.0 };
    let count = |max_angle| {
        let camera = built(&cfg_of(Equidistant { max_angle }.into(), pixels), &context(1));
        camera.markers(0, &|_| scene::Pose::identity()).len()
    };
    // Corners are 40 pixels from the middle: 2 rad.
    assert_eq!((count(2.01), count(1.99)), (5, 1));
}
