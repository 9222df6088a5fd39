//! One viewer: its pictures and its commands.
//!
//! What is sent is made when it can be sent: there is no queue that could grow. The page says when it has a picture or a
//! state, and not more than a few are on their way at a time; so a slow viewer gets fewer, and always the newest.

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

/// How long a viewer may not take what is sent.
pub(super) const WRITE_TIME: Duration = Duration::from_secs(5);
/// Who was silent for so long is gone; pages answer a ping.
const SILENT_TIME: Duration = Duration::from_secs(15);
const PING_EVERY: Duration = Duration::from_secs(4);
/// Commands are short.
const MAX_MESSAGE: usize = 16 << 10;
/// Letters of a reason, at most: some repeat what was asked.
const MAX_REASON: usize = 500;
/// No more pictures, or states, are made while so many are on their way.
const MAX_PICTURES: u32 = 2;
const MAX_STATES: u32 = 3;
/// Between two states.
const STATE_EVERY: Duration = Duration::from_millis(40);
/// Between two looks at whether a picture is due.
const LOOK_EVERY: Duration = Duration::from_millis(25);

/// The reading of one viewer's socket and what is due to it.
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

/// Why a conversation ended.
struct Over;

/// Talks until one of both goes.
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
    // Why it was closed is read before the end.
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
        // At least a millisecond: zero would wait for ever.
        let due = STATE_EVERY.saturating_sub(self.told.elapsed()).min(LOOK_EVERY.saturating_sub(self.looked.elapsed()));
        stream.set_read_timeout(Some(due.max(Duration::from_millis(1)))).map_err(|_| Over)?;
        self.hear()
    }

    /// What there is, and how it stands.
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

    /// A command, if one comes in time.
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
                // The answer is ready and only has to be sent.
                let _ = self.socket.flush();
                Err(Over)
            }
            // tungstenite answers pings.
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

    /// One that does not take it in time is gone.
    fn send(&mut self, message: Message) -> Result<(), Over> {
        self.socket.send(message).map_err(|_| Over)
    }

    fn close(&mut self, code: CloseCode, reason: &'static str) -> Result<(), Over> {
        // It is over, whether that is heard or not.
        let _ = self.socket.close(Some(CloseFrame { code, reason: reason.into() }));
        let _ = self.socket.flush();
        Err(Over)
    }
}

fn is_wait(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
