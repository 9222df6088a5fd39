//! Light against closed forms.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod aperture;
mod emitters;
mod glass;
mod shadows;

use super::*;
use crate::lanes::Scalar;
use crate::ray::RayAssets;
use crate::ray::vector::sub;
use crate::visibility::View;
use crate::visibility::raster::Layer;
use scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere};
use scene::{Headlight, Hemisphere, Instance, LightKind, Material, PoseF32, Shape, Sky};
use std::f64::consts::PI;

/// A scene without any light of its own.
fn dark(instances: Vec<Instance>) -> RenderScene {
    let mut scene = RenderScene::new(instances).unwrap();
    scene.lights.clear();
    scene.headlight = Headlight { active: false, ..Headlight::default() };
    scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
    scene.sky = Sky::uniform([0.0; 3]);
    scene
}

/// A matt colour, the same in all channels, given in linear light, and what it is after sRGB.
fn matt(linear: f32) -> Material {
    let srgb = if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    Material { specular: 0.0, ..Material::from_rgba([srgb, srgb, srgb, 1.0]) }
}

/// The colour that a material really has: sRGB and back rounds.
fn albedo(linear: f32) -> f64 {
    f64::from(scene::material::decode_srgb(matt(linear).rgba[0]))
}

/// A pixel of a millionth of a radian: the light of one ray.
fn looking(eye: [f32; 3], target: [f32; 3]) -> View {
    View { fx: 1e6, fy: 1e6, cx: 0.5, cy: 0.5, ..View::look_at([1, 1], 0.5, eye, target, [0., 0., 1.]).unwrap() }
}

/// What rays meet, and the light.
struct Studio<'a> {
    scene: &'a RenderScene,
    tracer: Tracer,
    lamps: Lamps,
    projection: Projection,
}

impl<'a> Studio<'a> {
    fn new(scene: &'a RenderScene, poses: &[PoseF32], view: &View) -> Self {
        let mut tracer = Tracer::default();
        tracer.find_bodies(scene, &RayAssets::default(), |i| Layer::of(i, u32::MAX));
        tracer.place(scene, poses, None);
        let (mut lamps, projection) = (Lamps::default(), Projection::from(view));
        lamps.prepare((scene, &tracer), &scene.lights, true, (&projection, true));
        Self { scene, tracer, lamps, projection }
    }

    fn paths(&self, samples: u32, max_bounces: u32, seed: u32) -> Paths<'_> {
        let Self { scene, tracer, lamps, projection } = self;
        let eye = Eye { projection, lens: None, pupil: None };
        Paths { scene, tracer, eye, moving: None, samples, max_bounces, seed, lamps, ways: Ways::Both }
    }

    /// What a pixel shows in several pictures of different seeds: the mean, and the standard deviation of it.
    fn seen(&self, paths: &Paths<'_>, count: u32) -> (f64, f64) {
        let mut stack = Stack::default();
        let all: Vec<f64> =
            (0..count).map(|seed| Paths { seed, ..paths.clone() }.pixel(Scalar, [0, 0], &mut stack).color[1]).collect();
        let n = f64::from(count);
        let mean = all.iter().sum::<f64>() / n;
        let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, (variance / n).sqrt())
    }
}

/// What a pixel shows in sixteen pictures.
fn seen(scene: &RenderScene, poses: &[PoseF32], view: &View, samples: u32, max_bounces: u32) -> (f64, f64) {
    let studio = Studio::new(scene, poses, view);
    studio.seen(&studio.paths(samples, max_bounces, 0), 16)
}

/// Five standard deviations, and rounding: colours and lamps are single precision.
fn agrees((mean, deviation): (f64, f64), expected: f64) -> bool {
    (mean - expected).abs() <= 5.0 * deviation + 1e-6 * expected.abs().max(1e-3)
}

