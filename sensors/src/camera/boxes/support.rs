//! How far shapes reach.

use kinetoscope_scene::Shape;

/// Smallest and largest n · p over the points p of a shape, in its own frame; infinite where the shape is.
pub(super) fn reach(shape: &Shape, n: [f64; 3]) -> [f64; 2] {
    let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let wide = |x: f32| f64::from(x);
    let most = match shape {
        Shape::Sphere(s) => wide(s.radius) * length(n),
        Shape::Capsule(s) => wide(s.radius) * length(n) + wide(s.half_length) * n[2].abs(),
        Shape::Ellipsoid(s) => length([0, 1, 2].map(|k| wide(s.radii[k]) * n[k])),
        Shape::Cylinder(s) => wide(s.radius) * n[0].hypot(n[1]) + wide(s.half_length) * n[2].abs(),
        Shape::Box(s) => (0..3).map(|k| wide(s.half[k]) * n[k].abs()).sum(),
        Shape::Plane(s) => (0..2)
            .map(|k| match wide(s.half[k]) {
                // Nothing of a direction that it does not reach in.
                _ if n[k] == 0.0 => 0.0,
                0.0 => f64::INFINITY,
                half => half * n[k].abs(),
            })
            .sum(),
        Shape::Mesh(s) => return of_points(s.mesh.positions(), n),
        Shape::HeightField(s) => return of_points(s.mesh().positions(), n),
    };
    [-most, most]
}

fn of_points(points: &[[f32; 3]], n: [f64; 3]) -> [f64; 2] {
    let along = points.iter().map(|p| (0..3).map(|k| n[k] * f64::from(p[k])).sum::<f64>());
    along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}
