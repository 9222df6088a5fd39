//! What rays hit in one environment.

use super::bvh::{Bvh, Stack};
use super::shape::{ForShape, RayShape, Solid, Touch};
use super::vector::{V3, along, dot, sub};
use super::{Ray, RayAssets};
use crate::lanes::{Level, Simd, at_level};
use scene::{PoseF64, RenderScene};
use std::sync::Arc;

/// More instances that do not move than this are put into a tree.
const FEW: usize = 4;
/// How much larger bounding spheres are: more than the rounding of the test, for things down to a billionth of their
/// distance.
const LARGER: f64 = 1.0 + 1e-6;

/// What a ray hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// How far away \[m\]; +inf for a miss.
    pub distance: f64,
    /// Unit normal of the surface, turned to where the ray comes from, in the environment; 0 for a miss.
    pub normal: [f64; 3],
    /// Index of the instance in the scene; [`RayHit::NOTHING`] for a miss.
    pub instance: u32,
    /// The instance's mask id; 0 for a miss.
    pub mask_id: i32,
}

impl RayHit {
    /// The instance of a miss.
    pub const NOTHING: u32 = u32::MAX;
    /// No hit.
    pub const MISS: Self = Self { distance: f64::INFINITY, normal: [0.0; 3], instance: Self::NOTHING, mask_id: 0 };

    /// Whether something was hit.
    pub fn is_hit(&self) -> bool {
        self.instance != Self::NOTHING
    }
}

/// Instances of a scene that rays hit: immutable, shared by all environments and threads.
#[derive(Clone, Debug)]
pub struct RayTargets {
    targets: Vec<Target>,
    /// Those of `targets` that do not move, and those that may.
    fixed: Vec<u32>,
    moving: Vec<u32>,
    /// Instances of the scene.
    instances: usize,
}

#[derive(Clone, Debug)]
struct Target {
    instance: u32,
    mask_id: i32,
    solid: Solid,
    /// Middle and radius of a sphere around it; `None` for a shape without an end.
    sphere: Option<(V3, f64)>,
}

/// A target in an environment.
#[derive(Clone, Copy, Debug)]
struct Placed {
    target: u32,
    world_from_target: PoseF64,
    /// Of the sphere around it; a radius of +inf where there is none.
    middle: V3,
    radius: f64,
}

/// Targets that do not move, where they are: shared by all environments where they are at the same places.
#[derive(Clone, Debug, Default)]
pub(crate) struct FixedWorld {
    placed: Vec<Placed>,
    /// Over some of `placed`, given by the list; the others are tested one by one.
    tree: Option<(Bvh, Vec<u32>)>,
    one_by_one: Vec<u32>,
}

/// What rays hit, at the places of one environment. Keeps its scratch memory; use one per thread.
#[derive(Clone, Debug)]
pub struct RayWorld {
    targets: Arc<RayTargets>,
    fixed: Arc<FixedWorld>,
    moving: Vec<Placed>,
    level: Level,
    outer: Stack,
    inner: Stack,
}

impl RayTargets {
    /// The instances of `scene` that `wanted` names, by their indices; repetitions count once, others are left out. Trees
    /// over meshes are taken from `assets`, or built.
    pub fn new(scene: &RenderScene, wanted: impl IntoIterator<Item = usize>, assets: &RayAssets) -> Self {
        let mut is_wanted = vec![false; scene.instances().len()];
        for index in wanted {
            if let Some(is_wanted) = is_wanted.get_mut(index) {
                *is_wanted = true;
            }
        }
        let mut out = Self { targets: vec![], fixed: vec![], moving: vec![], instances: is_wanted.len() };
        assets.with(|assets| {
            for (index, instance) in scene.instances().iter().enumerate().filter(|(index, _)| is_wanted[*index]) {
                let solid = Solid::of(&instance.shape, assets);
                let sphere = solid.bounds().map(|[lo, hi]| {
                    let half = [0, 1, 2].map(|k| 0.5 * (hi[k] - lo[k]));
                    ([0, 1, 2].map(|k| 0.5 * (hi[k] + lo[k])), dot(half, half).sqrt() * LARGER)
                });
                let list = if instance.fixed { &mut out.fixed } else { &mut out.moving };
                list.push(out.targets.len() as u32);
                out.targets.push(Target { instance: index as u32, mask_id: instance.mask_id, solid, sphere });
            }
        });
        out
    }

