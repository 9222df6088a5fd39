//! Shadow maps: what a lamp sees.

use crate::lanes::{F, Level};
use crate::lanes::{LANES, M, Simd, V3, at_level, load, select, splat};
use crate::visibility::Projection;
use crate::visibility::raster::tile::{AREA, BLOCK, Tile};
use crate::visibility::raster::{DrawList, Layer, Painter};
use scene::{Light, LightKind, PoseF32, RenderScene};

/// Depths from a lamp.
#[derive(Clone, Debug)]
pub(crate) struct ShadowMap {
    projection: Projection,
    tile: Tile,
    /// A texel's width on a surface: at any depth, or at depth 1 for a spot.
    texel: f32,
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A frame with its z axis along a direction. Source: Duff et al., Building an Orthonormal Basis, Revisited, JCGT 2017.
fn frame_along(z: [f32; 3]) -> [[f32; 3]; 3] {
    let sign = if z[2] < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + z[2]);
    let b = z[0] * z[1] * a;
    let x = [1.0 + sign * z[0] * z[0] * a, sign * b, -sign * z[0]];
    let y = [b, sign + z[1] * z[1] * a, -z[1]];
    // Columns are the axes.
    [0, 1, 2].map(|k| [x[k], y[k], z[k]])
}

impl ShadowMap {
    /// A map without memory.
    pub(crate) fn empty() -> Self {
        let projection = Projection {
            parallel: true,
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
        Self { projection, tile: Tile::default(), texel: 1.0 }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.tile.bytes()
    }

    /// Draws what the lamp sees, on `side` by `side` texels. `false` where it casts no shadow.
    #[expect(clippy::too_many_arguments, reason = "scratch memory comes from outside")]
    pub(crate) fn draw(
        &mut self,
        level: Level,
        light: &Light,
        scene: &RenderScene,
        poses: &[PoseF32],
        groups: u32,
        side: usize,
        list: &mut DrawList,
        painter: &mut Painter,
    ) -> bool {
        let casts = |k: usize| {
            let instance = &scene.instances()[k];
            let solid = matches!(Layer::of(instance, groups), Layer::Opaque | Layer::Veil);
            solid && instance.shape.aabb()[1].iter().all(|x| x.is_finite())
        };
        let along = super::shade::unit(light.direction);
        let rotation = frame_along(along);
        let Some(projection) = (match light.kind {
            LightKind::Directional => fit(scene, poses, rotation, side, casts),
            LightKind::Spot { cutoff_deg, .. } => spot(light, rotation, cutoff_deg, side),
            LightKind::Point => None,
        }) else {
            return false;
        };
        self.texel = 1.0 / projection.fx;
        self.projection = projection;
        list.build(&projection, scene, poses, |instance| {
            let finite = instance.shape.aabb()[1].iter().all(|x| x.is_finite());
            match Layer::of(instance, groups) {
                Layer::Opaque | Layer::Veil if finite => Layer::Opaque,
                _ => Layer::Hidden,
            }
        });
        self.tile.clear([0, 0], [side / BLOCK; 2], 1, projection.farthest());
        let tile = &mut self.tile;
        at_level!(level, s => {
            for item in &list.opaque {
                painter.draw(s, tile, &projection, scene, &list.placed, item);
            }
        });
        true
    }

    /// How much of the lamp's light reaches points, 0..=1: the mean over 3x3 texels, blended between them. The points are
    /// moved off the surface first, by more than a texel, so that a surface does not shadow itself.
    #[inline(always)]
    pub(crate) fn light<S: Simd>(&self, s: S, position: V3<S>, normal: V3<S>, lanes: M<S>) -> F<S> {
        let p = &self.projection;
        let camera = &p.world_from_camera;
        let inverse = [0, 1, 2].map(|j| [0, 1, 2].map(|i| camera.rotation[i][j]));
        let to_lamp = |v: V3<S>| v.sub(V3::splat(s, camera.translation)).rotate(&inverse);
        let mut c = to_lamp(position);
        let width = if p.parallel { splat(s, self.texel) } else { c.z * self.texel };
        c = c.add(normal.rotate(&inverse).scale(width * 1.8));
        let (x, y) = if p.parallel { (c.x * p.fx, c.y * p.fy) } else { (c.x * p.fx / c.z, c.y * p.fy / c.z) };
        let (x, y) = (x + (p.cx - 0.5), y + (p.cy - 0.5));
        let nearness = p.nearness_lanes(c.z - width * 0.3);
        let side = (self.tile.blocks_x * BLOCK) as f32;
        let inside = x.simd_gt(splat(s, 2.0))
            & y.simd_gt(splat(s, 2.0))
            & x.simd_lt(splat(s, side - 3.0))
            & y.simd_lt(splat(s, side - 3.0))
            & c.z.simd_gt(splat(s, p.near));
        let wanted = (inside & lanes).to_bitmask();
        if wanted == 0 {
            return splat(s, 1.0);
        }
        let (x, y, q): ([f32; LANES], [f32; LANES], [f32; LANES]) = (x.array(), y.array(), nearness.array());
        let mut lit = [1.0f32; LANES];
        for lane in (0..LANES).filter(|lane| wanted >> lane & 1 == 1) {
            lit[lane] = self.taps(x[lane], y[lane], q[lane]);
        }
        select(lanes, load(s, &lit), splat(s, 1.0))
    }

    /// Sixteen texels around a point.
    #[inline(always)]
    fn taps(&self, x: f32, y: f32, q: f32) -> f32 {
        let (ix, iy) = (x as usize, y as usize);
        let (fx, fy) = (x - ix as f32, y - iy as f32);
        let (wx, wy) = ([1.0 - fx, 1.0, 1.0, fx], [1.0 - fy, 1.0, 1.0, fy]);
        let mut sum = 0.0;
        for (row, wy) in wy.iter().enumerate() {
            let ty = iy + row - 1;
            let line = (ty / BLOCK) * self.tile.blocks_x * AREA + (ty % BLOCK) * BLOCK;
            let mut part = 0.0;
            for (column, wx) in wx.iter().enumerate() {
                let tx = ix + column - 1;
                let seen = self.tile.nearness[line + (tx / BLOCK) * AREA + tx % BLOCK];
                part += if seen > q { 0.0 } else { *wx };
            }
            sum += part * wy;
        }
        sum * (1.0 / 9.0)
    }
}

/// A parallel view along a direction that holds everything that casts a shadow.
fn fit(
    scene: &RenderScene,
    poses: &[PoseF32],
    rotation: [[f32; 3]; 3],
    side: usize,
    casts: impl Fn(usize) -> bool,
) -> Option<Projection> {
    let (mut lo, mut hi) = ([f32::MAX; 3], [f32::MIN; 3]);
    for (_, (instance, pose)) in scene.instances().iter().zip(poses).enumerate().filter(|(k, _)| casts(*k)) {
        let [a, b] = instance.shape.aabb();
        let middle = pose.apply([0, 1, 2].map(|k| 0.5 * (a[k] + b[k])));
        for k in 0..3 {
            let axis = [rotation[0][k], rotation[1][k], rotation[2][k]];
            let local = pose.rotate_inverse(axis);
            let reach: f32 = (0..3).map(|i| local[i].abs() * 0.5 * (b[i] - a[i])).sum();
            let at = dot(axis, middle);
            (lo[k], hi[k]) = (lo[k].min(at - reach), hi[k].max(at + reach));
        }
    }
    if lo[0] > hi[0] {
        return None;
    }
    // Room for the taps on each side, and in front.
    let room = 4.0;
    let extent = (hi[0] - lo[0]).max(hi[1] - lo[1]).max(1e-3);
    let scale = (side as f32 - 2.0 * room) / extent;
    let depth = (hi[2] - lo[2]).max(1e-3);
    let start = lo[2] - 0.01 * depth - 1e-3;
    let middle = [0.5 * (lo[0] + hi[0]), 0.5 * (lo[1] + hi[1]), start];
    let translation = [0, 1, 2].map(|k| dot(rotation[k], middle));
    Some(Projection {
        parallel: true,
        width: side,
        height: side,
        fx: scale,
        fy: scale,
        cx: 0.5 * side as f32,
        cy: 0.5 * side as f32,
        near: 0.0,
        // Receivers behind everything that casts are still compared.
        far: 1.1 * depth + 2e-3,
        world_from_camera: PoseF32 { rotation, translation },
    })
}

/// What a spot lights.
fn spot(light: &Light, rotation: [[f32; 3]; 3], cutoff_deg: f32, side: usize) -> Option<Projection> {
    if !light.position.iter().all(|x| x.is_finite()) || cutoff_deg.is_nan() || cutoff_deg <= 0.0 {
        return None;
    }
    // Wider cones than 75 degrees would leave no texels for the middle.
    let half = f64::from(cutoff_deg.min(75.0) + 1.0).to_radians();
    let f = ((0.5 * side as f64 - 3.0) / half.tan()) as f32;
    Some(Projection {
        parallel: false,
        width: side,
        height: side,
        fx: f,
        fy: f,
        cx: 0.5 * side as f32,
        cy: 0.5 * side as f32,
        near: 0.02,
        far: 1000.0,
        world_from_camera: PoseF32 { rotation, translation: light.position },
    })
}
