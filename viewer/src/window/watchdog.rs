//! Watchdog of an X11 connection: closes the connection to a display that does not respond, so that no thread blocks
//! forever.

use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Maximum duration of a request or of opening a window. An image takes seconds over a slow network.
pub(super) const TIMEOUT: Duration = Duration::from_secs(15);
/// Interval between two checks. Checks are counted instead of measuring time, so that a suspended program does not time
/// out.
const CHECK_INTERVAL: Duration = Duration::from_secs(1);

/// Watches the requests of one connection on its own thread, until it is dropped.
#[derive(Debug)]
pub(super) struct Watchdog {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    /// Number of started plus finished requests: odd while a request is in progress.
    requests: AtomicU64,
    timed_out: AtomicBool,
    stop: Mutex<bool>,
    stop_changed: Condvar,
}

impl Watchdog {
    /// Starts a thread that watches the connection of `socket`.
    ///
    /// # Errors
    /// The operating system cannot start a thread.
    pub(super) fn start(socket: OwnedFd) -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let own = Arc::clone(&shared);
        // `shutdown` works for any kind of socket.
        let socket = UnixStream::from(socket);
        let thread = std::thread::Builder::new().name("kinetoscope-watch".into());
        let thread = thread.spawn(move || own.watch(&socket))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Runs a request that may block on the display.
    pub(super) fn request<T>(&self, request: impl FnOnce() -> T) -> T {
        self.shared.requests.fetch_add(1, Ordering::AcqRel);
        let result = request();
        self.shared.requests.fetch_add(1, Ordering::AcqRel);
        result
    }

    /// True if the connection was closed because the display did not respond.
    pub(super) fn has_timed_out(&self) -> bool {
        self.shared.timed_out.load(Ordering::Acquire)
    }
}

impl Shared {
    fn watch(&self, socket: &UnixStream) {
        let (mut last, mut checks) = (0, 0);
        let mut over = self.stop.lock().unwrap_or_else(PoisonError::into_inner);
        while !*over {
            over = self.stop_changed.wait_timeout(over, CHECK_INTERVAL).unwrap_or_else(PoisonError::into_inner).0;
            if *over {
                return;
            }
            let requests = self.requests.load(Ordering::Acquire);
            checks = if requests % 2 == 1 && requests == last { checks + 1 } else { 0 };
            last = requests;
            if CHECK_INTERVAL * checks >= TIMEOUT {
                self.timed_out.store(true, Ordering::Release);
                // The shutdown wakes the blocked thread. If it fails, the connection is already closed.
                let _ = socket.shutdown(std::net::Shutdown::Both);
                return;
            }
        }
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        *self.shared.stop.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.shared.stop_changed.notify_all();
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has ended as well.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use std::io::Read;
    use std::time::Instant;

    /// An unanswered request ends with its connection, but not before the timeout. Idle requests do not close the
    /// connection.
    #[test]
    fn unanswered_request() {
        let (own, other) = UnixStream::pair().unwrap();
        let watch = Watchdog::start(own.try_clone().unwrap().into()).unwrap();
        let start = Instant::now();
        assert_eq!(watch.request(|| (&own).read(&mut [0])).unwrap(), 0, "the connection is closed");
        assert!(start.elapsed() >= TIMEOUT && watch.has_timed_out(), "{:?}", start.elapsed());
        drop(other);
        let (own, _other) = UnixStream::pair().unwrap();
        let idle = Watchdog::start(own.into()).unwrap();
        (0..3).for_each(|_| idle.request(|| ()));
        assert!(!idle.has_timed_out());
        let start = Instant::now();
        drop(idle);
        assert!(start.elapsed() < CHECK_INTERVAL, "it is not waited for");
    }
}
