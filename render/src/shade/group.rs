//! Shading of sixteen samples: finds their instances, and computes each channel.

use super::corner_light::{LitPolygons, PolygonSource, light_at_corners};
use super::light::{ShadeContext, ViewRays, albedo, shade, sky};
use super::mirror::{MirrorSamples, Mirrors};
use super::motion_vectors::MotionVectors;
use super::surface::{CameraRays, InstanceSurface, LensRayLanes, surface};
use super::tone::to_srgb;
use crate::frame::PixelGroup;
use crate::lens::rays::LensRays;
use crate::raster::PlacedInstance;
use crate::raster::tile::NO_ID;
use crate::simd::{
    COLUMN, F, LANES, M, ROW, Simd, U, V3, load, load_u, max, min, select, select_i, splat, splat_i, splat_u, store,
};
use crate::visibility::Projection;
use kinetoscope_scene::PoseF32;
use std::cell::RefCell;

/// State that all pixels of a frame share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadingContext<'a> {
    pub(crate) projection: &'a Projection,
    /// Rays of a lens that bends them; `None` for a pinhole.
    pub(crate) lens: Option<&'a LensRays>,
    pub(crate) poses: &'a [PoseF32],
    pub(crate) placed: &'a [PlacedInstance],
    pub(crate) shade: ShadeContext<'a>,
    /// Mirroring surfaces, if the scene has any.
    pub(crate) mirrors: Option<Mirrors<'a>>,
    /// True if channels of [`Stage::Surface`](crate::frame::Stage::Surface) are rendered.
    pub(crate) surface: bool,
    /// True if channels of [`Stage::Albedo`](crate::frame::Stage::Albedo) are rendered.
    pub(crate) albedo: bool,
    /// Motion vectors, if channels of [`Stage::Flow`](crate::frame::Stage::Flow) are rendered.
    pub(crate) motion_vectors: Option<&'a MotionVectors>,
    /// Light at the corners of polygons, if it is computed there.
    pub(crate) lit_polygons: Option<&'a RefCell<&'a mut LitPolygons>>,
}

impl<'a> ShadingContext<'a> {
    /// Index of the instance that an id belongs to; `last` is tried first.
    #[inline(always)]
    pub(crate) fn instance(&self, id: u32, last: usize) -> usize {
        let first = self.shade.scene.first_ids();
        if id >= first[last] && id < first[last + 1] {
            return last;
        }
        first.partition_point(|&f| f <= id) - 1
    }

    #[inline(always)]
    pub(crate) fn source(&self, index: usize) -> InstanceSurface<'a> {
        InstanceSurface {
            instance: &self.shade.scene.instances()[index],
            world_from_instance: &self.poses[index],
            placed: &self.placed[index],
            first_id: self.shade.scene.first_ids()[index],
            color: self.shade.scene.linear_colors()[index],
            texture_scale: self.shade.scene.texture_scales()[index],
            texture_offset: self.shade.scene.texture_offsets()[index],
            face_images: self.shade.scene.face_images()[index],
            plane_lines: self.shade.scene.plane_lines()[index],
        }
    }
}

/// Colors of sixteen samples, in the [`BlendSpace`](crate::shade::tone::BlendSpace) of the frame.
pub(crate) type Colors = [[f32; LANES]; 3];

/// Positions of sixteen samples in the image.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SamplePositions<'a> {
    /// Centers of 8 x 2 pixels, the first of which is given.
    Pixels([usize; 2]),
    /// Points given by u and v \[pixels\].
    Points([&'a [f32; LANES]; 2]),
}

impl SamplePositions<'_> {
    #[inline(always)]
    fn uv<S: Simd>(self, s: S) -> [F<S>; 2] {
        match self {
            // Computed instead of loaded: a load would wait for numbers that were just written one by one.
            Self::Pixels([x, y]) => [load(s, &COLUMN) + (x as f32 + 0.5), load(s, &ROW) + (y as f32 + 0.5)],
            Self::Points([u, v]) => [load(s, u), load(s, v)],
        }
    }
}

