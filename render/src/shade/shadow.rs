//! Shadow maps: depth images from a light.

use super::MAX_BAND_SAMPLES;
use super::shadow_fit::{Extent, LightView};
use crate::raster::tile::{BLOCK, BLOCK_AREA, Tile};
use crate::raster::{DrawList, Granularity, Layer, VisibilityRasterizer};
use crate::request::RasterCfg;
use crate::simd::{F, SimdLevel};
use crate::simd::{LANES, M, Simd, V3, at_level, load, max, min, select, splat};
use crate::visibility::Projection;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::{Instance, PoseF32, RenderScene};

/// Depths from a light.
#[derive(Clone, Debug)]
pub(crate) struct ShadowMap {
    projection: Projection,
    /// Casters in the light's view.
    list: DrawList,
    /// Texels along a side before cropping.
    side: usize,
    /// Rotation from the world's axes to the light's.
    light_from_world: [[f32; 3]; 3],
    /// Range of x and y in which the light casts shadows, see [`LightView::limits`].
    limits: Option<[[f32; 2]; 2]>,
    /// Width of a texel on a surface \[m\]: at any depth, or at depth 1 for a spot.
    texel: f32,
    /// Nearness at each texel, row by row: the taps of a point are contiguous in four rows. Rows have [`side`](Self::side)
    /// texels, of which the first ones are in use.
    nearness: Vec<f32>,
    /// Smallest and largest nearness in each block of texels: for most points, all texels are lit, or none.
    range: Vec<[f32; 2]>,
    /// True for blocks of `nearness` that hold the nearness of an empty texel, [`empty`](Self::empty), whatever they were
    /// used for: most of a map is empty, in every frame, and is not written again.
    is_empty: Vec<bool>,
    /// Nearness of an empty texel.
    empty: f32,
}

/// Rows of a map that are rendered together, with their inputs.
#[derive(Debug)]
pub(crate) struct ShadowBand<'a> {
    projection: &'a Projection,
    list: &'a DrawList,
    /// Index of the first row of blocks.
    first: usize,
    /// Largest number of texels of a band, for any crop of the map.
    max_texels: usize,
    /// Texels from row to row.
    side: usize,
    nearness: &'a mut [f32],
    range: &'a mut [[f32; 2]],
    is_empty: &'a mut [bool],
}

/// Rows of blocks of a map that are rendered together; a quarter of small maps, so that the scratch memory is smaller
/// than the map.
fn rows_of_bands([width, height]: [usize; 2]) -> usize {
    (MAX_BAND_SAMPLES / (width * BLOCK)).min(height / BLOCK / 4).max(1)
}

/// Largest number of texels of a band, for any crop of a map of `side` by `side` texels.
fn max_band_texels(side: usize) -> usize {
    if side == 0 { 0 } else { rows_of_bands([side, side]) * BLOCK * side }
}

