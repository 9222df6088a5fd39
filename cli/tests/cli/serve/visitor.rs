//! A viewer without a browser.

use crate::serve::running::Running;
use image::RgbImage;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

/// More than anything here takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// What came.
#[derive(Debug)]
pub(crate) enum Came {
    Contents(Value),
    State(Value),
    Refused(String),
    Picture { about: Value, picture: RgbImage },
}

/// A viewer that behaves as the page does.
pub(crate) struct Visitor {
    pub(crate) socket: WebSocket<TcpStream>,
}

impl Visitor {
    /// Comes in.
    pub(crate) fn enter(running: &Running) -> Self {
        let stream = connect(running.address);
        let url = format!("ws://{}/live", running.address);
        let (socket, answer) = tungstenite::client(url, stream).unwrap();
        assert_eq!(answer.status().as_u16(), 101);
        Self { socket }
    }

    /// Asks for something.
    pub(crate) fn ask(&mut self, command: Value) {
        self.socket.send(Message::text(command.to_string())).unwrap();
    }

    /// The next thing that comes; says that it came, as the page does.
    pub(crate) fn next(&mut self) -> Came {
        loop {
            match self.socket.read().unwrap() {
                Message::Text(text) => {
                    let message: Value = serde_json::from_str(&text).unwrap();
                    let came = match message["is"].as_str().unwrap() {
                        "contents" => Came::Contents(message["contents"].clone()),
                        "state" => Came::State(message["state"].clone()),
                        "refused" => return Came::Refused(message["reason"].as_str().unwrap().into()),
                        other => panic!("{other:?} is not of the protocol"),
                    };
                    self.ask(json!({"do": "seen", "what": "state"}));
                    return came;
                }
                Message::Binary(bytes) => {
                    self.ask(json!({"do": "seen", "what": "picture"}));
                    return read_picture(&bytes);
                }
                Message::Ping(_) | Message::Pong(_) => {}
                other => panic!("{other:?} was not expected"),
            }
        }
    }

    /// The next picture of the stage, or `None` when nothing came for as long as the socket waits.
    pub(crate) fn next_or_silence(&mut self) -> Option<RgbImage> {
        loop {
            match self.socket.read() {
                Ok(Message::Binary(bytes)) => {
                    self.ask(json!({"do": "seen", "what": "picture"}));
                    match read_picture(&bytes) {
                        Came::Picture { about, picture } if about["shows"] == "stage" => return Some(picture),
                        _ => {}
                    }
                }
                Ok(Message::Text(_)) => self.ask(json!({"do": "seen", "what": "state"})),
                Ok(_) => {}
                Err(tungstenite::Error::Io(error)) if error.kind() == std::io::ErrorKind::WouldBlock => return None,
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Waits for something.
    pub(crate) fn wait<T>(&mut self, what: &str, mut wanted: impl FnMut(Came) -> Option<T>) -> T {
        let start = Instant::now();
        loop {
            assert!(start.elapsed() < PATIENCE, "waited for {what}");
            if let Some(found) = wanted(self.next()) {
                return found;
            }
        }
    }

    /// Waits for a state with a property.
    pub(crate) fn wait_state(&mut self, what: &str, mut holds: impl FnMut(&Value) -> bool) -> Value {
        self.wait(what, |came| match came {
            Came::State(state) if holds(&state) => Some(state),
            _ => None,
        })
    }

    /// Waits for a picture of something.
    pub(crate) fn wait_picture(&mut self, shows: &str, mut good: impl FnMut(&Value, &RgbImage) -> bool) -> RgbImage {
        self.wait(shows, |came| match came {
            Came::Picture { about, picture } if about["shows"] == shows && good(&about, &picture) => Some(picture),
            _ => None,
        })
    }
}

fn read_picture(bytes: &[u8]) -> Came {
    let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
    let about: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
    let picture = image::load_from_memory(&bytes[4 + length..]).unwrap().into_rgb8();
    Came::Picture { about, picture }
}

/// A connection that waits no longer than is sensible.
pub(crate) fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream.set_write_timeout(Some(PATIENCE)).unwrap();
    stream
}

/// Sends bytes and gives everything that is answered until the other end closes.
pub(crate) fn say(address: SocketAddr, bytes: &[u8]) -> String {
    let mut stream = connect(address);
    // Refused early, the rest cannot be written.
    let _ = stream.write_all(bytes);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

/// The status of a GET with these headers.
pub(crate) fn status(address: SocketAddr, path: &str, headers: &[&str]) -> u16 {
    let headers: String = headers.iter().map(|header| format!("{header}\r\n")).collect();
    status_of(&say(address, format!("GET {path} HTTP/1.1\r\n{headers}\r\n").as_bytes()))
}

/// The status of an answer; 0 where there is none.
pub(crate) fn status_of(answer: &str) -> u16 {
    answer.strip_prefix("HTTP/1.1 ").and_then(|rest| rest.get(..3)).and_then(|code| code.parse().ok()).unwrap_or(0)
}
