//! Columns: packets of steep rays find the same hits as single rays through the BVH, to the bit.

use super::bvhs::soup;
use super::packets::{Compare, targets};
use super::{TestRng, bits};
use crate::geometry::bvh::TraversalStack;
use crate::geometry::packet::{Packet, WIDTH};
use crate::geometry::shape::mesh::columns::{Columns, are_steep};
use crate::geometry::shape::mesh::{Mesh, MeshBvh};
use crate::geometry::shape::{Intersections, RayShape, ShapeVisitor};
use crate::geometry::triangle::{ShearedPacket, ShearedRay, Triangle};
use crate::geometry::world::{RayHit, RayWorld};
use crate::simd::{Scalar, Simd, all_levels, at_level};
use kinetoscope_scene::Ray;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::vector::{add_scaled, cross, dot, normalize, scale, sub, to_f64};
use kinetoscope_scene::{PoseF64, pose};
use std::sync::Arc;

/// Axes of columns along z.
const ABOVE: [usize; 3] = [0, 1, 2];

/// Numbers of compared rays and packets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Count {
    hits: usize,
    packets: usize,
    /// Packets that used the columns.
    columns: usize,
    /// Rays whose hit differs from that of the ray alone.
    wrong: usize,
}

/// Casts packets through the mesh and through given columns, at every SIMD level, and each ray alone.
fn compare(tree: &Arc<MeshBvh>, columns: Option<&Columns>, rays: &[Ray], max_distance: f64) -> Count {
    let mesh = Mesh::from_bvh(Arc::clone(tree));
    let mut count = Count { packets: rays.len().div_ceil(WIDTH), ..Count::default() };
    Compare { rays, max_distance, what: "steep", hits: &mut count.hits }.run(&mesh);
    let Some(columns) = columns else { return count };
    for rays in rays.chunks(WIDTH) {
        let packet = Packet::from_rays(rays, max_distance);
        for (index, level) in all_levels().into_iter().enumerate() {
            let mut touches: Intersections = [None; WIDTH];
            let by_columns = at_level!(level, s => s.vectorize(#[inline(always)] || match ShearedPacket::new(s, &packet) {
                Some(shear) if are_steep(s, &shear) && columns.axes() == shear.axes() => {
                    columns.intersect_packet(s, tree, &packet, &shear, &mut touches)
                }
                _ => false,
            }));
            if by_columns {
                count.columns += usize::from(index == 0);
                let alone = |ray: &Ray| mesh.intersect(ray, max_distance, &mut TraversalStack::default());
                let alone = |k: usize| rays.get(k).filter(|ray| ray.is_finite()).and_then(alone);
                count.wrong += (0..WIDTH).filter(|&k| bits(&alone(k)) != bits(&touches[k])).count();
            }
        }
    }
    count
}

/// Packets of steep rays towards about `at`, from above and from below: along z on a grid of eighths, with exact hits
/// of edges and corners; along z anywhere; parallel ones; fans to points of the grid; from within; and some that are
/// not steep.
fn steep(rng: &mut TestRng, at: [f64; 3]) -> Vec<Ray> {
    let mut rays = Vec::new();
    for kind in 0..240 {
        let sign = if kind % 2 == 0 { -1.0 } else { 1.0 };
        let eighth = |x: f64| (8.0 * x).round() / 8.0;
        let first = rng.point(1.0);
        let slope = [0; 2].map(|_| rng.uniform(-0.125, 0.125) * if kind % 12 == 2 { 2.0 } else { 0.9 });
        let slanted = normalize([slope[0], slope[1], sign]).unwrap();
        let far = if kind % 5 == 0 { 0.2 } else { 10f64.powf(rng.uniform(0.3, 2.0)) };
        for k in 0..WIDTH {
            let grid = [eighth(first[0]) + 0.125 * (k % 4) as f64, eighth(first[1]) + 0.125 * (k / 4) as f64];
            let near = add_scaled(first, 0.3, rng.point(1.0));
            let (to, direction) = match kind % 6 {
                0 => ([grid[0], grid[1], 0.0], [0.0, 0.0, sign]),
                1 => (near, [0.0, -0.0, sign]),
                2 => (near, slanted),
                3 => ([grid[0], grid[1], eighth(first[2])], slanted),
                4 => (near, normalize([rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), sign]).unwrap()),
                _ => {
                    let from = [first[0], first[1], -9.0 * sign];
                    ([grid[0], grid[1], 0.0], normalize(sub([grid[0], grid[1], 0.0], from)).unwrap())
                }
            };
            let mut ray = Ray { origin: add_scaled(add_scaled(to, -far, direction), 1.0, at), direction };
            if rng.uniform(0.0, 1.0) < 0.01 {
                ray.origin[k % 3] = f64::NAN;
            }
            rays.push(ray);
        }
    }
    rays
}

