//! Triangles.

use super::{RayShape, Touch};
use crate::ray::bvh::{Bvh, Stack};
use crate::ray::triangle::{Shear, Triangle, normal};
use crate::ray::vector::{V3, to_f64};
use crate::ray::{Assets, Ray};
use scene::RenderMesh;
use std::sync::Arc;

/// Triangles in a tree, one for each asset.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    tree: Arc<MeshTree>,
}

/// The triangles of an asset, in the order of the leaves.
#[derive(Clone, Debug)]
pub(crate) struct MeshTree {
    bvh: Bvh,
    triangles: Vec<Triangle>,
    bounds: [V3; 2],
}

impl MeshTree {
    pub(crate) fn new(mesh: &RenderMesh) -> Self {
        let corners = |t: &[u32; 3]| t.map(|i| mesh.positions()[i as usize]);
        let whole = |t: &Triangle| t.iter().flatten().all(|x| x.is_finite()) && normal(t).is_some();
        Self::of_triangles(mesh.triangles().iter().map(corners).filter(whole).collect())
    }

    /// Of triangles that have an area.
    pub(crate) fn of_triangles(triangles: Vec<Triangle>) -> Self {
        let bounds = |t: &Triangle| {
            let of = |pick: fn(f32, f32) -> f32| [0, 1, 2].map(|k| pick(pick(t[0][k], t[1][k]), t[2][k]));
            [of(f32::min), of(f32::max)]
        };
        let boxes: Vec<_> = triangles.iter().map(bounds).collect();
        let (bvh, order) = Bvh::build(&boxes);
        let triangles: Vec<Triangle> = order.iter().map(|&i| triangles[i as usize]).collect();
        let first = boxes.first().map_or([[0.0; 3]; 2], |b| b.map(to_f64));
        let bounds = boxes.iter().fold(first, |all, b| {
            let (lo, hi) = (to_f64(b[0]), to_f64(b[1]));
            [[0, 1, 2].map(|k| all[0][k].min(lo[k])), [0, 1, 2].map(|k| all[1][k].max(hi[k]))]
        });
        Self { bvh, triangles, bounds }
    }
}

impl Mesh {
    pub(super) fn of(shape: &scene::shape::Mesh, assets: &mut Assets) -> Self {
        Self { tree: assets.mesh(&shape.mesh) }
    }

    #[cfg(test)]
    pub(crate) fn of_tree(tree: Arc<MeshTree>) -> Self {
        Self { tree }
    }
}

impl RayShape for Mesh {
    #[inline(always)]
    fn touch(&self, ray: &Ray, limit: f64, stack: &mut Stack) -> Option<Touch> {
        let tree = &*self.tree;
        let shear = Shear::new(ray);
        let mut best: Option<(f64, usize)> = None;
        tree.bvh.walk(ray, limit, stack, |leaf, mut limit| {
            let first = leaf.start;
            for (k, triangle) in tree.triangles[leaf].iter().enumerate() {
                let Some(t) = shear.distance(triangle).filter(|&t| t >= 0.0 && t <= limit) else { continue };
                // On an edge the first triangle counts, in whatever order they are met.
                if best.is_none_or(|(s, index)| t < s || first + k < index) {
                    best = Some((t, first + k));
                    limit = t;
                }
            }
            limit
        });
        let (t, index) = best?;
        Some(Touch { t: t + 0.0, normal: normal(&tree.triangles[index])? })
    }

    fn bounds(&self) -> Option<[V3; 2]> {
        Some(self.tree.bounds)
    }
}
