//! The window on a real X server without a screen (Xvfb): what is on the display is what was drawn, windows are opened and
//! closed again and again, and the loss of the display ends the window, not the program.

use super::display::{Display, LONG, SIZE, cfg_on, hold, pixels, press, screenshot, send, simulation, until};
use sim::SimulationManager;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use view::window::App;
use view::{Canvas, Closed, Command, Eye, OpenWindow, Speed, Viewing, Wants, Window, WindowError};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ClientMessageEvent, ConfigureWindowAux, ConnectionExt as _, EventMask,
    MOTION_NOTIFY_EVENT,
};

/// Below the status, which counts pictures per second \[pixels\].
const BELOW_STATUS: usize = 70;

/// A simulation that a thread steps until it is told to stop.
struct Running {
    steps: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<SimulationManager>,
}

impl Running {
    fn start(mut sim: SimulationManager) -> Self {
        let (steps, stop) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
        let (count, ends) = (Arc::clone(&steps), Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            while !ends.load(Ordering::SeqCst) {
                sim.update(1);
                count.fetch_add(1, Ordering::SeqCst);
            }
            sim
        });
        Self { steps, stop, thread }
    }

    /// Steps that are done.
    fn steps(&self) -> u64 {
        self.steps.load(Ordering::SeqCst)
    }

    fn end(self) -> SimulationManager {
        self.stop.store(true, Ordering::SeqCst);
        self.thread.join().unwrap()
    }
}

/// Threads of this process, and files that it has open.
fn threads_and_files() -> [usize; 2] {
    ["task", "fd"].map(|of| std::fs::read_dir(format!("/proc/self/{of}")).unwrap().count())
}

fn ended(window: &Window) -> Closed {
    window.wait(LONG).expect("it ends")
}

