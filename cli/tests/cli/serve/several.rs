//! Several simultaneous viewers, including slow ones.

use super::running::ServedSimulation;
use super::test_client::{TestClient, connect, exchange, status_of};
use kinetoscope::viewer::{Command, ServeCfg, Speed};
use kinetoscope_testkit::wait;
use serde_json::json;
use std::io::{Read, Write};
use std::time::{Duration, Instant};
use tungstenite::Message;

/// A step of this scene takes less than a millisecond, and a viewer that does not read is disconnected after five
/// seconds. A simulation that waited for it even once would exceed this duration of a step.
const LONGEST_STEP: f64 = 2.0;

#[test]
fn own_views() {
    let running = ServedSimulation::start(2);
    let mut visitors: Vec<TestClient> = (0..3).map(|_| TestClient::connect(running.address)).collect();
    for (k, visitor) in (0u32..).zip(&mut visitors) {
        visitor.send(json!({"do": "size", "width": 160 + 16 * k, "height": 90}));
        visitor.send(json!({"do": "environment", "env": k.checked_sub(1)}));
    }
    for (k, visitor) in (0u32..).zip(&mut visitors) {
        visitor.wait_image("stage", |_, image| image.dimensions() == (160 + 16 * k, 90));
        let env = json!(k.checked_sub(1));
        visitor.wait_state("its environment", |state| state["environment"] == env && state["viewers"] == 3);
    }
    assert_eq!(running.viewers(), 3);
    drop(visitors);
    wait::until("they are gone", || running.viewers() == 0);
}

#[test]
fn max_viewers() {
    let running = ServedSimulation::start_at(1, "127.0.0.1:0", ServeCfg { max_viewers: 2, ..Default::default() });
    let (first, _second) = (TestClient::connect(running.address), TestClient::connect(running.address));
    let third = tungstenite::client(format!("ws://{}/live", running.address), connect(running.address));
    let Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) = third else {
        panic!("a third viewer is accepted")
    };
    assert_eq!(answer.status().as_u16(), 503);
    drop(first);
    wait::until("a place is free", || running.viewers() < 2);
    TestClient::connect(running.address).wait_state("any", |_| true);
}

/// A viewer that does not read slows neither the simulation nor another viewer.
#[test]
fn slow_viewers() {
    let running = ServedSimulation::start(1);
    let [mut alive, dead, mut greedy] = [(); 3].map(|()| TestClient::connect(running.address));
    alive.wait_state("three", |state| state["viewers"] == 3);
    running.reset_longest_step();
    let before = running.now().steps;
    // This viewer sends endlessly and reads no response.
    let talk = std::thread::spawn(move || {
        let mut said = 0_u32;
        while greedy.socket.send(Message::text(r#"{"do":"nothing"}"#)).is_ok() {
            said += 1;
        }
        said
    });
    // One is disconnected for the number of its messages, the other one after seconds of silence; the third keeps reading.
    let start = Instant::now();
    while running.viewers() > 1 {
        assert!(start.elapsed() < Duration::from_secs(90), "{} viewers", running.viewers());
        alive.wait_image("stage", |_, _| true);
    }
    assert!(talk.join().unwrap() > 1000, "a viewer may send many messages at once");
    let given_up_after = start.elapsed();
    assert!(given_up_after > Duration::from_secs(3), "{given_up_after:?}: a viewer may be slow for a moment");
    let now = running.now();
    assert!(now.steps > before + 200, "{} steps", now.steps - before);
    assert!(now.longest_step < LONGEST_STEP, "a step took {} s", now.longest_step);
    alive.wait_state("alone", |state| state["viewers"] == 1);
    drop(dead);
}

/// The pause of a viewer that leaves ends after a while; a viewer that returns at once finds the simulation paused.
#[test]
fn pause_of_browser() {
    let running = ServedSimulation::start(1);
    let mut visitor = TestClient::connect(running.address);
    visitor.pause();
    drop(visitor);
    wait::until("no viewer is left", || running.viewers() == 0);
    std::thread::sleep(Duration::from_secs(1));
    let mut again = TestClient::connect(running.address);
    again.wait_state("still paused", |state| state["paused"] == true);
    drop(again);
    running.wait_for_steps(20);
}

/// A pause by the program, such as by a window, stays when the browsers leave; their own settings do not.
#[test]
fn pause_of_program() {
    let cfg = ServeCfg { speed: Some(Speed::Factor(3.0)), ..ServeCfg::default() };
    let running = ServedSimulation::start_at(1, "127.0.0.1:0", cfg);
    let run = || running.viewer.newest().unwrap().run.clone();
    running.viewer.send(Command::Pause);
    wait::until("it is held", || run().paused);
    let mut visitor = TestClient::connect(running.address);
    visitor.send(json!({"do": "speed", "factor": 0.5}));
    visitor.wait_state("slower", |state| state["speed"] == 0.5);
    visitor.send(json!({"do": "step"}));
    let steps = run().steps;
    visitor.wait_state("a step", |state| state["steps"].as_u64() > Some(steps) && state["paused"] == true);
    drop(visitor);
    wait::until("the settings of the browser are undone", || run().speed == Speed::Factor(3.0));
    assert!(run().paused && run().steps == steps + 1, "{:?}", run());
    running.viewer.send(Command::Resume);
    running.wait_for_steps(20);
}

/// More connections than the server accepts at a time leave room for viewers; silent connections are closed.
#[test]
fn silent_connections() {
    let running = ServedSimulation::start(1);
    let mut silent = connect(running.address);
    silent.write_all(b"GET / HTTP/1.1\r\nHost: loc").unwrap();
    let mut answer = String::new();
    silent.read_to_string(&mut answer).unwrap();
    assert_eq!(status_of(&answer), 408, "{answer}");

    let mut viewer = TestClient::connect(running.address);
    let silent: Vec<_> = (0..120).map(|_| connect(running.address)).collect();
    viewer.wait_state("the viewer is served", |state| state["viewers"] == 1);
    // A new client is served at once: the oldest silent connection is closed for it.
    let get = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";
    for _ in 0..3 {
        assert_eq!(status_of(&exchange(running.address, get)), 200);
    }
    drop(silent);
    // Clients that disconnect at once get no response.
    for _ in 0..20 {
        connect(running.address).shutdown(std::net::Shutdown::Both).unwrap();
    }
    let mut half = connect(running.address);
    half.shutdown(std::net::Shutdown::Write).unwrap();
    half.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    assert_eq!(half.read(&mut [0; 16]).unwrap(), 0);
}
