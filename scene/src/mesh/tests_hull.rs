//! Tests of convex hulls against closed forms and brute force.

use std::collections::HashSet;
use std::f64::consts::PI;

use super::super::HullError;
use super::*;
use crate::mesh::tests_robots::{TestRng, files, load_of};

/// Largest distance of any of `points` in front of any face. Blocks of points whose box is behind the farthest point so
/// far are skipped; 1e-9 of the size of a box is far more than rounding.
fn outside(hull: &TriMesh, points: &[[f32; 3]]) -> f64 {
    let blocks: Vec<_> = points
        .chunks(64)
        .map(|block| {
            let [low, high] =
                [f32::min, f32::max].map(|of| block.iter().fold(block[0], |m, p| [0, 1, 2].map(|k| of(m[k], p[k]))));
            let [low, high] = [low, high].map(|corner| corner.map(f64::from));
            let half = sub(high, low).map(|x| 0.5 * x + 1e-9 * (1.0 + x));
            (block, [0, 1, 2].map(|k| 0.5 * (low[k] + high[k])), half)
        })
        .collect();
    let mut worst = f64::NEG_INFINITY;
    for triangle in &hull.triangles {
        let [a, b, c] = triangle.map(|i| hull.positions[i as usize].map(f64::from));
        let n = cross(sub(b, a), sub(c, a));
        let length = norm(n);
        assert!(length > 0.0, "a face has no area");
        for (block, middle, half) in &blocks {
            let farthest = (dot(n, sub(*middle, a)) + dot(n.map(f64::abs), *half)) / length;
            if farthest > worst {
                worst = block.iter().fold(worst, |w, &p| w.max(dot(n, sub(p.map(f64::from), a)) / length));
            }
        }
    }
    worst
}

/// Asserts that a hull is closed, oriented, connected (Euler), convex and outward-facing, and that it contains all
/// points unless its number of vertices was limited.
fn verify(points: &[[f32; 3]], cfg: &HullCfg) -> TriMesh {
    let hull = convex_hull(points, cfg).unwrap();
    hull.validate().unwrap();
    assert_eq!(convex_hull(points, cfg).unwrap(), hull, "the hull must be deterministic");
    let edges: HashSet<(u32, u32)> = hull.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
    assert_eq!(edges.len(), 3 * hull.triangles.len(), "an edge is used twice in one direction");
    assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "not closed");
    let used: HashSet<u32> = hull.triangles.iter().flatten().copied().collect();
    assert_eq!(used.len(), hull.positions.len());
    assert_eq!(hull.positions.len() + hull.triangles.len(), edges.len() / 2 + 2, "Euler");
    assert!(hull.positions.len() <= cfg.max_vertices);
    assert!(hull.signed_volume() > 0.0, "inside out");
    let diagonal = diagonal(&points.iter().map(|p| p.map(f64::from)).collect::<Vec<_>>());
    let convexity = outside(&hull, &hull.positions);
    assert!(convexity <= 2e-7 * diagonal, "a vertex is {:e} of the diagonal outside", convexity / diagonal);
    let worst = outside(&hull, points) / diagonal;
    let bounded = hull.positions.len() == cfg.max_vertices;
    assert!(bounded || worst <= cfg.tolerance + 2e-7, "a point is {worst:e} of the diagonal outside");
    hull
}

fn unbounded(tolerance: f64) -> HullCfg {
    HullCfg { max_vertices: usize::MAX, tolerance, min_thickness: None }
}

fn cube_grid(n: u8) -> Vec<[f32; 3]> {
    let axis = || (0..=n).map(move |i| f32::from(i) / f32::from(n));
    axis().flat_map(|x| axis().flat_map(move |y| axis().map(move |z| [x, y, z]))).collect()
}

#[test]
fn cubes() {
    for n in [1, 2, 5] {
        let mut points = cube_grid(n);
        points.extend(points.clone());
        points.reverse();
        for tolerance in [1e-4, 0.0] {
            let hull = verify(&points, &unbounded(tolerance));
            assert_eq!((hull.positions.len(), hull.triangles.len()), (8, 12));
            assert!((hull.signed_volume() - 1.0).abs() < 1e-12);
        }
    }
    let four = HullCfg { max_vertices: 4, ..HullCfg::default() };
    assert_eq!(verify(&cube_grid(3), &four).triangles.len(), 4);
}

