//! Groups of rays that are close to each other, as those that a mirror reflects into a group of samples.
//!
//! The instances that any ray of the group may hit are found once for all, in single precision and with bounds that are
//! enlarged by its error. Then each ray is intersected with its instances as a single ray is: hits are the same, bit for
//! bit.

use super::motion::END_TIME;
use super::{RayHit, RayTracer};
use crate::geometry::bvh::TraversalStack;
use crate::simd::{F, LANES, M, Simd, V3, abs, load, max, min, select, splat};
use kinetoscope_scene::Ray;

/// Error of rays and bounds in single precision, as a fraction of the largest coordinate and distance: a ray that is
/// rounded to single precision is at most half of this beside its line.
const PRECISION: f64 = 4e-6;

/// Factor of distances: more than the rounding of a slab test.
const DISTANCE_SCALE: f32 = 1.0 + 1e-5;

/// Rays of a group, in single precision.
#[derive(Clone, Copy)]
pub(crate) struct RayGroup<S: Simd> {
    /// Origins \[m\], world frame.
    pub(crate) origin: V3<S>,
    /// Unit vectors, world frame.
    pub(crate) direction: V3<S>,
}

impl<S: Simd> RayGroup<S> {
    /// The rays, rounded to single precision.
    #[inline(always)]
    pub(crate) fn of(s: S, rays: &[Ray; LANES]) -> Self {
        let (mut origins, mut directions) = ([[0.0f32; LANES]; 3], [[0.0f32; LANES]; 3]);
        for (k, Ray { origin, direction }) in rays.iter().enumerate() {
            for axis in 0..3 {
                (origins[axis][k], directions[axis][k]) = (origin[axis] as f32, direction[axis] as f32);
            }
        }
        let [x, y, z] = &origins;
        let origin = V3 { x: load(s, x), y: load(s, y), z: load(s, z) };
        let [x, y, z] = &directions;
        Self { origin, direction: V3 { x: load(s, x), y: load(s, y), z: load(s, z) } }
    }
}

/// Instances that the rays of a group may hit, those with near boxes first in most cases; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Candidates {
    list: Vec<Candidate>,
    /// Rays that may hit an instance.
    lanes: u64,
    /// Bounds are enlarged by this distance \[m\].
    pad: f32,
}

/// An instance that rays may hit.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// Index in [`RayTracer::instances`].
    instance_index: u32,
    lanes: u64,
    /// Distances of the rays to the box of the instance \[m\].
    near: [f32; LANES],
}

impl Candidates {
    pub(crate) fn bytes(&self) -> usize {
        self.list.capacity() * size_of::<Candidate>()
    }

    /// Rays that may hit an instance; the other ones hit none.
    pub(crate) fn lanes(&self) -> u64 {
        self.lanes
    }
}

/// Slab tests of a group of rays.
#[derive(Clone, Copy)]
pub(super) struct Slabs<S: Simd> {
    origin: V3<S>,
    inverse: V3<S>,
    pad: f32,
}

impl<S: Simd> Slabs<S> {
    /// `size` is the largest coordinate of the boxes \[m\].
    #[inline(always)]
    pub(super) fn new(s: S, rays: RayGroup<S>, lanes: M<S>, size: f64) -> Self {
        let RayGroup { origin, direction } = rays;
        let reach = max(max(abs(origin.x), abs(origin.y)), abs(origin.z));
        let reach = select(lanes, reach, splat(s, 0.0)).array().iter().fold(0.0f32, |far, &x| far.max(x));
        let inverse = {
            #[inline(always)]
            |d: F<S>| {
                let tiny = splat(s, 1e-12);
                splat(s, 1.0) / select(abs(d).simd_lt(tiny), tiny, d)
            }
        };
        let inverse = V3 { x: inverse(direction.x), y: inverse(direction.y), z: inverse(direction.z) };
        Self { origin, inverse, pad: (PRECISION * (f64::from(reach) + size)) as f32 }
    }

