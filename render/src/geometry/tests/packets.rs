//! Packets find the same hits as single rays, to the bit, on every instruction set.

use super::bvhs::soup;
use super::{TestRng, bits};
use crate::geometry::assets::{AssetCache, RayAssetCache};
use crate::geometry::bvh::{Beam, Traversal, TraversalStack};
use crate::geometry::packet::{Packet, WIDTH};
use crate::geometry::shape::mesh::{Mesh, MeshBvh};
use crate::geometry::shape::{RayGeometry, RayShape, ShapeVisitor};
use crate::geometry::triangle::{ShearedPacket, Triangle};
use crate::geometry::world::{RayHit, RayTargets, RayWorld};
use crate::simd::{Simd, all_levels, at_level};
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::Intersection;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{Box, Capsule, Cylinder, Ellipsoid, HeightField, Plane, Sphere};
use kinetoscope_scene::vector::{add_scaled, normalize};
use kinetoscope_scene::{Instance, Material, PoseF64, RenderScene};
use std::sync::Arc;

/// Casts every packet of the rays together, at every level, and each ray alone; counts hits.
pub(super) struct Compare<'a> {
    pub(super) rays: &'a [Ray],
    pub(super) max_distance: f64,
    pub(super) what: &'a str,
    pub(super) hits: &'a mut usize,
}

impl ShapeVisitor for Compare<'_> {
    fn run<T: RayShape>(self, shape: &T) {
        let mut stack = TraversalStack::default();
        for (index, rays) in self.rays.chunks(WIDTH).enumerate() {
            let packet = Packet::from_rays(rays, self.max_distance);
            let alone: [Option<Intersection>; WIDTH] = std::array::from_fn(|k| {
                let ray = rays.get(k).filter(|ray| ray.is_finite())?;
                shape.intersect(ray, self.max_distance, &mut stack)
            });
            *self.hits += alone.iter().flatten().count();
            for level in all_levels() {
                let mut touches = [None; WIDTH];
                at_level!(level, s => s.vectorize(#[inline(always)] || {
                    shape.intersect_packet(s, &packet, &mut stack, &mut touches);
                }));
                for k in 0..WIDTH {
                    let (one, all) = (bits(&alone[k]), bits(&touches[k]));
                    assert_eq!(one, all, "{}, packet {index}, lane {k}, {level:?}: {:?}", self.what, rays.get(k));
                }
            }
        }
    }
}

/// Packets of every kind: parallel, from one point, crossing, and in all directions.
fn packets(rng: &mut TestRng, at: [f64; 3]) -> Vec<Ray> {
    let mut rays = Vec::new();
    for kind in 0..160 {
        let spread = 10f64.powf(rng.uniform(-3.0, 0.0));
        let first = match kind % 5 {
            // Along an axis, on a grid of eighths: exact hits of edges and corners.
            0 | 1 => {
                let axis = kind / 5 % 3;
                let sign = if kind % 2 == 0 { 1.0 } else { -1.0 };
                let direction = [0, 1, 2].map(|k| if k == axis { sign } else { 0.0 });
                let origin = rng.point(1.0).map(|x| (8.0 * x).round() / 8.0);
                Ray { origin: add_scaled(origin, -3.0, direction), direction }
            }
            _ => rng.ray(if kind % 2 == 0 { 20.0 } else { 1.5 }, 1.0),
        };
        // Some lists end within a packet.
        let count = if kind % 4 == 0 { 5 } else { WIDTH };
        for k in 0..count {
            let mut ray = first;
            match kind % 5 {
                0 => ray.origin = [0, 1, 2].map(|a| first.origin[a] + 0.125 * ((k >> (a % 2)) & 1) as f64),
                1 | 2 => ray.origin = add_scaled(first.origin, spread, rng.point(1.0)),
                3 => ray.direction = normalize(add_scaled(first.direction, spread, rng.point(1.0))).unwrap(),
                _ => ray = rng.ray(5.0, 1.0),
            }
            if rng.uniform(0.0, 1.0) < 0.01 {
                ray.origin[k % 3] = f64::NAN;
            }
            ray.origin = [0, 1, 2].map(|a| ray.origin[a] + at[a]);
            rays.push(ray);
        }
        // The next kind begins a packet of its own; invalid rays fill this one.
        let none = Ray { origin: [f64::INFINITY; 3], direction: [0.0, 0.0, 1.0] };
        rays.extend((count..WIDTH).map(|_| none));
    }
    rays
}

