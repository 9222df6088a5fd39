//! Processor time of single threads of this process.

use crate::other_load::{TICK, process_ticks};
use std::fs;

/// Processor time \[s\] of the thread with a name; `None` without such a thread, with several, or without /proc.
pub(crate) fn thread_seconds(name: &str) -> Option<f64> {
    let threads = fs::read_dir("/proc/self/task").ok()?.flatten().map(|entry| entry.path());
    let is_named = |folder: &std::path::PathBuf| {
        fs::read_to_string(folder.join("comm")).is_ok_and(|found| found.trim_end() == name)
    };
    let mut named = threads.filter(is_named);
    let (Some(thread), None) = (named.next(), named.next()) else { return None };
    Some(process_ticks(&fs::read_to_string(thread.join("stat")).ok()?)? as f64 * TICK)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;
    use std::time::{Duration, Instant};

    /// A busy thread uses processor time, one that sleeps uses none.
    #[test]
    fn busy_and_idle() {
        for (name, busy) in [("busy-thread", true), ("idle-thread", false)] {
            let (ready, started) = channel();
            let (end, ended) = channel::<()>();
            let work = move || {
                let start = Instant::now();
                let mut x = 1_u64;
                while start.elapsed() < Duration::from_millis(200) {
                    if busy {
                        x = std::hint::black_box(x.wrapping_mul(3));
                    } else {
                        std::thread::sleep(Duration::from_millis(20));
                    }
                }
                let _ = ready.send(());
                let _ = ended.recv();
            };
            let thread = std::thread::Builder::new().name(name.into()).spawn(work);
            let _ = started.recv();
            if let Some(used) = thread_seconds(name) {
                // Other programs may use the core for a part of the time.
                assert!(if busy { used > 0.02 } else { used < 0.1 }, "{name}: {used}");
            }
            drop(end);
            let _ = thread.map(std::thread::JoinHandle::join);
        }
    }
}