/// A height field of triangles: cells of an eighth around the origin, two triangles each, heights in sixty-fourths.
fn sheet(rng: &mut TestRng, side: usize, height: f64) -> Vec<Triangle> {
    let heights: Vec<f32> =
        (0..side * side).map(|_| (height + f64::from(rng.uniform(0.0, 16.0) as u8) / 64.0) as f32).collect();
    let half = (side - 1) as f32 / 16.0;
    let point = |i: usize, j: usize| [i as f32 / 8.0 - half, j as f32 / 8.0 - half, heights[j * side + i]];
    let cell = |i: usize, j: usize| {
        let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i, j + 1), point(i + 1, j + 1)];
        [[a, b, d], [a, d, c]]
    };
    let cells = (0..side - 1).flat_map(|j| (0..side - 1).map(move |i| (i, j)));
    cells.flat_map(|(i, j)| cell(i, j)).collect()
}

/// Permutes the coordinates x, y, z to the given axes.
fn permuted<T: Copy>(p: [T; 3], axes: [usize; 3]) -> [T; 3] {
    let mut to = p;
    axes.into_iter().zip(p).for_each(|(axis, x)| to[axis] = x);
    to
}

fn moved(triangles: &[Triangle], by: f32) -> Vec<Triangle> {
    triangles.iter().map(|t| t.map(|p| p.map(|x| x + by))).collect()
}

#[test]
fn steep_rays() {
    let mut rng = TestRng(51);
    let ground = sheet(&mut rng, 25, 0.0);
    // All triangles twice: of equally near ones the first counts.
    let twice: Vec<Triangle> = ground.iter().chain(&ground).copied().collect();
    let layers: Vec<Triangle> = (0..4).flat_map(|k| sheet(&mut rng, 25, 0.3 * f64::from(k) - 0.9)).collect();
    let rotated = ground.iter().map(|t| t.map(|p| [0.8 * p[0] - 0.6 * p[1], 0.6 * p[0] + 0.8 * p[1], p[2]]));
    let flat = ground.iter().map(|t| t.map(|p| [p[0], p[1], 0.25]));
    for (what, triangles, at) in [
        ("a sheet", ground.clone(), 0.0),
        ("two sheets", twice, 0.0),
        ("four layers", layers, 0.0),
        ("a turned sheet", rotated.collect(), 0.0),
        ("a flat sheet", flat.collect(), 0.0),
        ("a sheet far away", moved(&ground, 4096.0), 4096.0),
        ("soup", soup(&mut rng, 1500, [0.0; 3]), 0.0),
        ("soup far away", soup(&mut rng, 1500, [3000.0; 3]), 3000.0),
    ] {
        let mut all = Count::default();
        for (last, max_distance) in [(2, f64::INFINITY), (2, 3.0), (2, 0.5), (0, f64::INFINITY), (1, 3.0)] {
            // The same mesh with other axes as the vertical one.
            let axes = [(last + 1) % 3, (last + 2) % 3, last];
            let tree: Vec<_> = triangles.iter().map(|t| t.map(|p| permuted(p, axes))).collect();
            let tree = Arc::new(MeshBvh::from_triangles(&tree));
            let rays: Vec<Ray> = steep(&mut rng, [at; 3])
                .iter()
                .map(|ray| Ray { origin: permuted(ray.origin, axes), direction: permuted(ray.direction, axes) })
                .collect();
            let count = compare(&tree, tree.columns(axes), &rays, max_distance);
            assert_eq!(count.wrong, 0, "{what}: {count:?}");
            (all.hits, all.packets, all.columns) =
                (all.hits + count.hits, all.packets + count.packets, all.columns + count.columns);
        }
        // In a soup, many triangles are above each other; its packets fall back to the BVH.
        let least = if what.starts_with("soup") { 0 } else { all.packets / 3 };
        assert!(all.hits > 1000 && all.columns >= least, "{what}: {all:?}");
    }
}

