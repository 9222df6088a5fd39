//! Path tracing of one frame after the other; threads share the rows of a frame.

use super::image_renderer::ImageRenderer;
use super::lens::LensRays;
use super::renderer::Renderer;
use super::request::RenderRequest;
use super::shutter::{FrameSample, ShutterInterval};
use crate::frame::FrameMut;
use crate::path::accumulator::{Accumulator, tonemap};
use crate::path::camera_rays::{CameraRayGenerator, ThinLens};
use crate::path::denoise;
use crate::path::{ExposureMotion, MisStrategy, PathTracer};
use crate::raster::tile::BLOCK;
use crate::shade::prepared_frame::PreparedFrame;
use crate::trace::motion::Motion;
use crate::visibility::RenderError;
use kinetoscope_exec::ThreadPool;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Rows of pixels per job of a thread: one row of blocks.
const ROWS: usize = BLOCK;

/// A frame whose request is prepared.
struct PathTraceJob<'a> {
    request: &'a RenderRequest<'a>,
    prepared: &'a PreparedFrame,
    /// `None` if the frame shows one instant.
    interval: Option<ShutterInterval<'a>>,
    /// [`FrameSample::noise`].
    noise: u32,
}

/// Renders a path-traced frame on the thread pool, with one rasterizer per thread. The result is bit-identical for any
/// number of threads. Fails for an invalid request, or if canceled.
pub(super) fn path_trace(
    pool: &ThreadPool,
    rasterizers: &mut [ImageRenderer],
    request: &RenderRequest<'_>,
    take: &FrameSample<'_>,
    frame: &mut FrameMut<'_>,
) -> Result<(), RenderError> {
    let Some(first) = rasterizers.first_mut() else { return Ok(()) };
    let (mut plan, mut film) = (std::mem::take(&mut first.prepared), std::mem::take(&mut first.accumulator));
    let ready =
        plan.prepare(first.settings(), request, frame).and_then(|()| first.shutter.exposure_interval(request, take));
    let result = ready.and_then(|interval| {
        if let Some(interval) = interval.filter(|_| frame.color.is_some()) {
            plan.tracer.place(request.scene, request.poses, Some(interval.opened.poses));
        }
        let exposure = PathTraceJob { request, prepared: &plan, interval, noise: take.noise };
        trace_colors(pool, rasterizers, &exposure, &mut film, frame)?;
        render_other_channels(pool, rasterizers, &exposure, frame)?;
        encode_colors(pool, rasterizers, &plan, &film, frame);
        Ok(())
    });
    if let Some(first) = rasterizers.first_mut() {
        (first.prepared, first.accumulator) = (plan, film);
    }
    result
}

