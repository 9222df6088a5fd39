//! Ray-traced images compared with the rasterizer's, and denoised path tracing compared with many paths.

use super::harness::{EXACT, Image, TestFrame, count_different, look_at_view};
use crate::frame::Channels;
use crate::renderer::Renderer;
use crate::request::RasterCfg;
use crate::shade::tone::ToneCurve;
use crate::visibility::View;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{Box, Cylinder, Ellipsoid, Plane, Sphere};
use kinetoscope_scene::{Hemisphere, Instance, Material, PoseF32, RenderScene, Sky};
use kinetoscope_testkit::scenes::{TestRng, instances, matte, random_scene, translation, unlit};
use kinetoscope_testkit::srgb::srgb;
use nalgebra::Vector3;

/// Differences of two images off silhouettes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Comparison {
    /// Number of compared pixels.
    pub(super) compared: usize,
    /// Pixels that differ in any channel but color and albedo.
    pub(super) different: usize,
    /// Pixels that differ in a channel other than the normals.
    pub(super) elsewhere: usize,
    /// Pixels whose albedo differs by more than one byte: at edges of a texture or another triangle.
    pub(super) albedo: usize,
}

/// Compares all channels but color, off silhouettes of both images.
///
/// Depth and distance may differ by 1e-4 of themselves: on surfaces with a slant of up to 1 : 100, rounding of rays in
/// single precision makes 1e-5. Normals may differ by 0.5 degrees: a pixel's center on an edge between two triangles
/// may belong to either, which explains the few pixels that differ.
pub(super) fn compare(a: &Image, b: &Image) -> Comparison {
    let mut all = Comparison::default();
    let near = |a: f32, b: f32| a == b || (a - b).abs() <= 1e-4 * a.abs();
    let parallel =
        |a: [f32; 3], b: [f32; 3]| a == b || Vector3::from(a).dot(&Vector3::from(b)) >= 0.5f32.to_radians().cos();
    for k in a.inner().filter(|&k| a.is_off_silhouette(k) && b.is_off_silhouette(k)) {
        let off = (Vector3::from(a.position()[k]) - Vector3::from(b.position()[k])).norm();
        let here = a.mask()[k] == b.mask()[k]
            && near(a.depth()[k], b.depth()[k])
            && near(a.distance()[k], b.distance()[k])
            && off <= 1e-4 * a.depth()[k].min(1e9);
        let normals = parallel(a.normal()[k], b.normal()[k]) && parallel(a.shading_normal()[k], b.shading_normal()[k]);
        all.compared += 1;
        all.different += usize::from(!(here && normals));
        all.elsewhere += usize::from(!here);
        all.albedo += usize::from((0..4).any(|c| a.albedo()[k][c].abs_diff(b.albedo()[k][c]) > 1));
    }
    all
}

#[test]
fn raster() {
    let mut numbers = TestRng(11);
    let mut sum = Comparison::default();
    for seed in 0..40 {
        let r = &mut numbers;
        let scene = random_scene(r, 1.2);
        let camera = r.pose(if seed % 4 == 0 { 0.5 } else { 3.0 });
        let view = look_at_view([101, 75], 1.0, camera.translation, r.vector(-0.5, 0.5).map(|x| x as f32));
        let (near, far) = [(0.01, 100.0), (1e-4, 1e5), (1.0, 4.0), (0.3, 2.0)][seed % 4];
        let view = View { near, far, cx: r.within(20., 80.) as f32, fy: r.within(40., 120.) as f32, ..view };
        let still = TestFrame { cfg: EXACT, ..TestFrame::new(scene, view) };
        let [raster, traced] =
            [Renderer::Raster, Renderer::FastRayTraced].map(|renderer| still.with_renderer(renderer));
        let found = compare(&raster, &traced);
        sum.compared += found.compared;
        sum.different += found.different;
        sum.elsewhere += found.elsewhere;
        sum.albedo += found.albedo;
        // Colors come from the same shading: they differ only where samples on edges do.
        let differ = count_different(&raster, &traced, 3);
        assert!(differ * 50 < 101 * 75, "scene {seed}: {differ} pixels look different");
    }
    assert!(sum.compared > 40 * 101 * 75 / 2, "{sum:?}");
    assert_eq!(sum.elsewhere, 0, "{sum:?}");
    // Normals at centers on edges of triangles: of the order of 1/256 pixel wide, a pixel or two apart.
    assert!(sum.different * 1000 <= sum.compared && sum.albedo * 1000 < sum.compared, "{sum:?}");
    // The control: an image from a viewpoint a millimeter aside differs.
    let still = TestFrame {
        cfg: EXACT,
        ..TestFrame::new(random_scene(&mut TestRng(5), 1.2), look_at_view([101, 75], 1.0, [2.0, 0.5, 1.0], [0.; 3]))
    };
    let mut beside = TestFrame { renderer: Renderer::FastRayTraced, ..still.clone() };
    beside.view.world_from_camera.translation[2] += 1e-3;
    let beside = compare(&still.draw(), &beside.draw());
    assert!(beside.elsewhere * 2 > beside.compared, "{beside:?}");
}

