//! The window without a display: what keys and the mouse do, and that everything is drawn.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::keys::{Action, TABLE};
use super::*;
use crate::control::{Recording, RecordingState};
use crate::sample::{HALF, Sample, sample};
use crate::stage::{Eye, Shown};
use sim::EnvId;

const SIZE: [usize; 2] = [640, 360];

/// A window's state that shows a sample.
fn app(num_envs: usize) -> (Sample, Viewer, App) {
    let mut sample = sample(num_envs);
    sample.sim.update(50);
    let viewer = sample.sim.viewer(Wants::default());
    let mut app = App::new(SIZE, 1);
    app.show(viewer.newest().unwrap());
    (sample, viewer, app)
}

fn drawn(app: &mut App) -> Canvas {
    let mut canvas = Canvas::default();
    app.draw(&mut canvas, Instant::now());
    canvas
}

fn press(app: &mut App, key: Key) -> Vec<Command> {
    app.handle(Input::Press(key));
    app.handle(Input::Release(key));
    app.take_commands()
}

#[test]
fn every_key_does_something() {
    for binding in TABLE {
        let (_sample, _viewer, mut app) = app(3);
        // Something is selected, that may be followed or let go; and speed is one that can be halved.
        app.look_from(Eye::looking([0.3, 0.2, 1.5], [0.0, 0.0, 2.0 * HALF]).unwrap());
        app.handle(Input::Press(Key::Char('p')));
        let before = format!("{app:?}");
        app.handle(Input::Press(binding.key));
        let commands = app.take_commands();
        let changed = format!("{app:?}") != before || !commands.is_empty();
        let may_rest = matches!(binding.action, Action::Follow | Action::FreeView | Action::AllEnvs | Action::Unselect);
        assert!(changed || may_rest, "{binding:?}");
        assert!(!drawn(&mut app).bytes().is_empty());
    }
}

#[test]
fn keys_become_commands() {
    let (_sample, _viewer, mut app) = app(3);
    assert_eq!(press(&mut app, Key::Char(' ')), [Command::TogglePause]);
    assert_eq!(press(&mut app, Key::Char('.')), [Command::Step(1)]);
    assert_eq!(press(&mut app, Key::Char('1')), [Command::SetSpeed(Speed::REAL)]);
    assert_eq!(press(&mut app, Key::Backspace), [Command::Reset(None)]);
    assert!(press(&mut app, Key::PageDown).is_empty());
    assert_eq!(press(&mut app, Key::Backspace), [Command::Reset(Some(EnvId(1)))], "the one that is shown");
    press(&mut app, Key::PageUp);
    press(&mut app, Key::PageUp);
    assert_eq!(press(&mut app, Key::Backspace), [Command::Reset(Some(EnvId(2)))], "before the first comes the last");
    press(&mut app, Key::Char('g'));
    assert_eq!(press(&mut app, Key::Backspace), [Command::Reset(None)]);
    press(&mut app, Key::Char('c'));
    assert_eq!(app.wants().contacts, Some(Shown::All));
}

/// From above the cube: the middle of the picture is on its upper face.
fn over_the_cube(app: &mut App, sample: &Sample, env: usize) {
    let origin = sample.sim.env_origins();
    let at = |p: [f64; 3]| [0, 1, 2].map(|k| origin[(env, k)] + p[k]);
    app.look_from(Eye::looking(at([0.02, 0.01, 1.5]), at([0.0, 0.0, 2.0 * HALF])).unwrap());
}

#[test]
fn a_click_selects_and_a_drag_with_control_pulls() {
    let (sample, _viewer, mut app) = app(4);
    over_the_cube(&mut app, &sample, 3);
    let middle = [SIZE[0] as f64 / 2.0, SIZE[1] as f64 / 2.0];
    app.handle(Input::ButtonPress(1, middle, Modifiers::default()));
    app.handle(Input::ButtonRelease(1, [middle[0] + 1.0, middle[1]]));
    let picked = app.picked().unwrap().clone();
    assert!(picked.name == "cube" && picked.env == 3, "{picked:?}");
    assert_eq!(app.wants().contacts, Some(Shown::One(3)), "to say which forces act on it");
    let ctrl = Modifiers { ctrl: true, shift: false };
    app.handle(Input::ButtonPress(1, middle, ctrl));
    app.handle(Input::Move([middle[0] + 90.0, middle[1]]));
    let [Command::Drag { env, body, target, .. }] = app.take_commands()[..] else { panic!("one drag") };
    assert_eq!((env, Some(body)), (EnvId(3), picked.body));
    // In the plane of the picture, at the depth of the face: 1.3 m away from the eye a pixel is 1.3 m / f, with
    // f = 180 / tan(22.5°) pixels.
    let moved = (0..3).map(|k| (target[k] - picked.point[k]).powi(2)).sum::<f64>().sqrt();
    // It was selected where the button was let go: in the middle of the pixel one to the right.
    let expected = 88.5 * 1.3 / (180.0 / 22.5f64.to_radians().tan());
    assert!((moved - expected).abs() < 0.01 * expected, "{moved} {expected}");
    app.handle(Input::ButtonRelease(1, middle));
    assert!(app.take_commands().contains(&Command::Release));
    press(&mut app, Key::Escape);
    assert!(app.picked().is_none());
}

