//! State that all bands of a frame share: draw list, lights and shadows.

use super::MAX_BAND_SAMPLES;
use super::corner_light::LitPolygons;
use super::group::ShadingContext;
use super::horizon::Horizon;
use super::light::{Lighting, MAX_LIGHTS, PixelWidth, ShadeContext};
use super::mirror::{self, Mirrors};
use super::motion_vectors::MotionVectors;
use super::shadow::{ShadowBand, ShadowMap};
use super::shadow_fit::{self, LightView};
use super::shadow_rays::ShadowRays;
use super::tone::ToneCurve;
use crate::aperture::Aperture;
use crate::frame::{FrameMut, Stage};
use crate::geometry::assets::RayAssetCache;
use crate::geometry::bvh::TraversalStack;
use crate::lens::rays::LensRays;
use crate::raster::tile::{BLOCK, SAMPLES};
use crate::raster::{DrawList, Granularity, Layer, largest_shift, select_level};
use crate::renderer::Renderer;
use crate::request::RasterCfg;
use crate::request::RenderRequest;
use crate::shutter::Shutter;
use crate::trace::{Candidates, RayTracer};
use crate::visibility::{Projection, RenderError, View};
use kinetoscope_scene::{Instance, Light, LightingSpace, PoseF32, RenderScene};
use std::cell::RefCell;

/// Largest number of lights with a shadow map.
const MAX_SHADOWS: usize = 4;

/// A frame prepared for rendering by bands; its memory is reused for the next frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct PreparedFrame {
    pub(crate) list: DrawList,
    lighting: Lighting,
    motion_vectors: MotionVectors,
    shadows: Vec<ShadowMap>,
    /// Number of maps in use.
    map_count: usize,
    /// Sample planes: 1, or 5 with multisampling.
    pub(crate) planes: usize,
    /// Projection of the image; `None` if preparation failed.
    pub(crate) projection: Option<Projection>,
    /// Ray tracer, used if any rays are cast.
    pub(crate) tracer: RayTracer,
    pub(crate) renderer: Renderer,
    /// True if visibility is ray traced.
    pub(crate) traces_visibility: bool,
    /// True if shadows are ray traced.
    shadow_rays: bool,
    /// Rays per sample for ambient occlusion.
    occlusion_rays: u16,
    /// Index of the first instance that mirrors, for rasterized color; `None` if no instance does, without color, or if
    /// reflections are off.
    first_mirror: Option<usize>,
    pub(crate) tone: ToneCurve,
    /// Factor of light before the tone curve.
    pub(crate) exposure: f32,
    /// The only row of each block that is rendered; `None` for all rows.
    pub(crate) only_row: Option<usize>,
}

/// Renderer, its configuration and the camera's optics, for one frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RenderSettings<'a> {
    pub(crate) cfg: RasterCfg,
    pub(crate) renderer: Renderer,
    pub(crate) aperture: Option<&'a Aperture>,
    pub(crate) shutter: Shutter,
    pub(crate) exposure_compensation: f64,
    /// Cache of BVHs over meshes.
    pub(crate) assets: &'a RayAssetCache,
}

/// Largest exposure compensation, in stops.
const MAX_STOPS: f64 = 20.0;

impl PreparedFrame {
    pub(crate) fn bytes(&self) -> usize {
        self.list.bytes()
            + self.tracer.bytes()
            + self.motion_vectors.bytes()
            + self.shadows.iter().map(ShadowMap::bytes).sum::<usize>()
    }

    /// Validates a request and builds its draw list. Shadow maps are rendered later, see
    /// [`PreparedFrame::shadow_bands`].
    pub(crate) fn prepare(
        &mut self,
        style: RenderSettings<'_>,
        render_request: &RenderRequest<'_>,
        frame: &FrameMut<'_>,
    ) -> Result<(), RenderError> {
        self.projection = None;
        let View { width, height, .. } = *render_request.view;
        render_request.view.validate()?;
        frame.validate(width * height)?;
        self.prepare_part(style, render_request, frame)
    }

