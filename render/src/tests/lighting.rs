//! Shadows, ambient occlusion, metals, emission and tone curves, compared with closed forms.

use super::harness::{EXACT, Image, TestFrame, look_at_view};
use crate::renderer::Renderer;
use crate::request::RasterCfg;
use crate::shade::tone::ToneCurve;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{Box, Plane, Sphere};
use kinetoscope_scene::{Headlight, Hemisphere, Light, LightKind, LightingSpace, Material, PoseF32, RenderScene, Sky};
use kinetoscope_testkit::scenes::{instances, matte, translation, unlit};
use kinetoscope_testkit::srgb::{linear, srgb};
use nalgebra::Vector3;

/// sRGB value of the gray floors.
const GRAY: f32 = 0.7;

/// A gray floor, and a gray box of these half sizes, by the hybrid.
fn floor_and_box(half: [f32; 3], place: PoseF32, ambient: f32, view: crate::visibility::View) -> TestFrame {
    let gray = matte([GRAY; 3]);
    let (mut scene, poses) = instances([
        (Shape::from(Plane::INFINITE), gray.clone(), PoseF32::IDENTITY),
        (Box { half }.into(), gray, place),
    ]);
    scene.headlight.active = false;
    scene.ambient = Hemisphere { sky: [ambient; 3], ground: [ambient; 3] };
    TestFrame { cfg: EXACT, renderer: Renderer::Hybrid, ..TestFrame::new((scene, poses), view) }
}

/// The byte of a gray floor in this light, below the bend of the tone curve.
fn byte(light: f32) -> f64 {
    srgb(linear(GRAY) * f64::from(light))
}

/// A quarter for the polynomial, a half for rounding.
const ROUNDING: f64 = 0.8;

/// A light after many inactive ones has its shadow map: the images are equal to those of the light alone.
///
/// Regression: lights after the first 256 had no shadow map.
#[test]
fn late_lights() {
    let view = look_at_view([101, 101], 0.9, [2.2, -0.3, 0.8], [1.0, 0., 0.]);
    let mut frame = floor_and_box([1.0, 2.0, 0.1], translation(-1.0, 0.0, 1.0), 0.1, view);
    frame.renderer = Renderer::Raster;
    let light = Light { diffuse: [0.7; 3], direction: [1., 0., -1.], ..Light::default() };
    let mut drawn = |before: usize, cast_shadow: bool| {
        let inactive = Light { active: false, ..light };
        frame.scene.lights = vec![inactive; before];
        frame.scene.lights.push(Light { cast_shadow, ..light });
        frame.draw().color().to_vec()
    };
    let alone = drawn(0, true);
    assert!(alone != drawn(0, false), "the control: the light casts a shadow");
    assert!(drawn(300, true) == alone);
}

/// The ray-traced shadow of a box over a floor: position of its edge, and brightness of the floor on both sides.
#[test]
fn hybrid_shadows() {
    // From -2 to 0 along x, 0.9 to 1.1 high.
    let view = look_at_view([201, 201], 0.9, [2.2, -0.3, 0.8], [1.0, 0., 0.]);
    let mut still = floor_and_box([1.0, 2.0, 0.1], translation(-1.0, 0.0, 1.0), 0.1, view);
    let light = Light { diffuse: [0.7; 3], attenuation: [1., 0., 0.], ..Light::default() };
    let slanted = Light { direction: [1., 0., -1.], ..light };
    let near = Light { kind: LightKind::Point, position: [-1.0, 0.0, 2.3], ..light };
    // Past the box's upper edge, 1.1 high: 1.1 m on at 45 degrees; from 1.2 m above and 1 m behind it, 1.1 / 1.2 m on.
    for (light, edge) in [(slanted, 1.1f32), (near, 1.1 / 1.2)] {
        still.scene.lights = vec![light];
        let cosine = |p: [f32; 3]| match light.kind {
            LightKind::Directional => 0.5f32.sqrt(),
            _ => 2.3 / ((p[0] + 1.0).powi(2) + p[1].powi(2) + 2.3 * 2.3).sqrt(),
        };
        let of = |image: &Image, k: usize, lit: &dyn Fn(f32) -> bool| {
            let p = image.position()[k];
            // A pixel is up to 0.02 m long on the floor; the box's sides do not end here.
            let inside = (p[0] - edge).abs() >= 0.03 && p[1].abs() <= 1.5 && (0.0..3.0).contains(&p[0]);
            let shadow = byte(if p[0] > edge { 0.1 + 0.7 * cosine(p) } else { 0.1 });
            (image.mask()[k] == 1 && inside && lit(p[0])).then_some(shadow)
        };
        let image = still.draw();
        image.assert_gray("hybrid shadows", ROUNDING, |k| of(&image, k, &|_| true));
        let sides: [&dyn Fn(f32) -> bool; 2] = [&|x| x <= edge, &|x| x > edge];
        let sizes = sides.map(|side| image.count_gray(ROUNDING, |k| of(&image, k, side))[1]);
        assert!(sizes.iter().all(|&n| n > 2000), "{sizes:?}");
        // The control: without shadows exactly the dark pixels are wrong.
        let bright = still.with(|still| still.cfg.shadows = false).draw();
        assert_eq!(bright.count_gray(ROUNDING, |k| of(&bright, k, &|_| true))[0], sizes[0]);
    }
}

