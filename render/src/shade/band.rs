//! Rendering of a band of an image: from the draw list to the pixels of all channels.

use super::corner_light::LitPolygons;
use super::group::{Colors, SamplePositions, resolve};
use super::multisample::{EdgeSamples, blend};
use super::prepared_frame::PreparedFrame;
use super::shadow::ShadowBand;
use crate::frame::{FrameMut, PixelGroup, Stage};
use crate::geometry::bvh::TraversalStack;
use crate::raster::tile::{BLOCK, OPENGL_SAMPLES, SAMPLES, Tile};
use crate::raster::{DrawItem, VisibilityRasterizer};
use crate::request::RenderRequest;
use crate::simd::{LANES, Simd, SimdLevel, as_lanes, at_level, load, splat_i};
use crate::trace::{CameraView, Candidates};
use crate::visibility::Projection;
use kinetoscope_scene::RenderScene;
use std::cell::RefCell;
use std::ops::Range;

/// Scratch memory of a thread for rendering.
#[derive(Clone, Debug)]
pub(crate) struct RasterScratch {
    pub(crate) level: SimdLevel,
    tile: Tile,
    layer: Tile,
    blended_tile: Tile,
    rasterizer: VisibilityRasterizer,
    /// Stack for visibility rays; `shade_stack` is for rays cast during shading.
    stack: TraversalStack,
    shade_stack: TraversalStack,
    candidates: Candidates,
    colors: Vec<Colors>,
    edges: EdgeSamples,
    lit_polygons: LitPolygons,
}

