//! Memory of steps, solves, sensors and frames: after the first ones, none is allocated.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod kinematics;
mod measuring;
mod rendering;
mod update;

use kinetoscope_exec::ThreadPool;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Barrier};

/// Allocations of this thread.
fn allocations(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).count_total
}

/// Asserts that 20 calls in a row return 0 within 400 calls: which thread does which share is chance, and the memory of
/// each thread grows to the need of its largest share.
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

/// Allocations of all slots of a pool, and the number of slots that worked.
#[derive(Debug, Default)]
struct Counting {
    allocations: AtomicU64,
    visits: AtomicU64,
}

impl Counting {
    /// A pool for jobs of `slots` slots that counts here.
    fn pool(self: &Arc<Self>, slots: usize) -> ThreadPool {
        let (counting, start) = (Arc::clone(self), Barrier::new(slots));
        let pool = ThreadPool::new().with_hook(move |slot, of, work| {
            // All start together: the first one would otherwise do it all.
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

/// The control of all tests here: the counter counts.
#[test]
fn counter() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![0u8; 100]))), 1);
}
