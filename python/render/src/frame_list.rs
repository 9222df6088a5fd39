//! Frames to render: scenes that Python's `mujoco` updated, and the images of all of them.

use crate::layout::{geom_layout, light_layout};
use crate::model_arrays::ModelArrays;
use crate::panic::catch;
use kinetoscope_look::horizon_haze;
use kinetoscope_look::mjv::{
    Background, DrawFlags, GeomLayout, LightLayout, LineView, MjvCamera, MjvFrame, MjvMemory, MjvObject, MjvReader,
    TextureRule,
};
use kinetoscope_render::frame::FrameMut;
use kinetoscope_render::{ParallelRenderer, RasterCfg, RenderRequest, ToneCurve, View};
use kinetoscope_scene::{Haze, OpenGlRules, Tessellation};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1};
use pyo3::exceptions::{PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::fmt::Display;

/// Frames that are rendered at once, at most: their color images in RGBA are in memory together.
const BLOCK: usize = 64;

/// Largest size of the color images and masks of a block \[bytes\]. A single frame may be larger.
const SCRATCH_BYTES: usize = 64 << 20;

/// Renderer of one model, and the frames that it renders next.
#[pyclass(module = "kinetoscope_render._render")]
pub(crate) struct FrameList {
    reader: MjvReader<ModelArrays>,
    kind: ReaderKind,
    /// Present until the list is dropped.
    renderer: Option<ParallelRenderer>,
    /// Process that started the renderer's threads: a forked process has none of them.
    process: u32,
    cfg: RasterCfg,
    threads: usize,
    frames: Vec<CapturedFrame>,
    rgba: Vec<u8>,
    mask: Vec<i32>,
}

/// All that a reader needs besides the model.
#[derive(Clone, Copy)]
struct ReaderKind {
    geoms: GeomLayout,
    lights: LightLayout,
    textures: TextureRule,
    rules: OpenGlRules,
    decor_casts: bool,
}

impl ReaderKind {
    fn reader(&self, arrays: &Bound<'_, PyDict>) -> PyResult<MjvReader<ModelArrays>> {
        let model = ModelArrays::from_dict(arrays)?;
        model.validate()?;
        let skins = model.skins();
        let reader = MjvReader::new(model, skins, self.geoms, self.lights).map_err(invalid)?;
        Ok(reader
            .with_texture_rule(self.textures)
            .with_opengl_rules(self.rules)
            .with_shadows_of_decor(self.decor_casts))
    }
}

/// A captured frame.
struct CapturedFrame {
    content: MjvFrame,
    view: View,
    effects: Effects,
    /// Meters of depth per meter of the scene, which may be transformed.
    scale: f32,
}

/// Effects that a frame may switch off.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Effects {
    shadows: bool,
    reflections: bool,
}

