//! Ray-traced visibility: hits of arbitrary rays, and a visibility buffer filled by the rays of its samples.
//!
//! Two levels of BVHs. The lower level has one BVH per mesh, in the mesh's own frame: built once, shared by all
//! environments, and the same that ray casters use. The upper level is a BVH over the boxes of a frame's instances,
//! built for every frame (`instance_bvh`). Shapes with a closed form are intersected exactly; height fields as the
//! triangles that the rasterizer draws. Hits are in double precision;
//! groups of rays choose the instances that they may hit in single precision, with a margin (`group`).
//!
//! The rays of an image need no upper BVH: an instance is tested only within the rectangle of the image that it covers.
//! There its rays are cast in packets of eight, the nearest instances first. The rays fill the rasterizer's own
//! visibility buffer, so every channel comes from the same code.

mod group;
mod instance_bvh;
pub(crate) mod motion;

use super::raster::tile::{BLOCK, BLOCK_AREA, Tile};
use super::raster::{DrawItem, Layer, PlacedInstance};
use crate::geometry::assets::{AssetCache, RayAssetCache};
use crate::geometry::bvh::TraversalStack;
use crate::geometry::packet::{Packet, WIDTH};
use crate::geometry::shape::mesh::MeshBvh;
use crate::geometry::triangle::ShearedPacket;
use crate::lens::ViewCone;
use crate::lens::rays::LensRays;
use crate::simd::{self, M, Simd, splat};
use crate::visibility::Projection;
pub(crate) use group::{Candidates, RayGroup, lanes_of};
use instance_bvh::InstanceBvh;
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::vector::{V3, add_scaled, dot, scale};
use kinetoscope_scene::{Instance, Marker, PoseF32, PoseF64, RenderScene};
use motion::{Motion, orthonormalized, pose_to_f64};
use std::sync::Arc;

/// Largest number of surfaces of a transparent instance that a shadow ray passes.
const MAX_FRONT_HITS: usize = 64;
/// Offset of rays past a surface, as a fraction of the largest coordinate.
const RAY_OFFSET: f64 = 1e-9;

/// Offsets of the samples of a packet from the first one \[pixels\].
type SampleOffsets = [[usize; 2]; WIDTH];
/// A compact block: fewer triangles are between its rays than between those of a row.
const BLOCK_OFFSETS: SampleOffsets = [[0, 0], [1, 0], [2, 0], [3, 0], [0, 1], [1, 1], [2, 1], [3, 1]];
/// A row, for images whose rows show different instants.
const ROW_OFFSETS: SampleOffsets = [[0, 0], [1, 0], [2, 0], [3, 0], [4, 0], [5, 0], [6, 0], [7, 0]];

/// Geometry of an instance that rays hit, in its own frame.
#[derive(Clone, Debug)]
enum InstanceGeometry {
    /// Triangles: the mesh, and its BVH.
    Mesh(Arc<RenderMesh>, Arc<MeshBvh>),
    /// A shape with a closed form.
    Closed(Shape),
}

/// An instance placed in the world.
#[derive(Clone, Copy, Debug)]
struct TracedInstance {
    instance: u32,
    world_from_instance: PoseF64,
    /// Motion during the exposure; `None` for a static instance.
    motion: Option<Motion>,
    /// Opacity.
    alpha: f64,
    /// False for markers: they show measurements and are not part of the scene.
    casts_shadow: bool,
}

/// Hit of a ray with a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hit {
    /// Distance \[m\].
    pub(crate) distance: f64,
    pub(crate) instance: u32,
    /// Index of the triangle in the instance's mesh; 0 for a closed form.
    pub(crate) triangle: u32,
    /// Outward unit normal, world frame.
    pub(crate) normal: V3,
    /// Pose of the instance.
    pub(crate) world_from_instance: PoseF64,
}

/// A camera whose rays are cast, and the placed instances.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraView<'a> {
    pub(crate) projection: &'a Projection,
    /// Rays of a lens that bends them; `None` for a pinhole.
    pub(crate) lens: Option<&'a LensRays>,
    pub(crate) placed: &'a [PlacedInstance],
    /// First id of each instance in the visibility buffer.
    pub(crate) first_ids: &'a [u32],
}

/// Ray tracer of a frame; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct RayTracer {
    /// Geometry of each instance; `None` for hidden instances.
    geometries: Vec<Option<InstanceGeometry>>,
    instances: Vec<TracedInstance>,
    /// Unbounded instances, which are outside of the BVH.
    unbounded: Vec<u32>,
    bvh: InstanceBvh,
    /// Bounds of each element of `instances`; [`RoundBounds::ALL`] for unbounded and moving ones.
    round_bounds: Vec<RoundBounds>,
}

