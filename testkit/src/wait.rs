//! Waiting for what another thread or process does.

use std::time::{Duration, Instant};

/// The longest wait: an event that has not come by then does not come, on a busy machine either.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Waits for a value.
#[track_caller]
pub fn some<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "waited for {PATIENCE:?}: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until a condition holds.
#[track_caller]
pub fn until(what: &str, mut holds: impl FnMut() -> bool) {
    some(what, || holds().then_some(()));
}

/// Number of threads of this process, and of files that it has open. For a process of its own ([`crate::process`]).
pub fn threads_and_files() -> [usize; 2] {
    ["task", "fd"].map(|of| std::fs::read_dir(format!("/proc/self/{of}")).unwrap().count())
}
