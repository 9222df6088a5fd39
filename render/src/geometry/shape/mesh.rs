//! Triangle meshes.

pub(crate) mod columns;

use super::{Intersections, RayShape, intersect_each};
use crate::geometry::assets::AssetCache;
use crate::geometry::bvh::{Beam, Bvh, BvhBuilder, Traversal, TraversalStack};
use crate::geometry::packet::{Packet, WIDTH};
use crate::geometry::triangle::{ShearedPacket, ShearedRay, Triangle, has_area, normal};
use crate::simd::{D, Simd, SimdLevel};
use columns::Columns;
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::Intersection;
use kinetoscope_scene::shape::RenderMesh;
use kinetoscope_scene::vector::{V3, to_f64};
use std::sync::{Arc, OnceLock};

/// Triangles that a packet tests against all of its rays; beyond that, rays go on one by one. That costs about as much
/// as these tests.
const MAX_PACKET_TRIANGLES: usize = 320;

/// A mesh with its BVH, shared by all instances of the asset.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    bvh: Arc<MeshBvh>,
}

/// The triangles of an asset, in the order of the BVH's leaves.
#[derive(Clone, Debug)]
pub(crate) struct MeshBvh {
    bvh: Bvh,
    triangles: Vec<Triangle>,
    /// Index of each triangle in the mesh.
    mesh_indices: Vec<u32>,
    /// Columns along each axis, built when the first steep rays come; `None` for unsuitable meshes.
    columns: [OnceLock<Option<Columns>>; 3],
}

/// Builds BVHs over meshes one after the other and keeps its memory between builds. New memory would take a fifth of
/// the time.
#[derive(Debug)]
pub(crate) struct MeshBuilder {
    builder: BvhBuilder,
    triangles: Vec<Triangle>,
}

impl Default for MeshBuilder {
    fn default() -> Self {
        Self { builder: BvhBuilder::new(SimdLevel::best()), triangles: Vec::new() }
    }
}

impl MeshBuilder {
    /// Builds a BVH over the triangles that have an area.
    pub(crate) fn build(&mut self, mesh: &RenderMesh) -> MeshBvh {
        let (indices, positions) = (mesh.triangles(), mesh.positions());
        let corners = |indices: &[u32; 3]| indices.map(|i| positions[i as usize]);
        self.triangles.clear();
        self.triangles.reserve(indices.len());
        for indices in indices {
            let triangle = corners(indices);
            if has_area(&triangle) {
                self.triangles.push(triangle);
            }
        }
        let mut tree = self.build_bvh();
        // Most meshes have no triangles without area.
        if tree.triangles.len() < indices.len() {
            let with_area: Vec<u32> =
                (0..).zip(indices).filter(|(_, indices)| has_area(&corners(indices))).map(|(k, _)| k).collect();
            tree.mesh_indices.iter_mut().for_each(|number| *number = with_area[*number as usize]);
        }
        tree
    }

    /// Builds a BVH over the builder's triangles, all of which have an area.
    fn build_bvh(&mut self) -> MeshBvh {
        // Plain comparisons, because those of the library check for NaN.
        let smaller = |a: f32, b: f32| if a < b { a } else { b };
        let larger = |a: f32, b: f32| if a > b { a } else { b };
        let around = |[a, b, c]: &Triangle| {
            [[0, 1, 2].map(|k| smaller(smaller(a[k], b[k]), c[k])), [0, 1, 2].map(|k| larger(larger(a[k], b[k]), c[k]))]
        };
        let (bvh, mesh_indices) = self.builder.build(self.triangles.iter().map(around));
        let triangles = mesh_indices.iter().map(|&number| self.triangles[number as usize]).collect();
        MeshBvh { bvh, triangles, mesh_indices, columns: Default::default() }
    }
}

impl Mesh {
    pub(super) fn from_mesh(mesh: &Arc<RenderMesh>, assets: &mut AssetCache) -> Self {
        Self { bvh: assets.mesh(mesh) }
    }

    /// Bounding box in the frame of the mesh: smallest and largest coordinates \[m\].
    pub(crate) fn bounds(&self) -> [V3; 2] {
        self.bvh.bounds()
    }

    #[cfg(test)]
    pub(crate) fn from_bvh(tree: Arc<MeshBvh>) -> Self {
        Self { bvh: tree }
    }
}

impl MeshBvh {
    #[cfg(test)]
    pub(crate) fn from_triangles(triangles: &[Triangle]) -> Self {
        MeshBuilder { triangles: triangles.to_vec(), ..Default::default() }.build_bvh()
    }

    #[cfg(test)]
    pub(crate) fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    #[cfg(test)]
    pub(crate) fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    #[inline(always)]
    pub(crate) fn columns(&self, axes: [usize; 3]) -> Option<&Columns> {
        self.columns[axes[2]].get_or_init(|| Columns::new(&self.triangles, &self.bounds(), axes)).as_ref()
    }

    /// Index in the mesh of a triangle given by its position in the BVH.
    #[inline(always)]
    pub(crate) fn mesh_index(&self, index: usize) -> u32 {
        self.mesh_indices[index]
    }

    /// Unit normal of a triangle given by its position in the BVH; its corners are counter-clockwise seen from the tip.
    /// `None` for a triangle without an area.
    #[inline(always)]
    pub(crate) fn normal(&self, index: usize) -> Option<V3> {
        normal(&self.triangles[index])
    }

    /// Bounding box in the frame of the mesh: smallest and largest coordinates \[m\].
    pub(crate) fn bounds(&self) -> [V3; 2] {
        self.bvh.bounds().map(to_f64)
    }

