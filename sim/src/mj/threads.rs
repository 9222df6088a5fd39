//! Threads that stay, and are lent what the caller borrows.
//!
//! Threads of a scope may borrow too, but start and end each time: some 0.05 ms and a few allocations, several times a
//! picture. To lend to threads that stay, the compiler has to be told that the loan ends in time. It is here because no
//! other folder may do that; it calls nothing of MuJoCo's.

use kinetoscope_sensors::{Crew, Threads};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Work of a caller that waits until nobody does it any more.
type Lent = &'static (dyn Fn(usize) + Sync);

/// Threads that wait for work. They start when there is first enough to do for several, sleep in between, and end with
/// their owner.
#[derive(Default)]
pub(crate) struct StayingThreads {
    shared: Arc<Shared>,
    threads: Mutex<Vec<JoinHandle<()>>>,
}

#[derive(Default)]
struct Shared {
    board: Mutex<Board>,
    wake: Condvar,
    done: Condvar,
}

/// Threads that stay until the last clone is dropped, as every simulation has them for its sensors: for whoever draws
/// without a simulation.
///
/// ```
/// use kinetoscope_sensors::camera::{ParallelRasterizer, RasterCfg};
///
/// let rasterizer = ParallelRasterizer::new(RasterCfg::default(), 2).with_crew(crate::staying_crew());
/// # assert_eq!(rasterizer.threads(), 2);
/// ```
pub fn staying_crew() -> Crew {
    Crew::new(Arc::new(StayingThreads::default()))
}

/// What is to be done now. It is one caller's at a time, from its call until its dismissal is over.
#[derive(Default)]
struct Board {
    /// Whose it is: somebody's who has not dismissed everybody yet.
    taken: bool,
    work: Option<Lent>,
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

/// Where the threads are busy with something else, or the system gives none, the calling one works alone.
impl Threads for StayingThreads {
    fn run(&self, desks: usize, work: &(dyn Fn(usize) + Sync)) {
        if desks < 2 || !self.call(desks, work) {
            return work(0);
        }
        let mine = catch_unwind(AssertUnwindSafe(|| work(0)));
        let panicked = self.shared.dismiss();
        if let Err(panic) = mine {
            resume_unwind(panic);
        }
        assert!(!panicked, "work of a sensor panicked on another thread");
    }
}

impl fmt::Debug for StayingThreads {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StayingThreads").field("started", &lock(&self.threads).len()).finish()
    }
}

impl StayingThreads {
    /// Calls for helpers; `false` where there are none. Who gets `true` must dismiss them before `work` ends.
    fn call(&self, desks: usize, work: &(dyn Fn(usize) + Sync)) -> bool {
        let helpers = self.helpers(desks - 1);
        let mut board = lock(&self.shared.board);
        if helpers == 0 || board.taken {
            return false;
        }
        // SAFETY: nobody uses it after the loan. It stands on the board until `dismiss` takes it down, and who has read it
        // there counts in `helping`, which `dismiss` waits for. `run`, the only caller, comes to `dismiss` on every way:
        // its own share of the work cannot unwind past it, and nothing else in between can panic.
        let lent = unsafe { std::mem::transmute::<&(dyn Fn(usize) + Sync), Lent>(work) };
        board.taken = true;
        (board.work, board.desk, board.desks) = (Some(lent), 1, 1 + helpers);
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

impl Drop for StayingThreads {
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
            let Some(work) = board.work.filter(|_| free) else {
                board = self.wake.wait(board).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            let desk = board.desk;
            board.desk += 1;
            board.helping += 1;
            drop(board);
            let done = catch_unwind(AssertUnwindSafe(|| work(desk)));
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
mod tests;
