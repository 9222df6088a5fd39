//! The window without a display: what keys and the mouse do, and that everything is drawn.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::keys::{Action, TABLE};
use super::*;
use crate::control::{Recording, RecordingState};
use crate::sample::{HALF, Sample, sample};
use crate::stage::{Eye, Look, Overlays, Painter, Panel, Shown, Snapshot};
use nalgebra::Vector3;
use sensors::visibility::View;
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

/// The middle of the picture.
const MIDDLE: [f64; 2] = [SIZE[0] as f64 / 2.0, SIZE[1] as f64 / 2.0];

fn click(app: &mut App, at: [f64; 2]) {
    app.handle(Input::ButtonPress(1, at, Modifiers::default()));
    app.handle(Input::ButtonRelease(1, at));
}

fn press(app: &mut App, key: Key) -> Vec<Command> {
    app.handle(Input::Press(key));
    app.handle(Input::Release(key));
    app.take_commands()
}

/// Where each key would change something: a cube is selected, and one environment is seen through its camera.
fn busy_app() -> (Sample, Viewer, App) {
    let (sample, viewer, mut app) = app(3);
    over_the_cube(&mut app, &sample, 0);
    click(&mut app, MIDDLE);
    assert!(app.picked().is_some_and(|picked| picked.name == "cube"), "{:?}", app.picked());
    press(&mut app, Key::PageDown);
    press(&mut app, Key::Char('v'));
    (sample, viewer, app)
}

#[test]
fn every_key_does_something() {
    for binding in TABLE {
        let (_sample, _viewer, mut app) = busy_app();
        let before = format!("{app:?}");
        app.handle(Input::Press(binding.key));
        let commands = app.take_commands();
        assert!(format!("{app:?}") != before || !commands.is_empty(), "{binding:?}");
        assert!(!drawn(&mut app).bytes().is_empty());
    }
}

/// Each key of an overlay turns that one, and no other, and back again.
#[test]
fn keys_of_overlays_turn_what_they_say() {
    let begin = Overlays::default();
    let keys = [
        ('o', Overlays { sensors: !begin.sensors, ..begin }),
        ('c', Overlays { contacts: !begin.contacts, ..begin }),
        ('f', Overlays { frames: !begin.frames, ..begin }),
        ('j', Overlays { joints: !begin.joints, ..begin }),
        ('m', Overlays { masses: !begin.masses, ..begin }),
        ('t', Overlays { names: !begin.names, ..begin }),
        ('l', Overlays { trails: !begin.trails, ..begin }),
        ('k', Overlays { collisions: !begin.collisions, ..begin }),
        ('u', Overlays { visuals: !begin.visuals, ..begin }),
    ];
    for (key, expected) in keys {
        let (_sample, _viewer, mut app) = app(1);
        press(&mut app, Key::Char(key));
        assert_eq!(app.overlays(), expected, "{key}");
        press(&mut app, Key::Char(key));
        assert_eq!(app.overlays(), begin, "{key}");
    }
}

/// The panel of keys I and page down: in its corner are the four pictures that a panel of that camera and that environment draws.
#[test]
fn the_panel_is_of_the_chosen_environment() {
    let (mut sample, viewer, mut app) = app(3);
    // What is seen in an environment is its own: the cube is elsewhere in each.
    let cube = sample.sim.rigid_object_id("cube").unwrap();
    let poses = ndarray::Array2::from_shape_fn((3, 7), |(env, k)| [0.0, 0.1 * env as f64, HALF, 1.0, 0.0, 0.0, 0.0][k]);
    sample.sim.rigid_object_mut(cube).write_pose(&poses, None).unwrap();
    drop(viewer);
    let viewer = sample.sim.viewer(Wants::default());
    let snapshot = viewer.newest().unwrap();
    app.show(Arc::clone(&snapshot));
    press(&mut app, Key::PageDown);
    press(&mut app, Key::Char('i'));
    let [mut expected, mut other] = [Canvas::default(), Canvas::default()];
    let mut panel = Panel::new(1);
    assert!(panel.draw(&snapshot, 0, 0, 160, &mut other) && panel.draw(&snapshot, 0, 1, 160, &mut expected));
    assert!(expected != other, "environments look alike");
    let canvas = drawn(&mut app);
    let ([width, height], [w, h]) = (canvas.dimensions(), expected.dimensions());
    let corner = |panel: &Canvas| {
        let at = |x: usize, y: usize| canvas.pixel(width - w - 6 + x, height - h - 6 + y);
        (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).all(|(x, y)| at(x, y) == panel.pixel(x, y))
    };
    assert!(corner(&expected) && !corner(&other));
    press(&mut app, Key::Char('i'));
    let canvas = drawn(&mut app);
    assert!(canvas.pixel(width - 10, height - 10) != expected.pixel(w - 4, h - 4), "it goes again");
}

