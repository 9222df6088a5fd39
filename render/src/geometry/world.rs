//! Ray casting against the targets of one environment.

use super::bvh::{Beam, Bvh, Traversal, TraversalStack};
use super::packet::{Packet, WIDTH};
use super::shape::{RayGeometry, RayShape, ShapeVisitor};
use super::triangle::ShearedPacket;
use crate::geometry::assets::RayAssetCache;
use crate::simd::{D, Simd, SimdLevel, at_level};
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::Intersection;
use kinetoscope_scene::vector::{V3, dot};
use kinetoscope_scene::{PoseF64, RenderScene};
use std::ops::Range;
use std::sync::Arc;

/// Up to this many fixed targets are tested one by one; more are put into a BVH.
const MAX_LINEAR_TARGETS: usize = 4;
/// Enlargement of bounding spheres: more than the rounding of the test, for targets down to a billionth of their
/// distance.
const BOUNDS_SCALE: f64 = 1.0 + 1e-6;
/// Targets of the BVH that a packet tests together; beyond that, rays go on one by one.
const MAX_PACKET_TARGETS: usize = 48;

/// The nearest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance \[m\]; +inf for a miss.
    pub distance: f64,
    /// Unit normal of the surface, facing the ray's origin, in the frame of the environment; 0 for a miss.
    pub normal: [f64; 3],
    /// Index of the instance in the scene; [`RayHit::NO_INSTANCE`] for a miss.
    pub instance: u32,
    /// The instance's mask id; 0 for a miss.
    pub mask_id: i32,
}

impl RayHit {
    /// Value of `instance` for a miss.
    pub const NO_INSTANCE: u32 = u32::MAX;
    /// A miss.
    pub const MISS: Self = Self { distance: f64::INFINITY, normal: [0.0; 3], instance: Self::NO_INSTANCE, mask_id: 0 };

    /// True if the ray hit a target.
    pub fn is_hit(&self) -> bool {
        self.instance != Self::NO_INSTANCE
    }
}

/// Targets: the instances of a scene that rays hit. Immutable, shared by all environments and threads.
#[derive(Clone, Debug)]
pub struct RayTargets {
    targets: Vec<Target>,
    /// Indices of the fixed targets; `moving` holds the others.
    fixed: Vec<u32>,
    moving: Vec<u32>,
    /// Number of instances in the scene.
    instances: usize,
}

#[derive(Clone, Debug)]
struct Target {
    instance: u32,
    mask_id: i32,
    /// True if rays can hit the target. Invisible targets keep their place: they may be visible in another environment.
    visible: bool,
    geometry: RayGeometry,
    /// Center and radius of the bounding sphere in the frame of the instance \[m\]; `None` for an unbounded shape.
    sphere: Option<(V3, f64)>,
}

/// A target at its pose in an environment.
#[derive(Clone, Copy, Debug)]
struct PlacedTarget {
    target: u32,
    world_from_target: PoseF64,
    /// Bounding sphere in the environment; radius +inf for an unbounded shape.
    center: V3,
    radius: f64,
}

/// Fixed targets placed at their poses: pose and bounding sphere of each, and a BVH over more than four bounded
/// targets. The geometry stays in [`RayTargets`]. One instance can serve all environments with the same [`RayTargets`]
/// and the same fixed poses.
#[derive(Clone, Debug, Default)]
pub struct FixedTargets {
    placed: Vec<PlacedTarget>,
    /// BVH over some of `placed`, and the indices of those; the others, all of them for `None`, are tested one by one.
    bvh: Option<(Bvh, Vec<u32>)>,
    unindexed: Vec<u32>,
}

/// Ray caster for one environment: targets at their poses. Keeps its scratch memory; use one per thread.
#[derive(Clone, Debug)]
pub struct RayWorld {
    targets: Arc<RayTargets>,
    fixed: Arc<FixedTargets>,
    moving: Vec<PlacedTarget>,
    level: SimdLevel,
    packets: Vec<Packet>,
    outer: TraversalStack,
    inner: TraversalStack,
}