fn every_convex_shape() -> Vec<Shape> {
    vec![
        Sphere { radius: 0.3 }.into(),
        Capsule { radius: 0.15, half_length: 0.3 }.into(),
        Ellipsoid { radii: [0.4, 0.2, 0.1] }.into(),
        Cylinder { radius: 0.2, half_length: 0.25 }.into(),
        Box { half: [0.2, 0.3, 0.1] }.into(),
    ]
}

/// White furnace: what is convex and has the albedo a sends a times the light that is everywhere. To the last digits, for
/// every path does.
#[test]
fn matt_things_in_a_furnace_are_as_bright_as_their_albedo() {
    for shape in every_convex_shape() {
        for a in [1.0, 0.5, 0.18] {
            let mut scene = dark(vec![Instance::new(shape.clone(), matt(a), 1)]);
            scene.ambient = Hemisphere { sky: [0.8; 3], ground: [0.8; 3] };
            for (k, eye) in [[2.0, 0.3, 0.2], [0.1, 0.2, 3.0], [-1.0, -1.0, -1.0]].into_iter().enumerate() {
                let view = looking(eye, [0.02, 0.01, 0.03]);
                let (mean, deviation) = seen(&scene, &[PoseF32::IDENTITY], &view, 4, 3);
                let expected = 0.8f32 as f64 * albedo(a);
                assert!((mean - expected).abs() < 1e-6, "{} from {k}: {mean}, not {expected}", shape.name());
                assert!(deviation < 1e-12);
            }
        }
    }
    // A control: a camera inside, where no light is.
    let mut scene = dark(vec![Instance::new(Sphere { radius: 0.3 }, matt(1.0), 1)]);
    scene.ambient = Hemisphere { sky: [0.8; 3], ground: [0.8; 3] };
    let (mean, _) = seen(&scene, &[PoseF32::IDENTITY], &looking([0.0; 3], [1.0, 0.2, 0.1]), 4, 3);
    assert_eq!(mean, 0.0);
}

/// Shiny things in a furnace take a part of the light, and give none.
#[test]
fn shiny_things_in_a_furnace_are_not_brighter_than_it() {
    for (specular, shininess) in [(1.0, 1.0), (1.0, 0.1), (0.5, 0.5), (1.0, 0.0)] {
        let material = Material { specular, shininess, ..matt(1.0) };
        let mut scene = dark(vec![Instance::new(Sphere { radius: 1.0 }, material, 1)]);
        scene.ambient = Hemisphere { sky: [1.0; 3], ground: [1.0; 3] };
        for beside in [0.0, 0.6, 0.95] {
            let view = looking([3.0, beside, 0.0], [0.0, beside, 0.0]);
            let (mean, deviation) = seen(&scene, &[PoseF32::IDENTITY], &view, 256, 3);
            assert!(mean <= 1.0 + 5.0 * deviation && mean > 0.7, "{specular} {shininess} {beside}: {mean}");
        }
    }
}

/// A metal that mirrors everything, of roughness 1, in a furnace: facets of all tilts are equally dense, D = 1/pi, and hide each
/// other by G = 2 o i / (o + i) of the cosines o and i, so what is sent of light from everywhere is the integral of
/// D G / (4 o i) i over the hemisphere, `1 - o ln(1 + 1/o)`: 0.31 straight on. What facets send each other is lost, as GGX has it.
/// A metal of roughness 0 loses nothing.
#[test]
fn metals_in_a_furnace_send_what_ggx_says() {
    let furnace = |roughness: f32| {
        let material = Material { metallic: 1.0, roughness: Some(roughness), ..Material::from_rgba([1.0; 4]) };
        let mut scene = dark(vec![Instance::new(Sphere { radius: 1.0 }, material, 1)]);
        scene.ambient = Hemisphere { sky: [1.0; 3], ground: [1.0; 3] };
        scene
    };
    let (rough, smooth) = (furnace(1.0), furnace(0.0));
    for beside in [0.0f32, 0.6, 0.95] {
        let view = looking([3.0, beside, 0.0], [0.0, beside, 0.0]);
        let cos = (1.0 - f64::from(beside).powi(2)).sqrt();
        let expected = 1.0 - cos * (1.0 / cos).ln_1p();
        let light = seen(&rough, &[PoseF32::IDENTITY], &view, 256, 3);
        assert!(agrees(light, expected), "{beside}: {light:?}, not {expected}");
        // It can tell a fiftieth.
        assert!(!agrees(light, 1.02 * expected) && !agrees(light, 0.98 * expected), "{beside}: {light:?}");
        let (mean, _) = seen(&smooth, &[PoseF32::IDENTITY], &view, 256, 3);
        // Facets of alpha² 1e-6 hide less than that, over the cosine.
        assert!((mean - 1.0).abs() < 1e-4, "{beside}: {mean}");
    }
}

