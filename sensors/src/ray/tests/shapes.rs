//! Shapes against closed forms.

use crate::ray::bvh::Stack;
use crate::ray::shape::Solid;
use crate::ray::{Assets, Ray};
use scene::Shape;
use scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere};

fn touch(shape: impl Into<Shape>, origin: [f64; 3], direction: [f64; 3]) -> Option<(f64, [f64; 3])> {
    let direction = crate::ray::vector::unit(direction).unwrap();
    let solid = Solid::of(&shape.into(), &mut Assets::default());
    solid.touch(&Ray { origin, direction }, f64::INFINITY, &mut Stack::default()).map(|t| (t.t, t.normal))
}

#[test]
fn closed_forms() {
    // A ball of 0.5 m at the offset 0.3 is met 0.4 m before its middle.
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
