//! Soft shadows of lights with a size, compared with closed forms, and surfaces close to a light or to each other.

use super::*;

/// Heights of the lower and the upper side of the box that casts the shadow \[m\].
const SIDES: [f64; 2] = [0.9, 1.1];
const RADIUS: f64 = 0.2;
const PLACES: [f32; 7] = [-0.5, -0.12, -0.06, 0.0, 0.06, 0.12, 0.5];

/// A floor, and a box that covers x < 0 at the heights [`SIDES`].
fn covered() -> (RenderScene, [PoseF32; 2]) {
    let scene = on_floor(matt(0.6), [Instance::new(Box { half: [1.0, 2.0, 0.1] }, matt(0.6), 2)]);
    (scene, [PoseF32::IDENTITY, PoseF32::from_translation([-1.0, 0.0, 1.0])])
}

/// The light of the floor at (x, 0).
fn at(light: Light, x: f32) -> (f64, f64) {
    let (mut scene, poses) = covered();
    scene.lights = vec![light];
    mean_light(&scene, &poses, &one_ray_view([2.5, 0.3, 0.6], [x, 0.0, 0.0]), 1024, 0)
}

/// A light with a size beside the edge of a box: the lit part is the visible part of its disc.
#[test]
fn near_lights() {
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 4.0 };
    for (kind, exponent) in [(LightKind::Point, 0), (spot, 4)] {
        // The light is 2 m up.
        let light = |radius: f64| Light {
            attenuation: [1., 0., 0.],
            radius: radius as f32,
            ..light(kind, [0., 0., 2.], [0., 0., -1.])
        };
        let cosine = |x: f64| 2.0 / (4.0 + x * x).sqrt();
        let open = |x: f64| albedo(0.6) * f64::from(0.9f32) * cosine(x).powi(1 + exponent);
        // Below the edge of the box's lower side (0, 0.9), a ray to the height 2 goes through x' with (x' - x) 0.9 / 2
        // = -x; below that of its upper side (0, 1.1), with 1.1. The disc is nearly level: its tilt is x / 2, seen from
        // x. The lit part lies beyond the larger of both.
        let cut = |x: f64| SIDES.map(|height| x - x * 2.0 / height).into_iter().fold(f64::MIN, f64::max);
        let part = |c: f64| {
            let c = (c / RADIUS).clamp(-1.0, 1.0);
            (c.acos() - c * (1.0 - c * c).sqrt()) / PI
        };
        let mut last = -1.0;
        for x in PLACES {
            let (mean, deviation) = at(light(RADIUS), x);
            let expected = open(x.into()) * part(cut(x.into()));
            // The tilt of the disc moves its points by up to r (1 - cos) sideways and r sin in height: both below 1 %.
            assert!((mean - expected).abs() < 5.0 * deviation + 0.015 * open(x.into()), "{x}: {mean}, not {expected}");
            // Farther from the edge, a spot gets darker again.
            assert!(mean > last - 1e-3 || x == 0.5, "{x}");
            last = mean;
            // A control: point lights cast sharp shadows.
            let (sharp, _) = at(light(0.0), x);
            let lit = if x < 0.0 { 0.0 } else { open(x.into()) };
            assert!(x == 0.0 || (sharp - lit).abs() < 1e-5, "{x}: {sharp}, not {lit}");
        }
        let (none, _) = at(Light { cast_shadow: false, ..light(0.0) }, -0.5);
        assert!((none - open(-0.5)).abs() < 1e-5, "a light without shadows");
    }
}

/// A directional light's directions are spread over a disc of its radius at a distance of 1 m. The light at x is the
/// mean cosine of the directions that pass the edge of the box: an integral over the disc whose inner part has a closed
/// form.
#[test]
fn directional_lights() {
    let light = Light { radius: RADIUS as f32, ..light(LightKind::Directional, [0.; 3], [0., 0., -1.]) };
    // Integral over the directions (u, v, 1) with a given u, whose cosine is 1 / sqrt(1 + u² + v²).
    let column = |u: f64| 2.0 * ((RADIUS * RADIUS - u * u).max(0.0) / (1.0 + u * u)).sqrt().asinh();
    let expected = |x: f64| {
        let cut = SIDES.map(|height| -x / height).into_iter().fold(-RADIUS, f64::max).min(RADIUS);
        const STEPS: usize = 20_000;
        let step = (RADIUS - cut) / STEPS as f64;
        let sum: f64 = (0..STEPS).map(|k| column(cut + (k as f64 + 0.5) * step)).sum();
        albedo(0.6) * f64::from(0.9f32) * sum * step / (PI * RADIUS * RADIUS)
    };
    // The control of the integral: the whole disc.
    let whole = 2.0 * ((1.0 + RADIUS * RADIUS).sqrt() - 1.0) / (RADIUS * RADIUS);
    assert!((expected(0.5) - albedo(0.6) * f64::from(0.9f32) * whole).abs() < 1e-6);
    let mut between = 0;
    for x in PLACES {
        let found = at(light, x);
        let expected = expected(x.into());
        assert!(agrees(found, expected), "{x}: {found:?}, not {expected}");
        between += usize::from(expected > 0.1 * whole * 0.54 && !agrees(found, 0.98 * expected));
    }
    assert!(between >= 4, "the control: {between} places detect a difference of a fiftieth");
}

