//! The tile rasterizer: fills a visibility buffer with the nearest surface at every sample.
//!
//! Meshes are rasterized triangle by triangle. Shapes with a closed form are rendered by casting the rays of the pixels
//! they may cover, infinite planes by their nearness, which is linear in the image. The image is processed in bands
//! that stay in the cache. Items are drawn front to back, and blocks that are full of nearer surfaces are skipped.

mod candidates;
mod cluster;
mod draw_list;
mod lod;
pub(crate) mod tile;
mod triangle;

use crate::simd::{COLUMN, F, LANES, M, ROW, Simd, U};
use crate::simd::{load, load_u, select, select_u, splat, splat_u, store, store_u};
use crate::visibility::{Projection, primitive};
use cluster::{ClusterPass, Vertices};
pub use draw_list::Layer;
pub(crate) use draw_list::{DrawItem, DrawList, Granularity, PlacedInstance};
use kinetoscope_scene::RenderScene;
use kinetoscope_scene::shape::{Plane, Shape};
pub(crate) use lod::{largest_shift, select_level};
use tile::{BLOCK, NO_ID, Tile};

/// Rasterizes items into a visibility buffer.
#[derive(Clone, Debug, Default)]
pub(crate) struct VisibilityRasterizer {
    vertices: Vertices,
}

impl VisibilityRasterizer {
    /// Draws one item of a draw list. One copy per instruction set: inlined into every caller, it took minutes to
    /// compile.
    #[inline(never)]
    pub(crate) fn draw<S: Simd>(
        &mut self,
        s: S,
        tile: &mut Tile,
        projection: &Projection,
        scene: &RenderScene,
        placed: &[PlacedInstance],
        item: &DrawItem,
    ) {
        let Some(area) = tile.overlap(item.rect) else { return };
        let index = item.instance as usize;
        let (instance, placed) = (&scene.instances()[index], &placed[index]);
        let first_id = scene.first_ids()[index];
        match (item.cluster, placed.mesh(instance)) {
            (Some(k), Some(mesh)) => {
                let mut hidden = true;
                'search: for by in area[1]..=area[3] {
                    for bx in area[0]..=area[2] {
                        let block = tile.block(bx, by);
                        if !tile.is_occluded(block, item.nearness) {
                            hidden = false;
                            break 'search;
                        }
                    }
                }
                if !hidden {
                    let cluster = &mesh.clusters()[k as usize];
                    let pass = ClusterPass {
                        projection,
                        camera_from_instance: &placed.camera_from_instance,
                        cull: placed.culls_backs || cluster.closed && placed.outside,
                        first_id,
                    };
                    let vertices = &mut self.vertices;
                    s.vectorize(
                        #[inline(always)]
                        || cluster::draw(s, tile, vertices, mesh, cluster, &pass),
                    );
                }
            }
            _ if is_infinite_plane(&instance.shape, projection) => s.vectorize(
                #[inline(always)]
                || draw_infinite_plane(s, tile, projection, placed, first_id, area),
            ),
            _ => s.vectorize(
                #[inline(always)]
                || draw_primitive(s, tile, projection, &instance.shape, placed, item, first_id, area),
            ),
        }
    }
}

/// True for an infinite plane seen by a perspective camera.
#[inline(always)]
fn is_infinite_plane(shape: &Shape, projection: &Projection) -> bool {
    matches!(shape, Shape::Plane(plane) if plane.half == [0.0; 2]) && !projection.parallel
}

