//! Path tracing compared with closed forms.

mod aperture;
mod emitters;
mod glass;
mod shadows;

use super::*;
use crate::geometry::assets::RayAssetCache;
use crate::raster::Layer;
use crate::simd::{SimdLevel, at_level};
use crate::visibility::View;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere};
use kinetoscope_scene::vector::sub;
use kinetoscope_scene::{Headlight, Hemisphere, Instance, LightKind, Material, PoseF32, Sky};
use kinetoscope_testkit::tolerance::{Tolerance, assert_number};
use std::f64::consts::PI;

/// A scene without any light.
fn dark(instances: Vec<Instance>) -> RenderScene {
    let mut scene = RenderScene::new(instances).unwrap();
    scene.lights.clear();
    scene.headlight = Headlight { active: false, ..Headlight::default() };
    scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
    scene.sky = Sky::uniform([0.0; 3]);
    scene
}

/// A matte color, the same in all channels, given in linear light.
fn matt(linear: f32) -> Material {
    let srgb = if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    Material { specular: 0.0, ..Material::from_rgba([srgb, srgb, srgb, 1.0]) }
}

/// The albedo of [`matt`]: conversion to sRGB and back rounds.
fn albedo(linear: f32) -> f64 {
    f64::from(kinetoscope_scene::decode_srgb(matt(linear).rgba[0]))
}

/// A view of one pixel of a millionth of a radian: the light of one ray.
fn one_ray_view(eye: [f32; 3], target: [f32; 3]) -> View {
    View { fx: 1e6, fy: 1e6, cx: 0.5, cy: 0.5, ..View::look_at([1, 1], 0.5, eye, target, [0., 0., 1.]).unwrap() }
}

/// A scene prepared for rays, with its lights.
struct TestScene<'a> {
    scene: &'a RenderScene,
    tracer: RayTracer,
    lights: SceneLights,
    projection: Projection,
}

impl<'a> TestScene<'a> {
    fn new(scene: &'a RenderScene, poses: &[PoseF32], view: &View) -> Self {
        let mut tracer = RayTracer::default();
        tracer.prepare_geometry(scene, &RayAssetCache::default(), |i| Layer::for_instance(i, u32::MAX));
        tracer.place(scene, poses, None);
        let (mut lights, projection) = (SceneLights::default(), Projection::from(view));
        lights.prepare(scene, &tracer, &scene.lights, true, &projection, true);
        Self { scene, tracer, lights, projection }
    }

    fn paths(&self, samples: u32, max_bounces: u32, seed: u32) -> PathTracer<'_> {
        let Self { scene, tracer, lights, projection } = self;
        let camera_rays = CameraRayGenerator { projection, lens: None, thin_lens: None };
        PathTracer {
            scene,
            tracer,
            camera_rays,
            motion: None,
            samples,
            max_bounces,
            seed,
            lights,
            strategy: MisStrategy::Both,
        }
    }

    /// The light of a pixel in several images with different seeds: the mean and its standard deviation.
    fn mean_light(&self, paths: &PathTracer<'_>, count: u32) -> (f64, f64) {
        let mut stack = TraversalStack::default();
        let all: Vec<f64> =
            (0..count).map(|seed| pixel(&PathTracer { seed, ..paths.clone() }, [0, 0], &mut stack)).collect();
        let n = f64::from(count);
        let mean = all.iter().sum::<f64>() / n;
        let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, (variance / n).sqrt())
    }
}

/// The light of a pixel.
fn pixel(paths: &PathTracer<'_>, at: [usize; 2], stack: &mut TraversalStack) -> f64 {
    at_level!(SimdLevel::best(), s => paths.pixel(s, at, stack)).color[1]
}

/// The light of a pixel in sixteen images: the mean and its standard deviation.
fn mean_light(scene: &RenderScene, poses: &[PoseF32], view: &View, samples: u32, max_bounces: u32) -> (f64, f64) {
    let studio = TestScene::new(scene, poses, view);
    studio.mean_light(&studio.paths(samples, max_bounces, 0), 16)
}

/// True within five standard deviations, and rounding: colors and lights are single precision.
fn agrees((mean, deviation): (f64, f64), expected: f64) -> bool {
    (mean - expected).abs() <= 5.0 * deviation + 1e-6 * expected.abs().max(1e-3)
}