impl ShadowMap {
    /// A map without memory.
    pub(crate) fn empty() -> Self {
        let projection = Projection {
            parallel: true,
            is_camera: false,
            width: BLOCK,
            height: BLOCK,
            fx: 1.0,
            fy: 1.0,
            cx: 0.0,
            cy: 0.0,
            near: 0.0,
            far: 1.0,
            world_from_camera: PoseF32::IDENTITY,
        };
        Self {
            projection,
            list: DrawList::default(),
            side: 0,
            light_from_world: PoseF32::IDENTITY.rotation,
            limits: None,
            texel: 1.0,
            nearness: Vec::new(),
            range: Vec::new(),
            is_empty: Vec::new(),
            empty: 0.0,
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.list.bytes()
            + size_of::<f32>() * (self.nearness.capacity() + 2 * self.range.capacity())
            + self.is_empty.capacity()
    }

    /// Finds the casters between the light and the `receivers`, on a map of up to `side` by `side` texels, without
    /// rendering them. Returns false if no caster shades a receiver.
    pub(super) fn prepare(
        &mut self,
        light: &LightView,
        receivers: &Extent,
        scene: &RenderScene,
        poses: &[PoseF32],
        cfg: RasterCfg,
        side: usize,
    ) -> bool {
        let solid = |instance: &Instance| {
            Layer::casts_shadows(instance, cfg.groups, scene.lighting_space)
                && instance.shape.aabb()[1].iter().all(|x| x.is_finite())
        };
        // Reserves the whole map and all casters at once: casters move, and memory must not grow with it.
        let parts = if cfg.lod { Granularity::LodClusters } else { Granularity::FullClusters };
        self.list.reserve(scene, parts, |i| if solid(i) { Layer::Opaque } else { Layer::Hidden });
        if self.side != side {
            let blocks = (side / BLOCK).pow(2).max(self.range.len());
            self.nearness.resize(blocks * BLOCK_AREA, 0.0);
            self.range.resize(blocks, [0.0; 2]);
            self.is_empty.resize(blocks, false);
            self.is_empty.fill(false);
            self.side = side;
        }
        let Some((projection, planes)) = light.fit(scene, poses, receivers, side, solid) else { return false };
        let rotation = light.rotation;
        let casts = |i: &Instance| solid(i) && (planes || !matches!(i.shape, Shape::Plane(_)));
        self.texel = 1.0 / projection.fx;
        self.light_from_world = [0, 1, 2].map(|j| [0, 1, 2].map(|i| rotation[i][j]));
        self.projection = projection;
        self.limits = light.limits(&projection);
        self.list.build(
            &projection,
            None,
            scene,
            poses,
            parts,
            |i| if casts(i) { Layer::Opaque } else { Layer::Hidden },
        );
        let empty = projection.farthest();
        if self.empty != empty {
            self.is_empty.fill(false);
            self.empty = empty;
        }
        self.crop()
    }

    /// Samples of a tile that can hold any band of the map, even if the map is not in use now.
    pub(crate) fn max_band_texels(&self) -> usize {
        max_band_texels(self.side)
    }

    /// Crops the map to the visible casters, and one block more on each side for the texels around a point: everything
    /// else is lit. Returns false if no caster is visible.
    fn crop(&mut self) -> bool {
        let Self { projection, list, .. } = self;
        let (mut lo, mut hi) = ([u16::MAX; 2], [0u16; 2]);
        for item in &list.opaque {
            let [x0, y0, x1, y1] = item.rect;
            (lo, hi) = ([lo[0].min(x0), lo[1].min(y0)], [hi[0].max(x1), hi[1].max(y1)]);
        }
        if lo[0] > hi[0] {
            return false;
        }
        let last = [projection.width, projection.height].map(|size| (size / BLOCK - 1) as u16);
        let lo = lo.map(|x| x.saturating_sub(1));
        let hi = [0, 1].map(|k| (hi[k] + 1).min(last[k]));
        for item in &mut list.opaque {
            let [x0, y0, x1, y1] = item.rect;
            item.rect = [x0 - lo[0], y0 - lo[1], x1 - lo[0], y1 - lo[1]];
        }
        [projection.width, projection.height] = [0, 1].map(|k| usize::from(hi[k] - lo[k] + 1) * BLOCK);
        // Whole texels: the crop moves no texel over the surfaces.
        projection.cx -= (usize::from(lo[0]) * BLOCK) as f32;
        projection.cy -= (usize::from(lo[1]) * BLOCK) as f32;
        true
    }

    /// Bands of the map, which can be rendered independently.
    pub(crate) fn bands(&mut self) -> impl Iterator<Item = ShadowBand<'_>> {
        let Self { projection, list, nearness, range, is_empty, side, .. } = self;
        let (projection, list, side) = (&*projection, &*list, *side);
        let max_texels = max_band_texels(side);
        let Projection { width, height, .. } = *projection;
        let (rows, blocks) = (rows_of_bands([width, height]), height / BLOCK * (side / BLOCK));
        let step = rows * (side / BLOCK);
        let parts = nearness[..blocks * BLOCK_AREA].chunks_mut(step * BLOCK_AREA);
        let parts = parts.zip(range[..blocks].chunks_mut(step)).zip(is_empty[..blocks].chunks_mut(step));
        parts.enumerate().map(move |(k, ((nearness, range), is_empty))| ShadowBand {
            projection,
            list,
            first: k * rows,
            max_texels,
            side,
            nearness,
            range,
            is_empty,
        })
    }

