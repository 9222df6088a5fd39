//! The window without a display: effects of keys and the mouse, and the rendered image. With a display: on Xvfb, an X
//! server without a screen.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod display;
mod on_x;

use super::key_bindings::{Action, BINDINGS};
use super::*;
use crate::Screenshot;
use crate::control::{RecordControl, RecordingState};
use crate::sample::{CUBE_HALF_EDGE, Sample, differing_pixels, sample};
use crate::scene_view::{CameraPanel, EnvSelection, OrbitCamera, Overlays, SceneRenderer, Snapshot, ViewOptions};
use kinetoscope_render::View;
use kinetoscope_sim::EnvId;
use nalgebra::Vector3;

const SIZE: [usize; 2] = [640, 360];
/// Center of the image.
const MIDDLE: [f64; 2] = [SIZE[0] as f64 / 2.0, SIZE[1] as f64 / 2.0];
const PLAIN: Modifiers = Modifiers { shift: false, ctrl: false };
const CTRL: Modifiers = Modifiers { shift: false, ctrl: true };
/// Color of a slider's target mark, and of notes.
const YELLOW: Option<[u8; 3]> = Some([255, 210, 60]);

/// A window state with a sample simulation.
struct Shows {
    sample: Sample,
    viewer: Viewer,
    app: App,
}

fn shows(num_envs: usize) -> Shows {
    let mut sample = sample(num_envs);
    sample.sim.update(50);
    let viewer = sample.sim.viewer(SnapshotRequest::default());
    let mut app = App::new(SIZE, 1);
    app.set_snapshot(viewer.newest().unwrap());
    Shows { sample, viewer, app }
}

impl Shows {
    fn drawn(&mut self) -> Canvas {
        let mut canvas = Canvas::default();
        self.app.draw(&mut canvas, Instant::now());
        canvas
    }

    /// Clicks at a pixel and returns the resulting commands.
    fn click(&mut self, at: [f64; 2]) -> Vec<Command> {
        self.app.handle(Input::ButtonPress(1, at, PLAIN));
        self.app.handle(Input::ButtonRelease(1, at));
        self.app.take_commands()
    }

    /// Presses and releases a key and returns the resulting commands.
    fn press(&mut self, key: Key) -> Vec<Command> {
        self.app.handle(Input::Press(key));
        self.app.handle(Input::Release(key));
        self.app.take_commands()
    }

    /// Presses letter keys and returns the resulting commands.
    fn type_in(&mut self, letters: &str) -> Vec<Command> {
        letters.chars().flat_map(|letter| self.press(Key::Char(letter))).collect()
    }

    /// Looks down at the cube: the image center is on its upper face.
    fn over_the_cube(&mut self, env: usize) {
        let origin = self.sample.sim.cfg().env_origins();
        let at = |p: [f64; 3]| [0, 1, 2].map(|k| origin[(env, k)] + p[k]);
        self.app.set_camera(OrbitCamera::look_at(at([0.02, 0.01, 1.5]), at([0.0, 0.0, 2.0 * CUBE_HALF_EDGE])).unwrap());
    }

    /// Moves the cube of each environment and shows the result.
    fn move_cube(&mut self, place: impl Fn(usize) -> [f64; 3]) -> Arc<Snapshot> {
        let (sim, envs) = (&mut self.sample.sim, self.viewer.newest().unwrap().envs.len());
        let row = |env| [&place(env)[..], &[1.0, 0.0, 0.0, 0.0]].concat();
        let poses = ndarray::Array2::from_shape_fn((envs, 7), |(env, k)| row(env)[k]);
        let cube = sim.entities().rigid_object_id("cube").unwrap();
        sim.rigid_object_mut(cube).write_pose(&poses, None).unwrap();
        self.viewer = sim.viewer(SnapshotRequest::default());
        self.app.set_snapshot(self.viewer.newest().unwrap());
        self.viewer.newest().unwrap()
    }

