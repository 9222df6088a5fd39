//! A window on an X server, through the X11 protocol without C libraries. A lost connection is an error, and does not
//! end the program.

use super::app::{Input, Modifiers};
use super::key_bindings::Key;
use super::server_scaling::{self, ScaledImage};
use super::watchdog::{TIMEOUT, Watchdog};
use crate::scene_view::Canvas;
use kinetoscope_render::View;
use std::os::fd::AsFd as _;
use x11rb::connection::{Connection, RequestConnection as _};
use x11rb::errors::{ConnectionError, ReplyError, ReplyOrIdError};
use x11rb::protocol::Event;
use x11rb::protocol::render::Pictformat;
use x11rb::protocol::xproto::{
    AtomEnum, ConnectionExt as _, CreateGCAux, CreateWindowAux, Drawable, EventMask, ImageFormat, ImageOrder,
    KeyButMask, KeyPressEvent, KeyReleaseEvent, PropMode, Screen, Window, WindowClass,
};
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

x11rb::atom_manager! {
    Atoms: AtomsCookie {
        WM_PROTOCOLS,
        WM_DELETE_WINDOW,
        _NET_WM_NAME,
        UTF8_STRING,
    }
}

/// An open window, with its keyboard mapping and its frame buffers.
#[derive(Debug)]
pub(super) struct XWindow {
    watch: Watchdog,
    connection: RustConnection,
    window: Window,
    gc: u32,
    atoms: Atoms,
    depth: u8,
    /// Bit position of red, green and blue in a pixel.
    shifts: [u32; 3],
    most_significant_first: bool,
    size: [usize; 2],
    keys: KeyboardMap,
    /// Last key release, held back until the next event shows if the key repeats.
    released: Option<KeyReleaseEvent>,
    /// Pixels in the server's format.
    pixels: Vec<u8>,
    /// RENDER format of the window; `None` if the server cannot scale images.
    format: Option<Pictformat>,
    /// Server-side image that is shown enlarged, while the window is huge.
    scaled_image: Option<ScaledImage>,
}

/// An event of the window.
#[derive(Debug)]
pub(super) enum WindowEvent {
    Input(Input),
    /// A part of the window was uncovered and needs a redraw.
    Exposed,
    /// The user closed the window.
    Close,
}