/// Draws an infinite plane, whose nearness is linear in the image: 1/z = -d.z / o.z, where the ray d from the camera o
/// points down in the plane's frame. Most images are full of one.
#[inline(always)]
fn draw_infinite_plane<S: Simd>(
    s: S,
    tile: &mut Tile,
    projection: &Projection,
    placed: &PlacedInstance,
    first_id: u32,
    area: [usize; 4],
) {
    let camera = &placed.local;
    let ([right, down, forward], height) =
        (camera.instance_from_camera.rotation[2], camera.instance_from_camera.translation[2]);
    // Visible from above only.
    if height <= 0.0 {
        return;
    }
    let (nearest, zero) = (splat(s, projection.nearest()), splat(s, 0.0));
    let (id, nothing) = (splat_u(s, first_id), splat_u(s, NO_ID));
    for by in area[1]..=area[3] {
        for bx in area[0]..=area[2] {
            let block = tile.block(bx, by);
            match coverage(s, projection, placed, [0.0; 2], [bx, by]) {
                Coverage::None => continue,
                // Most of a floor is the only item in its blocks.
                Coverage::All if tile.has_one_item(block) => {
                    tile.fill_uniform(block, first_id);
                    continue;
                }
                _ => {}
            }
            // Elsewhere, it is mostly the first item in its blocks, which then need no comparison.
            let empty = tile.take_cleared(block);
            let mut drawn = false;
            let offsets = tile.offsets;
            for (plane, offset) in offsets.iter().enumerate().take(tile.planes) {
                let offset = offset.map(|x| x as f32 / 256.0);
                let u = load(s, &COLUMN) + ((bx * BLOCK) as f32 + 0.5 + offset[0]);
                let across = (u - projection.cx) * camera.inverse_f[0] * right;
                let samples = tile.samples(block, plane);
                for row in 0..BLOCK / 2 {
                    let v = load(s, &ROW) + ((by * BLOCK + 2 * row) as f32 + 0.5 + offset[1]);
                    // Rounded as in [`Projection::rays`]: shading must see the surface that visibility found.
                    let down = across + (v - projection.cy) * camera.inverse_f[1] * down + forward;
                    let q = primitive::plane_nearness(down, height);
                    let hit = down.simd_lt(zero) & q.simd_le(nearest);
                    let at = samples + row * LANES;
                    let Some(empty) = empty else {
                        drawn |= depth_test(s, tile, at, hit, q, id);
                        continue;
                    };
                    let empty = splat(s, empty);
                    let nearer = hit & q.simd_gt(empty);
                    store(select(nearer, q, empty), &mut tile.nearness[at..]);
                    store_u(select_u(nearer, id, nothing), &mut tile.id[at..]);
                    drawn = true;
                }
            }
            if drawn {
                tile.mark_dirty(block);
            }
        }
    }
}

/// Part of a block that a plane covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Coverage {
    None,
    Part,
    All,
}

/// Part of a block and of one pixel around it that a plane with these half sizes (0 for infinite ones) covers, in front of
/// the far plane and behind the near plane. It covers a convex part of the image, so the corners are sufficient for all of
/// a block. None of a block is covered if its corners are above the horizon; other blocks may count as a part.
#[inline(always)]
fn coverage<S: Simd>(
    s: S,
    projection: &Projection,
    placed: &PlacedInstance,
    half: [f32; 2],
    [bx, by]: [usize; 2],
) -> Coverage {
    let ends = |first: usize| [(first * BLOCK) as f32 - 1.0, ((first + 1) * BLOCK) as f32 + 1.0];
    let ([left, right], [top, bottom]) = (ends(bx), ends(by));
    let is_first = load(s, &COLUMN).simd_lt(splat(s, 3.5));
    let u = select(is_first, splat(s, left), splat(s, right));
    let v = select(load(s, &ROW).simd_lt(splat(s, 0.5)), splat(s, top), splat(s, bottom));
    let (o, d) = projection.rays(s, &placed.local, u, v);
    if d.z.simd_ge(splat(s, 0.0)).all_true() {
        return Coverage::None;
    }
    let hit = primitive::intersect(s, &Shape::Plane(Plane { half }), o, d, projection.near);
    let is_visible = hit.hit & hit.t.simd_lt(splat(s, projection.far));
    if is_visible.all_true() { Coverage::All } else { Coverage::Part }
}

/// Keeps the samples that are nearer than the stored ones, or as near with a larger id. Returns true if any is kept.
#[inline(always)]
fn depth_test<S: Simd>(s: S, tile: &mut Tile, at: usize, hit: M<S>, nearness: F<S>, id: U<S>) -> bool {
    let old = load(s, &tile.nearness[at..]);
    let near = hit & nearness.simd_ge(old);
    if !near.any_true() {
        return false;
    }
    let old_id = load_u(s, &tile.id[at..]);
    let nearer = near & (nearness.simd_gt(old) | old_id.simd_lt(id));
    store(select(nearer, nearness, old), &mut tile.nearness[at..]);
    store_u(select_u(nearer, id, old_id), &mut tile.id[at..]);
    nearer.any_true()
}

