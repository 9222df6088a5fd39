use super::*;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::ThreadId;

fn me() -> ThreadId {
    std::thread::current().id()
}

/// Completed items: number, slot, thread.
type CompletedItems = Vec<(usize, usize, ThreadId)>;

/// Runs a slow job that takes the numbers below `count`; it panics at the number `fail`.
fn numbers(threads: &Workers, slots: usize, count: usize, fail: Option<usize>) -> CompletedItems {
    let (next, taken) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    threads.run(slots, &|slot| {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= count {
                return;
            }
            assert!(fail != Some(number), "fails on purpose");
            lock(&taken).push((number, slot, me()));
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
    });
    taken.into_inner().unwrap_or_else(PoisonError::into_inner)
}

#[test]
fn reused_threads() {
    let threads = Workers::default();
    let mut seen = BTreeSet::new();
    for round in 0..20 {
        let taken = numbers(&threads, 3, 10, None);
        let mut numbers: Vec<usize> = taken.iter().map(|(number, ..)| *number).collect();
        numbers.sort_unstable();
        assert!(numbers.iter().copied().eq(0..10), "round {round}: {numbers:?}");
        assert!(taken.iter().all(|(_, slot, thread)| *slot < 3 && (*slot == 0) == (*thread == me())));
        seen.extend(taken.iter().map(|(_, _, thread)| format!("{thread:?}")));
    }
    assert!((2..=3).contains(&seen.len()), "{seen:?}");
    assert_eq!(threads.started(), 2);
}

/// Other threads write borrowed data, which belong to the caller again afterwards.
#[test]
fn borrowed_data() {
    let threads = Workers::default();
    let mut helped = 0;
    for round in 1..=200 {
        let mut parts = vec![[0usize; 64]; 32];
        let hands: Vec<_> = parts.iter_mut().map(Mutex::new).collect();
        let next = AtomicUsize::new(0);
        let others = AtomicUsize::new(0);
        threads.run(4, &|slot| {
            while let Some(part) = hands.get(next.fetch_add(1, Ordering::Relaxed)) {
                lock(part).fill(round);
                others.fetch_add(slot.min(1), Ordering::Relaxed);
                std::thread::yield_now();
            }
        });
        drop(hands);
        assert!(parts.iter().flatten().all(|&number| number == round));
        helped += others.into_inner();
    }
    assert!(helped > 0, "control: a worker took part");
}

#[test]
fn alone() {
    let threads = Workers::default();
    assert_eq!(numbers(&threads, 1, 5, None).len(), 5);
    assert_eq!(threads.started(), 0);
    // A second caller while the workers are busy.
    let (there, over) = (AtomicBool::new(false), AtomicBool::new(false));
    std::thread::scope(|scope| {
        scope.spawn(|| {
            threads.run(2, &|_| {
                there.store(true, Ordering::Relaxed);
                while !over.load(Ordering::Relaxed) {
                    std::thread::sleep(std::time::Duration::from_millis(1));
                }
            });
        });
        while !there.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
        let taken = numbers(&threads, 2, 5, None);
        over.store(true, Ordering::Relaxed);
        assert!(taken.iter().all(|(_, slot, thread)| *slot == 0 && *thread == me()));
        assert_eq!(taken.len(), 5);
    });
}

#[test]
fn end_of_threads() {
    let threads = Workers::default();
    numbers(&threads, 3, 5, None);
    let shared = Arc::downgrade(&threads.shared);
    assert_eq!(shared.strong_count(), 3, "one reference of the pool and one per worker");
    drop(threads);
    assert_eq!(shared.strong_count(), 0);
}

/// A panic on any thread reaches the caller, and the threads keep working.
#[test]
fn panics() {
    let threads = Workers::default();
    for fail in 0..6 {
        let run = || numbers(&threads, 3, 10, Some(fail));
        assert!(catch_unwind(AssertUnwindSafe(run)).is_err(), "{fail}");
    }
    assert_eq!(numbers(&threads, 3, 10, None).len(), 10);
}

/// Regression test: a caller that waited for its helper had already withdrawn its work. Another caller could then post
/// its own work and receive the panic. The pool now belongs to one caller until all helpers are done.
#[test]
fn panics_of_two_callers() {
    let threads = Workers::default();
    for round in 0..300 {
        let (there, now) = (AtomicBool::new(false), AtomicBool::new(false));
        // Panics in every slot but the first, once `now` is set.
        let fails_late = |slot| {
            if slot == 0 {
                // Waits for a helper, because `run` does not wait for late helpers.
                while !there.load(Ordering::Relaxed) {
                    std::thread::yield_now();
                }
                return;
            }
            there.store(true, Ordering::Relaxed);
            while !now.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
            // `resume_unwind` skips the panic hook, which would print 300 messages.
            resume_unwind(Box::new("fails on purpose"));
        };
        std::thread::scope(|scope| {
            let first = scope.spawn(|| catch_unwind(AssertUnwindSafe(|| threads.run(2, &fails_late))).is_err());
            // The helper runs its slot, and its caller waits for it.
            while !there.load(Ordering::Relaxed) || lock(&threads.shared.job).work.is_some() {
                std::thread::yield_now();
            }
            now.store(true, Ordering::Relaxed);
            while !first.is_finished() {
                let run = catch_unwind(AssertUnwindSafe(|| threads.run(2, &|_| ())));
                assert!(run.is_ok(), "round {round}: a panic of another caller's job arrived here");
            }
            assert!(first.join().unwrap_or(false), "round {round}: the panic of its own job did not reach the caller");
        });
    }
}
