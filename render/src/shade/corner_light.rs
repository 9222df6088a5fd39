//! Light of surfaces in MuJoCo's OpenGL renderer, which computes it at the corners of polygons, clamps it there in each
//! pass, and interpolates; only shadows are found at every point.
//!
//! Large polygons cover many pixels, so light at their corners is kept for later pixels of the image. It is a function of
//! the polygon alone: colors do not depend on the pixels that were shaded before.

use super::light::{Highlight, ShadeContext, ViewRays, power, whole};
use super::polygon_cells::CornerLanes;
use super::surface::{InstanceSurface, Surface};
use crate::simd::{LANES, M, Simd, V3, load, load_u, max, min, select, splat, splat_u, store};
use kinetoscope_scene::OpenGlRules;
use kinetoscope_scene::shape::RenderMesh;
use std::cell::RefCell;

/// Number of polygons whose light is kept.
const SLOTS: usize = 256;
/// Largest number of polygons in sixteen pixels that are looked up. More of them are lit at once, which is faster.
const MAX_DISTINCT: usize = 6;
/// Key of an empty slot.
const NO_KEY: u64 = u64::MAX;

/// Light at the three corners of a polygon.
type CornerColors = [[f32; 3]; 3];

/// Light at the corners of polygons of one image, in each drawing pass: the sum of ambient light and of lights without
/// shadows, then each light with shadows.
#[derive(Clone, Debug, Default)]
pub(crate) struct LitPolygons {
    /// Instance and number of the polygon in each slot.
    keys: Vec<u64>,
    /// Light of each slot, pass by pass.
    lights: Vec<CornerColors>,
    /// Largest number of passes of an instance.
    passes: usize,
    /// Light at the corners of sixteen polygons, pass by pass.
    lanes: Vec<[[[f32; LANES]; 3]; 3]>,
    /// Position from which highlights are seen.
    eye: [f32; 3],
}

impl LitPolygons {
    /// Empties the table for an image seen from `eye`, in the light of up to `passes` passes.
    pub(crate) fn clear(&mut self, eye: [f32; 3], passes: usize) {
        self.keys.clear();
        self.keys.resize(SLOTS, NO_KEY);
        self.lights.resize(SLOTS * passes, [[0.0; 3]; 3]);
        self.lanes.resize(passes, [[[0.0; LANES]; 3]; 3]);
        (self.passes, self.eye) = (passes, eye);
    }

    pub(crate) fn bytes(&self) -> usize {
        self.keys.capacity() * size_of::<u64>()
            + self.lights.capacity() * size_of::<CornerColors>()
            + self.lanes.capacity() * size_of::<[[[f32; LANES]; 3]; 3]>()
    }

    /// Slot of a polygon: neighbors have different ones.
    #[inline(always)]
    fn slot(instance: u32, number: u32) -> usize {
        let mixed = number ^ number >> 8 ^ number >> 24 << 7 ^ instance.wrapping_mul(37);
        mixed as usize % SLOTS
    }
}

/// The different polygons of sixteen points.
#[derive(Clone, Copy)]
struct DistinctPolygons<S: Simd> {
    count: usize,
    /// Points of each polygon.
    points: [M<S>; MAX_DISTINCT],
    numbers: [u32; MAX_DISTINCT],
    slots: [usize; MAX_DISTINCT],
}

impl<S: Simd> DistinctPolygons<S> {
    /// `None` for too many polygons, and for polygons that have the same slot.
    #[inline(always)]
    fn of(s: S, instance: u32, numbers: &[u32; LANES], lanes: M<S>) -> Option<Self> {
        let list = load_u(s, numbers);
        let mut found =
            Self { count: 0, points: [lanes; MAX_DISTINCT], numbers: [0; MAX_DISTINCT], slots: [0; MAX_DISTINCT] };
        let mut left = lanes.to_bitmask();
        while left != 0 {
            let k = found.count;
            if k == MAX_DISTINCT {
                return None;
            }
            let number = numbers[left.trailing_zeros() as usize % LANES];
            let slot = LitPolygons::slot(instance, number);
            if found.slots[..k].contains(&slot) {
                return None;
            }
            let here = list.simd_eq(splat_u(s, number));
            (found.points[k], found.numbers[k], found.slots[k]) = (here, number, slot);
            left &= !here.to_bitmask();
            found.count += 1;
        }
        Some(found)
    }
}