/// Inside of a ball that glows, light is the same at every point: after n bounces it is e (1 + a + ... + a^n).
#[test]
fn every_bounce_in_a_glowing_ball_adds_its_part() {
    for a in [0.5f32, 0.8] {
        let material = Material { emission: 0.25, ..matt(a) };
        let scene = dark(vec![Instance::new(Sphere { radius: 1.0 }, material, 1)]);
        let view = looking([0.2, -0.1, 0.3], [1.0, 0.5, -0.2]);
        let a = albedo(a);
        let sum = |bounces: u32| 0.25 * a * (0..=bounces + 1).map(|k| a.powi(k as i32)).sum::<f64>();
        for bounces in [0, 1, 2, 5, 10] {
            let light = seen(&scene, &[PoseF32::IDENTITY], &view, 256, bounces);
            assert!(agrees(light, sum(bounces)), "{bounces} bounces: {light:?}, not {}", sum(bounces));
        }
        // Controls: another number of bounces would be found out, and so would a bounce too many.
        let light = seen(&scene, &[PoseF32::IDENTITY], &view, 256, 2);
        assert!(!agrees(light, sum(1)) && !agrees(light, sum(3)));
        // All of them: e / (1 - a).
        let light = seen(&scene, &[PoseF32::IDENTITY], &view, 256, 64);
        assert!(agrees(light, 0.25 * a / (1.0 - a)), "{light:?}");
    }
}

fn lamp(kind: LightKind, position: [f32; 3], direction: [f32; 3]) -> Light {
    Light { kind, position, direction, attenuation: [0., 0., 1.], diffuse: [0.9; 3], ..Light::default() }
}

/// What a matt floor sends of a lamp's light: albedo, colour, cosine, and 1 / r² where it is near.
#[test]
fn lamps_light_a_floor_by_cosine_and_distance() {
    let mut scene = dark(vec![Instance::new(Plane::INFINITE, matt(0.6), 1)]);
    let view = looking([3.0, 1.0, 2.0], [0.2, -0.1, 0.0]);
    let at = [0.2, -0.1, 0.0];
    let place = [0.9f32, 0.4, 1.5];
    let to = [0, 1, 2].map(|k| f64::from(place[k]) - f64::from(at[k] as f32));
    let square = dot(to, to);
    let (colour, a) = (f64::from(0.9f32), albedo(0.6));
    let down = [-0.7, -0.5, -1.5];
    let spot = LightKind::Spot { cutoff_deg: 30.0, exponent: 3.0 };
    let axis = crate::ray::vector::unit(down.map(f64::from)).unwrap();
    let inside = -dot(axis, to) / square.sqrt();
    let cases = [
        (lamp(LightKind::Directional, place, down), -axis[2]),
        (lamp(LightKind::Point, place, down), to[2] / square.powf(1.5)),
        (lamp(spot, place, down), to[2] / square.powf(1.5) * inside.powi(3)),
        // Looks the other way.
        (lamp(spot, place, [0.7, 0.5, -1.5]), 0.0),
    ];
    for (light, part) in cases {
        scene.lights = vec![light];
        let (mean, _) = seen(&scene, &[PoseF32::IDENTITY], &view, 4, 3);
        let expected = a * colour * part;
        // The pixel is a few micrometres wide, lamps are single precision.
        assert!((mean - expected).abs() < 1e-5 * expected.max(1e-3), "{light:?}: {mean}, not {expected}");
    }
}

