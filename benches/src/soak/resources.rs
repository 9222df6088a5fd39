//! Resources of this process: resident memory, open files and threads.

use crate::SoakResult;
use std::time::{Duration, Instant};

/// Time that ended threads and closed connections get to leave the lists of the system.
const SETTLING: Duration = Duration::from_secs(1);

/// Resources at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Resources {
    /// Resident memory \[bytes\].
    pub(crate) memory: u64,
    /// Number of open file descriptors.
    pub(crate) files: usize,
    /// Number of threads.
    pub(crate) threads: usize,
}

impl Resources {
    /// Reads the resources from `/proc/self`.
    ///
    /// # Errors
    /// The system has no such files.
    pub(crate) fn now() -> SoakResult<Self> {
        // `smaps_rollup` is exact; the sums of `status` and `statm` are off by some hundred kilobytes (proc(5)).
        let text = read("smaps_rollup")?;
        let memory = kibibytes(&text, "Rss:").ok_or("/proc/self/smaps_rollup has no line `Rss:`")? * 1024;
        Ok(Self { memory, files: count("fd")?, threads: count("task")? })
    }

    /// Reads the resources when files and threads have reached those of an earlier time, or after a second.
    ///
    /// # Errors
    /// As [`now`](Self::now).
    pub(crate) fn settled(earlier: Option<&Self>) -> SoakResult<Self> {
        let start = Instant::now();
        loop {
            let now = Self::now()?;
            let has_settled = earlier.is_none_or(|old| now.files <= old.files && now.threads <= old.threads);
            if has_settled || start.elapsed() > SETTLING {
                return Ok(now);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn read(name: &str) -> SoakResult<String> {
    let path = format!("/proc/self/{name}");
    std::fs::read_to_string(&path).map_err(|error| format!("{path}: {error}").into())
}

fn count(name: &str) -> SoakResult<usize> {
    let path = format!("/proc/self/{name}");
    Ok(std::fs::read_dir(&path).map_err(|error| format!("{path}: {error}"))?.count())
}

/// The number in the line of this key.
fn kibibytes(text: &str, key: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(key)?.trim().strip_suffix("kB")?.trim().parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Memory, files and threads that are added on purpose are counted. Other tests of this process add and remove fewer.
    #[test]
    fn what_is_added() {
        let before = Resources::now().unwrap();
        let held = std::hint::black_box(vec![1u8; 64 << 20]);
        let files: Vec<_> = (0..60).map(|_| std::fs::File::open("/proc/self/status").unwrap()).collect();
        let (end, threads): (Vec<_>, Vec<_>) = (0..60)
            .map(|_| {
                let (end, is_over) = std::sync::mpsc::channel::<()>();
                (end, std::thread::spawn(move || is_over.recv()))
            })
            .unzip();
        let after = Resources::now().unwrap();
        assert!(after.memory >= before.memory + (60 << 20), "{before:?} {after:?}");
        assert!(after.files >= before.files + 40 && after.threads >= before.threads + 40, "{before:?} {after:?}");
        drop((held, files, end));
        threads.into_iter().for_each(|thread| assert!(thread.join().unwrap().is_err()));
        let settled = Resources::settled(Some(&before)).unwrap();
        assert!(settled.memory < after.memory - (40 << 20), "{before:?} {after:?} {settled:?}");
    }

    #[test]
    fn keys() {
        let text = "5581 ---p 00000000 [rollup]\nRss:               12345 kB\nPss:                   1 kB\n";
        assert_eq!(kibibytes(text, "Rss:"), Some(12_345));
        assert_eq!(kibibytes(text, "Uss:"), None);
    }
}
