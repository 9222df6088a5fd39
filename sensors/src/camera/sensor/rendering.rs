//! Rendering of captured frames.

use super::Camera;
use crate::camera::cfg::{CameraCfg, DepthMiss};
use crate::camera::error::CameraError;
use crate::camera::frame_buffer::FrameSource;
use crate::camera::noise_model::SensorNoiseModel;
use kinetoscope_render::ParallelRenderer;
use kinetoscope_render::RenderJob;
use kinetoscope_render::frame::{FrameMut, Images};
use kinetoscope_render::{FrameSample, ShutterOpenState};
use kinetoscope_render::{PreviousState, RenderRequest};
use kinetoscope_render::{RenderError, View};
use kinetoscope_render::{RngKey, RngStream};
use kinetoscope_scene::{Instance, Marker, PoseF32, RenderScene};
use std::ops::Range;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;

/// Images with a flag for outdated ones.
#[derive(Debug)]
pub(in crate::camera) struct RenderedImages {
    images: Images,
    /// One flag per image.
    stale: Vec<bool>,
    error: Option<CameraError>,
}

impl RenderedImages {
    /// Allocates `count` images, all of them outdated.
    pub(in crate::camera) fn new(cfg: &CameraCfg, count: usize) -> Self {
        let images = Images::new(cfg.channels, count, cfg.width, cfg.height);
        Self { images, stale: vec![true; count], error: None }
    }

    /// Returns the images, or the error of rendering them.
    pub(in crate::camera) fn images(&self) -> Result<&Images, CameraError> {
        self.error.clone().map_or(Ok(&self.images), Err)
    }

    pub(in crate::camera) fn is_stale(&self, image: usize) -> bool {
        self.stale[image]
    }

    pub(in crate::camera) fn set_stale(&mut self, image: usize, stale: bool) {
        self.stale[image] = stale;
    }

    /// Copies image `from` of `others`, which has `count` images, to image `image`, and marks it as up to date.
    pub(in crate::camera) fn copy(&mut self, image: usize, others: &Images, count: usize, from: usize) {
        self.images.copy_view(self.stale.len(), image, others, count, from);
        self.stale[image] = false;
    }

    /// Shifts a range of images by `by` places. The last ones are dropped, the first ones become outdated.
    pub(in crate::camera) fn move_up(&mut self, images: Range<usize>, by: usize) {
        self.images.shift_views(self.stale.len(), images.clone(), by);
        let stale = &mut self.stale[images];
        stale.rotate_right(by);
        stale[..by].fill(true);
    }

    /// Clears a range of images to zero; they are not outdated then.
    pub(in crate::camera) fn clear(&mut self, images: Range<usize>) {
        self.images.clear_views(self.stale.len(), images.clone());
        self.stale[images].fill(false);
    }
}

/// The rasterizer of a camera, its noise, and buffers that are reused between renders.
#[derive(Debug)]
pub(in crate::camera) struct FrameRenderer {
    rasterizer: ParallelRenderer,
    views: Vec<View>,
    jobs: Vec<RenderJob<'static>>,
    frame_samples: Vec<FrameSample<'static>>,
    rng_keys: Vec<RngKey>,
    /// Noise and imperfections of rendered images.
    noise_model: Option<SensorNoiseModel>,
}

impl FrameRenderer {
    pub(in crate::camera) fn new(rasterizer: ParallelRenderer, noise_model: Option<SensorNoiseModel>) -> Self {
        let (views, jobs, frame_samples, rng_keys) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { rasterizer, views, jobs, frame_samples, rng_keys, noise_model }
    }
}

