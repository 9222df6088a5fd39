//! The WebSocket server of a live stream.

use super::sink::ClientSink;
use crate::error::{RecordError, Result};
use foxglove::websocket::Capability;
use foxglove::{FoxgloveError, WebSocketServer, WebSocketServerHandle};
use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

/// A running server.
pub(super) struct LiveServer {
    address: SocketAddr,
    /// `None` once the server was stopped.
    handle: Mutex<Option<WebSocketServerHandle>>,
}

impl fmt::Debug for LiveServer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LiveServer").field("address", &self.address).field("clients", &self.clients()).finish()
    }
}

impl LiveServer {
    /// Starts a server for the channels of a sink.
    ///
    /// # Errors
    /// The address is in use or does not belong to this machine, or the operating system provides no thread.
    pub(super) fn start(address: SocketAddr, sink: &ClientSink) -> Result<Self> {
        let host = match address {
            SocketAddr::V4(address) => address.ip().to_string(),
            SocketAddr::V6(address) => format!("[{}]", address.ip()),
        };
        let server = WebSocketServer::new()
            .name("kinetoscope")
            .context(sink.context())
            .bind(host, address.port())
            .capabilities([Capability::Time])
            .listener(sink.held());
        let failed = |error| RecordError::Listen { address, error: Arc::new(error) };
        let handle = start(server).map_err(failed)?;
        let address = SocketAddr::new(address.ip(), handle.port());
        Ok(Self { address, handle: Mutex::new(Some(handle)) })
    }

    /// Address and port that the server listens on.
    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Number of connected clients; 0 after [`stop`](Self::stop).
    pub(super) fn clients(&self) -> usize {
        self.with_handle(WebSocketServerHandle::client_count).unwrap_or(0)
    }

    /// Sends the time of the stream to all clients \[ns\].
    pub(super) fn send_time(&self, nanos: u64) {
        self.with_handle(|handle| handle.broadcast_time(nanos));
    }

    /// Disconnects all clients and stops listening.
    pub(super) fn stop(&self) {
        let handle = self.handle.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(handle) = handle {
            // The tasks of clients end on their own after the closing handshake.
            handle.stop().detach_all();
        }
    }

    fn with_handle<T>(&self, read: impl FnOnce(&WebSocketServerHandle) -> T) -> Option<T> {
        self.handle.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map(read)
    }
}

impl Drop for LiveServer {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Starts a server in a thread of its own: on a thread of an asynchronous runtime, the start would panic.
fn start(server: WebSocketServer) -> io::Result<WebSocketServerHandle> {
    let start = || server.start_blocking();
    let started = thread::scope(|scope| {
        let thread = thread::Builder::new().name("foxglove".into()).spawn_scoped(scope, start)?;
        thread.join().map_err(|_| io::Error::other("the server panicked"))
    })?;
    started.map_err(|error| match error {
        FoxgloveError::Bind(error) | FoxgloveError::IoError(error) => error,
        other => io::Error::other(other),
    })
}