/// Where nobody steps the simulation commands wait, and when thousands do no more are taken: the picture says so.
#[test]
fn what_nobody_hears_is_told() {
    let (_sample, viewer, mut app) = app(1);
    let mut sent = 0;
    while viewer.send(Command::TogglePause) {
        sent += 1;
        assert!(sent < 100_000, "it is taken for ever");
    }
    let plain = drawn(&mut app);
    app.was_heard(viewer.send(Command::TogglePause));
    let told = drawn(&mut app);
    // Below the lines of the status, where it says what was refused.
    let shining = |canvas: &Canvas| {
        let pixels = (8..400).flat_map(|x| (50..70).map(move |y| (x, y)));
        pixels.filter(|&(x, y)| canvas.pixel(x, y) == Some([255, 210, 60])).count()
    };
    assert!(shining(&told) > shining(&plain) + 300, "{} {}", shining(&told), shining(&plain));
    app.was_heard(true);
    assert_eq!(shining(&drawn(&mut app)), shining(&plain));
}

/// Whoever waits for a window hears of its end, even where its thread panics.
#[test]
fn a_window_that_crashes_is_closed() {
    let shared = Arc::new(Shared::default());
    let window = Window { shared: Arc::clone(&shared) };
    let crashing = std::thread::spawn(move || {
        let _ending = Ending(shared);
        panic!("as a mistake would");
    });
    assert_eq!(window.wait(Duration::from_secs(30)), Some(Closed::Crashed));
    assert!(!window.is_open() && crashing.join().is_err());
    assert!(Closed::Crashed.fault().is_some() && Closed::ByUser.fault().is_none());
}

/// A key that is held turns nothing to and fro: it pauses once, and begins one recording.
#[test]
fn held_keys_repeat_steps_and_nothing_else() {
    for binding in TABLE {
        let (_sample, _viewer, mut app) = busy_app();
        app.handle(Input::Press(binding.key));
        let first = app.take_commands();
        let before = format!("{app:?}");
        app.handle(Input::Repeat(binding.key));
        let again = app.take_commands();
        let goes_on = matches!(
            binding.action,
            Action::Steps(_) | Action::Slower | Action::Faster | Action::NextEnv | Action::PreviousEnv
        );
        assert_eq!(again, if goes_on { first } else { Vec::new() }, "{binding:?}");
        let turns_pages = matches!(binding.action, Action::NextEnv | Action::PreviousEnv);
        assert_eq!(format!("{app:?}") != before, turns_pages, "{binding:?}");
    }
}

#[test]
fn slower_and_faster_are_half_and_twice_as_fast() {
    let (_sample, viewer, mut app) = app(1);
    let mut run_at = |speed, measured_speed, key| {
        let mut snapshot = Snapshot::clone(&viewer.newest().unwrap());
        (snapshot.run.speed, snapshot.run.measured_speed) = (speed, measured_speed);
        app.show(Arc::new(snapshot));
        press(&mut app, Key::Char(key))
    };
    let times = Speed::Times;
    for (speed, key, expected) in [
        (Speed::REAL, '-', 0.5),
        (Speed::REAL, '=', 2.0),
        (Speed::REAL, '+', 2.0),
        (times(0.25), '-', 0.125),
        // The ends of the range.
        (times(1.5e-3), '-', 1e-3),
        (times(700.0), '+', 1e3),
    ] {
        assert_eq!(run_at(speed, Some(0.9), key), [Command::SetSpeed(times(expected))], "{speed:?} {key}");
    }
    // As fast as can be: half and twice of what that is.
    assert_eq!(run_at(Speed::Free, Some(8.0), '-'), [Command::SetSpeed(times(4.0))]);
    assert_eq!(run_at(Speed::Free, None, '='), [Command::SetSpeed(times(2.0))]);
}

