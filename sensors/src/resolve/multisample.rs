//! Colours of pixels whose four samples do not see the same: the mean of the samples.

use super::group::{At, Colors, Context, resolve};
use crate::lanes::{LANES, Simd, load, load_u, splat_u, store};
use crate::visibility::raster::tile::{NOTHING, SAMPLES, Tile};

/// A colour to compute: the pixel in the group, how many samples it stands for, where and of which id.
#[derive(Clone, Copy, Debug)]
struct Request {
    lane: u8,
    weight: u8,
    id: u32,
    u: f32,
    v: f32,
}

/// Whether two ids of one pixel look different enough to need a colour each.
#[inline(always)]
fn differ(context: &Context<'_>, a: u32, b: u32, qa: f32, qb: f32, last: &mut usize) -> bool {
    if a == b {
        return false;
    }
    if a == NOTHING || b == NOTHING {
        return true;
    }
    *last = context.instance(a, *last);
    let first = context.scene.first_ids();
    if b < first[*last] || b >= first[*last + 1] {
        return true;
    }
    let Some(mesh) = context.placed[*last].mesh(&context.scene.instances()[*last]) else { return true };
    // Neighbouring triangles of a smooth surface look the same: same normal, same distance.
    let corner = |id: u32| mesh.normals()[mesh.triangles()[(id - first[*last]) as usize][0] as usize];
    let (na, nb) = (corner(a), corner(b));
    let cosine = na[0] * nb[0] + na[1] * nb[1] + na[2] * nb[2];
    cosine < 0.97 || (qa - qb).abs() > 0.02 * qa
}

/// Replaces the colours of the pixels of a group (two rows of a block, `row` counts pairs) that lie on an edge.
#[inline(always)]
pub(crate) fn smooth<S: Simd>(
    s: S,
    context: &Context<'_>,
    tile: &Tile,
    block: usize,
    row: usize,
    corner: [f32; 2],
    colors: &mut Colors,
) {
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
    let mut requests = [Request { lane: 0, weight: 0, id: 0, u: 0.0, v: 0.0 }; 4 * LANES];
    let mut count = 0;
    let (mut edges, mut last) = (0u32, 0);
    while left != 0 {
        let lane = left.trailing_zeros() as usize;
        left &= left - 1;
        let sample = |plane: usize| (tile.id[at(plane) + lane], tile.nearness[at(plane) + lane]);
        let (c, qc) = sample(0);
        if !(1..5).any(|plane| differ(context, c, sample(plane).0, qc, sample(plane).1, &mut last)) {
            continue;
        }
        edges |= 1 << lane;
        let begin = count;
        for (plane, offset) in SAMPLES.iter().enumerate().skip(1) {
            let (id, q) = sample(plane);
            let known = requests[begin..count].iter_mut().find(|r| {
                let other = (1..5).find(|&p| sample(p).0 == r.id).map_or(q, |p| sample(p).1);
                !differ(context, r.id, id, other, q, &mut last)
            });
            if let Some(known) = known {
                known.weight += 1;
                continue;
            }
            requests[count] = Request {
                lane: lane as u8,
                weight: 1,
                id,
                u: corner[0] + (lane % 8) as f32 + 0.5 + offset[0] as f32 / 256.0,
                v: corner[1] + (2 * row + lane / 8) as f32 + 0.5 + offset[1] as f32 / 256.0,
            };
            count += 1;
        }
    }
    if edges == 0 {
        return;
    }
    for lane in (0..LANES).filter(|lane| edges >> lane & 1 == 1) {
        for channel in colors.iter_mut() {
            channel[lane] = 0.0;
        }
    }
    for batch in requests[..count].chunks(LANES) {
        let (mut u, mut v, mut id) = ([corner[0]; LANES], [corner[1]; LANES], [NOTHING; LANES]);
        for (k, request) in batch.iter().enumerate() {
            (u[k], v[k], id[k]) = (request.u, request.v, request.id);
        }
        let mut out: Colors = [[0.0; LANES]; 3];
        resolve(s, context, &id, At::Points([&u, &v]), None, Some(&mut out));
        for (k, request) in batch.iter().enumerate() {
            let weight = f32::from(request.weight) * 0.25;
            for (to, from) in colors.iter_mut().zip(&out) {
                to[usize::from(request.lane)] += from[k] * weight;
            }
        }
    }
}

/// Blends a layer over a group: `alpha` times the share of the samples that the layer covers.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "inlined into its only caller")]
pub(crate) fn blend<S: Simd>(
    s: S,
    context: &Context<'_>,
    layer: &Tile,
    block: usize,
    row: usize,
    corner: [f32; 2],
    alpha: f32,
    colors: &mut Colors,
) {
    let at = |plane: usize| layer.samples(block, plane) + row * LANES;
    let nothing = splat_u(s, NOTHING);
    let mut share = [0.0f32; LANES];
    let mut id = [NOTHING; LANES];
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
            if sample != NOTHING {
                share[lane] += each;
                if id[lane] == NOTHING {
                    id[lane] = sample;
                    u[lane] += SAMPLES[plane][0] as f32 / 256.0;
                    v[lane] += SAMPLES[plane][1] as f32 / 256.0;
                }
            }
        }
    }
    let mut over: Colors = [[0.0; LANES]; 3];
    resolve(s, context, &id, At::Points([&u, &v]), None, Some(&mut over));
    let k = load(s, &share) * alpha;
    for (to, from) in colors.iter_mut().zip(&over) {
        let (below, above) = (load(s, to), load(s, from));
        store(below + (above - below) * k, to);
    }
}
