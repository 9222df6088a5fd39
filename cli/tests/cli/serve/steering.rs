//! Commands of viewers: targets, pause, speed, selection, mouse spring, and recordings.

use super::running::ServedSimulation;
use super::test_client::{ServerMessage, TestClient};
use crate::support::red;
use serde_json::{Value, json};

/// Weight of the cube \[N\]: 1 kg.
const WEIGHT: f64 = 9.81;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().map(|all| all.iter().map(|x| x.as_f64().unwrap()).collect()).unwrap_or_default()
}

#[test]
fn contents() {
    let running = ServedSimulation::start(2);
    let contents = TestClient::connect(running.address).wait("contents", |came| match came {
        ServerMessage::Contents(contents) => Some(contents),
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

/// A slider moves its joint in the chosen environments and no other, and the state reports the target.
#[test]
fn targets() {
    let running = ServedSimulation::start(2);
    let mut visitor = TestClient::connect(running.address);
    visitor.send(json!({"do": "environment", "env": 1}));
    visitor.wait_state("environment 1", |state| state["environment"] == 1);
    visitor.send(json!({"do": "target", "robot": "arm", "joint": "JOINT1", "value": 0.8}));
    // Gains of 1e4 / 1e3 hold a joint with a vertical axis to less than a milliradian at its target; 0.02 is a fraction
    // of the distance of 0.8.
    running.wait_until("its target", |now| now.steps > 0 && (now.positions[(1, 0)] - 0.8).abs() < 0.02);
    // In the other environment, the joint stays at its start; other joints sag under the arm's weight according to
    // their gains.
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
    visitor.send(json!({"do": "environment", "env": null}));
    visitor.send(json!({"do": "target", "robot": "arm", "joint": "JOINT1", "value": -0.5}));
    running.wait_until("both targets", |now| now.positions.column(0).iter().all(|q| (q + 0.5).abs() < 0.02));

    // Efforts hold the arm up: leaning forward, the second joint carries everything above it.
    visitor.send(json!({"do": "environment", "env": 0}));
    visitor.send(json!({"do": "target", "robot": "arm", "joint": "JOINT2", "value": 0.9}));
    visitor.wait_state("the arm leans", |state| near(state, 1, 0.9));
    // Drive law at rest: effort = kp (target - position), kp = 1e4 N m/rad.
    let state = visitor.wait_state("it is at rest", |state| {
        let row = &state["robots"][0];
        let sag = row["targets"][1].as_f64().unwrap() - row["positions"][1].as_f64().unwrap();
        let effort = row["efforts"][1].as_f64().unwrap();
        effort.abs() > 5.0 && (effort - 1e4 * sag).abs() < 0.02 * effort.abs() && state["time"] != Value::Null
    });
    assert!(state["time"].as_f64().unwrap() > 0.0);
}

#[test]
fn refusals() {
    let running = ServedSimulation::start(1);
    let mut visitor = TestClient::connect(running.address);
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
        (json!({"do": "grab", "x": 0.01, "y": 0.99}), "no body to pull at this point"),
        (json!({"do": "grab", "x": 2.0, "y": 0.5}), "0 to 1"),
        (json!({"do": "select", "x": 0.5}), "missing field `y`"),
    ]);
    // A refusal by the simulation is part of its state.
    visitor.send(json!({"do": "record", "on": true}));
    visitor.wait_state("a refusal", |state| state["refused"].as_str().is_some_and(|why| why.contains("record button")));
    running.wait_for_steps(10);
}

/// Connects a viewer to environment `env`, whose cube is at rest. Returns the cube's center in fractions of the image.
fn at_rest(running: &ServedSimulation, env: usize) -> (TestClient, [f64; 2]) {
    let mut visitor = TestClient::connect(running.address);
    visitor.send(json!({"do": "size", "width": 640, "height": 360}));
    visitor.send(json!({"do": "environment", "env": env}));
    // The cube starts on the ground and sinks in by the compliance of the contact.
    let rests = |state: &Value| state["environment"] == env && state["time"].as_f64() > Some(1.5);
    visitor.wait_state("the cube is at rest", rests);
    let image = visitor.wait_image("stage", |_, image| image.dimensions() == (640, 360) && red(image).0 > 50);
    let (_, [x, y]) = red(&image);
    (visitor, [x / 640.0, y / 360.0])
}

/// A click on a resting body selects it: its pose, and the force that carries it.
#[test]
fn selection() {
    let running = ServedSimulation::start(2);
    let (mut visitor, [x, y]) = at_rest(&running, 1);
    let mut select = |y: f64, what: &str, holds: &dyn Fn(&Value) -> bool| {
        visitor.send(json!({"do": "select", "x": x, "y": y}));
        visitor.wait_state(what, |state| holds(&state["selected"]))
    };
    let state = select(y, "forces of the selection", &|selected| selected["force"].is_array());
    let selected = &state["selected"];
    assert_eq!((&selected["name"], &selected["environment"]), (&json!("cube"), &json!(1)));
    // It was placed at (0.7, 0, 0.2) and rests there; contacts yield by less than a millimeter.
    let position = numbers(&selected["position"]);
    assert!((0..3).all(|k| (position[k] - [0.7, 0.0, 0.2][k]).abs() < 1e-3), "{position:?}");
    assert!((numbers(&selected["quaternion"])[0] - 1.0).abs() < 1e-6, "{selected}");
    // At rest, the contacts carry exactly the weight. Settling decays with the contacts' time constant of 0.02 s, much
    // less than 1.5 s.
    let force = numbers(&selected["force"]);
    assert!((force[2] - WEIGHT).abs() < 1e-3 * WEIGHT, "{force:?}");
    assert!(force[0].hypot(force[1]) < 1e-3 * WEIGHT, "{force:?}");
    assert!(selected["contacts"].as_u64() >= Some(3), "{selected}");
    let says = selected["says"].as_array().unwrap();
    assert!(says.iter().any(|line| line.as_str().unwrap().contains("+9.81 N")), "{says:?}");
    // Control: above it in the image is the arm, the ground or the sky.
    select(0.02, "something else", &|selected| selected["name"] != "cube");
    select(y, "the cube", &|selected| selected["name"] == "cube");
    visitor.send(json!({"do": "unselect"}));
    visitor.wait_state("nothing", |state| state["selected"].is_null());
}
