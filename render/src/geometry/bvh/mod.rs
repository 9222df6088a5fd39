//! Bounding volume hierarchy (BVH) with eight children per node: finds the boxes that a ray may meet, near ones first.
//!
//! Boxes are single precision, rounded outward by more than the error of a single precision test, so that no primitive
//! is missed. The caller tests the primitives of a box in double precision, so the result does not depend on the BVH.

mod beam;
mod build;

pub(crate) use beam::{Beam, MAX_ORIGIN_RATIO, Traversal};
pub(crate) use build::BvhBuilder;

use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::{V3, add_scaled};
use std::ops::Range;

/// Children of a node.
const BVH_WIDTH: usize = 8;
/// Padding of boxes, as a fraction of the largest coordinate R in the BVH. With u = 2^-24, the plane of a side is off
/// by at most u R for the rounded origin, and by 4 u of its distance from there, which is 2 R at most, for the
/// difference, the inverse of the rounded direction and the product: 9 u R, and terms of u².
const PAD: f64 = 16.0 / (1u32 << 24) as f64;

/// Bounding box: smallest and largest coordinates \[m\].
pub(crate) type Aabb = [[f32; 3]; 2];

/// A bounding volume hierarchy.
#[derive(Clone, Debug)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    /// Index of the root node.
    root: u32,
    /// The box around all primitives, and the same box padded.
    bounds: Aabb,
    padded_bounds: [V3; 2],
}

/// Eight boxes, as arrays of their sides.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Node {
    /// Smallest x, y, z, then largest x, y, z. A missing child has an empty box, from +inf to -inf.
    sides: [[f32; BVH_WIDTH]; 6],
    /// Index of a node, or of the first primitive of a leaf.
    child: [u32; BVH_WIDTH],
    /// Primitives of a leaf; 0 for a node.
    count: [u32; BVH_WIDTH],
}

/// Stack of nodes to visit: scratch memory that is kept between traversals.
#[derive(Clone, Debug, Default)]
pub(crate) struct TraversalStack(Vec<StackEntry>);

impl TraversalStack {
    pub(crate) fn bytes(&self) -> usize {
        self.0.capacity() * size_of::<StackEntry>()
    }
}

#[derive(Clone, Copy, Debug)]
struct StackEntry {
    /// Distance at which the ray enters the box.
    entry_distance: f32,
    child: u32,
    count: u32,
}

/// A ray that starts where it enters the BVH, in single precision.
#[derive(Clone, Copy, Debug)]
struct EntryRay {
    /// Distance that the double precision ray runs before.
    entry_distance: f64,
    origin: [f32; 3],
    inverse: [f32; 3],
    /// Axes along which the larger sides come first.
    backward: [bool; 3],
}

impl Bvh {
    /// The box around all primitives; a point if there are no primitives.
    #[inline(always)]
    pub(crate) fn bounds(&self) -> &Aabb {
        &self.bounds
    }

    /// Visits the leaves that `ray` may meet at distances from 0 to `limit`, near ones first. `leaf` receives the
    /// primitives of a leaf, as positions in the order of the build, and the limit; it returns a new limit.
    #[inline(always)]
    pub(crate) fn traverse(
        &self,
        ray: &Ray,
        mut limit: f64,
        TraversalStack(stack): &mut TraversalStack,
        mut leaf: impl FnMut(Range<usize>, f64) -> f64,
    ) {
        let Some(short) = self.enter(ray, limit) else { return };
        let mut short_limit = short.limit(limit);
        stack.clear();
        let mut entry = StackEntry { entry_distance: 0.0, child: self.root, count: 0 };
        loop {
            if entry.entry_distance <= short_limit {
                let first = entry.child as usize;
                if entry.count > 0 {
                    limit = leaf(first..first + entry.count as usize, limit);
                    short_limit = short.limit(limit);
                } else {
                    let node = &self.nodes[first];
                    let (near, mut hit) = short.intersect_children(node, short_limit);
                    if hit != 0 {
                        let child = |k: usize| StackEntry {
                            entry_distance: near[k],
                            child: node.child[k],
                            count: node.count[k],
                        };
                        entry = child(hit.trailing_zeros() as usize & (BVH_WIDTH - 1));
                        hit &= hit - 1;
                        let bottom = stack.len();
                        while hit != 0 {
                            let mut next = child(hit.trailing_zeros() as usize & (BVH_WIDTH - 1));
                            hit &= hit - 1;
                            if next.entry_distance < entry.entry_distance {
                                std::mem::swap(&mut next, &mut entry);
                            }
                            insert(stack, bottom, next);
                        }
                        continue;
                    }
                }
            }
            match stack.pop() {
                Some(next) => entry = next,
                None => return,
            }
        }
    }

