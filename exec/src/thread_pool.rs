//! [`ThreadPool`]: one job at a time, on several threads, with borrowed data.

use crate::workers::Workers;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Wraps the share of one slot: called with the slot, the number of slots and the work.
type Hook = dyn Fn(usize, usize, &(dyn Fn(usize) + Sync)) + Send + Sync;

/// Worker threads for one job at a time; clones share the same threads.
///
/// The threads end when the last clone is dropped.
#[derive(Clone)]
pub struct ThreadPool {
    workers: Option<Arc<Workers>>,
    hook: Option<Arc<Hook>>,
}

impl ThreadPool {
    /// A pool whose threads start when a job first needs them.
    pub fn new() -> Self {
        Self { workers: Some(Arc::default()), hook: None }
    }

    /// A pool without worker threads: the calling thread does all the work.
    pub const fn serial() -> Self {
        Self { workers: None, hook: None }
    }

    /// The same threads; the share of each slot runs inside `hook(slot, slots, work)`, which must call `work(slot)` once.
    /// For measurements per thread, such as counting allocations.
    pub fn with_hook(mut self, hook: impl Fn(usize, usize, &(dyn Fn(usize) + Sync)) + Send + Sync + 'static) -> Self {
        self.hook = Some(Arc::new(hook));
        self
    }

    /// Starts the threads of jobs with `slots` slots now, instead of with the first job.
    ///
    /// # Errors
    /// The operating system refuses a thread.
    pub fn start(&self, slots: usize) -> std::io::Result<()> {
        match &self.workers {
            Some(workers) => workers.start(slots.saturating_sub(1)),
            None => Ok(()),
        }
    }

    /// Calls `work(0)` on the calling thread and, at the same time, `work(slot)` for other slots below `slots` on worker
    /// threads, each slot at most once; returns when all calls have returned.
    ///
    /// Busy or missing workers are not waited for, so `work` must complete the job even if only slot 0 runs.
    ///
    /// # Panics
    /// If `work` panics, on whichever thread.
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

    /// Calls `act(scratch, item)` once for each item, on as many threads as there are scratch values, the calling thread
    /// included. Each thread takes the next item when it has finished one.
    ///
    /// # Panics
    /// If `act` or the iterator panics, on whichever thread.
    pub fn for_each<W: Send, I>(&self, scratch: &mut [W], items: I, act: impl Fn(&mut W, I::Item) + Sync)
    where
        I: Iterator + Send,
    {
        // No more threads than items, where their number is known.
        let slots = match items.size_hint() {
            (least, Some(most)) if least == most => most.min(scratch.len()),
            _ => scratch.len(),
        };
        let (items, scratch) = (Mutex::new(items), Mutex::new(scratch.iter_mut()));
        self.run(slots, |_| {
            let Some(mine) = next(&scratch) else { return };
            while let Some(item) = next(&items) {
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

/// The next item. A panic of the iterator is raised on the thread that met it; the other threads see what is left.
fn next<I: Iterator>(items: &Mutex<I>) -> Option<I::Item> {
    items.lock().unwrap_or_else(PoisonError::into_inner).next()
}

#[cfg(test)]
mod tests;