    /// Returns a modified snapshot.
    fn changed(&self, change: impl FnOnce(&mut Snapshot)) -> Snapshot {
        let mut snapshot = Snapshot::clone(&self.viewer.newest().unwrap());
        change(&mut snapshot);
        snapshot
    }
}

/// A state in which each key has an effect: a cube is selected, and one environment is seen through its camera.
fn busy() -> Shows {
    let mut shows = shows(3);
    shows.over_the_cube(0);
    shows.click(MIDDLE);
    assert!(shows.app.selection().is_some_and(|picked| picked.name == "cube"), "{:?}", shows.app.selection());
    shows.press(Key::PageDown);
    shows.type_in("v");
    shows
}

/// Every key has an effect. A held key repeats steps only: it pauses once, and starts one recording.
#[test]
fn keys_and_repeats() {
    for binding in BINDINGS {
        let mut shows = busy();
        let before = format!("{:?}", shows.app);
        shows.app.handle(Input::Press(binding.key));
        let first = shows.app.take_commands();
        let after = format!("{:?}", shows.app);
        assert!(after != before || !first.is_empty(), "{binding:?}");
        shows.app.handle(Input::Repeat(binding.key));
        let again = shows.app.take_commands();
        let turns_pages = matches!(binding.action, Action::NextEnv | Action::PreviousEnv);
        let goes_on = turns_pages || matches!(binding.action, Action::Steps(_) | Action::Slower | Action::Faster);
        assert_eq!(again, if goes_on { first } else { Vec::new() }, "{binding:?}");
        assert_eq!(format!("{:?}", shows.app) != after, turns_pages, "{binding:?}");
        assert!(!shows.drawn().bytes().is_empty());
    }
}

/// Each overlay key toggles its own overlay and no other.
#[test]
fn overlay_keys() {
    type Overlay = fn(&mut Overlays) -> &mut bool;
    let turns: [(&str, Overlay); 9] = [
        ("o", |all| &mut all.sensors),
        ("c", |all| &mut all.contacts),
        ("f", |all| &mut all.frames),
        ("j", |all| &mut all.joints),
        ("m", |all| &mut all.centers_of_mass),
        ("t", |all| &mut all.names),
        ("l", |all| &mut all.trails),
        ("k", |all| &mut all.collisions),
        ("u", |all| &mut all.visuals),
    ];
    let (mut shows, mut expected) = (shows(1), Overlays::default());
    for (key, turned) in [turns, turns].concat() {
        *turned(&mut expected) ^= true;
        shows.type_in(key);
        assert_eq!(shows.app.overlays(), expected, "{key}");
    }
    assert_eq!(expected, Overlays::default());
}

#[test]
fn command_keys() {
    let mut shows = shows(3);
    assert_eq!(shows.type_in(" .1"), [Command::TogglePause, Command::Step(1), Command::SetSpeed(Speed::REAL_TIME)]);
    // The reset applies to the shown environment, or to all. The environment before the first is the last.
    for (keys, expected) in [
        (&[][..], None),
        (&[Key::PageDown], Some(EnvId(1))),
        (&[Key::PageUp, Key::PageUp], Some(EnvId(2))),
        (&[Key::Char('g')], None),
    ] {
        keys.iter().for_each(|key| assert!(shows.press(*key).is_empty()));
        assert_eq!(shows.press(Key::Backspace), [Command::Reset(expected)], "{keys:?}");
    }
    shows.type_in("c");
    assert_eq!(shows.app.snapshot_request().contacts, Some(EnvSelection::All));
    let times = Speed::Factor;
    for (speed, measured, key, expected) in [
        (Speed::REAL_TIME, Some(0.9), "-", 0.5),
        (Speed::REAL_TIME, Some(0.9), "=", 2.0),
        (Speed::REAL_TIME, Some(0.9), "+", 2.0),
        (times(0.25), Some(0.9), "-", 0.125),
        // At the limits of the range.
        (times(1.5e-3), Some(0.9), "-", 1e-3),
        (times(700.0), Some(0.9), "+", 1e3),
        // At free speed: half and twice the measured speed.
        (Speed::Unlimited, Some(8.0), "-", 4.0),
        (Speed::Unlimited, None, "=", 2.0),
    ] {
        let snapshot = shows.changed(|s| (s.run.speed, s.run.measured_speed) = (speed, measured));
        shows.app.set_snapshot(Arc::new(snapshot));
        assert_eq!(shows.type_in(key), [Command::SetSpeed(times(expected))], "{speed:?} {key}");
    }
}

