//! Renders many frames on several threads.

use super::aperture::Aperture;
use super::image_renderer::ImageRenderer;
use super::path_frame::path_trace;
use super::progress::RenderProgress;
use super::renderer::Renderer;
use super::request::{RasterCfg, RenderRequest};
use super::shutter::{FrameSample, Shutter};
use crate::frame::FrameMut;
use crate::geometry::assets::RayAssetCache;
use crate::raster::tile::BLOCK;
use crate::shade::prepared_frame::{PreparedFrame, estimate_cost_ns};
use crate::visibility::RenderError;
use kinetoscope_exec::ThreadPool;
use std::sync::{Mutex, PoisonError};

/// Work that takes less time than this \[ns\] is done on the calling thread: waking or starting another thread takes up
/// to 0.05 ms.
const MIN_THREAD_WORK_NS: usize = 1_000_000;
/// Bands per thread, approximately: the last bands decide how long other threads wait.
const BANDS_PER_THREAD: usize = 8;

/// A render request and the buffers of its images.
pub type RenderJob<'a> = (RenderRequest<'a>, FrameMut<'a>);

/// Renders batches of frames on several threads; keeps the scratch memory of each thread. Images are bit-identical for
/// any number of threads.
///
/// In a large batch, each frame is rendered by one thread. All threads together render each frame of a small batch
/// (fewer than two frames per thread), and the last frames of a medium batch (fewer than eight per thread): first the
/// visibility, then parts of the shadow maps, then bands of the images. Path tracing renders one frame after the other,
/// each by all threads.
#[derive(Debug)]
pub struct ParallelRenderer {
    renderers: Vec<ImageRenderer>,
    /// Largest number of threads to use.
    active: usize,
    prepared: Vec<PreparedFrame>,
    pool: ThreadPool,
    progress: RenderProgress,
}

/// Clones the settings. The clone has its own progress counter.
impl Clone for ParallelRenderer {
    fn clone(&self) -> Self {
        let mut clone = Self {
            renderers: self.renderers.clone(),
            active: self.active,
            prepared: self.prepared.clone(),
            pool: self.pool.clone(),
            progress: RenderProgress::default(),
        };
        clone.share_progress();
        clone
    }
}

impl ParallelRenderer {
    /// Creates a renderer with [`Renderer::Raster`] for each of `threads` threads, the calling one included; 0 counts
    /// as 1. The other threads start with the first batch that needs them, and end when the renderer and all its clones
    /// are dropped; see also [`with_pool`](Self::with_pool).
    pub fn new(cfg: RasterCfg, threads: usize) -> Self {
        let (active, renderers) = (threads.max(1), vec![ImageRenderer::new(cfg); threads.max(1)]);
        let (pool, progress) = (ThreadPool::new(), RenderProgress::default());
        let mut all = Self { renderers, active, prepared: Vec::new(), pool, progress };
        all.share_progress();
        all
    }

    /// Lets all threads count their progress together.
    fn share_progress(&mut self) {
        for image_renderer in &mut self.renderers {
            image_renderer.progress = self.progress.clone();
        }
    }

    /// Renders on the threads of `pool`; the number of threads stays that of [`new`](Self::new). With the pool of a
    /// simulation, no memory is allocated after the first batches.
    pub fn with_pool(mut self, pool: ThreadPool) -> Self {
        self.pool = pool;
        self
    }

    /// Number of threads given to [`new`](Self::new), the calling one included; [`use_threads`](Self::use_threads) does
    /// not change it.
    pub fn threads(&self) -> usize {
        self.renderers.len()
    }

    /// Limits the number of threads of the next batches to `most`, clamped to 1..=[`threads`](Self::threads). All
    /// threads keep their memory.
    pub fn use_threads(&mut self, most: usize) {
        self.active = most.clamp(1, self.renderers.len());
    }

    /// Sets the options of the next batches, see [`ImageRenderer::cfg`].
    pub fn set_cfg(&mut self, cfg: RasterCfg) {
        for image_renderer in &mut self.renderers {
            image_renderer.cfg = cfg;
        }
    }

    /// Sets the renderer.
    pub fn set_renderer(&mut self, renderer: Renderer) {
        for image_renderer in &mut self.renderers {
            image_renderer.renderer = renderer;
        }
    }

    /// Sets the aperture (depth of field) and the shutter (exposure time, rolling shutter); `None` and
    /// [`Shutter::default`] turn them off. Other values need path tracing: rendering returns
    /// [`RenderError::NeedsPathTracing`] without it. Motion also needs the poses at shutter opening: see
    /// [`render_samples`](Self::render_samples).
    pub fn set_exposure_optics(&mut self, aperture: Option<Aperture>, shutter: Shutter) {
        for image_renderer in &mut self.renderers {
            (image_renderer.aperture, image_renderer.shutter) = (aperture, shutter);
        }
    }