fn invalid(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Mutable slice of a contiguous array; `None` without an array.
fn slice_of<'a, T: numpy::Element>(array: &'a mut Option<PyReadwriteArray1<'_, T>>) -> PyResult<Option<&'a mut [T]>> {
    array.as_mut().map(|array| array.as_slice_mut().map_err(invalid)).transpose()
}

/// Vertices of skins and flexes: positions and normals of skins, positions, normals and texture coordinates of flexes;
/// then index of the first triangle and number of triangles of each flex. All arrays are flat.
type SoftArrays<'py> = ([PyReadonlyArray1<'py, f32>; 5], [PyReadonlyArray1<'py, i32>; 2]);

/// Rows of `N` numbers of a flat array.
fn rows<'a, const N: usize>(array: &'a PyReadonlyArray1<'_, f32>) -> PyResult<&'a [[f32; N]]> {
    Ok(array.as_slice().map_err(invalid)?.as_chunks().0)
}

/// Background of a frame, from the numbers of its visual options in the order of Python's `scene.py`.
fn background(numbers: [f64; 13], has_skybox: bool) -> Background {
    let [skybox, haze, fog, haze_r, haze_g, haze_b, haze_width, fog_r, fog_g, fog_b, fog_start, fog_end, far] = numbers;
    let skybox = skybox != 0.0 && has_skybox;
    let color = |rgb: [f64; 3]| rgb.map(|c| c as f32);
    let horizon =
        (skybox && haze != 0.0).then(|| horizon_haze(color([haze_r, haze_g, haze_b]), haze_width as f32, far));
    let fog = (fog != 0.0).then(|| Haze {
        color: Some(color([fog_r, fog_g, fog_b])),
        start: fog_start as f32,
        end: fog_end as f32,
    });
    Background { skybox, horizon, fog }
}

#[pymethods]
impl FrameList {
    /// Copies the arrays of a model. `arrays` has the names of `MjModel`; the layouts have the places of fields.
    /// `wraps_textures` is true for versions of MuJoCo whose shapes have texture coordinates. `shadows` are half the side
    /// of the square in which directional lights cast shadows \[m\], and the fraction of the angle in which spots do; decoration
    /// casts shadows if `decor_casts` is true. `quality` has the numbers of slices, stacks and quads of shapes.
    #[new]
    #[expect(clippy::too_many_arguments, reason = "an internal function of the package")]
    fn new(
        arrays: &Bound<'_, PyDict>,
        geom_fields: &Bound<'_, PyDict>,
        light_fields: &Bound<'_, PyDict>,
        threads: usize,
        samples: u8,
        wraps_textures: bool,
        shadows: [f64; 2],
        decor_casts: bool,
        quality: [u16; 3],
    ) -> PyResult<Self> {
        catch(|| {
            let textures = if wraps_textures { TextureRule::Wrapped } else { TextureRule::Projected };
            let [shadow_clip, shadow_scale] = shadows.map(|x| x as f32);
            // The flags are those of each frame.
            let [slices, stacks, quads] = quality;
            let tessellation = Some(Tessellation { slices, stacks, quads });
            let rules = OpenGlRules { shadow_clip, shadow_scale, culls_backs: false, is_additive: false, tessellation };
            let (geoms, lights) = (geom_layout(geom_fields)?, light_layout(light_fields)?);
            let kind = ReaderKind { geoms, lights, textures, rules, decor_casts };
            let reader = kind.reader(arrays)?;
            let cfg = RasterCfg { samples, tone: ToneCurve::Clip, groups: u32::MAX, ..RasterCfg::default() };
            let renderer = Some(ParallelRenderer::new(cfg, threads));
            let process = std::process::id();
            let (frames, rgba, mask) = (Vec::new(), Vec::new(), Vec::new());
            Ok(Self { reader, kind, renderer, process, cfg, threads, frames, rgba, mask })
        })
    }

    /// Copies the arrays of the model again. Captured frames stay as they are.
    fn reload(&mut self, arrays: &Bound<'_, PyDict>) -> PyResult<()> {
        catch(|| {
            self.reader = self.kind.reader(arrays)?;
            Ok(())
        })
    }

    /// Messages about elements that are not rendered.
    fn omitted(&self) -> Vec<String> {
        self.reader.omitted().to_vec()
    }

    /// Number of captured frames.
    fn __len__(&self) -> usize {
        self.frames.len()
    }

    /// Forgets the captured frames.
    fn clear(&mut self) {
        self.frames.clear();
    }

    /// Captures a scene: the memory of its geoms (N, stride) and lights (L, stride), its camera (position, forward, up,
    /// center, half width, bottom, top, near, far, 1 if it is orthographic, width of lines \[pixels\]), its visual
    /// options, its flags (shadows, reflections, culled backs, added transparent geoms, wireframe), the size of the image
    /// (width, height) \[pixels\], the meters of depth and of the attenuation of lights per meter of all other lengths, and
    /// the vertices of its skins and flexes.
    #[pyo3(signature = (geoms, lights, camera, options, effects, size, scale=1.0, soft=None))]
    #[expect(clippy::too_many_arguments, reason = "an internal function of the package")]
    fn capture(
        &mut self,
        geoms: PyReadonlyArray2<'_, u8>,
        lights: PyReadonlyArray2<'_, u8>,
        camera: [f64; 17],
        options: [f64; 13],
        effects: [bool; 5],
        size: [usize; 2],
        scale: f32,
        soft: Option<SoftArrays<'_>>,
    ) -> PyResult<()> {
        catch(|| {
            let [px, py, pz, fx, fy, fz, ux, uy, uz, center, half_width, bottom, top, near, far, parallel, line] =
                camera;
            let parallel = parallel != 0.0;
            let camera = MjvCamera {
                orthographic: parallel,
                position: [px, py, pz],
                forward: [fx, fy, fz],
                up: [ux, uy, uz],
                center,
                half_width,
                bottom,
                top,
                near,
                far,
            };
            let [width, height] = size;
            let [fx, fy, cx, cy] = camera.intrinsics(width, height).map_err(invalid)?;
            let world_from_camera = camera.world_from_camera().map_err(invalid)?;
            let (near, far) = (near as f32, far as f32);
            let view = View { parallel, width, height, fx, fy, cx, cy, near, far, world_from_camera };
            view.validate().map_err(invalid)?;
            let background = background(options, self.reader.has_skybox());
            let (geoms, lights) = (geoms.as_slice().map_err(invalid)?, lights.as_slice().map_err(invalid)?);
            let forward = camera.forward.map(|x| x as f32);
            let lines = LineView {
                position: world_from_camera.translation,
                forward: world_from_camera.rotation.map(|row| row[2]),
                width: line as f32 / fy,
                near,
                far,
                parallel,
            };
            let [shadows, reflections, culls_backs, is_additive, is_wireframe] = effects;
            let flags = DrawFlags { culls_backs, is_additive, is_wireframe };
            let mut memory = MjvMemory { geoms, lights, forward, flags, lines: Some(lines), ..MjvMemory::default() };
            if let Some((floats, integers)) = &soft {
                let [skin_positions, skin_normals, flex_positions, flex_normals, flex_texcoords] = floats;
                let [first_faces, faces] = integers;
                memory = MjvMemory {
                    skin_positions: rows(skin_positions)?,
                    skin_normals: rows(skin_normals)?,
                    flex_positions: rows(flex_positions)?,
                    flex_normals: rows(flex_normals)?,
                    flex_texcoords: rows(flex_texcoords)?,
                    flex_first_faces: first_faces.as_slice().map_err(invalid)?,
                    flex_faces: faces.as_slice().map_err(invalid)?,
                    ..memory
                };
            }
            let mut content = self.reader.read(&memory, background).map_err(invalid)?;
            for light in &mut content.lights {
                let [constant, linear, quadratic] = light.attenuation;
                light.attenuation = [constant, linear * scale, quadratic * scale * scale];
            }
            self.frames.push(CapturedFrame { content, view, effects: Effects { shadows, reflections }, scale });
            Ok(())
        })
    }

    /// Renders all captured frames into flat arrays: RGB bytes, depth \[m\], pairs of object id and object type,
    /// segmentation ids (-1 in the background), normals. The frames must have one size. Depth and normals show geoms
    /// without a segmentation id only with `surfaces_of_color`. The interpreter runs other threads meanwhile.
    #[pyo3(signature = (rgb=None, depth=None, segmentation=None, segments=None, normal=None, surfaces_of_color=false))]
    #[expect(clippy::too_many_arguments, reason = "an internal function of the package")]
    fn render(
        &mut self,
        py: Python<'_>,
        mut rgb: Option<PyReadwriteArray1<'_, u8>>,
        mut depth: Option<PyReadwriteArray1<'_, f32>>,
        mut segmentation: Option<PyReadwriteArray1<'_, i32>>,
        mut segments: Option<PyReadwriteArray1<'_, i32>>,
        mut normal: Option<PyReadwriteArray1<'_, f32>>,
        surfaces_of_color: bool,
    ) -> PyResult<()> {
        let mut images = Images {
            rgb: slice_of(&mut rgb)?,
            depth: slice_of(&mut depth)?,
            segmentation: slice_of(&mut segmentation)?,
            segments: slice_of(&mut segments)?,
            normal: slice_of(&mut normal)?,
            surfaces_of_color,
        };
        py.detach(|| catch(|| self.render_frames(&mut images)))
    }
}

/// Images of all frames, one after the other; `None` for images that are not wanted.
struct Images<'a> {
    rgb: Option<&'a mut [u8]>,
    depth: Option<&'a mut [f32]>,
    segmentation: Option<&'a mut [i32]>,
    segments: Option<&'a mut [i32]>,
    normal: Option<&'a mut [f32]>,
    /// True if depth and normals show geoms without a segmentation id too, like color.
    surfaces_of_color: bool,
}