    /// As [`prepare`](Self::prepare), for one row of the image; the frame covers the row of blocks that contains it.
    pub(crate) fn prepare_row(
        &mut self,
        style: RenderSettings<'_>,
        render_request: &RenderRequest<'_>,
        frame: &FrameMut<'_>,
        row: usize,
    ) -> Result<(), RenderError> {
        self.projection = None;
        self.prepare_part(style, render_request, frame)?;
        self.only_row = Some(row % BLOCK);
        Ok(())
    }

    fn prepare_part(
        &mut self,
        style: RenderSettings<'_>,
        render_request: &RenderRequest<'_>,
        frame: &FrameMut<'_>,
    ) -> Result<(), RenderError> {
        let RenderSettings { cfg, renderer, aperture, shutter, exposure_compensation, assets } = style;
        (self.map_count, self.only_row) = (0, None);
        let RenderRequest { scene, poses, view, .. } = *render_request;
        view.validate()?;
        if !matches!(cfg.samples, 1 | 4) {
            return Err(RenderError::Samples { samples: cfg.samples });
        }
        if !(-MAX_STOPS..=MAX_STOPS).contains(&exposure_compensation) {
            return Err(RenderError::ExposureCompensation { stops: exposure_compensation as f32 });
        }
        renderer.validate()?;
        if view.parallel && (render_request.lens.is_some() || renderer.traces_visibility(false)) {
            return Err(RenderError::Orthographic { renderer: renderer.name() });
        }
        check_occlusion(cfg, renderer)?;
        if poses.len() != scene.instances().len() {
            return Err(RenderError::PoseCount { expected: scene.instances().len(), found: poses.len() });
        }
        if let Some((instance, pose)) = poses.iter().enumerate().find(|(_, p)| !p.is_rigid()) {
            return Err(RenderError::InstancePose { instance, pose: *pose });
        }
        aperture.map_or(Ok(()), Aperture::check)?;
        shutter.check()?;
        check_exposure_optics(renderer, aperture, shutter)?;
        if frame.wants(Stage::Flow) {
            self.motion_vectors.prepare(render_request)?;
        }
        let projection = Projection::from(view);
        let wants_color = frame.wants(Stage::Color);
        let multisampled = wants_color && cfg.samples == 4 && !renderer.is_path_tracing();
        if let Some(lens) = render_request.lens {
            check_lens(lens, renderer, view, if multisampled { 4 } else { 1 })?;
        }
        let shaded = wants_color && !renderer.is_path_tracing();
        let hybrid = wants_color && renderer == Renderer::Hybrid;
        self.shadow_rays = hybrid && cfg.shadows;
        self.occlusion_rays = if hybrid { cfg.occlusion_rays } else { 0 };
        (self.tone, self.exposure) = (cfg.tone, exposure_compensation.exp2() as f32);
        if shaded && scene.lighting_space == LightingSpace::Display && cfg.tone == ToneCurve::Soft {
            self.tone = ToneCurve::Clip;
        }
        let shown = |i: &Instance| Layer::for_instance(i, cfg.groups) != Layer::Hidden && mirror::reflectance(i) > 0.0;
        self.first_mirror = scene.instances().iter().position(shown).filter(|_| shaded && cfg.reflections);
        let casts_rays = self.shadow_rays || self.occlusion_rays > 0 || self.first_mirror.is_some();
        if shaded {
            self.prepare_lights(cfg, render_request);
        }
        self.planes = if multisampled { SAMPLES.len() } else { 1 };
        self.traces_visibility = renderer.traces_visibility(render_request.lens.is_some());
        let parts = match renderer {
            _ if self.traces_visibility => Granularity::Instances,
            Renderer::Raster if cfg.lod => Granularity::LodClusters,
            _ => Granularity::FullClusters,
        };
        let keep = |instance: &Instance| Layer::for_instance(instance, cfg.groups);
        self.list.build(&projection, render_request.lens, scene, poses, parts, keep);
        if self.traces_visibility || casts_rays {
            self.tracer.prepare_geometry(scene, assets, keep);
        }
        if casts_rays || wants_color && renderer.is_path_tracing() {
            self.tracer.place(scene, poses, None);
        }
        self.renderer = renderer;
        self.projection = Some(projection);
        Ok(())
    }

