//! Pictures by rays against the rasterizer's.

use super::super::{Channels, Frame, ParallelRasterizer, RasterCfg, Rasterizer, Renderer, Shot, ToneCurve};
use super::determinism::bits;
use super::scenes::{EXACT, Random, figure, random};
use crate::lanes::levels;
use crate::visibility::{RenderError, View};
use scene::shape::{Ellipsoid, Plane, Sphere};
use scene::{Hemisphere, Instance, Light, LightKind, Material, PoseF32, RenderScene};

const FEW_PATHS: Renderer = Renderer::RayTraced { samples: 4, max_bounces: 2, denoise: true, seed: 3 };

fn draw(renderer: Renderer, cfg: RasterCfg, scene: &RenderScene, poses: &[PoseF32], view: &View) -> Frame {
    let mut rasterizer = Rasterizer::new(cfg);
    rasterizer.renderer = renderer;
    let mut frame = Frame::new(view.width, view.height, Channels::ALL);
    rasterizer.render(scene, poses, view, &mut frame).unwrap();
    frame
}

/// What pixels off silhouettes show in two pictures.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Comparison {
    /// How many pixels.
    pub(super) compared: usize,
    /// How many differ in any channel.
    pub(super) different: usize,
    /// How many differ in another channel than the normals.
    pub(super) elsewhere: usize,
}

/// Compares all channels but the colour where no silhouette is: where all eight neighbours show the same thing at about the
/// same depth, in both pictures.
///
/// Depth and distance may differ by 1e-4 of themselves: of surfaces seen at a slant of up to 1 : 100, rounding of rays in
/// single precision makes 1e-5. Normals by 0.5 degrees: a pixel's centre on an edge between two triangles may belong to
/// either, which is what the few pixels that differ are.
pub(super) fn compare(a: &Frame, b: &Frame, width: usize) -> Comparison {
    let (depth, mask) = (a.depth.as_ref().unwrap(), a.mask.as_ref().unwrap());
    let height = mask.len() / width;
    let inner = (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| y * width + x));
    let mut all = Comparison::default();
    let near = |a: f32, b: f32, part: f32| a == b || (a - b).abs() <= part * a.abs();
    for k in inner {
        let around = (0..9).map(|n| k + (n / 3) * width + n % 3 - width - 1);
        let other = (b.depth.as_ref().unwrap(), b.mask.as_ref().unwrap());
        let whole = |(depth, mask): (&Vec<f32>, &Vec<i32>)| {
            around.clone().all(|n| mask[n] == mask[k] && near(depth[k], depth[n], 0.1))
        };
        if !(whole((depth, mask)) && whole(other)) {
            continue;
        }
        all.compared += 1;
        let vector = |f: &Option<Vec<f32>>| {
            let f = f.as_ref().unwrap();
            nalgebra::Vector3::new(f[3 * k], f[3 * k + 1], f[3 * k + 2])
        };
        let same_normal = |a: &Option<Vec<f32>>, b: &Option<Vec<f32>>| {
            let (a, b) = (vector(a), vector(b));
            a == b || a.dot(&b) >= 0.5f32.to_radians().cos()
        };
        let here = mask[k] == other.1[k]
            && near(depth[k], other.0[k], 1e-4)
            && near(a.distance.as_ref().unwrap()[k], b.distance.as_ref().unwrap()[k], 1e-4)
            && (vector(&a.position) - vector(&b.position)).norm() <= 1e-4 * depth[k].min(1e9);
        let same = here && same_normal(&a.normal, &b.normal) && same_normal(&a.shading_normal, &b.shading_normal);
        all.different += usize::from(!same);
        all.elsewhere += usize::from(!here);
    }
    all
}

