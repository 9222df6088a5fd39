//! WebSocket session of one browser: images, states and commands.
//!
//! Messages are created when they can be sent, so no queue can grow. The page acknowledges images and states, and only
//! a few may be unacknowledged at a time. A slow viewer therefore gets fewer images, and always the newest.

use super::command::{Command, Seen};
use super::server::ServerContext;
use super::view_backend::ViewSession;
use serde_json::json;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::protocol::frame::CloseFrame;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Bytes, Error, Message, WebSocket};

/// Write timeout, after which a viewer is disconnected.
pub(super) const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// Time without messages after which a viewer is disconnected. Pages answer pings.
const READ_TIMEOUT: Duration = Duration::from_secs(15);
const PING_INTERVAL: Duration = Duration::from_secs(4);
/// Maximum size of a command \[bytes\].
const MAX_MESSAGE: usize = 16 << 10;
/// Maximum number of characters of a refusal, since some refusals quote the command.
const MAX_REASON: usize = 500;
/// Numbers of unacknowledged images and states from which on no more are sent. Two may be sent at once.
const MAX_UNSEEN_IMAGES: u32 = 2;
const MAX_UNSEEN_STATES: u32 = 3;
/// Minimum interval between two states.
const STATE_INTERVAL: Duration = Duration::from_millis(40);
/// Minimum interval between two checks for new images.
const IMAGE_CHECK_INTERVAL: Duration = Duration::from_millis(25);

/// WebSocket session of one browser.
struct WebSocketSession<'a, S> {
    socket: WebSocket<S>,
    context: &'a ServerContext,
    session: Box<dyn ViewSession>,
    unseen_images: u32,
    unseen_states: u32,
    last_received: Instant,
    last_ping: Instant,
    last_image_check: Instant,
    last_state: Instant,
}

/// End of a session.
struct SessionEnded;

/// Runs a session until the browser or the server ends it.
pub(super) fn run_session(
    stream: &mut TcpStream,
    rest: Vec<u8>,
    context: &ServerContext,
    session: Box<dyn ViewSession>,
) {
    let config = WebSocketConfig::default()
        .read_buffer_size(8 << 10)
        .write_buffer_size(0)
        .max_message_size(Some(MAX_MESSAGE))
        .max_frame_size(Some(MAX_MESSAGE));
    let now = Instant::now();
    let Some(past) = now.checked_sub(STATE_INTERVAL + IMAGE_CHECK_INTERVAL) else { return };
    let mut viewer = WebSocketSession {
        socket: WebSocket::from_partially_read(&*stream, rest, Role::Server, Some(config)),
        context,
        session,
        unseen_images: 0,
        unseen_states: 0,
        last_received: now,
        last_ping: now,
        last_image_check: past,
        last_state: past,
    };
    while viewer.poll(stream).is_ok() {}
    drop(viewer);
    // The browser reads the close reason before the connection ends.
    kinetoscope_http::drain(stream);
}

impl<S: Read + Write> WebSocketSession<'_, S> {
    fn poll(&mut self, stream: &TcpStream) -> Result<(), SessionEnded> {
        if self.context.is_closing() {
            return self.close(CloseCode::Away, "the simulation has ended");
        }
        if self.last_received.elapsed() > READ_TIMEOUT {
            return self.close(CloseCode::Policy, "silent for too long");
        }
        if self.last_ping.elapsed() >= PING_INTERVAL {
            self.last_ping = Instant::now();
            self.send(Message::Ping(Bytes::new()))?;
        }
        self.send_state()?;
        self.send_images()?;
        // At least one millisecond: a timeout of zero would block forever.
        let due = STATE_INTERVAL
            .saturating_sub(self.last_state.elapsed())
            .min(IMAGE_CHECK_INTERVAL.saturating_sub(self.last_image_check.elapsed()));
        stream.set_read_timeout(Some(due.max(Duration::from_millis(1)))).map_err(|_| SessionEnded)?;
        self.receive()
    }

    /// Sends contents and state if they changed.
    fn send_state(&mut self) -> Result<(), SessionEnded> {
        if self.last_state.elapsed() < STATE_INTERVAL {
            return Ok(());
        }
        self.last_state = Instant::now();
        if self.unseen_states >= MAX_UNSEEN_STATES {
            return Ok(());
        }
        if let Some(contents) = self.session.contents() {
            self.unseen_states += 1;
            self.send(Message::text(json!({"is": "contents", "contents": contents}).to_string()))?;
        }
        if let Some(state) = self.session.state() {
            self.unseen_states += 1;
            self.send(Message::text(json!({"is": "state", "state": state}).to_string()))?;
        }
        Ok(())
    }

    fn send_images(&mut self) -> Result<(), SessionEnded> {
        if self.last_image_check.elapsed() < IMAGE_CHECK_INTERVAL {
            return Ok(());
        }
        self.last_image_check = Instant::now();
        if self.unseen_images >= MAX_UNSEEN_IMAGES {
            return Ok(());
        }
        for image in self.session.due_images() {
            self.unseen_images += 1;
            self.send(Message::binary(image.to_message()))?;
        }
        Ok(())
    }

    /// Reads and runs a command, if one arrives before the timeout.
    fn receive(&mut self) -> Result<(), SessionEnded> {
        let message = match self.socket.read() {
            Ok(message) => message,
            Err(Error::Io(error)) if is_timeout(&error) => return Ok(()),
            Err(Error::Capacity(_)) => return self.close(CloseCode::Size, "the command is too long"),
            Err(Error::Utf8(_)) => return self.close(CloseCode::Invalid, "commands must be UTF-8"),
            Err(Error::Protocol(_)) => return self.close(CloseCode::Protocol, "violation of RFC 6455"),
            Err(_) => return Err(SessionEnded),
        };
        self.last_received = Instant::now();
        match message {
            Message::Text(text) => self.handle_text(&text),
            Message::Binary(_) => self.close(CloseCode::Unsupported, "commands must be text"),
            Message::Close(_) => {
                // The close response is already queued and only has to be sent.
                let _ = self.socket.flush();
                Err(SessionEnded)
            }
            // tungstenite answers pings itself.
            Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => Ok(()),
        }
    }

    fn handle_text(&mut self, text: &str) -> Result<(), SessionEnded> {
        let reason = match Command::parse(text) {
            Ok(Command::Seen { what: Seen::Picture }) => {
                self.unseen_images = self.unseen_images.saturating_sub(1);
                return Ok(());
            }
            Ok(Command::Seen { what: Seen::State }) => {
                self.unseen_states = self.unseen_states.saturating_sub(1);
                return Ok(());
            }
            Ok(command) => self.session.handle(command),
            Err(reason) => Err(reason),
        };
        match reason {
            Ok(()) => Ok(()),
            Err(reason) => {
                let reason: String = reason.chars().take(MAX_REASON).collect();
                self.send(Message::text(json!({"is": "refused", "reason": reason}).to_string()))
            }
        }
    }

    /// Sends a message. A write timeout ends the session.
    fn send(&mut self, message: Message) -> Result<(), SessionEnded> {
        self.socket.send(message).map_err(|_| SessionEnded)
    }

    fn close(&mut self, code: CloseCode, reason: &'static str) -> Result<(), SessionEnded> {
        // The session ends regardless of errors.
        let _ = self.socket.close(Some(CloseFrame { code, reason: reason.into() }));
        let _ = self.socket.flush();
        Err(SessionEnded)
    }
}

fn is_timeout(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