/// An error of the connection, or a refused request.
#[derive(Debug, thiserror::Error)]
pub(super) enum DisplayError {
    #[error("{0}")]
    Connect(#[from] x11rb::errors::ConnectError),
    #[error("the connection to the display was lost: {0}")]
    Lost(#[from] ConnectionError),
    #[error("the display refused a request: {0}")]
    Reply(#[from] ReplyError),
    #[error("the display refused a request: {0}")]
    Id(#[from] ReplyOrIdError),
    #[error("the display has not answered for {} s", TIMEOUT.as_secs())]
    Unresponsive,
    #[error("the connection to the display cannot be watched: {0}")]
    Watch(#[from] std::io::Error),
    #[error("the display has no 32-bit pixel format with 8 bits per color")]
    Colors,
}

/// Maximum number of rendered pixels. Larger windows are rendered at lower resolution and enlarged, because rendering
/// more pixels takes longer than a thirtieth of a second.
const MAX_PIXELS: usize = 1920 * 1200;

impl XWindow {
    /// Opens a window of about `size` pixels on a display; `None` uses the environment variable `DISPLAY`.
    pub(super) fn open(title: &str, size: [usize; 2], display: Option<&str>) -> Result<Self, DisplayError> {
        let (connection, number) = x11rb::connect(display)?;
        let watch = Watchdog::start(connection.stream().as_fd().try_clone_to_owned()?)?;
        let screen = &connection.setup().roots[number];
        let (depth, shifts) = color_layout(&connection, screen)?;
        let [width, height] = size.map(|n| u16::try_from(n.clamp(1, 16_000)).unwrap_or(u16::MAX));
        let window = connection.generate_id()?;
        let events = EventMask::EXPOSURE
            | EventMask::STRUCTURE_NOTIFY
            | EventMask::KEY_PRESS
            | EventMask::KEY_RELEASE
            | EventMask::BUTTON_PRESS
            | EventMask::BUTTON_RELEASE
            | EventMask::POINTER_MOTION
            | EventMask::FOCUS_CHANGE;
        let aux = CreateWindowAux::new().event_mask(events).background_pixel(screen.black_pixel);
        let (root, visual) = (screen.root, screen.root_visual);
        connection.create_window(
            depth,
            window,
            root,
            0,
            0,
            width,
            height,
            0,
            WindowClass::INPUT_OUTPUT,
            visual,
            &aux,
        )?;
        let atoms = Atoms::new(&connection)?.reply()?;
        let text = title.as_bytes();
        connection.change_property8(PropMode::REPLACE, window, AtomEnum::WM_NAME, AtomEnum::STRING, text)?;
        connection.change_property8(PropMode::REPLACE, window, atoms._NET_WM_NAME, atoms.UTF8_STRING, text)?;
        let class = b"kinetoscope\0Kinetoscope\0";
        connection.change_property8(PropMode::REPLACE, window, AtomEnum::WM_CLASS, AtomEnum::STRING, class)?;
        let close = [atoms.WM_DELETE_WINDOW];
        connection.change_property32(PropMode::REPLACE, window, atoms.WM_PROTOCOLS, AtomEnum::ATOM, &close)?;
        let gc = connection.generate_id()?;
        connection.create_gc(gc, window, &CreateGCAux::new().graphics_exposures(0))?;
        connection.map_window(window)?;
        let keys = KeyboardMap::of(&connection)?;
        connection.flush()?;
        let most_significant_first = connection.setup().image_byte_order == ImageOrder::MSB_FIRST;
        let size = [usize::from(width), usize::from(height)];
        let format = server_scaling::render_format(&connection, visual)?;
        let (pixels, scaled_image, released) = (Vec::new(), None, None);
        Ok(Self {
            watch,
            connection,
            window,
            gc,
            atoms,
            depth,
            shifts,
            most_significant_first,
            size,
            keys,
            released,
            pixels,
            format,
            scaled_image,
        })
    }

    /// Returns the number of window pixels per image pixel, along each side.
    fn pixel_scale(&self) -> usize {
        coarseness(self.size)
    }

    /// Returns the size of the image to render.
    pub(super) fn image_size(&self) -> [usize; 2] {
        let k = self.pixel_scale();
        self.size.map(|n| n.div_ceil(k).max(1))
    }

    /// Returns the X11 window id.
    pub(super) fn window_id(&self) -> u32 {
        self.window
    }

    /// Returns the events since the last call; the last key release may be returned by the next call.
    pub(super) fn poll(&mut self) -> Result<Vec<WindowEvent>, DisplayError> {
        self.events().map_err(|failure| self.resolve_error(failure))
    }

    /// Replaces the error by [`DisplayError::Unresponsive`] if the connection was closed because the display did not
    /// respond.
    fn resolve_error(&self, failure: DisplayError) -> DisplayError {
        if self.watch.has_timed_out() { DisplayError::Unresponsive } else { failure }
    }

    fn events(&mut self) -> Result<Vec<WindowEvent>, DisplayError> {
        let mut happened: Vec<WindowEvent> = Vec::new();
        let mut released = self.released.take();
        // True if the next event may still arrive.
        let mut is_new = false;
        while let Some(event) = self.watch.request(|| self.connection.poll_for_event())? {
            let repeats =
                matches!((&released, &event), (Some(key), Event::KeyPress(next)) if is_auto_repeat(key, next));
            if let Some(key) = released.take().filter(|_| !repeats) {
                happened.extend(self.key(key.detail, key.state).map(|key| WindowEvent::Input(Input::Release(key))));
            }
            if let Event::KeyRelease(key) = event {
                (released, is_new) = (Some(key), true);
                continue;
            }
            let next = match self.translate_event(&event) {
                Some(WindowEvent::Input(Input::Press(key))) if repeats => Some(WindowEvent::Input(Input::Repeat(key))),
                next => next,
            };
            // Of several consecutive mouse moves only the last counts.
            if let (Some(WindowEvent::Input(Input::Move(to))), Some(WindowEvent::Input(Input::Move(last)))) =
                (&next, happened.last_mut())
            {
                *last = *to;
            } else {
                happened.extend(next);
            }
        }
        match released {
            Some(key) if is_new => self.released = Some(key),
            Some(key) => {
                happened.extend(self.key(key.detail, key.state).map(|key| WindowEvent::Input(Input::Release(key))));
            }
            None => {}
        }
        Ok(happened)
    }

    fn translate_event(&mut self, event: &Event) -> Option<WindowEvent> {
        let scale = self.pixel_scale() as f64;
        let at = |x: i16, y: i16| [f64::from(x) / scale, f64::from(y) / scale];
        let held = |state: KeyButMask| Modifiers {
            shift: state.contains(KeyButMask::SHIFT),
            ctrl: state.contains(KeyButMask::CONTROL),
        };
        Some(match event {
            Event::Expose(_) => WindowEvent::Exposed,
            Event::ConfigureNotify(event) => {
                let size = [event.width, event.height].map(|n| usize::from(n).max(1));
                if size == self.size {
                    return None;
                }
                self.size = size;
                WindowEvent::Input(Input::Resize(self.image_size()))
            }
            Event::ClientMessage(event) => {
                let asks = event.format == 32 && event.data.as_data32()[0] == self.atoms.WM_DELETE_WINDOW;
                return asks.then_some(WindowEvent::Close);
            }
            Event::DestroyNotify(event) if event.window == self.window => WindowEvent::Close,
            Event::KeyPress(event) => WindowEvent::Input(Input::Press(self.key(event.detail, event.state)?)),
            Event::ButtonPress(event) => WindowEvent::Input(match event.detail {
                4 => Input::Wheel(1.0, at(event.event_x, event.event_y)),
                5 => Input::Wheel(-1.0, at(event.event_x, event.event_y)),
                button => Input::ButtonPress(button, at(event.event_x, event.event_y), held(event.state)),
            }),
            Event::ButtonRelease(event) if !(4..=7).contains(&event.detail) => {
                WindowEvent::Input(Input::ButtonRelease(event.detail, at(event.event_x, event.event_y)))
            }
            Event::MotionNotify(event) => WindowEvent::Input(Input::Move(at(event.event_x, event.event_y))),
            Event::FocusOut(_) => WindowEvent::Input(Input::FocusLost),
            _ => return None,
        })
    }

    /// Returns the key of a key code, with the modifiers in `state`.
    fn key(&self, code: u8, state: KeyButMask) -> Option<Key> {
        self.keys.get(code, state.contains(KeyButMask::SHIFT))
    }

    /// Shows an image.
    pub(super) fn present(&mut self, canvas: &Canvas) -> Result<(), DisplayError> {
        self.send(canvas).map_err(|failure| self.resolve_error(failure))
    }

    fn send(&mut self, canvas: &Canvas) -> Result<(), DisplayError> {
        let (k, image) = (self.pixel_scale(), canvas.dimensions());
        let fits = |old: &ScaledImage| k > 1 && (old.size, old.factor) == (image, k);
        if let Some(old) = self.scaled_image.take_if(|old| !fits(old)) {
            self.watch.request(|| old.free(&self.connection))?;
        }
        if let (true, None, Some(format)) = (k > 1, &self.scaled_image, self.format) {
            let enlarged =
                self.watch.request(|| ScaledImage::new(&self.connection, self.window, self.depth, format, image, k))?;
            self.scaled_image = Some(enlarged);
        }
        match self.scaled_image.take() {
            Some(enlarged) => {
                self.put_image(canvas, 1, enlarged.pixmap(), image)?;
                self.watch.request(|| enlarged.show(&self.connection, self.size))?;
                self.scaled_image = Some(enlarged);
            }
            None => self.put_image(canvas, k, self.window, self.size)?,
        }
        self.watch.request(|| self.connection.flush())?;
        Ok(())
    }

    /// Sends an image to a drawable of `size` pixels, with each pixel repeated `k` times along each side.
    fn put_image(
        &mut self,
        canvas: &Canvas,
        k: usize,
        to: Drawable,
        [width, height]: [usize; 2],
    ) -> Result<(), DisplayError> {
        let [columns, rows] = canvas.dimensions();
        let line = 4 * width;
        // Maximum payload of one request, without its header.
        let most = self.connection.maximum_request_bytes().saturating_sub(64);
        let band = (most / line).clamp(1, height);
        for top in (0..height).step_by(band) {
            let band = band.min(height - top);
            self.pixels.clear();
            for y in top..top + band {
                let row = (y / k).min(rows.saturating_sub(1));
                let from = &canvas.bytes()[4 * row * columns..4 * (row + 1) * columns];
                for x in 0..width {
                    let rgb = &from[4 * (x / k).min(columns.saturating_sub(1))..];
                    let pixel = (0..3).fold(0, |pixel, c| pixel | u32::from(rgb[c]) << self.shifts[c]);
                    let bytes = if self.most_significant_first { pixel.to_be_bytes() } else { pixel.to_le_bytes() };
                    self.pixels.extend(bytes);
                }
            }
            let [width, band] = [width, band].map(|n| u16::try_from(n).unwrap_or(u16::MAX));
            let top = i16::try_from(top).unwrap_or(i16::MAX);
            let (format, gc) = (ImageFormat::Z_PIXMAP, self.gc);
            let (depth, pixels) = (self.depth, &self.pixels);
            let put = || self.connection.put_image(format, to, gc, width, band, 0, top, 0, depth, pixels);
            self.watch.request(put)?;
        }
        Ok(())
    }
}

impl Drop for XWindow {
    fn drop(&mut self) {
        // Errors are ignored: if the connection is lost, the window is gone anyway.
        self.watch.request(|| {
            let _ = self.connection.destroy_window(self.window);
            let _ = self.connection.flush();
        });
    }
}

/// Returns the number of window pixels per image pixel, along each side, for an image of at most [`MAX_PIXELS`] pixels
/// with sides that the renderer supports.
fn coarseness(size: [usize; 2]) -> usize {
    let fits = |k: &usize| {
        let [width, height] = size.map(|n| n.div_ceil(*k));
        width * height <= MAX_PIXELS && width.max(height) <= View::MAX_SIDE
    };
    (1..).find(fits).unwrap_or(1)
}

/// True if a release and a press come from a held key: the X server sends both with the same time stamp.
fn is_auto_repeat(released: &KeyReleaseEvent, next: &KeyPressEvent) -> bool {
    (released.detail, released.time) == (next.detail, next.time)
}

/// Returns the depth of the screen and the bit positions of red, green and blue.
fn color_layout(connection: &RustConnection, screen: &Screen) -> Result<(u8, [u32; 3]), DisplayError> {
    let depth = screen.root_depth;
    let formats = &connection.setup().pixmap_formats;
    let wide = formats.iter().any(|format| format.depth == depth && format.bits_per_pixel == 32);
    let visuals = screen.allowed_depths.iter().flat_map(|depth| &depth.visuals);
    let visual = visuals.filter(|_| wide).find(|visual| visual.visual_id == screen.root_visual);
    let masks =
        visual.map(|visual| [visual.red_mask, visual.green_mask, visual.blue_mask]).ok_or(DisplayError::Colors)?;
    let byte = |mask: u32| mask != 0 && mask >> mask.trailing_zeros() == 0xff;
    if masks.into_iter().all(byte) { Ok((depth, masks.map(u32::trailing_zeros))) } else { Err(DisplayError::Colors) }
}

/// Keyboard mapping: the keysyms of each key code.
#[derive(Debug)]
struct KeyboardMap {
    first_keycode: u8,
    keysyms_per_keycode: usize,
    keysyms: Vec<u32>,
}

impl KeyboardMap {
    fn of(connection: &RustConnection) -> Result<Self, DisplayError> {
        let (first_keycode, last) = (connection.setup().min_keycode, connection.setup().max_keycode);
        let count = last.saturating_sub(first_keycode).saturating_add(1);
        let mapping = connection.get_keyboard_mapping(first_keycode, count)?.reply()?;
        Ok(Self {
            first_keycode,
            keysyms_per_keycode: usize::from(mapping.keysyms_per_keycode),
            keysyms: mapping.keysyms,
        })
    }

    /// Returns the key of a key code, with the upper keysym if Shift is held. With several keyboard layouts, the second
    /// one is used for keys whose keysym in the first is not supported, such as Cyrillic letters. Each layout has two
    /// keysyms per key.
    fn get(&self, code: u8, shift: bool) -> Option<Key> {
        let at = usize::from(code.checked_sub(self.first_keycode)?) * self.keysyms_per_keycode;
        let signs = self.keysyms.get(at..at + self.keysyms_per_keycode)?;
        signs.chunks(2).take(2).find_map(|alphabet| {
            let upper = alphabet.get(1).copied().filter(|sign| shift && *sign != 0);
            key_from_keysym(upper.or(alphabet.first().copied())?)
        })
    }
}

/// Returns the key of a keysym. Source: the X protocol's `keysymdef.h`, whose first 256 keysyms are Latin-1.
fn key_from_keysym(sign: u32) -> Option<Key> {
    Some(match sign {
        0x20..=0x7e => Key::Char(char::from_u32(sign)?.to_ascii_lowercase()),
        0xff08 => Key::Backspace,
        0xff09 => Key::Tab,
        0xff1b => Key::Escape,
        0xff50 | 0xff95 => Key::Home,
        0xff51 | 0xff96 => Key::Left,
        0xff52 | 0xff97 => Key::Up,
        0xff53 | 0xff98 => Key::Right,
        0xff54 | 0xff99 => Key::Down,
        0xff55 | 0xff9a => Key::PageUp,
        0xff56 | 0xff9b => Key::PageDown,
        0xffab => Key::Char('+'),
        0xffad => Key::Char('-'),
        0xffbe => Key::F1,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_signs() {
        for (sign, key) in [
            (0x20, Some(Key::Char(' '))),
            (0x41, Some(Key::Char('a'))),
            (0x61, Some(Key::Char('a'))),
            (0x2e, Some(Key::Char('.'))),
            (0xffbe, Some(Key::F1)),
            (0xff1b, Some(Key::Escape)),
            (0xffab, Some(Key::Char('+'))),
            // The Shift key alone.
            (0xffe1, None),
        ] {
            assert_eq!(key_from_keysym(sign), key, "{sign:x}");
        }
        let american = KeyboardMap { first_keycode: 8, keysyms_per_keycode: 2, keysyms: vec![0x3d, 0x2b, 0x61, 0] };
        // A Russian layout before an American one: the key between Tab and W is "short i" in the first, Q in the
        // second.
        let two = KeyboardMap {
            first_keycode: 8,
            keysyms_per_keycode: 4,
            keysyms: vec![0x6ca, 0x6ea, 0x71, 0x51, 0x20, 0x20, 0x6ca, 0x6ca],
        };
        let russian = KeyboardMap { first_keycode: 8, keysyms_per_keycode: 2, keysyms: vec![0x6ca, 0x6ea] };
        for (keys, code, shift, expected) in [
            (&american, 8, false, Some('=')),
            (&american, 8, true, Some('+')),
            (&american, 9, true, Some('a')),
            (&american, 7, false, None),
            (&american, 10, false, None),
            (&two, 8, false, Some('q')),
            (&two, 8, true, Some('q')),
            (&two, 9, false, Some(' ')),
            (&russian, 8, false, None),
        ] {
            assert_eq!(keys.get(code, shift), expected.map(Key::Char), "{code} {shift}");
        }
    }

    /// A window may be up to 65 535 pixels wide, but an image at most 8192: without a coarser image, its last column
    /// was repeated. Root cause of images with too many pixels: the limit applied to sides rounded down, but images
    /// have sides rounded up, 1921 x 1201 for a window of 3841 x 2401.
    #[test]
    fn coarse_images() {
        for (size, k) in [
            ([1, 1], 1),
            ([960, 540], 1),
            ([1920, 1200], 1),
            ([3840, 2160], 2),
            ([3840, 2400], 2),
            ([3841, 2401], 3),
            ([8192, 50], 1),
        ] {
            assert_eq!(coarseness(size), k, "{size:?}");
        }
        for size in [[8193, 1], [30_000, 50], [65_535, 65_535], [1, 65_535], [3841, 2401]] {
            let k = coarseness(size);
            let image = size.map(|n| n.div_ceil(k));
            assert!(image[0] * image[1] <= MAX_PIXELS, "{size:?}: {image:?}");
            assert!(image.iter().all(|n| *n <= View::MAX_SIDE) && image[0] * k >= size[0], "{size:?}: {k}");
        }
    }
}
