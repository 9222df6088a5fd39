//! Rasterization of a cluster of triangles: transform, clip, triangle setup.

use super::candidates::candidates;
use super::tile::Tile;
use super::triangle::{self, GUARD_BAND, Gradient, SUBPIXELS};
use crate::simd::{LANES, Simd, abs, load, select, splat, store, store_i};
use crate::visibility::Projection;
use kinetoscope_scene::PoseF32;
use kinetoscope_scene::shape::Cluster;
use kinetoscope_scene::shape::RenderMesh;
use kinetoscope_scene::vector::{cross, dot, sub};

/// Largest number of vertices: an index of one byte needs no check. A cluster has fewer.
const MAX_VERTICES: usize = 256;
const _: () = assert!(3 * RenderMesh::MAX_CLUSTER_TRIANGLES <= MAX_VERTICES);
/// Adding and subtracting this rounds to an integer (below 2^22). `round()` would be a library call.
const ROUND: f32 = 12_582_912.0;

/// Transformed vertices of a cluster.
#[derive(Clone, Debug)]
pub(crate) struct Vertices {
    camera: [[f32; MAX_VERTICES]; 3],
    screen: [[f32; MAX_VERTICES]; 2],
    snapped: [[i32; MAX_VERTICES]; 2],
    /// The numbers of `snapped`.
    pub(super) grid: [[f32; MAX_VERTICES]; 2],
    nearness: [f32; MAX_VERTICES],
    /// 1 if the vertex must be clipped, else 0.
    clip: [f32; MAX_VERTICES],
}

impl Default for Vertices {
    fn default() -> Self {
        Self {
            camera: [[0.0; MAX_VERTICES]; 3],
            screen: [[0.0; MAX_VERTICES]; 2],
            snapped: [[0; MAX_VERTICES]; 2],
            grid: [[0.0; MAX_VERTICES]; 2],
            nearness: [0.0; MAX_VERTICES],
            clip: [0.0; MAX_VERTICES],
        }
    }
}

/// State that all triangles of an instance share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClusterPass<'a> {
    pub(crate) projection: &'a Projection,
    pub(crate) camera_from_instance: &'a PoseF32,
    /// True if back faces are culled.
    pub(crate) cull: bool,
    pub(crate) first_id: u32,
}

/// Rasterizes the triangles of a cluster, front faces only if `pass` culls.
#[inline(always)]
pub(crate) fn draw<S: Simd>(
    s: S,
    tile: &mut Tile,
    v: &mut Vertices,
    mesh: &RenderMesh,
    cluster: &Cluster,
    pass: &ClusterPass<'_>,
) {
    let all_good = transform(s, v, mesh, cluster, pass);
    let nearest = pass.projection.nearest();
    let first = cluster.first as usize;
    let corners_of = &mesh.corners()[first..first + cluster.count as usize];
    for (group, corners_of) in corners_of.chunks(LANES).enumerate() {
        let everything = (1 << corners_of.len()) - 1;
        let mut left = if all_good { candidates(s, tile, v, corners_of, pass.cull) } else { everything };
        while left != 0 {
            let k = left.trailing_zeros() as usize % LANES;
            left &= left - 1;
            let corners = corners_of[k].map(usize::from);
            let id = pass.first_id + (first + group * LANES + k) as u32;
            if !all_good && corners.iter().any(|&i| v.clip[i] != 0.0) {
                draw_clipped(s, tile, v, corners, pass, id);
                continue;
            }
            let snapped = |i: usize| [v.snapped[0][i], v.snapped[1][i]];
            let mut p = [snapped(corners[0]), snapped(corners[1]), snapped(corners[2])];
            let double =
                |a: [i32; 2], b: [i32; 2]| i64::from(a[0]) * i64::from(b[1]) - i64::from(a[1]) * i64::from(b[0]);
            let edge = |k: usize| [p[k][0] - p[0][0], p[k][1] - p[0][1]];
            let area = double(edge(1), edge(2));
            // The image's y axis points down, so front faces are clockwise: negative area.
            if area == 0 || (area > 0 && pass.cull) {
                continue;
            }
            if area < 0 {
                p.swap(1, 2);
            }
            let plane = || {
                let seen = |i: usize| [v.camera[0][i], v.camera[1][i], v.camera[2][i]];
                let camera = [seen(corners[0]), seen(corners[1]), seen(corners[2])];
                let at = [v.screen[0][corners[0]], v.screen[1][corners[0]]];
                gradient(pass.projection, camera, at, corners.map(|i| v.nearness[i]).as_slice())
            };
            triangle::draw(s, tile, p, plane, nearest, id);
        }
    }
}