/// A rectangle above the middle of which a point lies, `a` by `b` half sides in units of the height: its form factor.
/// Source: Howell, A catalog of radiation heat transfer configuration factors, B-3.
fn form_factor(a: f64, b: f64) -> f64 {
    let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    4.0 / (2.0 * PI) * (a / p * (b / p).atan() + b / q * (a / q).atan())
}

#[test]
fn a_glowing_rectangle_lights_a_floor_by_its_form_factor() {
    let emitter = Material { emission: 2.0, ..matt(0.5) };
    let half = [0.6f32, 0.4];
    let scene = dark(vec![Instance::new(Plane::INFINITE, matt(0.7), 1), Instance::new(Plane { half }, emitter, 2)]);
    // Face down, 0.8 m up.
    let rotation = [[1., 0., 0.], [0., -1., 0.], [0., 0., -1.]];
    let poses = [PoseF32::IDENTITY, PoseF32 { rotation, translation: [0., 0., 0.8] }];
    let view = looking([2.0, 0.5, 0.4], [0.0; 3]);
    let factor = form_factor(f64::from(half[0]) / 0.8, f64::from(half[1]) / 0.8);
    let expected = albedo(0.7) * 2.0 * albedo(0.5) * factor;
    let light = seen(&scene, &poses, &view, 1024, 0);
    assert!(agrees(light, expected), "{light:?}, not {expected}");
    assert!(light.1 < 0.01 * expected && !agrees(light, 1.1 * expected), "it can tell a tenth");
    // From behind the rectangle is not there.
    let behind = [PoseF32::IDENTITY, PoseF32::from_translation([0., 0., 0.8])];
    assert_eq!(seen(&scene, &behind, &view, 64, 0).0, 0.0);
}

/// A ball of alpha 0.3 between the floor and a lamp lets 0.7 of the light past, once; seen from above it takes 0.3 of the
/// picture.
#[test]
fn what_is_not_opaque_takes_its_alpha_once() {
    let mut glass = matt(0.0);
    glass.rgba[3] = 0.3;
    let mut scene =
        dark(vec![Instance::new(Plane::INFINITE, matt(0.6), 1), Instance::new(Sphere { radius: 0.2 }, glass, 2)]);
    scene.lights = vec![lamp(LightKind::Directional, [0.; 3], [0., 0., -1.])];
    let poses = [PoseF32::IDENTITY, PoseF32::from_translation([0.0, 0.0, 1.0])];
    let (lit, part) = (albedo(0.6) * f64::from(0.9f32), 1.0 - f64::from(0.3f32));
    let beside = looking([1.0, 0.0, 0.5], [0.0; 3]);
    let (mean, _) = seen(&scene, &poses, &beside, 4, 0);
    assert!((mean - part * lit).abs() < 1e-5, "{mean}");
    // Through the ball at a point that is lit past it.
    let through = looking([-0.5, 0.0, 1.5], [0.5, 0.0, 0.5]);
    let light = seen(&scene, &poses, &through, 1024, 0);
    assert!(agrees(light, part * lit), "{light:?}");
    assert!(!agrees(light, lit) && !agrees(light, part * part * lit));
}

