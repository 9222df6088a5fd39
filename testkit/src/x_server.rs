//! An X server without a screen (Xvfb).

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{ClientMessageEvent, ConnectionExt as _, EventMask, ImageFormat};
use x11rb::rust_connection::RustConnection;

/// An X server without a screen. Dropping it ends the server.
#[derive(Debug)]
pub struct Display {
    /// Process of the server.
    pub server: Child,
    /// Name that clients connect to, for example `:1`.
    pub name: String,
}

impl Display {
    /// Starts a server with a screen of this size, for example `800x600`.
    pub fn start(screen: &str) -> Self {
        let screen = format!("{screen}x24");
        let command = ["-displayfd", "1", "-screen", "0", &screen, "-nolisten", "tcp", "-noreset"];
        let started = Command::new("Xvfb").args(command).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut server = started.expect("Xvfb: apt-get install xvfb, or `cargo xtask test`");
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Self { server, name: format!(":{}", number.trim()) }
    }

    /// Sends a signal to the server, by the name of the signal.
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill").args(["-s", name, &self.server.id().to_string()]).status().unwrap();
        assert!(sent.success(), "{name}");
    }

    /// Connects a client.
    pub fn connect(&self) -> RustConnection {
        x11rb::connect(Some(&self.name)).unwrap().0
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// Pixels of a rectangle of the screen, row by row: red, green and blue.
pub fn screenshot(connection: &RustConnection, corner: [usize; 2], size: [usize; 2]) -> Vec<[u8; 3]> {
    let root = connection.setup().roots[0].root;
    let ([x, y], [width, height]) = (corner.map(|n| n as i16), size.map(|n| n as u16));
    let image = connection.get_image(ImageFormat::Z_PIXMAP, root, x, y, width, height, !0).unwrap();
    // Pixels of 24 bits in four bytes: blue, green, red, unused.
    image.reply().unwrap().data.chunks_exact(4).map(|p| [p[2], p[1], p[0]]).collect()
}

/// Closes a window as a window manager does.
pub fn close(connection: &RustConnection, window: u32) {
    let atom = |name: &[u8]| connection.intern_atom(false, name).unwrap().reply().unwrap().atom;
    let data = [atom(b"WM_DELETE_WINDOW"), 0, 0, 0, 0];
    let event = ClientMessageEvent::new(32, window, atom(b"WM_PROTOCOLS"), data);
    connection.send_event(false, window, EventMask::NO_EVENT, event).unwrap();
    connection.flush().unwrap();
}