impl Camera {
    /// Renders the outdated images, each from its `source`. An error is stored with the images.
    ///
    /// # Errors
    ///
    /// [`CameraError::Render`] if rendering was canceled.
    pub(in crate::camera) fn render_stale<'a>(
        &'a self,
        images: &mut RenderedImages,
        source: impl Fn(usize) -> Option<FrameSource<'a>>,
    ) -> Result<(), CameraError> {
        let RenderedImages { images: pictures, stale, error: failure } = images;
        let count = stale.len();
        let outdated = |image: usize| source(image).filter(|_| stale[image]);
        let sources = (0..count).filter_map(outdated);
        let frames = pictures.frames_mut(count).enumerate().filter(|(image, _)| outdated(*image).is_some());
        let result = self.render_frames(sources.clone(), frames.map(|(_, frame)| frame));
        *failure = result.err().and_then(|(job, error)| {
            let row = sources.clone().nth(job)?.row;
            Some(CameraError::Render { env: self.env_ids()[row], error })
        });
        match failure {
            None => stale.fill(false),
            Some(failure) if failure.is_cancelled() => return Err(failure.clone()),
            // It is unknown which images are valid, so all stay outdated.
            Some(_) => {}
        }
        Ok(())
    }

    /// Renders frames into images, with the noise and the imperfections of the camera.
    fn render_frames<'a>(
        &'a self,
        sources: impl Iterator<Item = FrameSource<'a>> + Clone,
        frames: impl Iterator<Item = FrameMut<'a>>,
    ) -> Result<(), (usize, RenderError)> {
        let mut renderer = self.renderer.lock().unwrap_or_else(PoisonError::into_inner);
        let FrameRenderer { rasterizer, views, jobs: kept, frame_samples: kept_takes, rng_keys, noise_model } =
            &mut *renderer;
        views.clear();
        views.extend(sources.clone().map(|source| self.view_from(&source)));
        rng_keys.clear();
        let mut jobs: Vec<RenderJob<'_>> = recycle(std::mem::take(kept));
        let mut takes: Vec<FrameSample<'_>> = recycle(std::mem::take(kept_takes));
        let mut marked: Vec<&[Marker]> = Vec::new();
        for ((source, frame), view) in sources.zip(frames).zip(&*views) {
            jobs.push((self.render_request(&source, view, self.motion.previous_frame(source.row)), frame));
            rng_keys.push(source.frame.rng_key);
            if self.cfg.draw_markers {
                marked.push(&source.frame.markers);
            }
            takes.push(self.frame_sample(&source));
        }
        let result = match self.cfg.draw_markers && self.cfg.channels.color {
            true => render_with_markers(rasterizer, &mut jobs, &takes, &marked),
            false => rasterizer.render_samples(&mut jobs, &takes),
        };
        *kept_takes = recycle(takes);
        if let Some(faults) = noise_model {
            faults.apply(&mut jobs, rng_keys);
        }
        let miss = match self.cfg.depth_miss {
            DepthMiss::Inf => None,
            DepthMiss::Far => Some(self.lens.far),
            DepthMiss::Zero => Some(0.0),
        };
        for (request, frame) in &mut jobs {
            if self.cfg.depth_miss == DepthMiss::Far {
                clamp_hits_below_far(self.lens.far, request.lens.is_some_and(|rays| !rays.is_forward()), frame);
            }
            miss.into_iter().for_each(|value| frame.replace_misses(value));
        }
        self.render_count.fetch_add(jobs.len() as u64, Ordering::Relaxed);
        *kept = recycle(jobs);
        result
    }

    fn render_request<'a>(
        &'a self,
        source: &FrameSource<'a>,
        view: &'a View,
        previous: Option<PreviousState<'a>>,
    ) -> RenderRequest<'a> {
        let FrameSource { frame, rays, .. } = *source;
        let scene = frame.scene.0.as_deref().unwrap_or(&self.scene);
        RenderRequest {
            scene,
            poses: &frame.poses,
            view,
            lights: Some(&frame.lights),
            lens: rays.map(|rays| &**rays),
            previous,
        }
    }

    /// Returns the shutter poses and the path tracing seed of a frame.
    fn frame_sample<'a>(&self, source: &FrameSource<'a>) -> FrameSample<'a> {
        let shutter_open = source.frame.shutter_open_poses().and_then(|(poses, parent)| {
            let camera = self.viewpoints.world_from(source.viewpoint, Some(parent))?;
            let age = self.motion.shutter_seconds()?;
            Some(ShutterOpenState { poses, world_from_camera: PoseF32::from(&camera), age })
        });
        FrameSample { noise: source.frame.rng_key.bits(RngStream::PATHS), shutter_open }
    }

    /// Returns true if the shutter has a nonzero span: image rows may show several instants.
    pub(in crate::camera) fn has_shutter_span(&self) -> bool {
        self.motion.shutter_seconds().is_some()
    }

    /// Calls `act` with the renderer, and with the render request and the frame sample of the shown frame of a row.
    /// Bounding boxes and isolated entities are rendered this way.
    pub(in crate::camera) fn with_render_request<T>(
        &self,
        row: usize,
        act: impl FnOnce(&mut ParallelRenderer, RenderRequest<'_>, FrameSample<'_>) -> T,
    ) -> T {
        let mut renderer = self.renderer.lock().unwrap_or_else(PoisonError::into_inner);
        let source = self.shown_source(row);
        let view = self.view_from(&source);
        act(&mut renderer.rasterizer, self.render_request(&source, &view, None), self.frame_sample(&source))
    }
}

