//! Orthographic cameras.

use super::harness::{EXACT, Image, TestFrame, assert_same_bits, look_at_view};
use crate::lens::{Lens, LensRays};
use crate::renderer::Renderer;
use crate::shade::tone::ToneCurve;
use crate::visibility::{RenderError, View};
use kinetoscope_scene::shape::{Box, Mesh, Plane, RenderMesh, Shape};
use kinetoscope_scene::{Light, LightKind, LightingSpace, PoseF32, RenderScene};
use kinetoscope_testkit::scenes::{every_shape, instances, matte, translation, unlit};
use std::sync::Arc;

/// 40 pixels per meter, aslant from above.
fn aslant([width, height]: [usize; 2]) -> View {
    let view = look_at_view([width, height], 0.9, [1.0, -2.0, 2.5], [0.0, 0.0, 0.3]);
    View { parallel: true, fx: 40.0, fy: 44.0, cx: 0.45 * width as f32, ..view }
}

/// Every shape, twice: over an infinite floor.
fn every() -> (RenderScene, Vec<PoseF32>) {
    let floor = (Shape::from(Plane::INFINITE), matte([0.5; 3]), PoseF32::IDENTITY);
    let shapes = every_shape().into_iter().enumerate();
    let placed = shapes.map(|(k, shape)| {
        let at = translation((k % 3) as f32 - 1.0, (k / 3) as f32 - 1.0, 0.2 + 0.1 * (k % 2) as f32);
        (shape, matte([0.2 + 0.1 * k as f32, 0.5, 0.9 - 0.1 * k as f32]), at)
    });
    let (scene, poses) = instances(std::iter::once(floor).chain(placed));
    (scene, poses)
}

/// Each pixel is that of a pinhole at the origin of its ray, whose image is this pixel alone: depth, mask, normals and
/// position.
#[test]
fn rays() {
    let view = aslant([61, 53]);
    let still = TestFrame { cfg: EXACT, ..TestFrame::new(every(), view) };
    let image = still.draw();
    let mut seen = std::collections::BTreeSet::new();
    for k in image.inner().step_by(7) {
        let (x, y) = ((k % 61) as f32 + 0.5, (k / 61) as f32 + 0.5);
        let across = [(x - view.cx) / view.fx, (y - view.cy) / view.fy, 0.0];
        let PoseF32 { rotation, .. } = view.world_from_camera;
        let world_from_camera = PoseF32 { rotation, translation: view.world_from_camera.apply(across) };
        let one = View {
            parallel: false,
            width: 1,
            height: 1,
            fx: 1e6,
            fy: 1e6,
            cx: 0.5,
            cy: 0.5,
            world_from_camera,
            ..view
        };
        let one = still.draw_view(one);
        // Silhouettes are rounded differently.
        if !image.is_off_silhouette(k) {
            continue;
        }
        let (found, expected) = (image.depth()[k], one.depth()[0]);
        assert_eq!(image.mask()[k], one.mask()[0], "pixel {k}");
        // An edge inside of a mesh, snapped to 1/256 pixel, moves the depth by up to as much of its slope.
        assert!((found - expected).abs() < 2e-4 * expected, "pixel {k}: {found} {expected}");
        seen.insert(image.mask()[k]);
        let [a, b] = [image.position()[k], one.position()[0]];
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-3), "pixel {k}: {a:?} {b:?}");
    }
    assert!(seen.len() >= 6, "{seen:?}");
    // The control: a pinhole of the same view differs.
    let pinhole = still.draw_view(View { parallel: false, ..view });
    assert!(image.inner().filter(|&k| pinhole.mask()[k] != image.mask()[k]).count() > 100);
}

