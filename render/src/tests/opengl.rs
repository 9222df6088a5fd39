//! Rules of light of MuJoCo's OpenGL renderer, each against its formula, and against the rules of this renderer as the
//! control.

use super::harness::{Image, TestFrame};
use crate::renderer::Renderer;
use crate::shade::tone::ToneCurve;
use crate::visibility::View;
use kinetoscope_scene::shape::{Box, Cylinder, Mesh, Plane, Shape, Sphere};
use kinetoscope_scene::{
    Haze, Light, LightKind, LightingSpace, Material, OpenGlRules, PlaneLines, PoseF32, Tessellation, Texture,
    TextureKind,
};
use kinetoscope_testkit::scenes::{instances, matte, translation, unlit};
use std::sync::Arc;

const RULES: OpenGlRules =
    OpenGlRules { shadow_clip: 10.0, shadow_scale: 1.0, culls_backs: false, is_additive: false, tessellation: None };
/// The same, and light at the corners of polygons.
const AT_CORNERS: OpenGlRules =
    OpenGlRules { tessellation: Some(Tessellation { slices: 28, stacks: 16, quads: 4 }), ..RULES };
const SIZE: usize = 65;

/// A floor of this material below a plate, from above; 20 pixels are 1 m.
fn floor_and_plate(floor: Material, opengl: Option<OpenGlRules>, lights: Vec<Light>) -> TestFrame {
    floor_and((plate(), matte([0.5; 3]), translation(-2.0, 0.0, 1.0)), floor, opengl, lights)
}

fn plate() -> Shape {
    Box { half: [0.5, 0.5, 0.01] }.into()
}

