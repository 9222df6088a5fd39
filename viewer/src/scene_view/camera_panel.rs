//! Live images of a camera sensor: color, depth, mask and normals in a 2 x 2 grid.

use super::canvas::Canvas;
use super::merged_scene::MARKER_GROUP;
use super::snapshot::Snapshot;
use embedded_graphics::mono_font::ascii::FONT_6X10;
use kinetoscope_render::View;
use kinetoscope_render::frame::{Channels, Frame, FrameMut};
use kinetoscope_render::lens::{Lens, LensRays, Optics};
use kinetoscope_render::{ParallelRenderer, PixelIntrinsics, RasterCfg, RenderRequest, Renderer};
use kinetoscope_scene::{Instance, Marker, PoseF32, RenderScene};
use kinetoscope_sensors::camera::colormap::{depth_color, mask_color, normal_color};

/// Renders the images of camera sensors from snapshots, without triggering the sensors. The pose and lens are those of
/// the last measurement; everything else is current. With a bending lens, images are ray traced. Markers of other
/// sensors appear in the color image of cameras that draw them.
#[derive(Debug)]
pub(crate) struct CameraPanel {
    rasterizer: ParallelRenderer,
    frame: Frame,
    size: [usize; 2],
    /// Rays of the most recently used lens.
    rays: Option<LensRays>,
}

/// Rasterizer settings of the panel.
fn cfg() -> RasterCfg {
    RasterCfg { samples: 1, ..RasterCfg::default() }
}

impl CameraPanel {
    /// Creates a panel with `threads` rendering threads.
    pub(crate) fn new(threads: usize) -> Self {
        let rasterizer = ParallelRenderer::new(cfg(), threads);
        Self { rasterizer, frame: Frame::default(), size: [0; 2], rays: None }
    }

    /// Renders camera `camera` in environment `env` as a grid of images, each at most `width` pixels wide. Returns
    /// `false` and leaves the canvas unchanged if the camera has no view of the environment, or if rendering fails.
    pub(crate) fn draw(
        &mut self,
        snapshot: &Snapshot,
        camera: usize,
        env: usize,
        width: usize,
        canvas: &mut Canvas,
    ) -> bool {
        let Some(stage) = snapshot.envs.get(env) else { return false };
        let camera_view = stage.views.get(camera).and_then(Option::as_ref);
        let Some((looks, scene)) = camera_view.zip(snapshot.env_scene(stage)) else {
            return false;
        };
        let view = downscaled(&looks.view, width);
        let size = [view.width, view.height];
        if self.size != size || self.frame.color.is_none() {
            let channels = Channels { color: true, depth: true, mask: true, normal: true, ..Channels::default() };
            (self.frame, self.size) = (Frame::new(size[0], size[1], channels), size);
        }
        let has_distortion = !looks.lens.is_pinhole();
        if has_distortion && !self.update_rays(looks.lens, &view) {
            return false;
        }
        self.rasterizer.set_renderer(if has_distortion { Renderer::FastRayTraced } else { Renderer::Raster });
        self.rasterizer.set_cfg(cfg());
        let (poses, lights) = (stage.snapshot.instances.as_slice(), Some(stage.snapshot.lights.as_slice()));
        let lens = self.rays.as_ref().filter(|_| has_distortion);
        let request = RenderRequest { scene: &scene, poses, view: &view, lights, lens, previous: None };
        if self.rasterizer.render(&mut [(request, self.frame.as_mut())]).is_err() {
            return false;
        }
        if let Some((scene, poses)) = with_markers(&scene, poses, &looks.markers) {
            self.rasterizer.set_cfg(RasterCfg { groups: cfg().groups | 1 << MARKER_GROUP, ..cfg() });
            let request = RenderRequest { scene: &scene, poses: &poses, ..request };
            let frame = FrameMut { color: self.frame.color.as_deref_mut(), ..FrameMut::default() };
            if self.rasterizer.render(&mut [(request, frame)]).is_err() {
                return false;
            }
        }
        canvas.resize(2 * size[0], 2 * size[1]);
        self.draw_grid(canvas);
        true
    }

    /// Computes the rays of a lens for these pixels, unless they are cached. Returns `false` if the lens or its rays
    /// are invalid at this resolution.
    fn update_rays(&mut self, lens: Lens, view: &View) -> bool {
        let [fx, fy, cx, cy] = [view.fx, view.fy, view.cx, view.cy].map(f64::from);
        let Ok(optics) = Optics::new(lens, PixelIntrinsics { fx, fy, cx, cy }) else { return false };
        let size = [view.width, view.height];
        if !self.rays.as_ref().is_some_and(|rays| *rays.optics() == optics && rays.size() == size) {
            self.rays = LensRays::new(&optics, size, 1).ok();
        }
        self.rays.is_some()
    }

    fn draw_grid(&self, canvas: &mut Canvas) {
        let Frame { color: Some(color), depth: Some(depth), mask: Some(mask), normal: Some(normal), .. } = &self.frame
        else {
            return;
        };
        let [width, height] = self.size;
        let finite = depth.iter().copied().filter(|d| d.is_finite());
        let range = finite.fold([f32::MAX, f32::MIN], |[low, high], d| [low.min(d), high.max(d)]);
        let of: [(&str, PixelColor<'_>); 4] = [
            ("Color", &|k| [color[4 * k], color[4 * k + 1], color[4 * k + 2]]),
            ("Depth", &|k| depth_color(depth[k], range)),
            ("Mask", &|k| mask_color(mask[k])),
            ("Normals", &|k| normal_color([normal[3 * k], normal[3 * k + 1], normal[3 * k + 2]])),
        ];
        for (index, (title, pixel)) in of.into_iter().enumerate() {
            let [left, top] = [index % 2 * width, index / 2 * height];
            let bytes = canvas.bytes_mut();
            for row in 0..height {
                let line = &mut bytes[4 * ((top + row) * 2 * width + left)..][..4 * width];
                for (column, to) in line.chunks_exact_mut(4).enumerate() {
                    to[..3].copy_from_slice(&pixel(row * width + column));
                }
            }
            canvas.text(title, [left as i32 + 4, top as i32 + 3], &FONT_6X10, [240; 3]);
        }
    }
}

/// Adds markers to the instances and poses of a scene; `None` if there are no markers or too many triangles.
fn with_markers(scene: &RenderScene, poses: &[PoseF32], markers: &[Marker]) -> Option<(RenderScene, Vec<PoseF32>)> {
    let (added, places): (Vec<Instance>, Vec<PoseF32>) = markers.iter().flat_map(Marker::instances).unzip();
    if added.is_empty() {
        return None;
    }
    let added = added.into_iter().map(|instance| Instance { group: MARKER_GROUP, ..instance });
    let instances = scene.instances().iter().cloned().chain(added).collect();
    // The triangle count of all instances may exceed the limit.
    let scene = scene.with_instances(instances).ok()?;
    Some((scene, poses.iter().copied().chain(places).collect()))
}

/// Returns the color of a pixel, by its index.
type PixelColor<'a> = &'a dyn Fn(usize) -> [u8; 3];

/// Scales a view down to at most `width` pixels per row.
fn downscaled(view: &View, width: usize) -> View {
    let scale = (width.max(1) as f32 / view.width as f32).min(1.0);
    let side = |n: usize| ((n as f32 * scale).round() as usize).max(1);
    let (width, height) = (side(view.width), side(view.height));
    let [sx, sy] = [width as f32 / view.width as f32, height as f32 / view.height as f32];
    View { width, height, fx: view.fx * sx, fy: view.fy * sy, cx: view.cx * sx, cy: view.cy * sy, ..*view }
}