/// Tolerances for light of brightness 1.
const SINGLE: Tolerance = Tolerance::absolute(1e-5, "colors, lights and the camera are single precision");
const TIGHT: Tolerance = Tolerance::absolute(1e-6, "colors are single precision; every path sees the same light");

/// A floor of this material at z = 0, and further instances.
fn on_floor(floor: Material, others: impl IntoIterator<Item = Instance>) -> RenderScene {
    dark(std::iter::once(Instance::new(Plane::INFINITE, floor, 1)).chain(others).collect())
}

/// One shape in uniform light.
fn furnace(shape: impl Into<Shape>, material: Material, light: f32) -> RenderScene {
    let mut scene = dark(vec![Instance::new(shape, material, 1)]);
    scene.ambient = Hemisphere { sky: [light; 3], ground: [light; 3] };
    scene
}

fn floor_and_object(height: f32) -> [PoseF32; 2] {
    [PoseF32::IDENTITY, PoseF32::from_translation([0.0, 0.0, height])]
}

fn glass_of(alpha: f32) -> Material {
    let mut glass = matt(0.0);
    glass.rgba[3] = alpha;
    glass
}

const ONE: [PoseF32; 1] = [PoseF32::IDENTITY];

/// White furnace: a convex object of albedo a reflects a times the uniform light. Exact to the last digits, because
/// every path does so.
#[test]
fn matt_in_furnace() {
    let shapes: [Shape; 5] = [
        Sphere { radius: 0.3 }.into(),
        Capsule { radius: 0.15, half_length: 0.3 }.into(),
        Ellipsoid { radii: [0.4, 0.2, 0.1] }.into(),
        Cylinder { radius: 0.2, half_length: 0.25 }.into(),
        Box { half: [0.2, 0.3, 0.1] }.into(),
    ];
    for (shape, a) in shapes.iter().flat_map(|shape| [1.0, 0.5, 0.18].map(|a| (shape, a))) {
        let scene = furnace(shape.clone(), matt(a), 0.8);
        for eye in [[2.0, 0.3, 0.2], [0.1, 0.2, 3.0], [-1.0, -1.0, -1.0]] {
            let (mean, deviation) = mean_light(&scene, &ONE, &one_ray_view(eye, [0.02, 0.01, 0.03]), 4, 3);
            assert_number(&format!("{} from {eye:?}", shape.name()), mean, f64::from(0.8f32) * albedo(a), TIGHT);
            assert!(deviation < 1e-12);
        }
    }
    // A control: a camera inside, where there is no light.
    let scene = furnace(Sphere { radius: 0.3 }, matt(1.0), 0.8);
    assert_eq!(mean_light(&scene, &ONE, &one_ray_view([0.0; 3], [1.0, 0.2, 0.1]), 4, 3).0, 0.0);
}

/// A shiny object in a furnace reflects a part of the light, and adds no light.
///
/// A perfectly reflecting metal of roughness 1: facets of all tilts are equally dense, D = 1/pi, and mask each other by
/// G = 2 o i / (o + i) of the cosines o and i. So the reflected light is the integral of D G / (4 o i) i over the
/// hemisphere, `1 - o ln(1 + 1/o)`: 0.31 straight on. GGX loses the light between facets. A metal of roughness 0 loses
/// no light.
#[test]
fn gloss_in_furnace() {
    let ball = |material| furnace(Sphere { radius: 1.0 }, material, 1.0);
    let metal = |roughness| Material { metallic: 1.0, roughness: Some(roughness), ..Material::from_rgba([1.0; 4]) };
    let (rough, smooth) = (ball(metal(1.0)), ball(metal(0.0)));
    for beside in [0.0f32, 0.6, 0.95] {
        let view = one_ray_view([3.0, beside, 0.0], [0.0, beside, 0.0]);
        for (specular, shininess) in [(1.0, 1.0), (1.0, 0.1), (0.5, 0.5), (1.0, 0.0)] {
            let scene = ball(Material { specular, shininess, ..matt(1.0) });
            let (mean, deviation) = mean_light(&scene, &ONE, &view, 256, 3);
            assert!(mean <= 1.0 + 5.0 * deviation && mean > 0.7, "{specular} {shininess} {beside}: {mean}");
        }
        let cos = (1.0 - f64::from(beside).powi(2)).sqrt();
        let expected = 1.0 - cos * (1.0 / cos).ln_1p();
        let light = mean_light(&rough, &ONE, &view, 256, 3);
        assert!(agrees(light, expected), "{beside}: {light:?}, not {expected}");
        // The control: a deviation of a fiftieth is detected.
        assert!(!agrees(light, 1.02 * expected) && !agrees(light, 0.98 * expected), "{beside}: {light:?}");
        let limit = Tolerance::absolute(1e-4, "facets of alpha² 1e-6 hide less than that, over the cosine");
        assert_number(&format!("{beside} aside"), mean_light(&smooth, &ONE, &view, 256, 3).0, 1.0, limit);
    }
}