/// A point light exactly on a ceiling does not get occluded by it: the floor below is lit everywhere, by the cosine.
///
/// Root cause: rays went as far as the light, so the last bit decided whether the ceiling occluded it.
#[test]
fn ceiling_light() {
    let view = look_at_view([80, 60], 0.6, [1.5, 0.3, 0.6], [0.0; 3]);
    let mut still = floor_and_box([3.0, 3.0, 0.5], translation(0.0, 0.0, 2.5), 0.0, view);
    let mut wrong = |height: f32| {
        let kind = LightKind::Point;
        let light = Light { kind, position: [0.1, 0.0, height], diffuse: [0.7; 3], ..Light::default() };
        still.scene.lights = vec![Light { attenuation: [1., 0., 0.], ..light }];
        let image = still.draw();
        image.count_gray(ROUNDING, |k| {
            let p = image.position()[k];
            let cosine = 2.0 / ((p[0] - 0.1).powi(2) + p[1].powi(2) + 4.0).sqrt();
            (image.mask()[k] == 1 && p[0].abs() < 1.0 && p[1].abs() < 1.0).then(|| byte(0.7 * cosine))
        })
    };
    let [off, all] = wrong(2.0);
    assert!(off == 0 && all > 2000, "{off} of {all}");
    // The control: a millimeter inside of the ceiling, the light reaches no surface.
    assert_eq!(wrong(2.001), [all; 2]);
}

/// A point light at the distance d is attenuated by 1 / (c + l d + q d²).
#[test]
fn attenuation() {
    let view = look_at_view([80, 60], 0.6, [1.5, 0.3, 0.6], [0.0; 3]);
    let mut still = floor_and_box([0.1; 3], translation(9.0, 0.0, 0.0), 0.0, view);
    for attenuation in [[1.0, 0.0, 0.0], [0.5, 0.3, 0.0], [0.5, 0.0, 0.2], [0.4, 0.1, 0.15]] {
        let light = Light { kind: LightKind::Point, position: [0.1, 0.0, 2.0], diffuse: [0.7; 3], ..Light::default() };
        still.scene.lights = vec![Light { attenuation, ..light }];
        let image = still.draw();
        let [off, all] = image.count_gray(ROUNDING, |k| {
            let p = image.position()[k];
            let d = ((p[0] - 0.1).powi(2) + p[1].powi(2) + 4.0).sqrt();
            let [constant, linear, quadratic] = attenuation;
            let strength = 1.0 / (constant + linear * d + quadratic * d * d);
            (image.mask()[k] == 1 && p[0].abs() < 1.0 && p[1].abs() < 1.0).then(|| byte(0.7 * strength * 2.0 / d))
        });
        assert!(off == 0 && all > 2000, "{attenuation:?}: {off} of {all}");
    }
}

