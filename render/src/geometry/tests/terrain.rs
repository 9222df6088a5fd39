//! The walk over a grid finds the same hits as brute force over the triangles of the same field.

use super::TestRng;
use super::bvhs::nearest;
use crate::geometry::assets::AssetCache;
use crate::geometry::bvh::TraversalStack;
use crate::geometry::shape::RayGeometry;
use crate::geometry::shape::height_field::HeightGrid;
use crate::geometry::triangle::Triangle;
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::HeightField;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::vector::normalize;

/// The field's triangles. Grid points are a quarter of a meter apart; rounding to single precision is undone.
fn triangles(field: &HeightField) -> Vec<Triangle> {
    let mesh = field.mesh();
    let half = field.size();
    let snap = |p: [f32; 3]| {
        let snap = |x: f32, half: f64| (((f64::from(x) + half) * 4.0).round() / 4.0 - half) as f32;
        [snap(p[0], half[0]), snap(p[1], half[1]), p[2]]
    };
    mesh.triangles().iter().map(|t| t.map(|i| snap(mesh.positions()[i as usize]))).collect()
}

fn solid(field: &HeightField) -> RayGeometry {
    RayGeometry::from_shape(&Shape::from(field.clone()), &mut AssetCache::default())
}

fn distance(solid: &RayGeometry, ray: &Ray) -> Option<(f64, [f64; 3])> {
    solid.intersect(ray, f64::INFINITY, &mut TraversalStack::default()).map(|t| (t.t, t.normal))
}

/// Rough terrain with coordinates that single precision represents exactly, so that triangles match the grid.
fn rough(rng: &mut TestRng, rows: usize, columns: usize) -> HeightField {
    let elevation: Vec<f32> = (0..rows * columns).map(|_| (rng.uniform(0.0, 256.0) as u32) as f32 / 256.0).collect();
    let half = |n: usize| (n - 1) as f64 / 8.0;
    HeightField::new([half(columns), half(rows), 1.5, 0.5], rows, columns, &elevation).unwrap()
}

#[test]
fn brute_force() {
    let mut rng = TestRng(11);
    for (rows, columns) in [(2, 2), (2, 9), (9, 9), (17, 33), (40, 23)] {
        let field = rough(&mut rng, rows, columns);
        let (walk, triangles) = (solid(&field), triangles(&field));
        let (mut hits, mut misses) = (0, 0);
        for k in 0..4000 {
            let mut ray = match k % 4 {
                // From far, from near, and from inside the solid or just above it.
                0 => rng.ray(20.0, 2.0),
                1 => rng.ray(4.0, 2.0),
                2 => Ray { origin: rng.point(1.0), direction: rng.direction() },
                // Grazing.
                _ => {
                    let mut ray = rng.ray(6.0, 3.0);
                    ray.origin[2] = rng.uniform(0.0, 2.0);
                    ray.direction = normalize([ray.direction[0], ray.direction[1], rng.uniform(-0.05, 0.05)]).unwrap();
                    ray
                }
            };
            if k % 7 == 0 {
                ray.direction = [0.0, 0.0, if k % 2 == 0 { -1.0 } else { 1.0 }];
            } else if k % 7 == 1 {
                ray.direction = if k % 2 == 0 { [1.0, 0.0, 0.0] } else { [0.0, -1.0, 0.0] };
            }
            let ours = distance(&walk, &ray).map(|(t, _)| t);
            // Rounding may decide either way at an edge of a wall, nowhere else.
            let (tight, wide) = (nearest(&ray, &triangles, -1e-9), nearest(&ray, &triangles, 1e-9));
            if tight.zip(wide).is_none_or(|(a, b)| (a - b).abs() > 1e-9) && (tight.is_some() || wide.is_some()) {
                let fits = |t: Option<f64>| t.zip(ours).map_or(t == ours, |(a, b)| (a - b).abs() < 1e-9);
                assert!(fits(tight) || fits(wide), "{rows}x{columns} ray {k} {ray:?}: {ours:?}, {tight:?} or {wide:?}");
                continue;
            }
            match (ours, wide) {
                (Some(a), Some(b)) => {
                    hits += 1;
                    assert!((a - b).abs() < 1e-9, "{rows}x{columns} ray {k} {ray:?}: {a}, not {b}");
                }
                (None, None) => misses += 1,
                (a, b) => panic!("{rows}x{columns} ray {k} {ray:?}: {a:?}, not {b:?}"),
            }
        }
        assert!(hits > 100 && misses > 100);
    }
}