fn terrain(side: usize, rng: &mut TestRng) -> HeightField {
    let elevation: Vec<f32> = (0..side * side).map(|_| (rng.uniform(0.0, 64.0) as u32) as f32 / 64.0).collect();
    let half = (side - 1) as f64 / 16.0;
    HeightField::new([half, half, 0.5, 0.25], side, side, &elevation).unwrap()
}

/// Triangles over a grid of eighths, so that rays of the grid hit corners and edges.
fn sheet(field: &HeightField) -> Vec<Triangle> {
    let mesh = field.mesh();
    mesh.triangles().iter().map(|t| t.map(|i| mesh.positions()[i as usize])).collect()
}

#[test]
fn triangles() {
    let mut rng = TestRng(31);
    let sheet = sheet(&terrain(33, &mut rng));
    // All triangles twice: of equally near ones the first counts.
    let twice: Vec<Triangle> = sheet.iter().chain(&sheet).copied().collect();
    let mut hits = 0;
    for (what, triangles, at) in [
        ("soup", soup(&mut rng, 1500, [0.0; 3]), 0.0),
        ("a few", soup(&mut rng, 5, [0.0; 3]), 0.0),
        ("one", soup(&mut rng, 1, [0.0; 3]), 0.0),
        ("far away", soup(&mut rng, 700, [3000.0; 3]), 3000.0),
        ("a sheet", sheet, 0.0),
        ("two sheets", twice, 0.0),
        ("nothing", vec![], 0.0),
    ] {
        let mesh = Mesh::from_bvh(Arc::new(MeshBvh::from_triangles(&triangles)));
        for max_distance in [f64::INFINITY, 3.0, 0.5] {
            let rays = packets(&mut rng, [at; 3]);
            Compare { rays: &rays, max_distance, what, hits: &mut hits }.run(&mesh);
        }
    }
    assert!(hits > 3000, "{hits}");
}

/// A limit equal to the distance includes the hit, the next smaller number does not, in packets and alone.
#[test]
fn limits() {
    let mut rng = TestRng(32);
    let mesh = Mesh::from_bvh(Arc::new(MeshBvh::from_triangles(&sheet(&terrain(17, &mut rng)))));
    let (mut hits, mut lost) = (0, 0);
    for rays in packets(&mut rng, [0.0; 3]).chunks(WIDTH) {
        let Some(touch) = mesh.intersect(&rays[0], f64::INFINITY, &mut TraversalStack::default()) else { continue };
        for max_distance in [touch.t, touch.t.next_down()] {
            let before = hits;
            Compare { rays, max_distance, what: "a limit", hits: &mut hits }.run(&mesh);
            lost += usize::from(hits == before);
        }
    }
    assert!(hits > 300 && lost > 0, "{hits} {lost}");
}

#[test]
fn height_fields() {
    let mut rng = TestRng(33);
    let mut hits = 0;
    for side in [2, 3, 17, 40] {
        let field = terrain(side, &mut rng);
        let solid = RayGeometry::from_shape(&Shape::from(field), &mut AssetCache::default());
        let mut rays = packets(&mut rng, [0.0; 3]);
        // Nearly straight down from above, some at points and along edges of the grid.
        for k in 0..200 * WIDTH {
            let mut ray = Ray { origin: rng.point(2.5), direction: [0.0, 0.0, -1.0] };
            if (k / WIDTH).is_multiple_of(3) {
                ray.origin = ray.origin.map(|x| (8.0 * x).round() / 8.0);
            }
            ray.origin[2] = if k.is_multiple_of(11) { rng.uniform(-0.5, 1.0) } else { 3.0 };
            if !(k / WIDTH).is_multiple_of(4) {
                let [x, y, _] = rng.point(0.3);
                ray.direction = normalize([x, if k.is_multiple_of(13) { 0.0 } else { y }, -1.0]).unwrap();
            }
            rays.push(ray);
        }
        for max_distance in [f64::INFINITY, 3.0] {
            let what = format!("{side} x {side}");
            solid.with(Compare { rays: &rays, max_distance, what: &what, hits: &mut hits });
        }
    }
    assert!(hits > 5000, "{hits}");
}

