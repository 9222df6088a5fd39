//! Which renderer draws images.

use super::request::{RasterCfg, Shot};
use crate::frame::FrameMut;
use crate::visibility::RenderError;
use kinetoscope_scene::pattern::{UnknownName, closest};
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;

/// Which renderer draws images. All of them give the same depth, distance, mask, normals and positions off silhouettes,
/// where the rasterizer draws meshes as they are: with [`RasterCfg::lod`](crate::request::RasterCfg::lod), which is on by default, its
/// surfaces are moved as is said there, and no other renderer's are.
///
/// In files it is a name, `"hybrid"`, or a table of paths with what is not as in [`Renderer::RAY_TRACED`]:
/// `{ ray_traced = { samples = 256 } }`. EmbodiChain's names `auto`, `fast-rt` and `rt` are known there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Renderer {
    /// The rasterizer.
    #[default]
    Raster,
    /// What is seen is found by rays: one through each sample, against every triangle and the exact shapes. Light, shadows
    /// and transparency are the rasterizer's. Meshes are never drawn coarser
    /// ([`RasterCfg::lod`](crate::request::RasterCfg::lod) is for shadow maps only).
    FastRayTraced,
    /// The rasterizer, with shadows by rays: sharp at every distance, of all lights that cast shadows, point lights too; and
    /// with ambient occlusion by rays, where [`RasterCfg::occlusion_rays`](crate::request::RasterCfg::occlusion_rays) asks for some.
    /// Meshes are never drawn coarser. Rays begin on the triangles: near the edge of its dark side, a coarse mesh with smooth normals
    /// goes dark triangle by triangle. Behind a lens that bends lines what is seen is found by rays too.
    Hybrid,
    /// Colors by path tracing: light that went over several surfaces, soft shadows of lights that have a size, mirrors that
    /// show the scene. All other channels as [`FastRayTraced`](Self::FastRayTraced) has them.
    ///
    /// - **Lights** are as bright as the rasterizer draws them: a white matt surface that faces a light of color L has the
    ///   radiance L. A light with a [`radius`](kinetoscope_scene::Light::radius) is a disc that faces what it lights: half of one on a
    ///   ceiling would be behind the ceiling, so keep it the radius below. Ambient light of lights and of the headlight reaches
    ///   everything, as in the rasterizer. The headlight is shaded by nothing that is before the near plane. 16 lights count,
    ///   the first, and the headlight.
    /// - **The dome** is [`RenderScene::ambient`](kinetoscope_scene::RenderScene::ambient): its sky's radiance from above the horizon, its
    ///   ground's from below. Where nothing is in the way a matt surface (specular 0) gets what the rasterizer gives it; below a glossy
    ///   layer it gets what the layer leaves. Cameras and mirrors see
    ///   [`RenderScene::sky`](kinetoscope_scene::RenderScene::sky) there instead.
    /// - **Emission** of a material lights other things, with `max_bounces` 0 too. Points of what glows are looked for at every
    ///   surface: of finite planes (area lights), boxes, spheres, cylinders and meshes. Capsules, ellipsoids, height fields and
    ///   infinite planes light as much, with more noise: paths meet them by chance.
    /// - **Materials**: Lambert's law below a GGX layer that reflects F0 = 0.08 specular at normal incidence and
    ///   F90 = min(1, 50 F0) at grazing, of roughness alpha² = 2 / (e + 2) with MuJoCo's exponent e = 128 shininess (at least
    ///   1), or its roughness to the fourth power. The layer mirrors a light's `specular` color and everything else's only
    ///   color. Of a metal F0 is its color, F90 is 1, and nothing is below. `reflectance` of the light is
    ///   mirrored perfectly, of boxes by the +z face alone. Of what is left, `transmission` meets smooth glass: it is mirrored by Fresnel's equations or goes
    ///   through by Snell's law, and takes the color where it enters. Each surface of glass is a bounce; lights cast its shadow,
    ///   and are not seen through it. `alpha` is the part of the light that the front of a surface takes; the rest goes on straight; their
    ///   backs are not seen. Paths end, black, after 64 such surfaces, and where a smooth normal mirrors them below the surface
    ///   itself.
    ///
    /// The [tone curve](crate::request::RasterCfg::tone) and sRGB are those of the rasterizer. Noise depends on the pixel and the seed only: the same bits for
    /// any number of threads. Images of `Camera`s have noise of their own each, by the seed of the
    /// simulation, the environment's global index, the name of the camera and which image it is, besides this seed: the
    /// same in any batch.
    RayTraced {
        /// Paths per pixel; 1 to 65536. A power of two spreads them best.
        samples: u32,
        /// Surfaces that light goes over after the one that is seen, at most; 0 is light that comes from lights, from the
        /// dome and from what glows at once. At most 64.
        max_bounces: u32,
        /// Whether noise is smoothed where normals and depth of the surface are alike and light differs no more than noise does.
        /// The surface's own colors stay as they are.
        denoise: bool,
        /// Another seed has other noise.
        seed: u32,
    },
}

