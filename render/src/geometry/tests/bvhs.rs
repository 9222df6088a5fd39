//! Triangles and their BVHs compared with brute force, by the textbook formula in double precision and by the
//! watertight test.

use super::TestRng;
use crate::geometry::bvh::{Bvh, BvhBuilder, TraversalStack};
use crate::geometry::shape::RayShape;
use crate::geometry::shape::mesh::{Mesh, MeshBuilder, MeshBvh};
use crate::geometry::triangle::{ShearedRay, Triangle, normal};
use crate::simd::all_levels;
use kinetoscope_scene::Ray;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::vector::{V3, cross, dot, normalize, sub, to_f64};
use std::sync::Arc;

/// Distance of a triangle along a ray, from either side. `slack` widens the triangle. Source: Möller, Trumbore: Fast,
/// minimum storage ray/triangle intersection, 1997.
fn moeller_trumbore(ray: &Ray, triangle: &Triangle, slack: f64) -> Option<f64> {
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

/// Distance of the nearest triangle by the textbook formula.
pub(super) fn nearest(ray: &Ray, triangles: &[Triangle], slack: f64) -> Option<f64> {
    triangles.iter().filter_map(|t| moeller_trumbore(ray, t, slack)).min_by(f64::total_cmp)
}

/// Distance of the nearest triangle by the watertight test.
fn nearest_watertight(ray: &Ray, triangles: &[Triangle]) -> Option<f64> {
    let shear = ShearedRay::new(ray);
    triangles.iter().filter_map(|t| shear.distance(t)).filter(|t| *t >= 0.0).min_by(f64::total_cmp)
}

/// Triangles of all sizes, some of them slivers.
pub(super) fn soup(rng: &mut TestRng, count: usize, at: V3) -> Vec<Triangle> {
    let mut triangle = || {
        let middle = rng.point(1.0);
        let size = 10f64.powf(rng.uniform(-3.0, -0.3));
        let squeeze = [0; 3].map(|_| if rng.uniform(0.0, 1.0) < 0.2 { 1e-3 } else { 1.0 });
        [0; 3].map(|_| {
            let p = rng.point(size);
            [0, 1, 2].map(|k| (at[k] + middle[k] + p[k] * squeeze[k]) as f32)
        })
    };
    (0..count).map(|_| triangle()).collect()
}

/// The textbook formula and the watertight test agree on hits and distances.
#[test]
fn watertight_and_textbook() {
    let mut rng = TestRng(3);
    let triangles = soup(&mut rng, 400, [0.0; 3]);
    let (mut hits, mut worst) = (0, 0.0f64);
    for _ in 0..2000 {
        let ray = rng.ray(20.0, 1.0);
        for triangle in &triangles {
            let ours = ShearedRay::new(&ray).distance(triangle).filter(|t| *t >= 0.0);
            // Within 1e-9 of an edge, or nearly edge-on, rounding may decide differently.
            let [wide, narrow] = [1e-9, -1e-9].map(|slack| moeller_trumbore(&ray, triangle, slack));
            assert!(ours.is_none() || wide.is_some(), "a false hit");
            assert!(ours.is_some() || narrow.is_none(), "a false miss");
            if let (Some(t), Some(u)) = (ours, narrow) {
                (hits, worst) = (hits + 1, worst.max((t - u).abs()));
            }
        }
    }
    // Slivers squeezed to a thousandth, of a millimeter's size, seen from 20 m lose some digits in the textbook
    // formula.
    assert!(hits > 500 && worst < 1e-7, "{hits} hits, {worst:e}");
}

/// Rays along edges and through corners of a closed surface always hit it; with the textbook formula some slip through.
#[test]
fn edges() {
    let mut rng = TestRng(4);
    // A tetrahedron with coordinates that are not round.
    let corner = [[-0.13f32, -0.37, -0.21], [0.71, -0.11, -0.17], [0.05, 0.53, -0.31], [0.11, 0.07, 0.59]];
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let triangles: Vec<Triangle> = faces.iter().map(|f: &[usize; 3]| f.map(|i| corner[i])).collect();
    let mut slipped = 0;
    for _ in 0..20_000 {
        let (i, j) = (rng.uniform(0.0, 4.0) as usize, rng.uniform(0.0, 4.0) as usize);
        let part = rng.uniform(0.0, 1.0);
        let on_edge = [0, 1, 2].map(|k| f64::from(corner[i][k]) * part + f64::from(corner[j][k]) * (1.0 - part));
        // From the center of the solid outwards: every ray must hit.
        let origin = [0.185, 0.03, -0.025];
        let ray = Ray { origin, direction: normalize(sub(on_edge, origin)).unwrap() };
        assert!(nearest_watertight(&ray, &triangles).is_some(), "{ray:?} passed through the closed mesh");
        slipped += usize::from(nearest(&ray, &triangles, 0.0).is_none());
    }
    assert!(slipped > 0, "the control: edges are hit so exactly that the textbook formula misses some");
}

fn mesh_of(triangles: &[Triangle]) -> Mesh {
    Mesh::from_bvh(Arc::new(MeshBvh::from_triangles(triangles)))
}

fn distance(mesh: &Mesh, ray: &Ray, limit: f64) -> Option<f64> {
    mesh.intersect(ray, limit, &mut TraversalStack::default()).map(|t| t.t)
}

/// The BVH equals brute force on every ray, to the bit.
#[test]
fn brute_force() {
    for (seed, count, at) in [(1, 1, 0.0), (2, 7, 0.0), (3, 300, 0.0), (4, 2000, 0.0), (5, 500, 1000.0), (6, 500, -3e4)]
    {
        let mut rng = TestRng(seed);
        let triangles = soup(&mut rng, count, [at; 3]);
        let mesh = mesh_of(&triangles);
        let (mut hits, mut worst) = (0, 0.0f64);
        for k in 0..3000 {
            let mut ray = rng.ray(if k % 3 == 0 { 20.0 } else { 1.5 }, 1.0);
            if k % 5 == 0 {
                // Along an axis, where two of three sides of a box are parallel to the ray.
                ray.direction = [0, 1, 2].map(|a| if a == k % 3 { if k % 2 == 0 { 1.0 } else { -1.0 } } else { 0.0 });
            }
            ray.origin = ray.origin.map(|x| x + at);
            let ours = distance(&mesh, &ray, f64::INFINITY);
            assert_eq!(ours, nearest_watertight(&ray, &triangles), "seed {seed}, ray {k}");
            if let (Some(t), Some(u)) = (ours, nearest(&ray, &triangles, 0.0)) {
                hits += 1;
                worst = worst.max((t - u).abs());
            }
        }
        assert!(hits > 0 || count < 8);
        // Coordinates of 3e4 m have 7e-12 m between doubles, slivers magnify that.
        assert!(worst < 1e-7 * (1.0 + at.abs() / 10.0), "{worst:e}");
    }
}

/// The control: a BVH without one of its triangles gives a different result.
#[test]
fn lost_triangle() {
    let mut rng = TestRng(7);
    let triangles = soup(&mut rng, 50, [0.0; 3]);
    let mesh = mesh_of(&triangles[1..]);
    let [a, b, c] = triangles[0].map(|p| p.map(f64::from));
    let middle = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
    let n = normal(&triangles[0]).unwrap();
    let ray = Ray { origin: kinetoscope_scene::vector::add_scaled(middle, 1e-4, n), direction: n.map(|x| -x) };
    assert!(nearest_watertight(&ray, &triangles).is_some_and(|t| (t - 1e-4).abs() < 1e-6));
    assert_ne!(distance(&mesh, &ray, f64::INFINITY), nearest_watertight(&ray, &triangles));
}

#[test]
fn limits() {
    let square = [[[-1., -1., 0.], [1., -1., 0.], [1., 1., 0.]], [[-1., -1., 0.], [1., 1., 0.], [-1., 1., 0.]]];
    let mesh = mesh_of(&square);
    let ray = Ray { origin: [0.25, 0.25, 20.0], direction: [0.0, 0.0, -1.0] };
    assert_eq!(distance(&mesh, &ray, 20.0), Some(20.0), "on the edge between the two");
    assert_eq!(distance(&mesh, &ray, 20.0f64.next_down()), None);
    let below = Ray { origin: [0.5, 0.25, -3.0], direction: [0.0, 0.0, 1.0] };
    assert_eq!(distance(&mesh, &below, 100.0), Some(3.0), "from behind too");
}

#[test]
fn degenerate() {
    let nothing = mesh_of(&[]);
    let ray = Ray { origin: [0.0, 0.0, 1.0], direction: [0.0, 0.0, -1.0] };
    assert_eq!(distance(&nothing, &ray, 10.0), None);
    assert_eq!(nothing.bounds(), [[0.0; 3]; 2]);
    // Triangles without an area are left out; the others are hit.
    let flat = [[0u32, 0, 1], [0, 1, 1], [0, 1, 2]];
    let mesh = TriMesh::from_triangles(vec![[-1., -1., 0.], [1., -1., 0.], [0., 2., 0.]], flat.to_vec());
    let built = Mesh::from_bvh(Arc::new(MeshBuilder::default().build(&RenderMesh::new(&mesh, 0.5))));
    assert_eq!(distance(&built, &ray, 10.0), Some(1.0));
    // All at one place: no plane separates them.
    let same = vec![[[0.0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.]]; 1000];
    let ray = Ray { origin: [0.2, 0.2, 1.0], direction: [0.0, 0.0, -1.0] };
    assert_eq!(distance(&mesh_of(&same), &ray, 10.0), Some(1.0));
    // Sizes over forty orders of magnitude: the BVH gets deep, not endless.
    let nested: Vec<Triangle> = (0..2000)
        .map(|k| 10f32.powf(k as f32 / 50.0 - 20.0))
        .map(|s| [[s, 0.0, s], [2.0 * s, 0.0, s], [s, s, s]])
        .collect();
    let ray = Ray { origin: [1.2, 0.1, 30.0], direction: [0.0, 0.0, -1.0] };
    assert_eq!(distance(&mesh_of(&nested), &ray, 100.0), nearest_watertight(&ray, &nested));
}

/// The same boxes give the same BVH, after other builds and with every instruction set; also for sizes beyond the
/// range.
#[test]
fn same_bvh() {
    let boxes = |count, scale: f32| -> Vec<_> {
        soup(&mut TestRng(9), count, [0.0; 3])
            .iter()
            .map(|t| t.map(|p| p.map(|x| x * scale)))
            .map(|t| [[0, 1, 2].map(|k| t[0][k].min(t[1][k])), [0, 1, 2].map(|k| t[0][k].max(t[1][k]))])
            .collect()
    };
    let all: Vec<Vec<_>> =
        [(500, 1.0), (3, 1.0), (0, 1.0), (3000, 1e-20), (700, 1e37)].map(|(n, s)| boxes(n, s)).into();
    for (known, boxes) in all.iter().enumerate() {
        let (tree, mut order) = Bvh::build(boxes.iter().copied());
        for level in all_levels() {
            let mut builder = BvhBuilder::new(level);
            for before in &all[..known] {
                builder.build(before.iter().copied());
            }
            let again = builder.build(boxes.iter().copied());
            assert_eq!(format!("{:?}", (&tree, &order)), format!("{again:?}"), "{level:?}");
        }
        order.sort_unstable();
        assert!(order.into_iter().eq(0..boxes.len() as u32), "each box is in exactly one leaf");
    }
}

/// A tessellated shape is hit at the shape's surface, up to the flatness of its triangles.
#[test]
fn tessellated_ball() {
    let ball = Shape::from(kinetoscope_scene::shape::Sphere { radius: 0.5 }).tessellate(256);
    let mesh = Mesh::from_bvh(Arc::new(
        MeshBuilder::default().build(&RenderMesh::new(&ball, RenderMesh::DEFAULT_CREASE_ANGLE)),
    ));
    // The sagitta of 1/256 of a turn.
    let flat = 0.5 * (1.0 - (std::f64::consts::PI / 256.0).cos()) * 2.0;
    for k in 0..100 {
        let x = f64::from(k) / 101.0 * 0.4;
        let ray = Ray { origin: [x, 0.1, 20.0], direction: [0.0, 0.0, -1.0] };
        let exact = 20.0 - (0.25 - x * x - 0.01f64).sqrt();
        let t = distance(&mesh, &ray, f64::INFINITY).unwrap();
        assert!(t - exact < 3.0 * flat && t > exact - 1e-6, "{t} {exact}");
    }
}