/// Shades sixteen samples: geometry into `pixels`, color into `colors`, each only if given.
///
/// One copy per instruction set, so its arguments are in memory.
#[inline(never)]
pub(crate) fn resolve<S: Simd>(
    s: S,
    context: &ShadingContext<'_>,
    ids: &[u32; LANES],
    at: SamplePositions<'_>,
    pixels: Option<&mut PixelGroup>,
    colors: Option<&mut Colors>,
) {
    s.vectorize(
        #[inline(always)]
        || {
            let uv = at.uv(s);
            let lens_directions = context.lens.map(|lens| match at {
                SamplePositions::Pixels(first) => lens.at_pixels(s, first),
                SamplePositions::Points(_) => lens.at_points(s, uv[0], uv[1]),
            });
            resolve_lanes(s, context, load_u(s, ids), uv, lens_directions, pixels, colors);
        },
    );
}

#[inline(always)]
fn resolve_lanes<S: Simd>(
    s: S,
    context: &ShadingContext<'_>,
    ids: U<S>,
    uv @ [u, v]: [F<S>; 2],
    bent: Option<V3<S>>,
    mut pixels: Option<&mut PixelGroup>,
    mut colors: Option<&mut Colors>,
) {
    let projection = context.projection;
    let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
    let (origin, direction) = match bent {
        None => projection.world_rays(s, u, v),
        Some(ray) => (V3::splat(s, [0.0; 3]), ray.rotate(&projection.world_from_camera.rotation)),
    };
    let mut length = direction.dot(direction).sqrt();
    if bent.is_some() {
        // Some pixels have no ray.
        length = select(length.simd_gt(zero), length, one);
    }
    // Positions along forward rays are depths, along all others distances.
    let forward = context.lens.is_none_or(LensRays::is_forward);
    let ray = bent.map(|ray| LensRayLanes { direction: ray, forward });
    let rays = CameraRays { uv, lens_rays: ray, origin, direction };
    let view = if colors.is_some() || context.albedo { direction.scale(1.0 / length) } else { direction };
    let nothing = splat_u(s, NO_ID);
    let missed = ids.simd_eq(nothing);
    let mut along = splat(s, f32::INFINITY);
    let none = V3::splat(s, [0.0; 3]);
    let (mut normal, mut shading, mut position) = (none, none, none);
    let mut color = none;
    let mut mask = splat_i(s, 0);
    if colors.is_some() && missed.any_true() {
        let toward = if projection.parallel {
            // The sky of MuJoCo's renderer is at this fraction of the far plane.
            direction.scale(splat(s, 0.7 * projection.far)).add(origin).unit(s)
        } else {
            view
        };
        color = sky(s, context.shade.lighting, toward, context.shade.pixel.angle());
        if let Some(horizon) = &context.shade.lighting.ground_haze {
            color = horizon.over_sky(s, view, color);
        }
    }
    // Optional channels are kept in memory; registers are for the common channels.
    if let Some(pixels) = pixels.as_mut().filter(|_| context.albedo) {
        pixels.albedo = [[0; 4]; LANES];
    }
    if let Some(pixels) = pixels.as_mut().filter(|_| context.motion_vectors.is_some()) {
        pixels.flow = [[f32::INFINITY; LANES]; 2];
    }
    let list: [u32; LANES] = ids.array();
    let mut left = (!missed).to_bitmask();
    let mut last = 0;
    while left != 0 {
        let lane = left.trailing_zeros() as usize;
        last = context.instance(list[lane], last);
        let source = context.source(last);
        let end = context.shade.scene.first_ids()[last + 1];
        let here: M<S> = ids.simd_ge(splat_u(s, source.first_id)) & ids.simd_lt(splat_u(s, end));
        let bits = here.to_bitmask();
        left &= !bits;
        let at = surface(s, projection, &source, ids, here, rays);
        if pixels.is_some() {
            along = select(here, at.t, along);
            normal = V3::select(here, at.normal, normal);
            mask = select_i(here, splat_i(s, source.instance.mask_id), mask);
            if context.surface {
                shading = V3::select(here, at.shading_normal, shading);
                position = V3::select(here, at.position, position);
            }
        }
        if let (Some(pixels), Some(moves)) = (&mut pixels, context.motion_vectors) {
            let [right, down] = moves.flow_at(s, last, at.local_position, uv, here);
            store(select(here, right, load(s, &pixels.flow[0])), &mut pixels.flow[0]);
            store(select(here, down, load(s, &pixels.flow[1])), &mut pixels.flow[1]);
        }
        if let Some(pixels) = pixels.as_mut().filter(|_| context.albedo) {
            let base = albedo(s, &source, &at, view, context.shade.pixel, here);
            store_bytes(s, base, here, &mut pixels.albedo);
        }
        if colors.is_some() {
            let ShadeContext { lighting, pixel, .. } = context.shade;
            let rays = ViewRays { direction: view, distance: at.t * length };
            let corner_light = context.lit_polygons.map(|table| {
                let triangles = list.map(|id| id.wrapping_sub(source.first_id));
                let mesh = source.placed.mesh(source.instance);
                let polygons = PolygonSource { index: last as u32, source: &source, mesh };
                light_at_corners(s, &context.shade, table, polygons, &triangles, &at, rays, true, 1.0, here)
            });
            let mut seen = shade(s, &context.shade, &source, &at, corner_light, rays, 1.0, here);
            if let Some(mirrors) = context.mirrors.filter(|mirrors| mirrors.has(last, source.instance)) {
                let samples = MirrorSamples { point: at.point(), view, length, color: seen };
                seen = mirrors.reflect(s, context, &source, samples, here);
            }
            if let Some(horizon) = lighting.ground_haze.as_ref().filter(|horizon| horizon.ground == last) {
                seen = horizon.over_ground(s, view, seen, || sky(s, lighting, view, pixel.angle()));
            }
            color = V3::select(here, seen, color);
        }
    }
    if let Some(pixels) = &mut pixels {
        let depth = bent.map_or(along, |ray| select(missed, along, along * ray.z));
        store(depth, &mut pixels.depth);
        pixels.mask = mask.array();
        store_v3(normal, &mut pixels.normal);
        if context.surface {
            store(along * length, &mut pixels.distance);
            store_v3(shading, &mut pixels.shading_normal);
            store_v3(V3::select(missed, none, position), &mut pixels.position);
        }
    }
    if let Some(colors) = &mut colors {
        if let Some(ray) = bent {
            // No light falls outside of the image circle.
            color = V3::select(ray.dot(ray).simd_gt(zero), color, none);
        }
        store_v3(color, colors);
    }
}

/// Stores linear colors of some lanes as sRGB bytes, opaque.
#[inline(always)]
fn store_bytes<S: Simd>(s: S, color: V3<S>, lanes: M<S>, to: &mut [[u8; 4]; LANES]) {
    let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
    // Written out: a closure that is called three times is compiled without the instruction set.
    let r = to_srgb(s, min(max(color.x, zero), one)).to_int();
    let g = to_srgb(s, min(max(color.y, zero), one)).to_int() * (1 << 8);
    let b = to_srgb(s, min(max(color.z, zero), one)).to_int() * (1 << 16);
    let rgba = r | g | b | splat_i(s, i32::MIN >> 7);
    let rgba: [i32; LANES] = rgba.array();
    let bits = lanes.to_bitmask();
    for (lane, (to, from)) in to.iter_mut().zip(rgba).enumerate() {
        if bits >> lane & 1 == 1 {
            *to = from.to_le_bytes();
        }
    }
}

#[inline(always)]
fn store_v3<S: Simd>(v: V3<S>, to: &mut [[f32; LANES]; 3]) {
    store(v.x, &mut to[0]);
    store(v.y, &mut to[1]);
    store(v.z, &mut to[2]);
}