impl RayTargets {
    /// Prepares the instances of `scene` with the indices `wanted`. Repeated indices count once; indices out of range
    /// are ignored. Invisible instances are never hit. Deformable instances keep the shape that they have in `scene`;
    /// ray-casting sensors leave them out. BVHs over meshes are taken from `assets`, or built.
    pub fn new(scene: &RenderScene, wanted: impl IntoIterator<Item = usize>, assets: &RayAssetCache) -> Self {
        let mut is_wanted = vec![false; scene.instances().len()];
        for index in wanted {
            if let Some(is_wanted) = is_wanted.get_mut(index) {
                *is_wanted = true;
            }
        }
        let mut out = Self { targets: vec![], fixed: vec![], moving: vec![], instances: is_wanted.len() };
        assets.with(|assets| {
            for (index, instance) in scene.instances().iter().enumerate().filter(|(index, _)| is_wanted[*index]) {
                let geometry = RayGeometry::from_shape(&instance.shape, assets);
                let sphere = geometry.bounds().map(|[lo, hi]| {
                    let half = [0, 1, 2].map(|k| 0.5 * (hi[k] - lo[k]));
                    ([0, 1, 2].map(|k| 0.5 * (hi[k] + lo[k])), dot(half, half).sqrt() * BOUNDS_SCALE)
                });
                let list = if instance.fixed { &mut out.fixed } else { &mut out.moving };
                list.push(out.targets.len() as u32);
                out.targets.push(Target {
                    instance: index as u32,
                    mask_id: instance.mask_id,
                    visible: instance.visible,
                    geometry,
                    sphere,
                });
            }
        });
        out
    }

    /// Indices of the target instances in the scene, in ascending order.
    pub fn instances(&self) -> impl Iterator<Item = usize> {
        self.targets.iter().map(|t| t.instance as usize)
    }

    /// Number of targets, invisible ones included.
    pub fn len(&self) -> usize {
        self.targets.len()
    }

    /// True if there are no targets.
    pub fn is_empty(&self) -> bool {
        self.targets.is_empty()
    }

    /// Number of fixed targets.
    pub fn fixed_count(&self) -> usize {
        self.fixed.len()
    }

    /// Number of targets that may move.
    pub fn moving_count(&self) -> usize {
        self.moving.len()
    }

    /// Poses of the targets that may move, in ascending order of their instances. `poses` has one pose for every
    /// instance of the scene.
    pub fn moving_poses(&self, poses: &[PoseF64]) -> impl Iterator<Item = PoseF64> {
        self.moving.iter().map(|&index| self.pose_of(index, poses))
    }

    fn pose_of(&self, index: u32, poses: &[PoseF64]) -> PoseF64 {
        poses[self.targets[index as usize].instance as usize]
    }

    /// Target `index` of this list at `pose` (world from instance); `None` if the pose is not finite or the target is
    /// invisible.
    fn place(&self, index: u32, pose: PoseF64) -> Option<PlacedTarget> {
        let target = &self.targets[index as usize];
        if !pose.is_finite() || !target.visible {
            return None;
        }
        let (center, radius) = target.sphere.map_or(([0.0; 3], f64::INFINITY), |(m, r)| (pose.apply(m), r));
        Some(PlacedTarget { target: index, world_from_target: pose, center, radius })
    }
}

impl FixedTargets {
    /// Places the fixed targets. `poses` (world from instance) has one pose for every instance of the scene, moving
    /// ones included. Invisible targets and targets with a pose that is not finite are skipped.
    ///
    /// # Panics
    ///
    /// If `poses` has fewer elements than the scene has instances.
    pub fn new(targets: &RayTargets, poses: &[PoseF64]) -> Self {
        let placed: Vec<PlacedTarget> =
            targets.fixed.iter().filter_map(|&t| targets.place(t, targets.pose_of(t, poses))).collect();
        let (mut in_tree, mut unindexed): (Vec<u32>, Vec<u32>) =
            (0..placed.len() as u32).partition(|&k| placed[k as usize].radius < f64::from(f32::MAX));
        if in_tree.len() <= MAX_LINEAR_TARGETS {
            unindexed.append(&mut in_tree);
            return Self { placed, bvh: None, unindexed };
        }
        let (bvh, order) = Bvh::build(in_tree.iter().map(|&k| targets.world_box(&placed[k as usize])));
        let order = order.into_iter().map(|i| in_tree[i as usize]).collect();
        Self { placed, bvh: Some((bvh, order)), unindexed }
    }

    /// True if the visible fixed targets of `targets` are still at the poses of [`new`](Self::new), and no other fixed
    /// target is visible. `poses` is as in `new`.
    pub fn is_at(&self, targets: &RayTargets, poses: &[PoseF64]) -> bool {
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
    /// Bounding box of a target in the world, rounded outward.
    fn world_box(&self, placed: &PlacedTarget) -> [[f32; 3]; 2] {
        let [lo, hi] = self.targets[placed.target as usize].geometry.bounds().unwrap_or([[0.0; 3]; 2]);
        let (middle, half) = ([0, 1, 2].map(|k| 0.5 * (lo[k] + hi[k])), [0, 1, 2].map(|k| 0.5 * (hi[k] - lo[k])));
        let pose = &placed.world_from_target;
        let at = pose.apply(middle);
        let reach = pose.rotation.map(|r| BOUNDS_SCALE * (0..3).map(|k| r[k].abs() * half[k]).sum::<f64>());
        [
            [0, 1, 2].map(|k| ((at[k] - reach[k]) as f32).next_down()),
            [0, 1, 2].map(|k| ((at[k] + reach[k]) as f32).next_up()),
        ]
    }
}

impl RayWorld {
    /// Creates a ray caster without placed targets: rays hit nothing before [`place`](Self::place).
    pub fn new(targets: &Arc<RayTargets>) -> Self {
        Self::with_level(targets, SimdLevel::best())
    }

