//! A window that is larger than any screen: a coarse picture of it travels to the X server, which enlarges it.

use super::display::{Display, LONG, SIZE, cfg_on, pixels, press, screenshot_of, simulation, until};
use std::io::{Read, Write};
use std::net::TcpListener;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use view::window::App;
use view::{Canvas, OpenWindow, Viewing, Wants, WindowCfg};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{ConfigureWindowAux, ConnectionExt as _};

/// An address before that of an X server, which passes everything on and counts what programs send.
struct Wire {
    name: String,
    sent: Arc<AtomicUsize>,
}

impl Wire {
    fn to(display: &Display) -> Self {
        let server = format!("/tmp/.X11-unix/X{}", display.name.trim_start_matches(':'));
        // Display n is at port 6000 + n.
        let (number, listener) =
            (100..1000).find_map(|n| Some((n, TcpListener::bind(("127.0.0.1", 6000 + n)).ok()?))).unwrap();
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
        Self { name: format!("127.0.0.1:{number}"), sent }
    }

    /// Bytes that were sent, when no more come.
    fn settled(&self) -> usize {
        let (mut last, mut since) = (self.sent.load(Ordering::SeqCst), Instant::now());
        while since.elapsed() < Duration::from_millis(700) {
            std::thread::sleep(Duration::from_millis(10));
            let now = self.sent.load(Ordering::SeqCst);
            if now != last {
                (last, since) = (now, Instant::now());
            }
        }
        last
    }
}

/// Until one end is closed; the other is closed when its last half is dropped.
fn pass_on(mut from: impl Read, mut to: impl Write, count: &AtomicUsize) {
    let mut chunk = vec![0; 1 << 16];
    while let Ok(n) = from.read(&mut chunk) {
        if n == 0 || to.write_all(&chunk[..n]).is_err() {
            break;
        }
        count.fetch_add(n, Ordering::SeqCst);
    }
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn of_a_huge_window_a_small_picture_is_sent_and_the_server_enlarges_it() {
    // Larger than the middle of the window.
    let display = Display::start("5400x4200");
    let wire = Wire::to(&display);
    let mut sim = simulation();
    let window = sim.open_window_with(WindowCfg { display: Some(wire.name.clone()), ..cfg_on(&display) }).unwrap();
    let connection = display.connect();
    let last_pixel = |[x, y]: [usize; 2]| screenshot_of(&connection, [x - 1, y - 1], [1, 1])[0];
    // Nothing steps: a picture is sent when a key asks for another one, and only then.
    let bytes_of_a_picture = || {
        let before = wire.settled();
        press(&connection, window.number(), u32::from('h'));
        until("a picture", || {
            assert!(window.is_open(), "{:?}", window.closed());
            wire.sent.load(Ordering::SeqCst) > before
        });
        wire.settled() - before
    };
    until("it is drawn", || last_pixel(SIZE) != [0; 3]);
    // Four bytes for each pixel, and some for the request.
    let (bytes, own) = (bytes_of_a_picture(), 4 * SIZE[0] * SIZE[1]);
    assert!((own..own + 4096).contains(&bytes), "{bytes} for {own}");
    let huge = ConfigureWindowAux::new().width(9000).height(7000);
    connection.configure_window(window.number(), &huge).unwrap();
    connection.flush().unwrap();
    until("it is drawn at its new size", || last_pixel([5400, 4200]) != [0; 3]);
    // 1920 x 1200 pixels are the most that are drawn: of 9000 x 7000 every sixth, along each side.
    let (bytes, coarse) = (bytes_of_a_picture(), [1500, 1167]);
    let own = 4 * coarse[0] * coarse[1];
    assert!((own..own + 8192).contains(&bytes), "{bytes} for {own}, of {}", 4 * 9000 * 7000);
    // What is on the display is that picture, each pixel 6 by 6 times: around the cube that is most to the left.
    let mut expected = Canvas::default();
    let mut app = App::new(coarse, 2);
    app.show(sim.viewer(Wants::default()).newest().unwrap());
    app.draw(&mut expected, Instant::now());
    let expected = pixels(&expected);
    let is_red = |p: &[u8; 3]| p[0] > 90 && p[1] < p[0] / 2;
    let red = || (0..expected.len()).filter(|&k| is_red(&expected[k])).map(|k| [k % coarse[0], k / coarse[0]]);
    let cube = red().min_by_key(|place| place[0]).unwrap();
    let (corner, size) = ([6 * cube[0] - 301, 6 * cube[1] - 302], [800, 600]);
    let enlarged: Vec<[u8; 3]> = (0..size[0] * size[1])
        .map(|k| {
            let [x, y] = [corner[0] + k % size[0], corner[1] + k / size[0]];
            expected[y / 6 * coarse[0] + x / 6]
        })
        .collect();
    until("the display shows it", || screenshot_of(&connection, corner, size) == enlarged);
    let red = enlarged.iter().filter(|p| is_red(p)).count();
    assert!(red > 36 * 200, "cubes are in it: {red}");
    // The control: a pixel beside it the picture is another one.
    assert_ne!(screenshot_of(&connection, [corner[0] + 1, corner[1]], size), enlarged);
    window.close();
    assert!(window.wait(LONG).is_some());
}
