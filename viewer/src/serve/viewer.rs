//! WebSocket session of one browser: images, states and commands.
//!
//! Messages are created when they can be sent, so no queue can grow. The page acknowledges images and states, and only
//! a few may be unacknowledged at a time. A slow viewer therefore gets fewer images, and always the newest.

use super::answer;
use super::command::{Command, Seen};
use super::server::House;
use super::show::Eyes;
use serde_json::json;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::protocol::frame::CloseFrame;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Bytes, Error, Message, WebSocket};

/// Write timeout, after which a viewer is disconnected.
pub(super) const WRITE_TIME: Duration = Duration::from_secs(5);
/// Time without messages after which a viewer is disconnected. Pages answer pings.
const SILENT_TIME: Duration = Duration::from_secs(15);
const PING_EVERY: Duration = Duration::from_secs(4);
/// Maximum size of a command \[bytes\].
const MAX_MESSAGE: usize = 16 << 10;
/// Maximum number of characters of a refusal, since some refusals quote the command.
const MAX_REASON: usize = 500;
/// Maximum number of unacknowledged images and states.
const MAX_PICTURES: u32 = 2;
const MAX_STATES: u32 = 3;
/// Minimum interval between two states.
const STATE_EVERY: Duration = Duration::from_millis(40);
/// Minimum interval between two checks for new images.
const LOOK_EVERY: Duration = Duration::from_millis(25);

/// WebSocket session of one browser.
struct Viewer<'a, S> {
    socket: WebSocket<S>,
    house: &'a House,
    eyes: Box<dyn Eyes>,
    pictures: u32,
    states: u32,
    heard: Instant,
    pinged: Instant,
    looked: Instant,
    told: Instant,
}

/// End of a session.
struct Over;

/// Runs a session until the browser or the server ends it.
pub(super) fn look(stream: &mut TcpStream, rest: Vec<u8>, house: &House, eyes: Box<dyn Eyes>) {
    let config = WebSocketConfig::default()
        .read_buffer_size(8 << 10)
        .write_buffer_size(0)
        .max_message_size(Some(MAX_MESSAGE))
        .max_frame_size(Some(MAX_MESSAGE));
    let now = Instant::now();
    let Some(past) = now.checked_sub(STATE_EVERY + LOOK_EVERY) else { return };
    let mut viewer = Viewer {
        socket: WebSocket::from_partially_read(&*stream, rest, Role::Server, Some(config)),
        house,
        eyes,
        pictures: 0,
        states: 0,
        heard: now,
        pinged: now,
        looked: past,
        told: past,
    };
    while viewer.turn(stream).is_ok() {}
    drop(viewer);
    // The browser reads the close reason before the connection ends.
    answer::linger(stream);
}

impl<S: Read + Write> Viewer<'_, S> {
    fn turn(&mut self, stream: &TcpStream) -> Result<(), Over> {
        if self.house.closes() {
            return self.close(CloseCode::Away, "the simulation has ended");
        }
        if self.heard.elapsed() > SILENT_TIME {
            return self.close(CloseCode::Policy, "silent for too long");
        }
        if self.pinged.elapsed() >= PING_EVERY {
            self.pinged = Instant::now();
            self.send(Message::Ping(Bytes::new()))?;
        }
        self.tell()?;
        self.show()?;
        // At least one millisecond: a timeout of zero would block forever.
        let due = STATE_EVERY.saturating_sub(self.told.elapsed()).min(LOOK_EVERY.saturating_sub(self.looked.elapsed()));
        stream.set_read_timeout(Some(due.max(Duration::from_millis(1)))).map_err(|_| Over)?;
        self.hear()
    }

    /// Sends contents and state if they changed.
    fn tell(&mut self) -> Result<(), Over> {
        if self.told.elapsed() < STATE_EVERY {
            return Ok(());
        }
        self.told = Instant::now();
        if self.states >= MAX_STATES {
            return Ok(());
        }
        if let Some(contents) = self.eyes.contents() {
            self.states += 1;
            self.send(Message::text(json!({"is": "contents", "contents": contents}).to_string()))?;
        }
        if let Some(state) = self.eyes.state() {
            self.states += 1;
            self.send(Message::text(json!({"is": "state", "state": state}).to_string()))?;
        }
        Ok(())
    }

    fn show(&mut self) -> Result<(), Over> {
        if self.looked.elapsed() < LOOK_EVERY {
            return Ok(());
        }
        self.looked = Instant::now();
        if self.pictures >= MAX_PICTURES {
            return Ok(());
        }
        for picture in self.eyes.pictures() {
            self.pictures += 1;
            self.send(Message::binary(picture.message()))?;
        }
        Ok(())
    }

    /// Reads and runs a command, if one arrives before the timeout.
    fn hear(&mut self) -> Result<(), Over> {
        let message = match self.socket.read() {
            Ok(message) => message,
            Err(Error::Io(error)) if is_wait(&error) => return Ok(()),
            Err(Error::Capacity(_)) => return self.close(CloseCode::Size, "commands are short"),
            Err(Error::Utf8(_)) => return self.close(CloseCode::Invalid, "commands are UTF-8"),
            Err(Error::Protocol(_)) => return self.close(CloseCode::Protocol, "not as RFC 6455 says"),
            Err(_) => return Err(Over),
        };
        self.heard = Instant::now();
        match message {
            Message::Text(text) => self.obey(&text),
            Message::Binary(_) => self.close(CloseCode::Unsupported, "commands are text"),
            Message::Close(_) => {
                // The close response is already queued and only has to be sent.
                let _ = self.socket.flush();
                Err(Over)
            }
            // tungstenite answers pings itself.
            Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => Ok(()),
        }
    }

    fn obey(&mut self, text: &str) -> Result<(), Over> {
        let reason = match Command::parse(text) {
            Ok(Command::Seen { what: Seen::Picture }) => {
                self.pictures = self.pictures.saturating_sub(1);
                return Ok(());
            }
            Ok(Command::Seen { what: Seen::State }) => {
                self.states = self.states.saturating_sub(1);
                return Ok(());
            }
            Ok(command) => self.eyes.obey(command),
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
    fn send(&mut self, message: Message) -> Result<(), Over> {
        self.socket.send(message).map_err(|_| Over)
    }

    fn close(&mut self, code: CloseCode, reason: &'static str) -> Result<(), Over> {
        // The session ends regardless of errors.
        let _ = self.socket.close(Some(CloseFrame { code, reason: reason.into() }));
        let _ = self.socket.flush();
        Err(Over)
    }
}

fn is_wait(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