#[test]
fn mirrors_show_what_is_there() {
    let mirror = Material { reflectance: 1.0, ..matt(0.3) };
    let glow = Material { emission: 1.0, ..matt(0.4) };
    let mut scene =
        dark(vec![Instance::new(Plane::INFINITE, mirror, 1), Instance::new(Sphere { radius: 0.3 }, glow, 2)]);
    scene.sky = Sky { zenith: [0.2; 3], horizon: [0.9; 3], nadir: [0.0; 3] };
    let poses = [PoseF32::IDENTITY, PoseF32::from_translation([-1.0, 0.0, 1.0])];
    let (mean, _) = seen(&scene, &poses, &looking([1.0, 0.0, 1.0], [0.0; 3]), 4, 2);
    assert!((mean - albedo(0.4)).abs() < 1e-6, "the ball: {mean}");
    // Past the ball: the sky 45 degrees up.
    let (mean, _) = seen(&scene, &poses, &looking([1.0, 2.0, 1.0], [0.0, 2.0, 0.0]), 4, 2);
    let linear = |x: f32| f64::from(scene::material::decode_srgb(x));
    let expected = linear(0.9) + 0.5f64.sqrt().sqrt() * (linear(0.2) - linear(0.9));
    assert!((mean - expected).abs() < 1e-5, "the sky: {mean}, not {expected}");
}

/// The lamp on the camera, and light from everywhere, are as bright as the rasterizer draws them.
#[test]
fn the_headlight_and_ambient_light_are_those_of_the_rasterizer() {
    let mut scene = dark(vec![Instance::new(Plane::INFINITE, matt(0.6), 1)]);
    scene.headlight = Headlight { ambient: [0.1; 3], diffuse: [0.4; 3], specular: [0.0; 3], active: true };
    scene.ambient = Hemisphere { sky: [0.3; 3], ground: [0.1; 3] };
    let (mean, _) = seen(&scene, &[PoseF32::IDENTITY], &looking([3.0, 0.0, 4.0], [0.0; 3]), 4, 2);
    let expected = albedo(0.6) * (0.8 * f64::from(0.4f32) + f64::from(0.1f32) + f64::from(0.3f32));
    assert!((mean - expected).abs() < 1e-5, "{mean}, not {expected}");
}

/// A camera in a housing that is nearer than it sees from: the picture is the one without.
#[test]
fn the_headlight_shines_out_of_the_cameras_housing() {
    let floor = Instance::new(Plane::INFINITE, matt(0.6), 1);
    let housing = Instance::new(Box { half: [0.05; 3] }, matt(0.6), 2);
    let mut scene = dark(vec![floor, housing]);
    scene.headlight = Headlight { ambient: [0.0; 3], diffuse: [0.4; 3], specular: [0.0; 3], active: true };
    let eye = [3.0f32, 0.0, 4.0];
    let view = View { near: 0.1, ..looking(eye, [0.0; 3]) };
    let poses = [PoseF32::IDENTITY, PoseF32::from_translation(eye)];
    let expected = albedo(0.6) * 0.8 * f64::from(0.4f32);
    let (mean, _) = seen(&scene, &poses, &view, 4, 0);
    assert!((mean - expected).abs() < 1e-5, "{mean}, not {expected}");
    // A control: a lamp at the same place is shaded by it.
    scene.headlight.active = false;
    scene.lights = vec![Light { attenuation: [1., 0., 0.], ..lamp(LightKind::Point, eye, [0., 0., -1.]) }];
    assert_eq!(seen(&scene, &poses, &view, 4, 0).0, 0.0);
}

/// Sixteen lamps and the camera's: all count.
#[test]
fn the_headlight_takes_no_place_of_a_lamp() {
    let mut scene = dark(vec![Instance::new(Plane::INFINITE, matt(0.6), 1)]);
    let down = Light { diffuse: [0.03; 3], ..lamp(LightKind::Directional, [0.; 3], [0., 0., -1.]) };
    scene.lights = vec![down; 16];
    scene.headlight = Headlight { ambient: [0.0; 3], diffuse: [0.4; 3], specular: [0.0; 3], active: true };
    let view = looking([3.0, 0.0, 4.0], [0.0; 3]);
    let (mean, _) = seen(&scene, &[PoseF32::IDENTITY], &view, 4, 0);
    let expected = albedo(0.6) * (16.0 * f64::from(0.03f32) + 0.8 * f64::from(0.4f32));
    // A sixteenth of the lamps would be 0.018.
    assert!((mean - expected).abs() < 1e-5, "{mean}, not {expected}");
}