/// Emissive objects, each in a color of its own, without any other light: paths hit the instance that the mask shows.
/// Paths cover the whole pixel, so this holds where the pixel and its neighbors show one instance.
///
/// Root cause: a mat on an infinite ground is as near as the ground, to the bit, and paths hit the first one of the
/// scene.
#[test]
fn mask_of_paths() {
    // Steps of 51 of 255, which the test distinguishes.
    let color_of = |k: usize| [k % 6, k / 6 % 6, k / 36 % 6].map(|x| 51 * x as u8);
    // Emission is a hundred times the color, so the light of other objects adds only a hundredth.
    let glowing = |k: usize| {
        let light = |x: u8| 0.01 * f64::from(kinetoscope_scene::decode_srgb(f32::from(x) / 255.0));
        Material { emission: 100.0, ..matte(color_of(k).map(|x| (srgb(light(x)) / 255.0) as f32)) }
    };
    let mut numbers = TestRng(23);
    let (mut compared, mut on_mats) = (0, 0);
    for seed in 0..12 {
        let (scene, mut poses) = random_scene(&mut numbers, 1.2);
        let mut instances = scene.instances().to_vec();
        instances.push(Instance::new(Plane { half: [0.7, 0.5] }, Material::default(), 101));
        poses.push(translation(0.3, 0.0, -1.0));
        for (k, instance) in instances.iter_mut().enumerate() {
            (instance.mask_id, instance.material) = (k as i32 + 1, glowing(k + 1));
        }
        let mat = instances.len() as i32;
        let eye = numbers.vector(-2.0, 2.0).map(|x| x as f32);
        let view = look_at_view([101, 75], 1.0, [eye[0], eye[1], 0.6 + eye[2].abs()], [0., 0., -0.4]);
        let cfg = RasterCfg { tone: ToneCurve::Clip, ..EXACT };
        let still = TestFrame { cfg, ..TestFrame::new((unlit(RenderScene::new(instances).unwrap()), poses), view) };
        let image = still.with_renderer(Renderer::RayTraced { samples: 1, max_bounces: 0, denoise: false, seed });
        for k in image.inner().filter(|&k| image.mask()[k] != 0 && image.is_off_silhouette(k)) {
            let (color, expected) = (image.color()[k], color_of(image.mask()[k] as usize));
            let same = (0..3).all(|c| color[c].abs_diff(expected[c]) <= 4);
            assert!(same, "scene {seed}, pixel {k}: {color:?}, not {expected:?}");
            compared += 1;
            on_mats += usize::from(image.mask()[k] == mat);
        }
    }
    assert!(compared > 12 * 99 * 73 / 3 && on_mats > 500, "{compared}, {on_mats} on mats");
}