impl Images<'_> {
    /// True if the renderer's masks are needed.
    fn need_masks(&self) -> bool {
        self.segmentation.is_some() || self.segments.is_some()
    }

    /// Checks the lengths for `pixels` pixels.
    fn validate(&self, pixels: usize) -> PyResult<()> {
        let lengths = [
            ("rgb", self.rgb.as_ref().map(|image| image.len()), 3),
            ("depth", self.depth.as_ref().map(|image| image.len()), 1),
            ("segmentation", self.segmentation.as_ref().map(|image| image.len()), 2),
            ("segments", self.segments.as_ref().map(|image| image.len()), 1),
            ("normal", self.normal.as_ref().map(|image| image.len()), 3),
        ];
        for (name, length, components) in lengths {
            if let Some(length) = length.filter(|&length| length != components * pixels) {
                let expected = components * pixels;
                return Err(PyValueError::new_err(format!(
                    "the array of {name} has {length} numbers; {pixels} pixels need {expected}"
                )));
            }
        }
        Ok(())
    }
}

/// Lengthens scratch memory to `length` elements.
///
/// # Errors
/// `MemoryError` if there is not enough memory.
fn grow<T: Clone + Default>(scratch: &mut Vec<T>, length: usize) -> PyResult<()> {
    let missing = length.saturating_sub(scratch.len());
    scratch.try_reserve_exact(missing).map_err(|_| {
        let megabytes = length.saturating_mul(size_of::<T>()) >> 20;
        PyMemoryError::new_err(format!("no memory for images of {megabytes} MiB"))
    })?;
    scratch.resize(scratch.len() + missing, T::default());
    Ok(())
}

