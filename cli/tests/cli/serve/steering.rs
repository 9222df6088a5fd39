//! What viewers may do to the simulation.

use crate::serve::running::Running;
use crate::serve::visitor::{Came, Visitor};
use kinetoscope::prelude::*;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[test]
fn the_contents_say_what_there_is() {
    let running = Running::start(2);
    let mut visitor = Visitor::enter(&running);
    let contents = visitor.wait("contents", |came| match came {
        Came::Contents(contents) => Some(contents),
        _ => None,
    });
    assert_eq!(contents["environments"], 2);
    assert_eq!(contents["cameras"], json!(["eye"]));
    let joints = contents["robots"][0]["joints"].as_array().unwrap();
    assert_eq!(contents["robots"][0]["name"], "arm");
    let names: Vec<&str> = joints.iter().map(|joint| joint["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["JOINT1", "JOINT2", "JOINT3", "JOINT4", "JOINT5", "JOINT6"]);
    assert!(joints.iter().all(|j| j["driven"] == true && j["unit"] == "rad"), "{joints:?}");
    assert!(joints.iter().all(|j| j["lower"].as_f64().unwrap() < j["upper"].as_f64().unwrap()), "{joints:?}");
}

#[test]
fn a_slider_moves_its_joint_and_no_other() {
    let running = Running::start(2);
    let mut visitor = Visitor::enter(&running);
    visitor.ask(json!({"do": "environment", "env": 1}));
    visitor.wait_state("environment 1", |state| state["environment"] == 1);
    visitor.ask(json!({"do": "target", "robot": "arm", "joint": "JOINT1", "value": 0.8}));
    // Gains of 1e4 / 1e3 hold a joint with a vertical axis to less than a milliradian once it is there; 0.02 is a part of
    // the way of 0.8.
    running
        .wait_until("the joint comes to its target", |now| now.steps > 0 && (now.positions[(1, 0)] - 0.8).abs() < 0.02);
    // In the other environment, at its start; the arm's own weight bends other joints by their gains only.
    let now = running.now();
    assert!(now.positions[(0, 0)].abs() < 0.02, "{:?}", now.positions);
    assert!(now.positions.row(1).iter().skip(1).all(|q| q.abs() < 0.05), "{:?}", now.positions);
    // The page is told the same.
    let state = visitor.wait_state("the state says so", |state| {
        state["robots"][0]["positions"][0].as_f64().is_some_and(|q| (q - 0.8).abs() < 0.02)
    });
    let row = &state["robots"][0];
    assert!((row["targets"][0].as_f64().unwrap() - 0.8).abs() < 1e-12, "{row}");
    assert!(row["efforts"].as_array().unwrap().iter().all(Value::is_number), "{row}");
    // All environments at once.
    visitor.ask(json!({"do": "environment", "env": null}));
    visitor.ask(json!({"do": "target", "robot": "arm", "joint": "JOINT1", "value": -0.5}));
    running.wait_until("both joints come to their target", |now| {
        now.positions.column(0).iter().all(|q| (q + 0.5).abs() < 0.02)
    });
}

#[test]
fn the_efforts_are_those_that_hold_the_arm_up() {
    let running = Running::start(1);
    let mut visitor = Visitor::enter(&running);
    // Leaned forward, the second joint carries everything above it.
    visitor.ask(json!({"do": "target", "robot": "arm", "joint": "JOINT2", "value": 0.9}));
    visitor.wait_state("the arm leans", |state| {
        state["robots"][0]["positions"][1].as_f64().is_some_and(|q| (q - 0.9).abs() < 0.02)
    });
    // The drive's law at rest: effort = kp (target - position), kp = 1e4 N m/rad.
    let state = visitor.wait_state("it is at rest", |state| {
        let row = &state["robots"][0];
        let sag = row["targets"][1].as_f64().unwrap() - row["positions"][1].as_f64().unwrap();
        let effort = row["efforts"][1].as_f64().unwrap();
        effort.abs() > 5.0 && (effort - 1e4 * sag).abs() < 0.02 * effort.abs() && state["time"] != Value::Null
    });
    assert!(state["time"].as_f64().unwrap() > 0.0);
}

#[test]
fn pause_pauses_and_a_step_is_a_step() {
    let running = Running::start(1);
    let mut visitor = Visitor::enter(&running);
    running.wait_until("it steps", |now| now.steps > 20);
    visitor.ask(json!({"do": "pause"}));
    let state = visitor.wait_state("paused", |state| state["paused"] == true);
    let held = state["steps"].as_u64().unwrap();
    std::thread::sleep(Duration::from_millis(400));
    // The program sees the step that holds only when it goes on.
    let before = running.now().steps;
    assert!(before == held || before + 1 == held, "{before} and {held}");
    visitor.ask(json!({"do": "step"}));
    let state = visitor.wait_state("a step further", |state| state["steps"].as_u64() > Some(held));
    assert_eq!((state["steps"].as_u64(), &state["paused"]), (Some(held + 1), &json!(true)));
    std::thread::sleep(Duration::from_millis(200));
    assert!(running.now().steps <= before + 1);
    visitor.ask(json!({"do": "play"}));
    running.wait_until("it goes on", |now| now.steps > before + 20);
    visitor.wait_state("the state says so", |state| state["paused"] == false);
}

#[test]
fn a_reset_begins_anew() {
    let running = Running::start(1);
    let mut visitor = Visitor::enter(&running);
    visitor.wait_state("some time has passed", |state| state["time"].as_f64() > Some(0.3));
    visitor.ask(json!({"do": "pause"}));
    visitor.wait_state("paused", |state| state["paused"] == true);
    visitor.ask(json!({"do": "reset"}));
    let state = visitor.wait_state("reset", |state| state["time"].as_f64() < Some(0.1));
    assert_eq!(state["time"].as_f64(), Some(0.0), "{state}");
}

#[test]
fn slow_motion_is_slow() {
    let running = Running::start(1);
    let mut visitor = Visitor::enter(&running);
    // From before it is asked for: what is told of it may come late.
    let start = std::time::Instant::now();
    visitor.ask(json!({"do": "speed", "factor": 0.1}));
    let from = visitor.wait_state("slow motion", |state| state["speed"] == 0.1);
    let to = visitor.wait_state("0.2 s are simulated", |state| {
        state["time"].as_f64().unwrap() > from["time"].as_f64().unwrap() + 0.2
    });
    let passed = to["time"].as_f64().unwrap() - from["time"].as_f64().unwrap();
    // A tenth of the time that passed on the wall, or less where the machine is busy; steps come in blocks of 8 ms of it, or
    // one by one, which 0.1 s is more than.
    assert!(passed <= 0.1 * (start.elapsed().as_secs_f64() + 0.1), "{passed} s in {:?}", start.elapsed());
}

#[test]
fn what_cannot_be_done_is_said() {
    let running = Running::start(1);
    let mut visitor = Visitor::enter(&running);
    for (command, says) in [
        (json!({"do": "fly"}), "unknown variant `fly`"),
        (json!({"do": "target", "robot": "leg", "joint": "JOINT1", "value": 0.0}), "\"arm\""),
        (json!({"do": "target", "robot": "arm", "joint": "JOINT7", "value": 0.0}), "JOINT1"),
        (json!({"do": "environment", "env": 4}), "there is 1 environment"),
        (json!({"do": "camera", "name": "ear"}), "\"eye\""),
        (json!({"do": "overlay", "name": "ghosts", "on": true}), "contacts"),
        (json!({"do": "speed", "factor": -1.0}), "0.001"),
        (json!({"do": "size", "width": 1e9 as u64, "height": 3}), "pixels"),
    ] {
        visitor.ask(command.clone());
        let reason = visitor.wait("a refusal", |came| match came {
            Came::Refused(reason) => Some(reason),
            _ => None,
        });
        assert!(reason.contains(says), "{command}: {reason}");
    }
    let before = running.now().steps;
    running.wait_until("it steps all the same", |now| now.steps > before + 10);
}

#[test]
fn the_record_button_is_there_where_the_program_gives_one_and_writes_a_file() {
    // Without one there is none, and pressing it is refused.
    let running = Running::start(1);
    let mut visitor = Visitor::enter(&running);
    let state = visitor.wait_state("a state", |_| true);
    assert_eq!(state["recording"], Value::Null);
    visitor.ask(json!({"do": "record", "on": true}));
    visitor.wait_state("a refusal", |state| state["refused"].as_str().is_some_and(|why| why.contains("record button")));
    drop((visitor, running));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let files = Arc::new(Mutex::new(FileRecording::new(RecorderCfg::new(&path))));
    let recording = Some(RecordButton::shared(files));
    let running = Running::start_at(1, "127.0.0.1:0", ServeCfg { recording, ..ServeCfg::default() });
    let mut visitor = Visitor::enter(&running);
    visitor.wait_state("a button", |state| state["recording"] == json!({"on": false, "text": ""}));
    visitor.ask(json!({"do": "record", "on": true}));
    let text = |state: &Value| state["recording"]["text"].as_str().unwrap_or_default().to_owned();
    let state = visitor.wait_state("it records", |state| state["recording"]["on"] == true);
    assert!(text(&state).starts_with("run.npz: "), "{state}");
    // Another viewer sees it, and ends it.
    let mut other = Visitor::enter(&running);
    other.wait_state("rows", |state| state["recording"]["on"] == true && text(state).len() > "run.npz: 9 rows".len());
    assert!(!path.exists());
    other.ask(json!({"do": "record", "on": false}));
    let state = visitor.wait_state("it has ended", |state| state["recording"]["on"] == false);
    assert!(text(&state).ends_with(" MB") && path.is_file(), "{state}");
}
