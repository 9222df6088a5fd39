//! Drawing what a camera captured.

use super::{Camera, Canvas, Desk};
use crate::camera::captures::Captures;
use crate::camera::cfg::DepthMiss;
use crate::camera::error::CameraError;
use crate::camera::viewpoints::Viewpoint;
use kinetoscope_render::frame::{FrameMut, Pictures};
use kinetoscope_render::lens::LensRays;
use kinetoscope_render::parallel::{Job, ParallelRasterizer};
use kinetoscope_render::request::Shot;
use kinetoscope_render::shutter::{Opened, Take};
use kinetoscope_render::ticket::Stream;
use kinetoscope_render::visibility::RenderError;
use kinetoscope_scene::{Instance, Marker, Pose, PoseF32, RenderScene};
use ndarray::Array2;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;

impl Camera {
    /// Draws what is stale.
    pub(super) fn draw(&self) -> Canvas {
        let rows = self.viewpoints.len();
        let canvas = self.desk.lock().unwrap_or_else(PoisonError::into_inner).canvas.take();
        // It is missing only where a drawing panicked.
        let mut canvas = canvas.unwrap_or_else(|| {
            Canvas::new(Pictures::new(self.channels, rows, self.lens.width, self.lens.height), rows)
        });
        let Canvas { pictures, stale, failure } = &mut canvas;
        let is_stale = |row: &usize| stale[*row];
        let frames = pictures.frames_mut(rows).enumerate().filter(|(row, _)| is_stale(row)).map(|(_, frame)| frame);
        let stale_rows = (0..rows).filter(is_stale).map(|row| (row, row));
        let look = |row: usize| (self.viewpoints.row(row), self.rays_of(row));
        let result = self.develop(&self.captures, look, stale_rows, frames);
        *failure = result.err().and_then(|(job, error)| {
            let row = (0..rows).filter(is_stale).nth(job)?;
            Some(CameraError::Draw { env: self.env_ids()[row], error })
        });
        // After a failure it is not known which are good.
        if failure.is_none() {
            stale.fill(false);
        }
        canvas
    }

    /// Draws captures, those of some rows at some places, into frames, and does to them what the camera does; `look` says from
    /// where, and through which lens, a place was captured.
    pub(in crate::camera) fn develop<'a>(
        &self,
        captures: &Captures,
        look: impl Fn(usize) -> (&'a Viewpoint, Option<&'a LensRays>),
        places: impl Iterator<Item = (usize, usize)> + Clone,
        frames: impl Iterator<Item = FrameMut<'a>>,
    ) -> Result<(), (usize, RenderError)> {
        let mut desk = self.desk.lock().unwrap_or_else(PoisonError::into_inner);
        let Desk { rasterizer, views, jobs: kept, takes: kept_takes, tickets, faults, .. } = &mut *desk;
        views.clear();
        views.extend(places.clone().map(|(_, place)| {
            let (viewpoint, _) = look(place);
            let pose =
                self.viewpoints.world_from(viewpoint, captures.world_from_parent[place]).unwrap_or_else(Pose::identity);
            self.lens.view(&viewpoint.pixels, PoseF32::from(&pose))
        }));
        tickets.clear();
        let mut jobs: Vec<Job<'_>> = emptied(std::mem::take(kept));
        let mut takes: Vec<Take<'_>> = emptied(std::mem::take(kept_takes));
        let mut marked: Vec<&[Marker]> = Vec::new();
        for (((row, place), frame), view) in places.zip(frames).zip(&*views) {
            let poses = row_of(&captures.poses, place);
            let lights = Some(row_of(&captures.lights, place));
            let scene = captures.scenes[place].0.as_deref().unwrap_or(&self.scene);
            let before = self.earlier.as_ref().and_then(|earlier| earlier.of(row));
            jobs.push((Shot { scene, poses, view, lights, lens: look(place).1, before }, frame));
            tickets.push(captures.tickets[place]);
            if self.draws_markers {
                marked.push(&captures.markers[place]);
            }
            takes.push(self.take_of(captures, place, look(place).0));
        }
        let result = match self.draws_markers && self.channels.color {
            true => render_marked(rasterizer, &mut jobs, &takes, &marked),
            false => rasterizer.render_takes(&mut jobs, &takes),
        };
        *kept_takes = emptied(takes);
        if let Some(faults) = faults {
            faults.spoil(&mut jobs, tickets);
        }
        let miss = match self.depth_miss {
            DepthMiss::Inf => None,
            DepthMiss::Far => Some(self.lens.far),
            DepthMiss::Zero => Some(0.0),
        };
        for (shot, frame) in &mut jobs {
            if self.depth_miss == DepthMiss::Far {
                keep_before(self.lens.far, shot.lens.is_some_and(|rays| !rays.is_forward()), frame);
            }
            miss.into_iter().for_each(|value| frame.replace_misses(value));
        }
        self.draws.fetch_add(jobs.len() as u64, Ordering::Relaxed);
        *kept = emptied(jobs);
        result
    }

    /// What tells the capture of a place from others, seen from a viewpoint.
    fn take_of<'a>(&self, captures: &'a Captures, place: usize, viewpoint: &Viewpoint) -> Take<'a> {
        let opened = captures.opened(place).and_then(|(poses, parent)| {
            let camera = self.viewpoints.world_from(viewpoint, Some(parent))?;
            let before = self.opening.as_ref()?.seconds();
            Some(Opened { poses, world_from_camera: PoseF32::from(&camera), before })
        });
        Take { noise: captures.tickets[place].bits(Stream::PATHS), opened }
    }

    /// Whether rows of its pictures may be of several instants.
    pub(in crate::camera) fn takes_time(&self) -> bool {
        self.opening.is_some()
    }

    /// What there is to draw of a row as it was captured, and what draws it: for whoever needs more than pictures.
    pub(in crate::camera) fn shot_of<T>(
        &self,
        row: usize,
        act: impl FnOnce(&mut ParallelRasterizer, Shot<'_>, Take<'_>) -> T,
    ) -> T {
        let mut desk = self.desk.lock().unwrap_or_else(PoisonError::into_inner);
        let view = &self.view_of(row);
        let scene = self.captures.scenes[row].0.as_deref().unwrap_or(&self.scene);
        let (poses, lights) = (row_of(&self.captures.poses, row), Some(row_of(&self.captures.lights, row)));
        let take = self.take_of(&self.captures, row, self.viewpoints.row(row));
        act(&mut desk.rasterizer, Shot { scene, poses, view, lights, lens: self.rays_of(row), before: None }, take)
    }
}

