//! HTTP server with one thread per connection, and limits on the number of connections.

use super::page::FrameAncestors;
use super::view_backend::ViewBackend;
use super::{page, websocket_session};
use kinetoscope_http::{AccessPolicy, RequestHead, ServeError, Status, random_hex, send_error};
use std::collections::BTreeMap;
use std::io::Write;
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tungstenite::handshake::derive_accept_key;

/// Number of connections in addition to viewers: page loads, and silent connections.
const MAX_OTHER_CONNECTIONS: usize = 32;
/// Interval between two checks for new connections.
const ACCEPT_INTERVAL: Duration = Duration::from_millis(15);
/// Time without viewers after which pause, speed and recording set by browsers are undone. A viewer that lost its
/// connection or reloads the page returns earlier.
const IDLE_TIMEOUT: Duration = Duration::from_secs(10);
/// Path of the WebSocket endpoint.
const WEBSOCKET_PATH: &str = "/live";

/// State shared by all connections.
pub(super) struct ServerContext {
    policy: AccessPolicy,
    frames: FrameAncestors,
    backend: Arc<dyn ViewBackend>,
    max_viewers: usize,
    viewers: AtomicUsize,
    stop: AtomicBool,
    /// Open sockets, which are shut down to wake their threads.
    connections: Mutex<Connections>,
}

#[derive(Default)]
struct Connections {
    next: u64,
    /// Connections by number, so the oldest comes first.
    open: BTreeMap<u64, OpenConnection>,
    threads: Vec<JoinHandle<()>>,
}

struct OpenConnection {
    stream: TcpStream,
    /// True until the client has sent a whole request.
    awaits_request: bool,
}

impl Connections {
    /// Closes the oldest connection whose client has not sent a whole request. Browsers send theirs at once, so silent
    /// clients cannot keep them out. Returns false if there is no such connection.
    fn close_oldest_silent(&mut self) -> bool {
        let oldest = self.open.iter().find(|(_, connection)| connection.awaits_request).map(|(number, _)| *number);
        let closed = oldest.and_then(|number| self.open.remove(&number));
        // An error means that the connection is already closed.
        closed.map(|connection| connection.stream.shutdown(Shutdown::Both)).is_some()
    }
}

impl ServerContext {
    /// True if the server is shutting down and all connections have to end.
    pub(super) fn is_closing(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Number of connected viewers.
    pub(super) fn viewers(&self) -> usize {
        self.viewers.load(Ordering::Acquire)
    }

    fn connections(&self) -> MutexGuard<'_, Connections> {
        self.connections.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A running server. Dropping the server closes every connection and joins all threads.
pub(super) struct Server {
    context: Arc<ServerContext>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Starts the thread that accepts connections, with at most `max_viewers` viewers.
    pub(super) fn start(
        listener: TcpListener,
        policy: AccessPolicy,
        frames: FrameAncestors,
        backend: Arc<dyn ViewBackend>,
        max_viewers: usize,
    ) -> Result<Self, ServeError> {
        let failed = |what: &'static str| move |error: std::io::Error| ServeError::System(format!("{what}: {error}"));
        listener.set_nonblocking(true).map_err(failed("cannot make the socket non-blocking"))?;
        let context = Arc::new(ServerContext {
            policy,
            frames,
            backend,
            max_viewers,
            viewers: AtomicUsize::new(0),
            stop: AtomicBool::new(false),
            connections: Mutex::default(),
        });
        let inside = Arc::clone(&context);
        let thread = std::thread::Builder::new().name("view-listen".into());
        let thread = thread.spawn(move || listen(&listener, &inside)).map_err(failed("cannot start a thread"))?;
        Ok(Self { context, thread: Some(thread) })
    }

    /// Number of connected viewers.
    pub(super) fn viewers(&self) -> usize {
        self.context.viewers()
    }

    /// Returns the state shared by all connections.
    pub(super) fn context(&self) -> Weak<ServerContext> {
        Arc::downgrade(&self.context)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.context.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // A thread that panicked has ended as well.
            let _ = thread.join();
        }
        let threads = {
            let mut connections = self.context.connections();
            for connection in connections.open.values() {
                // An error means that the connection is already closed.
                let _ = connection.stream.shutdown(Shutdown::Both);
            }
            std::mem::take(&mut connections.threads)
        };
        for thread in threads {
            let _ = thread.join();
        }
    }
}

fn listen(listener: &TcpListener, context: &Arc<ServerContext>) {
    // Time at which a viewer was last connected; `None` if no settings have to be undone.
    let mut seen: Option<Instant> = None;
    while !context.is_closing() {
        // An error comes from the connecting client or from a temporary lack of file descriptors.
        match listener.accept() {
            Ok((stream, _)) => spawn_connection(stream, context),
            Err(_) => std::thread::park_timeout(ACCEPT_INTERVAL),
        }
        context.connections().threads.retain(|thread| !thread.is_finished());
        if context.viewers() > 0 {
            seen = Some(Instant::now());
        } else if seen.is_some_and(|seen| seen.elapsed() > IDLE_TIMEOUT) {
            seen = None;
            context.backend.on_idle();
        }
    }
}

/// Starts the thread of a connection. If there are too many, the oldest silent one is closed; if none is silent, the new
/// one is closed without a response.
fn spawn_connection(mut stream: TcpStream, context: &Arc<ServerContext>) {
    // Accepted sockets may inherit the non-blocking mode of the listener on some systems (not on Linux).
    if stream.set_nonblocking(false).is_err() || stream.set_nodelay(true).is_err() {
        return;
    }
    let Ok(waker) = stream.try_clone() else { return };
    let waker = OpenConnection { stream: waker, awaits_request: true };
    let number = {
        let mut connections = context.connections();
        let is_full = connections.open.len().saturating_sub(context.viewers()) >= MAX_OTHER_CONNECTIONS;
        if is_full && !connections.close_oldest_silent() {
            drop(connections);
            // The connection is closed without a response, which could block. So many connections do not come from
            // browsers.
            return;
        }
        connections.next += 1;
        let number = connections.next;
        connections.open.insert(number, waker);
        number
    };
    let entry = ConnectionEntry { context: Arc::clone(context), number };
    let thread = std::thread::Builder::new().name("view-talk".into());
    let talk = move || {
        serve_connection(&mut stream, &entry);
        // Closes the connection for the client too, although `waker` still holds the socket.
        let _ = stream.shutdown(Shutdown::Both);
        drop(entry);
    };
    // If no thread can be started, the entry is dropped here.
    if let Ok(thread) = thread.spawn(talk) {
        context.connections().threads.push(thread);
    }
}

/// Entry of a connection in the list of open sockets. Dropping it removes the entry, even if the thread panics.
struct ConnectionEntry {
    context: Arc<ServerContext>,
    number: u64,
}

impl ConnectionEntry {
    fn set_request_received(&self) {
        if let Some(connection) = self.context.connections().open.get_mut(&self.number) {
            connection.awaits_request = false;
        }
    }
}

impl Drop for ConnectionEntry {
    fn drop(&mut self) {
        self.context.connections().open.remove(&self.number);
    }
}

/// Reserved place of a viewer, released on drop.
struct ViewerSlot<'a>(&'a ServerContext);