#[test]
fn rays_see_what_the_rasterizer_draws() {
    let mut numbers = Random(11);
    let mut sum = Comparison::default();
    for seed in 0..40 {
        let r = &mut numbers;
        let (scene, poses) = random(r, 1.2);
        let camera = r.pose(if seed % 4 == 0 { 0.5 } else { 3.0 });
        let target = r.vector(-0.5, 0.5).map(|x| x as f32);
        let view = View::look_at([101, 75], 1.0, camera.translation, target, [0., 0., 1.]).unwrap();
        let (near, far) = [(0.01, 100.0), (1e-4, 1e5), (1.0, 4.0), (0.3, 2.0)][seed % 4];
        let view = View { near, far, cx: r.within(20., 80.) as f32, fy: r.within(40., 120.) as f32, ..view };
        let raster = draw(Renderer::Raster, EXACT, &scene, &poses, &view);
        let traced = draw(Renderer::FastRayTraced, EXACT, &scene, &poses, &view);
        let found = compare(&raster, &traced, view.width);
        sum.compared += found.compared;
        sum.different += found.different;
        sum.elsewhere += found.elsewhere;
        // Colours come from the same shading: they differ where samples on edges do.
        let [a, b] = [&raster, &traced].map(|f| f.color.as_ref().unwrap());
        let pixels = a.chunks(4).zip(b.chunks(4));
        let far_apart = pixels.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 3)).count();
        assert!(far_apart * 50 < 101 * 75, "scene {seed}: {far_apart} pixels look different");
    }
    println!("{sum:?}");
    assert!(sum.compared > 40 * 101 * 75 / 2, "{sum:?}");
    assert_eq!(sum.elsewhere, 0, "{sum:?}");
    // Normals at centres on edges of triangles: of the order of 1/256 pixel wide, a pixel or two apart.
    assert!(sum.different * 1000 <= sum.compared, "{sum:?}");
    // A control: a picture from a millimetre beside is not the same.
    let (scene, poses) = random(&mut Random(5), 1.2);
    let view = View::look_at([101, 75], 1.0, [2.0, 0.5, 1.0], [0.; 3], [0., 0., 1.]).unwrap();
    let mut beside = view;
    beside.world_from_camera.translation[2] += 1e-3;
    let a = draw(Renderer::Raster, EXACT, &scene, &poses, &view);
    let b = draw(Renderer::FastRayTraced, EXACT, &scene, &poses, &beside);
    let beside = compare(&a, &b, 101);
    assert!(beside.elsewhere * 2 > beside.compared, "{beside:?}");
}

/// What paths meet first is what the mask says: things that glow, each in a colour of its own, in a scene without any other light.
/// Paths go through all of a pixel, so that where it and its neighbours show one thing they must meet it.
///
/// Found by reading: where a mat lies on endless ground both are as near, to the bit, and paths met what came first in the scene.
#[test]
fn paths_see_what_the_mask_says() {
    // Steps of 51 of 255, which the test tells apart.
    let color_of = |k: usize| [k % 6, k / 6 % 6, k / 36 % 6].map(|x| 51 * x as u8);
    // Of what glows a hundred times as bright as its colour, only a hundredth more is the others' light.
    let glowing = |k: usize| {
        let [r, g, b] = color_of(k).map(|x| {
            let linear = 0.01 * scene::material::decode_srgb(f32::from(x) / 255.0);
            if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
        });
        Material { emission: 100.0, specular: 0.0, ..Material::from_rgba([r, g, b, 1.0]) }
    };
    let mut numbers = Random(23);
    let (mut compared, mut on_mats) = (0, 0);
    for seed in 0..12 {
        let (scene, mut poses) = random(&mut numbers, 1.2);
        let mut instances = scene.instances().to_vec();
        instances.push(Instance::new(Plane { half: [0.7, 0.5] }, Material::default(), 101));
        poses.push(PoseF32::from_translation([0.3, 0.0, -1.0]));
        for (k, instance) in instances.iter_mut().enumerate() {
            (instance.mask_id, instance.material) = (k as i32 + 1, glowing(k + 1));
        }
        let mat = instances.len() as i32;
        let mut scene = RenderScene::new(instances).unwrap();
        scene.lights.clear();
        scene.headlight.active = false;
        scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
        let eye = numbers.vector(-2.0, 2.0).map(|x| x as f32);
        let view = View::look_at([101, 75], 1.0, [eye[0], eye[1], 0.6 + eye[2].abs()], [0., 0., -0.4], [0., 0., 1.]);
        let renderer = Renderer::RayTraced { samples: 1, max_bounces: 0, denoise: false, seed };
        let frame = draw(renderer, RasterCfg { tone: ToneCurve::Clip, ..EXACT }, &scene, &poses, &view.unwrap());
        let (mask, color) = (frame.mask.unwrap(), frame.color.unwrap());
        let depth = frame.depth.unwrap();
        for k in (1..74).flat_map(|y| (1..100).map(move |x| y * 101 + x)) {
            let alone = (0..9).map(|n| k + (n / 3) * 101 + n % 3 - 102);
            if !alone.clone().all(|n| mask[n] == mask[k] && (depth[n] - depth[k]).abs() <= 0.1 * depth[k]) {
                continue;
            }
            let expected = match mask[k] {
                0 => continue,
                id => color_of(id as usize),
            };
            let same = (0..3).all(|c| color[4 * k + c].abs_diff(expected[c]) <= 4);
            assert!(same, "scene {seed}, pixel {k}: {:?}, not {expected:?}", &color[4 * k..4 * k + 3]);
            compared += 1;
            on_mats += usize::from(mask[k] == mat);
        }
    }
    assert!(compared > 12 * 99 * 73 / 3 && on_mats > 500, "{compared}, {on_mats} on mats");
}