/// Bounds of an instance in the world: a ball, and a cylinder without ends through its center. Both are enlarged by the
/// error of single precision.
#[derive(Clone, Copy, Debug)]
struct RoundBounds {
    center: [f32; 3],
    radius: f32,
    /// Unit vector along the longest side.
    axis: [f32; 3],
    /// Radius of the cylinder \[m\].
    across: f32,
}

impl RoundBounds {
    /// Enlargement, as a fraction of size and coordinates.
    const MARGIN: f64 = 1e-3;

    /// Bounds that every ray meets. Squares of the radii are finite.
    const ALL: Self = Self { center: [0.0; 3], radius: 1e18, axis: [0.0, 0.0, 1.0], across: 1e18 };

    fn new(pose: &PoseF64, [lo, hi]: [V3; 2]) -> Self {
        let half = [0, 1, 2].map(|k| 0.5 * (hi[k] - lo[k]));
        let middle = [0, 1, 2].map(|k| 0.5 * (hi[k] + lo[k]));
        let center: V3 = [0, 1, 2].map(|k| dot(pose.rotation[k], middle) + pose.translation[k]);
        let longest = (0..3).fold(0, |best, k| if half[k] > half[best] { k } else { best });
        let square = dot(half, half);
        let pad = Self::MARGIN * (square.sqrt() + center.iter().fold(0.0f64, |most, x| most.max(x.abs())));
        Self {
            center: center.map(|x| x as f32),
            radius: (square.sqrt() + pad) as f32,
            axis: pose.rotation.map(|row| row[longest] as f32),
            across: ((square - half[longest] * half[longest]).max(0.0).sqrt() + pad) as f32,
        }
    }

    /// The rays of a group that may hit the instance.
    #[inline(always)]
    fn may_intersect<S: Simd>(&self, s: S, RayGroup { origin, direction }: RayGroup<S>) -> M<S> {
        let to = simd::V3::splat(s, self.center).sub(origin);
        let (square, along) = (to.dot(to), to.dot(direction));
        let radius = self.radius * self.radius;
        // The differences lose digits, in proportion to the distance. Numbers that overflow are no reason to leave it out.
        let near = !(square - along * along).simd_gt(square * 1e-6 + radius)
            & !(along.simd_lt(splat(s, 0.0)) & square.simd_gt(splat(s, radius)));
        let across = direction.cross(simd::V3::splat(s, self.axis));
        let distance = to.dot(across);
        let limit = (square * 1e-9 + self.across * self.across) * across.dot(across);
        near & !(distance * distance).simd_gt(limit + square * 1e-12)
    }
}

impl InstanceGeometry {
    fn of(instance: &Instance, known: Option<Self>, assets: &mut AssetCache) -> Self {
        let Some(mesh) = instance.shape.mesh() else { return Self::Closed(instance.shape.clone()) };
        match known {
            Some(Self::Mesh(of, tree)) if Arc::ptr_eq(&of, mesh) => Self::Mesh(of, tree),
            _ => Self::Mesh(Arc::clone(mesh), assets.mesh(mesh)),
        }
    }

    /// Nearest hit of a ray in the frame of the instance at a distance from 0 to `limit` \[m\]; `None` without one.
    #[inline(always)]
    fn intersect(&self, instance_index: u32, local: &Ray, limit: f64, stack: &mut TraversalStack) -> Option<RayHit> {
        match self {
            Self::Mesh(_, tree) => {
                let (distance, index) = tree.closest_hit(local, limit, None, stack)?;
                Some(RayHit { instance_index, distance, index, normal: [0.0; 3] })
            }
            Self::Closed(shape) => {
                let at = shape.intersect(local, limit)?;
                // These shapes are convex around their origin: the position of a surface point is its outward
                // direction. Points of a plane have no height, so planes are excluded.
                let inward = dot(at.normal, local.at(at.t)) < 0.0 && !shape.is_one_sided();
                let normal = scale(at.normal, if inward { -1.0 } else { 1.0 });
                Some(RayHit { instance_index, distance: at.t, index: 0, normal })
            }
        }
    }

    /// Bounding box in the frame of the instance: smallest and largest coordinates \[m\]; `None` for an unbounded
    /// shape.
    fn bounds(&self) -> Option<[V3; 2]> {
        match self {
            Self::Mesh(_, tree) => Some(tree.bounds()),
            Self::Closed(shape) => shape.bounds(),
        }
    }
}