/// Inside of an emissive ball, light is the same at every point: after n bounces it is e (1 + a + ... + a^n).
#[test]
fn bounces() {
    for a in [0.5f32, 0.8] {
        let material = Material { emission: 0.25, ..matt(a) };
        let scene = dark(vec![Instance::new(Sphere { radius: 1.0 }, material, 1)]);
        let light = |bounces| mean_light(&scene, &ONE, &one_ray_view([0.2, -0.1, 0.3], [1.0, 0.5, -0.2]), 256, bounces);
        let a = albedo(a);
        let sum = |bounces: u32| 0.25 * a * (0..=bounces + 1).map(|k| a.powi(k as i32)).sum::<f64>();
        for bounces in [0, 1, 2, 5, 10] {
            let light = light(bounces);
            assert!(agrees(light, sum(bounces)), "{bounces} bounces: {light:?}, not {}", sum(bounces));
        }
        // Controls: another number of bounces is detected. The limit of all bounces: e / (1 - a).
        assert!(!agrees(light(2), sum(1)) && !agrees(light(2), sum(3)));
        assert!(agrees(light(64), 0.25 * a / (1.0 - a)), "{:?}", light(64));
    }
}

fn light(kind: LightKind, position: [f32; 3], direction: [f32; 3]) -> Light {
    Light { kind, position, direction, attenuation: [0., 0., 1.], diffuse: [0.9; 3], ..Light::default() }
}

fn sun() -> Light {
    light(LightKind::Directional, [0.; 3], [0., 0., -1.])
}

/// A matte floor reflects albedo, color, cosine, and 1 / r² of a near light. Invalid lights are left out.
#[test]
fn lights() {
    let mut scene = on_floor(matt(0.6), []);
    let view = one_ray_view([3.0, 1.0, 2.0], [0.2, -0.1, 0.0]);
    let place = [0.9f32, 0.4, 1.5];
    let to = [0, 1, 2].map(|k| f64::from(place[k]) - f64::from([0.2f32, -0.1, 0.0][k]));
    let square = dot(to, to);
    let down = [-0.7, -0.5, -1.5];
    let spot = LightKind::Spot { cutoff_deg: 30.0, exponent: 3.0 };
    let axis = kinetoscope_scene::vector::normalize(down.map(f64::from)).unwrap();
    let inside = -dot(axis, to) / square.sqrt();
    for (light, part) in [
        (light(LightKind::Directional, place, down), -axis[2]),
        (light(LightKind::Point, place, down), to[2] / square.powf(1.5)),
        (light(spot, place, down), to[2] / square.powf(1.5) * inside.powi(3)),
        // Faces away.
        (light(spot, place, [0.7, 0.5, -1.5]), 0.0),
    ] {
        scene.lights = vec![light];
        let expected = albedo(0.6) * f64::from(0.9f32) * part;
        let dim = Tolerance {
            absolute: 1e-8,
            relative: 1e-5,
            derivation: "pixels of micrometers, lights in single precision",
        };
        assert_number(&format!("{light:?}"), mean_light(&scene, &ONE, &view, 4, 3).0, expected, dim);
    }
    let good = light(LightKind::Point, [0., 0., 1.], [0., 0., -1.]);
    for bad in [f32::NAN, f32::INFINITY] {
        for light in [
            Light { diffuse: [bad; 3], ..good },
            Light { ambient: [bad; 3], ..good },
            Light { position: [bad; 3], ..good },
            Light { attenuation: [bad; 3], ..good },
        ] {
            scene.lights = vec![light];
            assert!(
                mean_light(&scene, &ONE, &one_ray_view([3.0, 0.0, 4.0], [0.0; 3]), 4, 1).0.is_finite(),
                "{light:?}"
            );
        }
    }
}

