//! Work shared by threads.

use std::sync::{Mutex, PoisonError};

/// Does all the work, on as many threads as there are workers, each taking the next thing when it is done with one. The
/// calling thread is one of them.
pub(crate) fn share<W: Send, I>(workers: &mut [W], work: I, act: impl Fn(&mut W, I::Item) + Sync)
where
    I: Iterator + Send,
{
    let Some((mine, others)) = workers.split_first_mut() else { return };
    // No more threads than things to do, where their number is known.
    let count = match work.size_hint() {
        (least, Some(most)) if least == most => most.saturating_sub(1).min(others.len()),
        _ => others.len(),
    };
    let others = &mut others[..count];
    if others.is_empty() {
        return work.for_each(|item| act(mine, item));
    }
    let work = Mutex::new(work);
    let run = |worker: &mut W| {
        loop {
            let next = work.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(item) = next else { break };
            act(worker, item);
        }
    };
    std::thread::scope(|scope| {
        for worker in others {
            scope.spawn(|| run(worker));
        }
        run(mine);
    });
}