#[test]
fn a_slider_sends_the_target_where_the_mouse_is() {
    let (sample, _viewer, mut app) = app(1);
    press(&mut app, Key::Tab);
    // The panel is 210 pixels wide; its one slider goes from 8 pixels beside its edge to 8 before the end, from -2 to 2 rad.
    let [left, right] = [SIZE[0] as f64 - 202.0, SIZE[0] as f64 - 8.0];
    let mut target = |x: f64, first: bool| {
        if first {
            app.handle(Input::ButtonPress(1, [x, 35.0], Modifiers::default()));
        } else {
            app.handle(Input::Move([x, 300.0]));
        }
        match app.take_commands()[..] {
            [Command::SetTarget { robot, env, value, .. }] => {
                assert_eq!((robot, env), (sample.robot, Some(EnvId(0))));
                value
            }
            ref other => panic!("{other:?}"),
        }
    };
    assert!((target(0.5 * (left + right), true)).abs() < 1e-9);
    assert!((target(right, false) - 2.0).abs() < 1e-9, "held, it may leave its row");
    assert!((target(0.0, false) + 2.0).abs() < 1e-9, "and its panel");
    assert!((target(left + 0.75 * (right - left), false) - 1.0).abs() < 1e-9);
}

/// What is looked through a camera sensor is what it sees: the same pixel has the same link.
#[test]
fn looking_through_a_sensor_shows_what_it_sees() {
    let (sample, _viewer, mut app) = app(2);
    press(&mut app, Key::PageDown);
    press(&mut app, Key::Char('v'));
    let mask = sample.sim.sensor(sample.camera).unwrap().mask().unwrap();
    let cube = sample.sim.mask_ids().iter().find(|id| id.object == "cube").unwrap().id;
    // The sensor's 64 x 48 pixels are 7.5 pixels of the window each, in the middle of it.
    let mut tried = 0;
    for (v, u) in (2usize..46).step_by(4).flat_map(|v| (2usize..62).step_by(4).map(move |u| (v, u))) {
        let around = |dv: isize, du: isize| mask[(1, v.wrapping_add_signed(dv), u.wrapping_add_signed(du))];
        let inside = (-1..=1).all(|dv| (-1..=1).all(|du| around(dv, du) == around(0, 0)));
        if !inside || mask[(1, v, u)] <= 0 {
            continue;
        }
        let at = [320.0 + 7.5 * (u as f64 + 0.5 - 32.0), 180.0 + 7.5 * (v as f64 + 0.5 - 24.0)];
        app.handle(Input::ButtonPress(1, at, Modifiers::default()));
        app.handle(Input::ButtonRelease(1, at));
        assert_eq!(app.picked().map(|picked| picked.mask_id), Some(mask[(1, v, u)]), "pixel {u} {v}");
        tried += usize::from(mask[(1, v, u)] == cube);
    }
    assert!(tried > 3, "the cube was looked at {tried} times");
}

#[test]
fn everything_is_drawn_at_every_size() {
    let (_sample, _viewer, mut app) = app(2);
    for key in ['c', 'f', 'j', 'm', 't', 'l', 'k', 'i', 'h'] {
        press(&mut app, Key::Char(key));
    }
    press(&mut app, Key::Tab);
    for size in [[1, 1], [1, 700], [3000, 2], [250, 40], [960, 540]] {
        app.handle(Input::Resize(size));
        assert_eq!(drawn(&mut app).dimensions(), size);
    }
    // The help is one of the things that are drawn.
    let with = drawn(&mut app);
    press(&mut app, Key::F1);
    let without = drawn(&mut app);
    let unlike = with.bytes().chunks(4).zip(without.bytes().chunks(4)).filter(|(a, b)| a != b).count();
    assert!(unlike > 50_000, "a help of 640 pixels in a row: {unlike}");
}

