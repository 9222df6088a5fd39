//! Those with bad manners are refused: no panic, no memory, and the next one is served.

use crate::serve::running::Running;
use crate::serve::visitor::{Visitor, connect, say, status, status_of};
use std::fmt::Write as _;
use std::io::{Read, Write};
use std::time::Duration;

#[test]
fn garbage_is_refused() {
    let running = Running::start(1);
    // A pseudo-random sequence of every byte, a TLS greeting, and requests that are none.
    let noise: Vec<u8> = (0..4096_u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let tls = [&b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"[..], &noise].concat();
    for bytes in [
        &noise[..],
        &tls,
        b"\0\0\0\0\r\n\r\n",
        b"GET\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost localhost\r\n\r\n",
        b"GET / HTTP/3.0\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: \xff\xfe\r\n\r\n",
        b"GET /\x01 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    ] {
        let answer = say(running.address, bytes);
        assert_eq!(status_of(&answer), 400, "{:?}: {answer}", String::from_utf8_lossy(&bytes[..bytes.len().min(40)]));
    }
    assert_eq!(status(running.address, "/", &["Host: localhost"]), 200);
}

#[test]
fn huge_heads_are_refused_early() {
    let running = Running::start(1);
    let before = resident();
    let long = "x".repeat(64 << 20);
    let answer = say(running.address, format!("GET /{long} HTTP/1.1\r\nHost: localhost\r\n\r\n").as_bytes());
    assert_eq!(status_of(&answer), 431, "a line");
    let answer =
        say(running.address, format!("GET / HTTP/1.1\r\nHost: localhost\r\nCookie: {long}\r\n\r\n").as_bytes());
    assert_eq!(status_of(&answer), 431, "a header");
    let mut many = String::from("GET / HTTP/1.1\r\nHost: localhost\r\n");
    for k in 0..500 {
        let _ = write!(many, "A{k}: b\r\n");
    }
    assert_eq!(status_of(&say(running.address, (many + "\r\n").as_bytes())), 431, "many headers");
    drop(long);
    // The 64 MB are ours, and were freed; of them nothing may be kept. Other tests in this process draw pictures.
    let grown = resident().saturating_sub(before);
    assert!(grown < 100 << 20, "{} MB", grown >> 20);
    assert_eq!(status(running.address, "/", &["Host: localhost"]), 200);
}

/// Memory of this process \[bytes\].
fn resident() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<usize>().unwrap() << 10
}

/// A frame as a browser sends it, masked with zeros.
fn frame(first: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![first];
    match payload.len() {
        short @ 0..=125 => bytes.push(0x80 | short as u8),
        middle @ 126..=0xffff => {
            bytes.push(0x80 | 126);
            bytes.extend((middle as u16).to_be_bytes());
        }
        long => {
            bytes.push(0x80 | 127);
            bytes.extend((long as u64).to_be_bytes());
        }
    }
    bytes.extend([0; 4]);
    bytes.extend(payload);
    bytes
}

/// Sends bytes on an open WebSocket; gives the code with which it is closed.
fn closed_with(running: &Running, bytes: &[u8]) -> Option<u16> {
    let mut visitor = Visitor::enter(running);
    let stream = visitor.socket.get_mut();
    // Refused early, the rest cannot be written.
    let _ = stream.write_all(bytes);
    loop {
        match visitor.socket.read() {
            Ok(tungstenite::Message::Close(frame)) => return frame.map(|frame| frame.code.into()),
            Ok(_) => {}
            Err(_) => return None,
        }
    }
}

#[test]
fn frames_that_are_none_close_the_socket() {
    let running = Running::start(1);
    // Announces 2^62 bytes.
    let huge = [&[0x81, 0xff][..], &(1_u64 << 62).to_be_bytes(), &[0; 4], b"{"].concat();
    let fragments = [frame(0x01, &[b' '; 8000]), frame(0x00, &[b' '; 8000]), frame(0x00, &[b' '; 8000])].concat();
    for (what, bytes, code) in [
        ("a huge frame", huge, 1009),
        ("a large frame", frame(0x81, &[b' '; 20_000]), 1009),
        ("fragments that add up", fragments, 1009),
        ("bytes", frame(0x82, b"abc"), 1003),
        ("not UTF-8", frame(0x81, b"\xff\xfe"), 1007),
        ("not masked", vec![0x81, 0x02, b'{', b'}'], 1002),
        ("an unknown kind", frame(0x83, b"abc"), 1002),
        ("reserved bits", frame(0xf1, b"abc"), 1002),
    ] {
        assert_eq!(closed_with(&running, &bytes), Some(code), "{what}");
    }
    // One that says goodbye is answered.
    assert_eq!(closed_with(&running, &frame(0x88, &1000_u16.to_be_bytes())), Some(1000));
    Visitor::enter(&running).wait_state("served as before", |_| true);
    crate::serve::running::wait_until("nobody is left", || running.viewers() == 0);
}

#[test]
fn a_flood_of_connections_leaves_room_for_viewers() {
    let running = Running::start(1);
    let mut viewer = Visitor::enter(&running);
    // More than the server takes at a time; they say nothing until their time is up.
    let silent: Vec<_> = (0..120).map(|_| connect(running.address)).collect();
    viewer.wait_state("the viewer is served", |state| state["viewers"] == 1);
    drop(silent);
    crate::serve::running::wait_until("there is room again", || {
        status(running.address, "/", &["Host: localhost"]) == 200
    });
    // And nothing is said to those who leave at once.
    for _ in 0..20 {
        connect(running.address).shutdown(std::net::Shutdown::Both).unwrap();
    }
    let mut half = connect(running.address);
    half.shutdown(std::net::Shutdown::Write).unwrap();
    half.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    assert_eq!(half.read(&mut [0; 16]).unwrap(), 0);
}