    /// Sets the exposure compensation in stops, -20 to 20, see [`ImageRenderer::exposure_compensation`].
    pub fn set_exposure_compensation(&mut self, stops: f64) {
        for image_renderer in &mut self.renderers {
            image_renderer.exposure_compensation = stops;
        }
    }

    /// Progress of the path tracing of the current or the last batch.
    pub fn progress(&self) -> &RenderProgress {
        &self.progress
    }

    /// Geom groups that are rendered: bit k is group k.
    pub fn groups(&self) -> u32 {
        self.renderers.first().map_or(0, |image_renderer| image_renderer.cfg.groups)
    }

    /// Uses `assets`, which other renderers may share, as the cache of BVHs over meshes.
    pub fn share_assets(&mut self, assets: &RayAssetCache) {
        for image_renderer in &mut self.renderers {
            image_renderer.assets = assets.clone();
        }
    }

    /// Scratch memory held \[bytes\].
    pub fn scratch_bytes(&self) -> usize {
        let own: usize = self.renderers.iter().map(ImageRenderer::scratch_bytes).sum();
        own + self.prepared.iter().map(PreparedFrame::bytes).sum::<usize>()
    }

    /// Renders every request into its frame.
    ///
    /// # Errors
    ///
    /// The error of the first frame that cannot be rendered, with its index in `jobs`. The other frames are rendered
    /// nevertheless, except those after a cancellation.
    pub fn render(&mut self, jobs: &mut [RenderJob<'_>]) -> Result<(), (usize, RenderError)> {
        self.render_samples(jobs, &[])
    }

    /// As [`render`](Self::render), with the noise number and the poses at shutter opening of each frame in `takes`.
    /// Frames without an entry show one instant, with noise number 0. Renderers other than path tracing ignore `takes`.
    ///
    /// # Errors
    ///
    /// As [`render`](Self::render).
    pub fn render_samples(
        &mut self,
        jobs: &mut [RenderJob<'_>],
        takes: &[FrameSample<'_>],
    ) -> Result<(), (usize, RenderError)> {
        let Self { renderers, active, prepared, pool, progress } = self;
        let Some((cfg, renderer)) = renderers.first().map(|r| (r.cfg, r.renderer)) else { return Ok(()) };
        let threads = worthwhile_threads(cfg, renderer, jobs).min(*active);
        let image_renderers = &mut renderers[..threads];
        let failure = FirstError::default();
        progress
            .begin(jobs.iter().fold(0, |sum, (render_request, frame)| {
                sum.saturating_add(renderer.path_count(render_request, frame))
            }));
        if renderer.is_path_tracing() {
            for (index, (render_request, frame)) in jobs.iter_mut().enumerate() {
                let take = takes.get(index).copied().unwrap_or_default();
                let (before, paths) = (progress.samples(), renderer.path_count(render_request, frame));
                let result = path_trace(pool, image_renderers, render_request, &take, frame);
                if result.as_ref().is_err_and(|error| !matches!(error, RenderError::Canceled { .. })) {
                    progress.subtract(paths.saturating_sub(progress.samples().saturating_sub(before)));
                }
                failure.record(index, result);
            }
            return failure.first();
        }
        let count = jobs.len();
        let together = match threads {
            1 => 0,
            _ if count < 2 * threads => count,
            // As many as one thread would render while the others wait.
            _ if count < 8 * threads => count % threads,
            _ => 0,
        };
        let (alone, together) = jobs.split_at_mut(count - together);
        let first = alone.len();
        pool.for_each(
            image_renderers,
            alone.iter_mut().enumerate(),
            |image_renderer, (index, (render_request, frame))| {
                failure.record(index, image_renderer.render_request(render_request, frame));
            },
        );
        if !together.is_empty() {
            prepared.resize_with(prepared.len().max(together.len()), PreparedFrame::default);
            render_jointly(pool, image_renderers, &mut prepared[..together.len()], together, |index, result| {
                failure.record(first + index, result);
            });
        }
        failure.first()
    }
}

/// Number of threads that pay off for these frames; at least 1.
fn worthwhile_threads(cfg: RasterCfg, renderer: Renderer, jobs: &[RenderJob<'_>]) -> usize {
    let cost = jobs
        .iter()
        .fold(0usize, |sum, (render_request, frame)| sum.saturating_add(estimate_cost_ns(cfg, render_request, frame)));
    (cost.saturating_mul(renderer.relative_cost(cfg)) / (MIN_THREAD_WORK_NS / 2)).max(1)
}

/// Error of the first frame that could not be rendered.
#[derive(Debug, Default)]
struct FirstError(Mutex<Option<(usize, RenderError)>>);

impl FirstError {
    fn first(self) -> Result<(), (usize, RenderError)> {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
    }

    fn record(&self, index: usize, result: Result<(), RenderError>) {
        if let Err(error) = result {
            let mut first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            if first.as_ref().is_none_or(|(other, _)| index < *other) {
                *first = Some((index, error));
            }
        }
    }
}

/// Renders a few frames, each by all threads.
fn render_jointly(
    pool: &ThreadPool,
    image_renderers: &mut [ImageRenderer],
    plans: &mut [PreparedFrame],
    jobs: &mut [RenderJob<'_>],
    note: impl Fn(usize, Result<(), RenderError>) + Sync,
) {
    let parts = (BANDS_PER_THREAD * image_renderers.len()).div_ceil(jobs.len());
    pool.for_each(
        image_renderers,
        plans.iter_mut().zip(&*jobs).enumerate(),
        |image_renderer, (index, (plan, (render_request, frame)))| {
            note(index, plan.prepare(image_renderer.settings(), render_request, frame));
        },
    );
    if plans.iter().any(PreparedFrame::has_shadows) {
        let maps = plans.iter_mut().zip(&*jobs);
        let bands = maps
            .flat_map(|(plan, (render_request, _))| plan.shadow_bands().map(move |band| (render_request.scene, band)));
        pool.for_each(image_renderers, bands, |image_renderer, (scene, band)| {
            image_renderer.scratch.render_shadow_band(scene, band);
        });
    }
    let bands = plans.iter().zip(jobs).flat_map(|(plan, job)| {
        let (render_request, frame) = (job.0, &mut job.1);
        let bands = bands(plan, &render_request, frame, parts);
        bands.map(move |band| (plan, render_request, band))
    });
    pool.for_each(image_renderers, bands, |image_renderer, (plan, render_request, (first, rows, mut frame))| {
        image_renderer.scratch.render_band(plan, &render_request, &mut frame, first..first + rows);
    });
}

/// Splits a frame into about `parts` bands, or more if [`PreparedFrame::band_rows`] limits their height: first row of
/// blocks, number of rows of blocks, and the buffers of the band. Empty if the frame cannot be rendered.
fn bands<'a>(
    plan: &PreparedFrame,
    render_request: &RenderRequest<'_>,
    frame: &'a mut FrameMut<'_>,
    parts: usize,
) -> impl Iterator<Item = (usize, usize, FrameMut<'a>)> + use<'a> {
    let (width, height) = (render_request.view.width, render_request.view.height);
    let blocks = if plan.projection.is_some() { height.div_ceil(BLOCK) } else { 0 };
    let rows = blocks.div_ceil(parts).clamp(1, plan.band_rows());
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

    /// A small image with many paths takes seconds; with few paths, it is done before a thread has woken.
    #[test]
    fn worth_of_paths() {
        let scene = &RenderScene::new(vec![Instance::new(Sphere { radius: 0.3 }, Material::default(), 1)]).unwrap();
        let view = &View::look_at([32, 32], 0.7, [2.0, 0.0, 0.0], [0.0; 3], [0., 0., 1.]).unwrap();
        let mut frame = Frame::new(32, 32, Channels::ALL);
        let render_request =
            RenderRequest { scene, poses: &[PoseF32::IDENTITY], view, lights: None, lens: None, previous: None };
        let jobs = [(render_request, frame.as_mut())];
        // Without shadow maps, which cost as much as many more pixels.
        let cfg = RasterCfg { shadows: false, ..RasterCfg::default() };
        let paths = |samples, max_bounces| Renderer::RayTraced { samples, max_bounces, denoise: false, seed: 0 };
        assert_eq!(worthwhile_threads(cfg, Renderer::Raster, &jobs), 1);
        assert_eq!(worthwhile_threads(cfg, paths(1, 0), &jobs), 1);
        assert!(worthwhile_threads(cfg, paths(256, 0), &jobs) >= 64);
        assert!(worthwhile_threads(cfg, paths(16, 15), &jobs) >= 64);
        assert!(worthwhile_threads(cfg, paths(Renderer::MAX_SAMPLES, Renderer::MAX_BOUNCES), &jobs) >= 1 << 16);
    }
}
