//! Shading of the rasterizer: light that a surface reflects towards the camera.

use super::horizon::Horizon;
use super::polygons::PolygonTables;
use super::shadow::ShadowMap;
use super::shadow_rays::ShadowRays;
use super::surface::{InstanceSurface, Surface};
use super::texture::{self, MipRule};
use super::tone::{self, BlendSpace};
use crate::simd::{F, M, Simd, V3, abs, max, min, select, splat, sqrt_or_zero};
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::vector::try_normalize;
use kinetoscope_scene::{Light, LightKind, LightingSpace, Material, OpenGlRules, RenderScene, Texture};
use std::sync::Arc;

/// Largest number of lights.
pub(crate) const MAX_LIGHTS: usize = 16;

/// A light prepared for a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct PreparedLight {
    pub(super) light: Light,
    /// Unit vector along which the light shines.
    pub(super) along: [f32; 3],
    cutoff_cos: f32,
    exponent: u32,
    /// Index of the light's shadow map.
    pub(super) shadow: Option<usize>,
    /// True if the light is a drawing pass of its own, as lights with shadows are in MuJoCo's renderer: its light is
    /// clamped before it is added to that of other passes.
    pub(super) own_pass: bool,
}

/// Inputs of shading besides the surface, prepared once per frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lighting {
    pub(super) lights: Vec<PreparedLight>,
    zenith: [f32; 3],
    horizon: [f32; 3],
    nadir: [f32; 3],
    skybox: Option<Arc<Texture>>,
    /// Rule of texture sampling.
    mip_rule: MipRule,
    /// Space of all colors.
    pub(crate) blend: BlendSpace,
    haze: Option<[f32; 3]>,
    /// Haze at the end of the ground, if the scene has any.
    pub(crate) ground_haze: Option<Horizon>,
    /// True if the headlight is one of the lights: in MuJoCo's light model it is directional.
    headlight_is_light: bool,
    /// Polygons at whose corners light is computed.
    pub(crate) polygons: PolygonTables,
}

/// Lighting and settings for shading surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadeContext<'a> {
    pub(crate) scene: &'a RenderScene,
    pub(crate) lighting: &'a Lighting,
    pub(crate) shadows: &'a [ShadowMap],
    /// Shadow rays, used instead of shadow maps; `None` for shadow maps.
    pub(crate) shadow_rays: Option<ShadowRays<'a>>,
    pub(crate) pixel: PixelWidth,
    /// Position from which highlights are seen, for a camera with parallel rays in MuJoCo's OpenGL renderer; `None` for
    /// the direction of the rays.
    pub(crate) eye: Option<[f32; 3]>,
    /// False for reflections in MuJoCo's OpenGL renderer.
    pub(crate) receives_shadows: bool,
    /// Axes of the image in the world, right and down, for the widths of pixels on surfaces in MuJoCo's OpenGL renderer;
    /// `None` for reflections.
    pub(crate) image_axes: Option<[[f32; 3]; 2]>,
}

/// Width of a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelWidth {
    /// Width at depth 1 (for lenses whose rays do not all go forward, at distance 1), or at any depth \[m\].
    pub(crate) width: f32,
    /// True if rays are parallel: the width is the same at any depth.
    pub(crate) parallel: bool,
}

impl PixelWidth {
    /// Width at a depth \[m\].
    #[inline(always)]
    fn at<S: Simd>(self, s: S, depth: F<S>) -> F<S> {
        if self.parallel { splat(s, self.width) } else { depth * self.width }
    }

    /// Width at depth 1, 0 if rays are parallel.
    pub(crate) fn angle(self) -> f32 {
        if self.parallel { 0.0 } else { self.width }
    }
}

/// Viewing rays of the shaded surfaces.
#[derive(Clone, Copy)]
pub(crate) struct ViewRays<S: Simd> {
    /// Unit vector away from the camera, world frame.
    pub(crate) direction: V3<S>,
    /// Distance of the surface \[m\].
    pub(crate) distance: F<S>,
}

