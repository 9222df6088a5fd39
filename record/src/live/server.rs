//! The WebSocket server of a live stream.

use super::gate::Gate;
use super::sink::ClientSink;
use foxglove::websocket::Capability;
use foxglove::{FoxgloveError, WebSocketServer, WebSocketServerHandle};
use kinetoscope_http::{AccessPolicy, ServeError, Token, listen, random_loopback, reachable_address};
use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::sync::{Mutex, PoisonError};
use std::thread;

/// A running server.
pub(super) struct LiveServer {
    address: SocketAddr,
    /// Address for clients, with the token if one is required.
    url: String,
    /// `None` once the server was stopped.
    running: Mutex<Option<Running>>,
}

struct Running {
    gate: Gate,
    handle: WebSocketServerHandle,
}

impl fmt::Debug for LiveServer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LiveServer").field("address", &self.address).field("clients", &self.clients()).finish()
    }
}

impl LiveServer {
    /// Starts a server for the channels of a sink. Programs on this machine, pages of `websites`, and with a token other
    /// machines can connect.
    ///
    /// # Errors
    /// The address is in use or does not belong to this machine, a website is not an origin, or the operating system
    /// provides no thread or no random numbers.
    pub(super) fn start(asked: SocketAddr, websites: Vec<String>, sink: &ClientSink) -> Result<Self, ServeError> {
        let listener = listen(asked)?;
        let address = listener.local_addr().map_err(|error| ServeError::Listen { address: asked, error })?;
        let token = if address.ip().is_loopback() { None } else { Some(Token::random()?) };
        let token_query = token.as_ref().map_or_else(String::new, |token| format!("/?token={}", token.as_str()));
        let url = format!("ws://{}{token_query}", reachable_address(address));
        let policy = AccessPolicy::new(address, token).with_websites(websites)?;
        let inner = random_loopback()?;
        let server = WebSocketServer::new()
            .name("kinetoscope")
            .context(sink.context())
            .bind(inner.to_string(), 0)
            .capabilities([Capability::Time])
            .listener(sink.held());
        let failed = |error| ServeError::System(format!("the server for Foxglove: {error}"));
        let handle = start(server).map_err(failed)?;
        let gate = Gate::open(listener, policy, SocketAddr::from((inner, handle.port()))).map_err(failed)?;
        Ok(Self { address, url, running: Mutex::new(Some(Running { gate, handle })) })
    }

    /// Address and port that the server listens on.
    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Address for clients, with the token if one is required.
    pub(super) fn url(&self) -> &str {
        &self.url
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
        let running = self.running.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(Running { gate, handle }) = running {
            // The tasks of clients end on their own after the closing handshake, which the gate passes on.
            handle.stop().detach_all();
            drop(gate);
        }
    }

    fn with_handle<T>(&self, read: impl FnOnce(&WebSocketServerHandle) -> T) -> Option<T> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map(|running| read(&running.handle))
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