/// Copies the colors of pixels without their opacity.
fn drop_opacity(rgba: &[u8], rgb: &mut [u8]) {
    // Four pixels at a time: byte by byte, it takes several times as long.
    let (fours, rest) = rgba.as_chunks::<16>();
    let (to_fours, to_rest) = rgb.as_chunks_mut::<12>();
    for (to, from) in to_fours.iter_mut().zip(fours) {
        let from = u128::from_le_bytes(*from);
        let color = |k: u32| from >> (32 * k) & 0xff_ffff;
        let colors = color(0) | color(1) << 24 | color(2) << 48 | color(3) << 72;
        to.copy_from_slice(&colors.to_le_bytes()[..12]);
    }
    for (to, &[r, g, b, _]) in to_rest.as_chunks_mut::<3>().0.iter_mut().zip(rest.as_chunks::<4>().0) {
        *to = [r, g, b];
    }
}

/// Part of a slice of images with `each` numbers per frame: the images of the frames `first..first + count`.
fn part<'a, T>(
    all: &'a mut Option<&mut [T]>,
    [first, count]: [usize; 2],
    each: usize,
) -> Option<std::slice::ChunksExactMut<'a, T>> {
    all.as_mut().map(|all| all[first * each..(first + count) * each].chunks_exact_mut(each))
}

impl Drop for FrameList {
    fn drop(&mut self) {
        self.forget_threads_of_parent();
    }
}

impl FrameList {
    fn render_frames(&mut self, images: &mut Images<'_>) -> PyResult<()> {
        let Some(first) = self.frames.first() else {
            return Err(PyRuntimeError::new_err("there is nothing to render: call update_scene first"));
        };
        let [width, height] = [first.view.width, first.view.height];
        if self.frames.iter().any(|frame| [frame.view.width, frame.view.height] != [width, height]) {
            return Err(PyValueError::new_err("all frames must have one size"));
        }
        images.validate(self.frames.len() * width * height)?;
        if self.process != std::process::id() {
            self.forget_threads_of_parent();
            self.renderer = Some(ParallelRenderer::new(self.cfg, self.threads));
            self.process = std::process::id();
        }
        let mut start = 0;
        while start < self.frames.len() {
            // Effects are options of the renderer, so the frames of a block agree on them.
            let effects = self.frames[start].effects;
            let block = (SCRATCH_BYTES / (4 * width * height)).clamp(1, BLOCK);
            let count = self.frames[start..].iter().take(block).take_while(|frame| frame.effects == effects).count();
            self.render_block([start, count], effects, images)?;
            start += count;
        }
        if self.rgba.capacity() > SCRATCH_BYTES {
            self.rgba = Vec::new();
        }
        if self.mask.capacity() > SCRATCH_BYTES / 4 {
            self.mask = Vec::new();
        }
        Ok(())
    }

    /// Leaves the threads of the renderer alone if they belong to the parent process: they do not exist here, so that
    /// waiting for their end would take forever.
    fn forget_threads_of_parent(&mut self) {
        if self.process != std::process::id() {
            std::mem::forget(self.renderer.take());
        }
    }