/// Traces the paths of a prepared frame, unless it has no color channel; writes nothing into the frame. Fails if
/// canceled.
fn trace_colors(
    pool: &ThreadPool,
    rasterizers: &mut [ImageRenderer],
    exposure: &PathTraceJob<'_>,
    film: &mut Accumulator,
    frame: &FrameMut<'_>,
) -> Result<(), RenderError> {
    let &PathTraceJob { request, prepared, interval, noise } = exposure;
    let (Some(projection), Some(first)) = (&prepared.projection, rasterizers.first()) else { return Ok(()) };
    let Renderer::RayTraced { samples, max_bounces, denoise, seed } = prepared.renderer else { return Ok(()) };
    if frame.color.is_none() {
        return Ok(());
    }
    let (cfg, progress) = (first.cfg, first.progress.clone());
    let (width, height) = (projection.width, projection.height);
    film.resize([width, height], denoise);
    let (tracer, lens) = (&prepared.tracer, request.lens);
    let forward = lens.is_none_or(LensRays::is_forward);
    let lights = request.lights.unwrap_or(&request.scene.lights);
    film.lights.prepare(request.scene, tracer, lights, cfg.shadows, projection, forward);
    let moving = interval.map(|ShutterInterval { opened, clock }| ExposureMotion {
        clock,
        camera: Motion::between(&opened.world_from_camera, &request.view.world_from_camera),
    });
    let camera_rays =
        CameraRayGenerator { projection, lens, thin_lens: first.aperture.as_ref().and_then(ThinLens::from_aperture) };
    let (light_sources, rows) = film.rows(ROWS);
    // A noise number of 0 leaves the seed as it is.
    let seed = seed ^ noise;
    let (scene, motion) = (request.scene, moving.as_ref());
    let paths = PathTracer {
        scene,
        tracer,
        camera_rays,
        motion,
        samples,
        max_bounces,
        seed,
        lights: light_sources,
        strategy: MisStrategy::Both,
    };
    // Not read from the progress object afterwards: another thread may have resumed it meanwhile, with rows missing.
    let canceled = AtomicBool::new(false);
    pool.for_each(rasterizers, rows, |rasterizer, mut rows| {
        let level = rasterizer.scratch.level;
        if !rows.path_trace(level, &paths, denoise, rasterizer.scratch.stack(), &progress) {
            canceled.store(true, Ordering::Relaxed);
        }
    });
    if canceled.into_inner() {
        return Err(RenderError::Canceled { samples: progress.samples(), total: progress.total() });
    }
    let size = width * ROWS;
    if denoise && samples == 1 {
        let Accumulator { pixels, next, guides, .. } = &mut *film;
        let (pixels, guides) = (&*pixels, &*guides);
        pool.for_each(rasterizers, next.chunks_mut(size).enumerate(), |_, (k, to)| {
            denoise::estimate_variance([width, k * ROWS], pixels, guides, to);
        });
        std::mem::swap(&mut film.pixels, &mut film.next);
    }
    for pass in (0..denoise::FILTER_PASSES).filter(|_| denoise) {
        let Accumulator { pixels, next, guides, .. } = &mut *film;
        let (pixels, guides) = (&*pixels, &*guides);
        pool.for_each(rasterizers, next.chunks_mut(size).enumerate(), |_, (k, to)| {
            denoise::filter_pass([width, k * ROWS], pass, prepared.exposure, pixels, guides, to);
        });
        std::mem::swap(&mut film.pixels, &mut film.next);
    }
    Ok(())
}

/// Renders all channels but color, at the pixel centers.
fn render_other_channels(
    pool: &ThreadPool,
    rasterizers: &mut [ImageRenderer],
    exposure: &PathTraceJob<'_>,
    frame: &mut FrameMut<'_>,
) -> Result<(), RenderError> {
    let &PathTraceJob { request, prepared, interval, .. } = exposure;
    let Some(projection) = &prepared.projection else { return Ok(()) };
    let (width, height) = (projection.width, projection.height);
    let color = frame.color.take();
    let mut failure = Ok(());
    if frame.channels() != Default::default() {
        let mut rest = frame.reborrow();
        if let Some(interval) = interval {
            let first = Mutex::new(&mut failure);
            let rows = (0..height).map(move |y| (y, rest.split_off_first(width)));
            pool.for_each(rasterizers, rows, |rasterizer, (y, mut row)| {
                if let Err(error) = rasterizer.render_row(request, &interval, y, &mut row) {
                    **first.lock().unwrap_or_else(PoisonError::into_inner) = Err(error);
                }
            });
        } else {
            let bands = (0..height).step_by(ROWS).map(move |row| {
                let rows = ROWS.min(height - row);
                (row / BLOCK, rest.split_off_first(width * rows))
            });
            pool.for_each(rasterizers, bands, |rasterizer, (block, mut frame)| {
                rasterizer.scratch.render_band(prepared, request, &mut frame, block..block + 1);
            });
        }
    }
    frame.color = color;
    failure
}

/// Converts the traced light to sRGB bytes.
fn encode_colors(
    pool: &ThreadPool,
    rasterizers: &mut [ImageRenderer],
    plan: &PreparedFrame,
    film: &Accumulator,
    frame: &mut FrameMut<'_>,
) {
    let Renderer::RayTraced { denoise, .. } = plan.renderer else { return };
    let Some(color) = frame.color.as_deref_mut() else { return };
    let size = film.width * ROWS;
    let parts = film.pixels.chunks(size).zip(color.chunks_mut(4 * size)).enumerate();
    pool.for_each(rasterizers, parts, |rasterizer, (k, (pixels, out))| {
        let guides = if denoise { &film.guides[k * size..k * size + pixels.len()] } else { &[] };
        tonemap(rasterizer.scratch.level, plan.exposure, plan.tone, pixels, guides, out);
    });
}
