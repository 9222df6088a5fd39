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
use kinetoscope_scene::shape::Shape;
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
            // Most of a floor is the first item in its blocks, which then need no comparison.
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

/// Bounds of a round shape in a parallel projection: a line, and the distance from it \[pixels\]. Most blocks around a long
/// slanted capsule miss it.
#[derive(Clone, Copy, Debug)]
struct Outline {
    ends: [[f32; 2]; 2],
    reach: f32,
}

impl Outline {
    /// Distance of the corners of a block from its middle, and of the samples of a pixel from it \[pixels\], rounded up.
    const BLOCK_REACH: f32 = 7.0;

    /// The bounds of a shape; `None` for other shapes, and in perspective.
    #[inline(always)]
    fn of(shape: &Shape, placed: &PlacedInstance, projection: &Projection) -> Option<Self> {
        let (radius, half) = match shape {
            Shape::Sphere(sphere) => (sphere.radius, 0.0),
            Shape::Capsule(capsule) => (capsule.radius, capsule.half_length),
            Shape::Cylinder(cylinder) => (cylinder.radius, cylinder.half_length),
            _ => return None,
        };
        let end = |z: f32| {
            let [x, y, _] = placed.camera_from_instance.apply([0.0, 0.0, z]);
            [x * projection.fx + projection.cx, y * projection.fy + projection.cy]
        };
        let reach = 1.0001 * radius * projection.fx.max(projection.fy) + Self::BLOCK_REACH;
        projection.parallel.then(|| Self { ends: [end(-half), end(half)], reach })
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