/// The slack of rays is needed. Rays go to corners of a nearly flat sheet (its normals show which triangle was hit),
/// where columns meet. They come from slightly less than -8192 m along x: there the difference to a corner is rounded
/// and that to the sheet is not. The control: without slack, some hits are lost.
#[test]
fn slack() {
    let mut rng = TestRng(52);
    let flat = sheet(&mut rng, 33, 0.0);
    let flat: Vec<Triangle> = flat.iter().map(|t| t.map(|p| [p[0] + 2.5, p[1] + 2.5, 1e-30 * p[2]])).collect();
    let tree = Arc::new(MeshBvh::from_triangles(&flat));
    let columns = Columns::with_size(tree.triangles(), &[[0.5, 0.5, 0.0], [4.5, 4.5, 1e-30]], ABOVE, [32, 32]).unwrap();
    let rays: Vec<Ray> = (0..12_000)
        .map(|k| {
            let corner = to_f64(tree.triangles()[k % 2048][k % 3]);
            let slope = rng.uniform(0.05, 0.12);
            let direction = normalize([slope, rng.uniform(-0.01, 0.01), -1.0]).unwrap();
            let across = 8192.0 + corner[0] * rng.uniform(0.0, 1.0);
            let mut origin = add_scaled(corner, -across / direction[0], direction);
            origin[0] += rng.uniform(-1e-12, 1e-12);
            Ray { origin, direction }
        })
        .collect();
    let count = compare(&tree, Some(&columns), &rays, f64::INFINITY);
    assert_eq!((count.wrong, count.columns), (0, count.packets));
    assert!(count.hits > 9000, "{count:?}");
    let without = compare(&tree, Some(&columns.without_slack()), &rays, f64::INFINITY);
    assert!(without.wrong > 10, "{without:?}");
}

/// Very far rays are left to the BVH: their position at the mesh is rounding noise, and columns would hit triangles
/// that the BVH's boxes hide. The control: from closer, columns are used.
#[test]
fn far_rays() {
    let mut rng = TestRng(57);
    let tree = Arc::new(MeshBvh::from_triangles(&sheet(&mut rng, 25, 0.0)));
    let mut count = |sizes: f64| {
        // The sheet is 3 m wide.
        let ray = |_| {
            let direction = normalize([rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), -1.0]).unwrap();
            Ray { origin: add_scaled(rng.point(1.6), -3.0 * sizes, direction), direction }
        };
        let rays: Vec<Ray> = (0..16_000).map(ray).collect();
        compare(&tree, tree.columns(ABOVE), &rays, f64::INFINITY)
    };
    for sizes in [1e10, 1e11, 1e12] {
        let count = count(sizes);
        assert_eq!((count.wrong, count.columns), (0, 0), "{sizes}: {count:?}");
        assert!(count.hits > 8000, "{sizes}: {count:?}");
    }
    let near = count(1e3);
    assert!(near.wrong == 0 && near.columns == near.packets && near.hits > 8000, "{near:?}");
}