impl RasterScratch {
    pub(crate) fn new(level: SimdLevel) -> Self {
        Self {
            level,
            tile: Tile::default(),
            layer: Tile::default(),
            blended_tile: Tile::default(),
            rasterizer: VisibilityRasterizer::default(),
            stack: TraversalStack::default(),
            shade_stack: TraversalStack::default(),
            candidates: Candidates::default(),
            colors: Vec::new(),
            edges: EdgeSamples::default(),
            lit_polygons: LitPolygons::default(),
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.tile.bytes()
            + self.layer.bytes()
            + self.blended_tile.bytes()
            + size_of::<VisibilityRasterizer>()
            + self.colors.capacity() * size_of::<Colors>()
            + self.edges.bytes()
            + self.lit_polygons.bytes()
            + self.stack.bytes()
            + self.shade_stack.bytes()
            + self.candidates.bytes()
    }

    /// BVH stack, as scratch memory.
    pub(crate) fn stack(&mut self) -> &mut TraversalStack {
        &mut self.stack
    }

    /// Renders a band of a shadow map into the memory of `band`.
    pub(crate) fn render_shadow_band(&mut self, scene: &RenderScene, band: ShadowBand<'_>) {
        band.draw(self.level, scene, &mut self.tile, &mut self.rasterizer);
    }

    /// Renders rows of blocks of a prepared frame, a band at a time. `frame` begins with the first of these rows.
    pub(crate) fn render_band(
        &mut self,
        plan: &PreparedFrame,
        render_request: &RenderRequest<'_>,
        frame: &mut FrameMut<'_>,
        rows: Range<usize>,
    ) {
        let Some(projection) = &plan.projection else { return };
        let wide = projection.width.div_ceil(BLOCK);
        let (level, step, top) = (self.level, plan.band_rows(), rows.start * BLOCK);
        // Shadow maps may be rendered later: memory is reserved once.
        self.tile.reserve(plan.max_shadow_band_samples());
        self.tile.only_row = plan.only_row;
        plan.clear_lit_polygons(&mut self.lit_polygons);
        for first in rows.clone().step_by(step) {
            let size = [wide, step.min(rows.end - first)];
            self.tile.clear([0, first * BLOCK], size, plan.planes, projection.farthest());
            // Rays through a lens are known for the usual samples.
            let is_mirrored = render_request.scene.opengl.is_some() && render_request.lens.is_none();
            self.tile.offsets = if is_mirrored { OPENGL_SAMPLES } else { SAMPLES };
            let groups = size[0] * size[1] * (BLOCK / 2);
            if frame.wants(Stage::Color) && self.colors.len() < groups {
                self.colors.resize(groups, [[0.0; LANES]; 3]);
            }
            if frame.wants(Stage::Color) && plan.planes > 1 {
                self.edges.reserve();
            }
            at_level!(level, s => self.render_tile(s, plan, render_request, projection, frame, top));
        }
    }

    /// Renders the band of the image that the tile covers.
    #[inline(always)]
    fn render_tile<S: Simd>(
        &mut self,
        s: S,
        plan: &PreparedFrame,
        render_request: &RenderRequest<'_>,
        projection: &Projection,
        frame: &mut FrameMut<'_>,
        top: usize,
    ) {
        let Self { tile, layer, blended_tile, rasterizer, stack, shade_stack, .. } = self;
        let Self { candidates, colors, edges, lit_polygons, .. } = self;
        let list = &plan.list;
        let view = CameraView {
            projection,
            lens: render_request.lens,
            placed: &list.placed,
            first_ids: render_request.scene.first_ids(),
        };
        let mut draw = |tile: &mut Tile, item: &DrawItem| {
            if plan.traces_visibility {
                plan.tracer.draw(s, stack, tile, &view, item);
            } else {
                rasterizer.draw(s, tile, projection, render_request.scene, &list.placed, item);
            }
        };
        // Blended items are drawn over a copy of the tile, with the nearness of all samples.
        if !plan.traces_visibility && list.blended.is_empty() {
            tile.count_items(list.opaque.iter().map(|item| item.rect));
        }
        for item in &list.opaque {
            draw(tile, item);
        }
        tile.finish();
        let wanted = [Stage::Surface, Stage::Albedo, Stage::Flow].map(|stage| frame.wants(stage));
        let [wants_detail, wants_albedo, wants_flow] = wanted;
        // Shading has shared references only, so its scratch memory is in cells.
        let (shade_stack, lit_polygons) = (RefCell::new(shade_stack), RefCell::new(lit_polygons));
        let candidates = RefCell::new(candidates);
        let context = plan.context(render_request, projection, &shade_stack, &candidates, &lit_polygons, wanted);
        let veils = !list.blended.is_empty();
        if veils {
            blended_tile.copy(tile);
            for (_, item) in &list.blended {
                draw(blended_tile, item);
            }
        }
        let size = [projection.width, projection.height];
        let wants_color = frame.wants(Stage::Color);
        let wants_geometry = wanted.contains(&true) || frame.wants(Stage::Geometry);
        let mut pixels = PixelGroup::default();
        for (block, row, [x, y]) in groups(tile, size) {
            let at = tile.samples(block, 0) + row * LANES;
            let (ids, points) = (as_lanes(&tile.id[at..]), SamplePositions::Pixels([x, y]));
            let color = if wants_color { Some(&mut colors[block * 4 + row]) } else { None };
            if veils && wants_geometry {
                resolve(s, &context, as_lanes(&blended_tile.id[at..]), points, Some(&mut pixels), None);
                resolve(s, &context, ids, points, None, color);
            } else {
                resolve(s, &context, ids, points, wants_geometry.then_some(&mut pixels), color);
            }
            // Outside of `vectorize`: with the instruction set, normals become scattered writes, which are slower.
            write(frame, Stage::Geometry, &pixels, [x, y], size, top);
            if wants_detail {
                write(frame, Stage::Surface, &pixels, [x, y], size, top);
            }
            if wants_flow {
                write(frame, Stage::Flow, &pixels, [x, y], size, top);
            }
            if wants_albedo {
                write(frame, Stage::Albedo, &pixels, [x, y], size, top);
            }
        }
        if !wants_color {
            return;
        }
        if tile.planes > 1 {
            let mut line = 0;
            for (block, row, [x, y]) in groups(tile, size) {
                // One row of blocks at a time: the samples that are shaded together do not depend on the bands.
                if block / tile.blocks_x != line {
                    line = block / tile.blocks_x;
                    edges.resolve(s, &context, colors);
                }
                let corner = [x as f32, (y - 2 * row) as f32];
                s.vectorize(
                    #[inline(always)]
                    || edges.collect(s, &context, tile, [block, row], corner, colors),
                );
            }
            edges.resolve(s, &context, colors);
        }
        for items in list.blended.chunk_by(|(_, a), (_, b)| a.instance == b.instance) {
            layer.copy_depths(tile);
            for (_, item) in items {
                draw(layer, item);
            }
            let Some((_, item)) = items.first() else { continue };
            let alpha = render_request.scene.instances()[item.instance as usize].material.rgba[3];
            for (block, row, [x, y]) in groups(tile, size) {
                let corner = [x as f32, (y - 2 * row) as f32];
                s.vectorize(
                    #[inline(always)]
                    || blend(s, &context, layer, block, row, corner, alpha, &mut colors[block * 4 + row]),
                );
            }
        }
        let (curve, exposure, space) = (plan.tone, plan.exposure, context.shade.lighting.blend);
        for (block, row, at) in groups(tile, size) {
            s.vectorize(
                #[inline(always)]
                || {
                    let [r, g, b] = &colors[block * 4 + row];
                    // Written out: a closure that is called three times is compiled without the instruction set.
                    let r = space.encode(s, curve, load(s, r) * exposure).to_int();
                    let g = space.encode(s, curve, load(s, g) * exposure).to_int() * (1 << 8);
                    let b = space.encode(s, curve, load(s, b) * exposure).to_int() * (1 << 16);
                    let rgba = r | g | b | splat_i(s, i32::MIN >> 7);
                    let rgba: [i32; LANES] = rgba.array();
                    for (to, from) in pixels.color.iter_mut().zip(rgba) {
                        *to = from.to_le_bytes();
                    }
                    write(frame, Stage::Color, &pixels, at, size, top);
                },
            );
        }
    }
}

/// Groups of 8 x 2 pixels of a tile that are inside the image: block, pair of rows, first pixel. In the order of rows,
/// not of blocks: then images are written in few places at a time, which the hardware prefetcher can follow.
#[inline(always)]
fn groups(tile: &Tile, [width, height]: [usize; 2]) -> impl Iterator<Item = (usize, usize, [usize; 2])> + use<> {
    let (wide, high) = (tile.blocks_x, tile.blocks_y);
    let [x0, y0] = [tile.x0, tile.y0];
    let pairs = (0..high * (BLOCK / 2)).filter(move |pair| y0 + 2 * pair < height);
    pairs.flat_map(move |pair| {
        let (first, row) = (pair / (BLOCK / 2) * wide, pair % (BLOCK / 2));
        let inside = wide.min((width - x0).div_ceil(BLOCK));
        (0..inside).map(move |bx| (first + bx, row, [x0 + bx * BLOCK, y0 + 2 * pair]))
    })
}

/// Writes a group into a frame whose first row is row `top` of the image.
#[inline(always)]
fn write(
    frame: &mut FrameMut<'_>,
    stage: Stage,
    pixels: &PixelGroup,
    [x, y]: [usize; 2],
    [width, height]: [usize; 2],
    top: usize,
) {
    frame.write(stage, pixels, [x, y - top], [width, height - top]);
}
