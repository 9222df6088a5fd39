//! The judges: every triangle, by the textbook formula in double precision and by the watertight test.

use super::Dice;
use crate::ray::Ray;
use crate::ray::triangle::{Shear, Triangle};
use crate::ray::vector::{V3, cross, dot, sub, to_f64, unit};

/// Distance of a triangle along a ray, from either side. Source: Möller, Trumbore: Fast, minimum storage ray/triangle
/// intersection, 1997. `slack` widens the triangle.
pub(super) fn moeller_trumbore(ray: &Ray, triangle: &Triangle, slack: f64) -> Option<f64> {
    let [a, b, c] = triangle.map(to_f64);
    let (ab, ac) = (sub(b, a), sub(c, a));
    let p = cross(ray.direction, ac);
    let det = dot(ab, p);
    if det == 0.0 {
        return None;
    }
    let from = sub(ray.origin, a);
    let u = dot(from, p) / det;
    let q = cross(from, ab);
    let v = dot(ray.direction, q) / det;
    let t = dot(ac, q) / det;
    (u >= -slack && v >= -slack && u + v <= 1.0 + slack && t >= 0.0).then_some(t)
}

/// The nearest triangle.
pub(super) fn nearest(ray: &Ray, triangles: &[Triangle], slack: f64) -> Option<f64> {
    triangles.iter().filter_map(|t| moeller_trumbore(ray, t, slack)).min_by(f64::total_cmp)
}

/// The same with the watertight test.
pub(super) fn nearest_watertight(ray: &Ray, triangles: &[Triangle]) -> Option<f64> {
    let shear = Shear::new(ray);
    triangles.iter().filter_map(|t| shear.distance(t)).filter(|t| *t >= 0.0).min_by(f64::total_cmp)
}

/// Triangles of all sizes, some of them slivers.
pub(super) fn soup(dice: &mut Dice, count: usize, at: V3) -> Vec<Triangle> {
    let mut triangle = || {
        let middle = dice.point(1.0);
        let size = 10f64.powf(dice.number(-3.0, -0.3));
        let squeeze = [0; 3].map(|_| if dice.number(0.0, 1.0) < 0.2 { 1e-3 } else { 1.0 });
        [0; 3].map(|_| {
            let p = dice.point(size);
            [0, 1, 2].map(|k| (at[k] + middle[k] + p[k] * squeeze[k]) as f32)
        })
    };
    (0..count).map(|_| triangle()).collect()
}

/// A triangle is hit by the textbook formula where the watertight test hits it, at the same distance.
#[test]
fn watertight_and_textbook() {
    let mut dice = Dice(3);
    let triangles = soup(&mut dice, 400, [0.0; 3]);
    let (mut hits, mut worst) = (0, 0.0f64);
    for _ in 0..2000 {
        let ray = dice.ray(20.0, 1.0);
        for triangle in &triangles {
            let ours = Shear::new(&ray).distance(triangle).filter(|t| *t >= 0.0);
            // Within 1e-9 of an edge, or nearly edge-on, rounding may decide differently.
            let [wide, narrow] = [1e-9, -1e-9].map(|slack| moeller_trumbore(&ray, triangle, slack));
            assert!(ours.is_none() || wide.is_some(), "a hit that is none");
            assert!(ours.is_some() || narrow.is_none(), "a miss that is none");
            if let (Some(t), Some(u)) = (ours, narrow) {
                (hits, worst) = (hits + 1, worst.max((t - u).abs()));
            }
        }
    }
    // Slivers squeezed to a thousandth, of a millimetre's size, seen from 20 m lose some digits in the textbook formula.
    assert!(hits > 500 && worst < 1e-7, "{hits} hits, {worst:e}");
}

/// Rays along edges and through corners of a closed surface always hit it; with the textbook formula some slip through.
#[test]
fn edges() {
    let mut dice = Dice(4);
    // A tetrahedron with coordinates that are not round.
    let corner = [[-0.13f32, -0.37, -0.21], [0.71, -0.11, -0.17], [0.05, 0.53, -0.31], [0.11, 0.07, 0.59]];
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let triangles: Vec<Triangle> = faces.iter().map(|f: &[usize; 3]| f.map(|i| corner[i])).collect();
    let mut slipped = 0;
    for _ in 0..20_000 {
        let (i, j) = (dice.number(0.0, 4.0) as usize, dice.number(0.0, 4.0) as usize);
        let part = dice.number(0.0, 1.0);
        let on_edge = [0, 1, 2].map(|k| f64::from(corner[i][k]) * part + f64::from(corner[j][k]) * (1.0 - part));
        // From the middle of the solid outwards: every ray must hit.
        let origin = [0.185, 0.03, -0.025];
        let ray = Ray { origin, direction: unit(sub(on_edge, origin)).unwrap() };
        assert!(nearest_watertight(&ray, &triangles).is_some(), "{ray:?} got out");
        slipped += usize::from(nearest(&ray, &triangles, 0.0).is_none());
    }
    assert!(slipped > 0, "the control: edges are hit so exactly that the textbook formula misses some");
}
