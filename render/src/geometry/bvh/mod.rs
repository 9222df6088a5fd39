//! A tree of boxes with eight children per node: which boxes a ray may meet, the near ones first.
//!
//! Boxes are single precision, rounded outward by more than the error of a single precision test, so that nothing is
//! missed; what is in them is tested in double precision by who asks. So the result does not depend on the tree.

mod beam;
mod build;

pub(crate) use beam::{Beam, FAR, Walked};
pub(crate) use build::Builder;

use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::{V3, along};
use std::ops::Range;

/// Children of a node.
const WIDE: usize = 8;
/// How much larger boxes are than what they hold, as a part of the largest coordinate R in the tree. With u = 2^-24, the
/// plane of a side is off by at most u R for the rounded origin, and by 4 u of its distance from there, which is 2 R at most,
/// for the difference, the inverse of the rounded direction and the product: 9 u R, and terms of u².
const PAD: f64 = 16.0 / (1u32 << 24) as f64;

/// Smallest and largest coordinates.
pub(crate) type Aabb = [[f32; 3]; 2];

/// A tree of boxes.
#[derive(Clone, Debug)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    /// Which node is above all others.
    root: u32,
    /// The box around everything, and the same padded.
    around: Aabb,
    bounds: [V3; 2],
}

/// Eight boxes, as arrays of their sides.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Node {
    /// Smallest x, y, z, then largest x, y, z. Nothing where there is no child: larger than every number, and smaller.
    sides: [[f32; WIDE]; 6],
    /// A node, or the first thing of a leaf.
    child: [u32; WIDE],
    /// Things of a leaf; 0 for a node.
    count: [u32; WIDE],
}

/// What is still to be visited: scratch memory, to be kept.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stack(Vec<Entry>);

impl Stack {
    pub(crate) fn bytes(&self) -> usize {
        self.0.capacity() * size_of::<Entry>()
    }
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    /// The ray is not in it before.
    near: f32,
    child: u32,
    count: u32,
}

/// A ray from where it enters the tree, in single precision.
#[derive(Clone, Copy, Debug)]
struct ShortRay {
    /// How far the double precision ray runs before.
    shift: f64,
    origin: [f32; 3],
    inverse: [f32; 3],
    /// Along which axes the larger sides come first.
    backward: [bool; 3],
}

impl Bvh {
    /// The box around everything; a point where there is nothing.
    #[inline(always)]
    pub(crate) fn around(&self) -> &Aabb {
        &self.around
    }

    /// Visits the leaves that `ray` may meet at distances from 0 to `limit`, the near ones first. `leaf` is given the
    /// things of a leaf, as positions in the order of the build, and the limit; it returns a new limit.
    #[inline(always)]
    pub(crate) fn walk(
        &self,
        ray: &Ray,
        mut limit: f64,
        Stack(stack): &mut Stack,
        mut leaf: impl FnMut(Range<usize>, f64) -> f64,
    ) {
        let Some(short) = self.enter(ray, limit) else { return };
        let mut short_limit = short.limit(limit);
        stack.clear();
        let mut entry = Entry { near: 0.0, child: self.root, count: 0 };
        loop {
            if entry.near <= short_limit {
                let first = entry.child as usize;
                if entry.count > 0 {
                    limit = leaf(first..first + entry.count as usize, limit);
                    short_limit = short.limit(limit);
                } else {
                    let node = &self.nodes[first];
                    let (near, mut met) = short.meets(node, short_limit);
                    if met != 0 {
                        let child = |k: usize| Entry { near: near[k], child: node.child[k], count: node.count[k] };
                        entry = child(met.trailing_zeros() as usize & (WIDE - 1));
                        met &= met - 1;
                        let bottom = stack.len();
                        while met != 0 {
                            let mut next = child(met.trailing_zeros() as usize & (WIDE - 1));
                            met &= met - 1;
                            if next.near < entry.near {
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

    /// The ray from where it enters the box around everything; `None` if it does not before `limit`.
    #[inline(always)]
    fn enter(&self, ray: &Ray, limit: f64) -> Option<ShortRay> {
        if self.nodes.is_empty() {
            return None;
        }
        let [lo, hi] = self.bounds;
        let (mut shift, mut leave) = (0.0f64, limit);
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
            (shift, leave) = (shift.max(a.min(b)), leave.min(a.max(b)));
        }
        if shift > leave {
            return None;
        }
        let origin = along(ray.origin, shift, ray.direction).map(|x| x as f32);
        // A direction that is almost none would make an infinity; its sign is that of the ray.
        let inverse = ray.direction.map(|d| {
            let d = d as f32;
            1.0 / if d.abs() < 1e-18 { 1e-18f32.copysign(d) } else { d }
        });
        let backward = inverse.map(|x| x < 0.0);
        Some(ShortRay { shift, origin, inverse, backward })
    }
}

/// Puts an entry where it belongs above `bottom`: the nearest one on top, the first of those that are as near.
#[inline(always)]
fn insert(stack: &mut Vec<Entry>, bottom: usize, entry: Entry) {
    let mut at = stack.len();
    stack.push(entry);
    while at > bottom && stack[at - 1].near <= stack[at].near {
        stack.swap(at - 1, at);
        at -= 1;
    }
}

impl ShortRay {
    /// A limit, rounded up.
    #[inline(always)]
    fn limit(&self, limit: f64) -> f32 {
        ((limit - self.shift) as f32).next_up()
    }

    /// From where on the ray is in each of the boxes, and a bit for each box that it meets before `limit`.
    #[inline(always)]
    fn meets(&self, node: &Node, limit: f32) -> ([f32; WIDE], u32) {
        let [x0, y0, z0, x1, y1, z1] = &node.sides;
        let sort = |k: usize, a, b| if self.backward[k] { (b, a) } else { (a, b) };
        let ((nx, fx), (ny, fy), (nz, fz)) = (sort(0, x0, x1), sort(1, y0, y1), sort(2, z0, z1));
        let ([ox, oy, oz], [ix, iy, iz]) = (self.origin, self.inverse);
        let larger = |a: f32, b: f32| if a > b { a } else { b };
        let smaller = |a: f32, b: f32| if a < b { a } else { b };
        // One plain loop: compilers make vectors of it.
        let mut near = [0.0f32; WIDE];
        let mut met = [0u32; WIDE];
        for k in 0..WIDE {
            near[k] = larger(larger((nx[k] - ox) * ix, (ny[k] - oy) * iy), larger((nz[k] - oz) * iz, 0.0));
            let far = smaller(smaller((fx[k] - ox) * ix, (fy[k] - oy) * iy), smaller((fz[k] - oz) * iz, limit));
            met[k] = u32::from(near[k] <= far) << k;
        }
        (near, met.iter().fold(0, |bits, bit| bits | bit))
    }
}