/// Edges between the faces of a box, and of a cylinder, are as smooth by rays as by the rasterizer: each sample tells its face.
///
/// Found by reading: rays gave every face of a closed form the number of the first, so that colours had one sample there.
#[test]
fn edges_of_solids_are_as_smooth_by_rays() {
    let plain = |shape: scene::Shape, id| Instance::new(shape, Material::from_rgba([0.7, 0.7, 0.7, 1.0]), id);
    let mut scene = RenderScene::new(vec![
        plain(scene::shape::Box { half: [0.3, 0.3, 0.3] }.into(), 1),
        plain(scene::shape::Cylinder { radius: 0.25, half_length: 0.3 }.into(), 2),
    ])
    .unwrap();
    scene.lights[0].direction = [-0.3, -0.9, -0.6];
    let poses = [[-0.4f32, 0.0, 0.0], [0.4, 0.0, 0.0]].map(PoseF32::from_translation);
    let view = View::look_at([161, 121], 0.8, [0.5, 1.6, 1.1], [0., 0., 0.], [0.1, 0., 1.]).unwrap();
    let cfg = RasterCfg { shadows: false, ..EXACT };
    let [raster, traced] =
        [Renderer::Raster, Renderer::FastRayTraced].map(|renderer| draw(renderer, cfg, &scene, &poses, &view));
    let (mask, color, other) = (raster.mask.unwrap(), raster.color.unwrap(), traced.color.unwrap());
    let normal = raster.normal.unwrap();
    let (mut edges, mut differ) = (0, 0);
    for k in (1..120).flat_map(|y| (1..160).map(move |x| y * 161 + x)).filter(|&k| mask[k] != 0) {
        let around = (0..9).map(|n| k + (n / 3) * 161 + n % 3 - 162);
        if !around.clone().all(|n| mask[n] == mask[k]) {
            continue;
        }
        let at = |n: usize| nalgebra::Vector3::new(normal[3 * n], normal[3 * n + 1], normal[3 * n + 2]);
        if around.clone().all(|n| at(n).dot(&at(k)) > 0.5) {
            continue;
        }
        edges += 1;
        // A sample at the very edge may belong to either face: a quarter of what is between them.
        differ += usize::from((0..3).any(|c| color[4 * k + c].abs_diff(other[4 * k + c]) > 3));
    }
    assert!(edges > 200, "{edges}");
    assert!(differ * 50 <= edges, "{differ} of {edges}");
    // The control: one sample looks otherwise at most of them.
    let rough = draw(Renderer::FastRayTraced, RasterCfg { samples: 1, ..cfg }, &scene, &poses, &view).color.unwrap();
    let apart = color.chunks(4).zip(rough.chunks(4)).filter(|(a, b)| a[0].abs_diff(b[0]) > 3).count();
    assert!(apart * 4 > edges, "{apart} of {edges}");
}