/// Edges between the faces of a box, and of a cylinder, are as smooth in ray tracing as in the rasterizer: each sample
/// has its face.
///
/// Root cause: rays gave every face of a closed form the number of the first face, so that colors had one sample there.
#[test]
fn smooth_edges() {
    let plain = Material::from_rgba([0.7, 0.7, 0.7, 1.0]);
    let (mut scene, poses) = instances([
        (Shape::from(Box { half: [0.3, 0.3, 0.3] }), plain.clone(), translation(-0.4, 0.0, 0.0)),
        (Cylinder { radius: 0.25, half_length: 0.3 }.into(), plain, translation(0.4, 0.0, 0.0)),
    ]);
    scene.lights[0].direction = [-0.3, -0.9, -0.6];
    let view = View::look_at([161, 121], 0.8, [0.5, 1.6, 1.1], [0., 0., 0.], [0.1, 0., 1.]).unwrap();
    let still = TestFrame { cfg: RasterCfg { shadows: false, ..EXACT }, ..TestFrame::new((scene, poses), view) };
    let (raster, traced) = (still.draw(), still.with_renderer(Renderer::FastRayTraced));
    let normal = |k: usize| Vector3::from(raster.normal()[k]);
    let edge = |k: &usize| raster.neighbors(*k).any(|n| normal(n).dot(&normal(*k)) <= 0.5);
    let edges: Vec<usize> =
        raster.inner().filter(|&k| raster.mask()[k] != 0 && raster.is_inside_instance(k)).filter(edge).collect();
    // A sample at the very edge may belong to either face: a quarter of the difference between them.
    let [found, expected] = [&traced, &raster].map(Image::color);
    let differ = edges.iter().filter(|&&k| (0..3).any(|c| found[k][c].abs_diff(expected[k][c]) > 3)).count();
    assert!(edges.len() > 200 && differ * 50 <= edges.len(), "{differ} of {}", edges.len());
    // The control: one sample looks different at most of them.
    let rough = still.with(|still| still.cfg.samples = 1).with_renderer(Renderer::FastRayTraced);
    let apart = raster.channel(0).iter().zip(rough.channel(0)).filter(|(a, b)| (**a - b).abs() > 3.0).count();
    assert!(apart * 4 > edges.len(), "{apart} of {}", edges.len());
}

fn paths(samples: u32, max_bounces: u32, denoise: bool, seed: u32) -> Renderer {
    Renderer::RayTraced { samples, max_bounces, denoise, seed }
}

/// Root mean square of differences \[bytes\].
fn rms(differences: impl Iterator<Item = u8>) -> f64 {
    let (sum, n) = differences.fold((0.0, 0.0), |(sum, n), by| (sum + f64::from(by).powi(2), n + 1.0));
    (sum / n).sqrt()
}

/// Denoising brings few paths closer to many, where light is hard to find: below a glowing ellipsoid, which is not
/// sampled as a light, so that paths hit it by chance.
#[test]
fn smoothed_noise() {
    let red = |red| matte([red, 0.7, 0.7]);
    let down = PoseF32 { rotation: [[1., 0., 0.], [0., -1., 0.], [0., 0., -1.]], translation: [0., 0., 1.5] };
    let (scene, poses) = instances([
        (Shape::from(Plane::INFINITE), red(0.7), PoseF32::IDENTITY),
        (Sphere { radius: 0.3 }.into(), red(0.2), translation(0., 0., 0.3)),
        (Ellipsoid { radii: [0.56, 0.56, 0.01] }.into(), Material { emission: 6.0, ..red(0.7) }, down),
    ]);
    let mut scene = unlit(scene);
    scene.ambient = Hemisphere { sky: [0.02; 3], ground: [0.02; 3] };
    let view = look_at_view([96, 72], 0.7, [2.2, -1.4, 1.0], [0., 0., 0.2]);
    let still = TestFrame { cfg: EXACT, ..TestFrame::new((scene, poses), view) };
    let many = still.with_renderer(paths(256, 1, false, 9));
    let error = |samples, denoise| {
        let image = still.with_renderer(paths(samples, 1, denoise, 1));
        rms(image.color().iter().flatten().zip(many.color().iter().flatten()).map(|(a, b)| a.abs_diff(*b)))
    };
    let (rough, smooth, more) = (error(4, false), error(4, true), error(16, false));
    assert!(smooth < 0.6 * rough, "{smooth} of {rough}");
    // A single path has no estimate of its noise; the neighbors give one.
    let (one, smoothed) = (error(1, false), error(1, true));
    assert!(smoothed < 0.6 * one, "{smoothed} of {one}");
    // A control of the measure: noise falls as paths are added.
    assert!(more < 0.75 * rough, "{more} of {rough}");
}

