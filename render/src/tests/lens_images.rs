//! Images through lenses, compared with closed forms, and with pinhole images of the same rays.

use super::harness::{TestFrame, count_different, look_at_view};
use super::lenses::{FISHEYE, WARPED, all, distorting, rays_of};
use super::traced::{Comparison, compare};
use crate::intrinsics::PixelIntrinsics;
use crate::lens::{Equidistant, LensRays, OpenCv};
use crate::raster::tile::SAMPLES;
use crate::renderer::Renderer;
use crate::request::RasterCfg;
use crate::simd::SimdLevel;
use crate::visibility::{RenderError, View};
use kinetoscope_scene::shape::{Plane, Sphere};
use kinetoscope_scene::{Material, PoseF32, Sky};
use kinetoscope_testkit::scenes::{TestRng, humanoid, instances, matte, random_scene, translation, unlit};
use nalgebra::Vector3;

const FEW_PATHS: Renderer = Renderer::RayTraced { samples: 4, max_bounces: 1, denoise: false, seed: 3 };

const SIZE: [usize; 2] = [64, 48];

/// The full figure through a lens.
fn figure_through(rays: &LensRays) -> TestFrame {
    let view = look_at_view(SIZE, 0.9, [1.6, -0.9, 1.0], [0.1, 0., 0.7]);
    TestFrame { lens: Some(rays.clone()), ..TestFrame::new(humanoid(), view) }
}

/// A pixel equals an image of one pixel of a pinhole camera along its ray: for meshes, boxes and all other shapes.
#[test]
fn single_pixels() {
    let (mut compared, mut different, mut seen) = (0, 0, 0);
    for (k, (lens, pixels)) in all().into_iter().enumerate() {
        let scene = if k % 2 == 0 { humanoid() } else { random_scene(&mut TestRng(k as u64), 1.5) };
        let rays = rays_of(lens, pixels, SIZE);
        let still = TestFrame::new(scene, look_at_view(SIZE, 0.9, [1.3, -0.8, 0.9], [0.1, 0., 0.4]));
        let mut still = TestFrame { renderer: Renderer::FastRayTraced, lens: Some(rays.clone()), ..still };
        let mut rasterizer = still.rasterizer(SimdLevel::best());
        let image = still.draw_by(&mut rasterizer).unwrap();
        let view = still.view;
        let camera = view.world_from_camera;
        still.lens = None;
        for at in (0..SIZE[0] * SIZE[1]).step_by(13) {
            let Some(ray) = rays.optics().unproject([(at % SIZE[0]) as f64 + 0.5, (at / SIZE[0]) as f64 + 0.5]) else {
                continue;
            };
            let z = Vector3::from(camera.rotation.map(|r| Vector3::from(r.map(f64::from)).dot(&Vector3::from(ray))));
            let x = z.cross(&if z.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() }).normalize();
            let y = z.cross(&x);
            let rotation = [0, 1, 2].map(|i| [x[i] as f32, y[i] as f32, z[i] as f32]);
            let world_from_camera = PoseF32 { rotation, ..camera };
            let one = View { width: 1, height: 1, fx: 1e6, fy: 1e6, cx: 0.5, cy: 0.5, world_from_camera, ..view };
            let alone = TestFrame { view: one, ..still.clone() }.draw_by(&mut rasterizer).unwrap();
            let (a, b) = (image.distance()[at], alone.depth()[0]);
            let cosine = Vector3::from(image.normal()[at]).dot(&Vector3::from(alone.normal()[0]));
            // Forward lenses measure near and far along their axis: no surface here is near either.
            let near = a == b || (a - b).abs() <= 1e-4 * b && cosine > 0.9999;
            compared += 1;
            seen += usize::from(alone.mask()[0] != 0);
            different += usize::from(image.mask()[at] != alone.mask()[0] || !near);
        }
    }
    // Rays that are 1e-7 apart hit different triangles within that of an edge: one pixel in thousands.
    assert!(compared > 1500 && seen > compared / 4 && different * 500 <= compared, "{different} of {compared}");
}

