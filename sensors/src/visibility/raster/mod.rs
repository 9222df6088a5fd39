//! The tile rasterizer: fills a visibility buffer with the nearest surface at every sample.
//!
//! Meshes are drawn triangle by triangle, shapes with a closed form by casting the rays of the pixels they may cover. The
//! picture is drawn in bands that stay in the cache; things are drawn front to back, and blocks that are full
//! of nearer things are skipped.

mod cluster;
mod detail;
mod draw_list;
pub(crate) mod tile;
mod triangle;

use super::{Projection, primitive};
use crate::lanes::{COLUMN, ROW, Simd, load, load_u, select, select_u, splat_u, store, store_u};
use cluster::{Pass, Vertices};
pub(crate) use detail::level;
pub(crate) use draw_list::{DrawList, Item, Layer, Placed};
use scene::RenderScene;
use tile::{BLOCK, SAMPLES, Tile};

/// Draws things into a visibility buffer.
#[derive(Clone, Debug, Default)]
pub(crate) struct Painter {
    vertices: Vertices,
}

impl Painter {
    /// Draws one thing of a draw list. One copy per instruction set: inlined into every caller, it took minutes to compile.
    #[inline(never)]
    pub(crate) fn draw<S: Simd>(
        &mut self,
        s: S,
        tile: &mut Tile,
        projection: &Projection,
        scene: &RenderScene,
        placed: &[Placed],
        item: &Item,
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
                        if !tile.hidden(block, item.nearness) {
                            hidden = false;
                            break 'search;
                        }
                    }
                }
                if !hidden {
                    let cluster = &mesh.clusters()[k as usize];
                    let pass = Pass {
                        projection,
                        camera_from_instance: &placed.camera_from_instance,
                        cull: cluster.closed && placed.outside,
                        first_id,
                    };
                    let vertices = &mut self.vertices;
                    s.vectorize(
                        #[inline(always)]
                        || cluster::draw(s, tile, vertices, mesh, cluster, &pass),
                    );
                }
            }
            _ => s.vectorize(
                #[inline(always)]
                || draw_primitive(s, tile, projection, &instance.shape, placed, item, first_id, area),
            ),
        }
    }
}

/// Casts the rays of all samples in an area of blocks.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "inlined into its only caller")]
fn draw_primitive<S: Simd>(
    s: S,
    tile: &mut Tile,
    projection: &Projection,
    shape: &scene::Shape,
    placed: &Placed,
    item: &Item,
    first_id: u32,
    area: [usize; 4],
) {
    for by in area[1]..=area[3] {
        for bx in area[0]..=area[2] {
            let block = tile.block(bx, by);
            if tile.hidden(block, item.nearness) {
                continue;
            }
            let mut drawn = false;
            for (plane, offset) in SAMPLES.iter().enumerate().take(tile.planes) {
                let offset = offset.map(|x| x as f32 / 256.0);
                let u = load(s, &COLUMN) + ((bx * BLOCK) as f32 + 0.5 + offset[0]);
                let samples = tile.samples(block, plane);
                for row in 0..BLOCK / 2 {
                    let v = load(s, &ROW) + ((by * BLOCK + 2 * row) as f32 + 0.5 + offset[1]);
                    let (o, d) = projection.rays(s, &placed.local, u, v);
                    let (hit, q, face) = primitive::nearness(s, shape, projection, o, d);
                    if !hit.any_true() {
                        continue;
                    }
                    let here = samples + row * 16;
                    let old = load(s, &tile.nearness[here..]);
                    let m = hit & q.simd_gt(old);
                    if m.any_true() {
                        store(select(m, q, old), &mut tile.nearness[here..]);
                        let old = load_u(s, &tile.id[here..]);
                        store_u(select_u(m, face + splat_u(s, first_id), old), &mut tile.id[here..]);
                        drawn = true;
                    }
                }
            }
            if drawn {
                tile.touch(block);
            }
        }
    }
}
