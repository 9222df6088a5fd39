//! Multisampling: color of pixels whose four samples hit different surfaces, the mean of the samples.

use super::group::{Colors, SamplePositions, ShadingContext, resolve};
use crate::raster::tile::{BLOCK, NO_ID, SAMPLES, Tile};
use crate::simd::{LANES, Simd, load, load_u, min, splat, splat_u, store};
use kinetoscope_scene::vector::dot;

/// Largest number of samples that are shaded together.
const CAPACITY: usize = 1024;

/// A sample to be shaded: pixel (group and lane), number of samples it stands for (`weight`), id and position.
#[derive(Clone, Copy, Debug)]
struct PendingSample {
    group: u32,
    lane: u8,
    weight: u8,
    id: u32,
    u: f32,
    v: f32,
}

/// Samples that pixels on edges still need. They are collected over many groups: each has few, and sixteen are shaded
/// at a time.
#[derive(Clone, Debug, Default)]
pub(crate) struct EdgeSamples {
    pending: Vec<PendingSample>,
}

/// True if two ids of one pixel look different enough to be shaded separately.
#[inline(always)]
fn differ(context: &ShadingContext<'_>, a: u32, b: u32, qa: f32, qb: f32, last: &mut usize) -> bool {
    if a == b {
        return false;
    }
    if a == NO_ID || b == NO_ID {
        return true;
    }
    *last = context.instance(a, *last);
    let first = context.shade.scene.first_ids();
    if b < first[*last] || b >= first[*last + 1] {
        return true;
    }
    let Some(mesh) = context.placed[*last].mesh(&context.shade.scene.instances()[*last]) else { return true };
    // Neighboring triangles of a smooth surface look the same: same normal, same distance.
    let corner = |id: u32| mesh.normals()[mesh.triangles()[(id - first[*last]) as usize][0] as usize];
    let (na, nb) = (corner(a), corner(b));
    dot(na, nb) < 0.97 || (qa - qb).abs() > 0.02 * qa
}

impl EdgeSamples {
    pub(crate) fn bytes(&self) -> usize {
        self.pending.capacity() * size_of::<PendingSample>()
    }

    /// Reserves memory for the largest number of samples: later images have more edges.
    pub(crate) fn reserve(&mut self) {
        self.pending.reserve_exact(CAPACITY - self.pending.len());
    }

