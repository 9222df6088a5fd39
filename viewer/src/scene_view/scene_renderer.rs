//! Renders snapshots on the thread of the viewer.

use super::canvas::Canvas;
use super::color;
use super::merged_scene::{MARKER_GROUP, MergedScene, shown_envs};
use super::overlay::{Overlays, in_overview};
use super::pick::Selection;
use super::snapshot::{EnvSelection, Snapshot};
use super::trail::Trails;
use kinetoscope_render::frame::FrameMut;
use kinetoscope_render::{ParallelRenderer, RasterCfg, RenderRequest};
use kinetoscope_render::{RenderError, View};
use kinetoscope_scene::vector::sub;
use kinetoscope_scene::{Light, Marker};

/// Radius of the marker at a selected point \[pixels\].
const SELECTION_RADIUS: f32 = 4.0;

/// Renders images of snapshots. It reuses its buffers, so one instance should serve all images of a window.
#[derive(Debug)]
pub(crate) struct SceneRenderer {
    rasterizer: ParallelRenderer,
    cfg: RasterCfg,
    assembly: MergedScene,
    /// Lights of the last image, in the overview.
    lights: Vec<Light>,
}

/// Environments and overlays to draw: geom groups, markers, the selected point, trails, the mouse spring.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ViewOptions<'a> {
    /// Environments in the image.
    pub(crate) envs: EnvSelection,
    /// Enabled overlays and geom groups.
    pub(crate) overlays: Overlays,
    /// Selected point, shown as a ball, with the frame of its body.
    pub(crate) selection: Option<&'a Selection>,
    /// Trails of bodies; drawn only if [`Overlays::trails`] is enabled.
    pub(crate) trails: Option<&'a Trails>,
    /// Mouse spring: its environment and its two ends in the environment frame \[m\].
    pub(crate) spring: Option<(usize, [[f64; 3]; 2])>,
}

impl SceneRenderer {
    /// Creates a renderer with `threads` threads and four samples per pixel.
    pub(crate) fn new(threads: usize) -> Self {
        let cfg = RasterCfg::default();
        Self {
            rasterizer: ParallelRenderer::new(cfg, threads),
            cfg,
            assembly: MergedScene::default(),
            lights: Vec::new(),
        }
    }

    /// Limits the number of threads for the next images, from one to the number of [`new`](Self::new).
    pub(crate) fn set_max_threads(&mut self, most: usize) {
        self.rasterizer.use_threads(most);
    }

    /// Number of samples per pixel.
    pub(crate) fn samples(&self) -> u8 {
        self.cfg.samples
    }

    /// Sets the number of samples per pixel, 1 or 4, for the next images.
    pub(crate) fn set_samples(&mut self, samples: u8) {
        self.cfg.samples = samples;
    }

    /// Renders a snapshot through `view`, whose pose is in the frame of the overview. A single environment stays at its
    /// place in the overview. All environments have the lights of the first one in the image. The canvas is resized to
    /// the view. If all instances together have too many triangles, only trails and overlays are drawn on top of it.
    ///
    /// # Errors
    /// The view is invalid, or the renderer failed.
    pub(crate) fn draw(
        &mut self,
        snapshot: &Snapshot,
        view: &View,
        look: &ViewOptions<'_>,
        canvas: &mut Canvas,
    ) -> Result<(), RenderError> {
        canvas.resize(view.width, view.height);
        let mut markers = look.overlays.markers(snapshot, look.envs);
        if let Some((picked, pose)) = look.selection.and_then(|picked| Some((picked, picked.pose(snapshot)?))) {
            markers.push((picked.env, Marker::axes(pose, 0.12)));
        }
        if let Some((picked, env)) = look.selection.and_then(|picked| Some((picked, snapshot.envs.get(picked.env)?))) {
            // The marker is visible even if the frame of the body is inside of the body.
            let point = picked.current_point(snapshot);
            let [.., depth] = view.world_from_camera.apply_inverse(in_overview(env, point).map(|x| x as f32));
            let ball = Marker::sphere(point, SELECTION_RADIUS * depth / view.fx, color::SELECTION);
            markers.extend((depth > view.near).then_some((picked.env, ball)));
        }
        if let Some((env, [from, to])) = look.spring {
            markers.extend(Marker::arrow(from, sub(to, from), color::SELECTION).map(|marker| (env, marker)));
        }
        self.assembly.update(snapshot, look.envs, &markers);
        // The lights of the first environment, where its bodies are.
        let lights = shown_envs(snapshot, look.envs).next().map(|(_, env)| {
            self.lights.clear();
            self.lights.extend(env.snapshot.lights.iter().map(|light| Light {
                position: std::array::from_fn(|k| light.position[k] + env.origin[k] as f32),
                ..*light
            }));
            self.lights.as_slice()
        });
        if let Some(scene) = &self.assembly.scene {
            let groups = look.overlays.geom_groups() | 1 << MARKER_GROUP;
            self.rasterizer.set_cfg(RasterCfg { groups, ..self.cfg });
            let request =
                RenderRequest { scene, poses: &self.assembly.poses, view, lights, lens: None, previous: None };
            let frame = FrameMut { color: Some(canvas.bytes_mut()), ..FrameMut::default() };
            self.rasterizer.render(&mut [(request, frame)]).map_err(|(_, error)| error)?;
        }
        if let Some(trails) = look.trails.filter(|_| look.overlays.trails) {
            trails.draw(snapshot, look.envs, view, canvas);
        }
        look.overlays.draw_on_top(snapshot, look.envs, view, canvas);
        Ok(())
    }

    /// Returns the object at a pixel, or `None` for the sky. Markers and geom groups that are not drawn are ignored.
    pub(crate) fn pick(
        &mut self,
        snapshot: &Snapshot,
        view: &View,
        look: &ViewOptions<'_>,
        [x, y]: [f64; 2],
    ) -> Option<Selection> {
        self.assembly.update(snapshot, look.envs, &[]);
        let scene = self.assembly.scene.as_ref()?;
        // A view of this single pixel, with the same rays.
        let (column, row) = (x.floor() as f32, y.floor() as f32);
        let pixel = View { width: 1, height: 1, cx: view.cx - column, cy: view.cy - row, ..*view };
        let (mut mask, mut position) = ([0], [0.0; 3]);
        let frame = FrameMut { mask: Some(&mut mask), position: Some(&mut position), ..FrameMut::default() };
        // A single pixel costs nothing, so full detail is used.
        self.rasterizer.set_cfg(RasterCfg { groups: look.overlays.geom_groups(), lod: false, ..self.cfg });
        let request = RenderRequest {
            scene,
            poses: &self.assembly.poses,
            view: &pixel,
            lights: None,
            lens: None,
            previous: None,
        };
        self.rasterizer.render(&mut [(request, frame)]).ok()?;
        let &(env, instance) = self.assembly.instance_sources.get(usize::try_from(mask[0] - 1).ok()?)?;
        Selection::new(snapshot, env, instance, position)
    }
}
