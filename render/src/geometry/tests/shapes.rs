//! Shapes compared with closed forms: hit points lie on the surface.

use super::TestRng;
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere};
use kinetoscope_scene::vector::{add_scaled, dot};

fn touch(shape: impl Into<Shape>, origin: [f64; 3], direction: [f64; 3]) -> Option<(f64, [f64; 3])> {
    let direction = kinetoscope_scene::vector::normalize(direction).unwrap();
    shape.into().intersect(&Ray { origin, direction }, f64::INFINITY).map(|t| (t.t, t.normal))
}

/// Signed distance from the shape: 0 on the surface, negative inside, near the surface in meters.
fn outside(shape: &Shape, [x, y, z]: [f64; 3]) -> f64 {
    let beyond = |p: f64, h: f32| p.abs() - f64::from(h);
    match shape {
        Shape::Sphere(s) => (x * x + y * y + z * z).sqrt() - f64::from(s.radius),
        Shape::Capsule(s) => {
            let h = f64::from(s.half_length);
            (x * x + y * y + (z - z.clamp(-h, h)).powi(2)).sqrt() - f64::from(s.radius)
        }
        Shape::Ellipsoid(s) => {
            let [a, b, c] = s.radii.map(f64::from);
            let value = (x / a).powi(2) + (y / b).powi(2) + (z / c).powi(2);
            let slope = 2.0 * ((x / a / a).powi(2) + (y / b / b).powi(2) + (z / c / c).powi(2)).sqrt();
            (value - 1.0) / slope.max(1.0)
        }
        Shape::Cylinder(s) => ((x * x + y * y).sqrt() - f64::from(s.radius)).max(beyond(z, s.half_length)),
        Shape::Box(s) => beyond(x, s.half[0]).max(beyond(y, s.half[1])).max(beyond(z, s.half[2])),
        other => panic!("{} is no solid with a closed form", other.name()),
    }
}

fn solids() -> Vec<Shape> {
    vec![
        Sphere { radius: 0.4 }.into(),
        Capsule { radius: 0.2, half_length: 0.3 }.into(),
        Ellipsoid { radii: [0.1, 0.3, 0.5] }.into(),
        Cylinder { radius: 0.25, half_length: 0.4 }.into(),
        Box { half: [0.1, 0.3, 0.4] }.into(),
    ]
}

/// From 20 m away and from inside: the hit is on the surface, no point before it is on the other side, and the normal
/// is the gradient of the distance.
#[test]
fn surfaces() {
    let mut rng = TestRng(1);
    for shape in solids() {
        let (name, mut hits, mut worst) = (shape.name(), 0, 0.0f64);
        for k in 0..20_000 {
            let (far, near) = if k % 2 == 0 { (20.0, 0.5) } else { (0.4, 1.0) };
            let ray = rng.ray(far, near);
            let off = |t: f64| outside(&shape, ray.at(t));
            let inside = outside(&shape, ray.origin) < 0.0;
            // Only every tenth ray: this is the slow part.
            let steps = |to: f64| (0..if k % 10 > 1 { 0 } else { 400 }).map(move |s| to * (f64::from(s) + 0.5) / 400.0);
            let Some((t, normal)) = touch(shape.clone(), ray.origin, ray.direction) else {
                assert!(!inside, "{name}: a ray from inside misses the surface");
                assert!(steps(40.0).all(|t| off(t) > 0.0), "{name} is missed");
                continue;
            };
            hits += 1;
            worst = worst.max(off(t).abs());
            assert!(steps(t).all(|s| (off(s) < 1e-9) == inside || off(s).abs() < 1e-6));
            let h = 1e-6;
            let slope = [0, 1, 2].map(|axis| {
                let by = [0, 1, 2].map(|k| if k == axis { h } else { 0.0 });
                (outside(&shape, add_scaled(ray.at(t), 1.0, by)) - outside(&shape, add_scaled(ray.at(t), -1.0, by)))
                    / (2.0 * h)
            });
            // At an edge the slope is that of either face.
            let facing = dot(normal, slope).abs() / dot(slope, slope).sqrt();
            assert!((dot(normal, normal) - 1.0).abs() < 1e-12);
            if dot(slope, slope).sqrt() > 0.5 && !edge(&shape, ray.at(t)) {
                assert!(facing > 1.0 - 1e-6, "{name}: normal {normal:?}, slope {slope:?}");
            }
        }
        // 20 m in double precision is known to 4e-15; grazing rays lose half of the digits along the ray, not across.
        assert!(hits > 5000 && worst < 1e-12, "{name}: {hits}, {worst:e}");
    }
}