/// Transforms the vertices of a cluster; true if no vertex must be clipped.
#[inline(always)]
fn transform<S: Simd>(s: S, v: &mut Vertices, mesh: &RenderMesh, cluster: &Cluster, pass: &ClusterPass<'_>) -> bool {
    let (projection, pose) = (pass.projection, pass.camera_from_instance);
    let (r, t) = (&pose.rotation, pose.translation);
    let too_near = splat(s, 0.5 * projection.near);
    let (guard, zero) = (splat(s, GUARD_BAND), splat(s, 0.0));
    let mut all_good = true;
    for i in (0..cluster.vertex_count as usize).step_by(LANES) {
        let from = cluster.first_vertex as usize + i;
        let [x, y, z] = mesh.cluster_positions();
        let (x, y, z) = (load(s, &x[from..]), load(s, &y[from..]), load(s, &z[from..]));
        let row = {
            #[inline(always)]
            |k: usize| x * r[k][0] + y * r[k][1] + z * r[k][2] + t[k]
        };
        let c = [row(0), row(1), row(2)];
        let nearness = projection.nearness_lanes(c[2]);
        let (sx, sy) = if projection.parallel {
            (c[0] * projection.fx + projection.cx, c[1] * projection.fy + projection.cy)
        } else {
            (c[0] * nearness * projection.fx + projection.cx, c[1] * nearness * projection.fy + projection.cy)
        };
        store(nearness, &mut v.nearness[i..]);
        let good = abs(sx).simd_le(guard) & abs(sy).simd_le(guard) & c[2].simd_ge(too_near);
        for (to, value) in v.camera.iter_mut().zip(c) {
            store(value, &mut to[i..]);
        }
        for (k, value) in [sx, sy].into_iter().enumerate() {
            let value = select(good, value, zero);
            store(value, &mut v.screen[k][i..]);
            let snapped = (value * SUBPIXELS + ROUND) - ROUND;
            store(snapped, &mut v.grid[k][i..]);
            store_i(snapped.to_int(), &mut v.snapped[k][i..]);
        }
        store(select(good, zero, splat(s, 1.0)), &mut v.clip[i..]);
        all_good &= good.all_true();
    }
    all_good
}

/// Nearness gradient of a triangle's plane, from its unsnapped corners. A ray (x, y, 1) meets the plane n·p = d at the
/// nearness 1/z = n·(x, y, 1) / d, which is linear in the pixels. `at` is the first corner in the image, `polygon`
/// holds the nearness of the rasterized corners, the first corner first.
#[inline(always)]
fn gradient(projection: &Projection, p: [[f32; 3]; 3], at: [f32; 2], polygon: &[f32]) -> Gradient {
    let (u, v) = (sub(p[1], p[0]), sub(p[2], p[0]));
    let n = cross(u, v);
    let (d, scale) = if projection.parallel { (n[2], 1.0 / projection.far) } else { (dot(n, p[0]), 1.0) };
    let k = if d == 0.0 { 0.0 } else { scale / d };
    let finite = |x: f32| if x.is_finite() { x } else { 0.0 };
    let (mut low, mut high) = (f32::MAX, f32::MIN);
    for &q in polygon {
        (low, high) = (low.min(q), high.max(q));
    }
    let step = [finite(n[0] * k / projection.fx), finite(n[1] * k / projection.fy)];
    Gradient { at: [at[0], at[1], polygon[0]], step, low, high }
}

