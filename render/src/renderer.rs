//! Selection of the renderer.

use super::request::{RasterCfg, RenderRequest};
use crate::frame::FrameMut;
use crate::visibility::RenderError;
use kinetoscope_scene::pattern::{UnknownName, closest_names};
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;

/// Renderer of images. All renderers agree on depth, distance, mask, normals and positions, except at silhouettes, and
/// where the rasterizer uses a mesh's level of detail ([`RasterCfg::lod`](crate::request::RasterCfg::lod), on by
/// default).
///
/// In files it is a name, `"hybrid"`, or a table with the parameters of path tracing that differ from
/// [`Renderer::RAY_TRACED`]: `{ ray_traced = { samples = 256 } }`. EmbodiChain's names `auto`, `fast-rt` and `rt` are
/// accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Renderer {
    /// The rasterizer.
    #[default]
    Raster,
    /// Ray-traced visibility: one ray through each sample, against every triangle and the exact shapes. Light, shadows
    /// and transparency are the rasterizer's. Meshes are always at full detail
    /// ([`RasterCfg::lod`](crate::request::RasterCfg::lod) applies to shadow maps only).
    FastRayTraced,
    /// The rasterizer with ray-traced shadows: sharp at every distance, for all lights that cast shadows, point lights
    /// too. [`RasterCfg::occlusion_rays`](crate::request::RasterCfg::occlusion_rays) adds ray-traced ambient occlusion.
    /// Meshes are always at full detail.
    ///
    /// Shadow rays start on the triangles. So a coarse mesh with smooth normals gets dark triangle by triangle near the
    /// edge of its dark side. With a lens that bends lines, visibility is ray traced too.
    Hybrid,
    /// Path-traced color: indirect light, soft shadows of lights with a size, and mirrors that show the scene. All
    /// other channels are those of [`FastRayTraced`](Self::FastRayTraced).
    ///
    /// - **Lights** are as bright as in the rasterizer: a white matte surface that faces a light of color L has the
    ///   radiance L. A light with a [`radius`](kinetoscope_scene::Light::radius) is a disc that faces the lit point:
    ///   keep it at least the radius below a ceiling, or half of it is behind the ceiling. Ambient light of lights and
    ///   of the headlight reaches every surface, as in the rasterizer. Objects between the camera and the near plane
    ///   cast no shadow in the headlight. The first 16 active lights count, and the headlight.
    /// - **Environment light** is [`RenderScene::ambient`](kinetoscope_scene::RenderScene::ambient): its sky's radiance
    ///   from above the horizon, its ground's from below. An unoccluded matte surface (specular 0) receives the same
    ///   light as in the rasterizer; below a glossy layer it receives the rest. Cameras and mirrors see
    ///   [`RenderScene::sky`](kinetoscope_scene::RenderScene::sky) instead.
    /// - **Emission** of a material lights other objects, with `max_bounces` 0 too. Emissive finite planes (area
    ///   lights), boxes, spheres, cylinders and meshes are sampled at every surface. Capsules, ellipsoids, height
    ///   fields and infinite planes light as much, with more noise: only paths that hit them find them.
    /// - **Materials**: Lambertian reflection below a GGX layer with F0 = 0.08 specular at normal incidence and F90 =
    ///   min(1, 50 F0) at grazing. Its roughness is alpha² = 2 / (e + 2) with MuJoCo's exponent e = 128 shininess (at
    ///   least 1), or the material's roughness to the fourth power. The layer mirrors a light's `specular` color, and
    ///   the plain color of all other light. For a metal, F0 is its color, F90 is 1, and the layer below is black. The
    ///   fraction `reflectance` of the light is mirrored perfectly, for boxes by the +z face alone. Of the rest, the
    ///   fraction `transmission` meets smooth glass: it is mirrored by Fresnel's equations or transmitted by Snell's
    ///   law, and takes the color where it enters. Each mirror and each surface of glass is a bounce; glass casts
    ///   shadows, and lights are invisible through it. `alpha` is the fraction of light that the front of a surface
    ///   absorbs or scatters; the rest passes straight. Backs of transparent surfaces are invisible. Paths end, black,
    ///   after 64 such surfaces, and where a smooth normal mirrors them below the flat surface.
    ///
    /// The [tone curve](crate::request::RasterCfg::tone) and sRGB are those of the rasterizer. Noise depends on the
    /// pixel, the seed and [`FrameSample::noise`](crate::shutter::FrameSample::noise) only: the same bits for any
    /// number of threads. Each image of a `Camera` has its own noise. It is keyed by the seed of the simulation, the
    /// environment's global index, the name of the camera and the index of the image, besides this seed: the same in
    /// any batch.
    RayTraced {
        /// Paths per pixel; 1 to 65536. A power of two distributes them best.
        samples: u32,
        /// Largest number of bounces after the visible surface, at most 64. 0 is direct light only: from lights, the
        /// environment and emissive surfaces.
        max_bounces: u32,
        /// True to denoise: light is smoothed where normals and depth are similar, and light differs by no more than
        /// its noise. Surface colors stay sharp.
        denoise: bool,
        /// Seed of the noise.
        seed: u32,
    },
}

