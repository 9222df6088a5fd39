//! Draws many frames on several threads.

use super::aperture::Aperture;
use super::exposure::expose;
use super::progress::RenderProgress;
use super::rasterizer::Rasterizer;
use super::renderer::Renderer;
use super::request::{RasterCfg, Shot};
use super::shutter::{Shutter, Take};
use crate::frame::FrameMut;
use crate::geometry::assets::RayAssets;
use crate::raster::tile::BLOCK;
use crate::shade::plan::{Plan, estimate};
use crate::visibility::RenderError;
use kinetoscope_exec::ThreadPool;
use std::sync::{Mutex, PoisonError};

/// Less work than this is drawn on the calling thread: waking or starting another takes up to 0.05 ms \[ns\].
const WORTH_A_THREAD: usize = 1_000_000;
/// Parts that each thread gets, about: the last ones decide how long the others wait.
const PARTS: usize = 8;

/// A shot and where its images go.
pub type Job<'a> = (Shot<'a>, FrameMut<'a>);

/// Draws batches of frames on several threads; keeps the scratch memory of each. The bits do not depend on the number of
/// threads.
///
/// Where there are many shots, each is drawn by one thread. The last ones, that would leave threads without work, are
/// drawn together: first what is drawn where, then their shadow maps in parts, then bands of the images.
#[derive(Debug)]
pub struct ParallelRasterizer {
    rasterizers: Vec<Rasterizer>,
    /// How many of them work.
    working: usize,
    plans: Vec<Plan>,
    pool: ThreadPool,
    progress: RenderProgress,
}

/// Draws as the other does, and counts its own progress.
impl Clone for ParallelRasterizer {
    fn clone(&self) -> Self {
        let mut clone = Self {
            rasterizers: self.rasterizers.clone(),
            working: self.working,
            plans: self.plans.clone(),
            pool: self.pool.clone(),
            progress: RenderProgress::default(),
        };
        clone.share_progress();
        clone
    }
}

impl ParallelRasterizer {
    /// A rasterizer for each of `threads` threads, the calling one included; 0 counts as 1. The others start with each
    /// batch and end with it: see [`with_pool`](Self::with_pool).
    pub fn new(cfg: RasterCfg, threads: usize) -> Self {
        let (working, rasterizers) = (threads.max(1), vec![Rasterizer::new(cfg); threads.max(1)]);
        let (pool, progress) = (ThreadPool::new(), RenderProgress::default());
        let mut all = Self { rasterizers, working, plans: Vec::new(), pool, progress };
        all.share_progress();
        all
    }

    /// All threads count together.
    fn share_progress(&mut self) {
        for rasterizer in &mut self.rasterizers {
            rasterizer.progress = self.progress.clone();
        }
    }

    /// Draws on the threads of `pool`. With those of a simulation nothing is allocated after the first batches.
    pub fn with_pool(mut self, pool: ThreadPool) -> Self {
        self.pool = pool;
        self
    }

    /// Number of threads, the calling one included.
    pub fn threads(&self) -> usize {
        self.rasterizers.len()
    }

    /// Draws with no more than so many of its threads from now on, and at least with one; all keep their memory.
    pub fn use_threads(&mut self, most: usize) {
        self.working = most.clamp(1, self.rasterizers.len());
    }

    /// How frames are drawn.
    pub fn set_cfg(&mut self, cfg: RasterCfg) {
        for rasterizer in &mut self.rasterizers {
            rasterizer.cfg = cfg;
        }
    }

    /// Which renderer draws frames.
    pub fn set_renderer(&mut self, renderer: Renderer) {
        for rasterizer in &mut self.rasterizers {
            rasterizer.renderer = renderer;
        }
    }

    /// What the lens and the shutter do to light: `None` and [`Shutter::default`] are a point and an instant.
    pub fn set_light(&mut self, aperture: Option<Aperture>, shutter: Shutter) {
        for rasterizer in &mut self.rasterizers {
            (rasterizer.aperture, rasterizer.shutter) = (aperture, shutter);
        }
    }

    /// How much light there is: stops, -20 to 20, see [`Rasterizer::stops`].
    pub fn set_stops(&mut self, stops: f64) {
        for rasterizer in &mut self.rasterizers {
            rasterizer.stops = stops;
        }
    }

