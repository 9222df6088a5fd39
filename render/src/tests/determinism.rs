//! The same image, bit for bit, with every instruction set, on any number of threads, and with any channels.

use super::harness::{EXACT, Image, TestFrame, assert_same_bits, look_at_view};
use super::shutter::{bar, bar_at};
use super::{lenses, lod};
use crate::aperture::Aperture;
use crate::frame::{Channels, Frame};
use crate::image_renderer::ImageRenderer;
use crate::parallel_renderer::ParallelRenderer;
use crate::renderer::Renderer;
use crate::request::{RasterCfg, RenderRequest};
use crate::shutter::Shutter;
use crate::simd::all_levels;
use crate::visibility::View;
use kinetoscope_scene::{Haze, Light, LightKind, LightingSpace, OpenGlRules, PoseF32, RenderScene, Tessellation};
use kinetoscope_testkit::scenes::{TestRng, humanoid, random_scene};

const RENDERERS: [Renderer; 4] = [Renderer::Raster, Renderer::FastRayTraced, Renderer::Hybrid, FEW_PATHS];
const FEW_PATHS: Renderer = Renderer::RayTraced { samples: 4, max_bounces: 2, denoise: true, seed: 3 };

/// A scene with all inputs of color: transparency, mirrors, all kinds of lights, haze.
fn rich(seed: u64, [width, height]: [usize; 2], zoom: f32) -> TestFrame {
    let (scene, poses) = random_scene(&mut TestRng(seed), 1.0);
    let mut instances = scene.instances().to_vec();
    (instances[1].material.rgba[3], instances[2].material.rgba[3]) = (0.4, 0.7);
    // An ellipsoid, a box and the ground.
    [3, 5, 16].into_iter().for_each(|k| instances[k].material.reflectance = 0.5);
    let mut scene = RenderScene::new(instances).unwrap();
    let kind = LightKind::Spot { cutoff_deg: 40.0, exponent: 10.0 };
    let spot = Light { kind, position: [2., 1., 3.], direction: [-2., -1., -3.], ..Light::default() };
    scene.lights.push(Light { radius: 0.1, ..spot });
    scene.lights.push(Light { kind: LightKind::Point, position: [0., -2., 1.], ..Light::default() });
    scene.haze = Some(Haze { color: None, start: 2.0, end: 8.0 });
    let view = look_at_view([width, height], 0.9, [2.5, -1.5, 1.5], [0., 0., -0.1]);
    TestFrame::new((scene, poses), View { fx: zoom * view.fx, fy: zoom * view.fy, ..view })
}

/// Sizes above and below the limit for another thread.
#[test]
fn raster() {
    #[cfg(target_arch = "x86_64")]
    assert!(all_levels().len() > usize::from(is_x86_feature_detected!("avx2")), "{:?}", all_levels());
    let sizes = [[333, 251], [64, 64], [97, 401], [8, 8], [401, 97], [203, 300], [1, 1], [120, 90], [130, 17]];
    for samples in [1, 4] {
        let cfg = RasterCfg { samples, ..RasterCfg::default() };
        let small = |k| TestFrame { cfg, ..rich(k as u64 + 1, [101, 67], 1.0) };
        assert_same_bits(&format!("{samples} samples"), (3, &small), &[1], &[3]);
        let large = |k| TestFrame { cfg, ..rich(k as u64 + 1, sizes[k], 3.0) };
        assert_same_bits(&format!("sizes, {samples} samples"), (9, &large), &[1, 2, 3, 8], &[1, 2, 3, 5, 9]);
    }
}

/// With the rules of MuJoCo's OpenGL renderer, light at the corners of polygons is kept for later pixels, and blocks that
/// one plane covers are not drawn sample by sample.
#[test]
fn corners_of_polygons() {
    let sizes = [[203, 151], [64, 64], [97, 301]];
    for transparent in [false, true] {
        let still = |k: usize| {
            let seed = k as u64 + 1;
            let mut still = rich(seed, sizes[k], 1.0);
            if !transparent {
                let (lights, haze) = (still.scene.lights.clone(), still.scene.haze);
                still.scene = random_scene(&mut TestRng(seed), 1.0).0;
                (still.scene.lights, still.scene.haze) = (lights, haze);
            }
            still.scene.lighting_space = LightingSpace::Display;
            still.scene.opengl = Some(OpenGlRules {
                shadow_clip: 10.0,
                shadow_scale: 1.0,
                culls_backs: false,
                is_additive: false,
                tessellation: Some(Tessellation::default()),
            });
            still
        };
        assert_same_bits(&format!("corners, transparent: {transparent}"), (3, &still), &[1, 2, 3], &[1, 3]);
    }
}

#[test]
fn rays() {
    for renderer in &RENDERERS[1..] {
        let occlusion_rays = if *renderer == Renderer::Hybrid { 4 } else { 0 };
        let cfg = RasterCfg { occlusion_rays, ..RasterCfg::default() };
        let sizes = [[61, 47], [8, 8], [33, 70]];
        let still = |k| TestFrame { renderer: *renderer, cfg, ..rich(k as u64 + 1, sizes[k], 1.0) };
        assert_same_bits(&format!("{renderer:?}"), (3, &still), &[1, 2, 3], &[1, 3]);
    }
    // The control: another seed has other noise.
    let other = Renderer::RayTraced { samples: 4, max_bounces: 2, denoise: true, seed: 4 };
    let still = rich(1, [61, 47], 1.0);
    assert!(still.with_renderer(FEW_PATHS).color() != still.with_renderer(other).color());
}