#[test]
fn random_clouds() {
    let mut random = TestRng(7);
    for round in 0..200 {
        let n = 4 + round;
        let stretch = [1.0, random.unit() as f32 + 0.1, [1.0, 0.01, 10.0][round % 3]];
        let far = [0.0, 5.0, -300.0][round % 3] as f32;
        let mut point = || std::array::from_fn(|i| (random.unit() as f32 - 0.5) * stretch[i] + far);
        let points: Vec<[f32; 3]> = (0..n).map(|_| point()).collect();
        verify(&points, &unbounded(0.0));
        verify(&points, &unbounded(1e-3));
        verify(&points, &HullCfg { max_vertices: 12, ..HullCfg::default() });
    }
}

#[test]
fn grids_and_snapped_clouds() {
    // Many points nearly, but not exactly, in the planes and lines of the hull.
    let mut random = TestRng(11);
    for _ in 0..40 {
        let pose = crate::pose::from_xyz_rpy([1.0, 2.0, 3.0], [random.unit() * 6.0, random.unit() * 6.0, 0.3]);
        let turn = |p: &[f32; 3]| {
            let p = pose * nalgebra::Point3::from(p.map(f64::from));
            [p.x as f32, p.y as f32, p.z as f32]
        };
        let grid: Vec<[f32; 3]> = cube_grid(6).iter().map(turn).collect();
        let hull = verify(&grid, &unbounded(1e-4));
        assert!((hull.signed_volume() - 1.0).abs() < 1e-3);
        verify(&grid, &unbounded(0.0));
        let snapped: Vec<[f32; 3]> =
            (0..400).map(|_| std::array::from_fn(|_| ((random.unit() * 8.0).floor() / 8.0) as f32)).collect();
        verify(&snapped, &unbounded(0.0));
        verify(&snapped.iter().map(turn).collect::<Vec<_>>(), &unbounded(0.0));
    }
}

#[test]
fn spheres_and_cylinders() {
    let mut random = TestRng(3);
    let sphere: Vec<[f32; 3]> = (0..5000)
        .map(|_| {
            let (z, angle) = (random.unit() * 2.0 - 1.0, random.unit() * 2.0 * PI);
            let r = (1.0 - z * z).sqrt();
            [r * angle.cos(), r * angle.sin(), z].map(|x| x as f32)
        })
        .collect();
    let whole = 4.0 / 3.0 * PI;
    let all = verify(&sphere, &unbounded(0.0));
    assert_eq!(all.positions.len(), 5000);
    let volume = all.signed_volume() / whole;
    assert!((0.997..1.0).contains(&volume), "{volume}");
    let few = verify(&sphere, &HullCfg::default());
    assert_eq!(few.positions.len(), 64);
    let volume = few.signed_volume() / whole;
    assert!((0.88..0.93).contains(&volume), "{volume}");

    let cylinder: Vec<[f32; 3]> = (0..720)
        .map(|i| {
            let angle = f64::from(i / 2) * PI / 180.0;
            [0.1 * angle.cos(), 0.1 * angle.sin(), f64::from(i % 2) * 0.3].map(|x| x as f32)
        })
        .collect();
    let volume = verify(&cylinder, &unbounded(0.0)).signed_volume();
    // A prism over a polygon of 360 corners.
    let exact = 0.3 * 0.01 * 180.0 * (PI / 180.0).sin();
    assert!((volume / exact - 1.0).abs() < 1e-5, "{volume} {exact}");
    let volume = verify(&cylinder, &HullCfg::default()).signed_volume();
    assert!(volume / exact > 0.98, "{}", volume / exact);
}