impl TracedInstance {
    /// Pose in the world at a time from 0 to [`END_TIME`](motion::END_TIME).
    #[inline(always)]
    fn at(&self, time: f64) -> PoseF64 {
        self.motion.as_ref().map_or(self.world_from_instance, |motion| motion.at(time))
    }
}

impl RayTracer {
    pub(crate) fn bytes(&self) -> usize {
        self.geometries.capacity() * size_of::<Option<InstanceGeometry>>()
            + self.instances.capacity() * size_of::<TracedInstance>()
            + self.unbounded.capacity() * size_of::<u32>()
            + self.round_bounds.capacity() * size_of::<RoundBounds>()
            + self.bvh.bytes()
    }

    /// Finds the BVHs of all instances that `keep` does not hide, and builds the missing ones.
    pub(crate) fn prepare_geometry(
        &mut self,
        scene: &RenderScene,
        assets: &RayAssetCache,
        keep: impl Fn(&Instance) -> Layer,
    ) {
        let instances = scene.instances();
        self.geometries.resize_with(instances.len(), || None);
        // All under one lock: scratch memory is kept from one mesh to the next.
        assets.with(|assets| {
            for (body, instance) in self.geometries.iter_mut().zip(instances) {
                *body = match keep(instance) {
                    Layer::Hidden => None,
                    _ => Some(InstanceGeometry::of(instance, body.take(), assets)),
                };
            }
        });
    }

    /// Places all instances, for rays in any direction at any time. `before` holds the poses at time 0; without it, all
    /// instances are static. [`prepare_geometry`](Self::prepare_geometry) must be called before.
    pub(crate) fn place(&mut self, scene: &RenderScene, poses: &[PoseF32], before: Option<&[PoseF32]>) {
        let Self { geometries, instances: things, unbounded, bvh, round_bounds } = self;
        round_bounds.clear();
        things.clear();
        unbounded.clear();
        bvh.clear();
        for (k, body) in geometries.iter().enumerate() {
            let Some(body) = body else { continue };
            let world_from_instance = orthonormalized(&poses[k]);
            let thing = things.len() as u32;
            let alpha = f64::from(scene.instances()[k].material.rgba[3].min(1.0));
            let motion = before.and_then(|before| Motion::between(before.get(k)?, &poses[k]));
            let casts_shadow = scene.instances()[k].group != Marker::GROUP;
            things.push(TracedInstance { instance: k as u32, world_from_instance, motion, alpha, casts_shadow });
            round_bounds.push(match (body.bounds(), motion) {
                (Some(bounds), None) => {
                    bvh.add(thing, &world_from_instance, bounds);
                    RoundBounds::new(&world_from_instance, bounds)
                }
                (Some(bounds), Some(motion)) => {
                    bvh.add_moving(thing, &motion, bounds);
                    RoundBounds::ALL
                }
                (None, _) => {
                    unbounded.push(thing);
                    RoundBounds::ALL
                }
            });
        }
        bvh.build();
    }

    /// True if all instances that are not hidden have bounds, but for `instance`.
    pub(crate) fn is_bounded_without(&self, instance: u32) -> bool {
        self.unbounded.iter().all(|&thing| self.instances[thing as usize].instance == instance)
    }

    /// Pose of an instance in the world at a time from 0 to [`END_TIME`](motion::END_TIME); `None` for hidden
    /// instances.
    pub(crate) fn pose_of(&self, instance: u32, time: f64) -> Option<PoseF64> {
        let thing = self.instances.binary_search_by_key(&instance, |thing| thing.instance).ok()?;
        Some(self.instances[thing].at(time))
    }

    /// Finds the nearest surface at a distance from 0 to `limit` \[m\], at a time; `None` without one. One copy per
    /// instruction set.
    #[inline(never)]
    pub(crate) fn closest_hit<S: Simd>(
        &self,
        s: S,
        ray: &Ray,
        limit: f64,
        time: f64,
        stack: &mut TraversalStack,
    ) -> Option<Hit> {
        s.vectorize(
            #[inline(always)]
            || {
                let (mut best, mut limit): (Option<RayHit>, f64) = (None, limit);
                let mut meet = {
                    #[inline(always)]
                    |thing: u32, limit: f64| {
                        let Some(found) = self.intersect(thing, ray, limit, time, stack) else { return limit };
                        if best.is_none_or(|best| found.precedes(&best)) {
                            best = Some(found);
                        }
                        limit.min(found.distance)
                    }
                };
                for &thing in &self.unbounded {
                    limit = meet(thing, limit);
                }
                self.bvh.traverse(ray, limit, meet);
                self.hit(best?, time)
            },
        )
    }