#[test]
fn lens_without_distortion() {
    // Rays from a table give the same image as a pinhole, away from silhouettes.
    let (mut compared, mut different) = (0, 0);
    for seed in 0..6 {
        let view = View { cx: 44.25, fy: 80.5, ..look_at_view([101, 75], 1.0, [2.0, 0.5, 1.0], [0.; 3]) };
        let [fx, fy, cx, cy] = [view.fx, view.fy, view.cx, view.cy].map(f64::from);
        let rays = rays_of(OpenCv::default().into(), PixelIntrinsics { fx, fy, cx, cy }, [101, 75]);
        let still = TestFrame::new(random_scene(&mut TestRng(seed), 1.2), view);
        for renderer in [Renderer::FastRayTraced, Renderer::Hybrid] {
            // Shadow maps cover the view of a pinhole, and the whole scene with a lens: the edges of shadows differ.
            let still = still.with(|still| still.cfg.shadows = renderer == Renderer::Hybrid);
            let (a, b) = (
                still.with_renderer(renderer),
                TestFrame { lens: Some(rays.clone()), ..still.clone() }.with_renderer(renderer),
            );
            let Comparison { compared: all, different: other, .. } = compare(&a, &b);
            (compared, different) = (compared + all, different + other);
            let differ = count_different(&a, &b, 3);
            assert!(differ * 100 < 101 * 75, "{differ} pixels look different by {renderer:?}");
        }
    }
    assert!(compared > 2 * 6 * 101 * 75 / 2 && different * 1000 <= compared, "{different} of {compared}");
}

/// Color samples have their own rays through the lens, each at its position in the pixel.
#[test]
fn sample_rays() {
    let pixels = PixelIntrinsics { fx: 20.0, fy: 22.0, cx: 30.25, cy: 25.5 };
    let rays = rays_of(FISHEYE.into(), pixels, SIZE);
    for (k, offset) in SAMPLES.iter().enumerate() {
        let at = [31.5 + offset[0] as f32 / 256.0, 17.5 + offset[1] as f32 / 256.0];
        let expected = rays.optics().ray(at.map(f64::from)).unwrap().map(|x| x as f32);
        assert_eq!(rays.direction(k, [31, 17]), expected);
    }
    // A white ball in front of a black sky: the brightness of a pixel is the number of samples that hit the ball.
    let white = Material { emission: 1.0, ..matte([1.0; 3]) };
    let (scene, poses) = instances([(Sphere { radius: 0.4 }, white, PoseF32::IDENTITY)]);
    let mut scene = unlit(scene);
    scene.sky = Sky::uniform([0.0; 3]);
    let view = look_at_view(SIZE, 0.9, [1.0, 0.2, 0.3], [0.0; 3]);
    let still = TestFrame { lens: Some(rays.clone()), ..TestFrame::new((scene, poses), view) };
    let image = still.with_renderer(Renderer::FastRayTraced);
    let shades: std::collections::BTreeSet<u8> = image.color().iter().map(|c| c[0]).collect();
    assert_eq!(shades.len(), 5, "{shades:?}");
    let eye = Vector3::from(view.world_from_camera.translation.map(f64::from));
    for (k, color) in image.color().iter().enumerate() {
        let mut margin = f64::INFINITY;
        let hits = SAMPLES[1..].iter().filter(|offset| {
            let [dx, dy] = offset.map(|o| f64::from(o) / 256.0 + 0.5);
            let ray = rays.optics().unproject([(k % SIZE[0]) as f64 + dx, (k / SIZE[0]) as f64 + dy]);
            let Some(ray) = ray.map(Vector3::from) else { return false };
            let d = Vector3::from(view.world_from_camera.rotation.map(|r| Vector3::from(r.map(f64::from)).dot(&ray)));
            let beside = (eye - d * eye.dot(&d)).norm() - 0.4;
            margin = margin.min(beside.abs());
            beside < 0.0 && eye.dot(&d) < 0.0
        });
        let hits = hits.count();
        let rank = shades.iter().position(|s| *s == color[0]).unwrap();
        assert!(rank == hits || margin < 1e-5, "pixel {k}: {hits} samples, shade {rank}");
    }
}