pub(crate) fn unit(v: [f32; 3]) -> [f32; 3] {
    try_normalize(v, 0.0).unwrap_or([0., 0., -1.])
}

/// Cosine of an angle in degrees, by its series: `cos()` differs from machine to machine.
pub(crate) fn cos_deg(deg: f32) -> f32 {
    let x = f64::from(deg.clamp(0.0, 180.0)) * (std::f64::consts::PI / 180.0);
    let (mut sum, mut term) = (1.0f64, 1.0f64);
    for k in 1..16 {
        term *= -(x * x) / f64::from((2 * k - 1) * (2 * k));
        sum += term;
    }
    sum as f32
}

impl PreparedLight {
    /// Direction to the light (unit) and the fraction of its light that reaches points, without shadows; `None` if all
    /// points are outside of the cone of a spot.
    #[inline(always)]
    pub(super) fn illumination<S: Simd>(&self, s: S, position: V3<S>, lanes: M<S>) -> Option<(V3<S>, F<S>)> {
        let (light, zero, one) = (&self.light, splat(s, 0.0), splat(s, 1.0));
        if light.kind == LightKind::Directional {
            let [x, y, z] = self.along;
            return Some((V3::splat(s, [-x, -y, -z]), one));
        }
        let to = V3::splat(s, light.position).sub(position);
        let square = to.dot(to);
        let axis = -to.dot(V3::splat(s, self.along));
        let is_spot = matches!(light.kind, LightKind::Spot { .. });
        // Most of a floor is outside of a spot's cone; this test needs no square root. It is slightly wider than the
        // cone, so that the light of a point does not depend on its neighbors.
        if is_spot && self.cutoff_cos > 0.0 {
            let least = square * (self.cutoff_cos * self.cutoff_cos * 0.9999);
            if !(lanes & axis.simd_gt(zero) & (axis * axis).simd_ge(least)).any_true() {
                return None;
            }
        }
        let distance = square.sqrt();
        let inverse = 1.0 / select(distance.simd_gt(zero), distance, one);
        let [constant, linear, quadratic] = light.attenuation;
        let mut strength = if linear == 0.0 && quadratic == 0.0 {
            splat(s, 1.0 / constant.max(1e-6))
        } else {
            1.0 / max(square * quadratic + distance * linear + constant, splat(s, 1e-6))
        };
        if is_spot {
            let cosine = axis * inverse;
            let inside = cosine.simd_ge(splat(s, self.cutoff_cos));
            strength = select(inside, strength * power(s, max(cosine, zero), self.exponent), zero);
        }
        Some((to.scale(inverse), strength))
    }
}

impl Lighting {
    /// Prepares the lighting of a frame. `forward` is the camera's viewing direction, for cameras that have one;
    /// `shadows` is true if lights cast shadows, and `shadow` returns the shadow map of a light.
    pub(crate) fn prepare(
        &mut self,
        scene: &RenderScene,
        lights: &[Light],
        forward: Option<[f32; 3]>,
        shadows: bool,
        shadow: impl Fn(usize) -> Option<usize>,
    ) {
        let sky = scene.sky;
        let blend = BlendSpace { is_display: scene.opengl.is_some() };
        self.blend = blend;
        (self.zenith, self.horizon, self.nadir) =
            (blend.color_of_srgb(sky.zenith), blend.color_of_srgb(sky.horizon), blend.color_of_srgb(sky.nadir));
        self.skybox.clone_from(&scene.skybox);
        self.mip_rule = MipRule::of(scene);
        self.polygons.prepare(scene.opengl.and_then(|rules| rules.tessellation));
        self.haze = scene.haze.and_then(|h| h.color).map(|color| blend.color_of_srgb(color));
        self.lights.clear();
        for (k, light) in lights.iter().enumerate().filter(|(_, l)| l.active).take(MAX_LIGHTS) {
            let (cutoff_cos, exponent) = match light.kind {
                LightKind::Spot { cutoff_deg, exponent } => (cos_deg(cutoff_deg), whole_exponent(exponent)),
                LightKind::Directional | LightKind::Point => (-2.0, 0),
            };
            self.lights.push(PreparedLight {
                light: *light,
                along: unit(light.direction),
                cutoff_cos,
                exponent,
                shadow: shadow(k),
                own_pass: shadows && light.cast_shadow && scene.lighting_space == LightingSpace::Display,
            });
        }
        let headlight = scene.headlight.to_directional(scene.lighting_space, forward);
        self.headlight_is_light = headlight.is_some();
        self.lights.extend(headlight.map(|light| PreparedLight {
            light,
            along: unit(light.direction),
            cutoff_cos: -2.0,
            exponent: 0,
            shadow: None,
            own_pass: false,
        }));
    }

