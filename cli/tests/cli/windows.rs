//! Windows of the command on an X server without a screen.

pub(crate) use testkit::x_server::Display;

use std::collections::BTreeSet;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{AtomEnum, ClientMessageEvent, ConnectionExt as _, EventMask, ImageFormat, Window};
use x11rb::rust_connection::RustConnection;

/// The window whose title contains this.
pub(crate) fn window_of(connection: &RustConnection, title: &str) -> Option<Window> {
    let root = connection.setup().roots[0].root;
    let children = connection.query_tree(root).unwrap().reply().unwrap().children;
    children.into_iter().find(|window| {
        let name = connection.get_property(false, *window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, 1000).unwrap().reply();
        name.is_ok_and(|name| String::from_utf8_lossy(&name.value).contains(title))
    })
}

/// How many colours the upper left of the display has.
pub(crate) fn colors(connection: &RustConnection) -> usize {
    screenshot(connection).into_iter().collect::<BTreeSet<_>>().len()
}

/// Size of windows, and of what is looked at.
pub(crate) const SIZE: [usize; 2] = [960, 540];

/// The upper left of the display: red, green and blue, row by row.
pub(crate) fn screenshot(connection: &RustConnection) -> Vec<[u8; 3]> {
    let (root, [width, height]) = (connection.setup().roots[0].root, SIZE.map(|n| n as u16));
    let image = connection.get_image(ImageFormat::Z_PIXMAP, root, 0, 0, width, height, !0).unwrap().reply().unwrap();
    // Xvfb's pixels of 24 bits: blue, green, red, nothing.
    image.data.chunks_exact(4).map(|p| [p[2], p[1], p[0]]).collect()
}

/// Closes a window as window managers do it.
pub(crate) fn close(connection: &RustConnection, window: Window) {
    let atom = |name: &[u8]| connection.intern_atom(false, name).unwrap().reply().unwrap().atom;
    let data = [atom(b"WM_DELETE_WINDOW"), 0, 0, 0, 0];
    let event = ClientMessageEvent::new(32, window, atom(b"WM_PROTOCOLS"), data);
    connection.send_event(false, window, EventMask::NO_EVENT, event).unwrap();
    connection.flush().unwrap();
}
