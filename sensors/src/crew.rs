//! Threads that wait for work: started once, shared by the sensors of a simulation.
//!
//! Scoped threads, as cameras use them, cost some 0.05 ms and a few allocations each time. These cost a wake-up. Safe code
//! cannot lend them what the caller borrows: what they work on is shared with them, behind locks that nobody contends for.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Something that several threads do together.
pub(crate) trait Work: Send + Sync {
    /// Does one thing after the other until none is left. `desk` is a number below that of the threads, and nobody else's
    /// meanwhile.
    fn work(&self, desk: usize);
}

/// Threads that wait for work. They start when a sensor first has enough to do for several, sleep in between, and end with
/// the last clone, which are all the same crew.
#[derive(Clone, Default)]
pub struct Crew(Arc<Owner>);

#[derive(Default)]
struct Owner {
    shared: Arc<Shared>,
    threads: Mutex<Vec<JoinHandle<()>>>,
}

#[derive(Default)]
struct Shared {
    board: Mutex<Board>,
    wake: Condvar,
    done: Condvar,
}

/// What is to be done now. It is one caller's at a time, from its call until its dismissal is over.
#[derive(Default)]
struct Board {
    /// Whose it is: somebody's who has not dismissed everybody yet.
    taken: bool,
    work: Option<Arc<dyn Work>>,
    /// The next desk to take, and how many there are.
    desk: usize,
    desks: usize,
    /// Threads that are at a desk, but for the calling one.
    helping: usize,
    panicked: bool,
    stop: bool,
}

/// What panics is raised again by who called, and then no lock is of use any more.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Crew {
    /// Works on `work` with up to `threads` threads, the calling one included, which has desk 0. Where the crew is busy with
    /// something else, or the system gives no thread, the calling one works alone.
    ///
    /// # Panics
    ///
    /// `work` panicked.
    pub(crate) fn run<W: Work + 'static>(&self, threads: usize, work: &Arc<W>) {
        if threads < 2 || !self.0.call(threads, work) {
            return work.work(0);
        }
        let mine = catch_unwind(AssertUnwindSafe(|| work.work(0)));
        let panicked = self.0.shared.dismiss();
        if let Err(panic) = mine {
            resume_unwind(panic);
        }
        assert!(!panicked, "work of a sensor panicked on another thread");
    }
}

impl fmt::Debug for Crew {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Crew").field("threads", &lock(&self.0.threads).len()).finish()
    }
}

impl Owner {
    /// Calls for helpers; `false` where there are none.
    fn call<W: Work + 'static>(&self, threads: usize, work: &Arc<W>) -> bool {
        let helpers = self.helpers(threads - 1);
        let mut board = lock(&self.shared.board);
        if helpers == 0 || board.taken {
            return false;
        }
        let work: Arc<dyn Work> = Arc::<W>::clone(work);
        board.taken = true;
        (board.work, board.desk, board.desks) = (Some(work), 1, 1 + helpers);
        drop(board);
        for _ in 0..helpers {
            self.shared.wake.notify_one();
        }
        true
    }

    /// Starts threads until there are `wanted`; gives how many can help.
    fn helpers(&self, wanted: usize) -> usize {
        let mut threads = lock(&self.threads);
        while threads.len() < wanted {
            let shared = Arc::clone(&self.shared);
            let name = format!("kinetoscope-sensors-{}", threads.len() + 1);
            match std::thread::Builder::new().name(name).spawn(move || shared.help()) {
                Ok(thread) => threads.push(thread),
                Err(_) => break,
            }
        }
        wanted.min(threads.len())
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        lock(&self.shared.board).stop = true;
        self.shared.wake.notify_all();
        for thread in lock(&self.threads).drain(..) {
            let _ = thread.join();
        }
    }
}

impl Shared {
    /// Takes the work from the board, waits for those who are at it, and leaves the board to others; gives whether one of
    /// them panicked. Who has not woken up by now is not waited for.
    fn dismiss(&self) -> bool {
        let mut board = lock(&self.board);
        board.work = None;
        while board.helping > 0 {
            board = self.done.wait(board).unwrap_or_else(PoisonError::into_inner);
        }
        board.taken = false;
        std::mem::take(&mut board.panicked)
    }