/// Renders jobs, with the markers of each job in its color only. The color images with markers are separate jobs. All
/// jobs are rendered together, so a failing job does not affect others, and each image is counted once.
fn render_with_markers(
    rasterizer: &mut ParallelRenderer,
    jobs: &mut [RenderJob<'_>],
    takes: &[FrameSample<'_>],
    markers: &[&[Marker]],
) -> Result<(), (usize, RenderError)> {
    let (mut stages, mut failed) = (Vec::new(), None);
    for (index, ((request, frame), markers)) in jobs.iter().zip(markers).enumerate() {
        if markers.is_empty() || frame.color.is_none() {
            continue;
        }
        match MarkedScene::of(request, &takes[index], markers) {
            Ok(stage) => stages.push((index, Some(stage))),
            Err(error) => {
                failed = failed.or(Some((index, error)));
                // The color stays unchanged; all other channels are rendered.
                stages.push((index, None));
            }
        }
    }
    let requests: Vec<RenderRequest<'_>> = jobs.iter().map(|(request, _)| *request).collect();
    let mut all: Vec<RenderJob<'_>> = jobs.iter_mut().map(|(request, frame)| (*request, frame.reborrow())).collect();
    let (mut all_takes, mut of) = (takes.to_vec(), (0..requests.len()).collect::<Vec<_>>());
    for (index, stage) in &stages {
        let frame = FrameMut { color: all[*index].1.color.take(), ..FrameMut::default() };
        let Some(MarkedScene { scene, poses, shutter_open_poses }) = stage else { continue };
        let take = takes[*index];
        all.push((RenderRequest { scene, poses, previous: None, ..requests[*index] }, frame));
        let shutter_open = take
            .shutter_open
            .zip(shutter_open_poses.as_deref())
            .map(|(opened, poses)| ShutterOpenState { poses, ..opened });
        all_takes.push(FrameSample { shutter_open, ..take });
        of.push(*index);
    }
    let drawn = rasterizer.render_samples(&mut all, &all_takes).map_err(|(place, error)| (of[place], error));
    let first = drawn.err().into_iter().chain(failed).min_by_key(|(index, _)| *index);
    first.map_or(Ok(()), Err)
}

/// A scene with markers added.
struct MarkedScene {
    scene: RenderScene,
    poses: Vec<PoseF32>,
    /// Poses at shutter opening; markers do not move.
    shutter_open_poses: Option<Vec<PoseF32>>,
}

impl MarkedScene {
    fn of(request: &RenderRequest<'_>, take: &FrameSample<'_>, markers: &[Marker]) -> Result<Self, RenderError> {
        let (added, places): (Vec<Instance>, Vec<PoseF32>) = markers.iter().flat_map(Marker::instances).unzip();
        let added = added.into_iter().map(|instance| Instance { group: Marker::GROUP, ..instance });
        let instances = request.scene.instances().iter().cloned().chain(added).collect();
        // Each marker can be rendered, but the total number of triangles may be too large.
        let scene = request.scene.with_instances(instances).map_err(|error| RenderError::Markers(error.to_string()))?;
        let with = |poses: &[PoseF32]| poses.iter().chain(&places).copied().collect();
        Ok(Self {
            scene,
            poses: with(request.poses),
            shutter_open_poses: take.shutter_open.as_ref().map(|opened| with(opened.poses)),
        })
    }
}

/// Clamps hits below the far plane, whose value means a miss; noise is clamped at the far plane. The clamped quantity
/// is depth, and also distance if rays do not all go forward.
fn clamp_hits_below_far(far: f32, aside: bool, frame: &mut FrameMut<'_>) {
    let last = far.next_down();
    let reach = frame.distance.as_deref_mut().filter(|_| aside);
    for numbers in frame.depth.as_deref_mut().into_iter().chain(reach) {
        numbers.iter_mut().filter(|number| number.is_finite()).for_each(|number| *number = number.min(last));
    }
}

/// Reuses the memory of a vector for a vector of the same type with another lifetime.
fn recycle<T, U>(mut list: Vec<T>) -> Vec<U> {
    list.clear();
    // The in-place `collect` keeps the allocation.
    list.into_iter().filter_map(|_| None).collect()
}