#[test]
fn lens_images() {
    let view = look_at_view([64, 48], 0.9, [1.6, -0.9, 1.0], [0.1, 0., 0.7]);
    // Farther to the side, and with other intrinsics.
    let old = look_at_view([64, 48], 0.8, [1.5, -1.0, 1.1], [0.1, 0., 0.7]);
    for (lens, rays) in lenses::distorting() {
        for renderer in &RENDERERS[1..] {
            let still = |_| {
                let previous = Some((humanoid().1, old));
                TestFrame {
                    renderer: *renderer,
                    lens: Some(rays.clone()),
                    previous,
                    ..TestFrame::new(humanoid(), view)
                }
            };
            let images = assert_same_bits(&format!("{}, {renderer:?}", lens.name()), (1, &still), &[2, 3], &[1]);
            assert!(images[0].flow().iter().flatten().any(|x| x.is_finite() && *x != 0.0), "the instances move");
        }
    }
}

#[test]
fn rolling_shutter() {
    let (scene, view) = bar();
    let shutter = Shutter { row_time: 0.004, exposure_time: 0.01 };
    let aperture = Some(Aperture { focal_length: 0.05, f_number: 1.4, focus_distance: 1.5 });
    let renderer = Renderer::RayTraced { samples: 4, max_bounces: 1, denoise: true, seed: 0 };
    let moved = PoseF32 { translation: [0.01, 0.0, 0.02], ..view.world_from_camera };
    let (previous, shutter_open) = (Some((bar_at(-0.3), view)), Some((bar_at(-0.3), moved, 0.2)));
    let still =
        TestFrame { shutter, aperture, renderer, previous, shutter_open, ..TestFrame::new((scene, bar_at(0.3)), view) };
    assert_same_bits("rows", (1, &|_| still.clone()), &[1, 2, 3], &[1]);
}

#[test]
fn detail_levels() {
    let still = |_| lod::new_transparent().with(|still| still.cfg = lod::ON);
    let images = assert_same_bits("levels of detail", (1, &still), &[2, 3], &[1, 9]);
    assert!(images[0].bits() != lod::transparent().draw().bits(), "levels are in use");
}

/// Bands, samples and unselected channels change no bit of the other channels.
#[test]
fn channels() {
    // Tall enough for several bands with four samples.
    let view = look_at_view([200, 400], 0.9, [2.6, -1.6, 1.6], [0.2, 0., 0.8]);
    let still = |channels, samples| {
        let cfg = RasterCfg { samples, ..RasterCfg::default() };
        TestFrame { channels, cfg, ..TestFrame::new(humanoid(), view) }.draw()
    };
    let (all, one) = (still(Channels::ALL, 4), still(Channels::ALL, 1));
    assert!(all.bits_but_color() == one.bits_but_color(), "multisampling changes color only");
    assert!(all.color() != one.color());
    assert!(still(Channels { depth: true, ..Channels::default() }, 4).depth() == all.depth());
    assert!(still(Channels { color: true, ..Channels::default() }, 4).color() == all.color());

    let still =
        TestFrame::new(random_scene(&mut TestRng(9), 1.0), look_at_view([90, 70], 1.0, [2.2, 0.4, 0.9], [0.0; 3]));
    for renderer in
        RENDERERS.into_iter().chain([Renderer::RayTraced { samples: 1, max_bounces: 0, denoise: false, seed: 0 }])
    {
        let of = |channels| TestFrame { channels, ..still.clone() }.with_renderer(renderer);
        let all = of(Channels::ALL);
        assert_eq!(of(Channels { albedo: true, mask: true, ..Channels::NONE }).albedo(), all.albedo());
        let without = of(Channels { albedo: false, ..Channels::ALL });
        let all = all.frame;
        assert!(without.bits() == Image { frame: Frame { albedo: None, ..all }, width: 90 }.bits());
    }
}

/// Path tracing and the hybrid change no channel but color.
#[test]
fn only_color_differs() {
    let view = look_at_view([97, 83], 0.9, [2.6, -1.6, 1.6], [0.2, 0., 0.8]);
    for scene in [humanoid(), random_scene(&mut TestRng(5), 1.2)] {
        let still = TestFrame { cfg: EXACT, ..TestFrame::new(scene, view) };
        let [raster, traced, hybrid, paths] = RENDERERS.map(|renderer| still.with_renderer(renderer));
        assert!(traced.bits_but_color() == paths.bits_but_color());
        assert!(raster.bits_but_color() == hybrid.bits_but_color());
        assert!(traced.color() != paths.color() && raster.color() != hybrid.color());
        let found = super::traced::compare(&raster, &paths);
        assert!(found.compared > 97 * 83 / 2 && found.different * 1000 <= found.compared, "{found:?}");
    }
}

#[test]
fn failed_jobs() {
    let still = rich(1, [333, 251], 3.0).with(|still| still.channels = Channels { mask: true, ..Channels::default() });
    for (threads, count) in [(1, 3), (2, 3), (4, 3), (2, 5), (2, 9)] {
        let mut frames = vec![still.frame(); count];
        let failed = |k| k == 1 || k == count - 1;
        let render_request = |k| RenderRequest { poses: if failed(k) { &[] } else { &still.poses }, ..still.request() };
        let mut jobs: Vec<_> =
            frames.iter_mut().enumerate().map(|(k, frame)| (render_request(k), frame.as_mut())).collect();
        let (index, _) = ParallelRenderer::new(still.cfg, threads).render(&mut jobs).unwrap_err();
        assert_eq!(index, 1);
        for (k, frame) in frames.iter().enumerate() {
            let drawn = frame.mask.iter().flatten().any(|&m| m != 0);
            assert_eq!(drawn, !failed(k), "shot {k} of {count}, {threads} threads");
        }
    }
}

#[test]
fn thread_safety() {
    fn shared<T: Send + Sync>(_: &T) {}
    shared(&ImageRenderer::default());
    shared(&ParallelRenderer::new(EXACT, 2));
}