/// Bounds of a round shape in the image: a line, and the distance from it \[pixels\]. Most blocks around a long slanted
/// capsule miss it.
#[derive(Clone, Copy, Debug)]
struct Outline {
    ends: [[f32; 2]; 2],
    reach: f32,
}

impl Outline {
    /// Distance of the corners of a block from its middle, and of the samples of a pixel from it \[pixels\], rounded up.
    const BLOCK_REACH: f32 = 7.0;

    /// The bounds of a shape; `None` for other shapes, and in perspective for shapes that reach behind the camera.
    #[inline(always)]
    fn of(shape: &Shape, placed: &PlacedInstance, projection: &Projection) -> Option<Self> {
        let (radius, half) = match shape {
            Shape::Sphere(sphere) => (sphere.radius, 0.0),
            Shape::Capsule(capsule) => (capsule.radius, capsule.half_length),
            Shape::Cylinder(cylinder) => (cylinder.radius, cylinder.half_length),
            _ => return None,
        };
        let ends = [-half, half].map(|z| placed.camera_from_instance.apply([0.0, 0.0, z]));
        let mut widest = radius;
        let mut slopes = ends.map(|[x, y, _]| [x, y]);
        if !projection.parallel {
            // A point at the slopes k and the depth z that is moved by up to r moves by up to r √(1 + k²) / (z - r) on a
            // plane at the depth 1.
            let depth = 0.9999 * ends[0][2].min(ends[1][2]) - radius;
            if depth <= 0.0 {
                return None;
            }
            slopes = ends.map(|[x, y, z]| [x / z, y / z]);
            let square = slopes.map(|[x, y]| x * x + y * y);
            widest = radius * (1.0 + square[0].max(square[1])).sqrt() / depth;
        }
        let ends = slopes.map(|[x, y]| [x * projection.fx + projection.cx, y * projection.fy + projection.cy]);
        let reach = 1.0001 * widest * projection.fx.max(projection.fy) + Self::BLOCK_REACH;
        Some(Self { ends, reach })
    }

    /// True if no sample of a block is within the bounds.
    #[inline(always)]
    fn misses(&self, block: [usize; 2]) -> bool {
        let middle = block.map(|k| (k * BLOCK + BLOCK / 2) as f32);
        let [from, to] = self.ends;
        let (along, at) = ([to[0] - from[0], to[1] - from[1]], [middle[0] - from[0], middle[1] - from[1]]);
        let square = along[0] * along[0] + along[1] * along[1];
        let share = (along[0] * at[0] + along[1] * at[1]) / square.max(1e-12);
        let share = share.clamp(0.0, 1.0);
        let off = [at[0] - share * along[0], at[1] - share * along[1]];
        off[0] * off[0] + off[1] * off[1] > self.reach * self.reach
    }
}