/// Form factor of a rectangle with a point below its center, `a` by `b` half sides in units of the height. Source:
/// Howell, A catalog of radiation heat transfer configuration factors, B-3.
fn form_factor(a: f64, b: f64) -> f64 {
    let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    4.0 / (2.0 * PI) * (a / p * (b / p).atan() + b / q * (a / q).atan())
}

/// An object of alpha 0.3 between the floor and a light transmits 0.7 of the light, once for each of its fronts; seen
/// from above it contributes 0.3 of the image.
#[test]
fn alpha() {
    let (lit, part) = (albedo(0.6) * f64::from(0.9f32), 1.0 - f64::from(0.3f32));
    let ball = Shape::from(Sphere { radius: 0.2 });
    for (shape, fronts) in [(ball, 1), (bricks(&[0.2]), 1), (bricks(&[0.2, 0.1]), 2), (bricks(&[0.2, 0.15, 0.1]), 3)] {
        let mut scene = on_floor(matt(0.6), [Instance::new(shape.clone(), glass_of(0.3), 2)]);
        scene.lights = vec![sun()];
        let (mean, _) =
            mean_light(&scene, &floor_and_object(1.0), &one_ray_view([1.0, 0.0, 0.5], [0.03, 0.01, 0.0]), 4, 0);
        assert_number(shape.name(), mean, lit * part.powi(fronts), SINGLE);
        if let Shape::Sphere(_) = shape {
            let (mean, _) = mean_light(&scene, &floor_and_object(1.0), &one_ray_view([1.0, 0.0, 0.5], [0.0; 3]), 4, 0);
            assert_number("below the middle", mean, part * lit, SINGLE);
            // Through the ball at a point that is lit directly.
            let light =
                mean_light(&scene, &floor_and_object(1.0), &one_ray_view([-0.5, 0.0, 1.5], [0.5, 0.0, 0.5]), 1024, 0);
            assert!(agrees(light, part * lit), "{light:?}");
            assert!(!agrees(light, lit) && !agrees(light, part * part * lit));
        }
    }
}

#[test]
fn mirrors() {
    let mirror = Material { reflectance: 1.0, ..matt(0.3) };
    let glow = Material { emission: 1.0, ..matt(0.4) };
    let mut scene = on_floor(mirror, [Instance::new(Sphere { radius: 0.3 }, glow, 2)]);
    scene.sky = Sky { zenith: [0.2; 3], horizon: [0.9; 3], nadir: [0.0; 3] };
    let poses = [PoseF32::IDENTITY, PoseF32::from_translation([-1.0, 0.0, 1.0])];
    let (mean, _) = mean_light(&scene, &poses, &one_ray_view([1.0, 0.0, 1.0], [0.0; 3]), 4, 2);
    assert_number("the ball", mean, albedo(0.4), TIGHT);
    // Past the ball: the sky 45 degrees up.
    let (mean, _) = mean_light(&scene, &poses, &one_ray_view([1.0, 2.0, 1.0], [0.0, 2.0, 0.0]), 4, 2);
    let linear = |x: f32| f64::from(kinetoscope_scene::decode_srgb(x));
    assert_number("the sky", mean, linear(0.9) + 0.5f64.sqrt().sqrt() * (linear(0.2) - linear(0.9)), SINGLE);
}

/// The headlight and ambient light are as bright as in the rasterizer. The headlight is added to sixteen other lights,
/// and is not blocked by a housing of the camera nearer than its near plane.
#[test]
fn headlight() {
    let only = |ambient, active| Headlight { ambient: [ambient; 3], diffuse: [0.4; 3], specular: [0.0; 3], active };
    let (eye, front) = ([3.0f32, 0.0, 4.0], 0.8 * f64::from(0.4f32));
    let view = one_ray_view(eye, [0.0; 3]);
    let mut scene = on_floor(matt(0.6), []);
    scene.headlight = only(0.1, true);
    scene.ambient = Hemisphere { sky: [0.3; 3], ground: [0.1; 3] };
    let expected = albedo(0.6) * (front + f64::from(0.1f32) + f64::from(0.3f32));
    assert_number("ambient", mean_light(&scene, &ONE, &view, 4, 2).0, expected, SINGLE);

    let mut scene = on_floor(matt(0.6), []);
    scene.headlight = only(0.0, true);
    scene.lights = vec![Light { diffuse: [0.03; 3], ..sun() }; 16];
    let expected = albedo(0.6) * (16.0 * f64::from(0.03f32) + front);
    // A missing light of the sixteen would be 0.018.
    assert_number("sixteen lights", mean_light(&scene, &ONE, &view, 4, 0).0, expected, SINGLE);

    let mut scene = on_floor(matt(0.6), [Instance::new(Box { half: [0.05; 3] }, matt(0.6), 2)]);
    scene.headlight = only(0.0, true);
    let (view, poses) = (View { near: 0.1, ..view }, [PoseF32::IDENTITY, PoseF32::from_translation(eye)]);
    assert_number("housing", mean_light(&scene, &poses, &view, 4, 0).0, albedo(0.6) * front, SINGLE);
    // A control: a light at the same place is shaded by the housing.
    scene.headlight = only(0.0, false);
    scene.lights = vec![Light { attenuation: [1., 0., 0.], ..light(LightKind::Point, eye, [0., 0., -1.]) }];
    assert_eq!(mean_light(&scene, &poses, &view, 4, 0).0, 0.0);
}

