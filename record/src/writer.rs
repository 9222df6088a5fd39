//! The thread that writes: packets in, a file out.

use crate::error::RecordError;
use crate::packet::Packet;
use crate::stream::Stream;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// What is written may be read by others after this long at the latest.
const FLUSH_EVERY: Duration = Duration::from_millis(500);

/// What comes of writing.
pub(crate) type Written<T = ()> = std::result::Result<T, Fault>;

/// Why something was not written.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Fault {
    /// The disk says no.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The format has no place for so much; what would be right.
    #[error("{0}")]
    Limit(String),
    /// Of animations and datasets, where every frame needs something that never came; what.
    #[error("there is no frame: {0}")]
    NoFrame(&'static str),
}

impl Fault {
    pub(crate) fn limit(what: impl Into<String>) -> Self {
        Self::Limit(what.into())
    }

    /// The error of the recording of a file.
    pub(crate) fn of_file(self, path: &Path) -> RecordError {
        let path = path.into();
        match self {
            Self::Io(error) => RecordError::File { path, error: Arc::new(error), kept: None },
            Self::Limit(what) => RecordError::Limit { path, what },
            Self::NoFrame(why) => RecordError::NoFrame { path, why },
        }
    }
}

/// A file of some format on its way.
pub(crate) trait Sink: Send {
    /// Writes what is in a packet.
    fn write(&mut self, streams: &[Stream], packet: &Packet) -> Written;

    /// Brings what was written to where a killed process leaves it.
    fn flush(&mut self) -> Written;

    /// Makes the file whole and gives it its name; returns its size \[bytes\].
    fn finish(&mut self, streams: &[Stream]) -> Written<u64>;

    /// After an error: where what was written can be read. What nobody can read is taken away with the sink.
    fn kept(&self) -> Option<PathBuf>;
}

/// Why a file was not finished, and where what can be read of it is.
#[derive(Debug)]
pub(crate) struct Failure {
    /// `None` where the recorder broke it off.
    pub(crate) error: Option<Fault>,
    pub(crate) kept: Option<PathBuf>,
}

/// Writes packets until nobody sends any more, then finishes the file. After an error, packets go back unwritten, and
/// `failed` and `why` are set; if it was set by the recorder, the file is not finished.
pub(crate) fn run(
    mut sink: Box<dyn Sink>,
    streams: &[Stream],
    full: &Receiver<Packet>,
    free: &Sender<Packet>,
    failed: &AtomicBool,
    why: &OnceLock<String>,
) -> Result<u64, Failure> {
    let mut result = Ok(());
    let mut flushed = Instant::now();
    let mut dirty = false;
    loop {
        let wait = if dirty { FLUSH_EVERY.saturating_sub(flushed.elapsed()) } else { Duration::MAX };
        let received = match wait {
            Duration::MAX => full.recv().map_err(|_| RecvTimeoutError::Disconnected),
            wait => full.recv_timeout(wait),
        };
        match received {
            Ok(mut packet) => {
                if !dirty {
                    flushed = Instant::now();
                }
                if result.is_ok() {
                    result = sink.write(streams, &packet);
                    dirty = true;
                }
                packet.clear();
                // The recorder is gone when it does not take it back.
                let _ = free.send(packet);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if dirty && result.is_ok() && flushed.elapsed() >= FLUSH_EVERY {
            result = sink.flush();
            dirty = false;
        }
        if let Err(error) = &result {
            dirty = false;
            why.get_or_init(|| error.to_string());
            failed.store(true, Ordering::Relaxed);
        }
    }
    // The recorder too may have found that the file cannot become what was asked for.
    if result.is_ok() && failed.load(Ordering::Relaxed) {
        // What is there can be read as far as it goes.
        result = sink.flush();
        if result.is_ok() {
            return Err(Failure { error: None, kept: sink.kept() });
        }
    }
    let size = result.and_then(|()| sink.finish(streams));
    size.map_err(|error| Failure { error: Some(error), kept: sink.kept() })
}
