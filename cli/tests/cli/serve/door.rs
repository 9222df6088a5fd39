//! Who is let in.

use crate::serve::running::{Running, scene};
use crate::serve::visitor::{say, status, status_of};
use kinetoscope::prelude::*;
use std::net::TcpListener;

/// What a browser sends to open a WebSocket.
const UPGRADE: [&str; 4] = [
    "Connection: keep-alive, Upgrade",
    "Upgrade: websocket",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
];

#[test]
fn the_page_loads_and_loads_nothing_from_elsewhere() {
    let running = Running::start(1);
    assert_eq!(running.url, format!("http://{}/", running.address));
    let answer = say(running.address, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    assert_eq!(status_of(&answer), 200, "{answer}");
    let (head, page) = answer.split_once("\r\n\r\n").unwrap();
    assert!(head.contains("Content-Type: text/html") && head.contains("default-src 'none'"), "{head}");
    assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
    let length = head.lines().find_map(|line| line.strip_prefix("Content-Length: ")).unwrap();
    assert_eq!(length.parse::<usize>().unwrap(), page.len());
    // Asked for the head only, the head only comes.
    let answer = say(running.address, b"HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    assert!(status_of(&answer) == 200 && answer.ends_with("\r\n\r\n"), "{answer}");
}

#[test]
fn pages_of_other_sites_are_kept_out() {
    let running = Running::start(1);
    let port = running.address.port();
    let get = |path: &str, headers: &[String]| {
        status(running.address, path, &headers.iter().map(String::as_str).collect::<Vec<_>>())
    };
    // The name of a site that was made to point here (DNS rebinding).
    for host in ["evil.example", &format!("evil.example:{port}"), "127.0.0.1.evil.example", "10.1.2.3"] {
        assert_eq!(get("/", &[format!("Host: {host}")]), 403, "{host}");
    }
    // A tunnel has another port.
    for host in [format!("127.0.0.1:{port}"), "localhost:1234".into(), "[::1]:80".into()] {
        assert_eq!(get("/", &[format!("Host: {host}")]), 200, "{host}");
    }
    let upgrade = |origin: &str| {
        let mut headers: Vec<String> = UPGRADE.map(String::from).to_vec();
        headers.extend([format!("Host: 127.0.0.1:{port}"), format!("Origin: {origin}")]);
        get("/live", &headers)
    };
    let others =
        ["http://evil.example".into(), "null".into(), format!("http://localhost:{port}"), "http://127.0.0.1".into()];
    for origin in others {
        assert_eq!(upgrade(&origin), 403, "{origin}");
    }
    // What is asked on an open WebSocket ends with the stream: the answer is all that is looked at.
    assert_eq!(upgrade_status(&running, &format!("http://127.0.0.1:{port}")), 101);
}

/// The status of an upgrade that may succeed, without waiting for the end.
fn upgrade_status(running: &Running, origin: &str) -> u16 {
    use std::io::{Read, Write};
    let mut stream = crate::serve::visitor::connect(running.address);
    let headers = UPGRADE.join("\r\n");
    let text = format!("GET /live HTTP/1.1\r\n{headers}\r\nHost: {}\r\nOrigin: {origin}\r\n\r\n", running.address);
    stream.write_all(text.as_bytes()).unwrap();
    let mut answer = [0; 256];
    let n = stream.read(&mut answer).unwrap();
    let answer = String::from_utf8_lossy(&answer[..n]).into_owned();
    // The answer to this key in RFC 6455, section 1.3.
    assert!(status_of(&answer) != 101 || answer.contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{answer}");
    status_of(&answer)
}

#[test]
fn another_address_needs_the_token() {
    let running = Running::start_at(1, "0.0.0.0:0", ServeCfg::default());
    let token = running.url.split_once("/?token=").expect("a token in the address").1.to_string();
    assert!(token.len() >= 32, "{token}");
    let local = ([127, 0, 0, 1], running.address.port()).into();
    let host = "Host: robot.lan:8080";
    assert_eq!(status(local, "/", &[host]), 403);
    assert_eq!(status(local, "/?token=", &[host]), 403);
    assert_eq!(status(local, &format!("/?token={}", &token[1..]), &[host]), 403);
    assert_eq!(status(local, &format!("/?token={}x", &token[..token.len() - 1]), &[host]), 403);
    let upgrade: Vec<&str> = UPGRADE.into_iter().chain([host]).collect();
    assert_eq!(status(local, "/live", &upgrade), 403);
    assert_eq!(status(local, &format!("/?token={token}"), &[host]), 200);
    // Nothing but the token opens it, whoever asks for it.
    assert_eq!(status(local, "/", &["Host: localhost"]), 403);
}

#[test]
fn only_what_is_there_is_answered() {
    let running = Running::start(1);
    let host = "Host: localhost";
    assert_eq!(status(running.address, "/etc/passwd", &[host]), 404);
    assert_eq!(status(running.address, "/../../etc/passwd", &[host]), 404);
    assert_eq!(status(running.address, "/live", &[host]), 426);
    assert_eq!(status(running.address, "/", &[]), 400, "HTTP 1.1 has a host");
    assert_eq!(status(running.address, "/", &[host, host]), 400, "only one");
    let post = say(running.address, b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 4\r\n\r\nabcd");
    assert_eq!(status_of(&post), 405, "{post}");
}

#[test]
fn what_cannot_be_listened_on_is_a_typed_error() {
    let mut sim = scene(1);
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    let error = sim.serve(&address.to_string()).unwrap_err();
    let ServeError::PortInUse { next: Some(next), .. } = &error else { panic!("{error}") };
    assert!(error.to_string().contains(&format!("port {} is in use; try {next}", address.port())), "{error}");
    let error = sim.serve("127.0.0.1:http").unwrap_err();
    assert!(matches!(error, ServeError::Address { .. }) && error.to_string().contains("127.0.0.1:8080"), "{error}");
    // The candidate is right, and a view that could not be had leaves nothing behind.
    sim.serve(&next.to_string()).unwrap();
}
