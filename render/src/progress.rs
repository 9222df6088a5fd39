//! Progress of long renderings, and their cancellation.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Progress of path tracing, and a way to cancel it. Clones share the same counters, also between threads.
///
/// Counts belong to the current batch of images, or to the last one. They are 0 for images without paths. Cancellation
/// leaves all pixels of the current image unchanged, and is an error:
/// [`RenderError::Canceled`](crate::visibility::RenderError::Canceled).
///
/// ```
/// use kinetoscope_render::ParallelRenderer;
/// use kinetoscope_render::RasterCfg;
///
/// let rasterizer = ParallelRenderer::new(RasterCfg::default(), 1);
/// let progress = rasterizer.progress().clone();
/// // On another thread, during rendering:
/// println!("{} of {} paths, {:?} left", progress.samples(), progress.total(), progress.remaining());
/// progress.cancel();
/// assert!(progress.is_canceled());
/// ```
#[derive(Clone, Debug, Default)]
pub struct RenderProgress(Arc<Counters>);

#[derive(Debug, Default)]
struct Counters {
    samples: AtomicU64,
    total: AtomicU64,
    rays: AtomicU64,
    canceled: AtomicBool,
    started: Mutex<Option<Instant>>,
}

impl RenderProgress {
    /// Number of paths of the batch that are traced so far.
    pub fn samples(&self) -> u64 {
        self.0.samples.load(Ordering::Relaxed)
    }

    /// Number of paths of the batch: pixels times samples, without those of images that could not be rendered.
    pub fn total(&self) -> u64 {
        self.0.total.load(Ordering::Relaxed)
    }

    /// Number of rays, for the paths themselves and for shadows.
    pub fn rays(&self) -> u64 {
        self.0.rays.load(Ordering::Relaxed)
    }

    /// Finished fraction, 0 to 1; `None` without any paths.
    pub fn fraction(&self) -> Option<f64> {
        let total = self.total();
        (total > 0).then(|| self.samples() as f64 / total as f64)
    }

    /// Time since the start of the batch, also after its end; `None` before the first batch.
    pub fn elapsed(&self) -> Option<Duration> {
        self.0.started.lock().unwrap_or_else(PoisonError::into_inner).map(|start| start.elapsed())
    }

    /// Estimated time left for the paths, at the mean speed so far; `None` before the first path.
    pub fn remaining(&self) -> Option<Duration> {
        let (elapsed, done) = (self.elapsed()?, self.fraction().filter(|done| *done > 0.0)?);
        Duration::try_from_secs_f64(elapsed.as_secs_f64() * (1.0 - done) / done).ok()
    }

    /// Cancels the current path tracing, and any that starts before [`resume`](Self::resume). An image whose paths are
    /// all traced is completed.
    pub fn cancel(&self) {
        self.0.canceled.store(true, Ordering::Relaxed);
    }

    /// Allows path tracing again. A `Camera` renders its canceled images when they are read again.
    pub fn resume(&self) {
        self.0.canceled.store(false, Ordering::Relaxed);
    }

    /// True after [`cancel`](Self::cancel), until [`resume`](Self::resume).
    pub fn is_canceled(&self) -> bool {
        self.0.canceled.load(Ordering::Relaxed)
    }

    /// Starts a batch.
    pub(crate) fn begin(&self, total: u64) {
        *self.0.started.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        self.0.samples.store(0, Ordering::Relaxed);
        self.0.rays.store(0, Ordering::Relaxed);
        self.0.total.store(total, Ordering::Relaxed);
    }

    /// Reduces the total by the untraced paths of an image that failed.
    pub(crate) fn subtract(&self, samples: u64) {
        let less = |total: u64| Some(total.saturating_sub(samples));
        let _ = self.0.total.fetch_update(Ordering::Relaxed, Ordering::Relaxed, less);
    }

    /// Adds finished paths, and their rays.
    pub(crate) fn add(&self, samples: u64, rays: u64) {
        self.0.samples.fetch_add(samples, Ordering::Relaxed);
        self.0.rays.fetch_add(rays, Ordering::Relaxed);
    }
}