/// Rasterizes a triangle that leaves the guard band or comes too near: clipped to a polygon of at most eight corners,
/// drawn as a fan. Edges are cut from the inside to the outside, so both neighbors of an edge get the same point.
#[inline(never)]
fn draw_clipped<S: Simd>(s: S, tile: &mut Tile, v: &Vertices, corners: [usize; 3], pass: &ClusterPass<'_>, id: u32) {
    let projection = pass.projection;
    let original = corners.map(|i| [v.camera[0][i], v.camera[1][i], v.camera[2][i]]);
    let Some((polygon, count)) = clip(projection, original) else { return };
    let polygon = &polygon[..count];
    let screen = |c: [f32; 3]| {
        let inverse = if projection.parallel { 1.0 } else { 1.0 / c[2] };
        let k = GUARD_BAND + 1.0;
        [
            (c[0] * inverse * projection.fx + projection.cx).clamp(-k, k),
            (c[1] * inverse * projection.fy + projection.cy).clamp(-k, k),
        ]
    };
    let snap = |p: [f32; 2]| p.map(|x| ((x * SUBPIXELS + ROUND) - ROUND) as i32);
    let mut nearness = [0.0; 9];
    for (to, corner) in nearness.iter_mut().zip(polygon) {
        *to = projection.nearness(corner[2]);
    }
    let g = gradient(projection, original, screen(polygon[0]), &nearness[..count]);
    for k in 2..count {
        let mut p = [0, k - 1, k].map(|i| snap(screen(polygon[i])));
        let edge = |k: usize| [i64::from(p[k][0] - p[0][0]), i64::from(p[k][1] - p[0][1])];
        let area = edge(1)[0] * edge(2)[1] - edge(1)[1] * edge(2)[0];
        if area == 0 || (area > 0 && pass.cull) {
            continue;
        }
        if area < 0 {
            p.swap(1, 2);
        }
        draw_outlined(s, tile, p, &g, projection.nearest(), id);
    }
}

/// Not inlined: a second copy of [`triangle::draw`] does not pay off.
#[inline(never)]
fn draw_outlined<S: Simd>(s: S, tile: &mut Tile, p: [[i32; 2]; 3], g: &Gradient, nearest: f32, id: u32) {
    s.vectorize(
        #[inline(always)]
        || triangle::draw(s, tile, p, || *g, nearest, id),
    );
}

/// Clips a triangle to the region in front of the camera and inside the guard band. Returns the corners of the polygon
/// and their number; `None` if nothing is left.
fn clip(projection: &Projection, triangle: [[f32; 3]; 3]) -> Option<([[f32; 3]; 9], usize)> {
    let p = projection;
    // Signed distances: positive inside. The screen coordinate is fx x / z + cx, for parallel rays fx x + cx.
    let side = |fx: f32, fy: f32, guard: f32| {
        let [by_depth, alone] = if p.parallel { [0.0, guard] } else { [guard, 0.0] };
        [fx, fy, by_depth, alone]
    };
    let planes = [
        [0.0, 0.0, 1.0, -0.5 * p.near],
        side(-p.fx, 0.0, GUARD_BAND - p.cx),
        side(p.fx, 0.0, GUARD_BAND + p.cx),
        side(0.0, -p.fy, GUARD_BAND - p.cy),
        side(0.0, p.fy, GUARD_BAND + p.cy),
    ];
    let mut from = ([[0.0f32; 3]; 9], 3);
    from.0[..3].copy_from_slice(&triangle);
    for plane in planes {
        let side = |c: [f32; 3]| plane[0] * c[0] + plane[1] * c[1] + plane[2] * c[2] + plane[3];
        let mut to = ([[0.0f32; 3]; 9], 0);
        for k in 0..from.1 {
            let (a, b) = (from.0[k], from.0[(k + 1) % from.1]);
            let (da, db) = (side(a), side(b));
            let mut push = |c| {
                if to.1 < 9 {
                    to.0[to.1] = c;
                    to.1 += 1;
                }
            };
            if da >= 0.0 {
                push(a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                let (inside, outside, di, d_o) = if da >= 0.0 { (a, b, da, db) } else { (b, a, db, da) };
                let k = di / (di - d_o);
                push([0, 1, 2].map(|i| inside[i] + (outside[i] - inside[i]) * k));
            }
        }
        from = to;
        if from.1 < 3 {
            return None;
        }
    }
    Some(from)
}
