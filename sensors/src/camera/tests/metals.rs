//! Metals, own light and tone curves in finished pictures, against the formulas of their documentation.

use super::super::{Channels, Frame, RasterCfg, Rasterizer, Renderer, ToneCurve};
use crate::visibility::View;
use scene::shape::Plane;
use scene::{Headlight, Hemisphere, Instance, Material, PoseF32, RenderScene, Sky};

const PATHS: Renderer = Renderer::RayTraced { samples: 4, max_bounces: 2, denoise: false, seed: 1 };

/// The colour in the middle of a picture of a plane, from straight above.
fn middle(material: Material, headlight: Headlight, sky: Sky, tone: ToneCurve, renderer: Renderer) -> [u8; 3] {
    let mut scene = RenderScene::new(vec![Instance::new(Plane::INFINITE, material, 1)]).unwrap();
    (scene.headlight, scene.sky, scene.lights) = (headlight, sky, Vec::new());
    scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
    let view = View::look_at([33, 33], 0.5, [0.0, 0.0, 2.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    let mut rasterizer = Rasterizer::new(RasterCfg { tone, ..RasterCfg::default() });
    rasterizer.renderer = renderer;
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
