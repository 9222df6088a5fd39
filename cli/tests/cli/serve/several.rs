//! Several viewers at once, and those who do not read.

use crate::serve::running::{Running, wait_until};
use crate::serve::visitor::{Visitor, connect};
use kinetoscope::prelude::*;
use kinetoscope::view::{Command, Speed};
use serde_json::json;
use std::io::Write;
use std::time::{Duration, Instant};
use tungstenite::Message;

/// A step of this scene takes less than a millisecond; a viewer that does not read is given up after five seconds. A
/// simulation that waited for it, even once, would take longer for a step than this.
const LONGEST_STEP: f64 = 2.0;

#[test]
fn each_viewer_has_its_own_view() {
    let running = Running::start(2);
    let mut visitors: Vec<Visitor> = (0..3).map(|_| Visitor::enter(&running)).collect();
    for (k, visitor) in (0u32..).zip(&mut visitors) {
        visitor.ask(json!({"do": "size", "width": 160 + 16 * k, "height": 90}));
        visitor.ask(json!({"do": "environment", "env": if k == 0 { None } else { Some(k - 1) }}));
    }
    for (k, visitor) in (0u32..).zip(&mut visitors) {
        visitor.wait_picture("stage", |_, picture| picture.dimensions() == (160 + 16 * k, 90));
        let env = if k == 0 { json!(null) } else { json!(k - 1) };
        visitor.wait_state("its environment", |state| state["environment"] == env && state["viewers"] == 3);
    }
    assert_eq!(running.viewers(), 3);
    drop(visitors);
    wait_until("they are gone", || running.viewers() == 0);
}

#[test]
fn there_are_no_more_viewers_than_may_be() {
    let running = Running::start_at(1, "127.0.0.1:0", ServeCfg { max_viewers: 2, ..Default::default() });
    let (first, _second) = (Visitor::enter(&running), Visitor::enter(&running));
    let third = tungstenite::client(format!("ws://{}/live", running.address), connect(running.address));
    let Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) = third else {
        panic!("there is no place for a third")
    };
    assert_eq!(answer.status().as_u16(), 503);
    drop(first);
    wait_until("a place is free", || running.viewers() < 2);
    Visitor::enter(&running).wait_state("any", |_| true);
}

#[test]
fn a_viewer_that_reads_nothing_slows_nobody() {
    let running = Running::start(1);
    let mut alive = Visitor::enter(&running);
    let dead = Visitor::enter(&running);
    // This one talks without end and reads no answer: they fill the buffers of both sides.
    let greedy = Visitor::enter(&running);
    alive.wait_state("three", |state| state["viewers"] == 3);
    running.forget_longest_step();
    let before = running.now().steps;
    let talk = std::thread::spawn(move || {
        let mut greedy = greedy;
        let mut said = 0_u32;
        while greedy.socket.send(Message::text(r#"{"do":"nothing"}"#)).is_ok() {
            said += 1;
        }
        said
    });
    // Both are given up when they were silent, or have not read, for seconds; the third reads on.
    let start = Instant::now();
    while running.viewers() > 1 {
        assert!(start.elapsed() < Duration::from_secs(90), "{} viewers", running.viewers());
        alive.wait_picture("stage", |_, _| true);
    }
    assert!(talk.join().unwrap() > 1000, "buffers take more than a few answers");
    let given_up_after = start.elapsed();
    assert!(given_up_after > Duration::from_secs(3), "{given_up_after:?}: a viewer may be slow for a moment");
    let now = running.now();
    assert!(now.steps > before + 200, "{} steps", now.steps - before);
    assert!(now.longest_step < LONGEST_STEP, "a step took {} s", now.longest_step);
    alive.wait_state("alone", |state| state["viewers"] == 1);
    drop(dead);
}

#[test]
fn who_pauses_and_leaves_does_not_hold_the_simulation_for_ever() {
    let running = Running::start(1);
    let mut visitor = Visitor::enter(&running);
    visitor.ask(json!({"do": "pause"}));
    visitor.wait_state("paused", |state| state["paused"] == true);
    drop(visitor);
    // Somebody who comes back at once finds it as it was.
    wait_until("nobody is there", || running.viewers() == 0);
    std::thread::sleep(Duration::from_secs(1));
    let mut again = Visitor::enter(&running);
    again.wait_state("still paused", |state| state["paused"] == true);
    let held = running.now().steps;
    drop(again);
    running.wait_until("it goes on by itself", |now| now.steps > held + 20);
}

#[test]
fn a_pause_that_no_browser_made_stays_when_the_browsers_leave() {
    let running =
        Running::start_at(1, "127.0.0.1:0", ServeCfg { speed: Some(Speed::Times(3.0)), ..ServeCfg::default() });
    let run = || running.key.newest().unwrap().run.clone();
    // As a window does it.
    running.key.send(Command::Pause);
    wait_until("it is held", || run().paused);
    let mut visitor = Visitor::enter(&running);
    visitor.ask(json!({"do": "speed", "factor": 0.5}));
    visitor.wait_state("slower", |state| state["speed"] == 0.5);
    visitor.ask(json!({"do": "step"}));
    let steps = run().steps;
    visitor.wait_state("a step", |state| state["steps"].as_u64() > Some(steps) && state["paused"] == true);
    let held = steps + 1;
    drop(visitor);
    wait_until("what the browser did is undone", || run().speed == Speed::Times(3.0));
    assert!(run().paused && run().steps == held, "{:?}", run());
    running.key.send(Command::Resume);
    let before = running.now().steps;
    running.wait_until("it goes on", |now| now.steps > before + 20);
}

#[test]
fn a_connection_that_says_nothing_is_closed() {
    let running = Running::start(1);
    let mut silent = connect(running.address);
    silent.write_all(b"GET / HTTP/1.1\r\nHost: loc").unwrap();
    let mut answer = String::new();
    std::io::Read::read_to_string(&mut silent, &mut answer).unwrap();
    assert_eq!(crate::serve::visitor::status_of(&answer), 408, "{answer}");
}