/// A glowing rectangle behind the edge of a board: the form factor of its visible part. Source: Howell, B-3; parts on
/// either side of the center are halves.
#[test]
fn emissive_rectangle() {
    const BOARD: f64 = 0.4;
    const THIN: f64 = 1e-4;
    let emitter = Material { emission: 2.0, ..matt(0.5) };
    let half = [0.6f32, 0.4];
    let board = Instance::new(Box { half: [1.0, 1.0, THIN as f32] }, matt(0.0), 3);
    let scene = on_floor(matt(0.7), [Instance::new(Plane { half }, emitter, 2), board]);
    // Facing down, 0.8 m up.
    let rotation = [[1., 0., 0.], [0., -1., 0.], [0., 0., -1.]];
    let view = one_ray_view([2.0, 0.5, 0.4], [0.0; 3]);
    let whole = |side: f64| form_factor(side / 0.8, f64::from(half[1]) / 0.8);
    for edge in [-0.2, -0.1, 0.05, 0.1, 0.2] {
        let board = PoseF32::from_translation([(edge - 1.0) as f32, 0.0, BOARD as f32]);
        let poses = [PoseF32::IDENTITY, PoseF32 { rotation, translation: [0., 0., 0.8] }, board];
        // Seen from the origin, by the edge that covers more of it.
        let cut = edge * 0.8 / (BOARD - THIN * f64::signum(edge));
        let factor = 0.5 * (whole(f64::from(half[0])) - f64::signum(cut) * whole(cut.abs()));
        let expected = albedo(0.7) * 2.0 * albedo(0.5) * factor;
        let light = mean_light(&scene, &poses, &view, 1024, 0);
        assert!(agrees(light, expected), "{edge}: {light:?}, not {expected}");
        assert!(!agrees(light, 1.1 * expected), "the control: a difference of a tenth is detected: {light:?}");
    }
}

/// Surfaces below a point light exactly on a ceiling, which does not occlude it: a floor in closed form, and a smooth
/// ball of triangles to the bit. The control: a millimeter inside the ceiling the light is gone.
///
/// Root cause: shadow rays started above the triangles, at the smooth surface, with the length from the triangles:
/// beyond the light, into the ceiling.
#[test]
fn light_on_a_ceiling() {
    let ceiling = || Instance::new(Box { half: [3.0, 3.0, 0.5] }, matt(0.0), 2);
    let light = |instances: Vec<Instance>, height: f32, at: [f32; 3], eye: [f32; 3]| {
        let mut scene = dark(instances);
        let point = light(LightKind::Point, [0., 0., height], [0., 0., -1.]);
        scene.lights = vec![Light { attenuation: [1., 0., 0.], ..point }];
        mean_light(&scene, &floor_and_object(2.5)[..scene.instances().len()], &one_ray_view(eye, at), 1, 0).0
    };
    let floor = || Instance::new(Plane::INFINITE, matt(0.6), 1);
    for k in 0..40 {
        let at = [0.03 * k as f32 - 0.6, 0.017 * k as f32 - 0.2, 0.0];
        let [on, inside] = [2.0, 2.001].map(|height| light(vec![floor(), ceiling()], height, at, [1.5, 0.3, 0.6]));
        let flat = f64::from(at[0]).hypot(at[1].into());
        assert_number(&format!("{at:?}"), on, albedo(0.6) * f64::from(0.9f32) * 2.0 / 2.0f64.hypot(flat), SINGLE);
        assert_number(&format!("inside, {at:?}"), inside, 0.0, SINGLE);
    }
    let ball = Shape::from(Sphere { radius: 0.4 }).tessellate(12);
    let mesh = std::sync::Arc::new(kinetoscope_scene::shape::RenderMesh::new(
        &ball,
        kinetoscope_scene::shape::RenderMesh::DEFAULT_CREASE_ANGLE,
    ));
    let ball = || Instance::new(kinetoscope_scene::shape::Mesh { mesh: mesh.clone() }, matt(0.6), 1);
    let mut lit = 0;
    for k in 0..60 {
        let at = [0.008 * k as f32, 0.003 * k as f32 - 0.1, 0.2];
        let light = |instances, height| light(instances, height, at, [1.5, 0.3, 1.2]);
        let alone = light(vec![ball()], 2.0);
        assert_eq!(light(vec![ball(), ceiling()], 2.0), alone, "{at:?}");
        assert_eq!(light(vec![ball(), ceiling()], 2.001), 0.0);
        lit += usize::from(alone > 0.1);
    }
    assert!(lit > 30, "{lit}");
}

/// The smooth normals of a brick of 1 m describe a point 0.33 m above the center of its top; a lid 0.05 m above it
/// shades it.
#[test]
fn close_above_a_smooth_surface() {
    let lid = Instance::new(Box { half: [0.3, 0.3, 0.001] }, matt(0.6), 2);
    let mut scene = dark(vec![Instance::new(bricks(&[0.5]), matt(0.6), 1), lid]);
    scene.lights = vec![sun()];
    for (height, lit) in [(0.55, false), (0.7, false), (0.45, true)] {
        let (mean, _) =
            mean_light(&scene, &floor_and_object(height), &one_ray_view([2.0, 0.1, 0.53], [0.0, 0.0, 0.5]), 1, 0);
        assert!(if lit { mean > 0.1 } else { mean == 0.0 }, "{height}: {mean}");
    }
}