    /// Number of drawing passes: one for all lights without shadows, and one for each of the others.
    pub(crate) fn passes(&self) -> usize {
        1 + self.lights.iter().filter(|prepared| prepared.own_pass).count()
    }
}

/// The exponent of a spot, rounded to an integer, up to OpenGL's largest.
pub(crate) fn whole_exponent(exponent: f32) -> u32 {
    (exponent.clamp(0.0, 128.0) + 0.5) as u32
}

/// Highlights weaker than this are black: a third of the weakest light that is not black on a screen.
const MIN_HIGHLIGHT: f32 = 1e-4;

/// Numbers whose power is [`MIN_HIGHLIGHT`], by exponent: below them, no highlight is computed.
const FAINT_ROOT: [f32; 129] = {
    let mut roots = [0.0f32; 129];
    let mut exponent = 1;
    while exponent < roots.len() {
        // By bisection: a constant is computed the same on every machine.
        let (mut low, mut high) = (0.0f32, 1.0f32);
        let mut halvings = 0;
        while halvings < 24 {
            let middle = 0.5 * (low + high);
            let (mut power, mut k) = (1.0f32, 0);
            while k < exponent {
                power *= middle;
                k += 1;
            }
            if power < MIN_HIGHLIGHT {
                low = middle
            } else {
                high = middle
            }
            halvings += 1;
        }
        roots[exponent] = low;
        exponent += 1;
    }
    roots
};

/// Specular highlight of a surface.
#[derive(Clone, Copy)]
pub(super) struct Highlight {
    pub(super) strength: f32,
    pub(super) exponent: u32,
    /// Cosines below this give no highlight.
    pub(super) faint: f32,
}

impl Highlight {
    /// The highlight of a material. A metal mirrors lights as it mirrors everything, whatever the `specular` of its
    /// nonmetallic part, except in MuJoCo's light model (`display`).
    pub(super) fn from_material(material: &Material, display: bool) -> Self {
        let exponent = (material.exponent() + 0.5) as u32;
        let strength = if material.metallic > 0.0 && !display { 1.0 } else { material.specular };
        Self { strength, exponent, faint: FAINT_ROOT[exponent as usize] }
    }

    /// True if the highlight is visible in a light of this specular color.
    pub(super) fn is_visible(&self, specular: [f32; 3]) -> bool {
        self.strength != 0.0 && specular.iter().any(|&x| x != 0.0)
    }
}

/// x to an integer power, by squaring.
#[inline(always)]
pub(super) fn power<S: Simd>(s: S, x: F<S>, mut exponent: u32) -> F<S> {
    let (mut result, mut square) = (splat(s, 1.0), x);
    while exponent > 0 {
        if exponent & 1 == 1 {
            result = result * square;
        }
        square = square * square;
        exponent >>= 1;
    }
    result
}

/// 1 from one half on, else 0.
#[inline(always)]
pub(super) fn whole<S: Simd>(s: S, x: F<S>) -> F<S> {
    select(x.simd_ge(splat(s, 0.5)), splat(s, 1.0), splat(s, 0.0))
}

