//! HTTP responses. The connection is closed after each response.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// Timeout of writing a response.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// Number of bytes and time for which remaining request data is read before closing. Closing a socket with unread data
/// would reset the connection and lose the response.
const DRAIN_LIMIT: (usize, Duration) = (256 << 10, Duration::from_millis(300));

/// Reason of a refused request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Status {
    BadRequest,
    Forbidden,
    NotFound,
    MethodNotAllowed,
    Timeout,
    UpgradeRequired,
    HeadTooLarge,
    ServiceUnavailable,
    InternalError,
}

impl Status {
    fn status_line(self) -> &'static str {
        match self {
            Self::BadRequest => "400 Bad Request",
            Self::Forbidden => "403 Forbidden",
            Self::NotFound => "404 Not Found",
            Self::MethodNotAllowed => "405 Method Not Allowed",
            Self::Timeout => "408 Request Timeout",
            Self::UpgradeRequired => "426 Upgrade Required",
            Self::HeadTooLarge => "431 Request Header Fields Too Large",
            Self::ServiceUnavailable => "503 Service Unavailable",
            Self::InternalError => "500 Internal Server Error",
        }
    }

    fn explanation(self) -> &'static str {
        match self {
            Self::BadRequest => "Malformed request.",
            Self::Forbidden => {
                "Not allowed. Open the address that the program printed, including the token if it has one; requests from \
                 other websites are refused."
            }
            Self::NotFound => "Not found: the page is at /.",
            Self::MethodNotAllowed => "Only GET and HEAD are supported.",
            Self::Timeout => "The request took too long.",
            Self::UpgradeRequired => "This endpoint requires WebSocket version 13.",
            Self::HeadTooLarge => "The request is too large.",
            Self::ServiceUnavailable => "The maximum number of viewers is reached: close one and reload this page.",
            Self::InternalError => "Internal server error.",
        }
    }
}

/// Web pages that may show the page in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FrameAncestors {
    None,
    ThisMachine,
}

impl FrameAncestors {
    /// Sources of the directive `frame-ancestors` (Content Security Policy, level 3). It has no notation for IPv6
    /// addresses.
    fn sources(self) -> &'static str {
        match self {
            Self::None => "'none'",
            Self::ThisMachine => "http://localhost:* https://localhost:* http://127.0.0.1:* https://127.0.0.1:*",
        }
    }
}

/// Sends the page with status 200.
pub(super) fn send_page(stream: &mut TcpStream, html: &str, nonce: &str, frames: FrameAncestors, with_body: bool) {
    let policy = format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; connect-src 'self'; img-src blob: \
         data:; base-uri 'none'; form-action 'none'; frame-ancestors {}",
        frames.sources()
    );
    let more = [("Content-Security-Policy", policy.as_str()), ("Content-Type", "text/html; charset=utf-8")];
    send(stream, "200 OK", &more, html, with_body);
}

/// Sends a status and an explanation. Responses to HEAD requests have no body.
pub(super) fn send_error(stream: &mut TcpStream, status: Status, with_body: bool) {
    let more: &[(&str, &str)] = match status {
        Status::MethodNotAllowed => &[("Allow", "GET, HEAD")],
        Status::UpgradeRequired => &[("Upgrade", "websocket"), ("Sec-WebSocket-Version", "13")],
        Status::ServiceUnavailable => &[("Retry-After", "5")],
        _ => &[],
    };
    let more: Vec<_> = more.iter().copied().chain([("Content-Type", "text/plain; charset=utf-8")]).collect();
    send(stream, status.status_line(), &more, &format!("{}\n", status.explanation()), with_body);
}

fn send(stream: &mut TcpStream, line: &str, more: &[(&str, &str)], body: &str, with_body: bool) {
    let more: String = more.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let head = format!(
        "HTTP/1.1 {line}\r\n{more}Content-Length: {}\r\nCache-Control: no-store\r\nReferrer-Policy: no-referrer\r\n\
         X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
        body.len()
    );
    let body = if with_body { body } else { "" };
    let sent = stream.set_write_timeout(Some(WRITE_TIMEOUT)).and_then(|()| stream.write_all((head + body).as_bytes()));
    if sent.is_ok() {
        drain(stream);
    }
}

/// Ends the sending side of the connection, then reads the remaining request data, within limits.
pub(super) fn drain(stream: &mut TcpStream) {
    let (most, time) = DRAIN_LIMIT;
    let start = Instant::now();
    let (mut seen, mut chunk) = (0, [0; 4096]);
    if stream.shutdown(Shutdown::Write).is_err() {
        return;
    }
    while seen < most {
        let left = time.saturating_sub(start.elapsed());
        if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
            return;
        }
        match stream.read(&mut chunk) {
            Ok(0) | Err(_) => return,
            Ok(n) => seen += n,
        }
    }
}
