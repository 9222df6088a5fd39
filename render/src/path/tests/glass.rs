//! Glass compared with Snell's law and Fresnel's equations.

use super::*;

fn glass(refractive_index: f32) -> Material {
    Material { transmission: 1.0, refractive_index, specular: 0.0, ..Material::from_rgba([1.0; 4]) }
}

/// All light that enters clear glass leaves it again, so glass is invisible in uniform light. (An ellipsoid keeps light
/// for more bounces than the limit.)
#[test]
fn clear_in_furnace() {
    let shapes: [Shape; 3] = [
        Sphere { radius: 0.3 }.into(),
        Box { half: [0.2, 0.3, 0.1] }.into(),
        Cylinder { radius: 0.2, half_length: 0.25 }.into(),
    ];
    for shape in shapes {
        let light = |material: Material| {
            let mut scene = dark(vec![Instance::new(shape.clone(), material, 1)]);
            scene.sky = Sky::uniform([1.0; 3]);
            mean_light(&scene, &ONE, &one_ray_view([1.0, 0.7, 0.9], [0.02, 0.01, 0.03]), 64, 64).0
        };
        let limit = Tolerance::absolute(1e-12, "rounding of 64 bounces in double precision");
        assert_number(shape.name(), light(glass(1.5)), 1.0, limit);
        // The control: gray glass absorbs a part of the light.
        assert!(light(Material { rgba: [0.5, 0.5, 0.5, 1.0], ..glass(1.5) }) < 0.5, "{shape:?}");
    }
}

/// A plate of thickness t, seen at an angle θ, shifts the image behind it by t (tan θ - tan θ'), sin θ' = sin θ/n, and
/// first transmits (1 - F)² of its light. Light mirrored inside leaves 2 t tan θ' beside, where the scene is empty.
#[test]
fn plate() {
    let (angle, n, t) = (0.25 * PI, 1.5f64, 0.2f64);
    let inside = (angle.sin() / n).asin();
    let across = ((angle - inside).sin() / (angle + inside).sin()).powi(2);
    let along = ((angle - inside).tan() / (angle + inside).tan()).powi(2);
    let expected = (1.0 - 0.5 * (across + along)).powi(2);
    // From the ray's hit with the plate, at x = 0, to the height of the emitter, 0.9 below the plate.
    let x = t * inside.tan() + 0.9 * angle.tan();
    let emissive = Material { emission: 1.0, ..matt(1.0) };
    let shapes = vec![
        Instance::new(Box { half: [2.0, 2.0, 0.5 * t as f32] }, glass(n as f32), 1),
        Instance::new(Sphere { radius: 0.02 }, emissive, 2),
    ];
    let poses =
        [PoseF32::from_translation([0.0, 0.0, -0.5 * t as f32]), PoseF32::from_translation([x as f32, 0.0, -1.1])];
    let view = one_ray_view([-1.0, 0.0, 1.0], [0.0; 3]);
    let scene = dark(shapes);
    let through = mean_light(&scene, &poses, &view, 1024, 4);
    assert!(agrees(through, expected), "{through:?}, not {expected}");
    // Controls: it is darker than without losses, and with air instead of glass the ray misses.
    assert!(!agrees(through, 1.0), "{through:?}");
    let mut air = scene.instances().to_vec();
    air[0].material = glass(1.0);
    assert_eq!(mean_light(&dark(air), &poses, &view, 64, 4).0, 0.0);
}