/// A floor of this material below another object, from above; 20 pixels are 1 m.
fn floor_and(
    object: (Shape, Material, PoseF32),
    floor: Material,
    opengl: Option<OpenGlRules>,
    lights: Vec<Light>,
) -> TestFrame {
    let floor = (Shape::from(Plane { half: [3.0; 2] }), floor, PoseF32::IDENTITY);
    let down = View::look_at([SIZE; 2], 0.5, [0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    still([floor, object], opengl, lights, down)
}

/// Objects from a camera with parallel rays; 20 pixels are 1 m.
fn still(
    objects: impl IntoIterator<Item = (Shape, Material, PoseF32)>,
    opengl: Option<OpenGlRules>,
    lights: Vec<Light>,
    view: View,
) -> TestFrame {
    let (scene, poses) = instances(objects);
    let mut scene = unlit(scene);
    (scene.lighting_space, scene.opengl, scene.lights) = (LightingSpace::Display, opengl, lights);
    let view = View { parallel: true, fx: 20.0, fy: 20.0, ..view };
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
    let renderers = [(Renderer::Raster, RULES), (Renderer::Hybrid, RULES), (Renderer::Raster, AT_CORNERS)];
    for (renderer, rules) in renderers {
        let draw = |shadows: bool, strength: f32| {
            let own = Light { cast_shadow: shadows, ..sun(strength / COSINE, 0.0) };
            floor_and_plate(floor.clone(), Some(rules), vec![headlight, own]).with_renderer(renderer)
        };
        // 1.7 is clamped to 1; the second pass adds 0.8, or 1.3, which is clamped to 1. In one pass, all is clamped to 1.
        assert_red(&draw(true, 0.8), LIT, 0.2 * 1.8);
        assert_red(&draw(true, 1.3), LIT, 0.2 * 2.0);
        assert_red(&draw(false, 0.8), LIT, 0.2);
    }
}

/// Edges of shadows are sharp: the floor is lit, or it is not.
#[test]
fn sharp_edges() {
    let values = |rules| {
        // Soft edges of a map with few texels are wider than a pixel.
        let still = floor_and_plate(matte([0.5; 3]), rules, vec![sun(0.8, 0.0)])
            .with(|still| (still.cfg.samples, still.cfg.shadow_size) = (1, 64));
        let image = still.draw();
        let row: std::collections::BTreeSet<u8> = (0..SIZE).map(|x| image.color()[32 * SIZE + x][0]).collect();
        row.len()
    };
    // Floor, shadow, and the plate at the left.
    assert!(values(Some(RULES)) <= 3);
    assert!(values(Some(AT_CORNERS)) <= 3, "light at corners");
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

/// A directional light casts shadows in a square around its axis only. The axis goes from (-4, 0, 3) along (2, 0, -1), so
/// that a point (x, 0, 0) of the floor is (x - 2) / sqrt(5) beside it.
#[test]
fn shadows_of_the_sun_end() {
    let draw = |clip: f32| {
        let rules = OpenGlRules { shadow_clip: clip, ..RULES };
        floor_and_plate(matte([0.5; 3]), Some(rules), vec![sun(0.8, 0.0)]).draw()
    };
    // The plate shades x = -0.5 to 0.5 and y = -0.5 to 0.5; with this square, x = -0.125 and y = 0.3 are the ends.
    let lit = 0.5 * 0.8 * COSINE;
    let narrow = draw(0.95);
    for (x, expected) in [(-0.45, lit), (-0.2, lit), (-0.05, 0.0), (0.4, 0.0), (0.6, lit)] {
        assert_red(&narrow, [x, 0.0], expected);
    }
    assert_red(&draw(10.0), [-0.2, 0.0], 0.0);
    // Across, the plane of the axis is y = 0. The square is as wide: it must contain x = 0.4, which is 0.716 away.
    let square = draw(0.75);
    for (y, expected) in [(0.0, 0.0), (0.45, 0.0), (0.6, lit)] {
        assert_red(&square, [0.4, y], expected);
    }
    assert_red(&square, [0.2, 0.0], lit);
}

/// A spot casts shadows in a fraction of its cutoff angle only. It is 3 m above the floor, so that a plate at half the
/// height, from x = 0 to 1, shades x = 0 to 1.5.
#[test]
fn shadows_of_a_spot_end() {
    let spot = Light {
        kind: LightKind::Spot { cutoff_deg: 45.0, exponent: 0.0 },
        position: [0.0, 0.0, 3.0],
        direction: [0.0, 0.0, -1.0],
        attenuation: [1.0, 0.0, 0.0],
        ..sun(0.8, 0.0)
    };
    let draw = |scale: f32| {
        let rules = OpenGlRules { shadow_scale: scale, ..RULES };
        let object = (plate(), matte([0.5; 3]), translation(0.5, 0.0, 1.0));
        floor_and(object, matte([0.5; 3]), Some(rules), vec![spot]).draw()
    };
    let lit = |x: f32| 0.5 * 0.8 * 3.0 / (9.0 + x * x).sqrt();
    // 3 m tan(22.5 deg) = 1.243 m.
    let (half, whole) = (draw(0.5), draw(1.0));
    for (x, expected) in [(1.1, 0.0), (1.4, lit(1.4)), (-0.3, lit(0.3))] {
        assert_red(&half, [x, 0.0], expected);
    }
    assert_red(&whole, [1.1, 0.0], 0.0);
    assert_red(&whole, [1.4, 0.0], 0.0);
}

/// Transparent surfaces receive no shadows, are lit by all lights, cast shadows, and are mixed as display colors.
///
/// The pane, of opacity 0.4, is in the shadow of the plate, and the floor below it too.
#[test]
fn transparent_surfaces() {
    let pane = Material { rgba: [0.9, 0.9, 0.9, 0.4], ..matte([0.9; 3]) };
    let draw = |opengl: Option<OpenGlRules>, plate_at: f32| {
        let floor = (Shape::from(Plane { half: [3.0; 2] }), matte([0.5; 3]), PoseF32::IDENTITY);
        let shade = (plate(), matte([0.5; 3]), translation(plate_at, 0.0, 1.0));
        let glass = (Box { half: [0.3, 0.3, 0.01] }.into(), pane.clone(), translation(0.0, 0.0, 0.2));
        let down = View::look_at([SIZE; 2], 0.5, [0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
        still([floor, shade, glass], opengl, vec![sun(0.8, 0.0)], down).draw()
    };
    let lit = 0.8 * COSINE;
    let shaded = draw(Some(RULES), -2.0);
    assert_red(&shaded, SHADOW, 0.4 * 0.9 * lit);
    assert_red(&draw(None, -2.0), SHADOW, 0.0);
    // Without the plate, the pane alone shades the floor, 0.4 m to its right.
    let alone = draw(Some(RULES), -20.0);
    assert_red(&alone, [0.2, 0.0], 0.4 * 0.9 * lit);
    assert_red(&alone, [0.5, 0.0], 0.0);
    assert_red(&alone, [-0.25, 0.0], 0.4 * 0.9 * lit + 0.6 * 0.5 * lit);
    // Additive: nothing is lost behind the pane.
    let added = draw(Some(OpenGlRules { is_additive: true, ..RULES }), -20.0);
    assert_red(&added, [-0.25, 0.0], 0.4 * 0.9 * lit + 0.5 * lit);
}

/// A mirror shows surfaces without shadows on them, in colors multiplied by the reflectance and added to its own.
///
/// Seen along (1, 0, -1), the floor at (1, 0, 0) mirrors the wall x = 2 at the height 1, which is in the shadow of a plate.
#[test]
fn reflections_have_no_shadows() {
    const WALL: f32 = 0.6;
    const REFLECTANCE: f32 = 0.5;
    let draw = |opengl: Option<OpenGlRules>, target: [f32; 3], reflectance: f32| {
        let mirror = Material { reflectance, ..matte([0.3; 3]) };
        let objects = [
            (Shape::from(Plane { half: [3.0; 2] }), mirror, PoseF32::IDENTITY),
            (Box { half: [0.05, 1.0, 1.0] }.into(), matte([WALL; 3]), translation(2.05, 0.0, 1.0)),
            (Box { half: [0.02, 0.3, 0.3] }.into(), matte([0.5; 3]), translation(0.0, 0.0, 2.0)),
        ];
        let eye = [target[0] - 2.0, 0.0, target[2] + 2.0];
        let view = View::look_at([SIZE; 2], 0.5, eye, target, [0.0, 0.0, 1.0]).unwrap();
        let image = still(objects, opengl, vec![sun(0.8, 0.0)], view).draw();
        f32::from(image.color()[SIZE / 2 * SIZE + SIZE / 2][0]) / 255.0
    };
    let (floor, wall) = ([1.0, 0.0, 0.0], [2.0, 0.0, 1.0]);
    // The light falls onto the wall at twice the tangent.
    let (own, mirrored) = (0.3 * 0.8 * COSINE, WALL * 0.8 * 2.0 * COSINE);
    let near = |found: f32, expected: f32| assert!((found - expected).abs() < 0.006, "{found} {expected}");
    near(draw(Some(RULES), wall, REFLECTANCE), 0.0);
    near(draw(Some(RULES), [2.0, 0.0, 1.6], REFLECTANCE), mirrored);
    near(draw(Some(RULES), floor, REFLECTANCE), own + REFLECTANCE * mirrored);
    near(draw(Some(RULES), floor, 0.0), own);
    near(draw(None, floor, REFLECTANCE), own);
}

/// A camera inside of a solid sees through it if backs are culled. The wall is 2 m before the camera.
#[test]
fn culled_backs() {
    let ball = kinetoscope_scene::shape::RenderMesh::new(&Shape::from(Sphere { radius: 0.5 }).tessellate(16), 0.5);
    let solids: [Shape; 4] = [
        Box { half: [0.5; 3] }.into(),
        Sphere { radius: 0.5 }.into(),
        Cylinder { radius: 0.5, half_length: 0.4 }.into(),
        Mesh { mesh: Arc::new(ball) }.into(),
    ];
    for solid in solids {
        let name = solid.name();
        let draw = |culls_backs: bool, from: f32| {
            let wall = (Shape::from(Box { half: [0.1, 9.0, 9.0] }), matte([0.5; 3]), translation(2.1, 0.0, 0.0));
            let object = (solid.clone(), matte([0.5; 3]), PoseF32::IDENTITY);
            let rules = OpenGlRules { culls_backs, ..RULES };
            let view = View::look_at([SIZE; 2], 0.5, [from, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0]).unwrap();
            let mut frame = still([object, wall], Some(rules), vec![sun(0.8, 0.0)], view);
            frame.view = view;
            let image = frame.draw();
            let middle = SIZE / 2 * SIZE + SIZE / 2;
            (image.mask()[middle], image.depth()[middle])
        };
        for (culls, from, mask, depth) in [(true, 0.0, 2, 2.0), (false, 0.0, 1, 0.5), (true, -2.0, 1, 1.5)] {
            let (found, at) = draw(culls, from);
            assert!(found == mask && (at - depth).abs() < 0.02, "{name} {culls} {from}: {found} at {at}");
        }
    }
}

/// Light is computed at the corners of polygons and interpolated: between the corners (0, 0), (2, 0) and (0, 2) of a floor,
/// below a light at (0, 0, 3).
#[test]
fn light_at_corners() {
    let light = Light {
        kind: LightKind::Point,
        position: [0.0, 0.0, 3.0],
        attenuation: [1.0, 0.0, 0.0],
        cast_shadow: false,
        ..sun(0.9, 0.0)
    };
    let lines = [PlaneLines { reach: 2.0, step: 2.0, border: 3.0 }; 2];
    let draw = |tessellation: Option<Tessellation>| {
        let rules = OpenGlRules { tessellation, ..RULES };
        let far = (plate(), matte([0.5; 3]), translation(-20.0, 0.0, 1.0));
        let mut frame = floor_and(far, matte([0.5; 3]), Some(rules), vec![light]);
        frame.scene.set_plane_lines(0, lines);
        frame.draw()
    };
    let lit = |square: f32| 0.5 * 0.9 * 3.0 / (9.0 + square).sqrt();
    let (corners, pixels) = (draw(Some(Tessellation::default())), draw(None));
    // Points with their shares of the corners (0, 0) and, together, of the other two, which are as bright.
    for (x, y, share) in [(0.5, 0.5, 0.5), (0.25, 0.75, 0.5), (1.0, 1.0, 0.0), (1.2, 0.0, 0.4)] {
        assert_red(&corners, [x, y], share * lit(0.0) + (1.0 - share) * lit(4.0));
        assert_red(&pixels, [x, y], lit(x * x + y * y));
    }
    // The formulas differ: where a corner is, they agree, in the middle of a polygon they do not.
    let middle = |image: &Image| red(image, 1.2, 0.0);
    assert!(middle(&pixels) - middle(&corners) > 2.0, "{} {}", middle(&pixels), middle(&corners));
}

/// Light at the corners of triangles of a mesh and of a box: the same colors as of the shape as a mesh with those
/// triangles, which has another code.
#[test]
fn corners_of_meshes() {
    let light = Light {
        kind: LightKind::Point,
        position: [1.0, 0.5, 2.0],
        attenuation: [0.5, 0.2, 0.1],
        cast_shadow: false,
        specular: [0.6; 3],
        ..sun(0.7, 0.1)
    };
    let half = [0.8, 0.5, 0.2];
    let quality = Tessellation { quads: 1, ..Tessellation::default() };
    let draw = |shape: Shape, quality: Tessellation| {
        let rules = OpenGlRules { tessellation: Some(quality), ..RULES };
        let shiny = Material { specular: 0.8, shininess: 0.2, ..matte([0.5; 3]) };
        floor_and((shape, shiny, translation(0.0, 0.0, 0.5)), matte([0.5; 3]), Some(rules), vec![light]).draw()
    };
    // The upper face, split like OpenGL splits it.
    let corner = |x: f32, y: f32| [x * half[0], y * half[1], half[2]];
    let positions = vec![corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)];
    let mesh = kinetoscope_scene::mesh::TriMesh::from_triangles(positions, vec![[0, 1, 3], [1, 2, 3]]);
    let mesh = kinetoscope_scene::shape::RenderMesh::new(&mesh, 0.5);
    let boxed = draw(Box { half }.into(), quality);
    let flat = draw(Mesh { mesh: Arc::new(mesh) }.into(), quality);
    let fine = draw(Box { half }.into(), Tessellation { quads: 50, ..quality });
    let upper = |image: &Image| -> Vec<u8> {
        let points = (-15..=15).flat_map(|x| (-9..=9).map(move |y| (x as f32 * 0.05, y as f32 * 0.05)));
        points.map(|(x, y)| red(image, x, y) as u8).collect()
    };
    let (a, b, control) = (upper(&boxed), upper(&flat), upper(&fine));
    assert!(a.iter().zip(&b).all(|(a, b)| a.abs_diff(*b) <= 1), "{a:?} {b:?}");
    assert!(a.iter().zip(&control).any(|(a, c)| a.abs_diff(*c) > 8), "the control: other polygons");
}

/// Each face of a box shows a whole image, and the box has the depth and the id of a box without a texture: of two boxes at
/// one place, the later one is visible, as in OpenGL.
///
/// Regression: boxes with a texture were meshes, through which a box at the same place shone in some pixels.
#[test]
fn images_on_faces() {
    // Two columns and two rows: red is 250, 150 above, 100, 50 below.
    let pixels: Vec<u8> = [250, 150, 100, 50].into_iter().flat_map(|byte| [byte; 3]).collect();
    let texture = Texture::averaged_in(LightingSpace::Display, TextureKind::TwoD, 2, 2, 3, &pixels).unwrap();
    let painted = Material { texture: Some(Arc::new(texture)), emission: 1.0, ..matte([1.0; 3]) };
    let half = [0.8, 0.4, 0.6];
    let from = |eye: [f32; 3], up: [f32; 3]| View::look_at([SIZE; 2], 0.5, eye, [0.0; 3], up).unwrap();
    let cuboid = |material: Material| (Shape::from(Box { half }), material, PoseF32::IDENTITY);
    let draw = |boxes: Vec<(Shape, Material, PoseF32)>, index: usize, view: View| {
        let mut frame = still(boxes, Some(RULES), Vec::new(), view);
        frame.scene.set_face_images(index, [1.0; 2]);
        frame.draw()
    };
    let up = [0.0, 0.0, 1.0];
    // The camera, its up, and the red of the quarters of the face: upper left, upper right, lower left, lower right.
    for (eye, up, quarters) in [
        ([0.0, 0.0, 3.0], [0.0, 1.0, 0.0], [250, 150, 100, 50]),
        ([0.0, 0.0, -3.0], [0.0, 1.0, 0.0], [150, 250, 50, 100]),
        ([3.0, 0.0, 0.0], up, [250, 150, 100, 50]),
        ([-3.0, 0.0, 0.0], up, [150, 250, 50, 100]),
        ([0.0, -3.0, 0.0], up, [250, 150, 100, 50]),
        ([0.0, 3.0, 0.0], up, [150, 250, 50, 100]),
    ] {
        let view = from(eye, up);
        let (alone, below) = (draw(vec![cuboid(painted.clone())], 0, view), cuboid(matte([0.0; 3])));
        let (later, earlier) = (
            draw(vec![below.clone(), cuboid(painted.clone())], 1, view),
            draw(vec![cuboid(painted.clone()), below], 0, view),
        );
        let axes = view.world_from_camera.rotation.map(|row| [row[0].abs(), row[1].abs()]);
        let reach = [0, 1].map(|k| (0..3).map(|axis| axes[axis][k] * half[axis]).sum::<f32>());
        for (k, expected) in quarters.into_iter().enumerate() {
            let [x, y] = [if k % 2 == 0 { -0.5 } else { 0.5 } * reach[0], if k < 2 { 0.5 } else { -0.5 } * reach[1]];
            assert_red(&alone, [x, y], expected as f32 / 255.0);
        }
        assert_eq!(later.color(), alone.color(), "{eye:?}");
        assert!(later.depth() == alone.depth() && earlier.depth() == alone.depth());
        assert!(earlier.mask().iter().all(|&id| id != 1) && later.mask().iter().all(|&id| id != 1), "{eye:?}");
    }
}

/// The mip levels of a texture follow from the derivatives of the surface point by the image coordinates, of which the
/// larger one counts: not from the distance along the ray, nor from its angle with the surface.
///
/// The texture is a row of a white and a black texel, so that the second level is gray. A pixel 1.4 texels wide, at the
/// middle of a white texel, is white by the part of the first level: OpenGL's logarithm is 0.4854.
#[test]
fn widths_of_pixels() {
    const TEXELS: f32 = 1.4;
    let expected = (1.0 - TEXELS.log2()) + 0.5 * TEXELS.log2();
    let pixels = [255, 255, 255, 0, 0, 0];
    let texture = Arc::new(Texture::averaged_in(LightingSpace::Display, TextureKind::TwoD, 2, 1, 3, &pixels).unwrap());
    let view = View::look_at([SIZE; 2], 1.6, [0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    // Width of a pixel on a plane across the optical axis, anywhere in the image.
    let width = 3.0 / view.fx;
    let draw = |opengl: Option<OpenGlRules>, column: usize, turn: f32, width: f32| {
        // Two texels in an image of the texture.
        let images_per_meter = TEXELS / (2.0 * width);
        let material = Material {
            texture: Some(Arc::clone(&texture)),
            tex_repeat: [2.0 * images_per_meter; 2],
            tex_uniform: true,
            emission: 1.0,
            ..matte([1.0; 3])
        };
        let (sine, cosine) = turn.sin_cos();
        let rotation = [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]];
        let plane = (Shape::from(Plane { half: [40.0; 2] }), material, PoseF32 { rotation, translation: [0.0; 3] });
        let mut frame = still([plane], opengl, Vec::new(), view);
        frame.view = view;
        // Moves the middle of a white texel to the pixel.
        let (scale, offset) = (frame.scene.texture_scales()[0][0], frame.scene.texture_offsets()[0][0]);
        let at = (0.25 - offset) / scale;
        let x = (column as f32 + 0.5 - view.cx) * 3.0 / view.fx;
        frame.poses[0].translation = [x - cosine * at, 0.0, sine * at];
        f32::from(frame.draw().color()[SIZE / 2 * SIZE + column][0]) / 255.0
    };
    let near = |found: f32| assert!((found - expected).abs() < 0.012, "{found} {expected}");
    let (middle, border) = (SIZE / 2, SIZE - 1);
    near(draw(Some(RULES), middle, 0.0, width));
    near(draw(Some(RULES), border, 0.0, width));
    // Turned about y, a step along x is longer by the cosine.
    near(draw(Some(RULES), middle, 0.7, width / 0.7f32.cos()));
    // The control: without these rules, pixels at the border are wider by the angle of their rays.
    assert!((draw(None, border, 0.0, width) - expected).abs() > 0.1);
}

/// By default, shadow maps have 512 to 2048 texels along a side, and those of other scenes 128 to 1024.
#[test]
fn texels_of_shadow_maps() {
    for (opengl, size, side) in
        [(Some(RULES), 40, 512), (Some(RULES), 100, 1024), (Some(RULES), 300, 2048), (None, 40, 128), (None, 300, 512)]
    {
        let draw = |shadow_size: usize| {
            let mut frame = floor_and_plate(matte([0.5; 3]), opengl, vec![sun(0.8, 0.0)]);
            let scale = size as f32 / SIZE as f32;
            let View { fx, fy, cx, cy, .. } = frame.view;
            let [fx, fy, cx, cy] = [fx, fy, cx, cy].map(|x| x * scale);
            frame.view = View { width: size, height: size, fx, fy, cx, cy, ..frame.view };
            frame.cfg.shadow_size = shadow_size;
            frame.draw()
        };
        let image = draw(0);
        assert_eq!(image.color(), draw(side).color(), "{size} {side}");
        assert_ne!(image.color(), draw(side / 8).color(), "the control: {size} {side}");
    }
}
