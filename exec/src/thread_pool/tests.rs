use super::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Each item is processed once, by at most as many threads as items, with and without worker threads.
#[test]
fn for_each() {
    for pool in [ThreadPool::new(), ThreadPool::serial()] {
        for (workers, items) in [(1, 5), (3, 0), (3, 1), (3, 100), (8, 3)] {
            let mut workers = vec![Vec::new(); workers];
            let mut seen = vec![0; items];
            pool.for_each(&mut workers, seen.iter_mut().enumerate(), |worker, (index, seen)| {
                *seen += 1;
                worker.push(index);
                std::thread::yield_now();
            });
            assert!(seen.iter().all(|&times| times == 1), "{seen:?}");
            assert_eq!(workers.iter().map(Vec::len).sum::<usize>(), items);
            assert!(workers.iter().filter(|took| !took.is_empty()).count() <= items);
        }
    }
}

/// Each slot runs at most once, inside the hook, and a panic reaches the caller.
#[test]
fn slots_and_hook() {
    let hooked = Arc::new(AtomicUsize::new(0));
    let counter = Arc::clone(&hooked);
    let pool = ThreadPool::new().with_hook(move |slot, _, work| {
        counter.fetch_add(1, Ordering::Relaxed);
        work(slot);
    });
    pool.start(4).expect("three threads");
    assert_eq!(format!("{pool:?}"), "ThreadPool { started: 3, .. }");
    let mut most = 0;
    for _ in 0..200 {
        let slots: [AtomicUsize; 4] = Default::default();
        hooked.store(0, Ordering::Relaxed);
        pool.run(4, |slot| {
            slots[slot].fetch_add(1, Ordering::Relaxed);
            std::thread::yield_now();
        });
        let slots = slots.map(AtomicUsize::into_inner);
        assert!(slots[0] == 1 && slots.iter().all(|&times| times <= 1), "{slots:?}");
        assert_eq!(slots.iter().sum::<usize>(), hooked.load(Ordering::Relaxed));
        most = most.max(slots.iter().sum());
    }
    assert!(most > 1, "control: a worker took part");
    let run = || pool.run(3, |slot| assert!(slot != 0, "fails on purpose"));
    assert!(catch_unwind(AssertUnwindSafe(run)).is_err());
    pool.run(3, |_| ());
}
