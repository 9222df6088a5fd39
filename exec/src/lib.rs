//! A pool of worker threads that work on what their caller borrows.
//!
//! Physics, renderers and ray casters share one [`ThreadPool`]. Its threads start when work first needs them and then
//! stay: a job costs no thread start and, after the first one, no allocation.
//!
//! | file | content |
//! |---|---|
//! | `thread_pool.rs` | [`ThreadPool`]: the interface |
//! | `workers.rs` | the threads, and the one place of unsafe code in this crate |
//! | `patience.rs` | time for which an idle worker spins before it sleeps |
//!
//! ```
//! use kinetoscope_exec::ThreadPool;
//!
//! let mut squares = [0; 100];
//! ThreadPool::new().for_each(&mut [(); 4], squares.iter_mut().enumerate(), |(), (i, square)| *square = i * i);
//! assert_eq!(squares[9], 81);
//! ```

mod patience;
mod thread_pool;
mod workers;

pub use thread_pool::ThreadPool;
