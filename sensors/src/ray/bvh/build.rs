//! Builds the tree: the surface area heuristic over bins, two children at a time, then eight.
//!
//! Source: Wald, On fast construction of SAH-based bounding volume hierarchies, 2007.

use super::{Aabb, Bvh, Node, PAD, WIDE};
use std::ops::Range;

const BINS: usize = 16;
/// Things of a leaf, at most.
const LEAF: usize = 4;
/// What passing a node costs, in tests of one thing. A wide node is shared by several binary ones.
const NODE_COST: f32 = 0.6;
/// Deeper than this, halves of equal number: things that are spread over many orders of magnitude.
const MAX_DEPTH: u32 = 48;

const NOTHING: Aabb = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];

/// A node with two children, or a leaf.
struct Binary {
    bounds: Aabb,
    /// The second child; the first one follows its parent. `None` for a leaf.
    second: Option<usize>,
    items: Range<usize>,
}

struct Builder<'a> {
    boxes: &'a [Aabb],
    middles: Vec<[f32; 3]>,
    order: Vec<u32>,
    tree: Vec<Binary>,
}

impl Bvh {
    /// A tree over boxes of finite numbers, and the order of the boxes in its leaves. The same boxes give the same tree.
    pub(crate) fn build(boxes: &[Aabb]) -> (Self, Vec<u32>) {
        let middle = |b: &Aabb| [0, 1, 2].map(|k| 0.5 * b[0][k] + 0.5 * b[1][k]);
        let order = (0..u32::try_from(boxes.len()).unwrap_or(u32::MAX)).collect();
        let mut builder = Builder { boxes, middles: boxes.iter().map(middle).collect(), order, tree: Vec::new() };
        if boxes.is_empty() {
            return (Self { nodes: Vec::new(), bounds: [[0.0; 3]; 2] }, Vec::new());
        }
        builder.split(0..boxes.len(), 0);
        let Builder { order, tree, .. } = builder;
        let whole = tree[0].bounds;
        let reach = whole.iter().flatten().fold(0.0f64, |m, &x| m.max(f64::from(x).abs()));
        let pad = reach * PAD;
        let mut bvh = Self {
            nodes: Vec::new(),
            bounds: [whole[0].map(|x| f64::from(x) - pad), whole[1].map(|x| f64::from(x) + pad)],
        };
        bvh.widen(&tree, 0, pad);
        (bvh, order)
    }

    /// Adds the wide node of a binary one; returns its index.
    fn widen(&mut self, tree: &[Binary], root: usize, pad: f64) -> u32 {
        let mut children = vec![root];
        // Opens the largest child until there are eight.
        while children.len() < WIDE {
            let largest = (0..children.len())
                .filter(|&k| tree[children[k]].second.is_some())
                .max_by(|&a, &b| area(&tree[children[a]].bounds).total_cmp(&area(&tree[children[b]].bounds)));
            let Some(k) = largest else { break };
            let open = children[k];
            children[k] = open + 1;
            children.extend(tree[open].second);
        }
        let index = self.nodes.len();
        let (empty, full) = ([f32::INFINITY; WIDE], [f32::NEG_INFINITY; WIDE]);
        self.nodes.push(Node { sides: [empty, empty, empty, full, full, full], child: [0; WIDE], count: [0; WIDE] });
        for (k, &child) in children.iter().enumerate() {
            let Binary { bounds, second, items } = &tree[child];
            let (to, count) = match second {
                Some(_) => (self.widen(tree, child, pad), 0),
                None => (items.start as u32, items.len() as u32),
            };
            let node = &mut self.nodes[index];
            (node.child[k], node.count[k]) = (to, count);
            for (axis, (&lo, &hi)) in bounds[0].iter().zip(&bounds[1]).enumerate() {
                node.sides[axis][k] = ((f64::from(lo) - pad) as f32).next_down();
                node.sides[axis + 3][k] = ((f64::from(hi) + pad) as f32).next_up();
            }
        }
        index as u32
    }
}