    /// How far the paths of the images are that are drawn.
    pub fn progress(&self) -> &RenderProgress {
        &self.progress
    }

    /// The geom groups that are drawn: bit k is group k.
    pub fn groups(&self) -> u32 {
        self.rasterizers.first().map_or(0, |rasterizer| rasterizer.cfg.groups)
    }

    /// Takes trees over meshes from there, and keeps new ones there.
    pub fn share_assets(&mut self, assets: &RayAssets) {
        for rasterizer in &mut self.rasterizers {
            rasterizer.assets = assets.clone();
        }
    }

    /// Scratch memory held \[bytes\].
    pub fn scratch_bytes(&self) -> usize {
        let own: usize = self.rasterizers.iter().map(Rasterizer::scratch_bytes).sum();
        own + self.plans.iter().map(Plan::bytes).sum::<usize>()
    }

    /// Draws every shot into its frame.
    ///
    /// # Errors
    ///
    /// Of the first shot that cannot be drawn, with its index; the others are drawn nevertheless.
    pub fn render(&mut self, jobs: &mut [Job<'_>]) -> Result<(), (usize, RenderError)> {
        self.render_takes(jobs, &[])
    }

    /// As [`render`](Self::render), of images by path tracing each with its noise and with things that moved while the
    /// shutter was open. Shots without a take are still, and have the same noise.
    ///
    /// # Errors
    ///
    /// As [`render`](Self::render).
    pub fn render_takes(&mut self, jobs: &mut [Job<'_>], takes: &[Take<'_>]) -> Result<(), (usize, RenderError)> {
        let Self { rasterizers, working, plans, pool, progress } = self;
        let Some((cfg, renderer)) = rasterizers.first().map(|r| (r.cfg, r.renderer)) else { return Ok(()) };
        let threads = worth(cfg, renderer, jobs).min(*working);
        let rasterizers = &mut rasterizers[..threads];
        let failure = Failure::default();
        progress.begin(jobs.iter().fold(0, |sum, (shot, frame)| sum.saturating_add(renderer.paths(shot, frame))));
        if renderer.follows_paths() {
            for (index, (shot, frame)) in jobs.iter_mut().enumerate() {
                let take = takes.get(index).copied().unwrap_or_default();
                let (before, paths) = (progress.samples(), renderer.paths(shot, frame));
                let result = expose(pool, rasterizers, shot, &take, frame);
                if result.as_ref().is_err_and(|error| !matches!(error, RenderError::Cancelled { .. })) {
                    progress.refuse(paths.saturating_sub(progress.samples().saturating_sub(before)));
                }
                failure.note(index, result);
            }
            return failure.first();
        }
        let count = jobs.len();
        let together = match threads {
            1 => 0,
            _ if count < 2 * threads => count,
            // As many as one thread would draw while the others wait.
            _ if count < 8 * threads => count % threads,
            _ => 0,
        };
        let (alone, together) = jobs.split_at_mut(count - together);
        let first = alone.len();
        pool.for_each(rasterizers, alone.iter_mut().enumerate(), |rasterizer, (index, (shot, frame))| {
            failure.note(index, rasterizer.render_shot(shot, frame));
        });
        if !together.is_empty() {
            plans.resize_with(plans.len().max(together.len()), Plan::default);
            draw_together(pool, rasterizers, &mut plans[..together.len()], together, |index, result| {
                failure.note(first + index, result);
            });
        }
        failure.first()
    }
}

/// How many threads some shots are worth; at least 1.
fn worth(cfg: RasterCfg, renderer: Renderer, jobs: &[Job<'_>]) -> usize {
    let cost = jobs.iter().fold(0usize, |sum, (shot, frame)| sum.saturating_add(estimate(cfg, shot, frame)));
    (cost.saturating_mul(renderer.slowness(cfg)) / (WORTH_A_THREAD / 2)).max(1)
}

/// The first shot that could not be drawn.
#[derive(Debug, Default)]
struct Failure(Mutex<Option<(usize, RenderError)>>);

impl Failure {
    fn first(self) -> Result<(), (usize, RenderError)> {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
    }

    fn note(&self, index: usize, result: Result<(), RenderError>) {
        if let Err(error) = result {
            let mut first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            if first.as_ref().is_none_or(|(other, _)| index < *other) {
                *first = Some((index, error));
            }
        }
    }
}

/// Draws a few shots, each by all threads.
fn draw_together(
    pool: &ThreadPool,
    rasterizers: &mut [Rasterizer],
    plans: &mut [Plan],
    jobs: &mut [Job<'_>],
    note: impl Fn(usize, Result<(), RenderError>) + Sync,
) {
    let parts = (PARTS * rasterizers.len()).div_ceil(jobs.len());
    pool.for_each(
        rasterizers,
        plans.iter_mut().zip(&*jobs).enumerate(),
        |rasterizer, (index, (plan, (shot, frame)))| {
            note(index, plan.prepare(rasterizer.style(), shot, frame));
        },
    );
    if plans.iter().any(Plan::has_shadows) {
        let maps = plans.iter_mut().zip(&*jobs);
        let bands = maps.flat_map(|(plan, (shot, _))| plan.shadow_bands().map(move |band| (shot.scene, band)));
        pool.for_each(rasterizers, bands, |rasterizer, (scene, band)| {
            rasterizer.brush.shadow(scene, band);
        });
    }
    let bands = plans.iter().zip(jobs).flat_map(|(plan, job)| {
        let (shot, frame) = (job.0, &mut job.1);
        let bands = bands(plan, &shot, frame, parts);
        bands.map(move |band| (plan, shot, band))
    });
    pool.for_each(rasterizers, bands, |rasterizer, (plan, shot, (first, rows, mut frame))| {
        rasterizer.brush.paint(plan, &shot, &mut frame, first..first + rows);
    });
}

/// Bands of a frame, about `parts` of them: the first row of blocks, their number, and that part of the frame. None where
/// the shot cannot be drawn.
fn bands<'a>(
    plan: &Plan,
    shot: &Shot<'_>,
    frame: &'a mut FrameMut<'_>,
    parts: usize,
) -> impl Iterator<Item = (usize, usize, FrameMut<'a>)> + use<'a> {
    let (width, height) = (shot.view.width, shot.view.height);
    let blocks = if plan.projection.is_some() { height.div_ceil(BLOCK) } else { 0 };
    let rows = blocks.div_ceil(parts).clamp(1, plan.rows());
    let mut rest = frame.reborrow();
    (0..blocks).step_by(rows).map(move |first| {
        let rows = rows.min(blocks - first);
        let pixels = width * (rows * BLOCK).min(height - first * BLOCK);
        (first, rows, rest.split_off_first(pixels))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Channels, Frame};
    use crate::visibility::View;
    use kinetoscope_scene::shape::Sphere;
    use kinetoscope_scene::{Instance, Material, PoseF32, RenderScene};

    /// A small image of many paths takes seconds, one of few is drawn before a thread has woken.
    #[test]
    fn worth_of_paths() {
        let scene = &RenderScene::new(vec![Instance::new(Sphere { radius: 0.3 }, Material::default(), 1)]).unwrap();
        let view = &View::look_at([32, 32], 0.7, [2.0, 0.0, 0.0], [0.0; 3], [0., 0., 1.]).unwrap();
        let mut frame = Frame::new(32, 32, Channels::ALL);
        let shot = Shot { scene, poses: &[PoseF32::IDENTITY], view, lights: None, lens: None, before: None };
        let jobs = [(shot, frame.as_mut())];
        // Without shadow maps, whose cost is that of many more pixels.
        let cfg = RasterCfg { shadows: false, ..RasterCfg::default() };
        let paths = |samples, max_bounces| Renderer::RayTraced { samples, max_bounces, denoise: false, seed: 0 };
        assert_eq!(worth(cfg, Renderer::Raster, &jobs), 1);
        assert_eq!(worth(cfg, paths(1, 0), &jobs), 1);
        assert!(worth(cfg, paths(256, 0), &jobs) >= 64);
        assert!(worth(cfg, paths(16, 15), &jobs) >= 64);
        assert!(worth(cfg, paths(Renderer::MAX_SAMPLES, Renderer::MAX_BOUNCES), &jobs) >= 1 << 16);
    }
}