/// Columns exist only for meshes that are spread out, with triangles of similar size.
#[test]
fn meshes_without_columns() {
    let mut rng = TestRng(53);
    let ground = sheet(&mut rng, 25, 0.0);
    let wall: Vec<Triangle> = ground.iter().map(|t| t.map(|p| [0.5, p[0], p[1]])).collect();
    let all = [[-1.5, -1.5, 0.0], [1.5, -1.5, 0.0], [1.5, 1.5, 0.0]];
    let mix = |(k, t): (usize, &Triangle)| if k.is_multiple_of(40) { all } else { *t };
    let mixed: Vec<Triangle> = ground.iter().enumerate().map(mix).collect();
    for (what, triangles, expected) in [
        ("ground", &ground[..], true),
        ("few", &ground[..100], false),
        ("none", &[], false),
        ("a wall, without extent along x", &wall, false),
        ("of very different sizes", &mixed, false),
    ] {
        assert_eq!(MeshBvh::from_triangles(triangles).columns(ABOVE).is_some(), expected, "{what}");
    }
}

/// A packet whose columns hold too many triangles uses the BVH.
#[test]
fn crowded_columns() {
    let mut rng = TestRng(54);
    let mut triangles = sheet(&mut rng, 33, 0.0);
    triangles.extend(soup(&mut rng, 900, [0.0; 3]).iter().map(|t| t.map(|p| p.map(|x| 0.05 * x))));
    let tree = Arc::new(MeshBvh::from_triangles(&triangles));
    let rays = |x: f64| -> Vec<Ray> {
        let ray = |k: usize| [x + 0.01 * (k % 4) as f64, 0.01 * (k / 4) as f64, 2.0];
        (0..WIDTH).map(|k| Ray { origin: ray(k), direction: [0.0, 0.0, -1.0] }).collect()
    };
    let count = compare(&tree, tree.columns(ABOVE), &rays(0.0), f64::INFINITY);
    assert_eq!(count, Count { hits: WIDTH, packets: 1, columns: 0, wrong: 0 });
    let count = compare(&tree, tree.columns(ABOVE), &rays(1.0), f64::INFINITY);
    assert_eq!(count, Count { hits: WIDTH, packets: 1, columns: 1, wrong: 0 }, "the control: beside it");
}

/// Rays in the planes of triangles pass them at a distance of at least their length: no ray is inside, however edges
/// are rounded. The control: by the signs of edges alone, as in the paper, some are.
#[test]
fn edge_on() {
    let mut rng = TestRng(55);
    let (mut rays, mut by_signs) = (0, 0);
    for _ in 0..200_000 {
        let triangle: Triangle = [0; 3].map(|_| rng.point(1.0).map(|x| x as f32));
        let [a, b, c] = triangle.map(to_f64);
        let (p, q) = (sub(b, a), sub(c, a));
        let Some(direction) = normalize(add_scaled(scale(p, rng.uniform(-1.0, 1.0)), rng.uniform(-1.0, 1.0), q)) else {
            continue;
        };
        let Some(beside) = normalize(cross(direction, cross(p, q))) else { continue };
        let [x, y, z] = [a, b, c].map(|p| dot(beside, p));
        let (low, high) = (x.min(y).min(z), x.max(y).max(z));
        let away = high + (high - low) * rng.uniform(1.0, 3.0) - x;
        let origin = add_scaled(add_scaled(a, away, beside), -rng.uniform(0.0, 5.0), direction);
        let ray = Ray { origin, direction };
        rays += 1;
        assert_eq!(ShearedRay::new(&ray).distance(&triangle), None, "{ray:?} {triangle:?}");
        let packet = Packet::from_rays(&[ray], f64::INFINITY);
        let together = ShearedPacket::new(Scalar, &packet).unwrap().distances(&triangle);
        assert!(together.is_none_or(|(_, inside)| inside.to_bitmask() == 0), "{ray:?} {triangle:?}");
        by_signs += usize::from(inside_by_signs(&ray, &triangle));
    }
    assert!(rays > 190_000 && by_signs > 10, "{by_signs} of {rays}");
}