/// A light reflected by a black glossy floor, seen in the mirror direction and beside it: Walter et al. 2007, Schlick
/// 1994.
#[test]
fn ggx_highlights() {
    for (specular, shininess) in [(1.0f32, 1.0f32), (0.5, 0.25), (0.1, 0.05)] {
        let mut scene = on_floor(Material { specular, shininess, ..matt(0.0) }, []);
        let toward_light = [0.8f64, 0.0, 0.6];
        let light = Light { diffuse: [0.0; 3], specular: [0.5; 3], ..Light::default() };
        scene.lights = vec![Light { direction: toward_light.map(|x| -x as f32), ..light }];
        // The first is the mirror direction.
        let all = [[-1.6f32, 0.0, 1.2], [-1.5, 0.3, 1.2], [-1.0, 0.5, 2.0], [0.0, 0.0, 2.0]].map(|eye| {
            let (mean, _) = mean_light(&scene, &ONE, &one_ray_view(eye, [0.0; 3]), 1, 0);
            let o = kinetoscope_scene::vector::normalize(eye.map(f64::from)).unwrap();
            let h = kinetoscope_scene::vector::normalize(add(o, toward_light)).unwrap();
            let alpha2 = 2.0 / ((128.0 * f64::from(shininess)).max(1.0) + 2.0);
            let d = alpha2 / (PI * (h[2] * h[2] * (alpha2 - 1.0) + 1.0).powi(2));
            let lambda = |cos: f64| ((1.0 + alpha2 * (1.0 / (cos * cos) - 1.0)).sqrt() - 1.0) / 2.0;
            let g = 1.0 / (1.0 + lambda(o[2]) + lambda(0.6));
            let (f0, f90) = (0.08 * f64::from(specular), (4.0 * f64::from(specular)).min(1.0));
            let f = f0 + (f90 - f0) * (1.0 - dot(h, o)).powi(5);
            // A light of color L has the irradiance PI L.
            let expected = PI * 0.5 * d * g * f / (4.0 * o[2]);
            let sharp = Tolerance::relative(2e-4, "single precision, of which the sharpest lobe makes 1e3 per radian");
            assert_number(&format!("{specular} {shininess} {eye:?}"), mean, expected, sharp);
            mean
        });
        // Controls: a highlight exists, in the mirror direction.
        assert!(all[0] > 0.0 && all[0] > all[2] && all[2] > all[3], "{all:?}");
    }
}

/// One mesh of nested bricks, whose corners share their normals.
fn bricks(halves: &[f32]) -> Shape {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for half in halves {
        let first = positions.len() as u32;
        positions.extend((0..8).map(|k| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { *half } else { -half })));
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = sides.iter().flat_map(|&[a, b, c, d]: &[u32; 4]| [[a, b, c], [a, c, d]]);
        triangles.extend(faces.map(|t| t.map(|k| k + first)));
    }
    mesh(positions, triangles, std::f32::consts::PI)
}

fn mesh(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>, crease: f32) -> Shape {
    let mesh = kinetoscope_scene::mesh::TriMesh::from_triangles(positions, triangles);
    kinetoscope_scene::shape::Mesh {
        mesh: std::sync::Arc::new(kinetoscope_scene::shape::RenderMesh::new(&mesh, crease)),
    }
    .into()
}
