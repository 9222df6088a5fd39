//! Commands of viewers: targets, pause, speed, selection, the spring, and recordings.

use super::running::{Running, button, play_fall};
use super::visitor::{Came, Visitor};
use crate::support::red;
use kinetoscope::prelude::*;
use serde_json::{Value, json};
use std::time::Duration;

/// Weight of the cube \[N\]: 1 kg.
const WEIGHT: f64 = 9.81;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().map(|all| all.iter().map(|x| x.as_f64().unwrap()).collect()).unwrap_or_default()
}

#[test]
fn contents() {
    let running = Running::start(2);
    let contents = Visitor::enter(running.address).wait("contents", |came| match came {
        Came::Contents(contents) => Some(contents),
        _ => None,
    });
    assert_eq!((&contents["environments"], &contents["cameras"]), (&json!(2), &json!(["eye"])));
    let joints = contents["robots"][0]["joints"].as_array().unwrap();
    assert_eq!(contents["robots"][0]["name"], "arm");
    let names: Vec<&str> = joints.iter().map(|joint| joint["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["JOINT1", "JOINT2", "JOINT3", "JOINT4", "JOINT5", "JOINT6"]);
    assert!(joints.iter().all(|j| j["driven"] == true && j["unit"] == "rad"), "{joints:?}");
    assert!(joints.iter().all(|j| j["lower"].as_f64().unwrap() < j["upper"].as_f64().unwrap()), "{joints:?}");
}

/// A slider moves its joint in the chosen environments, and no other; the state says so.
#[test]
fn targets() {
    let running = Running::start(2);
    let mut visitor = Visitor::enter(running.address);
    visitor.ask(json!({"do": "environment", "env": 1}));
    visitor.wait_state("environment 1", |state| state["environment"] == 1);
    visitor.ask(json!({"do": "target", "robot": "arm", "joint": "JOINT1", "value": 0.8}));
    // Gains of 1e4 / 1e3 hold a joint with a vertical axis to less than a milliradian once it is there; 0.02 is a part of
    // the way of 0.8.
    running.wait_until("its target", |now| now.steps > 0 && (now.positions[(1, 0)] - 0.8).abs() < 0.02);
    // In the other environment, at its start; the arm's own weight bends other joints by their gains only.
    let now = running.now();
    assert!(now.positions[(0, 0)].abs() < 0.02, "{:?}", now.positions);
    assert!(now.positions.row(1).iter().skip(1).all(|q| q.abs() < 0.05), "{:?}", now.positions);
    let near = |state: &Value, joint: usize, target: f64| {
        state["robots"][0]["positions"][joint].as_f64().is_some_and(|q| (q - target).abs() < 0.02)
    };
    let state = visitor.wait_state("the state says so", |state| near(state, 0, 0.8));
    let row = &state["robots"][0];
    assert!((row["targets"][0].as_f64().unwrap() - 0.8).abs() < 1e-12, "{row}");
    assert!(row["efforts"].as_array().unwrap().iter().all(Value::is_number), "{row}");
    // All environments at once.
    visitor.ask(json!({"do": "environment", "env": null}));
    visitor.ask(json!({"do": "target", "robot": "arm", "joint": "JOINT1", "value": -0.5}));
    running.wait_until("both targets", |now| now.positions.column(0).iter().all(|q| (q + 0.5).abs() < 0.02));

    // Efforts hold the arm up: leaned forward, the second joint carries everything above it.
    visitor.ask(json!({"do": "environment", "env": 0}));
    visitor.ask(json!({"do": "target", "robot": "arm", "joint": "JOINT2", "value": 0.9}));
    visitor.wait_state("the arm leans", |state| near(state, 1, 0.9));
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
fn pause_step_and_reset() {
    let running = Running::start(1);
    let mut visitor = Visitor::enter(running.address);
    running.wait_until("it steps", |now| now.steps > 20);
    let held = visitor.pause()["steps"].as_u64().unwrap();
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

    visitor.wait_state("some time has passed", |state| state["time"].as_f64() > Some(0.3));
    visitor.pause();
    visitor.ask(json!({"do": "reset"}));
    let state = visitor.wait_state("reset", |state| state["time"].as_f64() < Some(0.1));
    assert_eq!(state["time"].as_f64(), Some(0.0), "{state}");
}

#[test]
fn refusals() {
    let running = Running::start(1);
    let mut visitor = Visitor::enter(running.address);
    visitor.wait_image("stage", |_, _| true);
    visitor.assert_refused([
        (json!({"do": "fly"}), "unknown variant `fly`"),
        (json!({"do": "target", "robot": "leg", "joint": "JOINT1", "value": 0.0}), "\"arm\""),
        (json!({"do": "target", "robot": "arm", "joint": "JOINT7", "value": 0.0}), "JOINT1"),
        (json!({"do": "environment", "env": 4}), "there is 1 environment"),
        (json!({"do": "camera", "name": "ear"}), "\"eye\""),
        (json!({"do": "overlay", "name": "ghosts", "on": true}), "contacts"),
        (json!({"do": "speed", "factor": -1.0}), "0.001"),
        (json!({"do": "size", "width": 1e9 as u64, "height": 3}), "pixels"),
        (json!({"do": "grab", "x": 0.01, "y": 0.99}), "nothing here"),
        (json!({"do": "grab", "x": 2.0, "y": 0.5}), "0 to 1"),
        (json!({"do": "select", "x": 0.5}), "missing field `y`"),
    ]);
    running.wait_for_steps(10);
}

/// A visitor who sees environment `env`, whose cube is at rest, and the place of the cube in the image, in parts of it.
fn at_rest(running: &Running, env: usize) -> (Visitor, [f64; 2]) {
    let mut visitor = Visitor::enter(running.address);
    visitor.ask(json!({"do": "size", "width": 640, "height": 360}));
    visitor.ask(json!({"do": "environment", "env": env}));
    // It starts where it stands, and sinks in by the softness of the contact.
    let rests = |state: &Value| state["environment"] == env && state["time"].as_f64() > Some(1.5);
    visitor.wait_state("the cube is at rest", rests);
    let image = visitor.wait_image("stage", |_, image| image.dimensions() == (640, 360) && red(image).0 > 50);
    let (_, [x, y]) = red(&image);
    (visitor, [x / 640.0, y / 360.0])
}

fn height(state: &Value) -> Option<f64> {
    numbers(&state["selected"]["position"]).get(2).copied()
}

/// A click on a resting body selects it: its pose, and the force that carries it.
#[test]
fn selection() {
    let running = Running::start(2);
    let (mut visitor, [x, y]) = at_rest(&running, 1);
    let mut select = |y: f64, what: &str, holds: &dyn Fn(&Value) -> bool| {
        visitor.ask(json!({"do": "select", "x": x, "y": y}));
        visitor.wait_state(what, |state| holds(&state["selected"]))
    };
    let state = select(y, "forces of the selection", &|selected| selected["force"].is_array());
    let selected = &state["selected"];
    assert_eq!((&selected["name"], &selected["environment"]), (&json!("cube"), &json!(1)));
    // It was put at (0.7, 0, 0.2) and stands; contacts give way by less than a millimetre.
    let position = numbers(&selected["position"]);
    assert!((0..3).all(|k| (position[k] - [0.7, 0.0, 0.2][k]).abs() < 1e-3), "{position:?}");
    assert!((numbers(&selected["quaternion"])[0] - 1.0).abs() < 1e-6, "{selected}");
    // At rest the contacts carry the weight and nothing else; what is left of the settling decays with the contacts' time
    // constant of 0.02 s, from which 1.5 s are far away.
    let force = numbers(&selected["force"]);
    assert!((force[2] - WEIGHT).abs() < 1e-3 * WEIGHT, "{force:?}");
    assert!(force[0].hypot(force[1]) < 1e-3 * WEIGHT, "{force:?}");
    assert!(selected["contacts"].as_u64() >= Some(3), "{selected}");
    let says = selected["says"].as_array().unwrap();
    assert!(says.iter().any(|line| line.as_str().unwrap().contains("+9.81 N")), "{says:?}");
    // The control: above it in the image there is the arm, the ground or the sky.
    select(0.02, "something else", &|selected| selected["name"] != "cube");
    select(y, "the cube", &|selected| selected["name"] == "cube");
    visitor.ask(json!({"do": "unselect"}));
    visitor.wait_state("nothing", |state| state["selected"].is_null());
}

/// A body hangs on the spring, and falls when it is let go or when the viewer leaves.
#[test]
fn spring() {
    let running = Running::start(1);
    let (mut visitor, [x, y]) = at_rest(&running, 0);
    assert_eq!(visitor.wait_state("a state", |_| true)["selected"], Value::Null);
    visitor.ask(json!({"do": "grab", "x": x, "y": y}));
    visitor.wait_state("held, it is selected", |state| state["selected"]["name"] == "cube");
    visitor.ask(json!({"do": "pull", "x": x, "y": y - 0.35}));
    // In the air nothing touches it.
    let state = visitor.wait_state("it is in the air", |state| {
        height(state) > Some(0.3) && state["selected"]["contacts"] == 0 && state["selected"]["force"].is_array()
    });
    assert_eq!(numbers(&state["selected"]["force"]), [0.0; 3]);
    visitor.ask(json!({"do": "release"}));
    let state = visitor.wait_state("it has fallen and is at rest", |state| {
        let force = numbers(&state["selected"]["force"]);
        force.len() == 3 && (force[2] - WEIGHT).abs() < 1e-2 * WEIGHT && height(state) < Some(0.3)
    });
    // On a face, it is as high as before; on an edge no force would stay.
    assert!(height(&state).unwrap() > 0.19, "{state}");

    let (mut other, [x, y]) = at_rest(&running, 0);
    other.ask(json!({"do": "grab", "x": x, "y": y}));
    other.ask(json!({"do": "pull", "x": x, "y": y - 0.35}));
    visitor.wait_state("another viewer pulls it up", |state| height(state) > Some(0.3));
    drop(other);
    visitor.wait_state("it falls", |state| height(state).is_some_and(|z| z < 0.25));
}

#[test]
fn record_button() {
    // Without a button, pressing it is refused.
    let running = Running::start(1);
    let mut visitor = Visitor::enter(running.address);
    assert_eq!(visitor.wait_state("a state", |_| true)["recording"], Value::Null);
    visitor.ask(json!({"do": "record", "on": true}));
    visitor.wait_state("a refusal", |state| state["refused"].as_str().is_some_and(|why| why.contains("record button")));
    drop((visitor, running));
    let (_folder, path, recording) = button();
    let running = Running::start_at(1, "127.0.0.1:0", ServeCfg { recording, ..ServeCfg::default() });
    let mut visitor = Visitor::enter(running.address);
    visitor.wait_state("a button", |state| state["recording"] == json!({"on": false, "text": ""}));
    visitor.ask(json!({"do": "record", "on": true}));
    let text = |state: &Value| state["recording"]["text"].as_str().unwrap_or_default().to_owned();
    let state = visitor.wait_state("it records", |state| state["recording"]["on"] == true);
    assert!(text(&state).starts_with("run.npz: "), "{state}");
    // Another viewer sees it, and ends it.
    let mut other = Visitor::enter(running.address);
    other.wait_state("rows", |state| state["recording"]["on"] == true && text(state).len() > "run.npz: 9 rows".len());
    assert!(!path.exists());
    other.ask(json!({"do": "record", "on": false}));
    let state = visitor.wait_state("it has ended", |state| state["recording"]["on"] == false);
    assert!(text(&state).ends_with(" MB") && path.is_file(), "{state}");
}

/// The time line of a recording: a seek shows the scene of that time.
#[test]
fn seek() {
    // From 3 m, in half a second, it falls 1.2 m.
    play_fall(3.0, |address, _| {
        let mut visitor = Visitor::enter(address);
        visitor.ask(json!({"do": "size", "width": 320, "height": 240}));
        visitor.ask(json!({"do": "pause"}));
        let mut row = |time: f64| {
            visitor.ask(json!({"do": "seek", "time": time}));
            let near = |now: &Value| now.as_f64().is_some_and(|now| (now - time).abs() < 1e-6);
            let state = visitor.wait_state("its time", |state| near(&state["timeline"]["now"]));
            assert!(state["paused"] == true && near(&state["time"]), "{state}");
            assert_eq!([&state["timeline"]["start"], &state["timeline"]["end"]], [&json!(0.0), &json!(0.5)]);
            // The first image may be an old one; two equal ones are not. A turn by nothing makes the server draw again.
            let mut last = f64::NAN;
            loop {
                visitor.ask(json!({"do": "orbit", "dx": 0.0, "dy": 0.0}));
                let (_, [_, now]) = red(&visitor.wait_image("stage", |_, _| true));
                if (now - last).abs() < 0.1 {
                    return now;
                }
                last = now;
            }
        };
        let (begun, ended, again) = (row(0.0), row(0.5), row(0.0));
        assert!(ended > begun + 10.0 && (begun - again).abs() < 1.0, "{begun} {ended} {again}");
        visitor.ask(json!({"do": "play"}));
        visitor.wait_state("the end", |state| state["timeline"]["now"] == 0.5 && state["paused"] == true);
    });
}