/// Ambient occlusion at the foot of a long wall of height h: at the distance d, the wall occludes `(1 - d / sqrt(d² +
/// h²)) / 2` of uniform light. Source: Howell, A catalog of radiation heat transfer configuration factors: from an
/// element to an infinitely long strip in a plane perpendicular to that of the element.
#[test]
fn ambient_occlusion() {
    // From x = 0 on, 1 m high.
    let view = look_at_view([48, 16], 0.4, [-1.0, -3.0, 2.5], [-0.8, 0.0, 0.0]);
    let mut still = floor_and_box([0.5, 300.0, 0.5], translation(0.5, 0.0, 0.5), 0.6, view);
    still.scene.lights.clear();
    still.scene.ambient.ground = [0.2; 3];
    let of = |occlusion_rays| still.with(|still| still.cfg.occlusion_rays = occlusion_rays).draw();
    let (with, without) = (of(1024), of(0));
    // Colors of pixels at edges are means.
    let x = |k: usize| Some(with.position()[k][0]).filter(|x| with.mask()[k] == 1 && *x < -0.02);
    let shade = |x: f32| byte(0.6 * (1.0 - 0.5 * (1.0 - -x / (x * x + 1.0).sqrt())));
    // The net finds the fraction to about 1/256, and byte(x) rises by at most 250 here.
    with.assert_gray("ambient occlusion", 1.5, |k| x(k).map(shade));
    let all: Vec<(usize, f32)> = (0..48 * 16).filter_map(|k| Some((k, x(k)?))).collect();
    assert!(all.len() > 300 && all.iter().any(|(_, x)| *x > -0.1), "{} pixels", all.len());
    // The control: without rays the floor is as bright as in the open, at the foot of the wall by 35.
    for (k, x) in all {
        let off = f64::from(without.color()[k][0]) - shade(x);
        assert!((x < -0.1 || off > 30.0) && off > -1.5, "at {x} m: {off}");
    }
}

/// Distance of a point from the segment between the light and another point.
fn beside(point: [f32; 3], from: [f32; 3], to: [f32; 3]) -> f32 {
    let (way, at) = (Vector3::from(to) - Vector3::from(from), Vector3::from(point) - Vector3::from(from));
    (at - way * (at.dot(&way) / way.norm_squared()).clamp(0.0, 1.0)).norm()
}

/// Shadow maps are cropped to the casters. A point of the ground is dark if its segment to the light crosses a ball,
/// and lit elsewhere: balls at the center of the cone, half outside of it, close to the light, far apart.
#[test]
fn shadow_maps() {
    const RADIUS: f32 = 0.3;
    let (position, spot) = ([0.0, 0.0, 3.0], LightKind::Spot { cutoff_deg: 40.0, exponent: 0.0 });
    let cases: [&[[f32; 3]]; 6] = [
        &[[0.0, 0.0, 0.5]],
        &[[1.9, 0.0, 0.5]],
        &[[-0.9, -1.6, 0.6]],
        &[[0.1, 0.0, 2.5]],
        &[[-1.5, 1.0, 0.35], [1.4, -1.1, 0.5], [0.0, 0.3, 1.4]],
        // No ball is in the cone.
        &[[6.0, 0.0, 0.5]],
    ];
    for (case, kind) in (0..cases.len()).flat_map(|case| [(case, spot), (case, LightKind::Directional)]) {
        let gray = Material::default;
        let ball = |[x, y, z]: &[f32; 3]| (Shape::from(Sphere { radius: RADIUS }), gray(), translation(*x, *y, *z));
        let ground = (Shape::from(Plane::INFINITE), gray(), PoseF32::IDENTITY);
        let (mut scene, poses) = instances([ground].into_iter().chain(cases[case].iter().map(ball)));
        let direction = if kind == spot { [0.0, 0.0, -1.0] } else { [0.3, 0.2, -1.0] };
        scene.lights = vec![Light { kind, position, direction, ..Light::default() }];
        scene.headlight.active = false;
        let view = look_at_view([320, 240], 1.1, [3.5, -2.5, 4.0], [0.; 3]);
        let still =
            TestFrame { cfg: RasterCfg { samples: 1, ..RasterCfg::default() }, ..TestFrame::new((scene, poses), view) };
        let (image, bright) = (still.draw(), still.with(|still| still.cfg.shadows = false).draw());
        let (mut dark, mut lit) = (0, 0);
        for (k, &p) in image.position().iter().enumerate().filter(|(k, _)| image.mask()[*k] == 1) {
            // Inside of the cone and of the map, where the balls can occlude the light.
            if p[0].hypot(p[1]) > 3.0 * 38f32.to_radians().tan() {
                continue;
            }
            let from = if kind == spot { position } else { [0, 1, 2].map(|k| p[k] - 8.0 * direction[k]) };
            let near = cases[case].iter().map(|ball| beside(*ball, from, p)).fold(f32::INFINITY, f32::min);
            let [with, without] = [&image, &bright].map(|image| i32::from(image.color()[k][0]));
            // The edge of a shadow is two texels of 1 to 2 cm wide on each side, and points are offset from the ground
            // by two more; close to the light a ball is larger on the map than on the ground.
            if near < RADIUS - 0.08 {
                assert!(with + 20 < without, "case {case}, {kind:?}: {with} of {without} at {p:?}");
                dark += 1;
            } else if near > RADIUS + 0.08 {
                assert!((with - without).abs() <= 1, "case {case}, {kind:?}: {with} of {without} at {p:?}");
                lit += 1;
            }
        }
        assert!(lit > 50 && (dark > 20 || case == 5), "case {case}, {kind:?}: {dark} dark, {lit} lit");
    }
}

