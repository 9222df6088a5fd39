//! Waiting for other threads or processes.

use std::time::{Duration, Instant};

/// Longest wait. An event that has not occurred by then does not occur, even on a busy machine.
pub const TIMEOUT: Duration = Duration::from_secs(60);

/// Waits until `found` returns a value, and panics after [`TIMEOUT`].
#[track_caller]
pub fn until_some<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(start.elapsed() < TIMEOUT, "waited for {TIMEOUT:?}: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until a condition holds, and panics after [`TIMEOUT`].
#[track_caller]
pub fn until(what: &str, mut holds: impl FnMut() -> bool) {
    until_some(what, || holds().then_some(()));
}

/// Number of threads and of open files of this process. For tests in their own process ([`crate::process`]).
pub fn threads_and_files() -> [usize; 2] {
    ["task", "fd"].map(|of| std::fs::read_dir(format!("/proc/self/{of}")).unwrap().count())
}