    /// Prepares lights and their shadow maps.
    fn prepare_lights(&mut self, cfg: RasterCfg, render_request: &RenderRequest<'_>) {
        let RenderRequest { scene, poses, view, lights, lens, .. } = *render_request;
        let lights = lights.unwrap_or(&scene.lights);
        // Index of the light of each shadow map.
        let mut maps: [Option<usize>; MAX_SHADOWS] = [None; MAX_SHADOWS];
        if cfg.shadows && !self.shadow_rays {
            let side = shadow_side(cfg, view, scene);
            let light_sources = lights.iter().enumerate().filter(|(_, l)| l.active).take(MAX_LIGHTS);
            let mut views = [None; MAX_LIGHTS];
            let mut casting = [0; MAX_LIGHTS];
            let light_sources = light_sources.filter(|(_, l)| l.cast_shadow);
            let limits = |light: &LightView, of: &Light| match scene.opengl {
                Some(rules) => light.limited(of, &rules, [view.near, view.far]),
                None => Some(*light),
            };
            let light_sources =
                light_sources.filter_map(|(k, light)| Some((k, limits(&LightView::from_light(light)?, light)?)));
            for ((k, light_view), (view, of)) in light_sources.zip(views.iter_mut().zip(&mut casting)) {
                (*view, *of) = (Some(light_view), k);
            }
            let receivers = match lens {
                None => {
                    let shown = |i: &Instance| Layer::for_instance(i, cfg.groups) != Layer::Hidden;
                    shadow_fit::visible_extents(&Projection::from(view), scene, poses, shown, &views)
                }
                Some(_) => shadow_fit::unbounded_extents(),
            };
            for ((light_view, receivers), k) in views.iter().flatten().zip(&receivers).zip(casting) {
                if self.map_count == MAX_SHADOWS {
                    break;
                }
                if self.shadows.len() == self.map_count {
                    self.shadows.push(ShadowMap::empty());
                }
                if self.shadows[self.map_count].prepare(light_view, receivers, scene, poses, cfg, side) {
                    maps[self.map_count] = Some(k);
                    self.map_count += 1;
                }
            }
        }
        let forward = lens.is_none_or(LensRays::is_forward).then(|| view.world_from_camera.rotation.map(|row| row[2]));
        let shadow = |k| maps.iter().position(|light| *light == Some(k));
        self.lighting.prepare(scene, lights, forward, cfg.shadows, shadow);
        let shown = |i: &Instance| Layer::for_instance(i, cfg.groups) != Layer::Hidden;
        let has_horizon = !view.parallel;
        self.lighting.ground_haze =
            if has_horizon { Horizon::of(scene, poses, view.world_from_camera.translation, shown) } else { None };
    }

    /// True if there are shadow maps to render.
    pub(crate) fn has_shadows(&self) -> bool {
        self.map_count > 0
    }

