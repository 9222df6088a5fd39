//! The window on Xvfb, an X server without a screen: the display shows the rendered image, windows are opened and
//! closed repeatedly, and the loss of the display ends the window, not the program.

use super::display::{SIZE, Target, cfg_on, is_red, simulation};
use crate::sample::SteppingThread;
use crate::window::App;
use crate::{
    Canvas, Closed, Command, ImageWindow, ImageWindowCfg, OpenWindow, OrbitCamera, SnapshotRequest, Speed, Viewer,
    ViewerExt, Window, WindowError,
};
use kinetoscope_sim::SimulationManager;
use kinetoscope_testkit::process;
use kinetoscope_testkit::wait;
use kinetoscope_testkit::wait::{TIMEOUT, threads_and_files};
use kinetoscope_testkit::x_server::{Display, close, screenshot};
use std::io::{Read, Write};
use std::net::TcpListener;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use x11rb::protocol::xproto::{BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, MOTION_NOTIFY_EVENT};

/// First pixel below the status, which shows the frame rate.
const BELOW_STATUS: usize = 70 * SIZE[0];

fn pixels(canvas: &Canvas) -> Vec<[u8; 3]> {
    canvas.bytes().chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect()
}

/// Renders the image of a window without a display.
fn drawn(app: &mut App) -> Vec<[u8; 3]> {
    let mut canvas = Canvas::default();
    app.draw(&mut canvas, Instant::now());
    pixels(&canvas)
}

fn ended(window: &Window) -> Closed {
    window.wait(TIMEOUT).expect("it ends")
}