/// A cube of 5 cm and an arm of boxes on a plane of half size `ground`, with the default light of a simulation, from a
/// camera above.
fn tabletop(ground: f32, view: crate::visibility::View) -> TestFrame {
    let gray = || matte([GRAY; 3]);
    let cuboid = |half: [f32; 3], pose| (Shape::from(Box { half }), gray(), pose);
    // The cube sinks in by the depth of a contact.
    let (mut scene, poses) = instances([
        (Plane { half: [ground; 2] }.into(), gray(), PoseF32::IDENTITY),
        cuboid([0.025; 3], translation(1.0, -0.2, 0.0249)),
        cuboid([0.08, 0.08, 0.5], translation(0.0, 0.0, 0.5)),
        cuboid([0.4, 0.05, 0.05], translation(0.4, 0.0, 0.9)),
    ]);
    scene.lights = vec![Light { direction: [-0.3, 0.4, -1.0], ..Light::default() }];
    TestFrame::new((scene, poses), view)
}

/// Shadow maps compared with shadow rays, on a ground of 100 m as on one of 6 m, near and far, and below a spot.
///
/// Root cause: the map covered all casters, and the ground, which shades no surface above it, was one. A texel of the
/// default ground was 10 cm wide, and a cube of 5 cm had no shadow.
#[test]
fn shadows_on_wide_ground() {
    let views = [
        ("above", look_at_view([320, 240], 0.3, [1.2, -0.2, 0.8], [1.05, -0.2, 0.0])),
        ("slanted", look_at_view([320, 240], 0.8, [2.2, -1.6, 1.2], [0.6, -0.1, 0.3])),
        ("close", look_at_view([320, 240], 0.5, [0.85, 0.05, 0.25], [0.99, -0.18, 0.0])),
        ("horizon", look_at_view([320, 240], 0.9, [1.8, -1.5, 0.6], [0.5, 0.3, 0.6])),
    ];
    let spot = LightKind::Spot { cutoff_deg: 60.0, exponent: 0.0 };
    for ((name, view), kind) in views.into_iter().flat_map(|view| [(view, LightKind::Directional), (view, spot)]) {
        let lit = |ground: f32| {
            let still = tabletop(ground, view);
            still.with(|still| (still.scene.lights[0].kind, still.scene.lights[0].position) = (kind, [0.9, -1.8, 2.2]))
        };
        let (wide, small) = (lit(50.0), lit(3.0));
        let [image, other] = [wide.draw(), small.draw()];
        let rays = wide.with_renderer(Renderer::Hybrid);
        let bright = wide.with(|still| still.cfg.shadows = false).draw();
        // Ground pixels whose neighbors are ground pixels too: elsewhere the coverage differs.
        let ground: Vec<usize> =
            image.inner().filter(|k| image.mask()[*k] == 1 && image.is_inside_instance(*k)).collect();
        let dark = |image: &Image, k: usize| i32::from(image.color()[k][0]) + 20 < i32::from(bright.color()[k][0]);
        let count = |f: &dyn Fn(usize) -> bool| ground.iter().filter(|k| f(**k)).count();
        let [shaded, both] = [count(&|k| dark(&rays, k)), count(&|k| dark(&rays, k) && dark(&image, k))];
        let wrong = count(&|k| dark(&rays, k) != dark(&image, k));
        // A shadow's edge is a texel or two wide: at most one in eight of the pixels in shadow is beside an edge.
        assert!(shaded > 200, "{name}, {kind:?}: {shaded} pixels in shadow");
        assert!(wrong * 8 <= shaded, "{name}, {kind:?}: {wrong} wrong, {both} of {shaded} in shadow");
        // The size of the ground changes no ground pixel.
        let [mut differ, mut same] = [0, 0];
        for &k in ground.iter().filter(|k| other.mask()[**k] == 1 && other.is_inside_instance(**k)) {
            let far = (0..3).any(|c| image.color()[k][c].abs_diff(other.color()[k][c]) > 2);
            (differ, same) = (differ + usize::from(far), same + usize::from(!far));
        }
        assert!(differ * 1000 <= same, "{name}, {kind:?}: {differ} of {same} depend on the size of the ground");
        // The control: without shadows all pixels in shadow are wrong.
        assert_eq!(count(&|k| dark(&rays, k) != dark(&bright, k)), shaded);
    }
}