/// A point lamp exactly on a ceiling, which is not between it and the floor.
#[test]
fn a_lamp_on_a_ceiling_is_not_behind_it() {
    let ceiling = Instance::new(Box { half: [3.0, 3.0, 0.5] }, matt(0.0), 2);
    let mut scene = dark(vec![Instance::new(Plane::INFINITE, matt(0.6), 1), ceiling]);
    let poses = [PoseF32::IDENTITY, PoseF32::from_translation([0.0, 0.0, 2.5])];
    for k in 0..40 {
        let at = [0.03 * k as f32 - 0.6, 0.017 * k as f32 - 0.2, 0.0];
        for height in [2.0f32, 2.001] {
            scene.lights =
                vec![Light { attenuation: [1., 0., 0.], ..lamp(LightKind::Point, [0., 0., height], [0., 0., -1.]) }];
            let (mean, _) = seen(&scene, &poses, &looking([1.5, 0.3, 0.6], at), 1, 0);
            let flat = f64::from(at[0]).hypot(at[1].into());
            let expected = albedo(0.6) * f64::from(0.9f32) * 2.0 / 2.0f64.hypot(flat);
            // The control: a millimetre inside it is.
            let expected = if height > 2.0 { 0.0 } else { expected };
            assert!((mean - expected).abs() < 1e-5, "{at:?}, {height}: {mean}, not {expected}");
        }
    }
}

/// What is no number is left out, wherever it comes from.
#[test]
fn lamps_that_are_no_numbers_spoil_no_picture() {
    let mut scene = dark(vec![Instance::new(Plane::INFINITE, matt(0.6), 1)]);
    let view = looking([3.0, 0.0, 4.0], [0.0; 3]);
    for bad in [f32::NAN, f32::INFINITY] {
        let good = lamp(LightKind::Point, [0., 0., 1.], [0., 0., -1.]);
        for light in [
            Light { diffuse: [bad; 3], ..good },
            Light { ambient: [bad; 3], ..good },
            Light { position: [bad; 3], ..good },
            Light { attenuation: [bad; 3], ..good },
        ] {
            scene.lights = vec![light];
            let (mean, _) = seen(&scene, &[PoseF32::IDENTITY], &view, 4, 1);
            assert!(mean.is_finite(), "{light:?}: {mean}");
        }
    }
}

/// A lamp in a black glossy floor, seen where the floor mirrors it and beside: Walter et al. 2007, Schlick 1994.
#[test]
fn highlights_are_those_of_ggx() {
    for (specular, shininess) in [(1.0f32, 1.0f32), (0.5, 0.25), (0.1, 0.05)] {
        let shiny = Material { specular, shininess, ..matt(0.0) };
        let mut scene = dark(vec![Instance::new(Plane::INFINITE, shiny, 1)]);
        let toward_lamp = [0.8f64, 0.0, 0.6];
        let light = Light { diffuse: [0.0; 3], specular: [0.5; 3], ..Light::default() };
        scene.lights = vec![Light { direction: toward_lamp.map(|x| -x as f32), ..light }];
        let mut all = Vec::new();
        // The first is the mirror's direction.
        for eye in [[-1.6f32, 0.0, 1.2], [-1.5, 0.3, 1.2], [-1.0, 0.5, 2.0], [0.0, 0.0, 2.0]] {
            let (mean, _) = seen(&scene, &[PoseF32::IDENTITY], &looking(eye, [0.0; 3]), 1, 0);
            let o = crate::ray::vector::unit(eye.map(f64::from)).unwrap();
            let h = crate::ray::vector::unit(add(o, toward_lamp)).unwrap();
            let alpha2 = 2.0 / ((128.0 * f64::from(shininess)).max(1.0) + 2.0);
            let d = alpha2 / (PI * (h[2] * h[2] * (alpha2 - 1.0) + 1.0).powi(2));
            let lambda = |cos: f64| ((1.0 + alpha2 * (1.0 / (cos * cos) - 1.0)).sqrt() - 1.0) / 2.0;
            let g = 1.0 / (1.0 + lambda(o[2]) + lambda(0.6));
            let (f0, f90) = (0.08 * f64::from(specular), (4.0 * f64::from(specular)).min(1.0));
            let f = f0 + (f90 - f0) * (1.0 - dot(h, o)).powi(5);
            // A lamp of colour L has the irradiance PI L.
            let expected = PI * 0.5 * d * g * f / (4.0 * o[2]);
            // The pixel, the camera and the lamp are single precision; the sharpest lobe bends by 1e3 per radian.
            assert!(
                (mean - expected).abs() < 2e-4 * expected,
                "{specular} {shininess} {eye:?}: {mean}, not {expected}"
            );
            all.push(mean);
        }
        // Controls: there is a highlight, and it is where the lamp is mirrored.
        assert!(all[0] > 0.0 && all[0] > all[2] && all[2] > all[3], "{all:?}");
    }
}

