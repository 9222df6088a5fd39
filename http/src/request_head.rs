//! Parser of HTTP request heads, with limits on size and duration.

use crate::response::Status;
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Maximum size of a request head \[bytes\]. Browsers send less than 2 kB, plus cookies of other pages on this machine.
const MAX_BYTES: usize = 16 << 10;
/// Maximum number of headers.
const MAX_HEADERS: usize = 96;
/// A parsed HTTP request head.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RequestHead {
    /// Method, such as `GET`.
    pub method: String,
    /// Path without the query.
    pub path: String,
    /// Query without the question mark.
    pub query: String,
    headers: Vec<(String, String)>,
    /// Bytes received after the head.
    pub rest: Vec<u8>,
}

impl RequestHead {
    /// Timeout of a complete request head. Clients that send a byte per second are refused.
    pub const READ_TIMEOUT: Duration = Duration::from_secs(5);

    /// Reads a request head, at most 16 KiB within 5 s. Returns `None` if the client sent nothing, or if the connection failed.
    ///
    /// # Errors
    /// The status of a response for a request that is malformed, too large or too slow.
    pub fn read(stream: &mut TcpStream) -> Result<Option<Self>, Status> {
        let start = Instant::now();
        let mut bytes = Vec::new();
        let mut chunk = [0; 2048];
        let mut parsed_length = 0;
        loop {
            let left = Self::READ_TIMEOUT.saturating_sub(start.elapsed());
            if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
                return Err(Status::Timeout);
            }
            let before = bytes.len();
            match stream.read(&mut chunk) {
                Ok(0) if bytes.is_empty() => return Ok(None),
                Ok(0) => return Err(Status::BadRequest),
                Ok(n) => bytes.extend_from_slice(&chunk[..n]),
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    return Err(Status::Timeout);
                }
                Err(_) => return Ok(None),
            }
            // A client that sends single bytes does not cause a parse for each of them. A head ends with an empty line.
            let new = &bytes[before.saturating_sub(2)..];
            let has_empty_line = [&b"\n\n"[..], b"\n\r\n"].iter().any(|end| new.windows(end.len()).any(|w| w == *end));
            if bytes.len() < 2 * parsed_length && !has_empty_line {
                continue;
            }
            parsed_length = bytes.len();
            if let Some(head) = Self::parse(&bytes)? {
                return Ok(Some(head));
            }
        }
    }

    /// Parses the first bytes of a connection, or returns `None` if the head is not complete.
    ///
    /// # Errors
    /// The status of a response for a request that is malformed or too large.
    pub fn parse(bytes: &[u8]) -> Result<Option<Self>, Status> {
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        let length = match request.parse(bytes) {
            Ok(httparse::Status::Complete(length)) if length <= MAX_BYTES => length,
            Ok(httparse::Status::Complete(_)) | Err(httparse::Error::TooManyHeaders) => {
                return Err(Status::HeadTooLarge);
            }
            Ok(httparse::Status::Partial) if bytes.len() >= MAX_BYTES => return Err(Status::HeadTooLarge),
            Ok(httparse::Status::Partial) => return Ok(None),
            Err(_) => return Err(Status::BadRequest),
        };
        let target = request.path.unwrap_or_default();
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let text =
            |value: &[u8]| std::str::from_utf8(value).map(|v| v.trim().to_string()).map_err(|_| Status::BadRequest);
        let headers: Result<Vec<_>, Status> =
            request.headers.iter().map(|h| Ok((h.name.to_ascii_lowercase(), text(h.value)?))).collect();
        Ok(Some(Self {
            method: request.method.unwrap_or_default().into(),
            path: path.into(),
            query: query.into(),
            headers: headers?,
            rest: bytes[length..].to_vec(),
        }))
    }

    /// Returns the value of a header, by lower-case name.
    ///
    /// # Errors
    /// The header occurs several times, which is ambiguous.
    pub fn header(&self, name: &str) -> Result<Option<&str>, Status> {
        let mut values = self.headers.iter().filter(|(n, _)| n == name).map(|(_, value)| value.as_str());
        match (values.next(), values.next()) {
            (value, None) => Ok(value),
            _ => Err(Status::BadRequest),
        }
    }

    /// True if a comma-separated header contains a word.
    pub fn header_contains(&self, name: &str, word: &str) -> bool {
        let values = self.headers.iter().filter(|(n, _)| n == name);
        values.flat_map(|(_, value)| value.split(',')).any(|item| item.trim().eq_ignore_ascii_case(word))
    }

    /// Returns a value of the query.
    pub fn query(&self, key: &str) -> Option<&str> {
        self.query.split('&').filter_map(|pair| pair.split_once('=')).find(|(k, _)| *k == key).map(|(_, value)| value)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use std::io::Write;
    use std::net::TcpListener;

    fn parsed(text: &str) -> Result<Option<RequestHead>, Status> {
        RequestHead::parse(text.as_bytes())
    }

    /// A client may send single bytes. The bytes after the head are kept.
    #[test]
    fn single_bytes() {
        for end in ["\r\n\r\n", "\n\n", "\r\n\n"] {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            let mut client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            let (mut server, _) = listener.accept().unwrap();
            let text = format!("GET /page HTTP/1.1\r\nHost: localhost{end}");
            let sent = std::thread::spawn(move || {
                client.set_nodelay(true).unwrap();
                let (last, bytes) = text.as_bytes().split_last().unwrap();
                for byte in bytes {
                    client.write_all(&[*byte]).unwrap();
                    std::thread::sleep(Duration::from_micros(200));
                }
                client.write_all(&[*last, b'x', b'y']).unwrap();
                client
            });
            let head = RequestHead::read(&mut server).unwrap().unwrap();
            assert_eq!((head.path.as_str(), head.header("host")), ("/page", Ok(Some("localhost"))));
            assert_eq!(head.rest, b"xy");
            sent.join().unwrap();
        }
    }

    #[test]
    fn requests() {
        let text =
            "GET /live?a=1&token=xyz HTTP/1.1\r\nHost: localhost:8080\r\nConnection: keep-alive, Upgrade\r\n\r\nmore";
        let head = parsed(text).unwrap().expect("whole");
        assert_eq!((head.method.as_str(), head.path.as_str(), head.query("token")), ("GET", "/live", Some("xyz")));
        assert_eq!(head.header("host"), Ok(Some("localhost:8080")));
        assert_eq!(head.header("origin"), Ok(None));
        assert!(head.header_contains("connection", "upgrade") && !head.header_contains("connection", "close"));
        assert_eq!(head.rest, b"more");
        // An incomplete request waits for more bytes.
        for end in 1..text.len() - "more".len() {
            assert_eq!(parsed(&text[..end]), Ok(None), "{:?}", &text[..end]);
        }
        let long = format!("GET / HTTP/1.1\r\nCookie: {}", "a".repeat(MAX_BYTES));
        assert_eq!(parsed(&long[..MAX_BYTES - 1]), Ok(None));
        assert_eq!(parsed(&long[..MAX_BYTES]), Err(Status::HeadTooLarge));
        let many: String = (0..=MAX_HEADERS).map(|k| format!("a{k}: b\r\n")).collect();
        assert_eq!(parsed(&format!("GET / HTTP/1.1\r\n{many}\r\n")), Err(Status::HeadTooLarge));
    }
}
