//! The visibility buffer: nearness and id of the nearest surface, for a part of the image.

/// Pixels along the side of a block.
pub(crate) const BLOCK: usize = 8;
/// Pixels in a block.
pub(crate) const BLOCK_AREA: usize = BLOCK * BLOCK;
/// Id of an empty sample.
pub(crate) const NO_ID: u32 = u32::MAX;

/// Sample positions in a pixel, from its center, in 1/256 pixel. The first is the center, used by all channels but
/// color; the other four are the rotated grid of GPUs.
pub(crate) const SAMPLES: [[i32; 2]; 5] = [[0, 0], [-32, -96], [96, -32], [-96, 32], [32, 96]];
/// The same grid mirrored, as in OpenGL: the rows of its images go up.
pub(crate) const OPENGL_SAMPLES: [[i32; 2]; 5] = [[0, 0], [-32, 96], [96, 32], [-96, -32], [32, -96]];
/// Number of items in a block that counts as many.
const MANY: u8 = 2;

/// The largest offset of a sample.
pub(crate) const MAX_SAMPLE_OFFSET: i32 = 96;

/// A rectangle of 8x8 blocks of the image. Within a block, samples of one kind are contiguous: `[block][plane][64]`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tile {
    /// The first pixel; a multiple of [`BLOCK`].
    pub(crate) x0: usize,
    pub(crate) y0: usize,
    pub(crate) blocks_x: usize,
    pub(crate) blocks_y: usize,
    /// 1, or 5 with multisampling.
    pub(crate) planes: usize,
    /// Positions of the samples of each plane, in 1/256 pixel.
    pub(crate) offsets: [[i32; 2]; SAMPLES.len()],
    pub(crate) nearness: Vec<f32>,
    pub(crate) id: Vec<u32>,
    /// Lower bound of the nearness in each block.
    farthest: Vec<f32>,
    /// True if the block changed since `farthest` was computed.
    dirty: Vec<bool>,
    /// True if the block is empty, whatever its memory holds. It is cleared when it is first drawn into, while it
    /// passes through the cache anyway.
    cleared: Vec<bool>,
    /// Number of items that may cover samples of each block, up to [`MANY`].
    items: Vec<u8>,
    /// True for blocks whose samples all have the id of their plane 0, which is the only plane in memory. Nothing is drawn
    /// into them any more, so they need no nearness.
    uniform: Vec<bool>,
    /// True if `items` are counted.
    is_counted: bool,
    /// Nearness of an empty sample.
    empty: f32,
    /// The only row of each block that rays are cast for; `None` for all rows.
    pub(crate) only_row: Option<usize>,
}

impl Tile {
    /// Reserves memory for tiles of up to `samples` samples in total, over all pixels and planes.
    pub(crate) fn reserve(&mut self, samples: usize) {
        let blocks = samples.div_ceil(BLOCK_AREA);
        self.nearness.reserve_exact(samples.saturating_sub(self.nearness.len()));
        self.id.reserve_exact(samples.saturating_sub(self.id.len()));
        self.farthest.reserve_exact(blocks.saturating_sub(self.farthest.len()));
        self.dirty.reserve_exact(blocks.saturating_sub(self.dirty.len()));
        self.cleared.reserve_exact(blocks.saturating_sub(self.cleared.len()));
        self.items.reserve_exact(blocks.saturating_sub(self.items.len()));
        self.uniform.reserve_exact(blocks.saturating_sub(self.uniform.len()));
    }

    /// Moves the tile and empties it. Call [`finish`](Self::finish) before reading it.
    pub(crate) fn clear(&mut self, origin: [usize; 2], blocks: [usize; 2], planes: usize, farthest: f32) {
        [self.x0, self.y0] = origin;
        [self.blocks_x, self.blocks_y] = blocks;
        self.planes = planes;
        self.empty = farthest;
        let count = blocks[0] * blocks[1];
        // Memory of larger tiles is kept: filling it again would take longer than drawing small images.
        let samples = count * planes * BLOCK_AREA;
        if self.nearness.len() < samples {
            self.nearness.resize(samples, farthest);
            self.id.resize(samples, NO_ID);
        }
        for (flags, value) in [(&mut self.dirty, false), (&mut self.cleared, true), (&mut self.uniform, false)] {
            flags.clear();
            flags.resize(count, value);
        }
        self.items.clear();
        self.items.resize(count, MANY);
        self.is_counted = false;
        self.farthest.clear();
        self.farthest.resize(count, farthest);
    }

    /// Counts the items that may cover each block, given by their rectangles of blocks. No other item may be drawn.
    pub(crate) fn count_items(&mut self, rects: impl Iterator<Item = [u16; 4]>) {
        self.items.fill(0);
        self.is_counted = true;
        for rect in rects {
            let Some([x0, y0, x1, y1]) = self.overlap(rect) else { continue };
            for by in y0..=y1 {
                let (first, last) = (self.block(x0, by), self.block(x1, by));
                for count in &mut self.items[first..=last] {
                    *count = (*count + 1).min(MANY);
                }
            }
        }
    }

    /// True if only one item may cover samples of a block.
    #[inline(always)]
    pub(crate) fn has_one_item(&self, block: usize) -> bool {
        self.items[block] == 1
    }