/// The panel of the keys I and page down: its corner shows the four images that a panel of that camera and environment
/// draws.
#[test]
fn panel_of_environment() {
    let mut shows = shows(3);
    let snapshot = shows.move_cube(|env| [0.0, 0.1 * env as f64, CUBE_HALF_EDGE]);
    shows.press(Key::PageDown);
    shows.type_in("i");
    let [mut expected, mut other] = [Canvas::default(), Canvas::default()];
    let mut panel = CameraPanel::new(1);
    assert!(panel.draw(&snapshot, 0, 0, 160, &mut other) && panel.draw(&snapshot, 0, 1, 160, &mut expected));
    assert!(expected != other, "environments look alike");
    let canvas = shows.drawn();
    let ([width, height], [w, h]) = (canvas.dimensions(), expected.dimensions());
    let corner = |panel: &Canvas| {
        let at = |x: usize, y: usize| canvas.pixel(width - w - 6 + x, height - h - 6 + y);
        (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).all(|(x, y)| at(x, y) == panel.pixel(x, y))
    };
    assert!(corner(&expected) && !corner(&other));
    shows.type_in("i");
    assert!(shows.drawn().pixel(width - 10, height - 10) != expected.pixel(w - 4, h - 4), "it goes again");
}

/// Commands are queued while the simulation does not step. When the queue is full, commands are rejected, and the image
/// says so.
#[test]
fn full_inbox() {
    let mut shows = shows(1);
    let sent = (0..100_000).take_while(|_| shows.viewer.send(Command::TogglePause)).count();
    assert!(sent < 100_000, "it is taken for ever");
    // Below the status lines, where refusals are shown.
    let mut shining = |heard: Option<bool>| {
        heard.into_iter().for_each(|heard| shows.app.set_send_result(heard));
        let canvas = shows.drawn();
        let pixels = (8..400).flat_map(|x| (50..70).map(move |y| (x, y)));
        pixels.filter(|&(x, y)| canvas.pixel(x, y) == YELLOW).count()
    };
    let (plain, told) = (shining(None), shining(Some(false)));
    assert!(told > plain + 300, "{told} {plain}");
    assert_eq!(shining(Some(true)), plain);
}

/// Waiting callers see the end of a window, even if its thread panics.
#[test]
fn crash() {
    let shared = Arc::new(WindowState::default());
    let window = Window { shared: Arc::clone(&shared) };
    let crashing = std::thread::spawn(move || {
        let _ending = EndGuard(shared);
        panic!("as a mistake would");
    });
    assert_eq!(window.wait(Duration::from_secs(30)), Some(Closed::Crashed));
    assert!(!window.is_open() && crashing.join().is_err());
    assert!(Closed::Crashed.error().is_some() && Closed::ByUser.error().is_none());
}

/// A camera motion by a mouse drag.
type Way = fn(&mut OrbitCamera, [f64; 2], usize);