fn inside_by_signs(ray: &Ray, triangle: &Triangle) -> bool {
    let shear = ShearedPacket::new(Scalar, &Packet::from_rays(&[*ray], f64::INFINITY)).unwrap();
    let ([i, j, k], o) = (shear.axes(), ray.origin);
    let by = shear.slopes().map(|x| x.array()[0]);
    let [a, b, c] = triangle.map(to_f64).map(|p| {
        let z = p[k] - o[k];
        [(p[i] - o[i]) - by[0] * z, (p[j] - o[j]) - by[1] * z]
    });
    let edges = [c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]];
    let mixed = edges.iter().any(|&x| x < 0.0) && edges.iter().any(|&x| x > 0.0);
    !mixed && edges.iter().sum::<f64>() != 0.0
}

/// Height scanners over and beside fixed and moving meshes: whole scans give the same hits as every ray alone.
#[test]
fn scans() {
    let mut rng = TestRng(56);
    let mesh = |triangles: &[Triangle]| {
        let positions = triangles.iter().flatten().copied().collect();
        let triangles = (0..triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let mesh = TriMesh { positions, triangles, ..TriMesh::default() };
        Shape::from(kinetoscope_scene::shape::Mesh {
            mesh: Arc::new(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE)),
        })
    };
    let (ground, heap) = (mesh(&sheet(&mut rng, 40, 0.0)), mesh(&soup(&mut rng, 400, [0.0; 3])));
    let targets = targets(&[ground.clone(), ground, heap.clone(), heap], 4, |k| k < 2);
    // The grid of a height scanner: 16 by 10 parallel rays, 0.1 m apart.
    let pattern: Vec<Ray> = (0..160)
        .map(|k| [-0.8 + 0.1 * (k % 16) as f64, -0.5 + 0.1 * (k / 16) as f64, 0.0])
        .map(|origin| Ray { origin, direction: [0.0, 0.0, -1.0] })
        .collect();
    let (mut hits, mut seen) = (0, [0; 4]);
    for round in 0..12 {
        let mut placed = |far: f64| PoseF64::from(&pose::from_xyz_rpy(rng.point(far), rng.point(1.0)));
        // The first two at the same place: the first one counts.
        let poses = [PoseF64::IDENTITY, PoseF64::IDENTITY, placed(1.0), placed(1.0)];
        let poses = if round % 3 == 0 { poses } else { [PoseF64::IDENTITY, placed(0.3), poses[2], poses[3]] };
        let roll = if round % 2 == 0 { 0.0 } else { 0.4 };
        let yaw = rng.uniform(-3.0, 3.0);
        let at = pose::from_xyz_rpy([rng.uniform(-2.0, 2.0), rng.uniform(-2.0, 2.0), 6.0], [roll, -roll, yaw]);
        let mut rays: Vec<Ray> = pattern.iter().map(|ray| ray.transformed_by(&PoseF64::from(&at))).collect();
        rays[round * 7].origin[1] = f64::NAN;
        for level in all_levels() {
            let mut world = RayWorld::with_level(&targets, level);
            world.place(&poses);
            let mut together = vec![RayHit::MISS; rays.len()];
            world.cast(&rays, 8.0, &mut together);
            for (ray, hit) in rays.iter().zip(&together) {
                let mut alone = *hit;
                world.cast(std::slice::from_ref(ray), 8.0, std::slice::from_mut(&mut alone));
                assert_eq!(
                    (alone, alone.distance.to_bits()),
                    (*hit, hit.distance.to_bits()),
                    "round {round}, {level:?}"
                );
            }
            for hit in together.iter().filter(|hit| hit.is_hit()) {
                (hits, seen[hit.instance as usize]) = (hits + 1, seen[hit.instance as usize] + 1);
            }
        }
    }
    assert!(hits > 2000 && seen.iter().all(|&n| n > 5), "{hits} {seen:?}");
}
