//! A test client of the browser view, without a browser.

use image::RgbImage;
use kinetoscope_testkit::wait::TIMEOUT;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Instant;
use tungstenite::{Message, WebSocket};

/// A message from the server.
#[derive(Debug)]
pub(crate) enum ServerMessage {
    Contents(Value),
    State(Value),
    Refused(String),
    Image { about: Value, image: RgbImage },
}

/// A client that behaves like the page.
pub(crate) struct TestClient {
    pub(crate) socket: WebSocket<TcpStream>,
}

impl TestClient {
    pub(crate) fn connect(address: SocketAddr) -> Self {
        let (socket, answer) = tungstenite::client(format!("ws://{address}/live"), connect(address)).unwrap();
        assert_eq!(answer.status().as_u16(), 101);
        Self { socket }
    }

    /// Sends a command.
    pub(crate) fn send(&mut self, command: Value) {
        self.socket.send(Message::text(command.to_string())).unwrap();
    }

    /// Returns the next message and acknowledges it, like the page. Returns `None` if the read timeout expires.
    pub(crate) fn next_message(&mut self) -> Option<ServerMessage> {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => {
                    let message: Value = serde_json::from_str(&text).unwrap();
                    let came = match message["is"].as_str().unwrap() {
                        "contents" => ServerMessage::Contents(message["contents"].clone()),
                        "state" => ServerMessage::State(message["state"].clone()),
                        "refused" => return Some(ServerMessage::Refused(message["reason"].as_str().unwrap().into())),
                        other => panic!("{other:?} is not of the protocol"),
                    };
                    self.send(json!({"do": "seen", "what": "state"}));
                    return Some(came);
                }
                Ok(Message::Binary(bytes)) => {
                    self.send(json!({"do": "seen", "what": "picture"}));
                    let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
                    let about = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
                    let image = image::load_from_memory(&bytes[4 + length..]).unwrap().into_rgb8();
                    return Some(ServerMessage::Image { about, image });
                }
                Ok(Message::Ping(_) | Message::Pong(_)) => {}
                Ok(other) => panic!("{other:?} was not expected"),
                Err(tungstenite::Error::Io(error)) if error.kind() == std::io::ErrorKind::WouldBlock => return None,
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Waits for a message that satisfies `wanted`.
    #[track_caller]
    pub(crate) fn wait<T>(&mut self, what: &str, mut wanted: impl FnMut(ServerMessage) -> Option<T>) -> T {
        let start = Instant::now();
        loop {
            assert!(start.elapsed() < TIMEOUT, "waited for {what}");
            if let Some(found) = wanted(self.next_message().expect(what)) {
                return found;
            }
        }
    }

    /// Waits for a state that satisfies `holds`.
    #[track_caller]
    pub(crate) fn wait_state(&mut self, what: &str, mut holds: impl FnMut(&Value) -> bool) -> Value {
        self.wait(what, |came| match came {
            ServerMessage::State(state) if holds(&state) => Some(state),
            _ => None,
        })
    }

    /// Waits for an image of the scene or of a camera sensor that satisfies `good`.
    #[track_caller]
    pub(crate) fn wait_image(&mut self, shows: &str, mut good: impl FnMut(&Value, &RgbImage) -> bool) -> RgbImage {
        self.wait(shows, |came| match came {
            ServerMessage::Image { about, image } if about["shows"] == shows && good(&about, &image) => Some(image),
            _ => None,
        })
    }

    /// Asserts that each command is refused with a reason that contains these words.
    #[track_caller]
    pub(crate) fn assert_refused<const N: usize>(&mut self, rows: [(Value, &str); N]) {
        for (command, words) in rows {
            self.send(command.clone());
            let reason = self.wait("a refusal", |came| match came {
                ServerMessage::Refused(reason) => Some(reason),
                _ => None,
            });
            assert!(reason.contains(words), "{command}: {reason}");
        }
    }

    /// Pauses the simulation and returns the paused state.
    pub(crate) fn pause(&mut self) -> Value {
        self.send(json!({"do": "pause"}));
        self.wait_state("paused", |state| state["paused"] == true)
    }
}

/// Connects with the timeouts of the tests.
pub(crate) fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(TIMEOUT)).unwrap();
    stream.set_write_timeout(Some(TIMEOUT)).unwrap();
    stream
}

/// Sends bytes and returns the response, up to the end of the connection.
pub(crate) fn exchange(address: SocketAddr, bytes: &[u8]) -> String {
    let mut stream = connect(address);
    // After an early refusal, the rest cannot be written.
    let _ = stream.write_all(bytes);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

/// Returns the status of a GET request with these headers.
pub(crate) fn status(address: SocketAddr, path: &str, headers: &[&str]) -> u16 {
    let headers: String = headers.iter().map(|header| format!("{header}\r\n")).collect();
    status_of(&exchange(address, format!("GET {path} HTTP/1.1\r\n{headers}\r\n").as_bytes()))
}

/// Returns the status of a response; 0 without a response.
pub(crate) fn status_of(answer: &str) -> u16 {
    answer.strip_prefix("HTTP/1.1 ").and_then(|rest| rest.get(..3)).and_then(|code| code.parse().ok()).unwrap_or(0)
}
