//! The writer thread and the interface of file formats.

use crate::error::RecordError;
use crate::packet::Packet;
use crate::stream::Stream;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Longest time until written data is flushed to the file.
const FLUSH_EVERY: Duration = Duration::from_millis(500);

/// Result of a writer.
pub(crate) type Written<T = ()> = std::result::Result<T, Fault>;

/// Error of a writer.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Fault {
    /// The file cannot be written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A limit of the format is exceeded; the text says what to change.
    #[error("{0}")]
    Limit(String),
    /// An animation or a dataset has no frame; the text says what every frame needs.
    #[error("there is no frame: {0}")]
    NoFrame(&'static str),
}

impl Fault {
    pub(crate) fn limit(what: impl Into<String>) -> Self {
        Self::Limit(what.into())
    }

    /// Converts to the error of a recording, with the path of the file.
    pub(crate) fn of_file(self, path: &Path) -> RecordError {
        let path = path.into();
        match self {
            Self::Io(error) => RecordError::File { path, error: Arc::new(error), kept: None },
            Self::Limit(what) => RecordError::Limit { path, what },
            Self::NoFrame(why) => RecordError::NoFrame { path, why },
        }
    }
}

/// Writer of a file format.
pub(crate) trait Sink: Send {
    /// Writes the content of a packet.
    fn write(&mut self, streams: &[Stream], packet: &Packet) -> Written;

    /// Writes buffered data to the file, so that it survives a kill of the process.
    fn flush(&mut self) -> Written;

    /// Completes the file and gives it its name; returns its size \[bytes\].
    fn finish(&mut self, streams: &[Stream]) -> Written<u64>;

    /// Path of the partial file after an error, if it can be read. Otherwise it is deleted when the writer is dropped.
    fn kept(&self) -> Option<PathBuf>;
}

/// Error of a writer, and the partial file that remains.
#[derive(Debug)]
pub(crate) struct Failure {
    /// `None` if the recorder aborted the recording.
    pub(crate) error: Option<Fault>,
    pub(crate) kept: Option<PathBuf>,
}

/// Writes packets until the channel closes, then completes the file.
///
/// After an error, packets are returned unwritten, and `failed` and `why` are set. If the recorder sets `failed`, the
/// file is not completed.
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
                // Fails only after the recorder is gone.
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
    // The recorder sets `failed` to abort the recording.
    if result.is_ok() && failed.load(Ordering::Relaxed) {
        // A partial file is readable up to its end.
        result = sink.flush();
        if result.is_ok() {
            return Err(Failure { error: None, kept: sink.kept() });
        }
    }
    let size = result.and_then(|()| sink.finish(streams));
    size.map_err(|error| Failure { error: Some(error), kept: sink.kept() })
}
