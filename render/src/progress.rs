//! How far a long rendering is, for whoever waits for it.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How far the path tracing of images is, and a way to break it off; clones are handles of the same, for other threads.
///
/// Counts are of the batch of images that is drawn or was drawn last, those of images that need no paths are 0. What is
/// broken off leaves every pixel of the image that it was at as it was before, and is an error:
/// [`RenderError::Cancelled`](crate::visibility::RenderError::Cancelled).
///
/// ```
/// use kinetoscope_render::ParallelRasterizer;
/// use kinetoscope_render::RasterCfg;
///
/// let rasterizer = ParallelRasterizer::new(RasterCfg::default(), 1);
/// let progress = rasterizer.progress().clone();
/// // On another thread, while images are drawn:
/// println!("{} of {} paths, {:?} left", progress.samples(), progress.total(), progress.remaining());
/// progress.cancel();
/// assert!(progress.is_cancelled());
/// ```
#[derive(Clone, Debug, Default)]
pub struct RenderProgress(Arc<Counters>);

#[derive(Debug, Default)]
struct Counters {
    samples: AtomicU64,
    total: AtomicU64,
    rays: AtomicU64,
    cancelled: AtomicBool,
    started: Mutex<Option<Instant>>,
}

impl RenderProgress {
    /// Paths that were followed.
    pub fn samples(&self) -> u64 {
        self.0.samples.load(Ordering::Relaxed)
    }

    /// Paths that there are to follow: pixels times samples, without those of images that turned out to be impossible.
    pub fn total(&self) -> u64 {
        self.0.total.load(Ordering::Relaxed)
    }

    /// Rays that were cast for them: of the paths themselves and for shadows.
    pub fn rays(&self) -> u64 {
        self.0.rays.load(Ordering::Relaxed)
    }

    /// The part that is done, 0 to 1; `None` where there is nothing to do.
    pub fn fraction(&self) -> Option<f64> {
        let total = self.total();
        (total > 0).then(|| self.samples() as f64 / total as f64)
    }

    /// Since the batch was begun; `None` before the first.
    pub fn elapsed(&self) -> Option<Duration> {
        self.0.started.lock().unwrap_or_else(PoisonError::into_inner).map(|start| start.elapsed())
    }

    /// About how long it takes yet, if it goes on as it went so far; `None` before anything is known.
    pub fn remaining(&self) -> Option<Duration> {
        let (elapsed, done) = (self.elapsed()?, self.fraction().filter(|done| *done > 0.0)?);
        Duration::try_from_secs_f64(elapsed.as_secs_f64() * (1.0 - done) / done).ok()
    }

    /// Breaks off the paths that are followed now, and whatever is begun later until [`resume`](Self::resume). What comes after
    /// the paths, other channels and smoothing, is done to its end.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Relaxed);
    }

    /// Images that are begun from now on are drawn again, those that were broken off too when somebody reads them.
    pub fn resume(&self) {
        self.0.cancelled.store(false, Ordering::Relaxed);
    }

    /// Whether it was broken off.
    pub fn is_cancelled(&self) -> bool {
        self.0.cancelled.load(Ordering::Relaxed)
    }

    /// A batch begins.
    pub(crate) fn begin(&self, total: u64) {
        *self.0.started.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        self.0.samples.store(0, Ordering::Relaxed);
        self.0.rays.store(0, Ordering::Relaxed);
        self.0.total.store(total, Ordering::Relaxed);
    }

    /// Some of it will never be done: a image that cannot be drawn.
    pub(crate) fn refuse(&self, samples: u64) {
        let less = |total: u64| Some(total.saturating_sub(samples));
        let _ = self.0.total.fetch_update(Ordering::Relaxed, Ordering::Relaxed, less);
    }

    /// Some of it is done.
    pub(crate) fn add(&self, samples: u64, rays: u64) {
        self.0.samples.fetch_add(samples, Ordering::Relaxed);
        self.0.rays.fetch_add(rays, Ordering::Relaxed);
    }
}
