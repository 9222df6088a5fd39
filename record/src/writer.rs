//! The writer thread and the interface of file formats.

use crate::error::RecordError;
use crate::packet::Packet;
use crate::stream::StreamSchema;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Longest time until written data is flushed to the file.
const FLUSH_EVERY: Duration = Duration::from_millis(500);

/// Result of a writer.
pub(crate) type WriteResult<T = ()> = std::result::Result<T, WriteError>;

/// Error of a writer.
#[derive(Debug, thiserror::Error)]
pub(crate) enum WriteError {
    /// The file cannot be written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A limit of the format is exceeded; the text says what to change.
    #[error("{0}")]
    Limit(String),
    /// An animation or a dataset has no frame; the text is the reason.
    #[error("the recording has no frame: {0}")]
    NoFrame(&'static str),
}

impl WriteError {
    pub(crate) fn limit(what: impl Into<String>) -> Self {
        Self::Limit(what.into())
    }

    /// Converts to the error of a recording, with the path of the file.
    pub(crate) fn into_record_error(self, path: &Path) -> RecordError {
        let path = path.into();
        match self {
            Self::Io(error) => RecordError::File { path, error: Arc::new(error), partial_file: None },
            Self::Limit(what) => RecordError::Limit { path, what },
            Self::NoFrame(why) => RecordError::NoFrame { path, why },
        }
    }
}

/// Writer of a file format.
pub(crate) trait FormatWriter: Send {
    /// Writes the content of a packet.
    fn write(&mut self, streams: &[StreamSchema], packet: &Packet) -> WriteResult;

    /// Writes buffered data to the file, so that it survives a kill of the process. By default does nothing, for formats
    /// that are not readable before their end.
    fn flush(&mut self) -> WriteResult {
        Ok(())
    }

    /// Completes the file, renames it to its final name, and returns its size \[bytes\]. Called once.
    fn finish(&mut self, streams: &[StreamSchema]) -> WriteResult<u64>;

    /// Path of the partial file after an error, if it can be read. Otherwise it is deleted when the writer is dropped.
    fn partial_path(&self) -> Option<PathBuf>;
}

/// Error of a writer, and the partial file that remains.
#[derive(Debug)]
pub(crate) struct WriterFailure {
    /// `None` if the recorder aborted the recording.
    pub(crate) error: Option<WriteError>,
    pub(crate) partial_path: Option<PathBuf>,
}

/// Writes packets until the channel closes, then completes the file.
///
/// After an error, packets are returned unwritten, and `failed` and `reason` are set. If the recorder sets `failed`,
/// the file is not completed.
pub(crate) fn run(
    mut sink: Box<dyn FormatWriter>,
    streams: &[StreamSchema],
    filled: &Receiver<Packet>,
    empty: &Sender<Packet>,
    failed: &AtomicBool,
    reason: &OnceLock<String>,
) -> Result<u64, WriterFailure> {
    let mut result = Ok(());
    let mut flushed = Instant::now();
    let mut dirty = false;
    loop {
        let wait = if dirty { FLUSH_EVERY.saturating_sub(flushed.elapsed()) } else { Duration::MAX };
        let received = match wait {
            Duration::MAX => filled.recv().map_err(|_| RecvTimeoutError::Disconnected),
            wait => filled.recv_timeout(wait),
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
                let _ = empty.send(packet);
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
            reason.get_or_init(|| {
                tracing::error!(target: "kinetoscope_record", %error, "the recording stopped");
                error.to_string()
            });
            failed.store(true, Ordering::Relaxed);
        }
    }
    // The recorder sets `failed` to abort the recording.
    if result.is_ok() && failed.load(Ordering::Relaxed) {
        // A partial file is readable up to its end.
        result = sink.flush();
        if result.is_ok() {
            return Err(WriterFailure { error: None, partial_path: sink.partial_path() });
        }
    }
    let size = result.and_then(|()| sink.finish(streams));
    size.map_err(|error| WriterFailure { error: Some(error), partial_path: sink.partial_path() })
}