/// A brick whose corners share their normals, or some of them one inside the other.
fn bricks(halves: &[f32]) -> Shape {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for half in halves {
        let first = positions.len() as u32;
        positions.extend((0..8).map(|k| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { *half } else { -half })));
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = sides.iter().flat_map(|&[a, b, c, d]: &[u32; 4]| [[a, b, c], [a, c, d]]);
        triangles.extend(faces.map(|t| t.map(|k| k + first)));
    }
    let mesh = scene::mesh::TriMesh::from_triangles(positions, triangles);
    scene::shape::Mesh { mesh: std::sync::Arc::new(scene::RenderMesh::new(&mesh, std::f32::consts::PI)) }.into()
}

/// The smooth normals of a brick of 1 m mean a point 0.33 m above the middle of its top; a lid 0.05 m above it shades it.
#[test]
fn what_is_close_above_a_smooth_surface_shades_it() {
    let lid = Instance::new(Box { half: [0.3, 0.3, 0.001] }, matt(0.6), 2);
    let mut scene = dark(vec![Instance::new(bricks(&[0.5]), matt(0.6), 1), lid]);
    scene.lights = vec![lamp(LightKind::Directional, [0.; 3], [0., 0., -1.])];
    let view = looking([2.0, 0.1, 0.53], [0.0, 0.0, 0.5]);
    for (height, lit) in [(0.55, false), (0.7, false), (0.45, true)] {
        let poses = [PoseF32::IDENTITY, PoseF32::from_translation([0.0, 0.0, height])];
        let (mean, _) = seen(&scene, &poses, &view, 1, 0);
        assert!(if lit { mean > 0.1 } else { mean == 0.0 }, "{height}: {mean}");
    }
}

/// One mesh of glass bricks one inside the other: light goes through all of their fronts, as many as it has.
#[test]
fn every_front_of_a_thing_takes_its_alpha() {
    let mut glass = matt(0.0);
    glass.rgba[3] = 0.3;
    for (halves, fronts) in [(&[0.2f32][..], 1), (&[0.2, 0.1], 2), (&[0.2, 0.15, 0.1], 3)] {
        let glass = Instance::new(bricks(halves), glass.clone(), 2);
        let mut scene = dark(vec![Instance::new(Plane::INFINITE, matt(0.6), 1), glass]);
        scene.lights = vec![lamp(LightKind::Directional, [0.; 3], [0., 0., -1.])];
        let poses = [PoseF32::IDENTITY, PoseF32::from_translation([0.0, 0.0, 1.0])];
        let at = [0.03, 0.01, 0.0];
        let (mean, _) = seen(&scene, &poses, &looking([1.0, 0.0, 0.5], at), 4, 0);
        let expected = albedo(0.6) * f64::from(0.9f32) * (1.0 - f64::from(0.3f32)).powi(fronts);
        assert!((mean - expected).abs() < 1e-5, "{halves:?}: {mean}, not {expected}");
    }
}