    /// The life of a thread.
    fn help(&self) {
        let mut board = lock(&self.board);
        while !board.stop {
            let free = board.desk < board.desks;
            let Some(work) = board.work.as_ref().filter(|_| free).map(Arc::clone) else {
                board = self.wake.wait(board).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            let desk = board.desk;
            board.desk += 1;
            board.helping += 1;
            drop(board);
            let done = catch_unwind(AssertUnwindSafe(|| work.work(desk)));
            // Before the others go on: the last one to hold it would free it.
            drop(work);
            board = lock(&self.board);
            board.panicked |= done.is_err();
            board.helping -= 1;
            if board.helping == 0 {
                self.done.notify_all();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::thread::ThreadId;

    /// Takes numbers up to `count`, slowly; fails at `fail`.
    #[derive(Default)]
    struct Numbers {
        next: AtomicUsize,
        count: usize,
        fail: Option<usize>,
        taken: Mutex<Vec<(usize, usize, ThreadId)>>,
    }

    impl Work for Numbers {
        fn work(&self, desk: usize) {
            loop {
                let number = self.next.fetch_add(1, Ordering::Relaxed);
                if number >= self.count {
                    return;
                }
                assert!(self.fail != Some(number), "told to fail");
                lock(&self.taken).push((number, desk, std::thread::current().id()));
                std::thread::sleep(std::time::Duration::from_millis(2));
            }
        }
    }

    #[test]
    fn everything_is_done_once_by_threads_that_stay() {
        let crew = Crew::default();
        let mut threads = BTreeSet::new();
        for round in 0..20 {
            let work = Arc::new(Numbers { count: 10, ..Numbers::default() });
            crew.run(3, &work);
            let taken = lock(&work.taken);
            let mut numbers: Vec<usize> = taken.iter().map(|(number, ..)| *number).collect();
            numbers.sort_unstable();
            assert!(numbers.iter().copied().eq(0..10), "round {round}: {numbers:?}");
            assert!(taken.iter().all(|(_, desk, thread)| *desk < 3 && (*desk == 0) == (*thread == me())));
            threads.extend(taken.iter().map(|(_, _, thread)| format!("{thread:?}")));
        }
        assert!((2..=3).contains(&threads.len()), "{threads:?}");
        assert_eq!(format!("{crew:?}"), "Crew { threads: 2 }");
    }

    fn me() -> ThreadId {
        std::thread::current().id()
    }

    #[test]
    fn one_thread_and_a_busy_crew_work_alone() {
        let crew = Crew::default();
        let work = Arc::new(Numbers { count: 5, ..Numbers::default() });
        crew.run(1, &work);
        assert_eq!((lock(&work.taken).len(), format!("{crew:?}").as_str()), (5, "Crew { threads: 0 }"));
        // While the crew does one thing, somebody else asks it to do another.
        let long = Arc::new(Waiting::default());
        std::thread::scope(|scope| {
            scope.spawn(|| crew.run(2, &long));
            while long.there.load(Ordering::Relaxed) == 0 {
                std::thread::yield_now();
            }
            let short = Arc::new(Numbers { count: 5, ..Numbers::default() });
            crew.run(2, &short);
            long.over.store(true, Ordering::Relaxed);
            assert!(lock(&short.taken).iter().all(|(_, desk, thread)| *desk == 0 && *thread == me()));
            assert_eq!(lock(&short.taken).len(), 5);
        });
    }

    /// Lasts until it is told that it is over.
    #[derive(Default)]
    struct Waiting {
        there: AtomicUsize,
        over: AtomicBool,
    }

    impl Work for Waiting {
        fn work(&self, _desk: usize) {
            self.there.fetch_add(1, Ordering::Relaxed);
            while !self.over.load(Ordering::Relaxed) {
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
        }
    }

    #[test]
    fn threads_end_with_the_last_clone() {
        let crew = Crew::default();
        crew.run(3, &Arc::new(Numbers { count: 5, ..Numbers::default() }));
        let (clone, shared) = (crew.clone(), Arc::downgrade(&crew.0.shared));
        drop(crew);
        assert_eq!(shared.strong_count(), 3, "its owner and two threads");
        drop(clone);
        assert_eq!(shared.strong_count(), 0);
    }

    /// A panic reaches the caller, whichever thread it was on, and the crew goes on.
    #[test]
    fn panics_reach_the_caller() {
        let crew = Crew::default();
        for fail in 0..6 {
            let work = Arc::new(Numbers { count: 10, fail: Some(fail), ..Numbers::default() });
            assert!(catch_unwind(AssertUnwindSafe(|| crew.run(3, &work))).is_err(), "{fail}");
        }
        let work = Arc::new(Numbers { count: 10, ..Numbers::default() });
        crew.run(3, &work);
        assert_eq!(lock(&work.taken).len(), 10);
    }

    /// Root cause: whoever dismissed next took the panic. A caller that waited for its helper had already taken its work
    /// from the board, so that another caller could put up its own there before the first one woke: that one's dismissal
    /// then took the note of the panic. The board is one caller's now until that caller has dismissed everybody.
    #[test]
    fn a_panic_reaches_its_own_caller_only() {
        let crew = Crew::default();
        for round in 0..300 {
            let fails = Arc::new(FailsLate::default());
            std::thread::scope(|scope| {
                let first = scope.spawn(|| catch_unwind(AssertUnwindSafe(|| crew.run(2, &fails))).is_err());
                // The helper is at its desk, and its caller waits for it.
                while !fails.there.load(Ordering::Relaxed) || lock(&crew.0.shared.board).work.is_some() {
                    std::thread::yield_now();
                }
                fails.now.store(true, Ordering::Relaxed);
                while !first.is_finished() {
                    let other = Arc::new(Nothing);
                    let run = catch_unwind(AssertUnwindSafe(|| crew.run(2, &other)));
                    assert!(run.is_ok(), "round {round}: the panic of another caller's work");
                }
                assert!(first.join().unwrap_or(false), "round {round}: its own panic did not reach it");
            });
        }
    }

    /// Fails at any desk but the first, when told.
    #[derive(Default)]
    struct FailsLate {
        there: AtomicBool,
        now: AtomicBool,
    }

    impl Work for FailsLate {
        fn work(&self, desk: usize) {
            if desk == 0 {
                // Until a helper came: who is late is not waited for.
                while !self.there.load(Ordering::Relaxed) {
                    std::thread::yield_now();
                }
                return;
            }
            self.there.store(true, Ordering::Relaxed);
            while !self.now.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
            // Without the words that a panic hook prints 300 times.
            resume_unwind(Box::new("told to fail"));
        }
    }

    struct Nothing;

    impl Work for Nothing {
        fn work(&self, _desk: usize) {}
    }
}
