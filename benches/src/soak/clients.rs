//! Clients of a browser view on loopback, without a browser: they read, never read, disconnect, or send half a request.

use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tungstenite::{HandshakeError, Message, WebSocket};

/// Longest wait of a client for a message, and between two looks at the flag that ends it.
const WAIT: Duration = Duration::from_millis(100);

/// Behavior of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Client {
    /// Reads and acknowledges all messages, as the page does.
    Reads,
    /// Connects and reads nothing.
    NeverReads,
    /// Connects, reads one message and disconnects, at least once.
    Disconnects,
    /// Requests the page, then sends half of a request and disconnects.
    Requests,
}

impl Client {
    /// Runs the client until `stop` is set. Returns its number of messages and responses.
    ///
    /// # Errors
    /// The server refused a connection, or answered with something that is not of the protocol.
    pub(crate) fn run(self, address: SocketAddr, stop: &AtomicBool) -> Result<u64, String> {
        let mut messages = 0;
        match self {
            Self::Reads => {
                let Some(mut socket) = connect_until(address, stop)? else { return Ok(messages) };
                send(&mut socket, &json!({"do": "size", "width": 160, "height": 90}))?;
                send(&mut socket, &json!({"do": "camera", "name": "eye"}))?;
                while !stop.load(Ordering::Relaxed) {
                    messages += u64::from(read(&mut socket)?);
                }
                close(socket);
            }
            Self::NeverReads => {
                let Some(mut socket) = connect_until(address, stop)? else { return Ok(messages) };
                // The server may have disconnected a client that is this slow.
                let _ = send(&mut socket, &json!({"do": "size", "width": 320, "height": 180}));
                while !stop.load(Ordering::Relaxed) {
                    std::thread::sleep(WAIT);
                }
            }
            Self::Disconnects => loop {
                if let Some(mut socket) = connect(address)? {
                    messages += u64::from(read(&mut socket)?);
                }
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                std::thread::sleep(WAIT);
            },
            Self::Requests => {
                let page = exchange(address, "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")?;
                if !page.starts_with("HTTP/1.1 200") {
                    return Err(format!("the page was answered by {:?}", page.lines().next().unwrap_or_default()));
                }
                messages += 1;
                let mut half = stream(address)?;
                half.write_all(b"GET / HTTP/1.1\r\nHost: loc").map_err(|error| error.to_string())?;
            }
        }
        Ok(messages)
    }
}

fn stream(address: SocketAddr) -> Result<TcpStream, String> {
    let stream = TcpStream::connect(address).map_err(|error| format!("{address}: {error}"))?;
    stream.set_read_timeout(Some(WAIT)).map_err(|error| error.to_string())?;
    Ok(stream)
}

/// Connects to the view. `None` if it has as many viewers as it accepts: viewers that have left count until their image is
/// drawn, which takes long on a busy machine.
fn connect(address: SocketAddr) -> Result<Option<WebSocket<TcpStream>>, String> {
    // The server answers within its own time; the response to the handshake must not time out.
    let stream = stream(address)?;
    stream.set_read_timeout(Some(Duration::from_secs(30))).map_err(|error| error.to_string())?;
    let socket = match tungstenite::client(format!("ws://{address}/live"), stream) {
        Ok((socket, _)) => socket,
        Err(HandshakeError::Failure(tungstenite::Error::Http(answer))) if answer.status() == 503 => return Ok(None),
        Err(error) => return Err(format!("no view at {address}: {error}")),
    };
    socket.get_ref().set_read_timeout(Some(WAIT)).map_err(|error| error.to_string())?;
    Ok(Some(socket))
}

/// Connects to the view as soon as it accepts a further viewer; `None` if `stop` is set before.
fn connect_until(address: SocketAddr, stop: &AtomicBool) -> Result<Option<WebSocket<TcpStream>>, String> {
    loop {
        let socket = connect(address)?;
        if socket.is_some() || stop.load(Ordering::Relaxed) {
            return Ok(socket);
        }
        std::thread::sleep(WAIT);
    }
}

fn send(socket: &mut WebSocket<TcpStream>, command: &Value) -> Result<(), String> {
    socket.send(Message::text(command.to_string())).map_err(|error| format!("{command}: {error}"))
}

/// Reads a message and acknowledges it. Returns false if none came in time.
fn read(socket: &mut WebSocket<TcpStream>) -> Result<bool, String> {
    let kind = match socket.read() {
        Ok(Message::Text(_)) => "state",
        Ok(Message::Binary(_)) => "picture",
        Ok(_) => return Ok(false),
        Err(tungstenite::Error::Io(error)) if error.kind() == std::io::ErrorKind::WouldBlock => return Ok(false),
        Err(error) => return Err(error.to_string()),
    };
    send(socket, &json!({"do": "seen", "what": kind}))?;
    Ok(true)
}

/// Closes a connection as a browser does. The server may have closed it first.
fn close(mut socket: WebSocket<TcpStream>) {
    let _ = socket.close(None);
    let _ = socket.flush();
}

fn exchange(address: SocketAddr, request: &str) -> Result<String, String> {
    let mut stream = stream(address)?;
    stream.set_read_timeout(Some(Duration::from_secs(30))).map_err(|error| error.to_string())?;
    stream.write_all(request.as_bytes()).map_err(|error| error.to_string())?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).map_err(|error| error.to_string())?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}