#[track_caller]
fn wait_for(viewer: &Viewer, paused: bool, speed: Option<Speed>) {
    let run = || viewer.newest().map(|snapshot| snapshot.run.clone());
    let holds = || run().is_some_and(|run| run.paused == paused && speed.is_none_or(|speed| run.speed == speed));
    wait::until(&format!("paused: {paused}, {speed:?}, now {:?}", run()), holds);
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn image_and_mouse() {
    let display = Display::start("1280x800");
    let mut sim = simulation();
    let window = sim.open_window_with(cfg_on(&display.name)).unwrap();
    let connection = display.connect();
    let target = Target::on(&connection, window.id());
    let mut app = App::new(SIZE, 2);
    app.set_snapshot(sim.viewer(SnapshotRequest::default()).newest().unwrap());
    let (first, mut eye) = (drawn(&mut app), app.camera());
    let mut expect = |what: &str, eye: OrbitCamera| {
        app.set_camera(eye);
        let expected = drawn(&mut app);
        let shown = || screenshot(&connection, [0, 0], SIZE);
        wait::until(what, || shown()[BELOW_STATUS..] == expected[BELOW_STATUS..]);
        expected
    };
    assert!(expect("the display shows what was drawn", eye)[BELOW_STATUS..] == first[BELOW_STATUS..]);
    let red = first[BELOW_STATUS..].iter().filter(|p| is_red(p)).count();
    assert!(red > 200, "cubes are in the image: {red}");
    // Mouse drags by 60 and 20 pixels with the left and right button, and steps of the wheel.
    let at = [200i16, 150];
    for (button, way) in [(1, OrbitCamera::orbit as fn(&mut OrbitCamera, [f64; 2], usize)), (3, OrbitCamera::pan)] {
        target.send(BUTTON_PRESS_EVENT, button, 0, at);
        target.send(MOTION_NOTIFY_EVENT, 0, 0, [at[0] + 60, at[1] + 20]);
        target.send(BUTTON_RELEASE_EVENT, button, 0, [at[0] + 60, at[1] + 20]);
        way(&mut eye, [60.0, 20.0], SIZE[1]);
        // Control: a different view is a different image.
        assert!(expect("it is turned and moved", eye)[BELOW_STATUS..] != first[BELOW_STATUS..]);
    }
    for (button, steps) in [(4, 1.0), (5, -1.0), (5, -1.0)] {
        target.send(BUTTON_PRESS_EVENT, button, 0, at);
        target.send(BUTTON_RELEASE_EVENT, button, 0, at);
        eye.zoom(steps);
        expect("it comes nearer and goes away", eye);
    }

    // Extreme sizes: the window survives and fills its last pixel, where a resize leaves black.
    const SCREEN: [usize; 2] = [1280, 800];
    for size in [[1u32, 1], [9000, 7000], [480, 270]] {
        target.resize(size);
        sim.update(5);
        let last = [0, 1].map(|k| SCREEN[k].min(size[k] as usize) - 1);
        wait::until("it is drawn at this size", || screenshot(&connection, last, [1, 1]) != [[0; 3]]);
        assert!(window.is_open(), "{size:?}: {:?}", window.closed());
    }
    close(&connection, window.id());
    assert_eq!(ended(&window), Closed::ByUser);
    // Dropping the simulation closes the window.
    let window = sim.open_window_with(cfg_on(&display.name)).unwrap();
    drop(sim);
    assert_eq!(ended(&window), Closed::WithSimulation);
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn keys() {
    let display = Display::start("1280x800");
    let mut sim = simulation();
    let window = sim.open_window_with(cfg_on(&display.name)).unwrap();
    let connection = display.connect();
    let target = Target::on(&connection, window.id());
    let viewer = sim.viewer(SnapshotRequest::default());
    let run = SteppingThread::start(sim);
    // The space bar pauses and resumes; 0 is free speed.
    for (keys, paused, speed) in [(&b" "[..], true, None), (b" ", false, None), (b"0", false, Some(Speed::Unlimited))] {
        target.press(keys);
        wait_for(&viewer, paused, speed);
    }
    // While held, the space bar pauses once: an odd number of repeats would resume. The following key marks the end of
    // the repeats.
    target.hold(b' ', 5);
    target.press(b"1");
    wait_for(&viewer, true, Some(Speed::REAL_TIME));
    target.press(b" ");
    wait_for(&viewer, false, None);
    // Steps repeat: one and four more.
    target.press(b" ");
    wait_for(&viewer, true, None);
    let steps = || viewer.newest().unwrap().run.steps;
    let before = steps();
    target.hold(b'.', 4);
    wait::until("five steps", || steps() == before + 5);
    target.press(b"0 ");
    wait_for(&viewer, false, Some(Speed::Unlimited));
    drop(viewer);
    drop(run.end());
    assert_eq!(ended(&window), Closed::WithSimulation);
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn images() {
    let mut display = Display::start("640x480");
    let connection = display.connect();
    let open = |title: &str| {
        let cfg = ImageWindowCfg { title: title.into(), size: [40, 30], display: Some(display.name.clone()) };
        ImageWindow::open(cfg).unwrap()
    };
    let shown = || screenshot(&connection, [0, 0], [40, 30]);
    let filled = |color: [u8; 3]| {
        let mut image = Canvas::new(40, 30);
        image.fill([0, 0], [40, 30], color, 255);
        image.set(3, 2, [250, 251, 252]);
        image
    };
    let images = open("images");
    for color in [[200, 10, 20], [10, 200, 20]] {
        let image = filled(color);
        images.show(image.clone());
        wait::until("the image is on the screen", || shown() == pixels(&image));
    }
    // A larger window scales the image up.
    Target::on(&connection, images.window().id()).resize([80, 60]);
    wait::until("the image is scaled", || screenshot(&connection, [6, 4], [2, 2]) == [[250, 251, 252]; 4]);
    close(&connection, images.window().id());
    assert_eq!(ended(images.window()), Closed::ByUser);
    // The program continues: an image for a closed window is dropped.
    images.show(filled([1, 2, 3]));
    // Dropping the value closes the window.
    let images = open("dropped");
    let window = images.window().clone();
    drop(images);
    assert_eq!(ended(&window), Closed::ByUser);
    let images = open("lost");
    display.server.kill().unwrap();
    wait::until("the end of the display", || {
        images.show(filled([9, 9, 9]));
        !images.window().is_open()
    });
    assert!(matches!(images.window().closed(), Some(Closed::DisplayLost(_))), "{:?}", images.window().closed());
}

/// Opens a window on `display`, pauses the simulation with it, and steps on a thread.
fn paused(display: &Display, mut sim: SimulationManager) -> (Window, Viewer, SteppingThread) {
    let window = sim.open_window_with(cfg_on(&display.name)).unwrap();
    let viewer = sim.viewer(SnapshotRequest::default());
    // The connection stays open until the command has run: a server drops the events of clients that have disconnected.
    let connection = display.connect();
    Target::on(&connection, window.id()).press(b" ");
    let run = SteppingThread::start(sim);
    wait_for(&viewer, true, None);
    (window, viewer, run)
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn lost_display() {
    let mut display = Display::start("1280x800");
    // The display freezes while the window holds the simulation paused: the simulation continues. A second window
    // cannot open.
    let (window, viewer, run) = paused(&display, simulation());
    let held = run.steps();
    std::thread::sleep(Duration::from_millis(300));
    assert!(run.steps() <= held + 1, "it is held");
    display.signal("STOP");
    let cfg = cfg_on(&display.name);
    let other = std::thread::spawn(move || simulation().open_window_with(cfg).unwrap_err());
    // Snapshots of a paused simulation are published when a viewer changes its requests; then an image is due.
    while window.is_open() {
        viewer.set_request(SnapshotRequest { markers: run.steps().is_multiple_of(2), ..SnapshotRequest::default() });
        viewer.send(Command::SetSpeed(Speed::REAL_TIME));
        std::thread::sleep(Duration::from_millis(5));
    }
    let Closed::DisplayLost(reason) = ended(&window) else { panic!("{:?}", window.closed()) };
    assert!(reason.contains("not answered for 15 s"), "{reason}");
    run.wait_for_steps_beyond(held + 10);
    let error = other.join().unwrap().to_string();
    assert!(error.contains("not answered for 15 s"), "{error}");
    display.signal("CONT");
    drop(viewer);

    // The display is lost while the window holds the simulation paused: the simulation continues.
    let (window, viewer, run) = paused(&display, run.end());
    drop(viewer);
    display.server.kill().unwrap();
    assert!(matches!(ended(&window), Closed::DisplayLost(_)), "{:?}", window.closed());
    run.wait_for_steps_beyond(run.steps() + 10);
    let mut sim = run.end();

    // No display is available any more.
    let error = sim.open_window_with(cfg_on(&display.name)).unwrap_err();
    assert!(matches!(error, WindowError::NoDisplay { .. }));
    let text = error.to_string();
    assert!(["DISPLAY", "WAYLAND_DISPLAY", "--headless"].iter().all(|word| text.contains(word)), "{text}");
    sim.update(10);
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn leaks() {
    let display = Display::start("1280x800");
    process::assert_passes(module_path!(), "leaks_scenario", &[("DISPLAY", &display.name)]);
}

/// Repeated opening and closing leaks no thread and no file. It runs in its own process, because it counts them.
#[test]
#[ignore = "runs in a process of its own"]
fn leaks_scenario() {
    if !process::is_child() {
        return;
    }
    let mut sim = simulation();
    let mut open_and_close = || {
        let window = sim.open_window_with(cfg_on(&std::env::var("DISPLAY").unwrap())).unwrap();
        let open = threads_and_files();
        sim.update(1);
        window.close();
        assert_eq!(ended(&window), Closed::ByUser);
        open
    };
    // The first window starts threads that the simulation keeps.
    open_and_close();
    std::thread::sleep(Duration::from_secs(1));
    let before = threads_and_files();
    let open = open_and_close();
    assert!((0..2).all(|k| open[k] > before[k]), "a window has a thread and a connection");
    for _ in 1..20 {
        open_and_close();
    }
    let more = || threads_and_files().iter().zip(before).any(|(now, then)| *now > then);
    wait::until("threads and files of windows end", || !more());
}

/// Starts a proxy in front of an X server that counts the bytes sent by programs. Returns its display name and the
/// count.
fn counting_wire(display: &Display) -> (String, Arc<AtomicUsize>) {
    /// Copies until one end is closed. The other end is closed when its last half is dropped.
    fn pass_on(mut from: impl Read, mut to: impl Write, count: &AtomicUsize) {
        let mut chunk = vec![0; 1 << 16];
        while let Ok(n) = from.read(&mut chunk) {
            if n == 0 || to.write_all(&chunk[..n]).is_err() {
                break;
            }
            count.fetch_add(n, Ordering::SeqCst);
        }
    }
    let server = format!("/tmp/.X11-unix/X{}", display.name.trim_start_matches(':'));
    // Display n is at port 6000 + n.
    let bind = |n: u16| Some((n, TcpListener::bind(("127.0.0.1", 6000 + n)).ok()?));
    let (number, listener) = (100..1000).find_map(bind).unwrap();
    let sent = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&sent);
    std::thread::spawn(move || {
        for program in listener.incoming() {
            let (program, server) = (program.unwrap(), UnixStream::connect(&server).unwrap());
            let (answers, to_program) = (server.try_clone().unwrap(), program.try_clone().unwrap());
            let count = Arc::clone(&count);
            std::thread::spawn(move || pass_on(program, server, &count));
            std::thread::spawn(move || pass_on(answers, to_program, &AtomicUsize::new(0)));
        }
    });
    (format!("127.0.0.1:{number}"), sent)
}

/// For a window larger than any screen, a coarse image is sent to the X server, which enlarges it.
#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn huge() {
    // Larger than the center of the window.
    let display = Display::start("5400x4200");
    let (name, sent) = counting_wire(&display);
    // Returns the number of sent bytes, once it stops growing.
    let settled = || {
        let (mut last, mut since) = (sent.load(Ordering::SeqCst), Instant::now());
        while since.elapsed() < Duration::from_millis(700) {
            std::thread::sleep(Duration::from_millis(10));
            let now = sent.load(Ordering::SeqCst);
            if now != last {
                (last, since) = (now, Instant::now());
            }
        }
        last
    };
    let mut sim = simulation();
    let window = sim.open_window_with(cfg_on(&name)).unwrap();
    let connection = display.connect();
    let target = Target::on(&connection, window.id());
    let is_drawn = |[x, y]: [usize; 2]| screenshot(&connection, [x - 1, y - 1], [1, 1]) != [[0; 3]];
    // The simulation does not step, so an image is sent only after a key press. It has four bytes per pixel, plus the
    // request header.
    let assert_sent = |[width, height]: [usize; 2], request: usize| {
        let (before, own) = (settled(), 4 * width * height);
        target.press(b"h");
        wait::until("an image", || {
            assert!(window.is_open(), "{:?}", window.closed());
            sent.load(Ordering::SeqCst) > before
        });
        let bytes = settled() - before;
        assert!((own..own + request).contains(&bytes), "{bytes} for {own}");
    };
    wait::until("it is drawn", || is_drawn(SIZE));
    assert_sent(SIZE, 4096);
    target.resize([9000, 7000]);
    wait::until("it is drawn at its new size", || is_drawn([5400, 4200]));
    // At most 1920 x 1200 pixels are rendered: of 9000 x 7000, every sixth pixel along each side.
    let coarse = [1500, 1167];
    assert_sent(coarse, 8192);
    // The display shows that image with each pixel repeated 6 by 6 times, around the leftmost cube.
    let mut app = App::new(coarse, 2);
    let snapshot = sim.viewer(SnapshotRequest::default()).newest().unwrap();
    // The view is that of the window's first size.
    app.set_camera(OrbitCamera::overview(&snapshot, SIZE));
    app.set_snapshot(snapshot);
    let expected = drawn(&mut app);
    let red = (0..expected.len()).filter(|&k| is_red(&expected[k])).map(|k| [k % coarse[0], k / coarse[0]]);
    let cube = red.min_by_key(|place| place[0]).unwrap();
    let size = [800, 600];
    let corner = [0, 1].map(|k| (6 * cube[k]).saturating_sub(301 + k).min([5400, 4200][k] - size[k] - 1));
    let place = |k: usize| [corner[0] + k % size[0], corner[1] + k / size[0]];
    let enlarged: Vec<_> =
        (0..size[0] * size[1]).map(place).map(|[x, y]| expected[y / 6 * coarse[0] + x / 6]).collect();
    wait::until("the display shows it", || screenshot(&connection, corner, size) == enlarged);
    let red = enlarged.iter().filter(|p| is_red(p)).count();
    assert!(red > 36 * 200, "cubes are in it: {red}");
    // Control: one pixel beside, the image differs.
    assert!(screenshot(&connection, [corner[0] + 1, corner[1]], size) != enlarged);
    window.close();
    ended(&window);
}