    /// The ray from where it enters the box around all primitives; `None` if it does not enter before `limit`.
    #[inline(always)]
    fn enter(&self, ray: &Ray, limit: f64) -> Option<EntryRay> {
        if self.nodes.is_empty() {
            return None;
        }
        let [lo, hi] = self.padded_bounds;
        let (mut entry_distance, mut leave) = (0.0f64, limit);
        for k in 0..3 {
            let (o, d) = (ray.origin[k], ray.direction[k]);
            if d == 0.0 {
                if o < lo[k] || o > hi[k] {
                    return None;
                }
                continue;
            }
            let inverse = 1.0 / d;
            let (a, b) = ((lo[k] - o) * inverse, (hi[k] - o) * inverse);
            (entry_distance, leave) = (entry_distance.max(a.min(b)), leave.min(a.max(b)));
        }
        if entry_distance > leave {
            return None;
        }
        let origin = add_scaled(ray.origin, entry_distance, ray.direction).map(|x| x as f32);
        // A component close to 0 would have an infinite inverse; it keeps the sign of the ray.
        let inverse = ray.direction.map(|d| {
            let d = d as f32;
            1.0 / if d.abs() < 1e-18 { 1e-18f32.copysign(d) } else { d }
        });
        let backward = inverse.map(|x| x < 0.0);
        Some(EntryRay { entry_distance, origin, inverse, backward })
    }
}

/// Inserts an entry into the sorted part of the stack above `bottom`: the nearest on top, of equally near entries the
/// first.
#[inline(always)]
fn insert(stack: &mut Vec<StackEntry>, bottom: usize, entry: StackEntry) {
    let mut at = stack.len();
    stack.push(entry);
    while at > bottom && stack[at - 1].entry_distance <= stack[at].entry_distance {
        stack.swap(at - 1, at);
        at -= 1;
    }
}

impl EntryRay {
    /// A limit relative to the entry point, rounded up.
    #[inline(always)]
    fn limit(&self, limit: f64) -> f32 {
        ((limit - self.entry_distance) as f32).next_up()
    }

    /// Distances at which the ray enters each box, and a bit for each box that it meets before `limit`.
    #[inline(always)]
    fn intersect_children(&self, node: &Node, limit: f32) -> ([f32; BVH_WIDTH], u32) {
        let [x0, y0, z0, x1, y1, z1] = &node.sides;
        let sort = |k: usize, a, b| if self.backward[k] { (b, a) } else { (a, b) };
        let ((nx, fx), (ny, fy), (nz, fz)) = (sort(0, x0, x1), sort(1, y0, y1), sort(2, z0, z1));
        let ([ox, oy, oz], [ix, iy, iz]) = (self.origin, self.inverse);
        let larger = |a: f32, b: f32| if a > b { a } else { b };
        let smaller = |a: f32, b: f32| if a < b { a } else { b };
        // One plain loop, which compilers vectorize.
        let mut near = [0.0f32; BVH_WIDTH];
        let mut hit = [0u32; BVH_WIDTH];
        for k in 0..BVH_WIDTH {
            near[k] = larger(larger((nx[k] - ox) * ix, (ny[k] - oy) * iy), larger((nz[k] - oz) * iz, 0.0));
            let far = smaller(smaller((fx[k] - ox) * ix, (fy[k] - oy) * iy), smaller((fz[k] - oz) * iz, limit));
            hit[k] = u32::from(near[k] <= far) << k;
        }
        (near, hit.iter().fold(0, |bits, bit| bits | bit))
    }
}