    /// Bands of the shadow maps; all must be rendered before the image.
    pub(crate) fn shadow_bands(&mut self) -> impl Iterator<Item = ShadowBand<'_>> {
        self.shadows.iter_mut().take(self.map_count).flat_map(ShadowMap::bands)
    }

    /// Samples of a tile that can hold any band of the shadow maps, including maps that are not in use now.
    pub(crate) fn max_shadow_band_samples(&self) -> usize {
        self.shadows.iter().map(ShadowMap::max_band_texels).max().unwrap_or(0)
    }

    /// Rows of blocks that are rendered together.
    pub(crate) fn band_rows(&self) -> usize {
        let Some(projection) = &self.projection else { return 1 };
        let blocks = [projection.width.div_ceil(BLOCK), projection.height.div_ceil(BLOCK)];
        // Small images with many samples are split in two, so that the scratch memory is not much larger than the
        // image.
        let most = if self.planes > 1 { blocks[1].div_ceil(2) } else { blocks[1] };
        (MAX_BAND_SAMPLES / (self.planes * blocks[0] * BLOCK * BLOCK)).clamp(1, most)
    }

    /// Context for shading pixels; the flags select the stages `surface`, `albedo` and `flow`.
    pub(crate) fn context<'a>(
        &'a self,
        render_request: &RenderRequest<'a>,
        projection: &'a Projection,
        stack: &'a RefCell<&'a mut TraversalStack>,
        candidates: &'a RefCell<&'a mut Candidates>,
        lit_polygons: &'a RefCell<&'a mut LitPolygons>,
        [surface, albedo, flow]: [bool; 3],
    ) -> ShadingContext<'a> {
        let (shadows, occlusion_rays) = (self.shadow_rays, self.occlusion_rays);
        let rays = ShadowRays { tracer: &self.tracer, stack, shadows, occlusion_rays };
        let only_first = render_request.scene.lighting_space == LightingSpace::Display;
        let mirrors = self.first_mirror.map(|first| {
            let tracer = &self.tracer;
            let others = render_request.scene.instances()[first + 1..]
                .iter()
                .any(|instance| mirror::reflectance(instance) > 0.0);
            let bounded = (only_first || !others) && tracer.is_bounded_without(first as u32);
            Mirrors { tracer, stack, candidates, first, only_first, bounded }
        });
        ShadingContext {
            projection,
            lens: render_request.lens,
            poses: render_request.poses,
            placed: &self.list.placed,
            shade: ShadeContext {
                scene: render_request.scene,
                lighting: &self.lighting,
                shadows: &self.shadows[..self.map_count],
                shadow_rays: (shadows || occlusion_rays > 0).then_some(rays),
                pixel: PixelWidth {
                    width: render_request
                        .lens
                        .map_or(1.0 / projection.fx.min(projection.fy), |lens| lens.pixel_spacing() as f32),
                    parallel: projection.parallel,
                },
                eye: (projection.parallel && render_request.scene.opengl.is_some())
                    .then_some(projection.world_from_camera.translation),
                receives_shadows: true,
                image_axes: render_request.scene.opengl.is_some().then(|| {
                    let rotation = projection.world_from_camera.rotation;
                    [0, 1].map(|axis| rotation.map(|row| row[axis]))
                }),
            },
            mirrors,
            surface,
            albedo,
            motion_vectors: flow.then_some(&self.motion_vectors),
            lit_polygons: self.lighting.polygons.is_in_use().then_some(lit_polygons),
        }
    }

    /// Empties the table of lit polygons for this frame.
    pub(crate) fn clear_lit_polygons(&self, table: &mut LitPolygons) {
        if let Some(projection) = self.projection.filter(|_| self.lighting.polygons.is_in_use()) {
            table.clear(projection.world_from_camera.translation, self.lighting.passes());
        }
    }
}

/// Checks that a renderer supports the configured ambient occlusion.
///
/// # Errors
///
/// [`RenderError::Occlusion`] for occlusion rays with [`Renderer::Raster`] or [`Renderer::FastRayTraced`]. Path tracing
/// ignores them.
pub fn check_occlusion(cfg: RasterCfg, renderer: Renderer) -> Result<(), RenderError> {
    match renderer {
        Renderer::Raster | Renderer::FastRayTraced if cfg.occlusion_rays > 0 => {
            Err(RenderError::Occlusion { rays: cfg.occlusion_rays, renderer: renderer.name() })
        }
        _ => Ok(()),
    }
}