impl Builder<'_> {
    /// Adds the binary node of a range of the order, and all below.
    fn split(&mut self, items: Range<usize>, depth: u32) {
        let of = |builder: &Self, f: &dyn Fn(usize) -> Aabb| {
            builder.order[items.clone()].iter().fold(NOTHING, |all, &i| union(all, f(i as usize)))
        };
        let bounds = of(self, &|i| self.boxes[i]);
        let middles = of(self, &|i| [self.middles[i]; 2]);
        let index = self.tree.len();
        self.tree.push(Binary { bounds, second: None, items: items.clone() });
        let Some(at) = self.cut(&items, &bounds, &middles, depth) else { return };
        self.split(items.start..at, depth + 1);
        let second = self.tree.len();
        self.split(at..items.end, depth + 1);
        self.tree[index].second = Some(second);
    }

    /// Sorts a range in two parts and says where the second one begins; `None` where it is better left alone.
    fn cut(&mut self, items: &Range<usize>, bounds: &Aabb, middles: &Aabb, depth: u32) -> Option<usize> {
        let count = items.len();
        if count < 2 {
            return None;
        }
        let best = if depth < MAX_DEPTH { self.best_plane(items, middles) } else { None };
        let alone = count as f32 * area(bounds);
        match best {
            Some((cost, ..)) if count <= LEAF && cost + NODE_COST * area(bounds) >= alone => None,
            Some((_, axis, plane)) => {
                let order = &mut self.order[items.clone()];
                let bin = |i: u32| bin(self.middles[i as usize][axis], middles, axis);
                // Stable: the same tree whatever the sorting library does.
                order.sort_by_key(|&i| bin(i) > plane);
                let first = order.iter().filter(|&&i| bin(i) <= plane).count();
                Some(items.start + first)
            }
            // All at one place.
            None if count <= LEAF => None,
            None => Some(items.start + count / 2),
        }
    }

    /// Cost, axis and bin of the best plane to cut at; `None` if none has something on both sides.
    fn best_plane(&self, items: &Range<usize>, middles: &Aabb) -> Option<(f32, usize, usize)> {
        let mut best: Option<(f32, usize, usize)> = None;
        for axis in 0..3 {
            if middles[1][axis] <= middles[0][axis] {
                continue;
            }
            let mut bins = [(0usize, NOTHING); BINS];
            for &i in &self.order[items.clone()] {
                let (n, b) = &mut bins[bin(self.middles[i as usize][axis], middles, axis)];
                (*n, *b) = (*n + 1, union(*b, self.boxes[i as usize]));
            }
            let mut above = [(0usize, NOTHING); BINS];
            let mut sum = (0, NOTHING);
            for k in (0..BINS).rev() {
                sum = (sum.0 + bins[k].0, union(sum.1, bins[k].1));
                above[k] = sum;
            }
            let mut below = (0, NOTHING);
            for k in 0..BINS - 1 {
                below = (below.0 + bins[k].0, union(below.1, bins[k].1));
                let (n, b) = above[k + 1];
                if below.0 == 0 || n == 0 {
                    continue;
                }
                let cost = below.0 as f32 * area(&below.1) + n as f32 * area(&b);
                // A cost that is no number comes from sizes beyond the range: any plane will do.
                if best.is_none_or(|(c, ..)| cost < c) {
                    best = Some((cost, axis, k));
                }
            }
        }
        best
    }
}

/// Which of the bins along an axis a middle belongs to.
fn bin(middle: f32, middles: &Aabb, axis: usize) -> usize {
    let (lo, hi) = (f64::from(middles[0][axis]), f64::from(middles[1][axis]));
    (((f64::from(middle) - lo) / (hi - lo) * BINS as f64) as usize).min(BINS - 1)
}

fn union(a: Aabb, b: Aabb) -> Aabb {
    [[0, 1, 2].map(|k| a[0][k].min(b[0][k])), [0, 1, 2].map(|k| a[1][k].max(b[1][k]))]
}

/// Half the surface.
fn area(b: &Aabb) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|k| (b[1][k] - b[0][k]).max(0.0));
    x * y + y * z + z * x
}