    /// Fraction of light that passes along a ray from distance 0 to `limit` \[m\], at a time: 0 past an opaque surface,
    /// and `1 - alpha` past each front of a transparent one. Markers are ignored. One copy per instruction set.
    #[inline(never)]
    pub(crate) fn transmittance<S: Simd>(
        &self,
        s: S,
        ray: &Ray,
        limit: f64,
        time: f64,
        stack: &mut TraversalStack,
    ) -> f64 {
        s.vectorize(
            #[inline(always)]
            || {
                let mut left = 1.0;
                let mut meet = {
                    #[inline(always)]
                    |thing: u32, limit: f64| {
                        let placed @ TracedInstance { instance, alpha, casts_shadow, .. } =
                            &self.instances[thing as usize];
                        if !casts_shadow {
                            return limit;
                        }
                        if *alpha < 1.0 {
                            left *= (1.0 - alpha).powi(self.front_hits(thing, ray, limit, time, stack));
                            return limit;
                        }
                        let local = ray.inverse_transformed_by(&placed.at(time));
                        let blocked = match &self.geometries[*instance as usize] {
                            Some(InstanceGeometry::Mesh(_, tree)) => tree.any_hit(&local, limit, stack),
                            Some(InstanceGeometry::Closed(shape)) => shape.intersect(&local, limit).is_some(),
                            None => false,
                        };
                        if !blocked {
                            return limit;
                        }
                        left = 0.0;
                        // A negative limit ends the traversal.
                        -1.0
                    }
                };
                let mut limit = limit;
                for &thing in &self.unbounded {
                    limit = meet(thing, limit);
                }
                self.bvh.traverse(ray, limit, meet);
                left
            },
        )
    }

    /// Number of front surfaces of an instance that a ray passes, at most [`MAX_FRONT_HITS`].
    #[inline(never)]
    fn front_hits(&self, thing: u32, ray: &Ray, limit: f64, time: f64, stack: &mut TraversalStack) -> i32 {
        // Closed forms are convex: all surfaces after the first are backs.
        let body = &self.geometries[self.instances[thing as usize].instance as usize];
        let most = if matches!(body, Some(InstanceGeometry::Closed(_))) { 1 } else { MAX_FRONT_HITS };
        let (mut from, mut left, mut count) = (*ray, limit, 0);
        for _ in 0..most {
            let found_hit = self.intersect(thing, &from, left, time, stack);
            let Some(hit) = found_hit.and_then(|found| self.hit(found, time)) else { break };
            count += i32::from(dot(hit.normal, ray.direction) < 0.0);
            let onward =
                hit.distance + RAY_OFFSET * from.origin.iter().fold(hit.distance.max(1.0), |m, x| m.max(x.abs()));
            from.origin = add_scaled(from.origin, onward, from.direction);
            left -= onward;
        }
        count
    }

    /// Nearest hit of a ray and one instance at a distance from 0 to `limit` \[m\], at a time; `None` without one.
    #[inline(always)]
    fn intersect(
        &self,
        instance_index: u32,
        ray: &Ray,
        limit: f64,
        time: f64,
        stack: &mut TraversalStack,
    ) -> Option<RayHit> {
        let placed @ TracedInstance { instance, .. } = &self.instances[instance_index as usize];
        let local = ray.inverse_transformed_by(&placed.at(time));
        self.geometries[*instance as usize].as_ref()?.intersect(instance_index, &local, limit, stack)
    }

    /// Index of the instance of a hit in the scene.
    #[inline(always)]
    pub(crate) fn instance_of(&self, hit: &RayHit) -> u32 {
        self.instances[hit.instance_index as usize].instance
    }

    /// The surface of a hit on a static instance.
    #[inline(always)]
    pub(crate) fn surface(&self, hit: &RayHit) -> Option<Hit> {
        self.hit(*hit, motion::END_TIME)
    }