/// A floor of black and white tiles below a glossy layer, in weak uniform light, with the edge of a shadow on it.
fn tiles(emission: f32, dim: f32) -> TestFrame {
    let tile = |k: i32| {
        let rgba = if (k / 6 + k % 6) % 2 == 0 { [1.0; 4] } else { [0.0, 0.0, 0.0, 1.0] };
        let material = Material { specular: 1.0, shininess: 0.3, ..Material::from_rgba(rgba) };
        let place = translation(0.2 * (k / 6) as f32 - 0.5, 0.2 * (k % 6) as f32 - 0.5, 0.0);
        (Shape::from(Plane { half: [0.1, 0.1] }), material, place)
    };
    let light = Material { emission: emission * dim, ..matte([1.0; 3]) };
    let (scene, poses) =
        instances((0..36).map(tile).chain([(Sphere { radius: 0.4 }.into(), light, translation(0.4, 0.9, 1.0))]));
    let mut scene = unlit(scene);
    scene.ambient = Hemisphere { sky: [0.05 * dim; 3], ground: [0.05 * dim; 3] };
    TestFrame { cfg: EXACT, ..TestFrame::new((scene, poses), look_at_view([96, 72], 0.6, [-1.2, -0.8, 0.9], [0.; 3])) }
}

/// Black tiles mirror their surroundings, and adjacent white tiles are as bright: denoising blends neither into the
/// other.
///
/// Root cause: light was divided by the color of the surface, though mirrored light is not tinted by it.
#[test]
fn smoothed_tiles() {
    let still = tiles(3.0, 1.0);
    let many = still.with_renderer(paths(1024, 1, false, 9));
    let mask = many.mask();
    // Black tiles, away from their edges.
    let black: Vec<usize> = (2..70)
        .flat_map(|y| (2..94).map(move |x| y * 96 + x))
        .filter(|&k| (1..=36).contains(&mask[k]) && ((mask[k] - 1) / 6 + (mask[k] - 1) % 6) % 2 == 1)
        .filter(|&k| [1, 96, 97, 95].into_iter().all(|n| mask[k - n] == mask[k] && mask[k + n] == mask[k]))
        .collect();
    let error = |denoise| {
        let few = still.with_renderer(paths(2, 1, denoise, 1));
        rms(black.iter().map(|&k| many.color()[k][0].abs_diff(few.color()[k][0])))
    };
    let (rough, smooth) = (error(false), error(true));
    // A third of the error. Without tile colors in the guides it was half.
    assert!(black.len() > 300 && smooth < 0.4 * rough, "{smooth} of {rough}, {} pixels", black.len());
}

/// A thousandth of the light, with a thousand times the exposure, is denoised like the whole light. Light that is too
/// bright for single precision stays finite.
///
/// Root cause: light that differed by less than a fixed amount was blended, and infinity times a weight of 0 spread.
#[test]
fn smoothed_exposure() {
    let of = |emission: f32, dim: f32, stops: f64| {
        let mut still = tiles(emission, dim);
        still.scene.sky = Sky::uniform([0.0; 3]);
        (still.stops, still.channels) = (stops, Channels { color: true, ..Channels::NONE });
        still.with_renderer(paths(16, 1, true, 3))
    };
    let (plain, dim) = (of(3.0, 1.0, 0.0), of(3.0, 1.0 / 1024.0, 10.0));
    // Powers of two change no digit; the tiles' colors are the same.
    assert_eq!(count_different(&plain, &dim, 1), 0);
    let blinding = of(1e30, 1.0, 0.0);
    // Pixels of the light and of its mirror image are white; ambient light leaves no pixel black.
    let dark = |image: &Image| image.color().iter().filter(|color| color[..3] == [0; 3]).count();
    assert!(dark(&blinding) <= dark(&plain), "{} pixels, not {}", dark(&blinding), dark(&plain));
}
