//! Rules of light of MuJoCo's OpenGL renderer, each against its formula, and against the rules of this renderer as the
//! control.

use super::harness::{Image, TestFrame};
use crate::renderer::Renderer;
use crate::shade::tone::ToneCurve;
use crate::visibility::View;
use kinetoscope_scene::shape::{Box, Plane, Shape};
use kinetoscope_scene::{Haze, Light, LightingSpace, Material, OpenGlRules, PoseF32, Texture, TextureKind};
use kinetoscope_testkit::scenes::{instances, matte, translation, unlit};
use std::sync::Arc;

const RULES: OpenGlRules = OpenGlRules { shadow_clip: 10.0, shadow_scale: 1.0 };
const SIZE: usize = 65;

/// A floor of this material below a plate, from above; 20 pixels are 1 m.
fn floor_and_plate(floor: Material, opengl: Option<OpenGlRules>, lights: Vec<Light>) -> TestFrame {
    let plate = Shape::from(Box { half: [0.5, 0.5, 0.01] });
    let (scene, poses) = instances([
        (Shape::from(Plane { half: [3.0; 2] }), floor, PoseF32::IDENTITY),
        (plate, matte([0.5; 3]), translation(-2.0, 0.0, 1.0)),
    ]);
    let mut scene = unlit(scene);
    (scene.lighting_space, scene.opengl, scene.lights) = (LightingSpace::Display, opengl, lights);
    let down = View::look_at([SIZE; 2], 0.5, [0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    let view = View { parallel: true, fx: 20.0, fy: 20.0, ..down };
    TestFrame::new((scene, poses), view).with(|still| still.cfg.tone = ToneCurve::Clip)
}

/// A light from the upper left: the shadow of the plate is 2 m to the right of it, in the middle of the image.
fn sun(diffuse: f32, ambient: f32) -> Light {
    let direction = [2.0, 0.0, -1.0];
    Light {
        direction,
        diffuse: [diffuse; 3],
        ambient: [ambient; 3],
        specular: [0.0; 3],
        position: [-4.0, 0.0, 3.0],
        ..Light::default()
    }
}

/// Cosine of its direction with the vertical.
const COSINE: f32 = 0.447_213_6;

/// Red at a point of the floor \[m\].
fn red(image: &Image, x: f32, y: f32) -> f32 {
    let [column, row] = [32.5 + 20.0 * x, 32.5 - 20.0 * y].map(|pixel| pixel as usize);
    f32::from(image.color()[row * SIZE + column][0])
}

const SHADOW: [f32; 2] = [0.0, 0.0];
const LIT: [f32; 2] = [0.0, 1.2];

#[track_caller]
fn assert_red(image: &Image, [x, y]: [f32; 2], expected: f32) {
    let found = red(image, x, y);
    assert!((found - 255.0 * expected).abs() <= 1.5, "({x}, {y}): {found}, expected {}", 255.0 * expected);
}

/// A light gives no ambient light in its shadow.
///
/// Regression: ambient light had no shadow.
#[test]
fn ambient_light_has_shadows() {
    for renderer in [Renderer::Raster, Renderer::Hybrid] {
        let draw = |rules| floor_and_plate(matte([0.5; 3]), rules, vec![sun(0.8, 0.4)]).with_renderer(renderer);
        let (image, control) = (draw(Some(RULES)), draw(None));
        assert_red(&image, LIT, 0.5 * (0.8 * COSINE + 0.4));
        assert_red(&image, SHADOW, 0.0);
        assert_red(&control, SHADOW, 0.5 * 0.4);
    }
}

/// A light with shadows is a pass of its own, which is clamped before it is added: the texture darkens the sum.
#[test]
fn passes_are_clamped() {
    let texture = |byte: u8| {
        let pixels = [byte; 3];
        Some(Arc::new(Texture::averaged_in(LightingSpace::Display, TextureKind::TwoD, 1, 1, 3, &pixels).unwrap()))
    };
    let floor = Material { texture: texture(51), ..matte([1.0; 3]) };
    let headlight = Light { direction: [0.0, 0.0, -1.0], diffuse: [1.7; 3], cast_shadow: false, ..sun(0.0, 0.0) };
    for renderer in [Renderer::Raster, Renderer::Hybrid] {
        let draw = |shadows: bool| {
            let own = Light { cast_shadow: shadows, ..sun(1.0 / COSINE * 0.8, 0.0) };
            floor_and_plate(floor.clone(), Some(RULES), vec![headlight, own]).with_renderer(renderer)
        };
        // 1.7 is clamped to 1; the second pass adds 0.8. In one pass, all is clamped to 1.
        assert_red(&draw(true), LIT, 0.2 * 1.8);
        assert_red(&draw(false), LIT, 0.2);
    }
}

/// Edges of shadows are sharp: the floor is lit, or it is not.
#[test]
fn sharp_edges() {
    let values = |rules| {
        let still = floor_and_plate(matte([0.5; 3]), rules, vec![sun(0.8, 0.0)]).with(|still| still.cfg.samples = 1);
        let image = still.draw();
        let row: std::collections::BTreeSet<u8> = (0..SIZE).map(|x| image.color()[32 * SIZE + x][0]).collect();
        row.len()
    };
    // Floor, shadow, and the plate at the left.
    assert!(values(Some(RULES)) <= 3);
    assert!(values(None) > 3, "the control: soft edges");
}

/// Haze mixes display colors, linearly with the distance.
///
/// Regression: it increased smoothly, and mixed linear light.
#[test]
fn haze() {
    let draw = |opengl: bool, distance: f32| {
        let mut still = floor_and_plate(matte([0.5; 3]), opengl.then_some(RULES), vec![sun(0.8, 0.0)]);
        still.scene.haze = Some(Haze { color: Some([0.9; 3]), start: 1.0, end: 5.0 });
        still.view.world_from_camera.translation[2] = distance;
        red(&still.draw(), LIT[0], LIT[1]) / 255.0
    };
    let floor = 0.5 * 0.8 * COSINE;
    for distance in [1.8, 2.4, 3.7, 4.5] {
        let k = (distance - 1.0) / 4.0;
        let expected = floor + k * (0.9 - floor);
        let (found, control) = (draw(true, distance), draw(false, distance));
        assert!((found - expected).abs() < 0.008, "{distance}: {found} {expected}");
        assert!((control - expected).abs() > 0.02, "{distance}: {control} {expected}");
    }
}