/// Draws jobs, and the markers of each into its colours and nothing else: the colours with markers are jobs of their own. All
/// are drawn together, so that one that fails costs no other, and none is counted twice.
fn render_marked(
    rasterizer: &mut ParallelRasterizer,
    jobs: &mut [Job<'_>],
    takes: &[Take<'_>],
    markers: &[&[Marker]],
) -> Result<(), (usize, RenderError)> {
    let (mut stages, mut failed) = (Vec::new(), None);
    for (index, ((shot, frame), markers)) in jobs.iter().zip(markers).enumerate() {
        if markers.is_empty() || frame.color.is_none() {
            continue;
        }
        match Stage::of(shot, &takes[index], markers) {
            Ok(stage) => stages.push((index, Some(stage))),
            Err(error) => {
                failed = failed.or(Some((index, error)));
                // Its colour stays as it was, and what else there is to it is drawn.
                stages.push((index, None));
            }
        }
    }
    let shots: Vec<Shot<'_>> = jobs.iter().map(|(shot, _)| *shot).collect();
    let mut all: Vec<Job<'_>> = jobs.iter_mut().map(|(shot, frame)| (*shot, frame.reborrow())).collect();
    let (mut all_takes, mut of) = (takes.to_vec(), (0..shots.len()).collect::<Vec<_>>());
    for (index, stage) in &stages {
        let frame = FrameMut { color: all[*index].1.color.take(), ..FrameMut::default() };
        let Some(Stage { scene, poses, opened }) = stage else { continue };
        let take = takes[*index];
        all.push((Shot { scene, poses, before: None, ..shots[*index] }, frame));
        let opened = take.opened.zip(opened.as_deref()).map(|(opened, poses)| Opened { poses, ..opened });
        all_takes.push(Take { opened, ..take });
        of.push(*index);
    }
    let drawn = rasterizer.render_takes(&mut all, &all_takes).map_err(|(place, error)| (of[place], error));
    let first = drawn.err().into_iter().chain(failed).min_by_key(|(index, _)| *index);
    first.map_or(Ok(()), Err)
}

/// A scene with markers in it.
struct Stage {
    scene: RenderScene,
    poses: Vec<PoseF32>,
    /// Where everything was when the shutter opened: markers stand still.
    opened: Option<Vec<PoseF32>>,
}

impl Stage {
    fn of(shot: &Shot<'_>, take: &Take<'_>, markers: &[Marker]) -> Result<Self, RenderError> {
        let (added, places): (Vec<Instance>, Vec<PoseF32>) = markers.iter().flat_map(Marker::instances).unzip();
        let added = added.into_iter().map(|instance| Instance { group: Marker::GROUP, ..instance });
        let instances = shot.scene.instances().iter().cloned().chain(added).collect();
        // Each of them can be drawn; there may be too many triangles together.
        let scene = shot.scene.with_instances(instances).map_err(|error| RenderError::Markers(error.to_string()))?;
        let with = |poses: &[PoseF32]| poses.iter().chain(&places).copied().collect();
        Ok(Self { scene, poses: with(shot.poses), opened: take.opened.as_ref().map(|opened| with(opened.poses)) })
    }
}

/// Keeps what was hit nearer than the far plane, whose number means that nothing was: noise ends there. What counts to the far
/// plane is depth, or distance where rays go aside.
fn keep_before(far: f32, aside: bool, frame: &mut FrameMut<'_>) {
    let last = far.next_down();
    let reach = frame.distance.as_deref_mut().filter(|_| aside);
    for numbers in frame.depth.as_deref_mut().into_iter().chain(reach) {
        numbers.iter_mut().filter(|number| number.is_finite()).for_each(|number| *number = number.min(last));
    }
}

/// The memory of a list for another list: of the same type, but for what it borrows.
fn emptied<T, U>(mut list: Vec<T>) -> Vec<U> {
    list.clear();
    // Collected in place.
    list.into_iter().filter_map(|_| None).collect()
}

/// A row of an array that the camera allocated itself, in C order.
fn row_of<T>(array: &Array2<T>, row: usize) -> &[T] {
    let width = array.ncols();
    array.as_slice().map_or(&[], |flat| &flat[row * width..(row + 1) * width])
}