impl<'a> ViewerSlot<'a> {
    fn acquire(context: &'a ServerContext) -> Option<Self> {
        let free = |seated: usize| (seated < context.max_viewers).then_some(seated + 1);
        let taken = context.viewers.fetch_update(Ordering::AcqRel, Ordering::Acquire, free);
        taken.ok().map(|_| Self(context))
    }
}

impl Drop for ViewerSlot<'_> {
    fn drop(&mut self) {
        self.0.viewers.fetch_sub(1, Ordering::AcqRel);
    }
}

fn serve_connection(stream: &mut TcpStream, entry: &ConnectionEntry) {
    let context = &*entry.context;
    let head = match RequestHead::read(stream) {
        Ok(Some(head)) => head,
        Ok(None) => return,
        // The method of a request that cannot be parsed is unknown.
        Err(status) => return send_error(stream, status, true),
    };
    entry.set_request_received();
    let with_body = head.method != "HEAD";
    if let Err(status) = context.policy.check(&head) {
        return send_error(stream, status, with_body);
    }
    match (head.method.as_str(), head.path.as_str()) {
        ("GET" | "HEAD", "/" | "/index.html") => match random_hex() {
            Ok(nonce) => page::send(stream, &nonce, context.frames, with_body),
            Err(_) => send_error(stream, Status::InternalError, with_body),
        },
        ("GET", WEBSOCKET_PATH) => upgrade(stream, context, head),
        ("GET" | "HEAD", _) => send_error(stream, Status::NotFound, with_body),
        _ => send_error(stream, Status::MethodNotAllowed, with_body),
    }
}

/// Upgrades the connection to a WebSocket (RFC 6455, section 4.2) and runs its session to the end.
fn upgrade(stream: &mut TcpStream, context: &ServerContext, head: RequestHead) {
    let asks = head.header_contains("connection", "upgrade") && head.header_contains("upgrade", "websocket");
    let version = head.header("sec-websocket-version").ok().flatten();
    // Sixteen bytes in base64.
    let key = head.header("sec-websocket-key").ok().flatten().filter(|key| key.len() == 24);
    let Some(key) = key.filter(|_| asks && version == Some("13")) else {
        return send_error(stream, Status::UpgradeRequired, true);
    };
    let Some(slot) = ViewerSlot::acquire(context) else {
        return send_error(stream, Status::ServiceUnavailable, true);
    };
    let switch = format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {}\r\n\r\n",
        derive_accept_key(key.as_bytes())
    );
    let sent = stream
        .set_write_timeout(Some(websocket_session::WRITE_TIMEOUT))
        .and_then(|()| stream.write_all(switch.as_bytes()));
    if sent.is_ok() {
        websocket_session::run_session(stream, head.rest, context, context.backend.open_session());
    }
    drop(slot);
}