/// Drags and the wheel move the camera. The effect on the image is tested with the camera.
#[test]
fn drags_and_wheel() {
    let Shows { sample: _sample, viewer: _viewer, mut app } = shows(1);
    let by = [40.0, -15.0];
    let ways: [(u8, bool, Way); 4] = [
        (1, false, OrbitCamera::orbit),
        (1, true, OrbitCamera::pan),
        (2, false, OrbitCamera::look_around),
        (3, false, OrbitCamera::pan),
    ];
    for (button, shift, way) in ways {
        let (before, mut expected) = (app.camera(), app.camera());
        // In two parts, as with a real mouse.
        way(&mut expected, [by[0], 0.0], SIZE[1]);
        way(&mut expected, [0.0, by[1]], SIZE[1]);
        app.handle(Input::ButtonPress(button, [100.0, 100.0], Modifiers { shift, ctrl: false }));
        app.handle(Input::Move([100.0 + by[0], 100.0]));
        app.handle(Input::Move([100.0 + by[0], 100.0 + by[1]]));
        app.handle(Input::ButtonRelease(button, [100.0 + by[0], 100.0 + by[1]]));
        assert!(app.camera() == expected && expected != before, "button {button}: {:?}", app.camera());
        // After the release, the camera stays.
        app.handle(Input::Move([10.0, 10.0]));
        assert_eq!(app.camera(), expected);
    }
    let mut expected = app.camera();
    expected.zoom(2.0);
    app.handle(Input::Wheel(2.0, MIDDLE));
    assert_eq!(app.camera(), expected);
    // Through a camera sensor, the view is fixed.
    for input in [
        Input::Press(Key::Char('v')),
        Input::ButtonPress(1, MIDDLE, PLAIN),
        Input::Move([10.0, 10.0]),
        Input::ButtonRelease(1, [10.0, 10.0]),
        Input::Wheel(2.0, MIDDLE),
    ] {
        app.handle(input);
    }
    assert_eq!(app.camera(), expected);
}

/// A second button, pressed and released, has no effect on the drag of the first.
#[test]
fn second_button() {
    let mut shows = shows(1);
    shows.over_the_cube(0);
    let before = shows.app.camera();
    let mut commands = |inputs: &[Input]| {
        inputs.iter().for_each(|input| shows.app.handle(*input));
        (shows.app.take_commands(), shows.app.camera())
    };
    let [x, y] = MIDDLE;
    let (pulled, _) = commands(&[Input::ButtonPress(1, MIDDLE, CTRL), Input::Move([x + 20.0, y])]);
    assert!(matches!(pulled[..], [Command::Drag { .. }]));
    let (pulled, _) = commands(&[Input::ButtonPress(3, MIDDLE, PLAIN), Input::Move([x + 60.0, y])]);
    assert!(matches!(pulled[..], [Command::Drag { .. }]), "it is pulled on");
    let (held, eye) = commands(&[Input::ButtonRelease(3, MIDDLE)]);
    assert!(!held.contains(&Command::Release) && eye == before, "the spring is of the first button");
    assert_eq!(commands(&[Input::ButtonRelease(1, MIDDLE)]).0.last(), Some(&Command::Release));
    // A lost release is made up for when the button is pressed again.
    commands(&[Input::ButtonPress(1, MIDDLE, CTRL)]);
    assert_eq!(commands(&[Input::ButtonPress(1, MIDDLE, PLAIN)]).0, [Command::Release]);
}