    fn hit(&self, found: RayHit, time: f64) -> Option<Hit> {
        let placed @ TracedInstance { instance, .. } = &self.instances[found.instance_index as usize];
        let world_from_instance = placed.at(time);
        let (triangle, normal) = match self.geometries[*instance as usize].as_ref()? {
            InstanceGeometry::Mesh(_, tree) => (tree.mesh_index(found.index), tree.normal(found.index)?),
            InstanceGeometry::Closed(_) => (0, found.normal),
        };
        let normal = world_from_instance.rotate(normal);
        Some(Hit { distance: found.distance, instance: *instance, triangle, normal, world_from_instance })
    }

    /// Casts the rays of all samples where an instance may be visible, into a visibility buffer. One copy per
    /// instruction set.
    #[inline(never)]
    pub(crate) fn draw<S: Simd>(
        &self,
        s: S,
        stack: &mut TraversalStack,
        tile: &mut Tile,
        view: &CameraView<'_>,
        item: &DrawItem,
    ) {
        let Some(area) = tile.overlap(item.rect) else { return };
        let index = item.instance as usize;
        let Some(body) = &self.geometries[index] else { return };
        let &CameraView { projection, lens: lens_rays, placed, first_ids } = view;
        let lens = LocalCameraRays::new(projection, &placed[index]);
        let sight = lens_rays.zip(body.bounds()).map_or(ViewCone::All, |(_, bounds)| view_cone(&placed[index], bounds));
        s.vectorize(
            #[inline(always)]
            || {
                for by in area[1]..=area[3] {
                    for bx in area[0]..=area[2] {
                        if lens_rays.is_some_and(|rays| !rays.may_contain([bx, by], &sight)) {
                            continue;
                        }
                        let block = tile.block(bx, by);
                        if tile.is_occluded(block, item.nearness) {
                            continue;
                        }
                        tile.prepare_block(block);
                        let mut drawn = false;
                        let offsets = tile.offsets;
                        for (plane, offset) in offsets.iter().enumerate().take(tile.planes) {
                            let [dx, dy] = offset.map(|x| f64::from(x) / 256.0 + 0.5);
                            let samples = tile.samples(block, plane);
                            let (side, parts) = if tile.only_row.is_some() {
                                (&ROW_OFFSETS, 1)
                            } else {
                                (&BLOCK_OFFSETS, BLOCK_AREA / WIDTH)
                            };
                            for part in 0..parts {
                                let [x, y] = tile.only_row.map_or([4 * (part % 2), part & !1], |row| [0, row]);
                                let first = [bx * BLOCK + x, by * BLOCK + y];
                                let at = side.map(|[i, j]| samples + (y + j) * BLOCK + x + i);
                                let rays = match lens_rays {
                                    None => lens.pinhole([first[0] as f64 + dx, first[1] as f64 + dy], side),
                                    Some(rays) => lens.lens_directions(rays, plane, first, side),
                                };
                                let (nearness, ids) = (&mut *tile.nearness, &mut *tile.id);
                                let samples = TileSamples { nearness, ids, at };
                                drawn |= lens.cast(s, body, rays, stack, samples, first_ids[index]);
                            }
                        }
                        if drawn {
                            tile.mark_dirty(block);
                        }
                    }
                }
            },
        );
    }
}

/// Hit of a ray, as far as needed for comparisons.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayHit {
    /// Index in [`RayTracer::instances`].
    instance_index: u32,
    /// Distance \[m\].
    pub(crate) distance: f64,
    /// Position of the triangle in its BVH.
    index: usize,
    /// Outward normal of a closed form, in its own frame.
    normal: V3,
}

impl RayHit {
    /// True if this hit counts rather than `other`: it is nearer, or as near on a later instance.
    fn precedes(&self, other: &Self) -> bool {
        self.distance < other.distance || self.distance == other.distance && self.instance_index > other.instance_index
    }
}

/// Bounding cone of an instance, from bounds in its own frame.
fn view_cone(placed: &PlacedInstance, [lo, hi]: [V3; 2]) -> ViewCone {
    let half = [0, 1, 2].map(|k| 0.5 * (hi[k] - lo[k]));
    let pose = pose_to_f64(&placed.camera_from_instance);
    // A margin, because poses are single precision.
    let size = lo.iter().chain(&hi).chain(&pose.translation).fold(0.0f64, |m, x| m.max(x.abs()));
    ViewCone::of_sphere(pose.apply([0, 1, 2].map(|k| 0.5 * (lo[k] + hi[k]))), dot(half, half).sqrt() + 1e-6 * size)
}

/// Eight samples of a tile.
struct TileSamples<'a> {
    /// Nearness of all samples of the tile.
    nearness: &'a mut [f32],
    /// Ids of all samples of the tile.
    ids: &'a mut [u32],
    /// Indices of the eight samples in `nearness` and `ids`.
    at: [usize; WIDTH],
}

