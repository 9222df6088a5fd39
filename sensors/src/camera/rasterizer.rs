//! Draws frames.

use super::channel::{Frame, FrameMut, PixelGroup, Stage};
use crate::lanes::{COLUMN, LANES, Level, ROW, Simd, at_level, load, store};
use crate::resolve::group::{Colors, Context, resolve};
use crate::resolve::multisample::{blend, smooth};
use crate::resolve::shade::{Lighting, MAX_LIGHTS};
use crate::resolve::shadow::ShadowMap;
use crate::resolve::tone::encode;
use crate::visibility::raster::tile::{BLOCK, SAMPLES, Tile};
use crate::visibility::raster::{DrawList, Layer, Painter};
use crate::visibility::{Projection, RenderError, View};
use scene::{Light, PoseF32, RenderScene};

/// Samples in a band of the picture, at most about: it stays in a core's own cache (8 bytes each).
const BAND: usize = 128 * 1024;
/// Lamps with a shadow, at most.
const MAX_SHADOWS: usize = 4;

/// How frames are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RasterCfg {
    /// Samples per pixel for the colour: 1 or 4. All other channels see the pixel's centre.
    pub samples: u8,
    /// Whether lamps cast shadows (directional lamps and spots, the first four of them).
    pub shadows: bool,
    /// Texels along the side of a shadow map; 0 chooses by the picture's size.
    pub shadow_size: usize,
    /// Geom groups that are drawn: bit k is group k.
    pub groups: u32,
}

impl Default for RasterCfg {
    fn default() -> Self {
        Self { samples: 4, shadows: true, shadow_size: 0, groups: u32::MAX }
    }
}

/// Everything in a picture.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// What can be seen.
    pub scene: &'a RenderScene,
    /// Where each instance is: world from instance.
    pub poses: &'a [PoseF32],
    /// The camera.
    pub view: &'a View,
    /// Lamps instead of the scene's, for those that move.
    pub lights: Option<&'a [Light]>,
}

/// Draws frames, one at a time; keeps its scratch memory. Use one per thread.
///
/// The same shot gives the same bits on every thread and with every instruction set.
///
/// Transparency: things with 0 < alpha < 1 are blended into the colour, back to front by the depth of their origins, each
/// with its nearest surface only; they are not seen by things behind them twice. All other channels see the nearest
/// surface with alpha of at least 0.5. Opacity of textures is not used.
#[derive(Clone, Debug)]
pub struct Rasterizer {
    /// How frames are drawn.
    pub cfg: RasterCfg,
    level: Level,
    tile: Tile,
    layer: Tile,
    veiled: Tile,
    list: DrawList,
    shadow_list: DrawList,
    painter: Painter,
    lighting: Lighting,
    shadows: Vec<ShadowMap>,
    colors: Vec<Colors>,
}

impl Default for Rasterizer {
    fn default() -> Self {
        Self::new(RasterCfg::default())
    }
}

impl Rasterizer {
    /// A rasterizer for this machine.
    pub fn new(cfg: RasterCfg) -> Self {
        Self::with_level(cfg, Level::best())
    }

    pub(crate) fn with_level(cfg: RasterCfg, level: Level) -> Self {
        Self {
            cfg,
            level,
            tile: Tile::default(),
            layer: Tile::default(),
            veiled: Tile::default(),
            list: DrawList::default(),
            shadow_list: DrawList::default(),
            painter: Painter::default(),
            lighting: Lighting::default(),
            shadows: Vec::new(),
            colors: Vec::new(),
        }
    }

    /// The instruction set in use.
    pub fn simd_level(&self) -> String {
        format!("{:?}", self.level)
    }

    /// Scratch memory held \[bytes\].
    pub fn scratch_bytes(&self) -> usize {
        self.tile.bytes()
            + self.layer.bytes()
            + self.veiled.bytes()
            + self.list.bytes()
            + self.shadow_list.bytes()
            + size_of::<Painter>()
            + self.shadows.iter().map(ShadowMap::bytes).sum::<usize>()
            + self.colors.capacity() * size_of::<Colors>()
    }

