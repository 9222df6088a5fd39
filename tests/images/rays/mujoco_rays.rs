//! Comparison of our ray casts with `mj_ray`, on the same geoms at the same poses.

use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::Data;
use kinetoscope::render::geometry::{RayAssetCache, RayHit, RayTargets, RayWorld};
use kinetoscope::scene::PoseF64;
use kinetoscope::scene::Ray;
use kinetoscope::sim::VisualScene;
use std::sync::Arc;

/// Bit mask of the visible geom groups.
pub(crate) const GROUPS: u32 = 0b111;
/// Largest difference of distances \[m\].
pub(crate) const DISTANCE_TOLERANCE: f64 = 1e-6;

/// Pseudo-random numbers, the same in every run.
pub(crate) struct TestRng(pub(crate) u64);

impl TestRng {
    /// A number between `low` and `high`.
    pub(crate) fn number(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 33) as f64 / f64::from(1u32 << 31)
    }

    pub(crate) fn numbers<const N: usize>(&mut self, ranges: [[f64; 2]; N]) -> [f64; N] {
        ranges.map(|[low, high]| self.number(low, high))
    }

    pub(crate) fn point(&mut self, size: f64) -> [f64; 3] {
        self.numbers([[-size, size]; 3])
    }

    /// A ray from a point within `far` of the origin to a point within `near` of the origin.
    pub(crate) fn ray(&mut self, far: f64, near: f64) -> Ray {
        let (origin, target) = (self.point(far), self.point(near));
        ray_through(origin, target)
    }

    /// A body at a random pose in `range`. Every `free`-th body has a free joint; rays find the static ones through the
    /// BVH of the world.
    pub(crate) fn body(
        &mut self,
        [k, free]: [usize; 2],
        range: [[f64; 2]; 3],
        geom: impl FnOnce(&mut Self) -> String,
    ) -> String {
        let [[x, y, z], [a, b, c]] = [self.numbers(range), self.numbers([[0.0, 360.0]; 3])];
        let joint = if k.is_multiple_of(free) { "<freejoint/>" } else { "" };
        format!("<body pos='{x} {y} {z}' euler='{a} {b} {c}'>{joint}{}</body>", geom(self))
    }

    /// A plane and bodies of every primitive, with sizes in this range.
    pub(crate) fn primitives(&mut self, count: usize, free: usize, size: [f64; 2]) -> Data {
        let mut world = "<geom name='floor' type='plane' size='5 5 .1'/>".to_string();
        for k in 0..count {
            world += &self.body([k, free], [[-1.0, 1.0], [-1.0, 1.0], [0.2, 1.4]], |rng| {
                let kind = ["sphere", "capsule", "ellipsoid", "cylinder", "box"][k % 5];
                let [s, t, r] = rng.numbers([size; 3]);
                format!("<geom name='g{k}' type='{kind}' size='{s} {t} {r}'/>")
            });
        }
        data_of(&world)
    }
}

pub(crate) fn ray_through(origin: [f64; 3], target: [f64; 3]) -> Ray {
    let d = [0, 1, 2].map(|k| target[k] - origin[k]);
    let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
    Ray { origin, direction: d.map(|x| x / length) }
}

/// A mesh with inner edges.
pub(crate) const MESH_WITH_INNER_EDGES: &str = "<mesh name='fan' vertex='0 0 0  .5 0 0  0 .5 0  0 0 .5  .3 .3 .4' face='0 2 1  0 1 3  0 3 2  1 2 4  2 3 4  3 1 4'/>";

/// A height field file for MuJoCo: rows, columns, then elevations.
pub(crate) fn height_field(rows: i32, elevation: impl FnMut(i32) -> f32) -> mj::Asset {
    let mut bytes: Vec<u8> = [rows; 2].iter().flat_map(|n| n.to_le_bytes()).collect();
    bytes.extend((0..rows * rows).map(elevation).flat_map(f32::to_le_bytes));
    mj::Asset { name: "terrain.bin".into(), bytes }
}

/// Simulation data of a world with these elements, at rest.
pub(crate) fn data_of(world: &str) -> Data {
    data_with("", world, &[])
}

pub(crate) fn data_with(assets: &str, world: &str, files: &[mj::Asset]) -> Data {
    let xml = format!("<mujoco><asset>{assets}</asset><worldbody>{world}</worldbody></mujoco>");
    at_rest(mj::compile(&xml, files).unwrap())
}

pub(crate) fn at_rest(compiled: mj::Compiled) -> Data {
    let mut data = Data::new(&compiled.into_model()).unwrap();
    data.step1().unwrap();
    data
}

/// The mask id of a geom of `data` in a scene.
pub(crate) fn mask_of(visible: &VisualScene, data: &Data, geom: usize) -> i32 {
    let name = data.model().name(mj::ObjectKind::Geom, geom).unwrap_or_else(|| format!("geom {geom}"));
    visible.mask_ids().iter().find(|id| id.geoms.contains(&name)).unwrap().id
}

/// Hits of our rays in the scene of `data`.
fn our_hits(data: &Data, rays: &[Ray], max_distance: f64) -> Vec<RayHit> {
    let visible = VisualScene::of_model(data.model());
    let seen = |i: &kinetoscope::scene::Instance| i.visible && GROUPS >> i.group & 1 == 1;
    let wanted = visible.scene().instances().iter().enumerate().filter(|(_, i)| seen(i)).map(|(k, _)| k);
    let mut world = RayWorld::new(&Arc::new(RayTargets::new(visible.scene(), wanted, &RayAssetCache::default())));
    let mut poses = vec![PoseF64::IDENTITY; visible.scene().instances().len()];
    visible.read_poses_f64(data, &mut poses);
    world.place(&poses);
    let mut hits = vec![RayHit::MISS; rays.len()];
    world.cast(rays, max_distance, &mut hits);
    hits
}

/// Number of hits of `mj_ray` in `reference`, and number of rays for which our hit in `seen` differs.
pub(crate) fn compare(seen: &Data, reference: &Data, rays: &[Ray]) -> (usize, usize) {
    let visible = VisualScene::of_model(seen.model());
    let (mut hits, mut differing) = (0, 0);
    for (ray, hit) in rays.iter().zip(our_hits(seen, rays, 1e6)) {
        let theirs = reference.ray(ray.origin, ray.direction, GROUPS).unwrap();
        hits += usize::from(theirs.is_some());
        let same = theirs.map_or(!hit.is_hit(), |theirs| {
            hit.mask_id == mask_of(&visible, reference, theirs.geom)
                && (hit.distance - theirs.distance).abs() <= DISTANCE_TOLERANCE
        });
        differing += usize::from(!same);
    }
    (hits, differing)
}

pub(crate) fn check(name: &str, data: &Data, rays: &[Ray], least: usize) {
    let (hits, differing) = compare(data, data, rays);
    assert!(hits >= least, "{name}: only {hits} hits");
    assert_eq!(differing, 0, "{name}: rays differ from mj_ray");
}