impl Renderer {
    /// Path tracing with 64 paths per pixel, up to 4 bounces, denoised.
    pub const RAY_TRACED: Self = Self::RayTraced { samples: 64, max_bounces: 4, denoise: true, seed: 0 };
    /// Largest number of paths per pixel.
    pub const MAX_SAMPLES: u32 = 1 << 16;
    /// Largest number of bounces.
    pub const MAX_BOUNCES: u32 = 64;

    /// Checks the parameters of path tracing.
    ///
    /// # Errors
    ///
    /// [`RenderError::Paths`] or [`RenderError::Bounces`] for a number out of range.
    pub fn validate(self) -> Result<(), RenderError> {
        let Self::RayTraced { samples, max_bounces, .. } = self else { return Ok(()) };
        if !(1..=Self::MAX_SAMPLES).contains(&samples) {
            return Err(RenderError::Paths { samples, limit: Self::MAX_SAMPLES });
        }
        if max_bounces > Self::MAX_BOUNCES {
            return Err(RenderError::Bounces { max_bounces, limit: Self::MAX_BOUNCES });
        }
        Ok(())
    }

    /// The renderer of a name or alias, EmbodiChain's too; path tracing gets the parameters of
    /// [`RAY_TRACED`](Self::RAY_TRACED).
    fn from_name(name: &str) -> Result<Self, UnknownName> {
        const ALL: [Renderer; 4] = [Renderer::Raster, Renderer::FastRayTraced, Renderer::Hybrid, Renderer::RAY_TRACED];
        ALL.into_iter().find(|renderer| renderer.name() == name || renderer.aliases().contains(&name)).ok_or_else(
            || {
                let all = ALL.iter().flat_map(|renderer| [&[renderer.name()], renderer.aliases()].concat());
                let candidates = closest_names(name, all).into_iter().map(String::from).collect();
                UnknownName { what: "renderer", name: name.into(), candidates }
            },
        )
    }

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Raster => "raster",
            Self::FastRayTraced => "fast_ray_traced",
            Self::Hybrid => "hybrid",
            Self::RayTraced { .. } => "ray_traced",
        }
    }

    /// EmbodiChain's names, also used by the flags of examples.
    fn aliases(self) -> &'static [&'static str] {
        match self {
            Self::Raster => &["auto"],
            Self::FastRayTraced => &["fast-rt", "fast_rt"],
            Self::Hybrid => &[],
            Self::RayTraced { .. } => &["rt"],
        }
    }

    /// Returns true if rays, not the rasterizer, find the surface that each pixel shows. `bent` is true if the lens is
    /// not a pinhole.
    pub fn traces_visibility(self, bent: bool) -> bool {
        match self {
            Self::Raster => false,
            Self::Hybrid => bent,
            Self::FastRayTraced | Self::RayTraced { .. } => true,
        }
    }

    /// True if color is path traced.
    pub fn is_path_tracing(self) -> bool {
        matches!(self, Self::RayTraced { .. })
    }

    /// Number of paths of an image; 0 without path tracing or without color.
    pub(crate) fn path_count(self, render_request: &RenderRequest<'_>, frame: &FrameMut<'_>) -> u64 {
        match self {
            Self::RayTraced { samples, .. } if frame.color.is_some() => (render_request.view.width as u64)
                .saturating_mul(render_request.view.height as u64)
                .saturating_mul(samples.into()),
            _ => 0,
        }
    }

    /// Approximate time per pixel, relative to the rasterizer.
    pub(crate) fn relative_cost(self, cfg: RasterCfg) -> usize {
        match self {
            Self::Raster => 1,
            Self::Hybrid => 20 * (1 + usize::from(cfg.occlusion_rays)),
            Self::FastRayTraced => 20,
            Self::RayTraced { samples, max_bounces, .. } => {
                (samples as usize).saturating_mul(20 * (1 + max_bounces as usize))
            }
        }
    }
}