/// Camera rays in the frame of an instance.
struct LocalCameraRays {
    rotation: [V3; 3],
    origin: V3,
    c: [f64; 2],
    f: [f64; 2],
    near: f64,
}

impl LocalCameraRays {
    fn new(projection: &Projection, placed: &PlacedInstance) -> Self {
        let pose = pose_to_f64(&placed.local.instance_from_camera);
        Self {
            rotation: pose.rotation,
            origin: pose.translation,
            c: [projection.cx, projection.cy].map(f64::from),
            f: [projection.fx, projection.fy].map(f64::from),
            near: f64::from(projection.near),
        }
    }

    /// Rays of eight samples of a pinhole camera, in the optical frame; the first one is at (u, v).
    #[inline(always)]
    fn pinhole(&self, [u, v]: [f64; 2], side: &SampleOffsets) -> [V3; WIDTH] {
        let mut rays = [[0.0, 0.0, 1.0]; WIDTH];
        for (ray, [i, j]) in rays.iter_mut().zip(side) {
            *ray = [(u + *i as f64 - self.c[0]) / self.f[0], (v + *j as f64 - self.c[1]) / self.f[1], 1.0];
        }
        rays
    }

    /// Rays of one sample plane of eight pixels through a lens; 0 for samples without a ray.
    #[inline(always)]
    fn lens_directions(&self, rays: &LensRays, plane: usize, [x, y]: [usize; 2], side: &SampleOffsets) -> [V3; WIDTH] {
        let mut out = [[0.0; 3]; WIDTH];
        for (ray, [i, j]) in out.iter_mut().zip(side) {
            *ray = rays.direction(plane, [x + i, y + j]).map(f64::from);
        }
        out
    }

    /// Casts the rays of eight samples, and keeps hits that are nearer than the stored ones, or as near with a larger
    /// id. Returns true if any is kept.
    #[inline(always)]
    fn cast<S: Simd>(
        &self,
        s: S,
        body: &InstanceGeometry,
        directions: [V3; WIDTH],
        stack: &mut TraversalStack,
        samples: TileSamples<'_>,
        first_id: u32,
    ) -> bool {
        let TileSamples { nearness, ids, at } = samples;
        // Distance along a ray per meter of depth.
        let mut length = [1.0; WIDTH];
        let mut rays = [Ray { origin: self.origin, direction: [0.0, 0.0, 1.0] }; WIDTH];
        let mut none = [false; WIDTH];
        for (((ray, length), c), none) in rays.iter_mut().zip(&mut length).zip(&directions).zip(&mut none) {
            *none = *c == [0.0; 3];
            let c = if *none { [0.0, 0.0, 1.0] } else { *c };
            let d = self.rotation.map(|r| dot(r, c));
            *length = dot(d, d).sqrt();
            // Rays start at the near plane.
            *ray = Ray { origin: add_scaled(self.origin, self.near, d), direction: scale(d, 1.0 / *length) };
        }
        let mut packet = Packet::from_rays(&rays, f64::INFINITY);
        for k in 0..WIDTH {
            // Stored nearness is single precision.
            let limit = (1.000_001 / f64::from(nearness[at[k]]) - self.near) * length[k];
            packet.limit_to(k, if none[k] { -1.0 } else { limit });
        }
        let mut found = [None; WIDTH];
        match body {
            InstanceGeometry::Mesh(_, tree) => {
                tree.closest_hits(s, &packet, ShearedPacket::new(s, &packet).as_ref(), stack, &mut found);
                for (_, index) in found.iter_mut().flatten() {
                    *index = tree.mesh_index(*index) as usize;
                }
            }
            InstanceGeometry::Closed(shape) => {
                for k in (0..WIDTH).filter(|&k| packet.is_active(k)) {
                    let at = shape.intersect(&rays[k], packet.limit(k));
                    found[k] = at.map(|at| (at.t, shape.face(&at, &rays[k])));
                }
            }
        }
        let mut drawn = false;
        for k in 0..WIDTH {
            let Some((t, number)) = found[k] else { continue };
            let q = (1.0 / (self.near + t / length[k])) as f32;
            let (old, id) = (nearness[at[k]], first_id + number as u32);
            if q > old || q == old && id > ids[at[k]] {
                (nearness[at[k]], ids[at[k]]) = (q, id);
                drawn = true;
            }
        }
        drawn
    }
}