/// A plane shades the objects below it, for lights above it only.
#[test]
fn plane_above() {
    let view = look_at_view([160, 120], 0.8, [3.0, 0.0, 1.5], [0.0, 0.0, 0.2]);
    let gray = || matte([GRAY; 3]);
    let roof = (Shape::from(Plane { half: [0.5; 2] }), gray(), translation(0.0, 0.0, 1.0));
    let ground = (Shape::from(Plane { half: [50.0; 2] }), gray(), PoseF32::IDENTITY);
    let (mut scene, poses) = instances([ground, roof]);
    scene.lights = vec![Light { direction: [0.0, 0.0, -1.0], ..Light::default() }];
    let still = TestFrame::new((scene, poses), view);
    let [image, bright] = [still.draw(), still.with(|still| still.cfg.shadows = false).draw()];
    let (mut dark, mut lit) = (0, 0);
    for k in (0..160 * 120).filter(|k| image.mask()[*k] == 1) {
        let [x, y, _] = image.position()[k];
        let off = x.abs().max(y.abs()) - 0.5;
        let shaded = i32::from(image.color()[k][0]) + 20 < i32::from(bright.color()[k][0]);
        if off.abs() > 0.05 {
            assert_eq!(shaded, off < 0.0, "at {x}, {y}");
            (dark, lit) = (dark + usize::from(shaded), lit + usize::from(!shaded));
        }
    }
    assert!(dark > 100 && lit > 1000, "{dark} dark, {lit} lit");
}

const PATHS: Renderer = Renderer::RayTraced { samples: 4, max_bounces: 2, denoise: false, seed: 1 };

const DARK: Headlight = Headlight { ambient: [0.0; 3], diffuse: [0.0; 3], specular: [0.0; 3], active: false };