/// The control of the tests above: neighbors of a height scanner traverse the BVH together.
#[test]
fn beams() {
    let mut rng = TestRng(34);
    let tree = MeshBvh::from_triangles(&sheet(&terrain(65, &mut rng)));
    let origin = |k: usize| [0.03 + 0.125 * (k % 4) as f64, 0.125 * (k / 4) as f64, 20.0];
    let rays: Vec<Ray> = (0..WIDTH).map(|k| Ray { origin: origin(k), direction: [0.0, 0.0, -1.0] }).collect();
    let packet = Packet::from_rays(&rays, f64::INFINITY);
    for level in all_levels() {
        at_level!(level, s => s.vectorize(#[inline(always)] || {
            let shear = ShearedPacket::new(s, &packet).unwrap();
            let beam = Beam::enclosing(s, &packet, &shear, tree.bvh()).unwrap();
            let mut triangle_count = 0;
            let mut walk = |budget| {
                let limits = packet.limits(s);
                tree.bvh().traverse_beam(&beam, limits, budget, &mut TraversalStack::default(), |leaf| {
                    triangle_count += leaf.len();
                    None
                })
            };
            // Five by three cells are below the rays, with thirty of 8192 triangles, but not in leaves of their own.
            assert_eq!(walk(128), Traversal::Complete);
            assert_eq!(walk(8), Traversal::OverBudget, "the control");
            assert!(triangle_count >= 30, "{triangle_count}");
        }));
    }
}

/// One shape of each kind.
fn shapes(rng: &mut TestRng) -> Vec<Shape> {
    let field = terrain(17, rng);
    vec![
        Plane { half: [0.4, 0.0] }.into(),
        Sphere { radius: 0.2 }.into(),
        Capsule { radius: 0.1, half_length: 0.2 }.into(),
        Ellipsoid { radii: [0.1, 0.2, 0.3] }.into(),
        Cylinder { radius: 0.15, half_length: 0.2 }.into(),
        Box { half: [0.125, 0.25, 0.375] }.into(),
        kinetoscope_scene::shape::Mesh { mesh: Arc::clone(field.mesh()) }.into(),
        field.into(),
    ]
}

pub(super) fn targets(shapes: &[Shape], count: usize, fixed: impl Fn(usize) -> bool) -> Arc<RayTargets> {
    let instance = |k: usize| {
        let instance = Instance::new(shapes[k % shapes.len()].clone(), Material::default(), k as i32 + 1);
        if fixed(k) { instance.into_fixed() } else { instance }
    };
    let scene = RenderScene::new((0..count).map(instance).collect()).unwrap();
    Arc::new(RayTargets::new(&scene, 0..count, &RayAssetCache::default()))
}

fn cast(world: &mut RayWorld, poses: &[PoseF64], rays: &[Ray]) -> Vec<RayHit> {
    world.place(poses);
    let mut hits = vec![RayHit::MISS; rays.len()];
    world.cast(rays, 50.0, &mut hits);
    hits
}