/// True within a few micrometers of an edge.
fn edge(shape: &Shape, [x, y, z]: [f64; 3]) -> bool {
    let near = |p: f64, h: f32| (p.abs() - f64::from(h)).abs() < 1e-5;
    match shape {
        Shape::Box(s) => {
            [near(x, s.half[0]), near(y, s.half[1]), near(z, s.half[2])].iter().filter(|n| **n).count() > 1
        }
        Shape::Cylinder(s) => near(x.hypot(y), s.radius) && near(z, s.half_length),
        _ => false,
    }
}

#[test]
fn closed_forms() {
    // A ball of 0.5 m at the offset 0.3 is hit 0.4 m before its center.
    let (t, n) = touch(Sphere { radius: 0.5 }, [0.3, 0.0, 20.0], [0.0, 0.0, -1.0]).unwrap();
    assert!((t - 19.6).abs() < 1e-13 && (n[0] - 0.6).abs() < 1e-14 && (n[2] - 0.8).abs() < 1e-13);
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let [back, left, down] = [x, y, z].map(|v| v.map(|k: f64| 0.0 - k));
    let ball = || Shape::from(Sphere { radius: 0.5 });
    let capsule = || Shape::from(Capsule { radius: 0.25, half_length: 0.5 });
    let cylinder = || Shape::from(Cylinder { radius: 0.25, half_length: 0.5 });
    let cube = || Shape::from(Box { half: [0.25, 0.5, 1.0] });
    let ellipsoid = Shape::from(Ellipsoid { radii: [0.25, 0.5, 1.0] });
    let plane = || Shape::from(Plane::INFINITE);
    for (what, shape, origin, direction, expected) in [
        ("a way out", ball(), [0.0; 3], x, Some((0.5, x))),
        ("behind", ball(), [0.0, 0.0, 2.0], z, None),
        ("capsule's end", capsule(), [0.0, 0.0, 3.0], down, Some((2.25, z))),
        ("capsule's side", capsule(), [1.0, 0.0, 0.5], back, Some((0.75, x))),
        ("cylinder's end", cylinder(), [0.1, 0.0, 3.0], down, Some((2.5, z))),
        ("cylinder's side", cylinder(), [0.0, 2.0, 0.4], left, Some((1.75, y))),
        ("beside", cylinder(), [0.26, 0.0, 3.0], down, None),
        ("along an edge", cube(), [3.0, 0.5, 1.0], back, Some((2.75, x))),
        ("inside", cube(), [0.0, 0.0, 0.5], z, Some((0.5, z))),
        ("ellipsoid", ellipsoid, [0.0, -4.0, 0.0], y, Some((3.5, left))),
        ("plane", plane(), [1e6, -1e6, 20.0], down, Some((20.0, z))),
        ("from behind", plane(), [0.0, 0.0, -1.0], z, None),
        ("along the plane", plane(), z, x, None),
        ("on the rim", Plane { half: [0.5, 0.0] }.into(), [0.5, 1e3, 1.0], down, Some((1.0, z))),
        ("beside the rim", Plane { half: [0.5, 0.0] }.into(), [0.51, 0.0, 1.0], down, None),
    ] {
        assert_eq!(touch(shape, origin, direction), expected, "{what}");
    }
    assert_eq!(touch(plane(), [0.0, 0.0, 0.0], down).unwrap().0.to_bits(), 0, "on the plane: +0");
}
