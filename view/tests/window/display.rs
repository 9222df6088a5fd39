//! A real X server without a screen (Xvfb), and what is to be seen on it.

pub(crate) use testkit::x_server::Display;

use scene::Pose;
use sim::{ObjectShape, RigidObjectCfg, SimulationManager, SimulationManagerCfg};
use std::time::{Duration, Instant};
use view::{Canvas, WindowCfg};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ConnectionExt as _, EventMask, ImageFormat, KEY_PRESS_EVENT,
    KEY_RELEASE_EVENT, KeyButMask, KeyPressEvent,
};
use x11rb::rust_connection::RustConnection;

/// What is not there by then does not come.
pub(crate) const LONG: Duration = Duration::from_secs(30);
pub(crate) const SIZE: [usize; 2] = [480, 270];

/// A small window on a display.
pub(crate) fn cfg_on(display: &Display) -> WindowCfg {
    WindowCfg { size: SIZE, display: Some(display.name.clone()), threads: Some(1), ..WindowCfg::default() }
}

pub(crate) fn simulation() -> SimulationManager {
    let cfg = SimulationManagerCfg { num_envs: 2, physics_dt: 0.01, threads: Some(1), ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    sim.add_rigid_object(RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(0.4),
        init_pose: Pose::translation(0.0, 0.0, 0.2),
        rgba: [0.8, 0.1, 0.1, 1.0],
        ..Default::default()
    })
    .unwrap();
    sim
}

/// The upper left of the whole display, as red, green and blue.
pub(crate) fn screenshot(connection: &RustConnection, size: [usize; 2]) -> Vec<[u8; 3]> {
    screenshot_of(connection, [0, 0], size)
}

/// A part of the whole display.
pub(crate) fn screenshot_of(connection: &RustConnection, corner: [usize; 2], size: [usize; 2]) -> Vec<[u8; 3]> {
    let root = connection.setup().roots[0].root;
    let ([x, y], [width, height]) = (corner.map(|n| n as i16), size.map(|n| n as u16));
    let image = connection.get_image(ImageFormat::Z_PIXMAP, root, x, y, width, height, !0).unwrap();
    // Xvfb's pixels of 24 bits: blue, green, red, nothing.
    image.reply().unwrap().data.chunks_exact(4).map(|p| [p[2], p[1], p[0]]).collect()
}

pub(crate) fn pixels(canvas: &Canvas) -> Vec<[u8; 3]> {
    canvas.bytes().chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect()
}

pub(crate) fn until(what: &str, mut is: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is() {
        assert!(start.elapsed() < LONG, "never: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The code of a key by its sign.
pub(crate) fn code(connection: &RustConnection, sign: u32) -> u8 {
    let (first, last) = (connection.setup().min_keycode, connection.setup().max_keycode);
    let mapping = connection.get_keyboard_mapping(first, last - first + 1).unwrap().reply().unwrap();
    let each = usize::from(mapping.keysyms_per_keycode);
    let place = mapping.keysyms.chunks(each).position(|signs| signs[0] == sign).unwrap();
    first + place as u8
}

pub(crate) fn press(connection: &RustConnection, window: u32, sign: u32) {
    let key = code(connection, sign);
    send(connection, window, (KEY_PRESS_EVENT, key), 0, [0, 0]);
}

/// Sends an event of a key or a button of the mouse to a window: what it is, the key or button, when \[ms\], where.
pub(crate) fn send(connection: &RustConnection, window: u32, (kind, detail): (u8, u8), time: u32, [x, y]: [i16; 2]) {
    // Events of keys, buttons and the mouse have the same fields.
    let mask = match kind {
        KEY_PRESS_EVENT => EventMask::KEY_PRESS,
        KEY_RELEASE_EVENT => EventMask::KEY_RELEASE,
        BUTTON_PRESS_EVENT => EventMask::BUTTON_PRESS,
        BUTTON_RELEASE_EVENT => EventMask::BUTTON_RELEASE,
        _ => EventMask::POINTER_MOTION,
    };
    let event = KeyPressEvent {
        response_type: kind,
        detail,
        sequence: 0,
        time,
        root: connection.setup().roots[0].root,
        event: window,
        child: 0,
        root_x: x,
        root_y: y,
        event_x: x,
        event_y: y,
        state: KeyButMask::default(),
        same_screen: true,
    };
    connection.send_event(false, window, mask, event).unwrap();
    connection.flush().unwrap();
}

/// Holds a key down for as long as it takes to repeat some times, as an X server says it: released and pressed at one moment.
pub(crate) fn hold(connection: &RustConnection, window: u32, sign: u32, repeats: u32) {
    let key = code(connection, sign);
    send(connection, window, (KEY_PRESS_EVENT, key), 1000, [0, 0]);
    for time in (1..=repeats).map(|k| 1000 + 40 * k) {
        send(connection, window, (KEY_RELEASE_EVENT, key), time, [0, 0]);
        send(connection, window, (KEY_PRESS_EVENT, key), time, [0, 0]);
    }
    send(connection, window, (KEY_RELEASE_EVENT, key), 2000 + 40 * repeats, [0, 0]);
}