/// Compares the whole world with each shape and each ray alone: the nearest hit, of equally near ones the first
/// instance.
#[test]
fn world() {
    let mut rng = TestRng(35);
    let shapes = shapes(&mut rng);
    let count = 5 * shapes.len();
    let poses: Vec<PoseF64> = (0..count)
        .map(|k| match k / shapes.len() {
            // Two of each at the same place, where surfaces are at the same distances.
            0 | 1 => PoseF64::IDENTITY,
            _ => PoseF64::from(&kinetoscope_scene::pose::from_xyz_rpy(rng.point(1.5), rng.point(3.0))),
        })
        .collect();
    let rays = packets(&mut rng, [0.0; 3]);
    let mut assets = AssetCache::default();
    let solids: Vec<RayGeometry> = shapes.iter().map(|shape| RayGeometry::from_shape(shape, &mut assets)).collect();
    let expected: Vec<Option<(u64, u32)>> = rays
        .iter()
        .map(|ray| {
            let touch = |k: usize| {
                let local = ray.inverse_transformed_by(&poses[k]);
                let touch = solids[k % solids.len()].intersect(&local, 50.0, &mut TraversalStack::default())?;
                Some((touch.t, k))
            };
            let all = (0..count).filter(|_| ray.is_finite()).filter_map(touch);
            let best = all.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
            Some((best.0.to_bits(), best.1 as u32))
        })
        .collect();
    let hits = expected.iter().flatten().count();
    assert!(hits > 300 && hits < rays.len(), "{hits}");
    let mut first: Option<Vec<RayHit>> = None;
    for fixed in 0..3 {
        let targets = targets(&shapes, count, |k| fixed == 2 || fixed == 1 && k.is_multiple_of(2));
        for level in all_levels() {
            let mut world = RayWorld::with_level(&targets, level);
            let hits = cast(&mut world, &poses, &rays);
            for (k, (hit, expected)) in hits.iter().zip(&expected).enumerate() {
                let got = hit.is_hit().then(|| (hit.distance.to_bits(), hit.instance));
                assert_eq!(got, *expected, "ray {k} {:?}, {level:?}, {fixed}", rays[k]);
                let towards = (0..3).map(|axis| hit.normal[axis] * rays[k].direction[axis]).sum::<f64>();
                assert!(!hit.is_hit() || hit.mask_id == hit.instance as i32 + 1 && towards <= 1e-12, "{hit:?}");
            }
            let of = |h: &RayHit| (h.distance.to_bits(), h.normal.map(f64::to_bits), h.instance);
            let same = first.get_or_insert_with(|| hits.clone()).iter().map(of).eq(hits.iter().map(of));
            assert!(same, "{level:?}, {fixed}: other bits");
            // Packets of other rays, and rays alone.
            for size in [1, 3, 13] {
                let mut parts = vec![RayHit::MISS; rays.len()];
                for (rays, hits) in rays.chunks(size).zip(parts.chunks_mut(size)) {
                    world.cast(rays, 50.0, hits);
                }
                assert_eq!(parts, hits, "{size} at a time, {level:?}");
            }
        }
    }
}

/// Fixed instances are placed again when they move; non-finite poses and rays hit nothing.
#[test]
fn placing() {
    let mut rng = TestRng(23);
    let shapes = shapes(&mut rng);
    let fixed = targets(&shapes, 16, |_| true);
    assert_eq!((fixed.len(), fixed.fixed_count()), (16, 16));
    let mut poses = || -> Vec<PoseF64> {
        (0..16).map(|_| PoseF64::from(&kinetoscope_scene::pose::from_xyz_rpy(rng.point(2.0), rng.point(3.0)))).collect()
    };
    let (a, b) = (poses(), poses());
    let rays: Vec<Ray> = (0..200).map(|_| rng.ray(5.0, 2.0)).collect();
    let fresh = |poses| cast(&mut RayWorld::new(&fixed), poses, &rays);
    let mut world = RayWorld::new(&fixed);
    assert!([&a, &b, &a].into_iter().all(|poses| cast(&mut world, poses, &rays) == fresh(poses)));
    assert_ne!(fresh(&a), fresh(&b), "the control");

    let mixed = targets(&shapes, 16, |k| k.is_multiple_of(2));
    let hits = |poses: &[PoseF64], rays: &[Ray]| cast(&mut RayWorld::new(&mixed), poses, rays);
    let mut poses = vec![PoseF64::IDENTITY; 16];
    let down = Ray { origin: [0.05, 0.0, 3.0], direction: [0.0, 0.0, -1.0] };
    assert!(hits(&poses, &[down])[0].is_hit());
    for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let rays = [Ray { origin: [0.0, x, 3.0], ..down }, Ray { direction: [x, 0.0, -1.0], ..down }];
        assert_eq!(hits(&poses, &rays), [RayHit::MISS; 2]);
    }
    poses.iter_mut().for_each(|pose| pose.translation[1] = f64::NAN);
    assert_eq!(hits(&poses, &[down]), [RayHit::MISS]);
}