/// An instance with polygons.
#[derive(Clone, Copy)]
pub(crate) struct PolygonSource<'a> {
    pub(crate) index: u32,
    pub(crate) source: &'a InstanceSurface<'a>,
    /// Mesh that is rendered; `None` for a shape with a closed form.
    pub(crate) mesh: Option<&'a RenderMesh>,
}

/// Light of a surface, without textures, 0..=1 and more if passes add up. `triangles` has the index of the triangle of the
/// mesh in each lane. With `is_seen_by_camera`, the rays come from the camera, else from anywhere.
#[inline(never)]
#[expect(clippy::too_many_arguments, reason = "as many as its callers have")]
pub(crate) fn light_at_corners<S: Simd>(
    s: S,
    context: &ShadeContext<'_>,
    table: &RefCell<&mut LitPolygons>,
    polygons: PolygonSource<'_>,
    triangles: &[u32; LANES],
    at: &Surface<S>,
    rays: ViewRays<S>,
    is_seen_by_camera: bool,
    tint: f32,
    lanes: M<S>,
) -> V3<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let mut table = table.borrow_mut();
            let LitPolygons { keys, lights, passes, lanes: lit, eye } = &mut **table;
            let PolygonSource { index, source, mesh } = polygons;
            let ShadeContext { lighting, shadows, shadow_rays, receives_shadows, .. } = *context;
            let receives_shadows = receives_shadows && source.instance.material.rgba[3] >= 1.0;
            let found = lighting.polygons.polygons(s, source, mesh, triangles, at, lanes.to_bitmask());
            let distinct = if is_seen_by_camera { DistinctPolygons::of(s, index, &found.numbers, lanes) } else { None };
            let key = |number: u32| u64::from(index) << 32 | u64::from(number);
            let light = PassLight { source, tint, receives_shadows };
            let one = splat(s, 1.0);
            if let Some(distinct) = &distinct {
                let mut missing = [0usize; MAX_DISTINCT];
                let mut count = 0;
                for k in 0..distinct.count {
                    missing[count] = k;
                    count += usize::from(keys[distinct.slots[k]] != key(distinct.numbers[k]));
                }
                if count > 0 {
                    let mut numbers = [distinct.numbers[missing[0]]; LANES];
                    for (number, &k) in numbers.iter_mut().zip(&missing[..count]) {
                        *number = distinct.numbers[k];
                    }
                    let corners = lighting.polygons.corners(s, source, mesh, &numbers);
                    light.shine(s, context, &corners, V3::splat(s, *eye), one.simd_eq(one), lit);
                    for (lane, &k) in missing[..count].iter().enumerate() {
                        let slot = distinct.slots[k];
                        keys[slot] = key(distinct.numbers[k]);
                        for (to, from) in lights[slot * *passes..].iter_mut().zip(&*lit) {
                            *to = from.map(|corner| corner.map(|channel| channel[lane]));
                        }
                    }
                }
            } else {
                let corners = lighting.polygons.corners(s, source, mesh, &found.numbers);
                // Mirrored rays come from a mirrored eye.
                let eye = match context.eye {
                    _ if is_seen_by_camera => V3::splat(s, *eye),
                    Some(eye) => V3::splat(s, eye),
                    None => at.position.sub(rays.direction.scale(rays.distance)),
                };
                light.shine(s, context, &corners, eye, lanes, lit);
            }
            // Adds the light of a pass.
            let add = {
                #[inline(always)]
                |pass: usize, to: V3<S>| match &distinct {
                    None => {
                        let [a, b, c] = &lit[pass];
                        let color = {
                            #[inline(always)]
                            |c: &[[f32; LANES]; 3]| V3 { x: load(s, &c[0]), y: load(s, &c[1]), z: load(s, &c[2]) }
                        };
                        let [k, l, m] = found.shares;
                        to.add(color(a).scale(k)).add(color(b).scale(l)).add(color(c).scale(m))
                    }
                    Some(distinct) => {
                        let mut sum = to;
                        for k in 0..distinct.count {
                            let [a, b, c] = lights[distinct.slots[k] * *passes + pass];
                            let [l, m, n] = found.shares;
                            let here = to.add(V3::splat(s, a).scale(l)).add(V3::splat(s, b).scale(m));
                            let here = here.add(V3::splat(s, c).scale(n));
                            sum = if k == 0 { here } else { V3::select(distinct.points[k], here, sum) };
                        }
                        sum
                    }
                }
            };
            let mut total = V3::splat(s, [0.0; 3]);
            for (k, prepared) in light.own_passes(context).enumerate() {
                let mut pass = add(k + 1, V3::splat(s, [0.0; 3]));
                let matters = lanes & max(max(pass.x, pass.y), pass.z).simd_gt(splat(s, 1e-4));
                if !matters.any_true() {
                    continue;
                }
                if let Some(map) = prepared.shadow.and_then(|k| shadows.get(k)) {
                    pass =
                        pass.scale(whole(s, map.visibility(s, at.position, at.normal, source.placed.error, matters)));
                }
                if let Some(rays) = shadow_rays.filter(|rays| rays.shadows && prepared.light.cast_shadow) {
                    let toward = prepared.along.map(|x| -x);
                    pass = pass.scale(rays.visibility(s, &prepared.light, toward, at.point(), matters));
                }
                total = total.add(pass);
            }
            add(0, total)
        },
    )
}

