//! Hostile clients: they cause no panic and leak no memory, thread or file, and the next client is served.

use super::running::ServedSimulation;
use super::test_client::{TestClient, exchange, status, status_of};
use kinetoscope::prelude::*;
use kinetoscope_testkit::process;
use kinetoscope_testkit::wait;
use kinetoscope_testkit::wait::threads_and_files;
use kinetoscope_testkit::worlds::{cfg, cube};
use std::io::Write;
use std::net::TcpStream;
use tungstenite::Message;

#[test]
fn garbage() {
    let running = ServedSimulation::start(1);
    // Pseudo-random bytes of all values, a TLS handshake, and malformed requests.
    let noise: Vec<u8> = (0..4096_u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let tls = [&b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"[..], &noise].concat();
    for bytes in [
        &noise[..],
        &tls,
        b"\0\0\0\0\r\n\r\n",
        b"GET\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost localhost\r\n\r\n",
        b"GET / HTTP/3.0\r\nHost: localhost\r\n\r\n",
        b"G@T / HTTP/1.1\nHost\n\n",
        b"GET / HTTP/1.1\r\nHost: \xff\xfe\r\n\r\n",
        b"GET /\x01 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    ] {
        let answer = exchange(running.address, bytes);
        assert_eq!(status_of(&answer), 400, "{:?}: {answer}", String::from_utf8_lossy(&bytes[..bytes.len().min(40)]));
    }
    assert_eq!(status(running.address, "/", &["Host: localhost"]), 200);
}

/// Encodes a frame as a browser sends it, masked with zeros.
fn frame(first: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![first];
    match payload.len() {
        short @ 0..=125 => bytes.push(0x80 | short as u8),
        long => {
            bytes.push(0x80 | 126);
            bytes.extend(u16::try_from(long).unwrap().to_be_bytes());
        }
    }
    bytes.extend([0; 4]);
    bytes.extend(payload);
    bytes
}

/// Sends bytes on an open WebSocket. Returns the code of the close frame.
fn closed_with(running: &ServedSimulation, bytes: &[u8]) -> Option<u16> {
    let mut visitor = TestClient::connect(running.address);
    // After an early refusal, the rest cannot be written.
    let _ = visitor.socket.get_mut().write_all(bytes);
    loop {
        match visitor.socket.read() {
            Ok(Message::Close(frame)) => return frame.map(|frame| frame.code.into()),
            Ok(_) => {}
            Err(_) => return None,
        }
    }
}

#[test]
fn malformed_frames() {
    let running = ServedSimulation::start(1);
    // A header that announces 2^62 bytes.
    let huge = [&[0x81, 0xff][..], &(1_u64 << 62).to_be_bytes(), &[0; 4], b"{"].concat();
    let fragments = [0x01, 0x00, 0x00].map(|first| frame(first, &[b' '; 8000])).concat();
    for (what, bytes, code) in [
        ("a huge frame", huge, 1009),
        ("a large frame", frame(0x81, &[b' '; 20_000]), 1009),
        ("fragments that add up", fragments, 1009),
        ("bytes", frame(0x82, b"abc"), 1003),
        ("not UTF-8", frame(0x81, b"\xff\xfe"), 1007),
        ("not masked", vec![0x81, 0x02, b'{', b'}'], 1002),
        ("an unknown kind", frame(0x83, b"abc"), 1002),
        ("reserved bits", frame(0xf1, b"abc"), 1002),
        ("goodbye", frame(0x88, &1000_u16.to_be_bytes()), 1000),
    ] {
        assert_eq!(closed_with(&running, &bytes), Some(code), "{what}");
    }
    TestClient::connect(running.address).wait_state("served as before", |_| true);
    wait::until("no viewer is left", || running.viewers() == 0);
}

#[test]
fn huge_heads() {
    process::assert_passes(module_path!(), "huge_heads_scenario", &[]);
}

/// Runs in its own process, because it measures memory.
#[test]
#[ignore = "runs in a process of its own"]
fn huge_heads_scenario() {
    /// Returns the resident memory of this process \[bytes\].
    fn resident() -> usize {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        line.trim().trim_end_matches(" kB").parse::<usize>().unwrap() << 10
    }
    if !process::is_child() {
        return;
    }
    let running = ServedSimulation::start(1);
    let before = resident();
    let long = "x".repeat(64 << 20);
    let headers: String = (0..500).map(|k| format!("A{k}: b\r\n")).collect();
    for (what, head) in [
        ("a line", format!("GET /{long} HTTP/1.1\r\nHost: localhost\r\n\r\n")),
        ("a header", format!("GET / HTTP/1.1\r\nHost: localhost\r\nCookie: {long}\r\n\r\n")),
        ("many headers", format!("GET / HTTP/1.1\r\nHost: localhost\r\n{headers}\r\n")),
    ] {
        assert_eq!(status_of(&exchange(running.address, head.as_bytes())), 431, "{what}");
    }
    drop(long);
    // The texts of 64 MB are freed; the server must not keep copies of them.
    let grown = resident().saturating_sub(before);
    assert!(grown < 100 << 20, "{} MB", grown >> 20);
    assert_eq!(status(running.address, "/", &["Host: localhost"]), 200);
}

#[test]
fn leaks() {
    process::assert_passes(module_path!(), "leaks_scenario", &[]);
}

/// Vanishing viewers and the end of the simulation leak nothing. It runs in its own process, because it counts threads
/// and files.
#[test]
#[ignore = "runs in a process of its own"]
fn leaks_scenario() {
    if !process::is_child() {
        return;
    }
    let bare = threads_and_files();
    let more_than = |than: [usize; 2]| threads_and_files().iter().zip(than).all(|(now, then)| *now > then);
    let mut sim = SimulationManager::new(cfg(1, 1)).unwrap();
    sim.add_rigid_object(cube("cube", 0.2, 1.0, [0.0, 0.0, 0.5])).unwrap();
    let served = sim.serve("127.0.0.1:0").unwrap();
    sim.update(10);
    let before = threads_and_files();
    assert!(more_than(bare), "a server has a thread and a socket: {bare:?} and {before:?}");
    for k in 0..20 {
        let mut visitor = TestClient::connect(served.address());
        visitor.socket.send(Message::text(r#"{"do":"size","width":320,"height":180}"#)).unwrap();
        sim.update(5);
        // Some vanish at once, some while an image is sent.
        for _ in 0..k % 4 {
            let _ = visitor.socket.read();
        }
        assert!(k != 7 || more_than(before), "a viewer has a thread and a socket");
        // Without a close frame: unread messages make the system reset the connection.
        drop(visitor);
    }
    wait::until("viewers are gone", || served.viewers() == 0);
    wait::until("as before the viewers", || threads_and_files() == before);
    sim.update(10);

    // A viewer that is connected when the simulation ends is disconnected.
    let mut visitor = TestClient::connect(served.address());
    wait::until("it is there", || served.viewers() == 1);
    drop(sim);
    while visitor.socket.read().is_ok() {}
    drop(visitor);
    wait::until("as before the simulation", || threads_and_files() == bare);
    assert!(TcpStream::connect(served.address()).is_err(), "the port is closed");
}
