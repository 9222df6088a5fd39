//! WebSocket session of one browser: images, states and commands.
//!
//! Messages are created when they can be sent, so no queue can grow. The page acknowledges images and states, and only
//! a few may be unacknowledged at a time. A slow viewer therefore gets fewer images, and always the newest.

use super::command::{Command, Seen};
use super::server::ServerContext;
use super::view_backend::ViewSession;
use serde_json::json;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::protocol::frame::CloseFrame;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Bytes, Error, Message, WebSocket};

/// Time without progress of a write after which a viewer is disconnected.
pub(super) const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// Time of a whole message after which a viewer is disconnected, in addition to its length at [`MIN_RATE`].
const MESSAGE_TIMEOUT: Duration = Duration::from_secs(8);
/// Smallest rate at which a viewer may read a message \[bytes/s\].
const MIN_RATE: f64 = 16_000.0;
/// Number of messages that a viewer may send at once, and per second afterwards. On a display of 240 Hz, the page sends about
/// 320 per second while a slider is dragged, acknowledgments included.
const MAX_MESSAGES: f64 = 2000.0;
const MESSAGES_PER_SECOND: f64 = 500.0;
/// Number of reads of the socket for one message. A message takes three at most; frames without content, or of single bytes,
/// would keep the session from everything else.
const MAX_READS: u32 = 8;
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

/// A stream whose messages have a deadline. Without it, a client that reads a byte every few seconds would hold the place
/// of a viewer.
struct TimedStream<'a> {
    stream: &'a TcpStream,
    deadline: Instant,
    /// Number of reads until [`ErrorKind::WouldBlock`] is returned.
    reads_left: u32,
}

impl TimedStream<'_> {
    /// Starts the time of a message of `length` bytes.
    fn restart(&mut self, length: usize) {
        self.deadline = Instant::now() + MESSAGE_TIMEOUT + Duration::from_secs_f64(length as f64 / MIN_RATE);
    }
}

impl Read for TimedStream<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.reads_left = self.reads_left.checked_sub(1).ok_or(ErrorKind::WouldBlock)?;
        self.stream.read(buffer)
    }
}

impl Write for TimedStream<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let left = self.deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(ErrorKind::TimedOut.into());
        }
        self.stream.set_write_timeout(Some(left.min(WRITE_TIMEOUT)))?;
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

/// Limits the rate of messages: a bucket of tokens, one for each message.
struct MessageRate {
    tokens: f64,
    last: Instant,
}

impl MessageRate {
    fn new(now: Instant) -> Self {
        Self { tokens: MAX_MESSAGES, last: now }
    }

    /// Takes a token. Returns false if the bucket is empty.
    fn take(&mut self, now: Instant) -> bool {
        let refilled = MESSAGES_PER_SECOND * now.saturating_duration_since(self.last).as_secs_f64();
        self.tokens = (self.tokens + refilled).min(MAX_MESSAGES);
        self.last = now;
        let is_allowed = self.tokens >= 1.0;
        self.tokens -= f64::from(u8::from(is_allowed));
        is_allowed
    }
}

/// WebSocket session of one browser.
struct WebSocketSession<'a> {
    socket: WebSocket<TimedStream<'a>>,
    context: &'a ServerContext,
    session: Box<dyn ViewSession>,
    unseen_images: u32,
    unseen_states: u32,
    rate: MessageRate,
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
        socket: WebSocket::from_partially_read(
            TimedStream { stream: &*stream, deadline: now + MESSAGE_TIMEOUT, reads_left: 0 },
            rest,
            Role::Server,
            Some(config),
        ),
        context,
        session,
        unseen_images: 0,
        unseen_states: 0,
        rate: MessageRate::new(now),
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

impl WebSocketSession<'_> {
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
        // Reading also answers pings.
        self.socket.get_mut().restart(0);
        self.socket.get_mut().reads_left = MAX_READS;
        let message = match self.socket.read() {
            Ok(message) => message,
            Err(Error::Io(error)) if is_timeout(&error) => return Ok(()),
            Err(Error::Capacity(_)) => return self.close(CloseCode::Size, "the command is too long"),
            Err(Error::Utf8(_)) => return self.close(CloseCode::Invalid, "commands must be UTF-8"),
            Err(Error::Protocol(_)) => return self.close(CloseCode::Protocol, "violation of RFC 6455"),
            Err(_) => return Err(SessionEnded),
        };
        self.last_received = Instant::now();
        if !self.rate.take(self.last_received) {
            return self.close(CloseCode::Policy, "too many messages");
        }
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

    /// Sends a message. A timeout ends the session.
    fn send(&mut self, message: Message) -> Result<(), SessionEnded> {
        self.socket.get_mut().restart(message.len());
        self.socket.send(message).map_err(|_| SessionEnded)
    }

    fn close(&mut self, code: CloseCode, reason: &'static str) -> Result<(), SessionEnded> {
        self.socket.get_mut().restart(0);
        // The session ends regardless of errors.
        let _ = self.socket.close(Some(CloseFrame { code, reason: reason.into() }));
        let _ = self.socket.flush();
        Err(SessionEnded)
    }
}

fn is_timeout(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn message_rate() {
        let start = Instant::now();
        let mut rate = MessageRate::new(start);
        let count = |rate: &mut MessageRate, now| (0..10_000).take_while(|_| rate.take(now)).count();
        assert_eq!(count(&mut rate, start), 2000);
        assert_eq!(count(&mut rate, start + Duration::from_millis(500)), 250);
        // The bucket holds no more than it did at first.
        assert_eq!(count(&mut rate, start + Duration::from_secs(1000)), 2000);
    }

    /// A client that reads slowly, but without a pause, does not extend the time of a message.
    #[test]
    fn message_deadline() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (server, _) = listener.accept().unwrap();
        let reader = std::thread::spawn(move || {
            let mut client = client;
            let mut chunk = [0; 4096];
            while client.read(&mut chunk).is_ok_and(|n| n > 0) {
                std::thread::sleep(Duration::from_millis(2));
            }
        });
        let start = Instant::now();
        let mut stream = TimedStream { stream: &server, deadline: start + Duration::from_millis(300), reads_left: 0 };
        // At 2 MB/s at most, this takes more than 30 s; the buffers of the system hold a few megabytes.
        let error = stream.write_all(&vec![0; 64 << 20]).unwrap_err();
        let taken = start.elapsed();
        assert!(is_timeout(&error), "{error}");
        assert!((0.29..5.0).contains(&taken.as_secs_f64()), "{taken:?}");
        drop(server);
        reader.join().unwrap();
    }
}
