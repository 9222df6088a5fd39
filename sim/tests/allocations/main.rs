//! Memory of steps, solves, sensors and frames: after the first ones, none is allocated.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod kinematics;
mod measuring;
mod rendering;
mod update;

use kinetoscope_sensors::{ScopedThreads, Threads};
use std::sync::Barrier;
use std::sync::atomic::{AtomicU64, Ordering};

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

/// Threads that count allocations and visits of all workers.
#[derive(Debug, Default)]
struct Counting {
    allocations: AtomicU64,
    visits: AtomicU64,
}

impl Threads for Counting {
    fn run(&self, workers: usize, work: &(dyn Fn(usize) + Sync)) {
        // All start together: the first one would otherwise do it all.
        let start = Barrier::new(workers);
        ScopedThreads.run(workers, &|worker| {
            start.wait();
            self.allocations.fetch_add(allocations(|| work(worker)), Ordering::Relaxed);
            self.visits.fetch_add(1, Ordering::Relaxed);
        });
    }
}

/// The control of all tests here: the counter counts.
#[test]
fn counter() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![0u8; 100]))), 1);
}