/// A way to move an eye.
type Way = fn(&mut Eye, [f64; 2], usize);

/// What dragging and the wheel do to the eye; what that does to the picture is tested with the eye.
#[test]
fn drags_turn_move_and_look_around_and_the_wheel_comes_nearer() {
    let (_sample, _viewer, mut app) = app(1);
    let by = [40.0, -15.0];
    let shift = Modifiers { shift: true, ctrl: false };
    let ways: [(u8, Modifiers, Way); 4] = [
        (1, Modifiers::default(), Eye::orbit),
        (1, shift, Eye::pan),
        (2, Modifiers::default(), Eye::turn),
        (3, Modifiers::default(), Eye::pan),
    ];
    for (button, modifiers, way) in ways {
        let mut expected = app.eye();
        // In two parts, as a mouse moves.
        way(&mut expected, [by[0], 0.0], SIZE[1]);
        way(&mut expected, [0.0, by[1]], SIZE[1]);
        let before = app.eye();
        app.handle(Input::ButtonPress(button, [100.0, 100.0], modifiers));
        app.handle(Input::Move([100.0 + by[0], 100.0]));
        app.handle(Input::Move([100.0 + by[0], 100.0 + by[1]]));
        app.handle(Input::ButtonRelease(button, [100.0 + by[0], 100.0 + by[1]]));
        assert!(app.eye() == expected && expected != before, "button {button}: {:?}", app.eye());
        // Let go, it moves no more.
        app.handle(Input::Move([10.0, 10.0]));
        assert_eq!(app.eye(), expected);
    }
    let mut expected = app.eye();
    expected.zoom(2.0);
    app.handle(Input::Wheel(2.0, MIDDLE));
    assert_eq!(app.eye(), expected);
    // Through a camera nothing moves.
    press(&mut app, Key::Char('v'));
    app.handle(Input::ButtonPress(1, MIDDLE, Modifiers::default()));
    app.handle(Input::Move([10.0, 10.0]));
    app.handle(Input::ButtonRelease(1, [10.0, 10.0]));
    app.handle(Input::Wheel(2.0, MIDDLE));
    assert_eq!(app.eye(), expected);
}

