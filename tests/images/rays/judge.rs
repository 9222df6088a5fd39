//! Our rays against `mj_ray`, on the same geoms at the same places.

use kinetoscope::scene::PoseF64;
use kinetoscope::sensors::ray::{Ray, RayAssets, RayHit, RayTargets, RayWorld};
use kinetoscope::sim::Visible;
use kinetoscope::sim::mj::{self, Data};
use std::sync::Arc;

/// Geom groups that are seen.
pub(crate) const GROUPS: u32 = 0b111;
/// Distances may differ by this \[m\].
pub(crate) const EXACT: f64 = 1e-6;

/// Numbers that are the same in every run.
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    /// Between `low` and `high`.
    pub(crate) fn number(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 33) as f64 / f64::from(1u32 << 31)
    }

    pub(crate) fn point(&mut self, size: f64) -> [f64; 3] {
        [0; 3].map(|_| self.number(-size, size))
    }

    /// From within `far` of the origin to within `near` of it.
    pub(crate) fn ray(&mut self, far: f64, near: f64) -> Ray {
        let (origin, target) = (self.point(far), self.point(near));
        ray_through(origin, target)
    }
}

pub(crate) fn ray_through(origin: [f64; 3], target: [f64; 3]) -> Ray {
    let d = [0, 1, 2].map(|k| target[k] - origin[k]);
    let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
    Ray { origin, direction: d.map(|x| x / length) }
}

/// A model at rest.
pub(crate) fn data_of(xml: &str, assets: &[mj::Asset]) -> Data {
    let model = mj::compile(xml, assets).unwrap().into_model();
    let mut data = Data::new(&model).unwrap();
    data.step1().unwrap();
    data
}

/// What our rays hit in the scene of `data`.
pub(crate) fn ours(data: &Data, rays: &[Ray], max_distance: f64) -> Vec<RayHit> {
    let visible = Visible::of_model(data.model());
    let seen = |i: &kinetoscope::scene::Instance| i.visible && GROUPS >> i.group & 1 == 1;
    let wanted = visible.scene().instances().iter().enumerate().filter(|(_, i)| seen(i)).map(|(k, _)| k);
    let mut world = RayWorld::new(&Arc::new(RayTargets::new(visible.scene(), wanted, &RayAssets::default())));
    let mut poses = vec![PoseF64::IDENTITY; visible.scene().instances().len()];
    visible.read_exact(data, &mut poses);
    world.place(&poses);
    let mut hits = vec![RayHit::MISS; rays.len()];
    world.cast(rays, max_distance, &mut hits);
    hits
}

/// How the two compare.
#[derive(Debug, Default)]
pub(crate) struct Verdict {
    pub(crate) hits: usize,
    pub(crate) misses: usize,
    /// Rays that hit something else, or something where the other hits nothing, or elsewhere.
    pub(crate) differing: usize,
    /// The largest difference of distances of the others \[m\].
    pub(crate) worst: f64,
}

/// Rays in `seen` by ours and in `judge` by MuJoCo.
pub(crate) fn compare(seen: &Data, judge: &Data, rays: &[Ray]) -> Verdict {
    let visible = Visible::of_model(seen.model());
    let mut verdict = Verdict::default();
    for (ray, hit) in rays.iter().zip(ours(seen, rays, 1e6)) {
        let Some(theirs) = judge.ray(ray.origin, ray.direction, GROUPS).unwrap() else {
            verdict.misses += 1;
            verdict.differing += usize::from(hit.is_hit());
            continue;
        };
        verdict.hits += 1;
        let name = judge.model().name(mj::ObjectKind::Geom, theirs.geom).unwrap_or(format!("geom {}", theirs.geom));
        let id = visible.ids().iter().find(|id| id.geoms.contains(&name)).unwrap().id;
        let error = (hit.distance - theirs.distance).abs();
        if hit.mask_id != id || error.is_nan() || error > EXACT {
            verdict.differing += 1;
        } else {
            verdict.worst = verdict.worst.max(error);
        }
    }
    verdict
}

pub(crate) fn check(name: &str, data: &Data, rays: &[Ray], least: usize) {
    let verdict = compare(data, data, rays);
    println!("{name}: {verdict:?}");
    assert!(verdict.hits >= least, "{name}: only {} hits", verdict.hits);
    assert_eq!(verdict.differing, 0, "{name}: rays differ from mj_ray");
}