#[test]
fn selection_and_spring() {
    let mut shows = shows(4);
    shows.over_the_cube(3);
    let ([x, y], plain) = (MIDDLE, shows.drawn());
    shows.app.handle(Input::ButtonPress(1, MIDDLE, PLAIN));
    shows.app.handle(Input::ButtonRelease(1, [x + 1.0, y]));
    let picked = shows.app.selection().unwrap().clone();
    assert!(differing_pixels(&shows.drawn(), &plain) > 2_000, "a note on it");
    assert!(picked.name == "cube" && picked.env == 3, "{picked:?}");
    assert_eq!(shows.app.snapshot_request().contacts, Some(EnvSelection::One(3)), "the forces on it");
    shows.app.handle(Input::ButtonPress(1, MIDDLE, CTRL));
    shows.app.handle(Input::Move([x + 90.0, y]));
    let [Command::Drag { env, body, target, .. }] = shows.app.take_commands()[..] else { panic!("one drag") };
    assert_eq!((env, Some(body)), (EnvId(3), picked.body));
    // The motion is in the plane through the face parallel to the image: at a distance of 1.3 m, a pixel is 1.3 m / f,
    // with f = 180 / tan(22.5°) pixels. The selection was at the center of the pixel one to the right.
    let moved = (Vector3::from(target) - Vector3::from(picked.point)).norm();
    let expected = 88.5 * 1.3 / (180.0 / 22.5f64.to_radians().tan());
    assert!((moved - expected).abs() < 0.01 * expected, "{moved} {expected}");
    shows.app.handle(Input::ButtonRelease(1, MIDDLE));
    assert!(shows.app.take_commands().contains(&Command::Release));
    shows.press(Key::Escape);
    assert!(shows.app.selection().is_none());
    // While followed, the body stays at the image center.
    shows.click(MIDDLE);
    shows.type_in("x");
    shows.move_cube(|_| [0.0, -0.8, CUBE_HALF_EDGE]);
    shows.click(MIDDLE);
    assert!(shows.app.selection().is_some_and(|picked| picked.name == "cube"), "{:?}", shows.app.selection());
}

/// The slider panel is 210 pixels wide. Its first row is from 22 to 48. Its only slider goes from 8 pixels right of the
/// panel's edge to 8 pixels before its end, from -2 to 2 rad.
#[test]
fn sliders() {
    let mut shows = shows(1);
    shows.press(Key::Tab);
    let [left, right] = [SIZE[0] as f64 - 202.0, SIZE[0] as f64 - 8.0];
    for (what, input, expected) in [
        ("pressed", Input::ButtonPress(1, [0.5 * (left + right), 35.0], PLAIN), 0.0),
        ("held, it may leave its row", Input::Move([right, 300.0]), 2.0),
        ("and its panel", Input::Move([0.0, 300.0]), -2.0),
        ("and come back", Input::Move([left + 0.75 * (right - left), 300.0]), 1.0),
    ] {
        shows.app.handle(input);
        let commands = shows.app.take_commands();
        let [Command::SetTarget { robot, env, value, .. }] = commands[..] else { panic!("{what}: {commands:?}") };
        assert_eq!((robot, env), (shows.sample.robot, Some(EnvId(0))));
        assert!((value - expected).abs() < 1e-9, "{what}: {value}");
    }
    shows.app.handle(Input::ButtonRelease(1, MIDDLE));
    // A window without space for a slider has no slider to drag.
    for (height, is_there) in [(47, false), (48, true), (360, true)] {
        shows.app.handle(Input::Resize([SIZE[0], height]));
        let canvas = shows.drawn();
        // The title above has the same yellow.
        let mut places = (30..height.min(48)).flat_map(|y| (SIZE[0] - 202..SIZE[0] - 8).map(move |x| (x, y)));
        assert_eq!(places.any(|(x, y)| canvas.pixel(x, y) == YELLOW), is_there, "{height}");
        assert_eq!(shows.click([SIZE[0] as f64 - 100.0, 35.0]).len(), usize::from(is_there), "{height}");
    }
}

/// Through a camera sensor, a click on each pixel finds the object of its mask.
#[test]
fn sensor_view() {
    let mut shows = shows(2);
    shows.press(Key::PageDown);
    shows.type_in("v");
    let mask = shows.sample.sim.sensor(shows.sample.camera).unwrap().mask().unwrap().to_owned();
    let cube = shows.sample.sim.scene().mask_ids().iter().find(|id| id.object == "cube").unwrap().id;
    // The sensor's 64 x 48 pixels cover 7.5 window pixels each, centered in the window.
    let mut tried = 0;
    for (v, u) in (2usize..46).step_by(4).flat_map(|v| (2usize..62).step_by(4).map(move |u| (v, u))) {
        let id = mask[(1, v, u)];
        let inside = (v - 1..=v + 1).all(|v| (u - 1..=u + 1).all(|u| mask[(1, v, u)] == id));
        if !inside || id <= 0 {
            continue;
        }
        shows.click([320.0 + 7.5 * (u as f64 + 0.5 - 32.0), 180.0 + 7.5 * (v as f64 + 0.5 - 24.0)]);
        assert_eq!(shows.app.selection().map(|picked| picked.mask_id), Some(id), "pixel {u} {v}");
        tried += usize::from(id == cube);
    }
    assert!(tried > 3, "the cube was looked at {tried} times");
}