/// A second button changes nothing of what the first one holds, nor does letting it go.
#[test]
fn what_one_button_holds_another_does_not_let_go() {
    let (sample, _viewer, mut app) = app(1);
    over_the_cube(&mut app, &sample, 0);
    let ctrl = Modifiers { ctrl: true, shift: false };
    let before = app.eye();
    app.handle(Input::ButtonPress(1, MIDDLE, ctrl));
    app.handle(Input::Move([MIDDLE[0] + 20.0, MIDDLE[1]]));
    assert!(matches!(app.take_commands()[..], [Command::Drag { .. }]));
    app.handle(Input::ButtonPress(3, MIDDLE, Modifiers::default()));
    app.handle(Input::Move([MIDDLE[0] + 60.0, MIDDLE[1]]));
    assert!(matches!(app.take_commands()[..], [Command::Drag { .. }]), "it is pulled on");
    app.handle(Input::ButtonRelease(3, MIDDLE));
    assert!(!app.take_commands().contains(&Command::Release), "the spring is of the first button");
    assert_eq!(app.eye(), before);
    app.handle(Input::ButtonRelease(1, MIDDLE));
    assert_eq!(app.take_commands().last(), Some(&Command::Release));
    // Where it was not heard that a button was let go, it is when it is pressed again.
    app.handle(Input::ButtonPress(1, MIDDLE, ctrl));
    app.take_commands();
    app.handle(Input::ButtonPress(1, MIDDLE, Modifiers::default()));
    assert_eq!(app.take_commands(), [Command::Release]);
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

/// Through a camera only its environment is seen, so only that is clicked on, reset, and asked for contacts; also where all
/// environments are shown otherwise, and another one stands between.
#[test]
fn through_a_sensor_only_its_environment_is_there() {
    let (_sample, viewer, mut app) = app(2);
    let mut snapshot = Snapshot::clone(&viewer.newest().unwrap());
    let [x, y, z] = snapshot.envs[0].origin;
    snapshot.envs[1].origin = [x + 0.15, y + 0.15, z + 0.2];
    let through = snapshot.envs[0].views[0].as_ref().unwrap().view;
    app.show(Arc::new(snapshot.clone()));
    press(&mut app, Key::Char('c'));
    assert_eq!(app.wants().contacts, Some(Shown::All));
    press(&mut app, Key::Char('v'));
    assert_eq!(app.wants().contacts, Some(Shown::One(0)));
    assert_eq!(press(&mut app, Key::Backspace), [Command::Reset(Some(EnvId(0)))]);
    let points =
        || (0..12).flat_map(|row| (0..16).map(move |column| [85.0 + 31.0 * column as f64, 8.0 + 30.0 * row as f64]));
    let mut cubes = 0;
    for at in points() {
        click(&mut app, at);
        let picked = app.picked().unwrap();
        assert_eq!(picked.env, 0, "{picked:?} at {at:?}");
        cubes += usize::from(picked.name == "cube");
    }
    assert!(cubes > 3, "{cubes}");
    // The control: from the same place, freely, the other one is in the way.
    let mut painter = Painter::new(1);
    let mut pose = through.world_from_camera;
    (0..3).for_each(|k| pose.translation[k] += [x, y, z][k] as f32);
    let view = View { world_from_camera: pose, ..through };
    let look = Look::default();
    let mut others = (0..48).flat_map(|v| (0..64).map(move |u| [f64::from(u) + 0.5, f64::from(v) + 0.5]));
    let other = others.find_map(|at| painter.pick(&snapshot, &view, &look, at).filter(|picked| picked.env == 1));
    assert!(other.is_some());
}

/// In a window with too few rows for a slider there is none to be moved.
#[test]
fn sliders_are_where_they_are_drawn() {
    let (_sample, _viewer, mut app) = app(1);
    press(&mut app, Key::Tab);
    let at = [SIZE[0] as f64 - 100.0, 35.0];
    // The first row is from 22 to 48.
    for (height, is_there) in [(47, false), (48, true), (360, true)] {
        app.handle(Input::Resize([SIZE[0], height]));
        let canvas = drawn(&mut app);
        // The mark of the target; the letters above are of the same yellow.
        let mut places = (30..height.min(48)).flat_map(|y| (SIZE[0] - 202..SIZE[0] - 8).map(move |x| (x, y)));
        let mark = places.any(|(x, y)| canvas.pixel(x, y) == Some([255, 210, 60]));
        assert_eq!(mark, is_there, "{height}");
        app.handle(Input::ButtonPress(1, at, Modifiers::default()));
        assert_eq!(app.take_commands().len(), usize::from(is_there), "{height}");
        app.handle(Input::ButtonRelease(1, at));
    }
}

/// What somebody moves while time is held moves: where four samples take too long, it has one.
#[test]
fn what_is_moved_in_a_pause_is_drawn_coarsely_until_it_rests() {
    let (_sample, viewer, mut app) = app(1);
    // Six million pixels on one thread take longer than a thirtieth of a second.
    const LARGE: [usize; 2] = [3000, 2000];
    let mut snapshot = Snapshot::clone(&viewer.newest().unwrap());
    snapshot.run.paused = true;
    let mut fine = App::new(LARGE, 1);
    fine.show(Arc::new(snapshot.clone()));
    let fine = drawn(&mut fine);
    app.handle(Input::Resize(LARGE));
    app.keep_pace();
    let start = Instant::now();
    let mut coarse_at = |number: u64, milliseconds: u64| {
        app.show(Arc::new(Snapshot { number, ..snapshot.clone() }));
        let mut canvas = Canvas::default();
        app.draw(&mut canvas, start + Duration::from_millis(milliseconds));
        // Below the status, which counts pictures.
        canvas.bytes()[4 * 70 * LARGE[0]..] != fine.bytes()[4 * 70 * LARGE[0]..]
    };
    // It is found out in three pictures that fine ones take too long.
    assert_eq!([0, 1, 2].map(|k| coarse_at(10 + k, 100 * k)), [false; 3]);
    assert_eq!([3, 4, 5, 6, 7].map(|k| coarse_at(10 + k, 100 * k)), [true; 5], "it is moved on and on");
    assert_eq!([800, 900, 1000].map(|k| coarse_at(17, k)), [true, true, false], "a quarter of a second later it rests");
}

/// A small picture is drawn at once; a display that takes long to be handed one leaves no time for fine ones.
#[test]
fn what_a_slow_display_shows_is_coarse() {
    let shown = |handing: Duration| {
        let (_sample, viewer, mut app) = app(1);
        let mut snapshot = Snapshot::clone(&viewer.newest().unwrap());
        snapshot.run.paused = true;
        app.keep_pace();
        app.handle(Input::Resize([320, 200]));
        let start = Instant::now();
        let pictures = (0..8u64).map(|k| {
            app.show(Arc::new(Snapshot { number: 10 + k, ..snapshot.clone() }));
            let mut canvas = Canvas::default();
            app.draw(&mut canvas, start + Duration::from_millis(100 * k));
            app.handed_over(handing);
            // Below the status.
            canvas.bytes()[4 * 50 * 320..].to_vec()
        });
        let pictures: Vec<Vec<u8>> = pictures.collect();
        pictures.iter().map(|picture| *picture != pictures[0]).collect::<Vec<bool>>()
    };
    let [f, t] = [false, true];
    // The first picture does not know yet, and three tell.
    assert_eq!(shown(Duration::from_millis(500)), [f, f, f, f, t, t, t, t]);
    assert_eq!(shown(Duration::ZERO), [f; 8], "the control");
}

#[test]
fn the_help_is_whole_in_a_narrow_window() {
    let lines = keys::help().len();
    for (width, columns) in [(325, 1), (639, 1), (640, 2), (960, 2)] {
        let mut canvas = Canvas::new(width, 15 * lines + 34);
        hud::help(&mut canvas);
        let rows = lines.div_ceil(columns);
        let [left, top] = [width - 315 * columns - 10, 15 * (lines - rows)].map(|free| free / 2);
        // Of each line, both parts have letters.
        for line in 0..lines {
            let [x, y] = [left + 12 + line / rows * 315, top + 28 + line % rows * 15];
            for (part, wide, color) in [(0, 84, [240; 3]), (84, 222, [170; 3])] {
                let mut pixels = (y..y + 10).flat_map(|v| (x + part..x + part + wide).map(move |u| (u, v)));
                let found = pixels.any(|(u, v)| canvas.pixel(u, v) == Some(color));
                assert!(found, "line {line} at a width of {width}");
            }
        }
    }
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

/// Each key of flight goes where it says, and nowhere else: ahead along the view, right of it, and up in the world.
#[test]
fn keys_of_flight_go_where_they_say() {
    let keys = [
        (Key::Char('w'), [1.0, 0.0, 0.0]),
        (Key::Char('s'), [-1.0, 0.0, 0.0]),
        (Key::Char('a'), [0.0, -1.0, 0.0]),
        (Key::Char('d'), [0.0, 1.0, 0.0]),
        (Key::Char('e'), [0.0, 0.0, 1.0]),
        (Key::Char('q'), [0.0, 0.0, -1.0]),
        (Key::Up, [1.0, 0.0, 0.0]),
        (Key::Down, [-1.0, 0.0, 0.0]),
        (Key::Left, [0.0, -1.0, 0.0]),
        (Key::Right, [0.0, 1.0, 0.0]),
    ];
    for (key, [ahead, right, up]) in keys {
        let (_sample, _viewer, mut app) = app(1);
        let before = app.eye();
        app.handle(Input::Press(key));
        std::thread::sleep(Duration::from_millis(10));
        drawn(&mut app);
        let after = app.eye();
        let way = Vector3::from([0, 1, 2].map(|k| after.target[k] - before.target[k]));
        let forward = Vector3::from(before.forward());
        let to_right = forward.cross(&Vector3::z()).normalize();
        let wanted = forward * ahead + to_right * right + Vector3::z() * up;
        assert!((way.normalize() - wanted).norm() < 1e-9, "{key:?}: {way}, not along {wanted}");
    }
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