impl Renderer {
    /// A image to look at: 64 paths of up to 4 bounces, smoothed.
    pub const RAY_TRACED: Self = Self::RayTraced { samples: 64, max_bounces: 4, denoise: true, seed: 0 };
    /// The most paths per pixel.
    pub const MAX_SAMPLES: u32 = 1 << 16;
    /// The most bounces.
    pub const MAX_BOUNCES: u32 = 64;

    /// Checks the numbers.
    ///
    /// # Errors
    ///
    /// [`RenderError::Paths`], [`RenderError::Bounces`].
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

    /// The renderer of a name in files, EmbodiChain's too; paths are those of [`RAY_TRACED`](Self::RAY_TRACED).
    fn from_name(name: &str) -> Result<Self, UnknownName> {
        const ALL: [Renderer; 4] = [Renderer::Raster, Renderer::FastRayTraced, Renderer::Hybrid, Renderer::RAY_TRACED];
        ALL.into_iter().find(|renderer| renderer.name() == name || renderer.aliases().contains(&name)).ok_or_else(
            || {
                let all = ALL.iter().flat_map(|renderer| [&[renderer.name()], renderer.aliases()].concat());
                let candidates = closest(name, all).into_iter().map(String::from).collect();
                UnknownName { what: "renderer", name: name.into(), candidates }
            },
        )
    }

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Raster => "raster",
            Self::FastRayTraced => "fast_ray_traced",
            Self::Hybrid => "hybrid",
            Self::RayTraced { .. } => "ray_traced",
        }
    }

    /// What EmbodiChain, and so the flags of examples, call it.
    fn aliases(self) -> &'static [&'static str] {
        match self {
            Self::Raster => &["auto"],
            Self::FastRayTraced => &["fast-rt", "fast_rt"],
            Self::Hybrid => &[],
            Self::RayTraced { .. } => &["rt"],
        }
    }

    /// Whether what is seen at a pixel is found by rays; `bent` says whether there is a lens that bends lines.
    pub fn sees_by_rays(self, bent: bool) -> bool {
        match self {
            Self::Raster => false,
            Self::Hybrid => bent,
            Self::FastRayTraced | Self::RayTraced { .. } => true,
        }
    }

    /// Whether colors come from paths.
    pub fn follows_paths(self) -> bool {
        matches!(self, Self::RayTraced { .. })
    }

    /// How many paths a image takes.
    pub(crate) fn paths(self, shot: &Shot<'_>, frame: &FrameMut<'_>) -> u64 {
        match self {
            Self::RayTraced { samples, .. } if frame.color.is_some() => {
                (shot.view.width as u64).saturating_mul(shot.view.height as u64).saturating_mul(samples.into())
            }
            _ => 0,
        }
    }

    /// How much longer a pixel takes than the rasterizer's, about.
    pub(crate) fn slowness(self, cfg: RasterCfg) -> usize {
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

/// What a file says of the paths of [`Renderer::RayTraced`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Paths {
    samples: Option<u32>,
    max_bounces: Option<u32>,
    denoise: Option<bool>,
    seed: Option<u32>,
}

/// Reads a renderer.
struct InFile;

impl<'de> Visitor<'de> for InFile {
    type Value = Renderer;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a renderer, or a table with ray_traced")
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
                let paths: Paths = map.next_value()?;
                Renderer::RayTraced {
                    samples: paths.samples.unwrap_or(samples),
                    max_bounces: paths.max_bounces.unwrap_or(max_bounces),
                    denoise: paths.denoise.unwrap_or(denoise),
                    seed: paths.seed.unwrap_or(seed),
                }
            }
            _ => return Err(A::Error::custom(format!("renderer {name:?} has no numbers: its name is enough"))),
        };
        match map.next_key::<String>()? {
            Some(other) => Err(A::Error::custom(format!("one renderer only: {name:?} or {other:?}"))),
            None => Ok(renderer),
        }
    }
}

impl<'de> Deserialize<'de> for Renderer {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(InFile)
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

    /// As in scene files: a name, or a table with numbers; and back.
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
            ("renderer = 'fast_raytraced'", "there is no renderer \"fast_raytraced\"; known are \"fast_ray_traced\""),
            ("renderer.ray_traced.sample = 3", "unknown field `sample`"),
            ("renderer.ray_traced.samples = -3", "invalid value: integer `-3`"),
            ("renderer.hybrid = {}", "renderer \"hybrid\" has no numbers: its name is enough"),
            ("renderer = {}", "a renderer is a name, or a table"),
            ("renderer = { ray_traced = {}, raster = {} }", "one renderer only"),
            ("renderer = 3", "the name of a renderer"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
