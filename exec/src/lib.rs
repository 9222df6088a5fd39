//! A thread pool with scoped borrows: persistent worker threads run jobs that borrow data of the caller.
//!
//! Physics, renderers and ray casters share one [`ThreadPool`]. Its threads start with the first job that needs them
//! and then persist: a job costs no thread start and, after the first one, no allocation.
//!
//! | file | content |
//! |---|---|
//! | `thread_pool.rs` | [`ThreadPool`]: the interface |
//! | `workers.rs` | the worker threads, and all unsafe code of this crate |
//! | `spin_limit.rs` | time for which an idle worker spins before it sleeps |
//!
//! ```
//! use kinetoscope_exec::ThreadPool;
//!
//! let mut squares = [0; 100];
//! ThreadPool::new().for_each(&mut [(); 4], squares.iter_mut().enumerate(), |(), (i, square)| *square = i * i);
//! assert_eq!(squares[9], 81);
//! ```

mod spin_limit;
mod thread_pool;
mod workers;

pub use thread_pool::ThreadPool;