/// Parameters of [`Renderer::RayTraced`] in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PathParameters {
    samples: Option<u32>,
    max_bounces: Option<u32>,
    denoise: Option<bool>,
    seed: Option<u32>,
}

/// Deserializes a renderer from a name or a table.
struct RendererVisitor;

impl<'de> Visitor<'de> for RendererVisitor {
    type Value = Renderer;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a renderer, or a table whose only key is ray_traced")
    }

    fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Renderer, E> {
        Renderer::from_name(name).map_err(E::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Renderer, A::Error> {
        let Some(name) = map.next_key::<String>()? else {
            return Err(A::Error::custom("a renderer is a name, or a table such as { ray_traced = { samples = 64 } }"));
        };
        let renderer = match Renderer::from_name(&name).map_err(A::Error::custom)? {
            Renderer::RayTraced { samples, max_bounces, denoise, seed } => {
                let paths: PathParameters = map.next_value()?;
                Renderer::RayTraced {
                    samples: paths.samples.unwrap_or(samples),
                    max_bounces: paths.max_bounces.unwrap_or(max_bounces),
                    denoise: paths.denoise.unwrap_or(denoise),
                    seed: paths.seed.unwrap_or(seed),
                }
            }
            _ => return Err(A::Error::custom(format!("renderer {name:?} has no parameters; give only its name"))),
        };
        match map.next_key::<String>()? {
            Some(other) => Err(A::Error::custom(format!("two renderers are given: {name:?} and {other:?}; keep one"))),
            None => Ok(renderer),
        }
    }
}

impl<'de> Deserialize<'de> for Renderer {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(RendererVisitor)
    }
}

#[cfg(test)]
mod tests {
    use super::Renderer;
    use serde::{Deserialize, Serialize};

    #[derive(Default, Deserialize, Serialize)]
    #[serde(default)]
    struct Cfg {
        renderer: Renderer,
    }

    /// As in scene files: a name, or a table with parameters; and back.
    #[test]
    fn serde() {
        let read = |text: &str| toml::from_str::<Cfg>(text).map(|cfg| cfg.renderer);
        let some = Renderer::RayTraced { samples: 256, max_bounces: 4, denoise: true, seed: 7 };
        let all = Renderer::RayTraced { samples: 1, max_bounces: 0, denoise: false, seed: 9 };
        for (text, expected) in [
            ("", Renderer::Raster),
            ("renderer = 'fast_ray_traced'", Renderer::FastRayTraced),
            ("renderer = 'ray_traced'", Renderer::RAY_TRACED),
            ("renderer = 'auto'", Renderer::Raster),
            ("renderer = 'fast-rt'", Renderer::FastRayTraced),
            ("renderer = 'rt'", Renderer::RAY_TRACED),
            ("renderer.rt.samples = 9", Renderer::RayTraced { samples: 9, max_bounces: 4, denoise: true, seed: 0 }),
            ("renderer = { ray_traced = {} }", Renderer::RAY_TRACED),
            ("renderer.ray_traced = { samples = 256, seed = 7 }", some),
            ("[renderer.ray_traced]\nsamples = 1\nmax_bounces = 0\ndenoise = false\nseed = 9", all),
        ] {
            assert_eq!(read(text).unwrap(), expected, "{text}");
        }
        for renderer in [Renderer::Raster, Renderer::FastRayTraced, Renderer::Hybrid, some, all] {
            let text = toml::to_string(&Cfg { renderer }).unwrap();
            assert_eq!(read(&text).unwrap(), renderer, "{text}");
        }
        for (text, said) in [
            ("renderer = 'fast_raytraced'", "unknown renderer \"fast_raytraced\"; known names: \"fast_ray_traced\""),
            ("renderer.ray_traced.sample = 3", "unknown field `sample`"),
            ("renderer.ray_traced.samples = -3", "invalid value: integer `-3`"),
            ("renderer.hybrid = {}", "renderer \"hybrid\" has no parameters; give only its name"),
            ("renderer = {}", "a renderer is a name, or a table"),
            ("renderer = { ray_traced = {}, raster = {} }", "two renderers are given"),
            ("renderer = 3", "the name of a renderer"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
