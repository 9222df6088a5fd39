//! Input events that a test sends to a window on an X server.

use crate::window::WindowCfg;
use kinetoscope_scene::Pose;
use kinetoscope_sim::{ObjectShape, RigidObjectCfg, SimulationManager, SimulationManagerCfg};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ConfigureWindowAux, ConnectionExt as _, EventMask, KEY_PRESS_EVENT,
    KEY_RELEASE_EVENT, KeyPressEvent,
};
use x11rb::rust_connection::RustConnection;

pub(super) const SIZE: [usize; 2] = [480, 270];

/// Settings of a small window on a display.
pub(super) fn cfg_on(display: &str) -> WindowCfg {
    WindowCfg { size: SIZE, display: Some(display.into()), threads: Some(1), ..WindowCfg::default() }
}

/// Builds two environments with a red cube.
pub(super) fn simulation() -> SimulationManager {
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

/// A window, as seen by another X client.
pub(super) struct Target<'a> {
    pub(super) connection: &'a RustConnection,
    pub(super) window: u32,
}

impl<'a> Target<'a> {
    pub(super) fn on(connection: &'a RustConnection, window: u32) -> Self {
        Self { connection, window }
    }

    /// Sends a key or mouse event: kind, key code or button, time stamp \[ms\], position.
    pub(super) fn send(&self, kind: u8, detail: u8, time: u32, [x, y]: [i16; 2]) {
        let mask = match kind {
            KEY_PRESS_EVENT => EventMask::KEY_PRESS,
            KEY_RELEASE_EVENT => EventMask::KEY_RELEASE,
            BUTTON_PRESS_EVENT => EventMask::BUTTON_PRESS,
            BUTTON_RELEASE_EVENT => EventMask::BUTTON_RELEASE,
            _ => EventMask::POINTER_MOTION,
        };
        // Key, button and motion events have the same fields.
        let event = KeyPressEvent {
            response_type: kind,
            detail,
            sequence: 0,
            time,
            root: self.connection.setup().roots[0].root,
            event: self.window,
            child: 0,
            root_x: x,
            root_y: y,
            event_x: x,
            event_y: y,
            state: Default::default(),
            same_screen: true,
        };
        self.connection.send_event(false, self.window, mask, event).unwrap();
        self.connection.flush().unwrap();
    }

    /// Returns the key code of a keysym.
    fn code(&self, sign: u8) -> u8 {
        let (first, last) = (self.connection.setup().min_keycode, self.connection.setup().max_keycode);
        let mapping = self.connection.get_keyboard_mapping(first, last - first + 1).unwrap().reply().unwrap();
        let each = usize::from(mapping.keysyms_per_keycode);
        first + mapping.keysyms.chunks(each).position(|signs| signs[0] == u32::from(sign)).unwrap() as u8
    }

    /// Presses keys without releasing them.
    pub(super) fn press(&self, signs: &[u8]) {
        signs.iter().for_each(|sign| self.send(KEY_PRESS_EVENT, self.code(*sign), 0, [0, 0]));
    }

    /// Holds a key down for some repeats. For each, an X server sends a release and a press with the same time stamp.
    pub(super) fn hold(&self, sign: u8, repeats: u32) {
        let key = self.code(sign);
        self.send(KEY_PRESS_EVENT, key, 1000, [0, 0]);
        for time in (1..=repeats).map(|k| 1000 + 40 * k) {
            self.send(KEY_RELEASE_EVENT, key, time, [0, 0]);
            self.send(KEY_PRESS_EVENT, key, time, [0, 0]);
        }
        self.send(KEY_RELEASE_EVENT, key, 2000 + 40 * repeats, [0, 0]);
    }

    /// Resizes the window.
    pub(super) fn resize(&self, [width, height]: [u32; 2]) {
        let aux = ConfigureWindowAux::new().width(width).height(height);
        self.connection.configure_window(self.window, &aux).unwrap();
        self.connection.flush().unwrap();
    }
}

pub(super) fn is_red(p: &[u8; 3]) -> bool {
    p[0] > 90 && p[1] < p[0] / 2
}