    /// Fraction of the light that reaches points, 0..=1, and 1 outside of the map: the mean over 3x3 texels,
    /// interpolated between them. The points are first moved off the surface by more than a texel, so that a surface
    /// does not shadow itself. They are moved farther if the surface has a level of detail with an error up to `error`
    /// \[m\], or the caster has one.
    #[inline(always)]
    pub(crate) fn visibility<S: Simd>(&self, s: S, position: V3<S>, normal: V3<S>, error: f32, lanes: M<S>) -> F<S> {
        let p = &self.projection;
        let mut c = position.sub(V3::splat(s, p.world_from_camera.translation)).rotate(&self.light_from_world);
        let width = if p.parallel { splat(s, self.texel) } else { c.z * self.texel };
        c = c.add(normal.rotate(&self.light_from_world).scale(width * 1.8 + (error + self.list.error)));
        let (x, y, nearness) = if p.parallel {
            (c.x * p.fx, c.y * p.fy, p.nearness_lanes(c.z - width * 0.3))
        } else {
            let inverse = 1.0 / c.z;
            (c.x * inverse * p.fx, c.y * inverse * p.fy, inverse * (1.0 / (1.0 - self.texel * 0.3)))
        };
        let mut inside = c.z.simd_gt(splat(s, p.near));
        if let Some([lo, hi]) = self.limits {
            inside &= x.simd_ge(splat(s, lo[0] * p.fx))
                & x.simd_le(splat(s, hi[0] * p.fx))
                & y.simd_ge(splat(s, lo[1] * p.fy))
                & y.simd_le(splat(s, hi[1] * p.fy));
        }
        let (x, y) = (x + (p.cx - 0.5), y + (p.cy - 0.5));
        inside &= x.simd_gt(splat(s, 2.0))
            & y.simd_gt(splat(s, 2.0))
            & x.simd_lt(splat(s, p.width as f32 - 3.0))
            & y.simd_lt(splat(s, p.height as f32 - 3.0));
        let wanted = inside & lanes;
        let bits = wanted.to_bitmask();
        if bits == 0 {
            return splat(s, 1.0);
        }
        // Lanes that are not wanted use the texels of a wanted lane.
        let some = bits.trailing_zeros() as usize % LANES;
        let x = select(wanted, x, splat(s, x.array()[some]));
        let y = select(wanted, y, splat(s, y.array()[some]));
        let (columns, rows): ([i32; LANES], [i32; LANES]) = (x.to_int().array(), y.to_int().array());
        let (mut lo, mut hi) = ([i32::MAX; 2], [0i32; 2]);
        for (&x, &y) in columns.iter().zip(&rows) {
            (lo, hi) = ([lo[0].min(x), lo[1].min(y)], [hi[0].max(x), hi[1].max(y)]);
        }
        let [x0, y0] = [(lo[0] as usize - 1) / BLOCK, (lo[1] as usize - 1) / BLOCK];
        let [x1, y1] = [(hi[0] as usize + 2) / BLOCK, (hi[1] as usize + 2) / BLOCK];
        // Pixels far apart on the map would read too many blocks.
        if (x1 + 1 - x0) * (y1 + 1 - y0) <= 12 {
            let (mut low, mut high) = (f32::MAX, f32::MIN);
            for row in y0..=y1 {
                let first = row * (self.side / BLOCK);
                for &[l, h] in &self.range[first + x0..=first + x1] {
                    (low, high) = (if l < low { l } else { low }, if h > high { h } else { high });
                }
            }
            if !(wanted & nearness.simd_lt(splat(s, high))).any_true() {
                return splat(s, 1.0);
            }
            if !(wanted & nearness.simd_ge(splat(s, low))).any_true() {
                return select(wanted, splat(s, 0.0), splat(s, 1.0));
            }
        }
        let (x, y, q): ([f32; LANES], [f32; LANES], [f32; LANES]) = (x.array(), y.array(), nearness.array());
        let mut lit = [1.0f32; LANES];
        for lane in (0..LANES).filter(|lane| bits >> lane & 1 == 1) {
            let (column, row) = (columns[lane], rows[lane]);
            lit[lane] =
                self.taps([column as usize, row as usize], x[lane] - column as f32, y[lane] - row as f32, q[lane]);
        }
        load(s, &lit)
    }

