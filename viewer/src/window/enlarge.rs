//! Pictures that the X server enlarges: for a huge window a coarse picture is sent, by the extension RENDER.

use super::x11::Failure;
use x11rb::connection::{Connection, RequestConnection as _};
use x11rb::protocol::render::{
    ConnectionExt as _, CreatePictureAux, PictOp, Pictformat, Picture, Repeat, Transform, X11_EXTENSION_NAME,
};
use x11rb::protocol::xproto::{ConnectionExt as _, Pixmap, Visualid, Window};
use x11rb::rust_connection::RustConnection;

/// 1 in numbers of 16 bits before the point and 16 behind it.
const ONE: i32 = 1 << 16;

/// A picture on the server that a window shows enlarged.
#[derive(Debug)]
pub(super) struct Enlarged {
    pixmap: Pixmap,
    source: Picture,
    target: Picture,
    /// Of the picture \[pixels\].
    pub(super) size: [usize; 2],
    /// Pixels of the window for each, along each side.
    pub(super) factor: usize,
}

/// How the server calls the pixels of a visual; `None` where it enlarges nothing.
pub(super) fn format(connection: &RustConnection, visual: Visualid) -> Result<Option<Pictformat>, Failure> {
    if connection.extension_information(X11_EXTENSION_NAME)?.is_none() {
        return Ok(None);
    }
    // Transforms came with 0.6.
    let version = connection.render_query_version(0, 11)?.reply()?;
    if (version.major_version, version.minor_version) < (0, 6) {
        return Ok(None);
    }
    let formats = connection.render_query_pict_formats()?.reply()?;
    let visuals = formats.screens.iter().flat_map(|screen| &screen.depths).flat_map(|depth| &depth.visuals);
    Ok(visuals.filter(|known| known.visual == visual).map(|known| known.format).next())
}

impl Enlarged {
    /// A picture of `size` for a window with pixels of this depth and format.
    pub(super) fn new(
        connection: &RustConnection,
        window: Window,
        depth: u8,
        format: Pictformat,
        size: [usize; 2],
        factor: usize,
    ) -> Result<Self, Failure> {
        let [width, height] = size.map(|n| u16::try_from(n).unwrap_or(u16::MAX));
        let [pixmap, source, target] =
            [connection.generate_id()?, connection.generate_id()?, connection.generate_id()?];
        connection.create_pixmap(depth, pixmap, window, width, height)?;
        // Beyond its edge its last pixels are seen, where the window is not a multiple of it.
        let repeat = CreatePictureAux::new().repeat(Repeat::PAD);
        connection.render_create_picture(source, pixmap, format, &repeat)?;
        connection.render_create_picture(target, window, format, &CreatePictureAux::new())?;
        // From pixels of the window to those of the picture.
        let scale = ONE / i32::try_from(factor.max(1)).unwrap_or(i32::MAX);
        let transform = Transform { matrix11: scale, matrix22: scale, matrix33: ONE, ..Transform::default() };
        connection.render_set_picture_transform(source, transform)?;
        connection.render_set_picture_filter(source, b"nearest", &[])?;
        Ok(Self { pixmap, source, target, size, factor })
    }

    /// Where the picture is drawn.
    pub(super) fn pixmap(&self) -> Pixmap {
        self.pixmap
    }

    /// Shows it over the whole window.
    pub(super) fn show(&self, connection: &RustConnection, window: [usize; 2]) -> Result<(), Failure> {
        let [width, height] = window.map(|n| u16::try_from(n).unwrap_or(u16::MAX));
        let (op, mask) = (PictOp::SRC, x11rb::NONE);
        connection.render_composite(op, self.source, mask, self.target, 0, 0, 0, 0, 0, 0, width, height)?;
        Ok(())
    }

    /// Gives the server's memory back.
    pub(super) fn free(self, connection: &RustConnection) -> Result<(), Failure> {
        connection.render_free_picture(self.source)?;
        connection.render_free_picture(self.target)?;
        connection.free_pixmap(self.pixmap)?;
        Ok(())
    }
}