    /// Indices of the instances that can be hit.
    pub fn instances(&self) -> impl Iterator<Item = usize> {
        self.targets.iter().map(|t| t.instance as usize)
    }

    /// How many instances can be hit.
    pub fn len(&self) -> usize {
        self.targets.len()
    }

    /// Whether nothing can be hit.
    pub fn is_empty(&self) -> bool {
        self.targets.is_empty()
    }

    /// How many of them never move.
    pub fn fixed_count(&self) -> usize {
        self.fixed.len()
    }

    /// How many of them may move.
    pub(crate) fn moving_count(&self) -> usize {
        self.moving.len()
    }

    /// The poses of those that may move, from those of all instances.
    pub(crate) fn moving_poses(&self, poses: &[PoseF64]) -> impl Iterator<Item = PoseF64> {
        self.moving.iter().map(|&index| self.pose_of(index, poses))
    }

    fn pose_of(&self, index: u32, poses: &[PoseF64]) -> PoseF64 {
        poses[self.targets[index as usize].instance as usize]
    }

    /// A target at a pose; `None` where that is no pose: it cannot be hit there.
    fn place(&self, index: u32, pose: PoseF64) -> Option<Placed> {
        let target = &self.targets[index as usize];
        if !pose.is_finite() {
            return None;
        }
        let (middle, radius) = target.sphere.map_or(([0.0; 3], f64::INFINITY), |(m, r)| (pose.apply(m), r));
        Some(Placed { target: index, world_from_target: pose, middle, radius })
    }
}

impl FixedWorld {
    pub(crate) fn new(targets: &RayTargets, poses: &[PoseF64]) -> Self {
        let placed: Vec<Placed> =
            targets.fixed.iter().filter_map(|&t| targets.place(t, targets.pose_of(t, poses))).collect();
        let (mut in_tree, mut one_by_one): (Vec<u32>, Vec<u32>) =
            (0..placed.len() as u32).partition(|&k| placed[k as usize].radius < f64::from(f32::MAX));
        if in_tree.len() <= FEW {
            one_by_one.append(&mut in_tree);
            return Self { placed, tree: None, one_by_one };
        }
        let boxes: Vec<_> = in_tree.iter().map(|&k| targets.world_box(&placed[k as usize])).collect();
        let (bvh, order) = Bvh::build(&boxes);
        let order = order.into_iter().map(|i| in_tree[i as usize]).collect();
        Self { placed, tree: Some((bvh, order)), one_by_one }
    }

    /// Whether targets that do not move are where they were when this was built.
    pub(crate) fn is_at(&self, targets: &RayTargets, poses: &[PoseF64]) -> bool {
        let mut placed = self.placed.iter();
        let same = targets.fixed.iter().all(|&t| match targets.place(t, targets.pose_of(t, poses)) {
            None => true,
            Some(here) => {
                placed.next().is_some_and(|p| p.target == here.target && p.world_from_target == here.world_from_target)
            }
        });
        same && placed.next().is_none()
    }
}