/// Sky color in a direction (unit). `pixel` is the width of a pixel at depth 1.
#[inline(always)]
pub(crate) fn sky<S: Simd>(s: S, lighting: &Lighting, direction: V3<S>, pixel: f32) -> V3<S> {
    if let Some(image) = &lighting.skybox {
        return skybox(s, image, lighting, direction, pixel);
    }
    let k = sqrt_or_zero(s, min(abs(direction.z), splat(s, 1.0)));
    let up = direction.z.simd_gt(splat(s, 0.0));
    let mix = {
        #[inline(always)]
        |c: usize| {
            let (h, z, n) = (lighting.horizon[c], lighting.zenith[c], lighting.nadir[c]);
            k * select(up, splat(s, z - h), splat(s, n - h)) + h
        }
    };
    V3 { x: mix(0), y: mix(1), z: mix(2) }
}

/// Skybox color in a direction: a cube map whose y is up.
#[inline(never)]
fn skybox<S: Simd>(s: S, image: &Texture, lighting: &Lighting, direction: V3<S>, pixel: f32) -> V3<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let all = direction.z.simd_eq(direction.z);
            let turned = V3 { x: direction.x, y: direction.z, z: -direction.y };
            let (rule, blend) = (lighting.mip_rule, lighting.blend);
            let footprint = match rule {
                MipRule::Sharp => splat(s, pixel),
                // Away from the middle of a face, a pixel is wider on it, by the square of the distance to the face.
                MipRule::OpenGl | MipRule::OpenGlFaces => {
                    let nearest = max(max(abs(turned.x), abs(turned.y)), abs(turned.z));
                    splat(s, pixel) / max(nearest * nearest, splat(s, 1e-3))
                }
            };
            let [r, g, b] = texture::sample_cube(s, image, rule, turned, footprint, all);
            V3 { x: blend.color_of_bytes(r), y: blend.color_of_bytes(g), z: blend.color_of_bytes(b) }
        },
    )
}

