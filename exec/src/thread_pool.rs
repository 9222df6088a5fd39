//! [`ThreadPool`]: runs one job at a time on several threads, with borrowed data.

use crate::workers::Workers;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Wrapper around the work of one slot. Arguments: slot, number of slots, work.
type Hook = dyn Fn(usize, usize, &(dyn Fn(usize) + Sync)) + Send + Sync;

/// Thread pool that runs one job at a time. Clones share the same threads.
///
/// While a job runs, jobs of other callers, and jobs started inside the job, run on the calling thread alone. The
/// threads end when the last clone is dropped.
#[derive(Clone)]
pub struct ThreadPool {
    workers: Option<Arc<Workers>>,
    hook: Option<Arc<Hook>>,
}

impl ThreadPool {
    /// Creates a pool whose threads start when a job first needs them.
    pub fn new() -> Self {
        Self { workers: Some(Arc::default()), hook: None }
    }

    /// Creates a pool without worker threads: the calling thread does all the work.
    pub const fn serial() -> Self {
        Self { workers: None, hook: None }
    }

    /// Returns a pool on the same threads that calls `hook(slot, slots, work)` instead of `work(slot)` for each slot,
    /// slot 0 included. Replaces an earlier hook.
    ///
    /// The hook must call `work(slot)` once. Hooks are meant for measurements per thread, such as allocation counts.
    pub fn with_hook(mut self, hook: impl Fn(usize, usize, &(dyn Fn(usize) + Sync)) + Send + Sync + 'static) -> Self {
        self.hook = Some(Arc::new(hook));
        self
    }

    /// Starts the `slots - 1` worker threads of a job with `slots` slots immediately, so that the first job does not
    /// start them. Running threads are kept. Does nothing in a [serial](Self::serial) pool.
    ///
    /// # Errors
    /// The operating system cannot start a thread.
    pub fn start(&self, slots: usize) -> std::io::Result<()> {
        match &self.workers {
            Some(workers) => workers.start(slots.saturating_sub(1)),
            None => Ok(()),
        }
    }

    /// Calls `work(0)` on the calling thread and, concurrently, `work(slot)` for other slots below `slots` on worker
    /// threads.
    ///
    /// Each slot runs at most once, slot 0 always. Returns when all calls have returned. Busy or missing workers are
    /// not waited for, so `work` must complete the job even if only slot 0 runs.
    ///
    /// # Panics
    /// If `work` panics on any thread.
    pub fn run(&self, slots: usize, work: impl Fn(usize) + Sync) {
        match &self.hook {
            Some(hook) => self.run_unhooked(slots, &|slot| hook(slot, slots, &work)),
            None => self.run_unhooked(slots, &work),
        }
    }

    fn run_unhooked(&self, slots: usize, work: &(dyn Fn(usize) + Sync)) {
        match &self.workers {
            Some(workers) if slots > 1 => workers.run(slots, work),
            _ => work(0),
        }
    }

    /// Calls `act(scratch, item)` once for each item, on at most `scratch.len()` threads, including the calling thread.
    ///
    /// Each thread takes the next item when it has finished one, so the assignment of items to threads varies. Without
    /// scratch values, no item is processed.
    ///
    /// # Panics
    /// If `act` or the iterator panics on any thread.
    pub fn for_each<W: Send, I>(&self, scratch: &mut [W], items: I, act: impl Fn(&mut W, I::Item) + Sync)
    where
        I: Iterator + Send,
    {
        // A job with a known number of items uses at most that many threads.
        let slots = match items.size_hint() {
            (least, Some(most)) if least == most => most.min(scratch.len()),
            _ => scratch.len(),
        };
        let (items, scratch) = (Mutex::new(items), Mutex::new(scratch.iter_mut()));
        self.run(slots, |_| {
            let Some(mine) = next_item(&scratch) else { return };
            while let Some(item) = next_item(&items) {
                act(mine, item);
            }
        });
    }
}

impl Default for ThreadPool {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Debug for ThreadPool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let started = self.workers.as_ref().map_or(0, |workers| workers.started());
        f.debug_struct("ThreadPool").field("started", &started).finish_non_exhaustive()
    }
}

/// Takes the next item; `None` after the last. A panic of the iterator surfaces on this thread; the other threads get
/// the remaining items.
fn next_item<I: Iterator>(items: &Mutex<I>) -> Option<I::Item> {
    items.lock().unwrap_or_else(PoisonError::into_inner).next()
}

#[cfg(test)]
mod tests;