/// Checks that a renderer supports the configured depth of field and exposure time.
///
/// # Errors
///
/// [`RenderError::NeedsPathTracing`] for an aperture, an exposure time or a rolling shutter of a renderer without path
/// tracing.
pub fn check_exposure_optics(
    renderer: Renderer,
    aperture: Option<&Aperture>,
    shutter: Shutter,
) -> Result<(), RenderError> {
    let what = match (aperture, shutter.is_instant()) {
        _ if renderer.is_path_tracing() => return Ok(()),
        (None, true) => return Ok(()),
        (Some(_), _) => "an aperture (depth of field)",
        (None, false) => "an exposure time or a rolling shutter",
    };
    Err(RenderError::NeedsPathTracing { what, renderer: renderer.name() })
}

/// Checks that a renderer supports lenses, and that the rays match the image.
fn check_lens(lens: &LensRays, renderer: Renderer, view: &View, samples: u8) -> Result<(), RenderError> {
    if !renderer.traces_visibility(true) {
        let (lens, renderer) = (lens.optics().lens().name(), renderer.name());
        return Err(RenderError::LensRenderer { lens, renderer });
    }
    let (expected, found) = ([view.width, view.height], lens.size());
    if found != expected || lens.samples() < samples {
        return Err(RenderError::LensRays { expected, samples, found, found_samples: lens.samples() });
    }
    Ok(())
}

/// Texels along the side of a shadow map: as configured, or, for 0, about three texels for two pixels of a square image
/// of the same area, and four times as many for scenes with the rules of MuJoCo's OpenGL renderer.
fn shadow_side(cfg: RasterCfg, view: &View, scene: &RenderScene) -> usize {
    let size = view.width.saturating_mul(view.height).isqrt();
    match cfg.shadow_size {
        0 if scene.opengl.is_some() => (size.min(512) * 6).next_power_of_two().clamp(512, 2048),
        0 => (view.width.saturating_mul(view.height).isqrt().min(1024) * 3 / 2).next_power_of_two().clamp(128, 1024),
        n => n.clamp(64, 8192).next_multiple_of(BLOCK),
    }
}

/// Number of triangles of all meshes; with levels of detail, of the rendered meshes at their levels.
fn triangle_count(cfg: RasterCfg, render_request: &RenderRequest<'_>) -> usize {
    let RenderRequest { scene, poses, view, .. } = *render_request;
    if !cfg.lod {
        return scene.triangle_count();
    }
    let projection = Projection::from(view);
    let shift = largest_shift(scene, &projection);
    let count = |(instance, pose): (&Instance, &PoseF32)| {
        let mesh = instance.mesh().filter(|_| Layer::for_instance(instance, cfg.groups) != Layer::Hidden)?;
        let level = select_level(&projection, instance, &view.world_from_camera.inverse_times(pose), shift);
        Some(mesh.level(usize::from(level)).triangles().len())
    };
    scene.instances().iter().zip(poses).filter_map(count).sum()
}

/// Approximate time of a frame \[ns\]: decides if another thread pays off.
pub(crate) fn estimate_cost_ns(cfg: RasterCfg, render_request: &RenderRequest<'_>, frame: &FrameMut<'_>) -> usize {
    let RenderRequest { scene, view, .. } = *render_request;
    let wants_color = frame.wants(Stage::Color);
    let (pixels, triangles) = (view.width.saturating_mul(view.height), triangle_count(cfg, render_request));
    let shadows = if wants_color && cfg.shadows {
        let texels = shadow_side(cfg, view, scene).pow(2);
        scene.lights.len().min(MAX_SHADOWS) * (2 * texels + 20 * triangles) + 5 * pixels
    } else {
        0
    };
    pixels.saturating_mul(if wants_color { 15 } else { 8 }) + 20 * triangles + shadows
}
