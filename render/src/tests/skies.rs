//! Skyboxes, and haze at the end of the ground.

use super::harness::{EXACT, TestFrame, look_at_view};
use crate::renderer::Renderer;
use crate::request::RasterCfg;
use crate::shade::tone::ToneCurve;
use crate::visibility::View;
use kinetoscope_scene::shape::Plane;
use kinetoscope_scene::{HorizonHaze, LightingSpace, Material, PoseF32, RenderScene, Texture, TextureKind};
use kinetoscope_testkit::scenes::{instances, matte, unlit};
use std::sync::Arc;

const CLIP: RasterCfg = RasterCfg { samples: 1, tone: ToneCurve::Clip, ..EXACT };
const SIDE: u32 = 32;

/// Six faces: red is the column, green the row, and blue the face.
fn faces() -> Arc<Texture> {
    let pixels = (0..6 * SIDE).flat_map(|row| (0..SIDE).map(move |column| [column, row % SIDE, row / SIDE]));
    let bytes: Vec<u8> = pixels.flat_map(|[x, y, face]| [8 * x, 8 * y, 40 * face + 20].map(|x| x as u8)).collect();
    Arc::new(Texture::new(TextureKind::Cube, SIDE, 6 * SIDE, 3, &bytes).unwrap())
}

/// A camera along an axis with a field of view of a right angle sees one face of a skybox. The table lists the face and
/// its orientation, as in MuJoCo's renderer on OSMesa (forward, up, face, columns from the right, rows from below).
///
/// Root cause: images of skyboxes were gradients of three colors.
#[test]
fn skybox_faces() {
    let z = [0.0f32, 0.0, 1.0];
    let seen = [
        ([1.0f32, 0.0, 0.0], z, 0, true, false),
        ([-1.0, 0.0, 0.0], z, 1, true, false),
        ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0], 2, true, false),
        ([0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 3, false, true),
        ([0.0, -1.0, 0.0], z, 4, true, false),
        ([0.0, 1.0, 0.0], z, 5, true, false),
    ];
    let mut scene = RenderScene::empty();
    scene.skybox = Some(faces());
    for (forward, up, face, from_right, from_below) in seen {
        let side = SIDE as usize;
        let view = View::look_at([side; 2], std::f32::consts::FRAC_PI_2, [0.0; 3], forward, up).unwrap();
        let still = TestFrame { cfg: CLIP, ..TestFrame::new((scene.clone(), vec![]), view) };
        let paths = Renderer::RayTraced { samples: 64, max_bounces: 0, denoise: false, seed: 0 };
        for (renderer, tolerance) in [(Renderer::Raster, 2.0), (Renderer::FastRayTraced, 2.0), (paths, 4.0)] {
            let image = still.with_renderer(renderer);
            let (mut worst, mut mirrored) = (0.0f32, 0);
            for (row, column) in (1..side - 1).flat_map(|row| (1..side - 1).map(move |column| (row, column))) {
                let turned = |k: usize, turn: bool| if turn { side - 1 - k } else { k };
                let expected = [8 * turned(column, from_right), 8 * turned(row, from_below), 40 * face + 20];
                let found = image.color()[row * side + column];
                let off = |k: usize| (f32::from(found[k]) - expected[k] as f32).abs();
                worst = [0, 1, 2].map(off).into_iter().fold(worst, f32::max);
                mirrored += usize::from((f32::from(found[0]) - (8 * turned(column, !from_right)) as f32).abs() > 8.0);
            }
            assert!(worst <= tolerance, "{renderer:?} towards {forward:?}: {worst}");
            // The control: mirrored, most columns are wrong.
            assert!(mirrored > 700, "{mirrored}");
        }
    }
}