    /// Returns the lit fraction of sixteen texels around a point, filtered. The result is exactly 1 if no texel is
    /// nearer to the light, or if the nearer ones weigh less than a ninety-thousandth: the same as without reading
    /// texels.
    #[inline(always)]
    fn taps(&self, [column, row]: [usize; 2], fx: f32, fy: f32, q: f32) -> f32 {
        let width = self.side;
        let mut lit = [0.0f32; 4];
        for (k, weight) in [1.0 - fy, 1.0, 1.0, fy].into_iter().enumerate() {
            let first = (row + k - 1) * width + column - 1;
            let Some(texels) = self.nearness[first..].first_chunk::<4>() else { continue };
            for (lit, texel) in lit.iter_mut().zip(texels) {
                *lit += if *texel > q { 0.0 } else { weight };
            }
        }
        let sum = lit[0] * (1.0 - fx) + lit[1] + lit[2] + lit[3] * fx;
        if sum > 8.9999 { 1.0 } else { sum * (1.0 / 9.0) }
    }
}

impl ShadowBand<'_> {
    /// Renders the band, by way of a tile that stays in the cache.
    pub(crate) fn draw(
        self,
        level: SimdLevel,
        scene: &RenderScene,
        tile: &mut Tile,
        rasterizer: &mut VisibilityRasterizer,
    ) {
        let Self { projection, list, first, max_texels, side, nearness, range, is_empty } = self;
        let wide = projection.width / BLOCK;
        let rows = range.len() / (side / BLOCK);
        tile.reserve(max_texels);
        tile.clear([0, first * BLOCK], [wide, rows], 1, projection.farthest());
        at_level!(level, s => {
            for item in &list.opaque {
                rasterizer.draw(s, tile, projection, scene, &list.placed, item);
            }
            s.vectorize(
                #[inline(always)]
                || unfold(s, tile, side, nearness, range, is_empty),
            );
        });
    }
}

/// Copies the blocks of a tile into rows of `side` texels, and writes the smallest and largest nearness of each block to
/// `range`. Blocks that are empty, and were so before, are not written.
#[inline(always)]
fn unfold<S: Simd>(
    s: S,
    tile: &Tile,
    side: usize,
    nearness: &mut [f32],
    range: &mut [[f32; 2]],
    is_empty: &mut [bool],
) {
    let lines = nearness.chunks_exact_mut(BLOCK * side);
    let blocks = range.chunks_exact_mut(side / BLOCK).zip(is_empty.chunks_exact_mut(side / BLOCK));
    for (by, (lines, (range, is_empty))) in lines.zip(blocks).enumerate() {
        for (bx, (range, is_empty)) in range.iter_mut().zip(is_empty).take(tile.blocks_x).enumerate() {
            let block = by * tile.blocks_x + bx;
            if let Some(empty) = tile.cleared_nearness(block) {
                *range = [empty; 2];
                if !std::mem::replace(is_empty, true) {
                    write_block(lines, side, bx, &[[empty; BLOCK]; BLOCK]);
                }
                continue;
            }
            *is_empty = false;
            let block = &tile.nearness[tile.samples(block, 0)..][..BLOCK_AREA];
            let (mut low, mut high) = (load(s, block), load(s, block));
            for two in block.chunks_exact(LANES) {
                (low, high) = (min(load(s, two), low), max(load(s, two), high));
            }
            let (lows, highs): ([f32; LANES], [f32; LANES]) = (low.array(), high.array());
            *range = [lows[0], highs[0]];
            for (&l, &h) in lows.iter().zip(&highs) {
                *range = [if l < range[0] { l } else { range[0] }, if h > range[1] { h } else { range[1] }];
            }
            write_block(lines, side, bx, block.as_chunks::<BLOCK>().0);
        }
    }
}

/// Writes a block to rows of `side` texels. Rows are arrays, because slices of unknown length are copied by a call.
#[inline(always)]
fn write_block(lines: &mut [f32], side: usize, bx: usize, rows: &[[f32; BLOCK]]) {
    for (row, from) in rows.iter().enumerate() {
        if let Some(to) = lines[row * side + bx * BLOCK..].first_chunk_mut() {
            *to = *from;
        }
    }
}
