//! Ends the connection to a display that does not answer: whoever waits for it would wait for ever.

use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// How long a display may take for one request, or to let somebody in: a picture takes seconds where the way to it is slow.
pub(super) const PATIENCE: Duration = Duration::from_secs(15);
/// Between two looks. They are counted, not timed: a program that was stopped and goes on has not waited.
const LOOK: Duration = Duration::from_secs(1);

/// Watches the requests of one connection, on a thread of its own, until it is dropped.
#[derive(Debug)]
pub(super) struct Watch {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    /// Begun and ended requests: an odd number while one is on its way.
    requests: AtomicU64,
    frozen: AtomicBool,
    over: Mutex<bool>,
    ends: Condvar,
}

impl Watch {
    /// Watches a connection, whose socket this is.
    ///
    /// # Errors
    /// The operating system gives no thread.
    pub(super) fn start(socket: OwnedFd) -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let own = Arc::clone(&shared);
        // Any kind of socket is shut down alike.
        let socket = UnixStream::from(socket);
        let thread = std::thread::Builder::new().name("kinetoscope-watch".into());
        let thread = thread.spawn(move || own.watch(&socket))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Does something that may wait for the display.
    pub(super) fn request<T>(&self, request: impl FnOnce() -> T) -> T {
        self.shared.requests.fetch_add(1, Ordering::AcqRel);
        let result = request();
        self.shared.requests.fetch_add(1, Ordering::AcqRel);
        result
    }

    /// Whether the connection was ended because the display did not answer.
    pub(super) fn is_frozen(&self) -> bool {
        self.shared.frozen.load(Ordering::Acquire)
    }
}

impl Shared {
    fn watch(&self, socket: &UnixStream) {
        let (mut last, mut looks) = (0, 0);
        let mut over = self.over.lock().unwrap_or_else(PoisonError::into_inner);
        while !*over {
            over = self.ends.wait_timeout(over, LOOK).unwrap_or_else(PoisonError::into_inner).0;
            if *over {
                return;
            }
            let requests = self.requests.load(Ordering::Acquire);
            looks = if requests % 2 == 1 && requests == last { looks + 1 } else { 0 };
            last = requests;
            if LOOK * looks >= PATIENCE {
                self.frozen.store(true, Ordering::Release);
                // Whoever waits is woken by it; where that fails the connection is gone already.
                let _ = socket.shutdown(std::net::Shutdown::Both);
                return;
            }
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        *self.shared.over.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.shared.ends.notify_all();
        if let Some(thread) = self.thread.take() {
            // One that panicked has ended as well.
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

    /// A request without an answer ends with its connection, not before its time; idle requests end nothing.
    #[test]
    fn unanswered_request() {
        let (own, other) = UnixStream::pair().unwrap();
        let watch = Watch::start(own.try_clone().unwrap().into()).unwrap();
        let start = Instant::now();
        assert_eq!(watch.request(|| (&own).read(&mut [0])).unwrap(), 0, "the connection is closed");
        assert!(start.elapsed() >= PATIENCE && watch.is_frozen(), "{:?}", start.elapsed());
        drop(other);
        let (own, _other) = UnixStream::pair().unwrap();
        let idle = Watch::start(own.into()).unwrap();
        (0..3).for_each(|_| idle.request(|| ()));
        assert!(!idle.is_frozen());
        let start = Instant::now();
        drop(idle);
        assert!(start.elapsed() < LOOK, "it is not waited for");
    }
}