    pub(crate) fn with_level(targets: &Arc<RayTargets>, level: SimdLevel) -> Self {
        Self {
            targets: Arc::clone(targets),
            fixed: Arc::new(FixedTargets::default()),
            moving: Vec::with_capacity(targets.moving.len()),
            level,
            packets: Vec::new(),
            outer: TraversalStack::default(),
            inner: TraversalStack::default(),
        }
    }

    /// Targets that rays are cast against.
    pub fn targets(&self) -> &Arc<RayTargets> {
        &self.targets
    }

    /// Places all targets: `poses` are world from instance, one for every instance of the scene. Fixed targets are
    /// prepared again only if a fixed pose changed. A target with a non-finite pose is never hit.
    ///
    /// # Panics
    ///
    /// If there are fewer poses than instances in the scene.
    #[track_caller]
    pub fn place(&mut self, poses: &[PoseF64]) {
        assert!(poses.len() >= self.targets.instances, "fewer poses than instances of the scene");
        if !self.fixed.is_at(&self.targets, poses) {
            self.fixed = Arc::new(FixedTargets::new(&self.targets, poses));
        }
        let targets = Arc::clone(&self.targets);
        self.place_moving(targets.moving_poses(poses));
    }

    /// Replaces the targets and places them. `fixed` must be built for `targets`. `moving` holds one pose (world from
    /// instance) per moving target, in the order of [`RayTargets::moving_poses`]; targets without a pose are never hit.
    pub fn place_with(&mut self, targets: &Arc<RayTargets>, fixed: &Arc<FixedTargets>, moving: &[PoseF64]) {
        if !Arc::ptr_eq(&self.targets, targets) {
            self.targets = Arc::clone(targets);
        }
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

    /// Finds the nearest hit of every ray, at a distance from 0 to `max_distance` \[m\]. Of equally near instances, the
    /// first of the scene counts. A ray with a non-finite number hits nothing.
    ///
    /// # Panics
    ///
    /// If `hits` and `rays` differ in length.
    #[track_caller]
    pub fn cast(&mut self, rays: &[Ray], max_distance: f64, hits: &mut [RayHit]) {
        assert_eq!(rays.len(), hits.len(), "the numbers of rays and hits must be equal");
        hits.fill(RayHit::MISS);
        let level = self.level;
        at_level!(level, s => self.cast_at(s, rays, max_distance, hits));
    }

    fn cast_at<S: Simd>(&mut self, s: S, rays: &[Ray], max_distance: f64, hits: &mut [RayHit]) {
        let Self { targets, fixed, moving, packets, outer, inner, .. } = self;
        packets.clear();
        let bundle = s.vectorize(
            #[inline(always)]
            || {
                packets.extend(rays.chunks(WIDTH).map(|rays| Packet::from_rays(rays, max_distance)));
                RayBounds::enclosing(s, packets, max_distance)
            },
        );
        let single = fixed.unindexed.iter().map(|&k| &fixed.placed[k as usize]);
        for placed in single.chain(moving.iter()).filter(|placed| bundle.may_intersect(placed)) {
            cast_target(s, targets, placed, packets, hits, inner);
        }
        for (packet, hits) in packets.iter_mut().zip(hits.chunks_mut(WIDTH)) {
            fixed.cast_bvh(s, targets, packet, hits, [&mut *outer, &mut *inner]);
        }
    }
}

impl FixedTargets {
    /// Casts the rays of a packet against the BVH; keeps hits that are nearer than those in `hits`, or as near and of
    /// an earlier instance.
    fn cast_bvh<S: Simd>(
        &self,
        s: S,
        targets: &RayTargets,
        packet: &mut Packet,
        hits: &mut [RayHit],
        [outer, inner]: [&mut TraversalStack; 2],
    ) {
        let Some((bvh, order)) = &self.bvh else { return };
        let mut leaf = |leaf: Range<usize>, packet: &mut Packet| {
            for &k in &order[leaf] {
                cast_target(s, targets, &self.placed[k as usize], std::slice::from_mut(packet), hits, inner);
            }
        };
        s.vectorize(
            #[inline(always)]
            || {
                let limits = packet.limits(s);
                if let Some(shear) = ShearedPacket::new(s, packet)
                    && let Some(beam) = Beam::enclosing(s, packet, &shear, bvh)
                {
                    let walked = bvh.traverse_beam(
                        &beam,
                        limits,
                        MAX_PACKET_TARGETS,
                        outer,
                        #[inline(always)]
                        |things| {
                            leaf(things, packet);
                            Some(packet.limits(s))
                        },
                    );
                    if walked == Traversal::Complete {
                        return;
                    }
                }
                for k in (0..WIDTH).filter(|&k| packet.is_active(k)) {
                    let mut one = packet.single(k);
                    bvh.traverse(&packet.ray(k), packet.limit(k), outer, |things, _| {
                        leaf(things, &mut one);
                        one.limit(k)
                    });
                }
            },
        );
    }
}

/// Casts all packets against one target; keeps hits that are nearer than those in `hits`, or as near and of an earlier
/// instance.
fn cast_target<S: Simd>(
    s: S,
    targets: &RayTargets,
    placed: &PlacedTarget,
    packets: &mut [Packet],
    hits: &mut [RayHit],
    stack: &mut TraversalStack,
) {
    let target = &targets.targets[placed.target as usize];
    target.geometry.with(CastTarget { s, target, placed, packets, hits, stack });
}

/// Bounding box of several rays.
struct RayBounds {
    lo: V3,
    hi: V3,
}

impl RayBounds {
    #[inline(always)]
    fn enclosing<S: Simd>(s: S, packets: &[Packet], max_distance: f64) -> Self {
        // Infinity times zero would be NaN.
        let far = max_distance.min(1e30);
        let (mut lo, mut hi) = ([D::splat(s, f64::INFINITY); 3], [D::splat(s, f64::NEG_INFINITY); 3]);
        for packet in packets {
            let (origin, direction) = (packet.origins(s), packet.directions(s));
            for k in 0..3 {
                let (a, b) = (origin[k], origin[k] + direction[k] * far);
                (lo[k], hi[k]) = (lo[k].min(a.min(b)), hi[k].max(a.max(b)));
            }
        }
        let ([x, y, z], [a, b, c]) = (lo, hi);
        Self {
            lo: [x.reduce_min(), y.reduce_min(), z.reduce_min()],
            hi: [a.reduce_max(), b.reduce_max(), c.reduce_max()],
        }
    }

