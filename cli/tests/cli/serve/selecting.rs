//! What is clicked on, the forces on it, and the spring.

use crate::serve::running::Running;
use crate::serve::visitor::{Came, Visitor};
use image::RgbImage;
use serde_json::{Value, json};

/// Weight of the cube \[N\]: 1 kg.
const WEIGHT: f64 = 9.81;

/// The middle of what is red, in parts of the picture's width and height: of the cube, nothing else is.
fn middle_of_the_cube(picture: &RgbImage) -> Option<[f64; 2]> {
    let red = |p: &image::Rgb<u8>| p[0] > 60 && f64::from(p[0]) > 2.5 * f64::from(p[1].max(p[2]));
    let (mut sum, mut count) = ([0.0; 2], 0.0);
    for (x, y, _) in picture.enumerate_pixels().filter(|(.., p)| red(p)) {
        sum = [sum[0] + f64::from(x) + 0.5, sum[1] + f64::from(y) + 0.5];
        count += 1.0;
    }
    (count > 50.0).then(|| [sum[0] / count / f64::from(picture.width()), sum[1] / count / f64::from(picture.height())])
}

/// A visitor who sees environment `env` of `num_envs`, whose cube is at rest, and where in the picture the cube is.
fn at_rest(running: &Running, env: usize) -> (Visitor, [f64; 2]) {
    let mut visitor = Visitor::enter(running);
    visitor.ask(json!({"do": "size", "width": 640, "height": 360}));
    visitor.ask(json!({"do": "environment", "env": env}));
    // It starts where it stands, and sinks in by the softness of the contact.
    visitor
        .wait_state("the cube is at rest", |state| state["environment"] == env && state["time"].as_f64() > Some(1.5));
    let mut found = None;
    visitor.wait_picture("stage", |_, picture| {
        found = middle_of_the_cube(picture).filter(|_| picture.dimensions() == (640, 360));
        found.is_some()
    });
    (visitor, found.unwrap())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().map(|all| all.iter().map(|x| x.as_f64().unwrap()).collect()).unwrap_or_default()
}

fn select(visitor: &mut Visitor, [x, y]: [f64; 2]) {
    visitor.ask(json!({"do": "select", "x": x, "y": y}));
}

#[test]
fn a_click_on_a_resting_body_tells_its_pose_and_the_force_that_carries_it() {
    let running = Running::start(2);
    let (mut visitor, at) = at_rest(&running, 1);
    let state = visitor.wait_state("a state", |_| true);
    assert_eq!(state["selected"], Value::Null);
    select(&mut visitor, at);
    let state = visitor.wait_state("forces of what is selected", |state| state["selected"]["force"].is_array());
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
    // The control: upright in the picture above it there is the arm, the ground or the sky, not the cube.
    select(&mut visitor, [at[0], 0.02]);
    visitor.wait_state("something else", |state| state["selected"]["name"] != "cube");
    select(&mut visitor, at);
    visitor.wait_state("the cube", |state| state["selected"]["name"] == "cube");
    visitor.ask(json!({"do": "unselect"}));
    visitor.wait_state("nothing", |state| state["selected"].is_null());
}

#[test]
fn a_body_that_is_pulled_up_hangs_on_the_spring_and_falls_when_it_is_let_go() {
    let running = Running::start(1);
    let (mut visitor, [x, y]) = at_rest(&running, 0);
    visitor.ask(json!({"do": "grab", "x": x, "y": y}));
    visitor.wait_state("held, it is selected", |state| state["selected"]["name"] == "cube");
    let height = |state: &Value| numbers(&state["selected"]["position"]).get(2).copied();
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
}

#[test]
fn the_spring_of_a_viewer_who_leaves_lets_go() {
    let running = Running::start(1);
    let (mut watcher, at) = at_rest(&running, 0);
    select(&mut watcher, at);
    let (mut visitor, [x, y]) = at_rest(&running, 0);
    visitor.ask(json!({"do": "grab", "x": x, "y": y}));
    visitor.ask(json!({"do": "pull", "x": x, "y": y - 0.35}));
    let height = |state: &Value| numbers(&state["selected"]["position"]).get(2).copied();
    watcher.wait_state("another one pulls it up", |state| height(state) > Some(0.3));
    drop(visitor);
    watcher.wait_state("it falls", |state| height(state).is_some_and(|z| z < 0.25));
}

#[test]
fn what_cannot_be_pulled_is_said() {
    let running = Running::start(1);
    let (mut visitor, _) = at_rest(&running, 0);
    for (command, says) in [
        (json!({"do": "grab", "x": 0.01, "y": 0.99}), "nothing here"),
        (json!({"do": "grab", "x": 2.0, "y": 0.5}), "0 to 1"),
        (json!({"do": "select", "x": 0.5}), "missing field `y`"),
    ] {
        visitor.ask(command.clone());
        let reason = visitor.wait("a refusal", |came| match came {
            Came::Refused(reason) => Some(reason),
            _ => None,
        });
        assert!(reason.contains(says), "{command}: {reason}");
    }
}