    /// Draws the channels that `frame` has.
    ///
    /// # Errors
    ///
    /// A view, a pose or a buffer that is no good; nothing is drawn then.
    pub fn render(
        &mut self,
        scene: &RenderScene,
        poses: &[PoseF32],
        view: &View,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        self.render_shot(&Shot { scene, poses, view, lights: None }, &mut frame.as_mut())
    }

    /// Draws the channels that `frame` has, into borrowed memory.
    ///
    /// # Errors
    ///
    /// A view, a pose or a buffer that is no good; nothing is drawn then.
    pub fn render_shot(&mut self, shot: &Shot<'_>, frame: &mut FrameMut<'_>) -> Result<(), RenderError> {
        let Shot { scene, poses, view, lights } = *shot;
        view.validate()?;
        if !matches!(self.cfg.samples, 1 | 4) {
            return Err(RenderError::Samples { samples: self.cfg.samples });
        }
        if poses.len() != scene.instances().len() {
            return Err(RenderError::PoseCount { expected: scene.instances().len(), found: poses.len() });
        }
        if let Some((instance, pose)) = poses.iter().enumerate().find(|(_, p)| !p.is_rigid()) {
            return Err(RenderError::InstancePose { instance, pose: *pose });
        }
        frame.validate(view.width * view.height)?;
        let projection = Projection::from(view);
        let wants_color = frame.wants(Stage::Color);
        if wants_color {
            self.light(scene, poses, lights.unwrap_or(&scene.lights), view);
        }
        let groups = self.cfg.groups;
        self.list.build(&projection, scene, poses, |instance| Layer::of(instance, groups));
        let planes = if wants_color && self.cfg.samples == 4 { SAMPLES.len() } else { 1 };
        let blocks = [view.width.div_ceil(BLOCK), view.height.div_ceil(BLOCK)];
        let rows = (BAND / (planes * blocks[0] * BLOCK * BLOCK)).clamp(1, blocks[1]);
        let level = self.level;
        for first in (0..blocks[1]).step_by(rows) {
            let size = [blocks[0], rows.min(blocks[1] - first)];
            self.tile.clear([0, first * BLOCK], size, planes, projection.farthest());
            self.colors.clear();
            if wants_color {
                self.colors.resize(size[0] * size[1] * 4, [[0.0; LANES]; 3]);
            }
            at_level!(level, s => self.band(s, shot, &projection, frame));
        }
        Ok(())
    }

    /// Prepares lamps and their shadows.
    fn light(&mut self, scene: &RenderScene, poses: &[PoseF32], lights: &[Light], view: &View) {
        let mut maps = [None; 256];
        let mut used = 0;
        if self.cfg.shadows {
            let side = match self.cfg.shadow_size {
                0 => (3 * view.width.max(view.height) / 2).next_power_of_two().clamp(256, 1024),
                n => n.clamp(64, 8192).next_multiple_of(BLOCK),
            };
            let lamps = lights.iter().enumerate().filter(|(_, l)| l.active).take(MAX_LIGHTS);
            for (k, light) in lamps.filter(|(k, l)| l.cast_shadow && *k < 256) {
                if used == MAX_SHADOWS {
                    break;
                }
                if self.shadows.len() == used {
                    self.shadows.push(ShadowMap::empty());
                }
                let map = &mut self.shadows[used];
                let (list, painter) = (&mut self.shadow_list, &mut self.painter);
                if map.draw(self.level, light, scene, poses, self.cfg.groups, side, list, painter) {
                    maps[k] = Some(used);
                    used += 1;
                }
            }
        }
        self.lighting.prepare(scene, lights, |k| maps.get(k).copied().flatten());
    }

