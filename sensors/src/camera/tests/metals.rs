//! Metals, own light and tone curves in finished pictures, against the formulas of their documentation.

use super::super::imperfection::Exposure;
use super::super::{CameraCfg, Channels, Frame, Imperfections, RasterCfg, Rasterizer, Renderer, ToneCurve};
use crate::visibility::View;
use scene::shape::Plane;
use scene::{Headlight, Hemisphere, Instance, Material, PoseF32, RenderScene, Sky};

const PATHS: Renderer = Renderer::RayTraced { samples: 4, max_bounces: 2, denoise: false, seed: 1 };

/// The colour in the middle of a picture of a plane, from straight above.
fn middle(material: Material, headlight: Headlight, sky: Sky, tone: ToneCurve, renderer: Renderer) -> [u8; 3] {
    exposed(0.0, material, headlight, sky, tone, renderer)
}

/// The same, exposed some stops longer.
fn exposed(
    stops: f64,
    material: Material,
    headlight: Headlight,
    sky: Sky,
    tone: ToneCurve,
    renderer: Renderer,
) -> [u8; 3] {
    let mut scene = RenderScene::new(vec![Instance::new(Plane::INFINITE, material, 1)]).unwrap();
    (scene.headlight, scene.sky, scene.lights) = (headlight, sky, Vec::new());
    scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
    let view = View::look_at([33, 33], 0.5, [0.0, 0.0, 2.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    let mut rasterizer = Rasterizer::new(RasterCfg { tone, ..RasterCfg::default() });
    (rasterizer.renderer, rasterizer.stops) = (renderer, stops);
    let mut frame = Frame::new(33, 33, Channels { color: true, ..Channels::default() });
    rasterizer.render(&scene, &[PoseF32::IDENTITY], &view, &mut frame).unwrap();
    let color = frame.color.unwrap();
    let at = color.len() / (33 * 33) * (16 * 33 + 16);
    [color[at], color[at + 1], color[at + 2]]
}

/// The sRGB transfer function of the standard, and its inverse.
fn to_srgb(x: f64) -> f64 {
    if x <= 0.0031308 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

fn to_linear(x: f32) -> f64 {
    let x = f64::from(x);
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// A step of a byte for rounding, and one for the approximation of the power in the transfer function.
fn close(seen: [u8; 3], light: [f64; 3]) -> bool {
    (0..3).all(|k| (f64::from(seen[k]) - 255.0 * to_srgb(light[k].min(1.0))).abs() <= 1.5)
}

/// Seen along its normal a surface mirrors the sky behind the camera, and the headlight in full: a metal in its own colour, and
/// with its own light, whatever `specular` says. Root cause once: highlights of metals were those of what is not metal, none
/// where `specular` was 0, and their own light was lost.
#[test]
fn a_metal_mirrors_lamps_and_keeps_its_own_light() {
    let (base, above) = ([0.7, 0.5, 0.3], [0.4, 0.5, 0.6]);
    let headlight = Headlight { ambient: [0.0; 3], diffuse: [0.3, 0.2, 0.1], specular: [0.2, 0.3, 0.4], active: true };
    for (metallic, specular, emission) in
        [1.0, 0.4].into_iter().flat_map(|m| [(m, 0.0, 0.0), (m, 0.5, 0.0), (m, 0.0, 0.3), (m, 1.0, 0.3)])
    {
        let [r, g, b] = base;
        let material = Material { metallic, specular, emission, ..Material::from_rgba([r, g, b, 1.0]) };
        let expected = [0, 1, 2].map(|k| {
            let [color, sky, own, metal] =
                [to_linear(base[k]), to_linear(above[k]), f64::from(emission), f64::from(metallic)];
            let (shine, scattered) = (f64::from(headlight.specular[k]), f64::from(headlight.diffuse[k]));
            let plain = color * (scattered + own) + f64::from(specular) * shine;
            metal * color * (sky + shine + own) + (1.0 - metal) * plain
        });
        let seen = middle(material, headlight, Sky::uniform(above), ToneCurve::Clip, Renderer::Raster);
        let wanted = expected.map(|light| 255.0 * to_srgb(light));
        assert!(close(seen, expected), "metallic {metallic}, specular {specular}, {emission}: {seen:?} for {wanted:?}");
    }
}

/// A plane that glows in the dark: its light is its colour times its emission, in the rasterizer's picture and in that of paths,
/// through every curve.
#[test]
fn pictures_have_the_curve_that_they_are_told_to_have() {
    let dark = Headlight { active: false, ..Headlight::default() };
    for renderer in [Renderer::Raster, PATHS] {
        for emission in [0.05_f32, 0.5, 0.9, 1.7] {
            let material = Material { emission, specular: 0.0, ..Material::from_rgba([1.0; 4]) };
            let x = f64::from(emission);
            let shown = ToneCurve::ALL.map(|tone| {
                let curve = match tone {
                    ToneCurve::Soft if x > 0.7 => 0.7 + 0.3 * (x - 0.7) / (x - 0.7 + 0.3),
                    ToneCurve::Soft => x,
                    ToneCurve::Clip => x.min(1.0),
                    ToneCurve::Filmic => (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).min(1.0),
                };
                let seen = middle(material.clone(), dark, Sky::uniform([0.0; 3]), tone, renderer);
                let wanted = 255.0 * to_srgb(curve);
                assert!(close(seen, [curve; 3]), "{renderer:?}, {tone:?} of {x}: {seen:?} for {wanted}");
                seen[0]
            });
            // The control: above the knee no two curves are alike.
            assert!(emission != 0.9 || (0..3).all(|k| shown[k].abs_diff(shown[(k + 1) % 3]) > 3), "{shown:?}");
        }
    }
}

/// A stop is twice the light before the curve, in both renderers: also of what is far brighter than white, where finished bytes
/// know no more than that.
#[test]
fn a_stop_is_twice_the_light_before_the_curve() {
    let dark = Headlight { active: false, ..Headlight::default() };
    for renderer in [Renderer::Raster, PATHS] {
        let of = |emission: f32, stops| {
            let material = Material { emission, specular: 0.0, ..Material::from_rgba([1.0; 4]) };
            exposed(stops, material, dark, Sky::uniform([0.0; 3]), ToneCurve::Clip, renderer)
        };
        for (emission, stops) in [(0.2_f32, 1.0), (0.2, -1.0), (0.2, 0.5), (3.0, -2.0), (3.9, -2.0), (1e4, -20.0)] {
            let light = (f64::from(emission) * f64::exp2(stops)).min(1.0);
            let seen = of(emission, stops);
            assert!(close(seen, [light; 3]), "{renderer:?}: {emission} at {stops} stops is {seen:?}, not {light}");
        }
        // The control: at 0 stops both highlights are white.
        assert_eq!([of(3.0, 0.0), of(3.9, 0.0)], [[255; 3]; 2]);
        assert!(of(3.9, -2.0)[0] > of(3.0, -2.0)[0] + 20, "and are told apart at -2");
    }
    let mut rasterizer = Rasterizer::new(RasterCfg::default());
    let (view, scene) =
        (View::look_at([4, 4], 0.5, [0.0, 0.0, 2.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap(), RenderScene::empty());
    let mut frame = Frame::new(4, 4, Channels { color: true, ..Channels::default() });
    for stops in [f64::NAN, 21.0, f64::NEG_INFINITY] {
        rasterizer.stops = stops;
        let error = rasterizer.render(&scene, &[], &view, &mut frame).unwrap_err().to_string();
        assert!(error.contains("stops; it must be -20 to 20"), "{error}");
    }
}

/// A camera's exposure is that of its renderer: the sky, 0.8 on the screen, is taken twice as long and half as long.
#[test]
fn a_camera_exposes_as_its_imperfections_say() {
    let context = super::stage::context(1);
    let sky = |stops: Option<f64>| {
        let exposure = stops.map(|stops| Exposure { stops });
        let imperfections = Imperfections { exposure, ..Imperfections::default() };
        let raster = RasterCfg { tone: ToneCurve::Clip, ..RasterCfg::default() };
        let camera = super::stage::built(&CameraCfg { imperfections, raster, ..super::stage::cfg() }, &context);
        let bytes: Vec<u8> = camera.color().unwrap().iter().copied().collect();
        bytes
    };
    let plain = sky(None);
    assert_eq!(sky(Some(0.0)), plain);
    let light = |byte: u8| to_linear(f32::from(byte) / 255.0);
    for stops in [-1.0, 1.0] {
        let found = sky(Some(stops));
        let (mut compared, mut changed) = (0, 0);
        for (pixel, before) in found.chunks(4).zip(plain.chunks(4)) {
            for k in 0..3 {
                // A byte of the plain picture stands for light that is half a byte more or less.
                let ends = [-0.5, 0.5].map(|half| {
                    let byte = (f64::from(before[k]) + half).clamp(0.0, 255.0);
                    255.0 * to_srgb((to_linear((byte / 255.0) as f32) * f64::exp2(stops)).min(1.0))
                });
                // What is white may be brighter, and 1.5 as in `close`.
                let high = if before[k] == 255 { 255.0 } else { ends[1] };
                let byte = f64::from(pixel[k]);
                assert!(ends[0] - 1.5 <= byte && byte <= high + 1.5, "{} becomes {byte} at {stops}", before[k]);
                compared += 1;
                changed += usize::from(pixel[k].abs_diff(before[k]) > 8);
            }
            assert_eq!(pixel[3], 255);
        }
        assert!(changed > compared / 4, "{changed} of {compared}: {}", light(plain[0]));
    }
}