/// Color of a surface, in the [`BlendSpace`] of the frame. `tint` multiplies the color of the surface, but not its
/// highlights. With `corner_light`, light was computed at the corners of polygons.
///
/// Compiled once for each instruction set, not in each of its callers.
#[inline(never)]
#[expect(clippy::too_many_arguments, reason = "as many as the quantities of a shaded surface")]
pub(crate) fn shade<S: Simd>(
    s: S,
    context: &ShadeContext<'_>,
    source: &InstanceSurface<'_>,
    at: &Surface<S>,
    corner_light: Option<V3<S>>,
    rays: ViewRays<S>,
    tint: f32,
    lanes: M<S>,
) -> V3<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let ShadeContext { scene, lighting, shadows, shadow_rays, pixel, eye, receives_shadows, image_axes } =
                *context;
            let ViewRays { direction: view, distance } = rays;
            let material = &source.instance.material;
            let display = scene.lighting_space == LightingSpace::Display;
            // In OpenGL, transparent surfaces are drawn at last, in the light of all lights.
            let receives_shadows = receives_shadows && (scene.opengl.is_none() || material.rgba[3] >= 1.0);
            let base = if display {
                let [r, g, b, _] = material.rgba;
                V3::splat(s, [r, g, b])
            } else {
                albedo(s, source, at, view, pixel, lanes)
            };
            let base = if tint == 1.0 { base } else { base.scale(splat(s, tint)) };
            let zero = splat(s, 0.0);
            let n = at.shading_normal;
            let is_back = scene.opengl.is_some() && source.instance.group == OpenGlRules::BACK_GROUP;
            let n = if is_back { n.scale(splat(s, -1.0)) } else { n };
            // Ambient light: interpolated between ground and sky by the normal's height.
            let up = n.z * 0.5 + 0.5;
            let (sky_light, ground) = (scene.ambient.sky, scene.ambient.ground);
            let ambient = {
                #[inline(always)]
                |k: usize| up * (sky_light[k] - ground[k]) + (ground[k] + material.emission)
            };
            let mut diffuse = [ambient(0), ambient(1), ambient(2)];
            if let Some(rays) = shadow_rays.filter(|rays| rays.occlusion_rays > 0) {
                let [above, below] = rays.occlusion(s, at.point(), n, lanes);
                // The occluded fractions are estimates: they are limited to the light that is there.
                let (above, below) = (min(above, up), min(below, splat(s, 1.0) - up));
                for (k, diffuse) in diffuse.iter_mut().enumerate() {
                    *diffuse = *diffuse - above * sky_light[k] - below * ground[k];
                }
            }
            let mut gloss = [zero, zero, zero];
            let shiny = Highlight::from_material(material, display);
            let headlight = &scene.headlight;
            if headlight.active && !lighting.headlight_is_light {
                let facing = max(-n.dot(view), zero);
                for (k, diffuse) in diffuse.iter_mut().enumerate() {
                    *diffuse += facing * headlight.diffuse[k] + headlight.ambient[k];
                }
                let seen = lanes & facing.simd_gt(splat(s, shiny.faint));
                if shiny.is_visible(headlight.specular) && seen.any_true() {
                    let shine = select(seen, power(s, facing, shiny.exponent) * shiny.strength, zero);
                    for (gloss, specular) in gloss.iter_mut().zip(headlight.specular) {
                        *gloss += shine * specular;
                    }
                }
            }
            // The sum of all further passes, each clamped.
            let mut passes = V3::splat(s, [0.0; 3]);
            for prepared in lighting.lights.iter().filter(|_| corner_light.is_none()) {
                let light = &prepared.light;
                let Some((to, strength)) = prepared.illumination(s, at.position, lanes) else { continue };
                let facing = max(n.dot(to), zero);
                let mut lit = strength;
                let mut ambient_light = strength;
                // The ambient light of a light with shadows matters on its dark side, too.
                let matters = {
                    #[inline(always)]
                    || {
                        let has_ambient = scene.opengl.is_some() && light.ambient != [0.0; 3];
                        lanes & if has_ambient { strength } else { facing * strength }.simd_gt(splat(s, 1e-4))
                    }
                };
                if let Some(map) = prepared.shadow.filter(|_| receives_shadows).and_then(|k| shadows.get(k)) {
                    let matters = matters();
                    if matters.any_true() {
                        let seen = map.visibility(s, at.position, at.normal, source.placed.error, matters);
                        let seen = if scene.opengl.is_some() { whole(s, seen) } else { seen };
                        (lit, ambient_light) = (lit * seen, ambient_light * seen);
                    }
                }
                if let Some(rays) = shadow_rays.filter(|rays| rays.shadows && light.cast_shadow && receives_shadows) {
                    let matters = matters();
                    if matters.any_true() {
                        let seen = rays.visibility(s, light, prepared.along.map(|x| -x), at.point(), matters);
                        (lit, ambient_light) = (lit * seen, ambient_light * seen);
                    }
                }
                let own_pass = prepared.own_pass && receives_shadows;
                let mut pass_gloss = [zero, zero, zero];
                let gloss = if own_pass { &mut pass_gloss } else { &mut gloss };
                if !own_pass {
                    for (k, diffuse) in diffuse.iter_mut().enumerate() {
                        *diffuse += facing * lit * light.diffuse[k] + strength * light.ambient[k];
                    }
                }
                if shiny.is_visible(light.specular) {
                    // The cosine between the normal and the half vector, compared before its root is taken.
                    let half = to.sub(match eye {
                        None => view,
                        Some(eye) => at.position.sub(V3::splat(s, eye)).unit(s),
                    });
                    let (along, square) = (n.dot(half), half.dot(half));
                    let bright = (along * along).simd_gt(square * (shiny.faint * shiny.faint));
                    let seen = lanes & bright & along.simd_gt(zero) & facing.simd_gt(zero);
                    if seen.any_true() {
                        let cosine = along / select(seen, square, splat(s, 1.0)).sqrt();
                        let shine = select(seen, power(s, cosine, shiny.exponent) * shiny.strength, zero);
                        for (gloss, specular) in gloss.iter_mut().zip(light.specular) {
                            *gloss += shine * lit * specular;
                        }
                    }
                }
                if own_pass {
                    let (bright, one) = (facing * lit, splat(s, 1.0));
                    if scene.opengl.is_some() {
                        let [r, g, b] = [0, 1, 2].map(|k| bright * light.diffuse[k] + ambient_light * light.ambient[k]);
                        passes.x += min(base.x * r + pass_gloss[0], one);
                        passes.y += min(base.y * g + pass_gloss[1], one);
                        passes.z += min(base.z * b + pass_gloss[2], one);
                        continue;
                    }
                    // Ambient light has no shadow, and belongs to the first pass.
                    for (k, diffuse) in diffuse.iter_mut().enumerate() {
                        *diffuse += strength * light.ambient[k];
                    }
                    passes.x += min(base.x * bright * light.diffuse[0] + pass_gloss[0], one);
                    passes.y += min(base.y * bright * light.diffuse[1] + pass_gloss[1], one);
                    passes.z += min(base.z * bright * light.diffuse[2] + pass_gloss[2], one);
                }
            }
            let one = splat(s, 1.0);
            let plain = {
                #[inline(always)]
                |gloss: [F<S>; 3]| V3 {
                    x: base.x * diffuse[0] + gloss[0],
                    y: base.y * diffuse[1] + gloss[1],
                    z: base.z * diffuse[2] + gloss[2],
                }
            };
            let mut color = if display {
                // OpenGL clamps the sum at 1, highlights included, and multiplies the result by the texture.
                let lit = match corner_light {
                    Some(lit) => lit,
                    None => {
                        let sum = plain(gloss);
                        V3 {
                            x: min(max(sum.x, zero), one),
                            y: min(max(sum.y, zero), one),
                            z: min(max(sum.z, zero), one),
                        }
                        .add(passes)
                    }
                };
                let (r, g, b) = (lit.x * 255.0, lit.y * 255.0, lit.z * 255.0);
                let texture_rays = (view, image_axes.map(|axes| (axes, distance)));
                let (r, g, b) = match texels(s, source, lighting.mip_rule, at, texture_rays, pixel, lanes) {
                    Some([x, y, z]) => (r * x * (1.0 / 255.0), g * y * (1.0 / 255.0), b * z * (1.0 / 255.0)),
                    None => (r, g, b),
                };
                let most = splat(s, 255.0);
                let (r, g, b) = (min(r, most), min(g, most), min(b, most));
                let blend = lighting.blend;
                V3 { x: blend.color_of_bytes(r), y: blend.color_of_bytes(g), z: blend.color_of_bytes(b) }
            } else if material.metallic > 0.0 {
                // Mirrored light, tinted by the metal's color, and emission; without a traced mirror, the sky is mirrored.
                let mirrored = sky(s, lighting, view.sub(n.scale(n.dot(view) * 2.0)), pixel.angle());
                let metal = V3 {
                    x: base.x * (mirrored.x + gloss[0] + material.emission),
                    y: base.y * (mirrored.y + gloss[1] + material.emission),
                    z: base.z * (mirrored.z + gloss[2] + material.emission),
                };
                let k = splat(s, material.metallic.min(1.0));
                plain(gloss.map(|light| light * material.specular)).scale(1.0 - k).add(metal.scale(k))
            } else {
                plain(gloss)
            };
            if let Some(haze) = scene.haze {
                // OpenGL's fog depends on the depth.
                let distance = if scene.opengl.is_some() { at.t } else { distance };
                let k = (distance - haze.start) / (haze.end - haze.start).max(1e-6);
                let k = min(max(k, zero), splat(s, 1.0));
                // OpenGL's fog is linear.
                let k = if scene.opengl.is_some() { k } else { k * k * (3.0 - k * 2.0) };
                let behind = match lighting.haze {
                    Some(c) => V3::splat(s, c),
                    None => sky(s, lighting, V3 { x: view.x, y: view.y, z: max(view.z, zero) }, pixel.angle()),
                };
                color = color.scale(1.0 - k).add(behind.scale(k));
            }
            color
        },
    )
}