/// Path tracing changes no channel but color, and leaves pixels outside of the image circle black; the sky is as bright
/// as without a lens.
#[test]
fn paths() {
    let pixels = PixelIntrinsics { fx: 16.0, fy: 16.0, cx: 32.0, cy: 24.0 };
    let rays = rays_of(Equidistant { max_angle: 1.2 }.into(), pixels, SIZE);
    let still = figure_through(&rays);
    let [fast, paths] = [Renderer::FastRayTraced, FEW_PATHS].map(|renderer| still.with_renderer(renderer));
    assert!(fast.bits_but_color() == paths.bits_but_color() && fast.color() != paths.color());
    let (mut scene, poses) =
        instances([(Plane { half: [1e-3; 2] }, Material::default(), translation(0.0, 0.0, -50.0))]);
    scene.sky = Sky::uniform([0.25, 0.5, 0.75]);
    let empty = TestFrame { scene, poses, ..still };
    let plain = TestFrame { lens: None, ..empty.clone() }.with_renderer(FEW_PATHS).color()[0];
    for renderer in [Renderer::FastRayTraced, FEW_PATHS] {
        for (k, color) in empty.with_renderer(renderer).color().iter().enumerate() {
            let at = [(k % SIZE[0]) as f64 + 0.5 - 32.0, (k / SIZE[0]) as f64 + 0.5 - 24.0];
            let radius = at[0].hypot(at[1]) / 16.0;
            // A pixel's corners are 0.71 pixels from its center.
            if (radius - 1.2).abs() > 0.75 / 16.0 {
                assert_eq!(*color, if radius < 1.2 { plain } else { [0, 0, 0, 255] }, "{renderer:?} {k}");
            }
        }
    }
}

/// With lenses, the hybrid has ray-traced visibility. Its shadows are sharp: pixels without a shadow edge or a
/// silhouette nearby have the same light as with shadow maps.
#[test]
fn hybrid() {
    const BESIDE: usize = 2;
    let mut all_shadowed = 0;
    for (lens, rays) in distorting() {
        let still = figure_through(&rays);
        let [fast, hybrid] = [Renderer::FastRayTraced, Renderer::Hybrid].map(|renderer| still.with_renderer(renderer));
        assert!(fast.bits_but_color() == hybrid.bits_but_color(), "{}", lens.name());
        let cfg = RasterCfg { shadows: false, ..RasterCfg::default() };
        let lit = TestFrame { cfg, ..still }.with_renderer(Renderer::Hybrid);
        let shadow = |k: usize| hybrid.color()[k] != lit.color()[k];
        let kind = |k: usize| (hybrid.mask()[k], shadow(k));
        let (mut judged, mut shadowed, mut other) = (0, 0, 0);
        for k in 0..SIZE[0] * SIZE[1] {
            let (a, b) = (fast.color()[k], hybrid.color()[k]);
            let different = a.iter().zip(b).any(|(a, b)| a.abs_diff(b) > 2);
            other += usize::from(different);
            let around = |size: usize, at: usize| at.saturating_sub(BESIDE)..(at + BESIDE + 1).min(size);
            let (x, y) = (k % SIZE[0], k / SIZE[0]);
            let mut beside = around(SIZE[1], y).flat_map(|y| around(SIZE[0], x).map(move |x| y * SIZE[0] + x));
            if beside.all(|there| kind(there) == kind(k)) {
                assert!(!different, "{} {x} {y}: {a:?} {b:?}", lens.name());
                judged += 1;
                shadowed += usize::from(shadow(k));
            }
        }
        // The control: the edges of shadows differ.
        assert!(judged > 500 && other > 0, "{}: {judged} {other}", lens.name());
        all_shadowed += shadowed;
    }
    assert!(all_shadowed > 0);
}

/// The rasterizer draws straight lines only; other renderers reject rays of another image size, or with too few
/// samples.
#[test]
fn invalid_rays() {
    let pixels = PixelIntrinsics { fx: 50.0, fy: 50.0, cx: 32.0, cy: 24.0 };
    let expected = RenderError::LensRenderer { lens: "opencv", renderer: "raster" };
    let rays = rays_of(WARPED.into(), pixels, SIZE);
    assert_eq!(figure_through(&rays).try_draw().unwrap_err(), expected);
    for renderer in [Renderer::FastRayTraced, Renderer::Hybrid] {
        for (found, found_samples) in [(SIZE, 1), ([32, 48], 4)] {
            let other = LensRays::new(rays.optics(), found, found_samples).unwrap();
            let error = TestFrame { renderer, ..figure_through(&other) }.try_draw().unwrap_err();
            assert_eq!(error, RenderError::LensRays { expected: SIZE, samples: 4, found, found_samples });
        }
    }
}