    /// Draws a band of the picture.
    #[inline(always)]
    fn band<S: Simd>(&mut self, s: S, shot: &Shot<'_>, projection: &Projection, frame: &mut FrameMut<'_>) {
        let Self { tile, layer, veiled, list, painter, lighting, shadows, colors, .. } = self;
        for item in &list.opaque {
            painter.draw(s, tile, projection, shot.scene, &list.placed, item);
        }
        let context = Context {
            projection,
            scene: shot.scene,
            poses: shot.poses,
            placed: &list.placed,
            lighting,
            shadows,
            pixel: 1.0 / projection.fx.min(projection.fy),
        };
        let veils = list.blended.iter().any(|(layer, _)| *layer == Layer::Veil);
        if veils {
            veiled.copy(tile);
            for (_, item) in list.blended.iter().filter(|(layer, _)| *layer == Layer::Veil) {
                painter.draw(s, veiled, projection, shot.scene, &list.placed, item);
            }
        }
        let size = [projection.width, projection.height];
        let wants_color = frame.wants(Stage::Color);
        let wants_geometry = frame.wants(Stage::Geometry);
        let mut pixels = PixelGroup::default();
        let for_groups = |visit: &mut dyn FnMut(usize, usize, [usize; 2])| {
            each_group(tile.x0, tile.y0, tile.blocks_x, tile.blocks_y, size, visit);
        };
        let group = |tile: &Tile, block: usize, row: usize, [x, y]: [usize; 2]| {
            let at = tile.samples(block, 0) + row * LANES;
            let ids: [u32; LANES] = std::array::from_fn(|k| tile.id[at + k]);
            (ids, COLUMN.map(|c| c + (x as f32 + 0.5)), ROW.map(|r| r + (y as f32 + 0.5)))
        };
        for_groups(&mut |block, row, at| {
            let (ids, u, v) = group(tile, block, row, at);
            let color = if wants_color { Some(&mut colors[block * 4 + row]) } else { None };
            if veils && wants_geometry {
                let (seen, u, v) = group(veiled, block, row, at);
                resolve(s, &context, &seen, [&u, &v], Some(&mut pixels), None);
                resolve(s, &context, &ids, [&u, &v], None, color);
            } else {
                resolve(s, &context, &ids, [&u, &v], wants_geometry.then_some(&mut pixels), color);
            }
            frame.write(Stage::Geometry, &pixels, at, size);
        });
        if !wants_color {
            return;
        }
        if tile.planes > 1 {
            for_groups(&mut |block, row, [x, y]| {
                let corner = [x as f32, (y - 2 * row) as f32];
                s.vectorize(
                    #[inline(always)]
                    || smooth(s, &context, tile, block, row, corner, &mut colors[block * 4 + row]),
                );
            });
        }
        for items in list.blended.chunk_by(|(_, a), (_, b)| a.instance == b.instance) {
            layer.behind(tile);
            for (_, item) in items {
                painter.draw(s, layer, projection, shot.scene, &list.placed, item);
            }
            let Some((_, item)) = items.first() else { continue };
            let alpha = shot.scene.instances()[item.instance as usize].material.rgba[3];
            for_groups(&mut |block, row, [x, y]| {
                let corner = [x as f32, (y - 2 * row) as f32];
                s.vectorize(
                    #[inline(always)]
                    || blend(s, &context, layer, block, row, corner, alpha, &mut colors[block * 4 + row]),
                );
            });
        }
        for_groups(&mut |block, row, at| {
            s.vectorize(
                #[inline(always)]
                || {
                    let mut bytes = [[0.0f32; LANES]; 3];
                    for (to, from) in bytes.iter_mut().zip(&colors[block * 4 + row]) {
                        store(encode(s, load(s, from)), to);
                    }
                    for (lane, to) in pixels.color.iter_mut().enumerate() {
                        *to = [bytes[0][lane] as u8, bytes[1][lane] as u8, bytes[2][lane] as u8, 255];
                    }
                    frame.write(Stage::Color, &pixels, at, size);
                },
            );
        });
    }
}

/// Visits groups of 8 x 2 pixels that are inside of the picture: block, pair of rows, first pixel.
#[inline(always)]
fn each_group(
    x0: usize,
    y0: usize,
    blocks_x: usize,
    blocks_y: usize,
    [width, height]: [usize; 2],
    visit: &mut dyn FnMut(usize, usize, [usize; 2]),
) {
    for by in 0..blocks_y {
        for bx in 0..blocks_x {
            for row in 0..BLOCK / 2 {
                let (x, y) = (x0 + bx * BLOCK, y0 + by * BLOCK + 2 * row);
                if x < width && y < height {
                    visit(by * blocks_x + bx, row, [x, y]);
                }
            }
        }
    }
}