/// Casts the rays of all samples in an area of blocks.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "inlined into its only caller")]
fn draw_primitive<S: Simd>(
    s: S,
    tile: &mut Tile,
    projection: &Projection,
    shape: &Shape,
    placed: &PlacedInstance,
    item: &DrawItem,
    first_id: u32,
    area: [usize; 4],
) {
    let outline = Outline::of(shape, placed, projection);
    for by in area[1]..=area[3] {
        for bx in area[0]..=area[2] {
            let block = tile.block(bx, by);
            if let Shape::Plane(plane) = shape {
                match coverage(s, projection, placed, plane.half, [bx, by]) {
                    Coverage::None => continue,
                    Coverage::All if tile.has_one_item(block) => {
                        tile.fill_uniform(block, first_id);
                        continue;
                    }
                    _ => {}
                }
            }
            if tile.is_occluded(block, item.nearness) || outline.is_some_and(|outline| outline.misses([bx, by])) {
                continue;
            }
            let mut drawn = false;
            let offsets = tile.offsets;
            for (plane, offset) in offsets.iter().enumerate().take(tile.planes) {
                let offset = offset.map(|x| x as f32 / 256.0);
                let u = load(s, &COLUMN) + ((bx * BLOCK) as f32 + 0.5 + offset[0]);
                let samples = tile.samples(block, plane);
                for row in 0..BLOCK / 2 {
                    let v = load(s, &ROW) + ((by * BLOCK + 2 * row) as f32 + 0.5 + offset[1]);
                    let (o, d) = projection.rays(s, &placed.local, u, v);
                    let hit = primitive::intersect(s, shape, o, d, projection.near);
                    // The interval inside of a solid ends at its back.
                    let is_hit =
                        if placed.culls_backs { hit.hit & hit.normal.dot(d).simd_lt(splat(s, 0.0)) } else { hit.hit };
                    if !is_hit.any_true() {
                        continue;
                    }
                    tile.prepare_block(block);
                    let q = match shape {
                        // Same as an infinite plane at the same height, so that the later plane does not shine through.
                        Shape::Plane(_) if !projection.parallel => {
                            primitive::plane_nearness(d.z, placed.local.instance_from_camera.translation[2])
                        }
                        _ => projection.nearness_lanes(hit.t),
                    };
                    drawn |= depth_test(s, tile, samples + row * LANES, is_hit, q, hit.face + splat_u(s, first_id));
                }
            }
            if drawn {
                tile.mark_dirty(block);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::View;
    use kinetoscope_scene::PoseF32;
    use kinetoscope_scene::shape::{Capsule, Cylinder, Sphere};

    /// The blocks at all points of round shapes are within their bounds, in both projections; other blocks are not.
    #[test]
    fn outlines() {
        let mut rng = crate::geometry::TestRng(3);
        let (mut points, mut missed) = (0, 0);
        for round in 0..300 {
            let (radius, half) = (0.05 + 0.2 * (rng.point(1.0)[0].abs() as f32), 0.5 * rng.point(1.0)[1].abs() as f32);
            let shape: Shape = match round % 3 {
                0 => Sphere { radius }.into(),
                1 => Capsule { radius, half_length: half }.into(),
                _ => Cylinder { radius, half_length: half }.into(),
            };
            let at = rng.point(1.0).map(|x| x as f32);
            let axis = rng.point(1.0).map(|x| x as f32);
            let mut view = View::look_at([200, 150], 0.9, [2.5, 0.0, 0.5], [0.0; 3], axis).unwrap();
            view.parallel = round % 2 == 0;
            if view.parallel {
                (view.fx, view.fy) = (70.0, 90.0);
            }
            let projection = Projection::from(&view);
            let pose = PoseF32 { rotation: view.world_from_camera.rotation, translation: at };
            // Turned like the camera, and then about an axis.
            let tilt = View::look_at([8, 8], 0.9, axis, at, [0.3, 0.2, 1.0]).unwrap().world_from_camera.rotation;
            let pose = PoseF32 { rotation: if round % 5 == 0 { pose.rotation } else { tilt }, translation: at };
            let camera_from_instance = projection.world_from_camera.inverse_times(&pose);
            let local = projection.local(&pose);
            let placed =
                PlacedInstance { camera_from_instance, local, outside: true, culls_backs: false, level: 0, error: 0.0 };
            let Some(outline) = Outline::of(&shape, &placed, &projection) else { continue };
            for _ in 0..200 {
                let off = rng.point(1.0).map(|x| x as f32);
                let length = off.iter().map(|x| x * x).sum::<f32>().sqrt().max(0.1);
                let height = if round % 3 == 0 { 0.0 } else { half * rng.point(1.0)[2] as f32 };
                let surface = [0, 1, 2].map(|k| radius * off[k] / length + if k == 2 { height } else { 0.0 });
                let [x, y, z] = camera_from_instance.apply(surface);
                let by = if view.parallel { 1.0 } else { z };
                let pixel = [x / by * view.fx + view.cx, y / by * view.fy + view.cy];
                if pixel.iter().all(|&p| p >= 0.0) {
                    points += 1;
                    assert!(!outline.misses(pixel.map(|p| p as usize / BLOCK)), "{} {pixel:?}", shape.name());
                }
            }
            missed += (0..25 * 19).filter(|k| outline.misses([k % 25, k / 25])).count();
        }
        assert!(points > 20_000 && missed > 300 * 25 * 19 / 2, "{points} {missed}");
    }
}