/// The control: the triangles of other terrain give other distances.
#[test]
fn other_terrain() {
    let (a, b) = (rough(&mut TestRng(1), 9, 9), rough(&mut TestRng(2), 9, 9));
    let (walk, triangles) = (solid(&a), triangles(&b));
    let mut rng = TestRng(3);
    let differ = |ray: &Ray| match (distance(&walk, ray), nearest(ray, &triangles, 0.0)) {
        (Some((t, _)), Some(u)) => (t - u).abs() > 1e-3,
        (t, u) => t.is_some() != u.is_some(),
    };
    let differing = (0..1000).filter(|_| differ(&rng.ray(6.0, 1.0))).count();
    assert!(differing > 300, "{differing}");
}

/// Straight down on points, edges, diagonals and the rim of the grid: hits at the height interpolated from the four
/// corners.
#[test]
fn scans_from_above() {
    let field = rough(&mut TestRng(5), 17, 17);
    let (walk, e) = (solid(&field), field.elevation().clone());
    for (i, j) in (0..=64usize).flat_map(|j| (0..=64usize).map(move |i| (i, j))) {
        // Quarters of cells of 0.25 m.
        let origin = [i as f64 / 16.0 - 2.0, j as f64 / 16.0 - 2.0, 20.0];
        let (t, normal) = distance(&walk, &Ray { origin, direction: [0.0, 0.0, -1.0] }).unwrap();
        let (ci, cj) = ((i / 4).min(15), (j / 4).min(15));
        let (u, v) = ((i - 4 * ci) as f64 / 4.0, (j - 4 * cj) as f64 / 4.0);
        let at = |di: usize, dj: usize| 1.5 * f64::from(e[(cj + dj) * 17 + ci + di]);
        let (a, b, c, d) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1));
        let height = if u >= v { a + u * (b - a) + v * (d - b) } else { a + u * (d - c) + v * (c - a) };
        assert!((20.0 - t - height).abs() < 1e-13 && normal[2] > 0.0, "{i} {j}: {t}");
    }
    let beyond = Ray { origin: [2.0 + 1e-9, 0.0, 20.0], direction: [0.0, 0.0, -1.0] };
    assert_eq!(distance(&walk, &beyond), None);
}

/// Terrain at one height is a box: a wall, the floor, and from inside.
#[test]
fn level() {
    let field = HeightField::new([2.0, 1.0, 1.0, 0.5], 5, 9, &[0.75; 45]).unwrap();
    let walk = solid(&field);
    let hit = |origin: [f64; 3], direction: [f64; 3]| distance(&walk, &Ray { origin, direction });
    assert_eq!(hit([5.0, 0.3, 0.1], [-1.0, 0.0, 0.0]), Some((3.0, [1.0, 0.0, 0.0])), "a wall");
    assert_eq!(hit([5.0, 0.3, 0.8], [-1.0, 0.0, 0.0]), None, "over it");
    assert_eq!(hit([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]), Some((2.5, [0.0, 0.0, 1.0])), "the floor");
    assert_eq!(hit([0.1, 0.2, 20.0], [0.0, 0.0, -1.0]), Some((19.25, [0.0, 0.0, 1.0])), "the surface");
    assert_eq!(hit([0.1, 0.2, 0.25], [0.0, 0.0, 1.0]).unwrap().0, 0.5, "from inside, the surface");
    assert_eq!(hit([0.1, 0.2, 0.25], [0.0, 0.0, -1.0]).unwrap().0, 0.75, "from inside, the floor");
    assert_eq!(hit([0.5, 0.0, 0.25], [0.0, -1.0, 0.0]).unwrap().0, 1.0, "from inside, a wall");
}

/// Long flat rays over large terrain with a peak at (-212, 188), 2 m high, whose foot is one meter around.
#[test]
fn long_rays() {
    let n = 1025;
    let mut elevation = vec![0.0f32; n * n];
    elevation[700 * n + 300] = 1.0;
    let field = HeightField::new([512.0, 512.0, 2.0, 1.0], n, n, &elevation).unwrap();
    let walk = solid(&field);
    let hit = |origin: [f64; 3], direction: [f64; 3]| distance(&walk, &Ray { origin, direction }).map(|(t, _)| t);
    // Half way up the slope of one cell of a meter.
    for (x, expected) in [(-900.0, 900.0 - 212.0 - 0.5), (900.0, 900.0 + 212.0 - 0.5)] {
        let t = hit([x, 188.0, 1.0], [-f64::signum(x), 0.0, 0.0]).unwrap();
        assert!((t - expected).abs() < 1e-9, "{t} {expected}");
    }
    assert_eq!(hit([-900.0, 190.0, 1.0], [1.0, 0.0, 0.0]), None);
    let slanted = Ray { origin: [-1212.0, -812.0, 1.5], direction: normalize([1.0, 1.0, -1e-4]).unwrap() };
    let z = slanted.at(hit(slanted.origin, slanted.direction).unwrap())[2];
    assert!((z - z.clamp(1.0, 1.5)).abs() < 1e-12, "on the peak, not on the ground behind it");
    assert_eq!(HeightGrid::new(&field).levels(), 10);
}