#[test]
fn thin_plates() {
    let mut random = TestRng(5);
    let mut plate = |thickness: f64| -> Vec<[f32; 3]> {
        (0..500)
            .map(|i| {
                let (x, y) = (random.unit(), random.unit() * 0.5);
                let z = if i % 2 == 0 { 0.0 } else { thickness };
                // Tilted, so that no axis is special.
                [0.8 * x - 0.6 * z, y, 0.6 * x + 0.8 * z].map(|x| x as f32)
            })
            .collect()
    };
    let hull = verify(&plate(1e-3), &unbounded(1e-4));
    assert!((hull.signed_volume() / 0.5e-3 - 1.0).abs() < 0.1);
    verify(&plate(1e-5), &unbounded(0.0));

    // Thinner than the tolerance: thickened to a millimeter, or rejected.
    let flat = plate(0.0);
    let hull = convex_hull(&flat, &HullCfg::default()).unwrap();
    let convexity = outside(&hull, &hull.positions);
    // Narrow faces magnify grid steps.
    assert!(convexity < 1e-5, "{convexity:e}");
    assert!((hull.signed_volume() / 0.5e-3 - 1.0).abs() < 0.05, "{}", hull.signed_volume());
    assert!(hull.positions.len() <= 64);
    let never = HullCfg { min_thickness: None, ..HullCfg::default() };
    assert!(matches!(convex_hull(&flat, &never), Err(HullError::Coplanar { .. })));
    // A square of four points, and a plate so large that its tolerance exceeds the thickness.
    for side in [0.1f32, 200.0] {
        let square = [[0., 0., 1.], [side, 0., 1.], [0., side, 1.], [side, side, 1.]];
        let hull = convex_hull(&square, &HullCfg::default()).unwrap();
        assert_eq!((hull.positions.len(), hull.triangles.len()), (8, 12));
        assert!((hull.signed_volume() / f64::from(side * side) - 1e-3).abs() < 1e-6);
        let (lo, hi) = hull.bounds().unwrap();
        assert!((lo[2] - 0.9995).abs() < 1e-6 && (hi[2] - 1.0005).abs() < 1e-6);
    }
}

#[test]
fn refusals() {
    let cfg = HullCfg::default();
    let line: Vec<[f32; 3]> = (0..9u8).map(|i| [f32::from(i), 2.0 * f32::from(i), 1.0]).collect();
    assert!(matches!(convex_hull(&line, &cfg), Err(HullError::Collinear { .. })));
    assert_eq!(convex_hull(&line[..3], &cfg), Err(HullError::TooFewPoints { found: 3 }));
    assert_eq!(convex_hull(&[], &cfg), Err(HullError::TooFewPoints { found: 0 }));
    assert_eq!(convex_hull(&[[1., 2., 3.]; 9], &cfg), Err(HullError::Coincident { count: 9 }));
    let mut broken = line.clone();
    broken[4][2] = f32::NAN;
    assert!(matches!(convex_hull(&broken, &cfg), Err(HullError::NonFinite { index: 4, .. })));
    for cfg in [
        HullCfg { max_vertices: 3, ..cfg },
        HullCfg { tolerance: f64::NAN, ..cfg },
        HullCfg { min_thickness: Some(0.0), ..cfg },
    ] {
        assert!(matches!(convex_hull(&line, &cfg), Err(HullError::InvalidCfg { .. })));
    }
    // The largest finite numbers do not overflow.
    let huge = [[f32::MAX, 0., 0.], [-f32::MAX, 0., 0.], [0., f32::MAX, 0.], [0., 0., f32::MAX]];
    assert_eq!(convex_hull(&huge, &cfg).unwrap().triangles.len(), 4);
    let tiny = huge.map(|p| p.map(|x| x / f32::MAX * 1e-30));
    assert_eq!(convex_hull(&tiny, &cfg).unwrap().triangles.len(), 4);
}

/// Volumes of the exact hulls by Qhull (SciPy), in cubed units of the files.
const QHULL: [(&str, f64); 11] = [
    ("xMateSR5_base.stl", 2084907.3686896092),
    ("xMateSR5_link1.stl", 3202154.612781883),
    ("xMateSR5_link2.stl", 6239010.314075107),
    ("xMateSR5_link3.stl", 2404888.2176812566),
    ("xMateSR5_link4.stl", 2312485.9749916056),
    ("xMateSR5_link5.stl", 1278818.1190475086),
    ("xMateSR5_link6.stl", 203843.3775964416),
    ("L_hand_base_link.STL", 0.0003607119482044198),
    ("Link11_L.STL", 3.1428749295468436e-06),
    ("Link12_L.STL", 2.963200072253098e-05),
    ("Link14_L.STL", 4.12489872072844e-06),
];

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_meshes() {
    let files = files("stl");
    for (name, volume) in QHULL {
        let points = load_of(&files, name).positions;
        let share = |cfg| verify(&points, &cfg).signed_volume() / volume;
        let (few, all, exact) = (share(HullCfg::default()), share(unbounded(1e-4)), share(unbounded(0.0)));
        assert!((exact - 1.0).abs() < 1e-6, "{name}: {exact}");
        assert!(few > 0.93 && few < 1.0 + 1e-9 && all > 0.998, "{name}: {few} {all}");
    }
}