    fn render_block(&mut self, range: [usize; 2], effects: Effects, images: &mut Images<'_>) -> PyResult<()> {
        let Self { renderer: Some(renderer), frames, rgba, mask, cfg, .. } = self else {
            return Err(PyRuntimeError::new_err("the renderer has no threads"));
        };
        let [start, count] = range;
        let frames = &frames[start..start + count];
        let pixels = frames.first().map_or(0, |frame| frame.view.width * frame.view.height);
        renderer.set_cfg(RasterCfg { shadows: effects.shadows, reflections: effects.reflections, ..*cfg });
        let failure = |(index, error): (usize, kinetoscope_render::RenderError)| {
            PyValueError::new_err(format!("frame {}: {error}", start + index))
        };
        let surfaces = images.depth.is_some() || images.normal.is_some();
        // Geoms without a segmentation id are visible in color only.
        let split = frames.iter().any(|frame| frame.content.segment_scene.is_some());
        if images.rgb.is_some() {
            grow(rgba, 4 * pixels * count)?;
        }
        if images.need_masks() {
            grow(mask, pixels * count)?;
        }
        for pass in 0..if split { 2 } else { 1 } {
            let (with_color, with_geometry) = if split { (pass == 0, pass == 1) } else { (true, true) };
            let with_color = with_color && images.rgb.is_some();
            let with_masks = with_geometry && images.need_masks();
            // Surfaces are those of the scene of masks, unless those of color are asked for.
            let with_surfaces = surfaces && if images.surfaces_of_color { pass == 0 } else { with_geometry };
            if !with_color && !with_masks && !with_surfaces {
                continue;
            }
            let mut colors = with_color.then(|| rgba[..4 * pixels * count].chunks_exact_mut(4 * pixels));
            let mut masks = with_masks.then(|| mask[..pixels * count].chunks_exact_mut(pixels));
            let mut depths = if with_surfaces { part(&mut images.depth, range, pixels) } else { None };
            let mut normals = if with_surfaces { part(&mut images.normal, range, 3 * pixels) } else { None };
            let mut jobs: Vec<_> = frames
                .iter()
                .map(|frame| {
                    let scene = if split && pass == 1 { frame.content.segment_scene() } else { &*frame.content.scene };
                    let request = RenderRequest {
                        scene,
                        poses: &frame.content.poses,
                        view: &frame.view,
                        lights: Some(&frame.content.lights),
                        lens: None,
                        previous: None,
                    };
                    let buffers = FrameMut {
                        color: colors.as_mut().and_then(Iterator::next),
                        mask: masks.as_mut().and_then(Iterator::next),
                        depth: depths.as_mut().and_then(Iterator::next),
                        normal: normals.as_mut().and_then(Iterator::next),
                        ..FrameMut::default()
                    };
                    (request, buffers)
                })
                .collect();
            renderer.render(&mut jobs).map_err(failure)?;
            for (frame, (_, buffers)) in frames.iter().zip(&mut jobs) {
                buffers.replace_misses(frame.view.far);
                if frame.scale != 1.0 {
                    buffers.depth.iter_mut().flat_map(|depth| depth.iter_mut()).for_each(|depth| *depth *= frame.scale);
                }
            }
        }
        if let Some(rgb) = &mut images.rgb {
            drop_opacity(&rgba[..4 * pixels * count], &mut rgb[3 * pixels * start..3 * pixels * (start + count)]);
        }
        if images.need_masks() {
            let mut pairs = part(&mut images.segmentation, range, 2 * pixels);
            let mut segments = part(&mut images.segments, range, pixels);
            for (frame, mask) in frames.iter().zip(mask.chunks_exact(pixels)) {
                let objects = &frame.content.objects;
                let object = |&id: &i32| usize::try_from(id).ok().and_then(|id| objects.get(id).copied());
                let objects = mask.iter().map(|id| object(id).unwrap_or(MjvObject::NONE));
                if let Some(pairs) = pairs.as_mut().and_then(Iterator::next) {
                    for (to, MjvObject { id, kind, .. }) in pairs.as_chunks_mut::<2>().0.iter_mut().zip(objects.clone())
                    {
                        *to = [id, kind];
                    }
                }
                if let Some(segments) = segments.as_mut().and_then(Iterator::next) {
                    for (to, object) in segments.iter_mut().zip(objects) {
                        *to = object.segment;
                    }
                }
            }
        }
        Ok(())
    }
}
