//! Memory allocation of steps, solves, sensors and frames: zero after the first ones.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod kinematics;
mod rendering;
mod sensors;
mod stepping;

use kinetoscope_exec::ThreadPool;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Barrier};

/// Number of allocations of this thread during `work`.
fn allocations(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).count_total
}

/// Asserts that 20 calls in a row return 0 within 400 calls. The assignment of work to threads is random, and the
/// memory of each thread grows to the need of its largest share.
#[track_caller]
fn assert_settles(what: &str, mut allocations: impl FnMut() -> u64) {
    let mut in_a_row = 0;
    for _ in 0..400 {
        in_a_row = if allocations() == 0 { in_a_row + 1 } else { 0 };
        if in_a_row == 20 {
            return;
        }
    }
    panic!("{what}: no 20 in a row without an allocation");
}

/// Number of allocations of all slots of a pool, and number of slots that worked.
#[derive(Debug, Default)]
struct AllocationCounter {
    allocations: AtomicU64,
    visits: AtomicU64,
}

impl AllocationCounter {
    /// Creates a pool that counts the allocations of jobs with `slots` slots.
    fn pool(self: &Arc<Self>, slots: usize) -> ThreadPool {
        let (counting, start) = (Arc::clone(self), Barrier::new(slots));
        let pool = ThreadPool::new().with_hook(move |slot, of, work| {
            // All slots start together; otherwise the first slot could do all the work.
            if of == slots {
                start.wait();
            }
            counting.allocations.fetch_add(allocations(|| work(slot)), Ordering::Relaxed);
            counting.visits.fetch_add(1, Ordering::Relaxed);
        });
        pool.start(slots).unwrap();
        pool
    }
}

/// Control experiment for all tests here: the counter counts an allocation.
#[test]
fn counter() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![0u8; 100]))), 1);
}