    /// True if the ray meets any triangle at a distance from 0 to `limit`.
    #[inline(always)]
    pub(crate) fn any_hit(&self, ray: &Ray, limit: f64, stack: &mut TraversalStack) -> bool {
        let shear = ShearedRay::new(ray);
        let mut blocked = false;
        self.bvh.traverse(
            ray,
            limit,
            stack,
            #[inline(always)]
            |leaf, limit| {
                for triangle in &self.triangles[leaf] {
                    blocked = shear.distance(triangle).is_some_and(|t| t >= 0.0 && t <= limit);
                    if blocked {
                        break;
                    }
                }
                // A negative limit ends the traversal.
                if blocked { -1.0 } else { limit }
            },
        );
        blocked
    }

    /// The nearest triangle up to `limit`, or the one `found` before, whose distance is then `limit`: distance, and
    /// position in the BVH.
    #[inline(always)]
    pub(crate) fn closest_hit(
        &self,
        ray: &Ray,
        limit: f64,
        found: Option<(f64, usize)>,
        stack: &mut TraversalStack,
    ) -> Option<(f64, usize)> {
        let shear = ShearedRay::new(ray);
        let mut best = found;
        self.bvh.traverse(
            ray,
            limit,
            stack,
            #[inline(always)]
            |leaf, mut limit| {
                let first = leaf.start;
                for (k, triangle) in self.triangles[leaf].iter().enumerate() {
                    let Some(t) = shear.distance(triangle).filter(|&t| t >= 0.0 && t <= limit) else { continue };
                    // On an edge the first triangle counts, in any order of visits.
                    if best.is_none_or(|(s, index)| t < s || first + k < index) {
                        best = Some((t, first + k));
                        limit = t;
                    }
                }
                limit
            },
        );
        best
    }

    /// Packet version of [`closest_hit`](Self::closest_hit): the same bits for every ray, up to its limit. `shear` is
    /// that of the rays, if they share one. Nearly parallel rays take one traversal together. Only lanes with a ray are
    /// written.
    #[inline(always)]
    pub(crate) fn closest_hits<S: Simd>(
        &self,
        s: S,
        packet: &Packet,
        shear: Option<&ShearedPacket<S>>,
        stack: &mut TraversalStack,
        found: &mut [Option<(f64, usize)>; WIDTH],
    ) {
        let beam = shear.and_then(
            #[inline(always)]
            |shear| Some((shear, Beam::enclosing(s, packet, shear, &self.bvh)?)),
        );
        let narrow = beam
            .filter(|(_, beam)| beam.covered_fraction() * self.triangles.len() as f64 <= MAX_PACKET_TRIANGLES as f64);
        let Some((shear, beam)) = narrow else {
            for k in (0..WIDTH).filter(|&k| packet.is_active(k)) {
                found[k] = self.closest_hit(&packet.ray(k), packet.limit(k), None, stack);
            }
            return;
        };
        let (zero, mut limit) = (D::splat(s, 0.0), packet.limits(s));
        // Position of the best triangle, as a float that holds all positions exactly; +inf without a hit.
        let mut best = D::splat(s, f64::INFINITY);
        let walked = self.bvh.traverse_beam(
            &beam,
            limit,
            MAX_PACKET_TRIANGLES,
            stack,
            #[inline(always)]
            |leaf| {
                let mut nearer = 0;
                for (index, triangle) in leaf.clone().zip(&self.triangles[leaf]) {
                    let Some((t, inside)) = shear.distances(triangle) else { continue };
                    let index = D::splat(s, index as f64);
                    let better = inside & zero.le(t) & t.le(limit) & (t.lt(limit) | index.lt(best));
                    (limit, best) = (better.select(t, limit), better.select(index, best));
                    nearer |= better.to_bitmask();
                }
                if nearer != 0 { Some(limit) } else { None }
            },
        );
        let (limit, best) = (limit.array(), best.array());
        for k in (0..WIDTH).filter(|&k| packet.is_active(k)) {
            found[k] = (best[k] < f64::INFINITY).then(|| (limit[k], best[k] as usize));
            if walked == Traversal::OverBudget {
                found[k] = self.closest_hit(&packet.ray(k), limit[k], found[k], stack);
            }
        }
    }

    #[inline(always)]
    fn intersection_at(&self, (t, index): (f64, usize)) -> Option<Intersection> {
        Some(Intersection { t: t + 0.0, normal: normal(&self.triangles[index])? })
    }
}

impl RayShape for Mesh {
    #[inline(always)]
    fn intersect(&self, ray: &Ray, limit: f64, stack: &mut TraversalStack) -> Option<Intersection> {
        self.bvh.intersection_at(self.bvh.closest_hit(ray, limit, None, stack)?)
    }

    /// Steep rays use columns; other nearly parallel rays take one traversal together. Every triangle that a ray may
    /// hit is tested by the arithmetic of the single ray. The nearest one counts, the first of equally near ones: the
    /// same bits.
    #[inline(always)]
    fn intersect_packet<S: Simd>(
        &self,
        s: S,
        packet: &Packet,
        stack: &mut TraversalStack,
        touches: &mut Intersections,
    ) {
        let tree = &*self.bvh;
        let Some(shear) = ShearedPacket::new(s, packet) else { return intersect_each(self, packet, stack, touches) };
        if columns::are_steep(s, &shear)
            && let Some(columns) = tree.columns(shear.axes())
            && columns.intersect_packet(s, tree, packet, &shear, touches)
        {
            return;
        }
        let mut found = [None; WIDTH];
        tree.closest_hits(s, packet, Some(&shear), stack, &mut found);
        for k in (0..WIDTH).filter(|&k| packet.is_active(k)) {
            touches[k] = found[k].and_then(|found| tree.intersection_at(found));
        }
    }
}