    /// Fills a block that no other item covers with an id.
    #[inline(always)]
    pub(crate) fn fill_uniform(&mut self, block: usize, id: u32) {
        let first = self.samples(block, 0);
        self.id[first..first + BLOCK_AREA].fill(id);
        (self.cleared[block], self.uniform[block]) = (false, true);
    }

    /// True if all samples of a block have the id of their plane 0; other planes and the nearness hold anything.
    #[inline(always)]
    pub(crate) fn is_uniform(&self, block: usize) -> bool {
        self.uniform[block]
    }

    /// Prepares a block for drawing.
    #[inline(always)]
    pub(crate) fn prepare_block(&mut self, block: usize) {
        if self.cleared[block] {
            self.empty_block(block);
        }
    }

    #[inline(never)]
    fn empty_block(&mut self, block: usize) {
        let samples = self.samples(block, 0)..self.samples(block + 1, 0);
        self.nearness[samples.clone()].fill(self.empty);
        self.id[samples].fill(NO_ID);
        self.cleared[block] = false;
    }

    /// Prepares a block of which every sample will be written; returns the nearness of all samples if the block is
    /// still empty, else `None`.
    #[inline(always)]
    pub(crate) fn take_cleared(&mut self, block: usize) -> Option<f32> {
        std::mem::take(&mut self.cleared[block]).then_some(self.empty)
    }

    /// Clears untouched blocks, so that the tile can be read.
    pub(crate) fn finish(&mut self) {
        for block in 0..self.cleared.len() {
            if self.cleared[block] && self.is_counted {
                self.fill_uniform(block, NO_ID);
            }
            self.prepare_block(block);
        }
    }

    /// Nearness of all samples of a block that nothing was drawn into, whatever its memory holds; `None` for other blocks.
    #[inline(always)]
    pub(crate) fn cleared_nearness(&self, block: usize) -> Option<f32> {
        self.cleared[block].then_some(self.empty)
    }

    /// Copies the nearness of another tile, and sets all ids to [`NO_ID`].
    pub(crate) fn copy_depths(&mut self, other: &Self) {
        self.copy(other);
        self.id.fill(NO_ID);
    }

    /// Copies another tile.
    pub(crate) fn copy(&mut self, other: &Self) {
        let Self { x0, y0, blocks_x, blocks_y, planes, .. } = *other;
        (self.x0, self.y0, self.blocks_x, self.blocks_y, self.planes) = (x0, y0, blocks_x, blocks_y, planes);
        self.offsets = other.offsets;
        let samples = 0..other.samples(blocks_x * blocks_y, 0);
        self.nearness.clear();
        self.nearness.extend_from_slice(&other.nearness[samples.clone()]);
        self.id.clear();
        self.id.extend_from_slice(&other.id[samples]);
        self.farthest.clone_from(&other.farthest);
        self.dirty.clone_from(&other.dirty);
        self.cleared.clone_from(&other.cleared);
        self.items.clone_from(&other.items);
        self.uniform.clone_from(&other.uniform);
        (self.empty, self.only_row, self.is_counted) = (other.empty, other.only_row, other.is_counted);
    }

    /// Allocated heap memory \[bytes\].
    pub(crate) fn bytes(&self) -> usize {
        4 * (self.nearness.capacity() + self.id.capacity() + self.farthest.capacity())
            + self.dirty.capacity()
            + self.cleared.capacity()
            + self.items.capacity()
            + self.uniform.capacity()
    }

    /// Index of the block with the pixel (8 bx, 8 by) of the image.
    #[inline(always)]
    pub(crate) fn block(&self, bx: usize, by: usize) -> usize {
        (by - self.y0 / BLOCK) * self.blocks_x + bx - self.x0 / BLOCK
    }

    /// Index of the first sample of a block and plane.
    #[inline(always)]
    pub(crate) fn samples(&self, block: usize, plane: usize) -> usize {
        (block * self.planes + plane) * BLOCK_AREA
    }

    /// The part of a rectangle of blocks that is in this tile: x0, y0, x1, y1, the last included. `None` if they do not
    /// overlap.
    #[inline(always)]
    pub(crate) fn overlap(&self, rect: [u16; 4]) -> Option<[usize; 4]> {
        let [x, y] = [self.x0 / BLOCK, self.y0 / BLOCK];
        let r = rect.map(usize::from);
        let out = [r[0].max(x), r[1].max(y), r[2].min(x + self.blocks_x - 1), r[3].min(y + self.blocks_y - 1)];
        (out[0] <= out[2] && out[1] <= out[3]).then_some(out)
    }

    #[inline(always)]
    pub(crate) fn mark_dirty(&mut self, block: usize) {
        self.dirty[block] = true;
    }

    /// True if a surface of this nearness is hidden in the whole block.
    #[inline(always)]
    pub(crate) fn is_occluded(&mut self, block: usize, nearness: f32) -> bool {
        if nearness <= self.farthest[block] {
            return true;
        }
        if self.dirty[block] {
            let first = self.samples(block, 0);
            let mut lanes = [f32::MAX; 16];
            for row in self.nearness[first..first + self.planes * BLOCK_AREA].chunks_exact(16) {
                for (lane, &x) in lanes.iter_mut().zip(row) {
                    *lane = if x < *lane { x } else { *lane };
                }
            }
            self.farthest[block] = lanes.iter().copied().fold(f32::MAX, f32::min);
            self.dirty[block] = false;
        }
        nearness <= self.farthest[block]
    }
}
