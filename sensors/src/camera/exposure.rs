//! Pictures by path tracing: threads share the rows of one picture at a time.

use super::channel::FrameMut;
use super::lens::LensRays;
use super::rasterizer::{Rasterizer, Shot};
use super::renderer::Renderer;
use crate::crew::Crew;
use crate::resolve::path::Paths;
use crate::resolve::path::film::{Film, develop};
use crate::resolve::path::smooth;
use crate::resolve::plan::Plan;
use crate::visibility::RenderError;
use crate::visibility::raster::tile::BLOCK;

/// Rows of pixels that a thread takes at once: a row of blocks.
const ROWS: usize = BLOCK;

/// Draws a shot with the threads of some rasterizers. The bits do not depend on their number.
pub(super) fn expose(
    crew: &Crew,
    rasterizers: &mut [Rasterizer],
    shot: &Shot<'_>,
    frame: &mut FrameMut<'_>,
) -> Result<(), RenderError> {
    let Some(first) = rasterizers.first_mut() else { return Ok(()) };
    let (mut plan, mut film) = (std::mem::take(&mut first.plan), std::mem::take(&mut first.film));
    let result = plan.prepare(first.style(), shot, frame);
    if result.is_ok() {
        draw(crew, rasterizers, &plan, &mut film, shot, frame);
    }
    if let Some(first) = rasterizers.first_mut() {
        (first.plan, first.film) = (plan, film);
    }
    result
}

/// Draws a prepared shot.
fn draw(
    crew: &Crew,
    rasterizers: &mut [Rasterizer],
    plan: &Plan,
    film: &mut Film,
    shot: &Shot<'_>,
    frame: &mut FrameMut<'_>,
) {
    let (Some(projection), Some(cfg)) = (&plan.projection, rasterizers.first().map(|r| r.cfg)) else { return };
    let Renderer::RayTraced { samples, max_bounces, denoise, seed } = plan.renderer else { return };
    let (width, height) = (projection.width, projection.height);
    // Colours come from paths; all other channels from what the pixels' centres see.
    let color = frame.color.take();
    if frame.channels() != Default::default() {
        let mut rest = frame.reborrow();
        let bands = (0..height).step_by(ROWS).map(move |row| {
            let rows = ROWS.min(height - row);
            (row / BLOCK, rest.split_off_first(width * rows))
        });
        crew.share(rasterizers, bands, |rasterizer, (block, mut frame)| {
            rasterizer.brush.paint(rasterizer.level, plan, shot, &mut frame, block..block + 1);
        });
    }
    let Some(color) = color else { return };
    film.resize([width, height], denoise);
    let forward = shot.lens.is_none_or(LensRays::is_forward);
    let lights = shot.lights.unwrap_or(&shot.scene.lights);
    film.lamps.prepare(shot.scene, lights, cfg.shadows, (projection, forward));
    let (lamps, rows) = film.rows(ROWS);
    let (scene, poses, tracer) = (shot.scene, shot.poses, &plan.tracer);
    let lens = shot.lens;
    let paths = Paths { scene, poses, tracer, projection, lens, samples, max_bounces, seed, lamps };
    crew.share(rasterizers, rows, |rasterizer, mut rows| {
        rows.expose(&paths, denoise, rasterizer.brush.stack());
    });
    let size = width * ROWS;
    if denoise && samples == 1 {
        let Film { pixels, next, guides, .. } = &mut *film;
        let (pixels, guides) = (&*pixels, &*guides);
        crew.share(rasterizers, next.chunks_mut(size).enumerate(), |_, (k, to)| {
            smooth::guess([width, k * ROWS], pixels, guides, to);
        });
        std::mem::swap(&mut film.pixels, &mut film.next);
    }
    for pass in (0..smooth::PASSES).filter(|_| denoise) {
        let Film { pixels, next, guides, .. } = &mut *film;
        let (pixels, guides) = (&*pixels, &*guides);
        crew.share(rasterizers, next.chunks_mut(size).enumerate(), |_, (k, to)| {
            smooth::pass([width, k * ROWS], pass, pixels, guides, to);
        });
        std::mem::swap(&mut film.pixels, &mut film.next);
    }
    let parts = film.pixels.chunks(size).zip(film.guides.chunks(size)).zip(color.chunks_mut(4 * size));
    crew.share(rasterizers, parts, |rasterizer, ((pixels, guides), out)| {
        develop(rasterizer.level, pixels, guides, denoise, out);
    });
    frame.color = Some(color);
}