impl RayTargets {
    /// The box around a target in the world, rounded outward.
    fn world_box(&self, placed: &Placed) -> [[f32; 3]; 2] {
        let [lo, hi] = self.targets[placed.target as usize].solid.bounds().unwrap_or([[0.0; 3]; 2]);
        let (middle, half) = ([0, 1, 2].map(|k| 0.5 * (lo[k] + hi[k])), [0, 1, 2].map(|k| 0.5 * (hi[k] - lo[k])));
        let pose = &placed.world_from_target;
        let at = pose.apply(middle);
        let reach = pose.rotation.map(|r| LARGER * (0..3).map(|k| r[k].abs() * half[k]).sum::<f64>());
        [
            [0, 1, 2].map(|k| ((at[k] - reach[k]) as f32).next_down()),
            [0, 1, 2].map(|k| ((at[k] + reach[k]) as f32).next_up()),
        ]
    }
}

impl RayWorld {
    /// Nothing is placed yet.
    pub fn new(targets: &Arc<RayTargets>) -> Self {
        Self::with_level(targets, Level::best())
    }

    pub(crate) fn with_level(targets: &Arc<RayTargets>, level: Level) -> Self {
        Self {
            targets: Arc::clone(targets),
            fixed: Arc::new(FixedWorld::default()),
            moving: Vec::with_capacity(targets.moving.len()),
            level,
            outer: Stack::default(),
            inner: Stack::default(),
        }
    }

    /// What can be hit.
    pub fn targets(&self) -> &Arc<RayTargets> {
        &self.targets
    }

    /// Puts everything where it is: `poses` are world from instance, one for every instance of the scene. What does not
    /// move is prepared anew only where it is elsewhere than before. A target whose pose is not finite is not hit.
    ///
    /// # Panics
    ///
    /// There are fewer poses than instances in the scene.
    #[track_caller]
    pub fn place(&mut self, poses: &[PoseF64]) {
        assert!(poses.len() >= self.targets.instances, "poses of another scene");
        if !self.fixed.is_at(&self.targets, poses) {
            self.fixed = Arc::new(FixedWorld::new(&self.targets, poses));
        }
        let targets = Arc::clone(&self.targets);
        self.place_moving(targets.moving_poses(poses));
    }

    /// The same, with what does not move already prepared, and the poses of what may move: [`RayTargets::moving_poses`].
    pub(crate) fn place_with(&mut self, fixed: &Arc<FixedWorld>, moving: &[PoseF64]) {
        if !Arc::ptr_eq(&self.fixed, fixed) {
            self.fixed = Arc::clone(fixed);
        }
        self.place_moving(moving.iter().copied());
    }

    fn place_moving(&mut self, poses: impl Iterator<Item = PoseF64>) {
        let targets = &self.targets;
        self.moving.clear();
        self.moving.extend(targets.moving.iter().zip(poses).filter_map(|(&t, pose)| targets.place(t, pose)));
    }

    /// The nearest hit of every ray, at a distance from 0 to `max_distance` \[m\]. Of two that are as near, the instance
    /// that comes first in the scene counts. A ray with a number that is not finite hits nothing.
    ///
    /// # Panics
    ///
    /// `hits` has another length than `rays`.
    #[track_caller]
    pub fn cast(&mut self, rays: &[Ray], max_distance: f64, hits: &mut [RayHit]) {
        assert_eq!(rays.len(), hits.len(), "as many hits as rays");
        hits.fill(RayHit::MISS);
        let level = self.level;
        at_level!(level, s => self.cast_at(s, rays, max_distance, hits));
    }