/// Haze over a green ground in front of a blue sky, as values of MuJoCo's renderer on OSMesa: the slope of a ray, and
/// red, green and blue. The camera is 20 m above the ground, with `zfar` 50, an extent of 1 m, 360 slices, and a red
/// haze of widths 0.1 to 1.
///
/// Root cause: no haze was rendered, and an infinite ground went on beyond the end of MuJoCo's.
#[test]
fn horizon_haze() {
    const SEEN: &[(f32, f32, [u8; 3])] = &[
        (0.1, 0.01205, [0, 0, 255]),
        (0.1, -0.02780, [14, 0, 241]),
        (0.1, -0.17069, [81, 0, 174]),
        (0.1, -0.39537, [182, 0, 73]),
        (0.1, -0.53806, [241, 0, 14]),
        (0.1, -0.58173, [213, 42, 0]),
        (0.1, -0.60424, [123, 132, 0]),
        (0.1, -0.67810, [0, 255, 0]),
        (0.3, 0.01205, [0, 0, 255]),
        (0.3, -0.02780, [16, 0, 239]),
        (0.3, -0.17069, [91, 0, 164]),
        (0.3, -0.39537, [190, 0, 65]),
        (0.3, -0.53806, [243, 0, 12]),
        (0.3, -0.58173, [243, 12, 0]),
        (0.3, -0.60424, [218, 37, 0]),
        (0.3, -0.67810, [138, 117, 0]),
        (0.3, -0.76451, [50, 205, 0]),
        (0.6, 0.01205, [0, 0, 255]),
        (0.6, -0.02780, [19, 0, 236]),
        (0.6, -0.17069, [103, 0, 152]),
        (0.6, -0.39537, [199, 0, 56]),
        (0.6, -0.53806, [245, 0, 10]),
        (0.6, -0.58173, [250, 5, 0]),
        (0.6, -0.60424, [240, 15, 0]),
        (0.6, -0.67810, [209, 46, 0]),
        (0.6, -0.76451, [175, 80, 0]),
        (0.6, -1.01669, [95, 160, 0]),
        (0.6, -1.24542, [38, 217, 0]),
        (1.0, 0.01205, [0, 0, 255]),
        (1.0, -0.02780, [24, 0, 231]),
        (1.0, -0.17069, [117, 0, 138]),
        (1.0, -0.39537, [209, 0, 46]),
        (1.0, -0.53806, [247, 0, 8]),
        (1.0, -0.58173, [253, 2, 0]),
        (1.0, -0.60424, [248, 7, 0]),
        (1.0, -0.67810, [233, 22, 0]),
        (1.0, -0.76451, [218, 37, 0]),
        (1.0, -1.01669, [184, 71, 0]),
        (1.0, -1.24542, [160, 95, 0]),
    ];
    let ground = Material { emission: 1.0, ..matte([0.0, 1.0, 0.0]) };
    let (scene, poses) = instances([(Plane::INFINITE, ground, PoseF32::IDENTITY)]);
    let blue: Vec<u8> = [0, 0, 255].repeat(6 * 16);
    let mut scene = unlit(scene);
    scene.skybox = Some(Arc::new(Texture::new(TextureKind::Cube, 4, 24, 3, &blue).unwrap()));
    scene.lighting_space = LightingSpace::Display;
    let shown = |width: f32, slope: f32, radius: f32| {
        let mut scene = scene.clone();
        scene.horizon = Some(HorizonHaze { color: [1.0, 0.0, 0.0], radius, width });
        // One pixel, whose ray has the slope.
        let view = View { far: 1e3, ..look_at_view([1, 1], 0.1, [0.0, 0.0, 20.0], [1.0, 0.0, 20.0 + slope]) };
        TestFrame { cfg: CLIP, ..TestFrame::new((scene, poses.clone()), view) }.draw().color()[0]
    };
    let radius = 0.99 * 50.0 / 2.0f32.sqrt();
    let mut wrong = 0;
    for &(width, slope, expected) in SEEN {
        let off = |radius: f32| {
            let found = shown(width, slope, radius);
            [0, 1, 2].map(|k| found[k].abs_diff(expected[k])).into_iter().max().unwrap()
        };
        // A byte of rounding; where the ground begins to fade, the slope at the center of a pixel is known to 2e-5.
        let tolerance = 2;
        assert!(
            off(radius) <= tolerance,
            "width {width}, slope {slope}: {:?}, {expected:?}",
            shown(width, slope, radius)
        );
        wrong += usize::from(off(0.9 * radius) > tolerance);
    }
    // The control: a ground that ends 10 % nearer.
    assert!(wrong >= 25, "{wrong}");
    // Without an infinite plane, or from below, no haze is rendered.
    let mut below =
        TestFrame::new((scene.clone(), poses.clone()), look_at_view([8, 8], 0.1, [0.0, 0.0, -1.0], [1.0, 0.0, -1.0]));
    let clear = below.draw();
    below.scene.horizon = Some(HorizonHaze { color: [1.0, 0.0, 0.0], radius, width: 0.3 });
    assert!(below.draw().same_bits(&clear));
}