/// Through a camera, only its environment is shown, selected, reset, and queried for contacts, even if all environments
/// are shown otherwise and another one stands in between.
#[test]
fn sensor_view_of_one_environment() {
    let mut shows = shows(2);
    let [x, y, z] = shows.viewer.newest().unwrap().envs[0].origin;
    let snapshot = shows.changed(|s| s.envs[1].origin = [x + 0.15, y + 0.15, z + 0.2]);
    let through = snapshot.envs[0].views[0].as_ref().unwrap().view;
    shows.app.set_snapshot(Arc::new(snapshot.clone()));
    shows.type_in("c");
    assert_eq!(shows.app.snapshot_request().contacts, Some(EnvSelection::All));
    shows.type_in("v");
    assert_eq!(shows.app.snapshot_request().contacts, Some(EnvSelection::One(0)));
    assert_eq!(shows.press(Key::Backspace), [Command::Reset(Some(EnvId(0)))]);
    let mut cubes = 0;
    for (row, column) in (0..12).flat_map(|row| (0..16).map(move |column| (f64::from(row), f64::from(column)))) {
        shows.click([85.0 + 31.0 * column, 8.0 + 30.0 * row]);
        let picked = shows.app.selection().unwrap();
        assert_eq!(picked.env, 0, "{picked:?} at {row} {column}");
        cubes += usize::from(picked.name == "cube");
    }
    assert!(cubes > 3, "{cubes}");
    // Control: from the same pose without the camera, the other environment blocks the view.
    let mut renderer = SceneRenderer::new(1);
    let mut pose = through.world_from_camera;
    (0..3).for_each(|k| pose.translation[k] += [x, y, z][k] as f32);
    let view = View { world_from_camera: pose, ..through };
    let mut others = (0..48).flat_map(|v| (0..64).map(move |u| [f64::from(u) + 0.5, f64::from(v) + 0.5]));
    assert!(
        others
            .any(|at| renderer.pick(&snapshot, &view, &ViewOptions::default(), at).is_some_and(|other| other.env == 1))
    );
}

#[test]
fn help_at_every_width() {
    let lines = key_bindings::help().len();
    for (width, columns) in [(325, 1), (639, 1), (640, 2), (960, 2)] {
        let mut canvas = Canvas::new(width, 15 * lines + 34);
        hud::draw_help(&mut canvas);
        let rows = lines.div_ceil(columns);
        let [left, top] = [width - 315 * columns - 10, 15 * (lines - rows)].map(|free| free / 2);
        // Both parts of each line have letters.
        for line in 0..lines {
            let [x, y] = [left + 12 + line / rows * 315, top + 28 + line % rows * 15];
            for (part, wide, color) in [(0, 84, [240; 3]), (84, 222, [170; 3])] {
                let mut pixels = (y..y + 10).flat_map(|v| (x + part..x + part + wide).map(move |u| (u, v)));
                assert!(pixels.any(|(u, v)| canvas.pixel(u, v) == Some(color)), "line {line} at a width of {width}");
            }
        }
    }
}

#[test]
fn every_size() {
    let mut shows = shows(2);
    shows.type_in("cfjmtlkih");
    shows.press(Key::Tab);
    for size in [[1, 1], [1, 700], [3000, 2], [250, 40], [960, 540]] {
        shows.app.handle(Input::Resize(size));
        assert_eq!(shows.drawn().dimensions(), size);
    }
    // The help is part of the image, of 640 pixels in a row.
    let with = shows.drawn();
    shows.press(Key::F1);
    assert!(differing_pixels(&with, &shows.drawn()) > 50_000, "{}", differing_pixels(&with, &shows.drawn()));
}