/// Light that falls on an instance.
#[derive(Clone, Copy)]
struct PassLight<'a> {
    source: &'a InstanceSurface<'a>,
    tint: f32,
    receives_shadows: bool,
}

impl PassLight<'_> {
    /// Lights that are drawing passes of their own.
    #[inline(always)]
    fn own_passes<'a>(&self, context: &ShadeContext<'a>) -> impl Iterator<Item = &'a super::light::PreparedLight> {
        let receives_shadows = self.receives_shadows;
        context.lighting.lights.iter().filter(move |prepared| prepared.own_pass && receives_shadows)
    }

    /// Writes the light at corners, clamped in each pass, to `lit`.
    #[inline(always)]
    fn shine<S: Simd>(
        &self,
        s: S,
        context: &ShadeContext<'_>,
        corners: &CornerLanes<S>,
        eye: V3<S>,
        lanes: M<S>,
        lit: &mut [[[[f32; LANES]; 3]; 3]],
    ) {
        let ShadeContext { scene, lighting, .. } = *context;
        let material = &self.source.instance.material;
        let [r, g, b, _] = material.rgba;
        let base = [r, g, b].map(|c| c * self.tint);
        let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
        let shiny = Highlight::from_material(material, true);
        let side = splat(s, if self.source.instance.group == OpenGlRules::BACK_GROUP { -1.0 } else { 1.0 });
        let ambient = [0, 1, 2].map(|k| base[k] * (scene.ambient.ground[k] + material.emission));
        let keep = {
            #[inline(always)]
            |light: V3<S>, to: &mut [[f32; LANES]; 3]| {
                store(min(light.x, one), &mut to[0]);
                store(min(light.y, one), &mut to[1]);
                store(min(light.z, one), &mut to[2]);
            }
        };
        for (corner, (position, normal)) in corners.positions.iter().zip(corners.normals).enumerate() {
            let (position, normal) = (*position, normal.scale(side));
            // Needed by highlights only, which most materials have.
            let away = if shiny.strength == 0.0 { position } else { position.sub(eye).unit(s) };
            let mut sum = V3::splat(s, ambient);
            let mut pass = 0;
            for prepared in &lighting.lights {
                let light = &prepared.light;
                let is_own = prepared.own_pass && self.receives_shadows;
                let mut lit_here = V3::splat(s, [0.0; 3]);
                if let Some((to, strength)) = prepared.illumination(s, position, lanes) {
                    let facing = max(normal.dot(to), zero);
                    let bright = facing * strength;
                    let (d, a) = (light.diffuse, light.ambient);
                    lit_here = V3 {
                        x: bright * (base[0] * d[0]) + strength * (base[0] * a[0]),
                        y: bright * (base[1] * d[1]) + strength * (base[1] * a[1]),
                        z: bright * (base[2] * d[2]) + strength * (base[2] * a[2]),
                    };
                    if shiny.is_visible(light.specular) {
                        // The cosine between the normal and the half vector, compared before its root is taken.
                        let half = to.sub(away);
                        let (along, square) = (normal.dot(half), half.dot(half));
                        let is_bright = (along * along).simd_gt(square * (shiny.faint * shiny.faint));
                        let seen = lanes & is_bright & along.simd_gt(zero) & facing.simd_gt(zero);
                        if seen.any_true() {
                            let cosine = along / select(seen, square, one).sqrt();
                            let shine =
                                select(seen, power(s, cosine, shiny.exponent) * shiny.strength, zero) * strength;
                            lit_here = lit_here.add(V3::splat(s, light.specular).scale(shine));
                        }
                    }
                }
                if is_own {
                    pass += 1;
                    keep(lit_here, &mut lit[pass][corner]);
                } else {
                    sum = sum.add(lit_here);
                }
            }
            keep(sum, &mut lit[0][corner]);
        }
    }
}