    /// True if the box may meet the bounding sphere of a target.
    #[inline(always)]
    fn may_intersect(&self, placed: &PlacedTarget) -> bool {
        (0..3).all(|k| placed.center[k] + placed.radius >= self.lo[k] && placed.center[k] - placed.radius <= self.hi[k])
    }
}

/// Work of casting every ray against one target.
struct CastTarget<'a, S> {
    s: S,
    target: &'a Target,
    placed: &'a PlacedTarget,
    packets: &'a mut [Packet],
    hits: &'a mut [RayHit],
    stack: &'a mut TraversalStack,
}

impl<S: Simd> ShapeVisitor for CastTarget<'_, S> {
    /// Compiled once for each shape and instruction set.
    #[inline(never)]
    fn run<T: RayShape>(self, shape: &T) {
        let Self { s, target, placed, packets, hits, stack } = self;
        let pose = &placed.world_from_target;
        s.vectorize(
            #[inline(always)]
            || {
                for (packet, hits) in packets.iter_mut().zip(hits.chunks_mut(WIDTH)) {
                    let Some(local) = packet.in_local_frame(s, pose, placed.center, placed.radius) else { continue };
                    let mut touches = [None; WIDTH];
                    shape.intersect_packet(s, &local, stack, &mut touches);
                    for (k, hit) in hits.iter_mut().enumerate() {
                        if let Some(touch) = touches[k] {
                            keep_closest(hit, packet.ray(k).direction, target, placed, touch);
                            packet.limit_to(k, hit.distance);
                        }
                    }
                }
            },
        );
    }
}

/// Keeps a hit that is nearer, or as near and of an earlier instance.
#[inline(always)]
fn keep_closest(hit: &mut RayHit, direction: V3, target: &Target, placed: &PlacedTarget, touch: Intersection) {
    if touch.t < hit.distance || touch.t == hit.distance && target.instance < hit.instance {
        let normal = placed.world_from_target.rotate(touch.normal);
        let normal = if dot(normal, direction) > 0.0 { normal.map(|x| 0.0 - x) } else { normal };
        *hit = RayHit { distance: touch.t, normal, instance: target.instance, mask_id: target.mask_id };
    }
}
