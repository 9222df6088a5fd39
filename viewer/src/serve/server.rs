//! HTTP server with one thread per connection, and limits on the number of connections.

use super::answer::{self, Status};
use super::door::Door;
use super::error::ServeError;
use super::head::Head;
use super::show::Show;
use super::{page, viewer};
use std::collections::BTreeMap;
use std::io::Write;
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tungstenite::handshake::derive_accept_key;

/// Number of connections in addition to viewers: page loads, and silent connections until their timeout.
const SPARE_CONNECTIONS: usize = 32;
/// Interval between two checks for new connections.
const ACCEPT_EVERY: Duration = Duration::from_millis(15);
/// Time without viewers after which the settings of the last viewer are undone. A viewer that lost its connection or
/// reloads the page returns earlier.
const DESERTED_AFTER: Duration = Duration::from_secs(10);
/// Path of the WebSocket endpoint.
const LIVE: &str = "/live";

/// State shared by all connections.
pub(super) struct House {
    door: Door,
    show: Arc<dyn Show>,
    max_viewers: usize,
    viewers: AtomicUsize,
    stop: AtomicBool,
    /// Open sockets, which are shut down to wake their threads.
    connections: Mutex<Connections>,
}

#[derive(Default)]
struct Connections {
    next: u64,
    open: BTreeMap<u64, TcpStream>,
    threads: Vec<JoinHandle<()>>,
}

impl House {
    /// True if the server is shutting down and all connections have to end.
    pub(super) fn closes(&self) -> bool {
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
    house: Arc<House>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Starts to accept connections.
    pub(super) fn start(
        listener: TcpListener,
        door: Door,
        show: Arc<dyn Show>,
        max_viewers: usize,
    ) -> Result<Self, ServeError> {
        let no_thread = |error: std::io::Error| ServeError::System(format!("no thread for it: {error}"));
        listener.set_nonblocking(true).map_err(no_thread)?;
        let house = Arc::new(House {
            door,
            show,
            max_viewers,
            viewers: AtomicUsize::new(0),
            stop: AtomicBool::new(false),
            connections: Mutex::default(),
        });
        let inside = Arc::clone(&house);
        let thread = std::thread::Builder::new().name("view-listen".into());
        let thread = thread.spawn(move || listen(&listener, &inside)).map_err(no_thread)?;
        Ok(Self { house, thread: Some(thread) })
    }

    /// Number of connected viewers.
    pub(super) fn viewers(&self) -> usize {
        self.house.viewers()
    }

    /// Returns the state shared by all connections.
    pub(super) fn house(&self) -> Weak<House> {
        Arc::downgrade(&self.house)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.house.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // A thread that panicked has ended as well.
            let _ = thread.join();
        }
        let threads = {
            let mut connections = self.house.connections();
            for stream in connections.open.values() {
                // An error means that the connection is already closed.
                let _ = stream.shutdown(Shutdown::Both);
            }
            std::mem::take(&mut connections.threads)
        };
        for thread in threads {
            let _ = thread.join();
        }
    }
}

fn listen(listener: &TcpListener, house: &Arc<House>) {
    // Time at which a viewer was last connected; `None` if no settings have to be undone.
    let mut seen: Option<Instant> = None;
    while !house.closes() {
        // An error comes from the connecting client or from a temporary lack of file descriptors.
        match listener.accept() {
            Ok((stream, _)) => welcome(stream, house),
            Err(_) => std::thread::park_timeout(ACCEPT_EVERY),
        }
        house.connections().threads.retain(|thread| !thread.is_finished());
        if house.viewers() > 0 {
            seen = Some(Instant::now());
        } else if seen.is_some_and(|seen| seen.elapsed() > DESERTED_AFTER) {
            seen = None;
            house.show.deserted();
        }
    }
}

/// Starts the thread of a connection.
fn welcome(mut stream: TcpStream, house: &Arc<House>) {
    // Accepted sockets may inherit the non-blocking mode of the listener on some systems (not on Linux).
    if stream.set_nonblocking(false).is_err() || stream.set_nodelay(true).is_err() {
        return;
    }
    let Ok(waker) = stream.try_clone() else { return };
    let number = {
        let mut connections = house.connections();
        if connections.open.len() >= house.max_viewers + SPARE_CONNECTIONS {
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
    let entry = Entry { house: Arc::clone(house), number };
    let thread = std::thread::Builder::new().name("view-talk".into());
    let talk = move || {
        talk(&mut stream, &entry.house);
        // Closes the connection for the client too, although `waker` still holds the socket.
        let _ = stream.shutdown(Shutdown::Both);
        drop(entry);
    };
    // If no thread can be started, the entry is dropped here.
    if let Ok(thread) = thread.spawn(talk) {
        house.connections().threads.push(thread);
    }
}

/// Entry of a connection in the list of open sockets. Dropping it removes the entry, even if the thread panics.
struct Entry {
    house: Arc<House>,
    number: u64,
}

impl Drop for Entry {
    fn drop(&mut self) {
        self.house.connections().open.remove(&self.number);
    }
}

/// Reserved place of a viewer, released on drop.
struct Seat<'a>(&'a House);

impl<'a> Seat<'a> {
    fn take(house: &'a House) -> Option<Self> {
        let free = |seated: usize| (seated < house.max_viewers).then_some(seated + 1);
        let taken = house.viewers.fetch_update(Ordering::AcqRel, Ordering::Acquire, free);
        taken.ok().map(|_| Self(house))
    }
}

impl Drop for Seat<'_> {
    fn drop(&mut self) {
        self.0.viewers.fetch_sub(1, Ordering::AcqRel);
    }
}

fn talk(stream: &mut TcpStream, house: &House) {
    let head = match Head::read(stream) {
        Ok(Some(head)) => head,
        Ok(None) => return,
        Err(status) => return answer::refuse(stream, status),
    };
    if let Err(status) = house.door.check(&head) {
        return answer::refuse(stream, status);
    }
    match (head.method.as_str(), head.path.as_str()) {
        ("GET" | "HEAD", "/" | "/index.html") => match super::token::random_hex() {
            Ok(nonce) => answer::page(stream, &page::html(&nonce), &nonce, head.method == "GET"),
            Err(_) => answer::refuse(stream, Status::Broken),
        },
        ("GET", LIVE) => live(stream, house, head),
        ("GET" | "HEAD", _) => answer::refuse(stream, Status::NotFound),
        _ => answer::refuse(stream, Status::WrongMethod),
    }
}

/// Upgrades the connection to a WebSocket (RFC 6455, section 4.2).
fn live(stream: &mut TcpStream, house: &House, head: Head) {
    let asks = head.lists("connection", "upgrade") && head.lists("upgrade", "websocket");
    let version = head.header("sec-websocket-version").ok().flatten();
    // Sixteen bytes in base64.
    let key = head.header("sec-websocket-key").ok().flatten().filter(|key| key.len() == 24);
    let Some(key) = key.filter(|_| asks && version == Some("13")) else {
        return answer::refuse(stream, Status::UpgradeRequired);
    };
    let Some(seat) = Seat::take(house) else { return answer::refuse(stream, Status::Busy) };
    let switch = format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {}\r\n\r\n",
        derive_accept_key(key.as_bytes())
    );
    let sent = stream.set_write_timeout(Some(viewer::WRITE_TIME)).and_then(|()| stream.write_all(switch.as_bytes()));
    if sent.is_ok() {
        viewer::look(stream, head.rest, house, house.show.eyes());
    }
    drop(seat);
}