    /// Finds the pixels of a group (two rows of a block, `row` counts pairs) that lie on an edge. The center's surface
    /// keeps its share of the color; [`resolve`](Self::resolve) adds the rest.
    #[inline(always)]
    pub(crate) fn collect<S: Simd>(
        &mut self,
        s: S,
        context: &ShadingContext<'_>,
        tile: &Tile,
        [block, row]: [usize; 2],
        corner: [f32; 2],
        colors: &mut [Colors],
    ) {
        if tile.is_uniform(block) {
            return;
        }
        let at = |plane: usize| tile.samples(block, plane) + row * LANES;
        let center = load_u(s, &tile.id[at(0)..]);
        let mut same = center.simd_eq(load_u(s, &tile.id[at(1)..]));
        for plane in 2..SAMPLES.len() {
            same &= center.simd_eq(load_u(s, &tile.id[at(plane)..]));
        }
        let mut left = (!same).to_bitmask();
        if left == 0 {
            return;
        }
        if self.pending.len() + 4 * LANES > CAPACITY {
            self.resolve(s, context, colors);
        }
        let group = block * (BLOCK / 2) + row;
        let mut last = 0;
        // OpenGL computes the color of a surface once per pixel, in its middle: the mean of the samples is near to it.
        let at_mean = context.shade.scene.opengl.is_some();
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let sample = |plane: usize| (tile.id[at(plane) + lane], tile.nearness[at(plane) + lane]);
            let (center, nearness) = sample(0);
            let (mut own, begin) = (0u8, self.pending.len());
            let mut seen = [0.0f32; SAMPLES.len()];
            for (plane, offset) in tile.offsets.iter().enumerate().skip(1) {
                let (id, q) = sample(plane);
                let at_sample = [
                    corner[0] + (lane % 8) as f32 + 0.5 + offset[0] as f32 / 256.0,
                    corner[1] + (2 * row + lane / 8) as f32 + 0.5 + offset[1] as f32 / 256.0,
                ];
                if !differ(context, center, id, nearness, q, &mut last) {
                    own += 1;
                    continue;
                }
                let mut others = self.pending[begin..].iter_mut().zip(&seen);
                if let Some((other, _)) =
                    others.find(|(other, seen)| !differ(context, other.id, id, **seen, q, &mut last))
                {
                    other.weight += 1;
                    if at_mean {
                        other.u += at_sample[0];
                        other.v += at_sample[1];
                    }
                    continue;
                }
                seen[self.pending.len() - begin] = q;
                self.pending.push(PendingSample {
                    group: group as u32,
                    lane: lane as u8,
                    weight: 1,
                    id,
                    u: at_sample[0],
                    v: at_sample[1],
                });
            }
            if at_mean {
                for request in &mut self.pending[begin..] {
                    let share = 1.0 / f32::from(request.weight);
                    (request.u, request.v) = (request.u * share, request.v * share);
                }
            }
            if own < 4 {
                for channel in &mut colors[group] {
                    channel[lane] *= f32::from(own) * 0.25;
                }
            }
        }
    }

    /// Shades the collected samples, and adds them to the pixels.
    #[inline(always)]
    pub(crate) fn resolve<S: Simd>(&mut self, s: S, context: &ShadingContext<'_>, colors: &mut [Colors]) {
        // Sorted by id, so that samples of a surface are together. The other keys make the order unique.
        self.pending.sort_unstable_by_key(|r| (r.id, r.group, r.lane));
        for batch in self.pending.chunks(LANES) {
            let (mut u, mut v, mut id) = ([batch[0].u; LANES], [batch[0].v; LANES], [NO_ID; LANES]);
            for (k, request) in batch.iter().enumerate() {
                (u[k], v[k], id[k]) = (request.u, request.v, request.id);
            }
            let mut out: Colors = [[0.0; LANES]; 3];
            resolve(s, context, &id, SamplePositions::Points([&u, &v]), None, Some(&mut out));
            for (k, request) in batch.iter().enumerate() {
                let weight = f32::from(request.weight) * 0.25;
                for (to, from) in colors[request.group as usize].iter_mut().zip(&out) {
                    to[usize::from(request.lane)] += from[k] * weight;
                }
            }
        }
        self.pending.clear();
    }
}

/// Blends a layer over a group: `alpha` times the fraction of samples that the layer covers.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "inlined into its only caller")]
pub(crate) fn blend<S: Simd>(
    s: S,
    context: &ShadingContext<'_>,
    layer: &Tile,
    block: usize,
    row: usize,
    corner: [f32; 2],
    alpha: f32,
    colors: &mut Colors,
) {
    let at = |plane: usize| layer.samples(block, plane) + row * LANES;
    let nothing = splat_u(s, NO_ID);
    let mut share = [0.0f32; LANES];
    let mut id = [NO_ID; LANES];
    let (mut u, mut v) = ([0.0f32; LANES], [0.0f32; LANES]);
    let planes = if layer.planes == 1 { 0..1 } else { 1..layer.planes };
    if planes.clone().all(|plane| load_u(s, &layer.id[at(plane)..]).simd_eq(nothing).all_true()) {
        return;
    }
    let each = 1.0 / planes.len() as f32;
    for lane in 0..LANES {
        (u[lane], v[lane]) = (corner[0] + (lane % 8) as f32 + 0.5, corner[1] + (2 * row + lane / 8) as f32 + 0.5);
        id[lane] = layer.id[at(0) + lane];
        for plane in planes.clone() {
            let sample = layer.id[at(plane) + lane];
            if sample != NO_ID {
                share[lane] += each;
                if id[lane] == NO_ID {
                    id[lane] = sample;
                    u[lane] += layer.offsets[plane][0] as f32 / 256.0;
                    v[lane] += layer.offsets[plane][1] as f32 / 256.0;
                }
            }
        }
    }
    let mut over: Colors = [[0.0; LANES]; 3];
    resolve(s, context, &id, SamplePositions::Points([&u, &v]), None, Some(&mut over));
    let k = load(s, &share) * alpha;
    let is_additive = context.shade.scene.opengl.is_some_and(|rules| rules.is_additive);
    for (to, from) in colors.iter_mut().zip(&over) {
        let (below, above) = (load(s, to), load(s, from));
        if is_additive {
            store(min(below + above * k, splat(s, 1.0)), to);
        } else {
            store(below + (above - below) * k, to);
        }
    }
}
