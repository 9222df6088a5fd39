//! Upscaling by the X server: a huge window is sent a coarse image, which the RENDER extension enlarges.

use super::x11::DisplayError;
use x11rb::connection::{Connection, RequestConnection as _};
use x11rb::protocol::render::{
    ConnectionExt as _, CreatePictureAux, PictOp, Pictformat, Picture, Repeat, Transform, X11_EXTENSION_NAME,
};
use x11rb::protocol::xproto::{ConnectionExt as _, Pixmap, Visualid, Window};
use x11rb::rust_connection::RustConnection;

/// The number 1 in 16.16 fixed point.
const ONE: i32 = 1 << 16;

/// A server-side image that is shown enlarged in a window.
#[derive(Debug)]
pub(super) struct ScaledImage {
    pixmap: Pixmap,
    source: Picture,
    target: Picture,
    /// Size of the server-side image \[pixels\].
    pub(super) size: [usize; 2],
    /// Window pixels per image pixel, along each side.
    pub(super) factor: usize,
}

/// Returns the RENDER format of a visual, or `None` if the server cannot scale images of it.
pub(super) fn render_format(connection: &RustConnection, visual: Visualid) -> Result<Option<Pictformat>, DisplayError> {
    if connection.extension_information(X11_EXTENSION_NAME)?.is_none() {
        return Ok(None);
    }
    // RENDER supports transforms since version 0.6.
    let version = connection.render_query_version(0, 11)?.reply()?;
    if (version.major_version, version.minor_version) < (0, 6) {
        return Ok(None);
    }
    let formats = connection.render_query_pict_formats()?.reply()?;
    let visuals = formats.screens.iter().flat_map(|screen| &screen.depths).flat_map(|depth| &depth.visuals);
    Ok(visuals.filter(|known| known.visual == visual).map(|known| known.format).next())
}

impl ScaledImage {
    /// Creates an image of `size` pixels on the server, for a window of this depth and format.
    pub(super) fn new(
        connection: &RustConnection,
        window: Window,
        depth: u8,
        format: Pictformat,
        size: [usize; 2],
        factor: usize,
    ) -> Result<Self, DisplayError> {
        let [width, height] = size.map(|n| u16::try_from(n).unwrap_or(u16::MAX));
        let [pixmap, source, target] =
            [connection.generate_id()?, connection.generate_id()?, connection.generate_id()?];
        connection.create_pixmap(depth, pixmap, window, width, height)?;
        // Padding repeats the last pixels where the window size is no multiple of the factor.
        let repeat = CreatePictureAux::new().repeat(Repeat::PAD);
        connection.render_create_picture(source, pixmap, format, &repeat)?;
        connection.render_create_picture(target, window, format, &CreatePictureAux::new())?;
        // Maps window pixels to image pixels.
        let scale = ONE / i32::try_from(factor.max(1)).unwrap_or(i32::MAX);
        let transform = Transform { matrix11: scale, matrix22: scale, matrix33: ONE, ..Transform::default() };
        connection.render_set_picture_transform(source, transform)?;
        connection.render_set_picture_filter(source, b"nearest", &[])?;
        Ok(Self { pixmap, source, target, size, factor })
    }

    /// Returns the pixmap that the image is sent to.
    pub(super) fn pixmap(&self) -> Pixmap {
        self.pixmap
    }

    /// Shows the image in the window of size \[width, height\], enlarged by `factor`. Its last pixels fill the
    /// remainder.
    pub(super) fn show(&self, connection: &RustConnection, window: [usize; 2]) -> Result<(), DisplayError> {
        let [width, height] = window.map(|n| u16::try_from(n).unwrap_or(u16::MAX));
        let (op, mask) = (PictOp::SRC, x11rb::NONE);
        connection.render_composite(op, self.source, mask, self.target, 0, 0, 0, 0, 0, 0, width, height)?;
        Ok(())
    }

    /// Frees the resources on the server.
    pub(super) fn free(self, connection: &RustConnection) -> Result<(), DisplayError> {
        connection.render_free_picture(self.source)?;
        connection.render_free_picture(self.target)?;
        connection.free_pixmap(self.pixmap)?;
        Ok(())
    }
}