/// A box seen along its axis covers a rectangle of its size, at any distance, as a closed form and as a mesh.
#[test]
fn sizes() {
    let half = [0.3, 0.2, 0.1];
    let mesh = RenderMesh::new(&Shape::from(Box { half }).tessellate(1), RenderMesh::DEFAULT_CREASE_ANGLE);
    for shape in [Shape::from(Box { half }), Mesh { mesh: Arc::new(mesh) }.into()] {
        for height in [0.0f32, 1.5] {
            let scene = instances([(shape.clone(), matte([0.5; 3]), translation(0.0, 0.0, height))]);
            let down = View::look_at([64, 48], 0.5, [0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
            let still = TestFrame::new(scene, View { parallel: true, fx: 50.0, fy: 50.0, ..down });
            let image = still.draw();
            let count = image.mask().iter().filter(|&&id| id != 0).count();
            assert_eq!(count, 30 * 20, "{height}");
            let expected = 3.0 - height - 0.1;
            assert!(image.depth().iter().all(|d| d.is_infinite() || (d - expected).abs() < 1e-6));
            // The near plane cuts the box open: its inside is visible. Beyond the far plane there is nothing.
            let cut = still.draw_view(View { near: expected + 0.05, ..still.view });
            assert!(cut.depth().iter().all(|d| d.is_infinite() || (d - expected - 0.2).abs() < 1e-6));
            assert_eq!(cut.mask().iter().filter(|&&id| id != 0).count(), 30 * 20);
            let short = still.draw_view(View { far: expected - 0.01, ..still.view });
            assert!(short.mask().iter().all(|&id| id == 0));
        }
    }
}

/// The hybrid draws what the rasterizer draws, and all bits are the same with any instruction set and number of threads.
#[test]
fn renderers() {
    let make = |renderer| {
        move |_: usize| {
            let mut still = TestFrame { cfg: EXACT, renderer, ..TestFrame::new(every(), aslant([93, 70])) };
            still.scene.lights = vec![Light { direction: [0.3, 0.2, -1.0], ..Light::default() }];
            still
        }
    };
    let [raster, hybrid] = [Renderer::Raster, Renderer::Hybrid]
        .map(|renderer| assert_same_bits("orthographic", (1, &make(renderer)), &[1, 3], &[1, 2]).remove(0));
    assert!(raster.bits_but_color() == hybrid.bits_but_color());
    let far = |a: &Image, b: &Image| super::harness::count_different(a, b, 20);
    assert!(far(&raster, &hybrid) < 93 * 70 / 20, "{}", far(&raster, &hybrid));
    let bare = make(Renderer::Raster)(0).with(|still| still.cfg.shadows = false).draw();
    assert!(far(&bare, &hybrid) > far(&raster, &hybrid) + 100, "the control: shadows are visible");
}

/// Shadows of spots and directional lights, through maps and rays, fall where the closed form says.
#[test]
fn shadows() {
    let floor = (Shape::from(Plane::INFINITE), matte([0.8; 3]), PoseF32::IDENTITY);
    let plate = (Box { half: [0.2, 0.2, 0.01] }.into(), matte([0.8; 3]), translation(0.0, 0.0, 1.0));
    let (scene, poses) = instances([floor, plate]);
    let mut scene = unlit(scene);
    scene.lighting_space = LightingSpace::Display;
    let down = View::look_at([80, 80], 0.5, [0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    let view = View { parallel: true, fx: 40.0, fy: 40.0, ..down };
    for kind in [LightKind::Directional, LightKind::Spot { cutoff_deg: 60.0, exponent: 0.0 }] {
        // At 45 degrees: the shadow is 1 m to the side. That of the spot is twice as large.
        let light = Light {
            kind,
            position: [-1.0, 0.0, 2.0],
            direction: [1.0, 0.0, -1.0],
            diffuse: [0.8; 3],
            ..Light::default()
        };
        scene.lights = vec![light];
        let still = TestFrame::new((scene.clone(), poses.clone()), view).with(|still| still.cfg.tone = ToneCurve::Clip);
        for renderer in [Renderer::Raster, Renderer::Hybrid] {
            let image = still.with_renderer(renderer);
            let is_dark = |x: f32, y: f32| {
                let (column, row) = ((40.0 + 40.0 * x) as usize, (40.0 - 40.0 * y) as usize);
                image.color()[row * 80 + column][0] < 20
            };
            let half = if kind == LightKind::Directional { 0.2 } else { 0.4 };
            let points = [([1.01 - half + 0.07, 0.01], true), ([1.01 - half - 0.09, 0.01], false)];
            let sides = [([0.96, half - 0.07], true), ([0.96, half + 0.07], false), ([0.96, 0.07 - half], true)];
            for ([x, y], dark) in points.into_iter().chain(sides) {
                assert_eq!(is_dark(x, y), dark, "{kind:?} {renderer:?}: ({x}, {y})");
            }
        }
    }
}

/// Motion of a box, and of the camera, in pixels.
#[test]
fn flow() {
    let scene = instances([(Shape::from(Box { half: [0.3; 3] }), matte([0.5; 3]), translation(0.0, 0.0, 0.0))]);
    let down = View::look_at([64, 48], 0.5, [0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
    let view = View { parallel: true, fx: 50.0, fy: 50.0, ..down };
    let still = TestFrame::new(scene, view).with(|still| {
        still.previous = Some((vec![translation(-0.1, 0.04, -1.0)], view));
    });
    let image = still.draw();
    let [right, below] = image.flow()[24 * 64 + 32];
    // 0.1 m to the right and 0.04 m down, whatever the depth.
    assert!((right - 5.0).abs() < 1e-3 && (below - 2.0).abs() < 1e-3, "{right} {below}");
}

/// Other renderers, and lenses, refuse orthographic cameras.
#[test]
fn refused() {
    let still = TestFrame::new(every(), aslant([16, 16]));
    for renderer in [Renderer::FastRayTraced, Renderer::RAY_TRACED] {
        let error = still.with(|still| still.renderer = renderer).try_draw().unwrap_err();
        assert_eq!(error, RenderError::Orthographic { renderer: renderer.name() });
    }
    let optics = crate::lens::Optics::new(
        Lens::from_name("equidistant").unwrap(),
        crate::Intrinsics::Fovy { radians: 0.9 }.to_pixels(16, 16).unwrap(),
    );
    let lens = LensRays::new(&optics.unwrap(), [16, 16], 4).unwrap();
    let still = still.with(|still| (still.lens, still.renderer) = (Some(lens), Renderer::Hybrid));
    assert!(matches!(still.try_draw(), Err(RenderError::Orthographic { .. })));
}