/// Windows of one process, one after the other: all of it is one test, because threads are counted.
#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn a_window_shows_obeys_and_goes() {
    let mut display = Display::start("1280x800");
    let mut sim = simulation();

    // What is on the display is what was drawn.
    let window = sim.open_window_with(cfg_on(&display)).unwrap();
    let connection = display.connect();
    let viewer = sim.viewer(Wants::default());
    let (mut expected, mut expected_after) = (Canvas::default(), Canvas::default());
    let mut app = App::new(SIZE, 2);
    app.show(viewer.newest().unwrap());
    app.draw(&mut expected, Instant::now());
    let (from, expected) = (BELOW_STATUS * SIZE[0], pixels(&expected));
    until("the display shows what was drawn", || screenshot(&connection, SIZE)[from..] == expected[from..]);
    // The mouse: dragged by 60 and 20 pixels with the left button, with the right one, and one notch of the wheel.
    let (number, at) = (window.number(), [200i16, 150]);
    let mut eye = app.eye();
    let mut moved = |what: &str, eye: Eye| {
        app.look_from(eye);
        app.draw(&mut expected_after, Instant::now());
        let expected = pixels(&expected_after);
        until(what, || screenshot(&connection, SIZE)[from..] == expected[from..]);
    };
    for (button, way) in [(1, Eye::orbit as fn(&mut Eye, [f64; 2], usize)), (3, Eye::pan)] {
        send(&connection, number, (BUTTON_PRESS_EVENT, button), 0, at);
        send(&connection, number, (MOTION_NOTIFY_EVENT, 0), 0, [at[0] + 60, at[1] + 20]);
        send(&connection, number, (BUTTON_RELEASE_EVENT, button), 0, [at[0] + 60, at[1] + 20]);
        way(&mut eye, [60.0, 20.0], SIZE[1]);
        moved("it is turned and moved", eye);
    }
    for (button, steps) in [(4, 1.0), (5, -1.0), (5, -1.0)] {
        send(&connection, number, (BUTTON_PRESS_EVENT, button), 0, at);
        send(&connection, number, (BUTTON_RELEASE_EVENT, button), 0, at);
        eye.zoom(steps);
        moved("it comes nearer and goes away", eye);
    }
    let red = expected[from..].iter().filter(|p| p[0] > 90 && p[1] < p[0] / 2).count();
    assert!(red > 200, "cubes are in the picture: {red}");
    // The control: another view is another picture.
    let mut other = Canvas::default();
    let mut eye = app.eye();
    eye.orbit([40.0, 0.0], SIZE[1]);
    app.look_from(eye);
    app.draw(&mut other, Instant::now());
    assert_ne!(pixels(&other)[from..], expected[from..]);

    // A key: the space bar pauses, and lets go on.
    let run = Running::start(sim);
    let paused = |is: bool| viewer.newest().is_some_and(|snapshot| snapshot.run.paused == is);
    press(&connection, window.number(), 0x20);
    until("it pauses", || paused(true));
    press(&connection, window.number(), 0x20);
    until("it goes on", || paused(false));
    // As fast as can be.
    let speed = |is: Speed| viewer.newest().is_some_and(|snapshot| snapshot.run.speed == is);
    press(&connection, window.number(), 0x30);
    until("it is as fast as can be", || speed(Speed::Free));
    // Held, it pauses once and does not flicker: an odd number of repeats would let it go on. The key after it says when.
    hold(&connection, window.number(), 0x20, 5);
    press(&connection, window.number(), 0x31);
    until("the last key is obeyed", || speed(Speed::REAL));
    assert!(paused(true), "a held space bar pauses");
    press(&connection, window.number(), 0x20);
    until("it goes on", || paused(false));
    // Steps repeat: one and four more.
    press(&connection, window.number(), 0x20);
    until("it pauses", || paused(true));
    let steps = || viewer.newest().unwrap().run.steps;
    let before = steps();
    hold(&connection, window.number(), 0x2e, 4);
    until("five steps", || steps() == before + 5);
    press(&connection, window.number(), 0x30);
    press(&connection, window.number(), 0x20);
    until("it goes on as fast as can be", || paused(false) && speed(Speed::Free));
    let mut sim = run.end();

    // Sizes that nobody wants: the window stays, and shows something down to its last pixel, where a new size leaves black.
    const SCREEN: [usize; 2] = [1280, 800];
    for size in [[1u32, 1], [9000, 7000], [480, 270]] {
        let aux = ConfigureWindowAux::new().width(size[0]).height(size[1]);
        connection.configure_window(window.number(), &aux).unwrap();
        connection.flush().unwrap();
        sim.update(5);
        let [column, row] = [0, 1].map(|k| SCREEN[k].min(size[k] as usize) - 1);
        let last = row * SCREEN[0] + column;
        until("it is drawn at this size", || screenshot(&connection, SCREEN)[last] != [0; 3]);
        assert!(window.is_open(), "{size:?}: {:?}", window.closed());
    }

    // Closed by the user, as window managers do it.
    let atom = |name: &[u8]| connection.intern_atom(false, name).unwrap().reply().unwrap().atom;
    let data = [atom(b"WM_DELETE_WINDOW"), 0, 0, 0, 0];
    let event = ClientMessageEvent::new(32, window.number(), atom(b"WM_PROTOCOLS"), data);
    connection.send_event(false, window.number(), EventMask::NO_EVENT, event).unwrap();
    connection.flush().unwrap();
    assert_eq!(ended(&window), Closed::ByUser);

    // Opened and closed again: no thread stays, and no file.
    drop(viewer);
    let before = threads_and_files();
    for _ in 0..20 {
        let window = sim.open_window_with(cfg_on(&display)).unwrap();
        sim.update(1);
        window.close();
        assert_eq!(ended(&window), Closed::ByUser);
    }
    until("what belongs to windows ends", || threads_and_files().iter().zip(before).all(|(now, then)| *now <= then));

    // The simulation ends the window.
    let mut short = simulation();
    let window = short.open_window_with(cfg_on(&display)).unwrap();
    drop(short);
    assert_eq!(ended(&window), Closed::WithSimulation);

    // The display stands still while the window is open and has paused the simulation: that goes on. Nobody opens another one.
    let window = sim.open_window_with(cfg_on(&display)).unwrap();
    let viewer = sim.viewer(Wants::default());
    press(&connection, window.number(), 0x20);
    let run = Running::start(sim);
    until("it pauses", || viewer.newest().is_some_and(|snapshot| snapshot.run.paused));
    let held = run.steps();
    std::thread::sleep(Duration::from_millis(300));
    assert!(run.steps() <= held + 1, "it is held");
    let other = std::thread::spawn({
        let (cfg, mut sim) = (cfg_on(&display), simulation());
        display.signal("STOP");
        move || sim.open_window_with(cfg).unwrap_err()
    });
    // Snapshots of a paused simulation come where somebody wants something else: then a picture is due.
    while window.is_open() {
        viewer.set_wants(Wants { markers: run.steps().is_multiple_of(2), ..Wants::default() });
        viewer.send(Command::SetSpeed(Speed::REAL));
        std::thread::sleep(Duration::from_millis(5));
    }
    let Closed::DisplayLost(reason) = ended(&window) else { panic!("{:?}", window.closed()) };
    assert!(reason.contains("not answered for 15 s"), "{reason}");
    until("it goes on", || run.steps() > held + 10);
    let error = other.join().unwrap().to_string();
    assert!(error.contains("not answered for 15 s"), "{error}");
    display.signal("CONT");
    drop(viewer);
    let mut sim = run.end();

    // The display is lost while the window is open and the simulation is paused by it: it goes on.
    let window = sim.open_window_with(cfg_on(&display)).unwrap();
    let viewer = sim.viewer(Wants::default());
    press(&connection, window.number(), 0x20);
    let run = Running::start(sim);
    until("it pauses", || viewer.newest().is_some_and(|snapshot| snapshot.run.paused));
    drop(viewer);
    display.server.kill().unwrap();
    assert!(matches!(ended(&window), Closed::DisplayLost(_)), "{:?}", window.closed());
    let held = run.steps();
    until("it goes on", || run.steps() > held + 10);
    let mut sim = run.end();

    // And there is no display any more.
    let error = sim.open_window_with(cfg_on(&display)).unwrap_err();
    assert!(matches!(error, WindowError::NoDisplay { .. }));
    let text = error.to_string();
    for word in ["DISPLAY", "WAYLAND_DISPLAY", "--headless"] {
        assert!(text.contains(word), "{text}");
    }
    sim.update(10);
}