/// The color at the center of an image of a plane, from straight above.
fn center_color(
    material: Material,
    headlight: Headlight,
    sky: [f32; 3],
    tone: ToneCurve,
    by: (Renderer, f64),
) -> [u8; 4] {
    let (scene, poses) = instances([(Plane::INFINITE, material, PoseF32::IDENTITY)]);
    let mut scene = unlit(scene);
    (scene.headlight, scene.sky) = (headlight, Sky::uniform(sky));
    let view = crate::visibility::View::look_at([33, 33], 0.5, [0.0, 0.0, 2.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    let still = TestFrame { stops: by.1, ..TestFrame::new((scene, poses), view) };
    still.with(|still| still.cfg.tone = tone).with_renderer(by.0).color()[16 * 33 + 16]
}

/// A white plane that glows in the dark.
fn emissive_plane_color(emission: f32, tone: ToneCurve, by: (Renderer, f64)) -> [u8; 4] {
    center_color(Material { emission, ..matte([1.0; 3]) }, DARK, [0.0; 3], tone, by)
}

/// A step of a byte for rounding, and one for the approximation of the power in the transfer function.
fn close(seen: [u8; 4], light: [f64; 3]) -> bool {
    (0..3).all(|k| (f64::from(seen[k]) - srgb(light[k].min(1.0))).abs() <= 1.5)
}

/// Seen along its normal, a metal mirrors the sky behind the camera and the full headlight, in its own color, and adds
/// its emission, whatever its `specular`. Root cause: highlights of metals were those of other materials, 0 for a
/// `specular` of 0, and their emission was lost.
#[test]
fn metals() {
    let (base, above) = ([0.7, 0.5, 0.3], [0.4, 0.5, 0.6]);
    let headlight = Headlight { ambient: [0.0; 3], diffuse: [0.3, 0.2, 0.1], specular: [0.2, 0.3, 0.4], active: true };
    for (metallic, specular, emission) in
        [1.0, 0.4].into_iter().flat_map(|m| [(m, 0.0, 0.0), (m, 0.5, 0.0), (m, 0.0, 0.3), (m, 1.0, 0.3)])
    {
        let material = Material { metallic, specular, emission, ..matte(base) };
        let expected = [0, 1, 2].map(|k| {
            let [color, sky, own, metal] =
                [linear(base[k]), linear(above[k]), f64::from(emission), f64::from(metallic)];
            let (shine, scattered) = (f64::from(headlight.specular[k]), f64::from(headlight.diffuse[k]));
            let plain = color * (scattered + own) + f64::from(specular) * shine;
            metal * color * (sky + shine + own) + (1.0 - metal) * plain
        });
        let seen = center_color(material, headlight, above, ToneCurve::Clip, (Renderer::Raster, 0.0));
        assert!(close(seen, expected), "metallic {metallic}, specular {specular}, {emission}: {seen:?}, {expected:?}");
    }
}

/// A plane that glows in the dark: its light is its color times its emission, by the rasterizer and by path tracing,
/// with every tone curve.
#[test]
fn tone_curves() {
    for (renderer, emission) in
        [Renderer::Raster, PATHS].into_iter().flat_map(|r| [0.05_f32, 0.5, 0.9, 1.7].map(|e| (r, e)))
    {
        let x = f64::from(emission);
        let shown = ToneCurve::ALL.map(|tone| {
            let curve = match tone {
                ToneCurve::Soft if x > 0.7 => 0.7 + 0.3 * (x - 0.7) / (x - 0.7 + 0.3),
                ToneCurve::Soft => x,
                ToneCurve::Clip => x.min(1.0),
                ToneCurve::Filmic => (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).min(1.0),
            };
            let seen = emissive_plane_color(emission, tone, (renderer, 0.0));
            assert!(close(seen, [curve; 3]), "{renderer:?}, {tone:?} of {x}: {seen:?}, not {curve}");
            seen[0]
        });
        // The control: above the knee all curves differ.
        assert!(emission != 0.9 || (0..3).all(|k| shown[k].abs_diff(shown[(k + 1) % 3]) > 3), "{shown:?}");
    }
}

/// A stop doubles the light before the curve, in both renderers: also for light far brighter than white, which the
/// finished bytes do not distinguish.
#[test]
fn stops() {
    for renderer in [Renderer::Raster, PATHS] {
        let of = |emission, stops| emissive_plane_color(emission, ToneCurve::Clip, (renderer, stops));
        for (emission, stops) in [(0.2_f32, 1.0), (0.2, -1.0), (0.2, 0.5), (3.0, -2.0), (3.9, -2.0), (1e4, -20.0)] {
            let light = (f64::from(emission) * f64::exp2(stops)).min(1.0);
            let seen = of(emission, stops);
            assert!(close(seen, [light; 3]), "{renderer:?}: {emission} at {stops} stops is {seen:?}, not {light}");
        }
        // The control: at 0 stops both highlights are white, and at -2 they differ.
        assert_eq!([of(3.0, 0.0), of(3.9, 0.0)], [[255; 4]; 2]);
        assert!(of(3.9, -2.0)[0] > of(3.0, -2.0)[0] + 20);
    }
    let still = TestFrame::new((RenderScene::empty(), vec![]), look_at_view([4, 4], 0.5, [0.0, 0.1, 2.0], [0.0; 3]));
    for stops in [f64::NAN, 21.0, f64::NEG_INFINITY] {
        let error = TestFrame { stops, ..still.clone() }.try_draw().unwrap_err().to_string();
        assert!(error.contains("stops; it must be -20 to 20"), "{error}");
    }
}

/// Light summed as in MuJoCo's renderer: the byte of a matte plane is 255 times its sRGB color times the sum of the
/// lights, each times its cosine; the sum is clamped at white. Root causes: lights were added in linear light, and four
/// of them were darker than in MuJoCo; then the soft tone curve turned MuJoCo's white into a gray of 237.
#[test]
fn display_sum() {
    let directions = [[0.0, 0.0, -1.0], [0.6, 0.0, -0.8], [0.0, -0.6, -0.8], [-0.8, 0.0, -0.6]];
    let cosines: f32 = [1.0, 0.8, 0.8, 0.6].iter().sum();
    for (base, light) in [(0.5f32, 0.2f32), (0.7, 0.1), (1.0, 0.25), (0.9, 0.6)] {
        let (scene, poses) = instances([(Plane::INFINITE, matte([base, 0.5 * base, 0.25 * base]), PoseF32::IDENTITY)]);
        let mut scene = unlit(scene);
        scene.lighting_space = LightingSpace::Display;
        let directional = |direction| Light { direction, diffuse: [light; 3], cast_shadow: false, ..Light::default() };
        scene.lights = directions.map(directional).to_vec();
        let view = crate::visibility::View::look_at([33, 33], 0.5, [0.0, 0.0, 2.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
        let still = TestFrame::new((scene, poses), view).with(|still| still.cfg.tone = ToneCurve::Clip);
        let renderers = [Renderer::Raster, Renderer::Hybrid, Renderer::FastRayTraced];
        // The sum is clamped already: the soft curve changes no value.
        let tones = [ToneCurve::Clip, ToneCurve::Soft];
        for (renderer, tone) in renderers.into_iter().flat_map(|renderer| tones.map(|tone| (renderer, tone))) {
            let found = still.with(|still| still.cfg.tone = tone).with_renderer(renderer).color()[16 * 33 + 16];
            for (c, part) in [1.0, 0.5, 0.25].into_iter().enumerate() {
                let expected = 255.0 * (part * base * light * cosines).min(1.0);
                let off = (f32::from(found[c]) - expected).abs();
                assert!(off <= 1.5, "{renderer:?}, {base} {light}: {found:?}, {expected} in channel {c}");
            }
        }
        // The control: a linear sum differs.
        let linear =
            still.with(|still| still.scene.lighting_space = LightingSpace::Linear).draw().color()[16 * 33 + 16];
        assert!((f32::from(linear[1]) - 255.0 * 0.5 * base * light * cosines).abs() > 5.0, "{linear:?}");
    }
}

/// MuJoCo's headlight is directional: a plane that faces the camera is equally bright from corner to corner.
///
/// Root cause: it shone from the camera's position, and the ground of a model file grew darker with the distance.
#[test]
fn display_headlight() {
    let (scene, poses) = instances([(Plane::INFINITE, matte([0.8; 3]), PoseF32::IDENTITY)]);
    let mut scene = unlit(scene);
    scene.lighting_space = LightingSpace::Display;
    scene.headlight = Headlight { ambient: [0.1; 3], diffuse: [0.5; 3], specular: [0.0; 3], active: true };
    let view = crate::visibility::View::look_at([33, 33], 1.2, [0.0, 0.0, 2.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    let still = TestFrame::new((scene, poses), view).with(|still| still.cfg.tone = ToneCurve::Clip);
    let expected = 255.0 * 0.8 * (0.1 + 0.5);
    let corners = |image: &Image| [0, 32, 16 * 33 + 16].map(|k| f32::from(image.color()[k][0]));
    for renderer in [Renderer::Raster, Renderer::Hybrid, Renderer::FastRayTraced] {
        let found = corners(&still.with_renderer(renderer));
        assert!(found.iter().all(|x| (x - expected).abs() <= 1.5), "{renderer:?}: {found:?}, {expected}");
    }
    // The control: from the camera's position the corners are darker.
    let [corner, _, middle] = corners(&still.with(|still| still.scene.lighting_space = LightingSpace::Linear).draw());
    assert!(corner + 10.0 < middle, "{corner} {middle}");
}