    /// The rays that may meet a box, and their distances to it.
    #[inline(always)]
    pub(super) fn enter(&self, s: S, [lo, hi]: &[[f64; 3]; 2]) -> (M<S>, F<S>) {
        let (mut near, mut far) = (splat(s, 0.0), splat(s, f32::MAX));
        let Self { origin: o, inverse: i, pad } = *self;
        for (k, (o, i)) in [(o.x, i.x), (o.y, i.y), (o.z, i.z)].into_iter().enumerate() {
            let [lo, hi] = [lo[k] as f32 - pad, hi[k] as f32 + pad];
            let (a, b) = ((splat(s, lo) - o) * i, (splat(s, hi) - o) * i);
            (near, far) = (max(near, min(a, b)), min(far, max(a, b)));
        }
        (near.simd_le(far * DISTANCE_SCALE), near)
    }
}

impl RayTracer {
    /// Finds the bounded instances that the rays in `lanes` may hit, without the instance `skipped`.
    #[inline(always)]
    pub(crate) fn find_candidates<S: Simd>(
        &self,
        s: S,
        rays: RayGroup<S>,
        lanes: M<S>,
        skipped: Option<u32>,
        candidates: &mut Candidates,
    ) {
        let Candidates { list, lanes: all, pad } = candidates;
        list.clear();
        *all = 0;
        // All at once: candidates change from frame to frame, and memory must not grow with them.
        list.reserve(self.instances.len());
        let Some(bounds) = self.bvh.bounds() else { return };
        let size = bounds.iter().flatten().fold(0.0f64, |far, x| far.max(x.abs()));
        let slabs = Slabs::new(s, rays, lanes, size);
        if !(lanes & slabs.enter(s, &bounds).0).any_true() {
            return;
        }
        *pad = slabs.pad;
        self.bvh.traverse_group(s, &slabs, lanes, {
            #[inline(always)]
            |index: u32, met: M<S>, near: F<S>| {
                if skipped == Some(self.instances[index as usize].instance) {
                    return;
                }
                let met = met & self.round_bounds[index as usize].may_intersect(s, rays);
                if met.any_true() {
                    let lanes = met.to_bitmask();
                    *all |= lanes;
                    list.push(Candidate { instance_index: index, lanes, near: near.array() });
                }
            }
        });
    }

    /// Finds the nearest hit of each ray in `lanes`, as [`closest_hit`](Self::closest_hit) does without a limit for static
    /// instances, and writes it to `best`, which has no hits of these rays. `candidates` are those of the rays.
    #[inline(always)]
    pub(crate) fn closest_hits<S: Simd>(
        &self,
        s: S,
        candidates: &Candidates,
        rays: &[Ray; LANES],
        lanes: u64,
        stack: &mut TraversalStack,
        best: &mut [Option<RayHit>; LANES],
    ) {
        let mut limits = [f32::MAX; LANES];
        let mut meet = {
            #[inline(always)]
            |index: u32, lanes: u64, limits: &mut [f32; LANES]| {
                let placed = &self.instances[index as usize];
                let Some(body) = &self.geometries[placed.instance as usize] else { return };
                let pose = placed.at(END_TIME);
                for k in lanes_of(lanes) {
                    let limit = best[k].map_or(f64::INFINITY, |best| best.distance);
                    let local = rays[k].inverse_transformed_by(&pose);
                    let Some(found) = body.intersect(index, &local, limit, stack) else { continue };
                    if best[k].is_none_or(|best| found.precedes(&best)) {
                        best[k] = Some(found);
                        limits[k] = found.distance as f32;
                    }
                }
            }
        };
        for &index in &self.unbounded {
            meet(index, lanes, &mut limits);
        }
        for candidate in &candidates.list {
            let limit = load(s, &limits) * DISTANCE_SCALE + candidates.pad;
            let near_enough = load(s, &candidate.near).simd_le(limit).to_bitmask();
            meet(candidate.instance_index, candidate.lanes & lanes & near_enough, &mut limits);
        }
    }
}

