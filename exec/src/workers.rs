//! Worker threads of a pool. Lending borrowed work to them is the only unsafe operation of this crate.
//!
//! Scoped threads of the standard library can borrow, too, but start and end with each job. That would cost about
//! 0.05 ms and a few allocations, several times per image.
#![allow(unsafe_code, reason = "persistent workers run jobs that borrow from the caller")]

use crate::spin_limit::SpinLimit;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Borrowed work with an extended lifetime. Its caller waits until no worker runs it.
type BorrowedWork = &'static (dyn Fn(usize) + Sync);

/// Number of times a waiting caller polls for its last worker before it yields its core.
const SPINS_BEFORE_YIELD: u32 = 1_000;
/// Number of times a waiting caller then yields before it sleeps.
const YIELDS_BEFORE_SLEEP: u32 = 1_000;

/// The worker threads of a pool. They start when first needed, sleep when idle, and end with their owner.
#[derive(Default)]
pub(crate) struct Workers {
    shared: Arc<Shared>,
    threads: Mutex<Vec<JoinHandle<()>>>,
}

#[derive(Default)]
struct Shared {
    job: Mutex<JobState>,
    wake: Condvar,
    done: Condvar,
    /// Number of jobs so far; polled by idle workers, written under the lock of `job`, except at the end of the pool.
    epoch: AtomicU64,
    /// Workers that run the work now; polled by the caller, written under the lock of `job`.
    active: AtomicUsize,
}

/// The current job. It belongs to one caller from `post` until its `finish` has returned.
#[derive(Default)]
struct JobState {
    /// True while a job is in flight.
    in_flight: bool,
    work: Option<BorrowedWork>,
    /// Next slot to assign.
    slot: usize,
    /// Number of slots.
    slots: usize,
    /// Number of sleeping workers.
    sleeping: usize,
    /// True while the caller sleeps.
    caller_sleeps: bool,
    panicked: bool,
    stop: bool,
}

/// Locks a mutex and ignores poisoning: the caller raises the panic of a job again, and the locked data stay valid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Workers {
    /// Runs a job; see [`ThreadPool::run`](crate::ThreadPool::run). If the workers are busy with another job, or the
    /// pool has no worker, the calling thread works alone.
    pub(crate) fn run(&self, slots: usize, work: &(dyn Fn(usize) + Sync)) {
        if !self.post(slots, work) {
            return work(0);
        }
        let own = catch_unwind(AssertUnwindSafe(|| work(0)));
        let panicked = self.shared.finish();
        if let Err(panic) = own {
            resume_unwind(panic);
        }
        assert!(!panicked, "work panicked on another thread of the pool");
    }

    /// Posts a job. Returns `false` if no worker can help. After `true`, the caller must call `finish` before the
    /// borrow `work` ends.
    fn post(&self, slots: usize, work: &(dyn Fn(usize) + Sync)) -> bool {
        // If the operating system refuses a thread, the job runs on the existing ones.
        let _ = self.start(slots - 1);
        let num_workers = self.started().min(slots - 1);
        let mut job = lock(&self.shared.job);
        if num_workers == 0 || job.in_flight {
            return false;
        }
        // SAFETY: the reference is not used after the borrow ends. It stays in `job.work` until `finish` removes it,
        // and a worker that has read it counts in `active`, which `finish` waits for. `run`, the only caller, reaches
        // `finish` on every path: its own share of the work cannot unwind past it, and nothing in between can panic.
        let lent = unsafe { std::mem::transmute::<&(dyn Fn(usize) + Sync), BorrowedWork>(work) };
        job.in_flight = true;
        (job.work, job.slot, job.slots) = (Some(lent), 1, 1 + num_workers);
        self.shared.epoch.fetch_add(1, Ordering::Release);
        let sleeping = job.sleeping;
        drop(job);
        if sleeping > num_workers {
            (0..num_workers).for_each(|_| self.shared.wake.notify_one());
        } else if sleeping > 0 {
            self.shared.wake.notify_all();
        }
        true
    }

    /// Starts threads until `wanted` threads exist. After an error of the system, those started before it stay.
    pub(crate) fn start(&self, wanted: usize) -> std::io::Result<()> {
        let mut threads = lock(&self.threads);
        while threads.len() < wanted {
            let shared = Arc::clone(&self.shared);
            let name = format!("kinetoscope-{}", threads.len() + 1);
            threads.push(std::thread::Builder::new().name(name).spawn(move || shared.worker_loop())?);
        }
        Ok(())
    }

    /// Number of threads.
    pub(crate) fn started(&self) -> usize {
        lock(&self.threads).len()
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        lock(&self.shared.job).stop = true;
        // Ends the polling of idle workers.
        self.shared.epoch.fetch_add(1, Ordering::Release);
        self.shared.wake.notify_all();
        for thread in lock(&self.threads).drain(..) {
            let _ = thread.join();
        }
    }
}

impl Shared {
    /// Withdraws the work, waits for the workers that run it, and frees the pool for other callers.
    ///
    /// Returns true if a worker panicked. Workers that have not taken a slot yet are not waited for.
    fn finish(&self) -> bool {
        lock(&self.job).work = None;
        let mut waited = 0;
        while self.active.load(Ordering::Acquire) > 0 && waited < SPINS_BEFORE_YIELD + YIELDS_BEFORE_SLEEP {
            waited += 1;
            if waited < SPINS_BEFORE_YIELD { std::hint::spin_loop() } else { std::thread::yield_now() }
        }
        let mut job = lock(&self.job);
        while self.active.load(Ordering::Acquire) > 0 {
            job.caller_sleeps = true;
            job = self.done.wait(job).unwrap_or_else(PoisonError::into_inner);
        }
        (job.in_flight, job.caller_sleeps) = (false, false);
        std::mem::take(&mut job.panicked)
    }

    /// Runs the loop of a worker thread.
    fn worker_loop(&self) {
        let mut patience = SpinLimit::MAX;
        let mut job = lock(&self.job);
        while !job.stop {
            let free = job.slot < job.slots;
            if let Some(work) = job.work.filter(|_| free) {
                let slot = job.slot;
                job.slot += 1;
                self.active.fetch_add(1, Ordering::Relaxed);
                drop(job);
                let result = catch_unwind(AssertUnwindSafe(|| work(slot)));
                job = lock(&self.job);
                job.panicked |= result.is_err();
                // Release: makes the writes of the worker visible to a polling caller.
                if self.active.fetch_sub(1, Ordering::Release) == 1 && job.caller_sleeps {
                    self.done.notify_all();
                }
                continue;
            }
            let seen = self.epoch.load(Ordering::Acquire);
            drop(job);
            let came = (0..patience.spins()).any(|_| {
                std::hint::spin_loop();
                self.epoch.load(Ordering::Acquire) != seen
            });
            patience = patience.next(came);
            job = lock(&self.job);
            while self.epoch.load(Ordering::Acquire) == seen && !job.stop {
                job.sleeping += 1;
                job = self.wake.wait(job).unwrap_or_else(PoisonError::into_inner);
                job.sleeping -= 1;
            }
        }
    }
}

#[cfg(test)]
mod tests;