/// A held flight key moves along its own direction only: forward along the view, right of it, and up in the world. The
/// speed per second is the distance to the target. Losing the focus releases the key.
#[test]
fn flight() {
    for (key, [ahead, right, up]) in [
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
    ] {
        let mut shows = shows(1);
        let before = shows.app.camera();
        shows.app.handle(Input::Press(key));
        assert!(shows.app.needs_redraw(Instant::now()));
        std::thread::sleep(Duration::from_millis(30));
        shows.drawn();
        let way = Vector3::from(shows.app.camera().target) - Vector3::from(before.target);
        let forward = Vector3::from(before.direction());
        let to_right = forward.cross(&Vector3::z()).normalize();
        let wanted = forward * ahead + to_right * right + Vector3::z() * up;
        assert!((way.normalize() - wanted).norm() < 1e-9, "{key:?}: {way}, not along {wanted}");
        // Between 30 ms and 100 ms.
        let share = way.norm() / before.distance;
        assert!((0.029..0.101).contains(&share), "{key:?}: {share}");
        shows.app.handle(Input::FocusLost);
        assert!(!shows.app.needs_redraw(Instant::now()));
    }
}

/// A recording with a directly settable state.
#[derive(Debug, Default)]
struct Switch(bool);

impl RecordControl for Switch {
    fn set(&mut self, _: &mut SimulationManager, on: bool) -> Result<(), String> {
        self.0 = on;
        Ok(())
    }

    fn state(&self, _: &SimulationManager) -> RecordingState {
        RecordingState { on: self.0, text: "run.mcap: 12 rows".into() }
    }
}

#[test]
fn record_button() {
    let mut shows = shows(1);
    let on_button = [SIZE[0] as f64 - 96.0, 11.0];
    // The whole mark, of 9 by 9 pixels.
    let red = |canvas: &Canvas| (0..9).all(|k| canvas.pixel(SIZE[0] - 96 + k, 11 + k) == Some([235, 60, 50]));
    // Without a record button, the image shows none, and the simulation refuses the key.
    let bare = shows.drawn();
    assert!(shows.click(on_button).is_empty() && !red(&bare));
    assert_eq!(shows.type_in("r"), [Command::Record(true)]);
    for on in [false, true] {
        shows.sample.sim.set_record_button(RecordButton::new(Switch(on)));
        shows.app.set_snapshot(shows.viewer.newest().unwrap());
        assert_eq!(shows.type_in("r"), [Command::Record(!on)]);
        assert_eq!(shows.click(on_button), [Command::Record(!on)]);
        assert!(shows.click([on_button[0], 40.0]).is_empty(), "below it");
        assert_eq!(red(&shows.drawn()), on);
    }
    // The text is below the button.
    let with = shows.drawn();
    let text = (30..42).flat_map(|y| (SIZE[0] - 110..SIZE[0] - 8).map(move |x| (x, y)));
    assert!(text.filter(|&(x, y)| bare.pixel(x, y) != with.pixel(x, y)).count() > 200);
    // To the left of the sliders while they are open.
    shows.press(Key::Tab);
    assert!(!matches!(shows.click(on_button)[..], [Command::Record(_)]));
    assert_eq!(shows.click([on_button[0] - 210.0, 11.0]), [Command::Record(false)]);
}