/// The lanes of a mask.
pub(crate) fn lanes_of(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let k = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
        bits &= bits - 1;
        (k < LANES).then_some(k)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TestRng;
    use crate::geometry::assets::RayAssetCache;
    use crate::raster::Layer;
    use crate::simd::{all_levels, at_level};
    use kinetoscope_scene::vector::{add, dot, scale, sub};
    use kinetoscope_testkit::scenes::{TestRng as SceneRng, random_scene};

    /// Rays from points near `from` to points near `to`. Every fourth group is parallel to an axis but for the last digits
    /// of single precision.
    fn group(rng: &mut TestRng, number: usize, from: f64, spread: f64) -> [Ray; LANES] {
        let (origin, target) = (scale(rng.point(1.0), from), rng.point(1.5));
        std::array::from_fn(|_| {
            let origin = add(origin, scale(rng.point(1.0), spread));
            let mut d = sub(add(target, scale(rng.point(1.0), spread)), origin);
            if number.is_multiple_of(4) {
                d = scale(rng.point(1.0), 1e-8);
                d[number / 4 % 3] = 1.0;
            }
            Ray { origin, direction: scale(d, 1.0 / dot(d, d).sqrt()) }
        })
    }

    /// Hits of groups are those of single rays, bit for bit, and most instances are no candidates. Origins and directions
    /// are rounded to single precision for the candidates. In every other scene, objects move during the exposure; in every
    /// third group, some rays and an instance are left out.
    #[test]
    fn hits_of_single_rays() {
        let mut rng = TestRng(5);
        let (mut hits, mut tested, mut left_out, mut skipped_hits) = (0, 0, 0, 0);
        for seed in 1..7 {
            let (scene, poses) = random_scene(&mut SceneRng(seed), 1.0);
            let mut before = poses.clone();
            before.iter_mut().step_by(2).for_each(|pose| pose.translation[0] += 0.2);
            let mut tracer = RayTracer::default();
            tracer.prepare_geometry(&scene, &RayAssetCache::default(), |_| Layer::Opaque);
            tracer.place(&scene, &poses, seed.is_multiple_of(2).then_some(&before[..]));
            let (mut stack, mut candidates) = (TraversalStack::default(), Candidates::default());
            for number in 0..120 {
                let (from, spread) = [(3.0, 0.05), (3.0, 2.0), (200.0, 0.5), (0.5, 0.01)][number % 4];
                let rays = group(&mut rng, number / 4, from, spread);
                let is_partial = number.is_multiple_of(3);
                let lanes = if is_partial { 0x35c7 } else { 0xffff };
                let is_bounded = |index: &usize| !tracer.unbounded.contains(&(*index as u32));
                let skipped = (number..number + tracer.instances.len())
                    .map(|index| index % tracer.instances.len())
                    .find(|index| is_partial && is_bounded(index))
                    .map(|index| tracer.instances[index].instance);
                for level in all_levels() {
                    let mut found = [None; LANES];
                    at_level!(level, s => s.vectorize(#[inline(always)] || {
                        let wanted: [f32; LANES] = std::array::from_fn(|k| (lanes >> k & 1) as f32);
                        let mask = load(s, &wanted).simd_gt(splat(s, 0.5));
                        tracer.find_candidates(s, RayGroup::of(s, &rays), mask, skipped, &mut candidates);
                        tracer.closest_hits(s, &candidates, &rays, lanes, &mut stack, &mut found);
                    }));
                    for (k, ray) in rays.iter().enumerate() {
                        let found = found[k].and_then(|hit| tracer.surface(&hit));
                        let single =
                            at_level!(level, s => tracer.closest_hit(s, ray, f64::INFINITY, END_TIME, &mut stack));
                        if lanes >> k & 1 == 0 {
                            assert_eq!(found, None, "lane {k} is not in the group");
                        } else if skipped.is_some() && single.as_ref().map(|hit| hit.instance) == skipped {
                            assert_ne!(found.map(|hit| hit.instance), skipped, "{ray:?}");
                            skipped_hits += 1;
                        } else {
                            assert_eq!(found, single, "{ray:?}");
                            hits += usize::from(single.is_some());
                        }
                    }
                    tested += tracer.instances.len();
                    left_out += tracer.instances.len() - candidates.list.len();
                }
            }
        }
        assert!(skipped_hits > 20, "{skipped_hits} hits of an instance that was left out");
        assert!(hits > 3000 && 2 * left_out > tested, "{hits} hits, {left_out} of {tested} instances are left out");
    }
}
