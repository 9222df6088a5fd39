//! The threads that sensors draw and cast on: who provides them, and how work is shared among them.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Somebody who lends threads.
///
/// A simulation lends threads that stay ([`SensorContext::crew`](crate::SensorContext::crew)); without one there are
/// [`ScopedThreads`].
pub trait Threads: fmt::Debug + Send + Sync {
    /// Calls `work(0)` on the calling thread, and meanwhile `work(desk)` with other desks below `desks` on other threads,
    /// each desk once at most; returns when all calls have ended.
    ///
    /// Whoever is busy or missing is not waited for: `work` has to do everything there is even where it is called once.
    ///
    /// # Panics
    ///
    /// `work` panicked, on whichever thread.
    fn run(&self, desks: usize, work: &(dyn Fn(usize) + Sync));
}

/// Threads that start with the work and end with it: some 0.05 ms and a few allocations each.
#[derive(Clone, Copy, Debug, Default)]
pub struct ScopedThreads;

impl Threads for ScopedThreads {
    fn run(&self, desks: usize, work: &(dyn Fn(usize) + Sync)) {
        std::thread::scope(|scope| {
            for desk in 1..desks {
                // Without a thread more there is one desk less.
                let _ = std::thread::Builder::new().spawn_scoped(scope, move || work(desk));
            }
            work(0);
        });
    }
}

/// The threads that some sensors have in common; clones are the same threads. By default [`ScopedThreads`].
#[derive(Clone, Debug, Default)]
pub struct Crew(Option<Arc<dyn Threads>>);

impl Crew {
    /// Work is done on `threads`.
    pub fn new(threads: Arc<dyn Threads>) -> Self {
        Self(Some(threads))
    }

    /// Calls `work` at up to `desks` desks at the same time: see [`Threads::run`].
    pub(crate) fn run(&self, desks: usize, work: impl Fn(usize) + Sync) {
        match &self.0 {
            _ if desks < 2 => work(0),
            Some(threads) => threads.run(desks, &work),
            None => ScopedThreads.run(desks, &work),
        }
    }

    /// Does all the work, on as many threads as there are workers, each taking the next thing when it is done with one. The
    /// calling thread is one of them.
    pub(crate) fn share<W: Send, I>(&self, workers: &mut [W], work: I, act: impl Fn(&mut W, I::Item) + Sync)
    where
        I: Iterator + Send,
    {
        // No more threads than things to do, where their number is known.
        let desks = match work.size_hint() {
            (least, Some(most)) if least == most => most.min(workers.len()),
            _ => workers.len(),
        };
        let (work, workers) = (Mutex::new(work), Mutex::new(workers.iter_mut()));
        self.run(desks, |_| {
            let Some(worker) = next(&workers) else { return };
            while let Some(item) = next(&work) {
                act(worker, item);
            }
        });
    }
}

/// A panic of the iterator's own is raised by the thread that it happened on; the others see what is left.
fn next<I: Iterator>(items: &Mutex<I>) -> Option<I::Item> {
    items.lock().unwrap_or_else(PoisonError::into_inner).next()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Everything is done once, by no more threads than items.
    #[test]
    fn share() {
        let crew = Crew::default();
        for (workers, things) in [(1, 5), (3, 0), (3, 1), (3, 100), (8, 3)] {
            let mut workers = vec![Vec::new(); workers];
            let mut seen = vec![0; things];
            crew.share(&mut workers, seen.iter_mut().enumerate(), |worker, (index, seen)| {
                *seen += 1;
                worker.push(index);
                std::thread::yield_now();
            });
            assert!(seen.iter().all(|&times| times == 1), "{seen:?}");
            assert_eq!(workers.iter().map(Vec::len).sum::<usize>(), things);
            assert!(workers.iter().filter(|took| !took.is_empty()).count() <= things);
        }
    }

    /// Every thread has its own index, and panics reach the caller.
    #[test]
    fn run() {
        let desks: [AtomicUsize; 4] = Default::default();
        Crew::default().run(4, |desk| {
            desks[desk].fetch_add(1, Ordering::Relaxed);
        });
        assert_eq!(desks.map(AtomicUsize::into_inner), [1; 4]);
        for fails in 0..3 {
            let run = || Crew::default().run(3, |desk| assert!(desk != fails, "on purpose"));
            assert!(catch_unwind(AssertUnwindSafe(run)).is_err(), "desk {fails}");
        }
    }
}