/// Renders images of a paused simulation, each at a time \[ms\] and of a snapshot number. Returns true for each image
/// that differs from `fine` below the status, which shows the frame rate. `handing` is the duration of sending an
/// image.
fn coarse(app: &mut App, held: &Snapshot, fine: &Canvas, images: &[(u64, u64)], handing: Duration) -> Vec<bool> {
    let (start, below) = (Instant::now(), 4 * 70 * fine.dimensions()[0]);
    let one = |&(number, milliseconds): &(u64, u64)| {
        app.set_snapshot(Arc::new(Snapshot { number, ..held.clone() }));
        let mut canvas = Canvas::default();
        app.draw(&mut canvas, start + Duration::from_millis(milliseconds));
        app.set_send_duration(handing);
        canvas.bytes()[below..] != fine.bytes()[below..]
    };
    images.iter().map(one).collect()
}

/// In a paused simulation, if four samples per pixel take too long, a moving view has one sample until it rests. The
/// time of sending the image counts too.
#[test]
fn coarse_while_moving() {
    let Shows { sample: _sample, viewer, .. } = shows(1);
    let mut held = Snapshot::clone(&viewer.newest().unwrap());
    held.run.paused = true;
    let app = |size: [usize; 2]| {
        let mut app = App::new(size, 1);
        app.set_snapshot(Arc::new(held.clone()));
        let mut fine = Canvas::default();
        app.draw(&mut fine, Instant::now());
        app.enable_adaptive_quality();
        (app, fine)
    };
    // Six million pixels on one thread take longer than a thirtieth of a second, which three images detect.
    let (mut large, fine) = app([3000, 2000]);
    let moving: Vec<_> = (0..8).map(|k| (10 + k, 100 * k)).collect();
    let images = [&moving[..], &[(17, 800), (17, 900), (17, 1000)]].concat();
    let [f, t] = [false, true];
    // The view rests a quarter of a second after the last motion.
    assert_eq!(coarse(&mut large, &held, &fine, &images, Duration::ZERO), [f, f, f, t, t, t, t, t, t, t, f]);
    // A small image is rendered quickly. The first image does not know the duration of sending yet; three slow images
    // are needed.
    for (handing, expected) in [(Duration::from_millis(500), [f, f, f, f, t, t, t, t]), (Duration::ZERO, [f; 8])] {
        let (mut small, fine) = app([320, 200]);
        assert_eq!(coarse(&mut small, &held, &fine, &moving, handing), expected, "{handing:?}");
    }
}

/// The camera set by the program applies to open windows and screenshots; users can move on from there.
#[test]
fn viewpoint() {
    let mut shows = shows(2);
    let set = |shows: &mut Shows, eye: [f64; 3]| {
        shows.sample.sim.scene_mut().set_camera_view(eye, [0.0; 3]).unwrap();
        shows.sample.sim.update(1);
        let held = shows.viewer.newest().unwrap();
        let mut next = (*held).clone();
        next.viewpoint = shows.sample.sim.scene().viewpoint();
        shows.app.set_snapshot(Arc::new(next));
    };
    let expected = |eye: [f64; 3]| OrbitCamera::look_at(eye, [0.0; 3]).unwrap();
    assert_ne!(shows.app.camera(), expected([3.5; 3]), "the control");
    set(&mut shows, [3.5; 3]);
    assert_eq!(shows.app.camera(), expected([3.5; 3]));
    assert_eq!(shows.sample.sim.overview_camera([64, 48]), expected([3.5; 3]));
    // The user's own view stays until the program sets another.
    let own = expected([1.0, 2.0, 1.0]);
    shows.app.set_camera(own);
    shows.app.set_snapshot(shows.viewer.newest().unwrap());
    assert_eq!(shows.app.camera(), own);
    set(&mut shows, [0.0, 2.0, 0.5]);
    assert_eq!(shows.app.camera(), expected([0.0, 2.0, 0.5]));
    for (eye, target) in [([1.0; 3], [1.0; 3]), ([f64::NAN, 0.0, 0.0], [0.0; 3]), ([0.0; 3], [f64::INFINITY; 3])] {
        assert!(
            shows.sample.sim.scene_mut().set_camera_view(eye, target).unwrap_err().to_string().contains("different")
        );
    }
    assert_eq!(shows.sample.sim.scene().viewpoint().unwrap().revision, 2);
}