/// Linear base color of a surface.
#[inline(always)]
pub(crate) fn albedo<S: Simd>(
    s: S,
    source: &InstanceSurface<'_>,
    at: &Surface<S>,
    view: V3<S>,
    pixel: PixelWidth,
    lanes: M<S>,
) -> V3<S> {
    let flat = source.color;
    let Some(bytes) = texels(s, source, MipRule::Sharp, at, (view, None), pixel, lanes) else {
        return V3::splat(s, flat);
    };
    // Written out: a closure that is not inlined is compiled without the instruction set.
    V3 {
        x: tone::decode_bytes(bytes[0]) * flat[0],
        y: tone::decode_bytes(bytes[1]) * flat[1],
        z: tone::decode_bytes(bytes[2]) * flat[2],
    }
}

/// Axes of the image in the world, right and down, and the distance of the surface along the ray \[m\]: exact widths of
/// pixels follow from them.
type ExactWidth<S> = ([[f32; 3]; 2], F<S>);

/// The texture's bytes (0..=255) at the surface; `None` without a texture. The rays have their directions and, for exact
/// widths of pixels, the axes of the image and the distances of the surfaces.
#[inline(always)]
fn texels<S: Simd>(
    s: S,
    source: &InstanceSurface<'_>,
    rule: MipRule,
    at: &Surface<S>,
    (view, exact): (V3<S>, Option<ExactWidth<S>>),
    pixel: PixelWidth,
    lanes: M<S>,
) -> Option<[F<S>; 3]> {
    let instance = source.instance;
    let image = instance.material.texture.as_deref()?;
    // Width of a pixel on the surface: between its narrow and its wide side for slanted surfaces; the wide side in
    // OpenGL.
    let slant = max(-at.normal.dot(view), splat(s, 0.02));
    let width = match (exact, rule) {
        (Some((axes, distance)), _) => {
            // Derivatives of the point by the image coordinates: the larger one counts.
            let ray = if pixel.parallel { view } else { view.scale(distance / at.t) };
            let along = -max(-at.normal.dot(ray), splat(s, 1e-3));
            let square = {
                #[inline(always)]
                |axis: [f32; 3]| {
                    let axis = V3::splat(s, axis);
                    let moved = axis.sub(ray.scale(at.normal.dot(axis) / along));
                    moved.dot(moved)
                }
            };
            pixel.at(s, at.t) * max(square(axes[0]), square(axes[1])).sqrt()
        }
        (None, MipRule::Sharp) => pixel.at(s, at.t) / sqrt_or_zero(s, slant),
        (None, MipRule::OpenGl | MipRule::OpenGlFaces) => pixel.at(s, at.t) / slant,
    };
    let scale = source.texture_scale;
    Some(if texture::is_cube(image) {
        let direction = V3 {
            x: at.local_position.x * scale[0],
            y: at.local_position.y * scale[1],
            z: at.local_position.z * scale[2],
        };
        let footprint = if rule == MipRule::OpenGlFaces {
            texture::face_footprint(s, direction, scale, width)
        } else {
            width * scale.iter().copied().fold(0.0, f32::max)
        };
        texture::sample_cube(s, image, rule, direction, footprint, lanes)
    } else {
        let has_uvs = instance.mesh().is_some_and(|m| m.uvs().is_some());
        let (uv, density) = if has_uvs {
            (at.uv, at.uv_density)
        } else if let (Shape::Box(cuboid), Some(images)) = (&instance.shape, source.face_images) {
            texture::on_box_faces(s, cuboid, images, at.local_position)
        } else {
            let offset = source.texture_offset;
            let uv = [at.local_position.x * scale[0] + offset[0], at.local_position.y * scale[1] + offset[1]];
            (uv, splat(s, scale[0].abs().max(scale[1].abs())))
        };
        texture::sample(s, image, rule, uv, width * density, lanes)
    })
}
