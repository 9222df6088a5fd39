//! Access control: hosts, origins, tokens, and response statuses.

use super::running::{ServedSimulation, scene};
use super::test_client::{connect, exchange, status, status_of};
use kinetoscope::prelude::*;
use kinetoscope::viewer::{ServeCfg, ServeError};
use std::io::{Read, Write};
use std::net::TcpListener;

/// Headers that a browser sends to open a WebSocket.
const UPGRADE: [&str; 4] = [
    "Connection: keep-alive, Upgrade",
    "Upgrade: websocket",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
];

/// The page is complete and loads nothing from elsewhere; other paths are refused.
#[test]
fn page() {
    let running = ServedSimulation::start(1);
    assert_eq!(running.url, format!("http://{}/", running.address));
    let answer = exchange(running.address, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    assert_eq!(status_of(&answer), 200, "{answer}");
    let (head, page) = answer.split_once("\r\n\r\n").unwrap();
    assert!(head.contains("Content-Type: text/html") && head.contains("default-src 'none'"), "{head}");
    assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
    let length = head.lines().find_map(|line| line.strip_prefix("Content-Length: ")).unwrap();
    assert_eq!(length.parse::<usize>().unwrap(), page.len());
    let answer = exchange(running.address, b"HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    assert!(status_of(&answer) == 200 && answer.ends_with("\r\n\r\n"), "{answer}");
    let host = "Host: localhost";
    for (path, headers, expected) in [
        ("/etc/passwd", &[host][..], 404),
        ("/../../etc/passwd", &[host], 404),
        ("/live", &[host], 426),
        // HTTP 1.1 requires exactly one host.
        ("/", &[], 400),
        ("/", &[host, host], 400),
    ] {
        assert_eq!(status(running.address, path, headers), expected, "{path} {headers:?}");
    }
    // Root cause: refusals had a body for every method, but RFC 9110, section 9.3.2, forbids it for HEAD.
    for (path, header, expected) in [("/etc/passwd", host, 404), ("/", "Host: evil.example", 403)] {
        let of = |method: &str| {
            exchange(running.address, format!("{method} {path} HTTP/1.1\r\n{header}\r\n\r\n").as_bytes())
        };
        let [get, head] = ["GET", "HEAD"].map(of);
        assert_eq!([&get, &head].map(|answer| status_of(answer)), [expected; 2], "{path} {header}");
        let (get_head, body) = get.split_once("\r\n\r\n").unwrap();
        assert!(!body.is_empty() && head == format!("{get_head}\r\n\r\n"), "{head}");
    }
    let post = exchange(running.address, b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 4\r\n\r\nabcd");
    assert_eq!(status_of(&post), 405, "{post}");
}

/// Pages that may show the view in a frame: none by default, those of this machine on request.
#[test]
fn frames() {
    for (allow_local_frames, expected) in
        [(false, "'none'"), (true, "http://localhost:* https://localhost:* http://127.0.0.1:* https://127.0.0.1:*")]
    {
        let cfg = ServeCfg { allow_local_frames, ..ServeCfg::default() };
        let running = ServedSimulation::start_at(1, "127.0.0.1:0", cfg);
        let answer = exchange(running.address, b"HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\n");
        let policy = answer.lines().find_map(|line| line.strip_prefix("Content-Security-Policy: ")).unwrap();
        let ancestors = policy.split("; ").find_map(|rule| rule.strip_prefix("frame-ancestors ")).unwrap();
        assert_eq!(ancestors, expected);
        // Other headers would restrict frames, too.
        assert!(!answer.to_ascii_lowercase().contains("x-frame-options"), "{answer}");
    }
}

#[test]
fn other_sites() {
    let running = ServedSimulation::start(1);
    let port = running.address.port();
    for (host, expected) in [
        // A website whose name resolves to this machine (DNS rebinding).
        ("evil.example".into(), 403),
        (format!("evil.example:{port}"), 403),
        ("127.0.0.1.evil.example".into(), 403),
        ("10.1.2.3".into(), 403),
        (format!("127.0.0.1:{port}"), 200),
        // A tunnel has a different port.
        ("localhost:1234".into(), 200),
        ("[::1]:80".into(), 200),
    ] {
        assert_eq!(status(running.address, "/", &[&format!("Host: {host}")]), expected, "{host}");
    }
    let host = format!("Host: 127.0.0.1:{port}");
    for origin in ["http://evil.example", "null", &format!("http://localhost:{port}"), "http://127.0.0.1"] {
        let origin = format!("Origin: {origin}");
        let headers = [&UPGRADE[..], &[&host, &origin]].concat();
        assert_eq!(status(running.address, "/live", &headers), 403, "{origin}");
    }
    // Control. An open WebSocket does not end, so only the first response is read.
    let mut stream = connect(running.address);
    let headers = UPGRADE.join("\r\n");
    write!(stream, "GET /live HTTP/1.1\r\n{headers}\r\n{host}\r\nOrigin: http://127.0.0.1:{port}\r\n\r\n").unwrap();
    let mut answer = [0; 256];
    let n = stream.read(&mut answer).unwrap();
    let answer = String::from_utf8_lossy(&answer[..n]);
    // The response to this key in RFC 6455, section 1.3.
    assert!(status_of(&answer) == 101 && answer.contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{answer}");
}

/// An address of the network requires the token, and nothing else grants access.
#[test]
fn token() {
    let running = ServedSimulation::start_at(1, "0.0.0.0:0", ServeCfg::default());
    let token = running.url.split_once("/?token=").expect("a token in the address").1;
    assert!(token.len() >= 32, "{token}");
    let local = ([127, 0, 0, 1], running.address.port()).into();
    let host = "Host: robot.lan:8080";
    let upgrade = [&UPGRADE[..], &[host]].concat();
    for (path, headers, expected) in [
        ("/", &[host][..], 403),
        ("/?token=", &[host], 403),
        (&format!("/?token={}", &token[1..]), &[host], 403),
        (&format!("/?token={}x", &token[..token.len() - 1]), &[host], 403),
        ("/live", &upgrade, 403),
        (&format!("/?token={token}"), &[host], 200),
        ("/", &["Host: localhost"], 403),
    ] {
        assert_eq!(status(local, path, headers), expected, "{path}");
    }
    // A log of the handle does not give access.
    let mut sim = scene(1);
    let served = sim.serve("0.0.0.0:0").unwrap();
    let token = served.url().split_once("/?token=").unwrap().1;
    let text = format!("{served:?}");
    assert!(text.contains(&served.address().port().to_string()) && !text.contains(token), "{text}");
}

#[test]
fn address_errors() {
    let mut sim = scene(1);
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    let error = sim.serve(&address.to_string()).unwrap_err();
    let ServeError::PortInUse { next: Some(next), .. } = &error else { panic!("{error}") };
    assert!(error.to_string().contains(&format!("port {} is in use; try {next}", address.port())), "{error}");
    let error = sim.serve("127.0.0.1:http").unwrap_err();
    assert!(matches!(error, ServeError::Address { .. }) && error.to_string().contains("127.0.0.1:8080"), "{error}");
    // The suggested port works, and a failed view leaves nothing behind.
    sim.serve(&next.to_string()).unwrap();
}