    #[inline(always)]
    fn cast_at<S: Simd>(&mut self, s: S, rays: &[Ray], max_distance: f64, hits: &mut [RayHit]) {
        s.vectorize(
            #[inline(always)]
            || {
                let Self { targets, fixed, moving, outer, inner, .. } = self;
                let single = fixed.one_by_one.iter().map(|&k| &fixed.placed[k as usize]);
                let all = single.chain(moving.iter());
                let bundle = Bundle::around(rays, max_distance);
                for placed in all.filter(|placed| bundle.may_meet(placed)) {
                    let target = &targets.targets[placed.target as usize];
                    target.solid.with(Sweep {
                        target,
                        placed,
                        rays,
                        hits: &mut *hits,
                        max_distance,
                        stack: &mut *inner,
                    });
                }
                let Some((bvh, order)) = &fixed.tree else { return };
                for (ray, hit) in rays.iter().zip(hits).filter(|(ray, _)| ray.is_finite()) {
                    bvh.walk(ray, hit.distance.min(max_distance), outer, |leaf, mut limit| {
                        for &k in &order[leaf] {
                            let placed = &fixed.placed[k as usize];
                            let target = &targets.targets[placed.target as usize];
                            if !placed.may_be_met(ray, limit) {
                                continue;
                            }
                            let local = ray.seen_from(&placed.world_from_target);
                            if let Some(touch) = target.solid.touch(&local, limit, inner) {
                                keep(hit, ray, target, placed, touch);
                                limit = hit.distance.min(max_distance);
                            }
                        }
                        limit
                    });
                }
            },
        );
    }
}

impl Placed {
    /// Whether a ray may meet the sphere around it at a distance up to `limit`.
    #[inline(always)]
    fn may_be_met(&self, ray: &Ray, limit: f64) -> bool {
        let to_middle = sub(self.middle, ray.origin);
        let t = dot(to_middle, ray.direction);
        // Where the ray is nearest to the middle; not by the difference of squares, which cancels.
        let beside = along(to_middle, -t, ray.direction);
        dot(beside, beside) <= self.radius * self.radius && t + self.radius >= 0.0 && t - self.radius <= limit
    }
}

/// The box around some rays.
struct Bundle {
    lo: V3,
    hi: V3,
}

impl Bundle {
    #[inline(always)]
    fn around(rays: &[Ray], max_distance: f64) -> Self {
        // An infinity times a zero would be no number.
        let far = max_distance.min(1e30);
        let mut all = Self { lo: [f64::INFINITY; 3], hi: [f64::NEG_INFINITY; 3] };
        for ray in rays {
            for k in 0..3 {
                let (a, b) = (ray.origin[k], ray.origin[k] + far * ray.direction[k]);
                all.lo[k] = all.lo[k].min(a.min(b));
                all.hi[k] = all.hi[k].max(a.max(b));
            }
        }
        all
    }

    /// Whether it meets the sphere around a target.
    #[inline(always)]
    fn may_meet(&self, placed: &Placed) -> bool {
        (0..3).all(|k| placed.middle[k] + placed.radius >= self.lo[k] && placed.middle[k] - placed.radius <= self.hi[k])
    }
}

/// Every ray against one target.
struct Sweep<'a> {
    target: &'a Target,
    placed: &'a Placed,
    rays: &'a [Ray],
    hits: &'a mut [RayHit],
    max_distance: f64,
    stack: &'a mut Stack,
}

impl ForShape for Sweep<'_> {
    #[inline(always)]
    fn run<T: RayShape>(self, shape: &T) {
        let Self { target, placed, rays, hits, max_distance, stack } = self;
        for (ray, hit) in rays.iter().zip(hits) {
            let limit = hit.distance.min(max_distance);
            if !ray.is_finite() || placed.radius < f64::INFINITY && !placed.may_be_met(ray, limit) {
                continue;
            }
            if let Some(touch) = shape.touch(&ray.seen_from(&placed.world_from_target), limit, stack) {
                keep(hit, ray, target, placed, touch);
            }
        }
    }
}

/// Keeps a touch that is nearer than the hit, or as near and of an instance that comes before.
#[inline(always)]
fn keep(hit: &mut RayHit, ray: &Ray, target: &Target, placed: &Placed, touch: Touch) {
    if touch.t < hit.distance || touch.t == hit.distance && target.instance < hit.instance {
        let normal = placed.world_from_target.rotate(touch.normal);
        let normal = if dot(normal, ray.direction) > 0.0 { normal.map(|x| 0.0 - x) } else { normal };
        *hit = RayHit { distance: touch.t, normal, instance: target.instance, mask_id: target.mask_id };
    }
}