#[test]
fn path_tracing_changes_no_channel_but_the_colour() {
    let (scene, poses) = figure();
    let view = View::look_at([97, 83], 0.9, [2.6, -1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap();
    let [traced, paths, hybrid, raster] = [Renderer::FastRayTraced, FEW_PATHS, Renderer::Hybrid, Renderer::Raster]
        .map(|renderer| draw(renderer, EXACT, &scene, &poses, &view));
    let without = |frame: &Frame| bits(&Frame { color: None, ..frame.clone() });
    assert!(without(&traced) == without(&paths) && without(&raster) == without(&hybrid));
    assert!(traced.color != paths.color && raster.color != hybrid.color);
    let found = compare(&raster, &paths, 97);
    assert!(found.compared > 97 * 83 / 2 && found.different * 1000 <= found.compared, "{found:?}");
}

/// A scene with all kinds of lamps and things that are not quite opaque.
fn rich(seed: u64, size: [usize; 2]) -> (RenderScene, Vec<PoseF32>, View) {
    let (scene, poses) = random(&mut Random(seed), 1.0);
    let mut instances = scene.instances().to_vec();
    (instances[1].material.rgba[3], instances[2].material.rgba[3]) = (0.4, 0.7);
    instances[3].material.reflectance = 0.5;
    let mut scene = RenderScene::new(instances).unwrap();
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 10.0 };
    let spot = Light { kind: spot, position: [2., 1., 3.], direction: [-2., -1., -3.], ..Light::default() };
    scene.lights.push(Light { radius: 0.1, ..spot });
    scene.lights.push(Light { kind: LightKind::Point, position: [0., -2., 1.], ..Light::default() });
    scene.haze = Some(scene::Haze { color: None, start: 2.0, end: 8.0 });
    let view = View::look_at(size, 0.9, [2.5, -1.5, 1.5], [0., 0., -0.1], [0., 0., 1.]).unwrap();
    (scene, poses, view)
}

/// With all that a renderer can do with rays.
fn with_occlusion(renderer: Renderer) -> RasterCfg {
    RasterCfg { occlusion_rays: if renderer == Renderer::Hybrid { 4 } else { 0 }, ..RasterCfg::default() }
}

#[test]
fn every_renderer_draws_the_same_bits_with_any_number_of_threads() {
    let shots: Vec<_> = [[61, 47], [8, 8], [33, 70]].into_iter().zip(1..).map(|(s, k)| rich(k, s)).collect();
    for renderer in [Renderer::FastRayTraced, Renderer::Hybrid, FEW_PATHS] {
        let cfg = with_occlusion(renderer);
        let alone: Vec<_> = shots.iter().map(|(s, p, v)| bits(&draw(renderer, cfg, s, p, v))).collect();
        for threads in [1, 2, 3] {
            let mut parallel = ParallelRasterizer::new(cfg, threads);
            parallel.set_renderer(renderer);
            for count in [1, 3] {
                let new = |(_, _, v): &(_, _, View)| Frame::new(v.width, v.height, Channels::ALL);
                let mut frames: Vec<_> = shots[..count].iter().map(new).collect();
                let shots = shots.iter().map(|(scene, poses, view)| Shot {
                    scene,
                    poses,
                    view,
                    lights: None,
                    lens: None,
                    before: None,
                });
                let mut jobs: Vec<_> = shots.zip(&mut frames).map(|(shot, frame)| (shot, frame.as_mut())).collect();
                parallel.render(&mut jobs).unwrap();
                for (k, frame) in frames.iter().enumerate() {
                    assert!(bits(frame) == alone[k], "{renderer:?}: shot {k} of {count}, {threads} threads");
                }
            }
        }
    }
    // A control: another seed has other noise.
    let (scene, poses, view) = &shots[0];
    let other = Renderer::RayTraced { samples: 4, max_bounces: 2, denoise: true, seed: 4 };
    let [a, b] = [FEW_PATHS, other].map(|r| draw(r, RasterCfg::default(), scene, poses, view).color);
    assert!(a != b);
}

#[test]
fn every_instruction_set_casts_the_same_rays() {
    let (scene, poses, view) = rich(2, [61, 47]);
    for renderer in [Renderer::FastRayTraced, Renderer::Hybrid, FEW_PATHS] {
        let all = levels().into_iter().map(|level| {
            let mut rasterizer = Rasterizer::with_level(with_occlusion(renderer), level);
            rasterizer.renderer = renderer;
            let mut frame = Frame::new(view.width, view.height, Channels::ALL);
            rasterizer.render(&scene, &poses, &view, &mut frame).unwrap();
            bits(&frame)
        });
        let all: Vec<_> = all.collect();
        assert!(all.windows(2).all(|pair| pair[0] == pair[1]), "{renderer:?}");
    }
}

/// Smoothing makes few paths look more like many, where light is hard to find: below a glowing lens of a shape that nobody
/// looks for, which paths meet by chance.
#[test]
fn smoothing_takes_noise_away_and_keeps_the_picture() {
    let matt = |red: f32| Material { specular: 0.0, ..Material::from_rgba([red, 0.7, 0.7, 1.0]) };
    let panel = Material { emission: 6.0, ..matt(0.7) };
    let mut scene = RenderScene::new(vec![
        Instance::new(Plane::INFINITE, matt(0.7), 1),
        Instance::new(Sphere { radius: 0.3 }, matt(0.2), 2),
        Instance::new(Ellipsoid { radii: [0.56, 0.56, 0.01] }, panel, 3),
    ])
    .unwrap();
    scene.lights.clear();
    scene.headlight.active = false;
    scene.ambient = Hemisphere { sky: [0.02; 3], ground: [0.02; 3] };
    let down = PoseF32 { rotation: [[1., 0., 0.], [0., -1., 0.], [0., 0., -1.]], translation: [0., 0., 1.5] };
    let poses = [PoseF32::IDENTITY, PoseF32::from_translation([0., 0., 0.3]), down];
    let view = View::look_at([96, 72], 0.7, [2.2, -1.4, 1.0], [0., 0., 0.2], [0., 0., 1.]).unwrap();
    let paths = |samples, denoise, seed| {
        let renderer = Renderer::RayTraced { samples, max_bounces: 1, denoise, seed };
        draw(renderer, EXACT, &scene, &poses, &view).color.unwrap()
    };
    let many = paths(256, false, 9);
    let error = |a: &[u8]| {
        let square: f64 = a.iter().zip(&many).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
        (square / a.len() as f64).sqrt()
    };
    let (rough, smooth, more) = (error(&paths(4, false, 1)), error(&paths(4, true, 1)), error(&paths(16, false, 1)));
    println!("off by {rough} of 255 with 4 paths, {smooth} smoothed, {more} with 16 paths");
    assert!(smooth < 0.6 * rough, "{smooth} of {rough}");
    // One path does not know its own noise: it is that of its neighbours.
    let (one, smoothed) = (error(&paths(1, false, 1)), error(&paths(1, true, 1)));
    println!("off by {one} of 255 with 1 path, {smoothed} smoothed");
    assert!(smoothed < 0.6 * one, "{smoothed} of {one}");
    // A control of the measure: noise falls as paths are added.
    assert!(more < 0.75 * rough, "{more} of {rough}");
}

/// A floor of black and white tiles below a glossy layer, lit from everywhere by a little light, and the edge of a shadow on it.
fn tiles(emission: f32) -> (RenderScene, Vec<PoseF32>) {
    let tile = |white: bool| Material {
        specular: 1.0,
        shininess: 0.3,
        ..Material::from_rgba(if white { [1.0; 4] } else { [0.0, 0.0, 0.0, 1.0] })
    };
    let mut instances = Vec::new();
    let mut poses = Vec::new();
    for k in 0..36 {
        instances.push(Instance::new(Plane { half: [0.1, 0.1] }, tile((k / 6 + k % 6) % 2 == 0), k + 1));
        poses.push(PoseF32::from_translation([0.2 * (k / 6) as f32 - 0.5, 0.2 * (k % 6) as f32 - 0.5, 0.0]));
    }
    let lamp = Material { emission, specular: 0.0, ..Material::from_rgba([1.0; 4]) };
    instances.push(Instance::new(Sphere { radius: 0.4 }, lamp, 50));
    poses.push(PoseF32::from_translation([0.4, 0.9, 1.0]));
    let mut scene = RenderScene::new(instances).unwrap();
    scene.lights.clear();
    scene.headlight.active = false;
    scene.ambient = Hemisphere { sky: [0.05; 3], ground: [0.05; 3] };
    (scene, poses)
}

/// Black tiles mirror what they mirror, and white ones beside them are as bright as they are: nothing of the one is blended into
/// the other.
///
/// Found by reading: light was divided by the colour of the surface, though what is mirrored does not have it.
#[test]
fn smoothing_does_not_blend_what_tiles_mirror() {
    let (scene, poses) = tiles(3.0);
    let view = View::look_at([96, 72], 0.6, [-1.2, -0.8, 0.9], [0., 0., 0.], [0., 0., 1.]).unwrap();
    let paths = |samples, denoise, seed| {
        let renderer = Renderer::RayTraced { samples, max_bounces: 1, denoise, seed };
        draw(renderer, EXACT, &scene, &poses, &view)
    };
    let many = paths(1024, false, 9);
    let mask = many.mask.as_ref().unwrap();
    // Of tiles that are black, away from their edges.
    let black: Vec<usize> = (2..70)
        .flat_map(|y| (2..94).map(move |x| y * 96 + x))
        .filter(|&k| (1..=36).contains(&mask[k]) && ((mask[k] - 1) / 6 + (mask[k] - 1) % 6) % 2 == 1)
        .filter(|&k| [1, 96, 97, 95].into_iter().all(|n| mask[k - n] == mask[k] && mask[k + n] == mask[k]))
        .collect();
    let color = many.color.unwrap();
    let error = |other: &Frame| {
        let other = other.color.as_ref().unwrap();
        let square: f64 = black.iter().map(|&k| f64::from(color[4 * k].abs_diff(other[4 * k])).powi(2)).sum();
        (square / black.len() as f64).sqrt()
    };
    let (rough, smooth) = (error(&paths(2, false, 1)), error(&paths(2, true, 1)));
    println!("{} pixels of black tiles are off by {rough}, {smooth} smoothed", black.len());
    // A third. With the tiles' colours out of sight it was half.
    assert!(black.len() > 300 && smooth < 0.4 * rough, "{smooth} of {rough}");
}

/// Smoothing knows how bright the picture will be: a thousandth of the light, exposed a thousand times as long, is smoothed as
/// the whole of it is. And what is far too bright for single precision stays a number.
///
/// Found by reading: light that differed by less than a fixed amount was blended, and an infinity times a weight of 0 spread.
#[test]
fn smoothing_does_as_much_whatever_the_exposure() {
    let view = View::look_at([96, 72], 0.6, [-1.2, -0.8, 0.9], [0., 0., 0.], [0., 0., 1.]).unwrap();
    let paths = |emission: f32, dim: f32, stops: f64| {
        let (mut scene, poses) = tiles(emission * dim);
        scene.ambient = Hemisphere { sky: [0.05 * dim; 3], ground: [0.05 * dim; 3] };
        scene.sky = scene::Sky::uniform([0.0; 3]);
        let mut rasterizer = Rasterizer::new(EXACT);
        rasterizer.renderer = Renderer::RayTraced { samples: 16, max_bounces: 1, denoise: true, seed: 3 };
        rasterizer.stops = stops;
        let mut frame = Frame::new(view.width, view.height, Channels { color: true, ..Channels::NONE });
        rasterizer.render(&scene, &poses, &view, &mut frame).unwrap();
        frame.color.unwrap()
    };
    let (plain, dim) = (paths(3.0, 1.0, 0.0), paths(3.0, 1.0 / 1024.0, 10.0));
    let most = plain.iter().zip(&dim).map(|(a, b)| a.abs_diff(*b)).max();
    // Powers of two change no digit; the tiles' colours are the same.
    assert!(most <= Some(1), "{most:?}");
    let blinding = paths(1e30, 1.0, 0.0);
    // Where the lamp is mirrored or seen all is white, and nothing is black that the dome lights.
    let dark = |color: &[u8]| color.chunks(4).filter(|c| c[..3] == [0; 3]).count();
    assert!(dark(&blinding) <= dark(&plain), "{} pixels, not {}", dark(&blinding), dark(&plain));
}

#[test]
fn numbers_that_no_path_has_are_refused() {
    let (scene, poses) = figure();
    let view = View::look_at([8, 8], 0.9, [2.6, -1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap();
    let mut rasterizer = Rasterizer::default();
    let mut error = |samples, max_bounces| {
        rasterizer.renderer = Renderer::RayTraced { samples, max_bounces, denoise: false, seed: 0 };
        let mut frame = Frame::new(8, 8, Channels::ALL);
        rasterizer.render(&scene, &poses, &view, &mut frame).unwrap_err()
    };
    let limit = Renderer::MAX_SAMPLES;
    assert_eq!(error(0, 1), RenderError::Paths { samples: 0, limit });
    assert_eq!(error(1 << 17, 1), RenderError::Paths { samples: 1 << 17, limit });
    assert_eq!(error(1, 65), RenderError::Bounces { max_bounces: 65, limit: 64 });
    assert_eq!(error(0, 1).to_string(), "0 paths per pixel; 1 to 65536 are possible");
}

/// A box over a floor, its shadow by rays: where its edge is, and how bright the floor is on both sides.
#[test]
fn hybrid_shadows_end_where_the_light_passes_and_are_as_dark_as_what_is_left() {
    let matt = Material { specular: 0.0, ..Material::from_rgba([0.7, 0.7, 0.7, 1.0]) };
    let mut scene = RenderScene::new(vec![
        Instance::new(Plane::INFINITE, matt.clone(), 1),
        Instance::new(scene::shape::Box { half: [1.0, 2.0, 0.1] }, matt, 2),
    ])
    .unwrap();
    scene.headlight.active = false;
    scene.ambient = Hemisphere { sky: [0.1; 3], ground: [0.1; 3] };
    // From -2 to 0 along x, 0.9 to 1.1 high.
    let poses = [PoseF32::IDENTITY, PoseF32::from_translation([-1.0, 0.0, 1.0])];
    let view = View::look_at([201, 201], 0.9, [2.2, -0.3, 0.8], [1.0, 0., 0.], [0., 0., 1.]).unwrap();
    let lamp = Light { diffuse: [0.7; 3], attenuation: [1., 0., 0.], ..Light::default() };
    let slanted = Light { direction: [1., 0., -1.], ..lamp };
    let near = Light { kind: LightKind::Point, position: [-1.0, 0.0, 2.3], ..lamp };
    // Past the box's upper edge, 1.1 high: 1.1 m on at 45 degrees; from 1.2 m above and 1 m behind it, 1.1 / 1.2 m on.
    for (light, edge) in [(slanted, 1.1f32), (near, 1.1 / 1.2)] {
        scene.lights = vec![light];
        let cosine = |p: &[f32]| match light.kind {
            LightKind::Directional => 0.5f32.sqrt(),
            _ => 2.3 / ((p[0] + 1.0).powi(2) + p[1].powi(2) + 2.3 * 2.3).sqrt(),
        };
        let albedo = scene::material::decode_srgb(0.7);
        // sRGB, below where the tone curve bends.
        let byte = |x: f32| 255.0 * (1.055 * x.powf(1.0 / 2.4) - 0.055);
        let count = |frame: &Frame| {
            let (mask, position) = (frame.mask.as_ref().unwrap(), frame.position.as_ref().unwrap());
            let (mut counts, mut wrong) = ([0, 0], 0);
            for (k, p) in position.chunks(3).enumerate() {
                // A pixel is up to 0.02 m long on the floor; the box's sides do not end here.
                if mask[k] != 1 || (p[0] - edge).abs() < 0.03 || p[1].abs() > 1.5 || !(0.0..3.0).contains(&p[0]) {
                    continue;
                }
                let lit = p[0] > edge;
                let expected = byte(albedo * (0.1 + if lit { 0.7 * cosine(p) } else { 0.0 }));
                counts[usize::from(lit)] += 1;
                // A quarter for the polynomial, a half for rounding.
                let color = &frame.color.as_ref().unwrap()[4 * k..4 * k + 3];
                wrong += usize::from(color.iter().any(|&c| (f32::from(c) - expected).abs() > 0.8));
            }
            (counts, wrong)
        };
        let (counts, wrong) = count(&draw(Renderer::Hybrid, EXACT, &scene, &poses, &view));
        assert!(counts.iter().all(|&n| n > 2000), "{counts:?}");
        assert_eq!(wrong, 0, "{light:?}: of {counts:?}");
        // A control: without shadows all that is dark is wrong, and nothing else.
        let unshaded = RasterCfg { shadows: false, ..EXACT };
        let (counts, wrong) = count(&draw(Renderer::Hybrid, unshaded, &scene, &poses, &view));
        assert_eq!(wrong, counts[0]);
    }
}

/// A point lamp exactly on a ceiling, which is not between it and the floor: the floor below is lit everywhere, by the cosine.
///
/// Found by reading: rays went as far as the lamp, so that the last bit decided whether the ceiling was before it.
#[test]
fn a_lamp_on_a_ceiling_lights_the_floor_of_a_hybrid_picture() {
    let matt = Material { specular: 0.0, ..Material::from_rgba([0.7, 0.7, 0.7, 1.0]) };
    let mut scene = RenderScene::new(vec![
        Instance::new(Plane::INFINITE, matt.clone(), 1),
        Instance::new(scene::shape::Box { half: [3.0, 3.0, 0.5] }, matt, 2),
    ])
    .unwrap();
    scene.headlight.active = false;
    scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
    let poses = [PoseF32::IDENTITY, PoseF32::from_translation([0.0, 0.0, 2.5])];
    let view = View::look_at([80, 60], 0.6, [1.5, 0.3, 0.6], [0.0, 0.0, 0.0], [0., 0., 1.]).unwrap();
    let albedo = scene::material::decode_srgb(0.7);
    let byte = |x: f32| 255.0 * (1.055 * x.powf(1.0 / 2.4) - 0.055);
    let mut wrong = |height: f32| {
        let light =
            Light { kind: LightKind::Point, position: [0.1, 0.0, height], diffuse: [0.7; 3], ..Light::default() };
        scene.lights = vec![Light { attenuation: [1., 0., 0.], ..light }];
        let frame = draw(Renderer::Hybrid, EXACT, &scene, &poses, &view);
        let (mask, color) = (frame.mask.unwrap(), frame.color.unwrap());
        let floor = frame.position.unwrap();
        let floor = floor.chunks(3).enumerate().filter(|(k, p)| mask[*k] == 1 && p[0].abs() < 1.0 && p[1].abs() < 1.0);
        let off = floor.map(|(k, p)| {
            let cosine = 2.0 / ((p[0] - 0.1).powi(2) + p[1].powi(2) + 4.0).sqrt();
            (f32::from(color[4 * k]) - byte(albedo * 0.7 * cosine)).abs()
        });
        let off: Vec<f32> = off.collect();
        assert!(off.len() > 2000, "{}", off.len());
        // A quarter for the polynomial, a half for rounding.
        off.iter().filter(|off| **off > 0.8).count() as f32 / off.len() as f32
    };
    assert_eq!(wrong(2.0), 0.0);
    // The control: a millimetre inside of it the lamp lights nothing.
    assert_eq!(wrong(2.001), 1.0);
}

/// Ambient occlusion of a hybrid picture, at the foot of a long wall of height h: of the light that is everywhere, the wall takes
/// `(1 - d / sqrt(d² + h²)) / 2` at the distance d. Source: Howell, A catalog of radiation heat transfer configuration factors, B-71.
#[test]
fn hybrid_pictures_are_darker_at_the_foot_of_a_wall() {
    let matt = Material { specular: 0.0, ..Material::from_rgba([0.7, 0.7, 0.7, 1.0]) };
    // From x = 0 on, 1 m high.
    let mut scene = RenderScene::new(vec![
        Instance::new(Plane::INFINITE, matt.clone(), 1),
        Instance::new(scene::shape::Box { half: [0.5, 300.0, 0.5] }, matt, 2),
    ])
    .unwrap();
    let poses = [PoseF32::IDENTITY, PoseF32::from_translation([0.5, 0.0, 0.5])];
    scene.lights.clear();
    scene.headlight.active = false;
    scene.ambient = Hemisphere { sky: [0.6; 3], ground: [0.2; 3] };
    let view = View::look_at([48, 16], 0.4, [-1.0, -3.0, 2.5], [-0.8, 0.0, 0.0], [0., 0., 1.]).unwrap();
    let albedo = scene::material::decode_srgb(0.7);
    let byte = |x: f32| 255.0 * (1.055 * x.powf(1.0 / 2.4) - 0.055);
    let off = |occlusion_rays: u16| {
        let frame = draw(Renderer::Hybrid, RasterCfg { occlusion_rays, ..EXACT }, &scene, &poses, &view);
        let mask = frame.mask.as_ref().unwrap();
        let floor = frame.position.as_ref().unwrap().chunks(3).enumerate().filter(|(k, _)| mask[*k] == 1);
        // Colours of pixels at edges are means.
        let floor = floor.filter(|(_, p)| p[0] < -0.02);
        let off = floor.map(|(k, p)| {
            let blocked = 0.5 * (1.0 - -p[0] / (p[0] * p[0] + 1.0).sqrt());
            let expected = byte(albedo * 0.6 * (1.0 - blocked));
            (p[0], f32::from(frame.color.as_ref().unwrap()[4 * k]) - expected)
        });
        off.collect::<Vec<_>>()
    };
    let with = off(1024);
    let nearest = with.iter().map(|(x, _)| -x).fold(f32::INFINITY, f32::min);
    assert!(with.len() > 300 && nearest < 0.1, "{} pixels, from {nearest} m on", with.len());
    // The net finds the share to 1/256 or so, and byte(x) rises by 250 at most here.
    for (x, off) in &with {
        assert!(off.abs() <= 1.5, "at {x} m: off by {off}");
    }
    // The control: without rays the floor is as bright as in the open, at the foot of the wall by 35.
    let without = off(0);
    assert!(without.iter().all(|(x, off)| *x < -0.1 || *off > 30.0) && without.iter().all(|(_, off)| *off > -1.5));
}

#[test]
fn rasterizers_may_be_shared_between_threads() {
    fn shared<T: Send + Sync>(_: &T) {}
    shared(&Rasterizer::default());
    shared(&ParallelRasterizer::new(EXACT, 2));
}