#[test]
fn what_is_followed_stays_in_the_picture() {
    let (mut sample, viewer, mut app) = app(1);
    over_the_cube(&mut app, &sample, 0);
    let middle = [SIZE[0] as f64 / 2.0, SIZE[1] as f64 / 2.0];
    app.handle(Input::ButtonPress(1, middle, Modifiers::default()));
    app.handle(Input::ButtonRelease(1, middle));
    press(&mut app, Key::Char('x'));
    let cube = sample.sim.rigid_object_id("cube").unwrap();
    let pose = ndarray::arr2(&[[0.0, -0.8, HALF, 1.0, 0.0, 0.0, 0.0]]);
    sample.sim.rigid_object_mut(cube).write_pose(&pose, None).unwrap();
    drop(viewer);
    let viewer = sample.sim.viewer(Wants::default());
    app.show(viewer.newest().unwrap());
    app.handle(Input::ButtonPress(1, middle, Modifiers::default()));
    app.handle(Input::ButtonRelease(1, middle));
    assert!(app.picked().is_some_and(|picked| picked.name == "cube"), "{:?}", app.picked());
}

#[test]
fn held_keys_fly_and_are_let_go() {
    let (_sample, _viewer, mut app) = app(1);
    let before = app.eye();
    app.handle(Input::Press(Key::Char('w')));
    assert!(app.moves(Instant::now()));
    std::thread::sleep(Duration::from_millis(30));
    drawn(&mut app);
    let after = app.eye();
    // Ahead by the distance a second, for 30 ms to 100 ms.
    let way: f64 = (0..3).map(|k| (after.target[k] - before.target[k]) * before.forward()[k]).sum();
    assert!(way >= 0.029 * before.distance && way <= 0.101 * before.distance, "{way}");
    app.handle(Input::FocusLost);
    assert!(!app.moves(Instant::now()));
}

/// A recording that is what it is set to.
#[derive(Debug, Default)]
struct Switch(bool);

impl Recording for Switch {
    fn set(&mut self, _: &mut SimulationManager, on: bool) -> Result<(), String> {
        self.0 = on;
        Ok(())
    }

    fn state(&self, _: &SimulationManager) -> RecordingState {
        RecordingState { on: self.0, text: "run.mcap: 12 rows".into() }
    }
}

#[test]
fn the_record_button_is_a_key_and_a_place_in_the_picture() {
    let (mut sample, viewer, mut app) = app(1);
    let on_button = [SIZE[0] as f64 - 96.0, 11.0];
    let click = |app: &mut App, at| {
        app.handle(Input::ButtonPress(1, at, Modifiers::default()));
        app.handle(Input::ButtonRelease(1, at));
        app.take_commands()
    };
    let red = |app: &mut App| {
        let canvas = drawn(app);
        // The whole mark, of 9 by 9 pixels.
        (0..9).all(|k| canvas.pixel(SIZE[0] - 96 + k, 11 + k) == Some([235, 60, 50]))
    };
    // Without a button there is none, and the key says so by what the simulation answers.
    assert!(click(&mut app, on_button).is_empty() && !red(&mut app));
    assert_eq!(press(&mut app, Key::Char('r')), [Command::Record(true)]);
    let bare = drawn(&mut app);
    for on in [false, true] {
        sample.sim.record_button(RecordButton::new(Switch(on)));
        app.show(viewer.newest().unwrap());
        assert_eq!(press(&mut app, Key::Char('r')), [Command::Record(!on)]);
        assert_eq!(click(&mut app, on_button), [Command::Record(!on)]);
        assert!(click(&mut app, [on_button[0], 40.0]).is_empty(), "below it");
        assert_eq!(red(&mut app), on);
    }
    // What it says is beside it: the first 60 rows on the right have other pixels below the button.
    let with = drawn(&mut app);
    let unlike = (30..42).flat_map(|y| (SIZE[0] - 110..SIZE[0] - 8).map(move |x| (x, y)));
    assert!(unlike.filter(|&(x, y)| bare.pixel(x, y) != with.pixel(x, y)).count() > 200);
    // Beside the sliders, where they are open.
    press(&mut app, Key::Tab);
    assert!(!matches!(click(&mut app, on_button)[..], [Command::Record(_)]));
    assert_eq!(click(&mut app, [on_button[0] - 210.0, 11.0]), [Command::Record(false)]);
}
