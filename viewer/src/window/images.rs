//! A window for images that a program computes, such as the channels of a camera.

use super::x11::{DisplayError, WindowEvent, XWindow};
use super::{Closed, POLL_INTERVAL, Window, WindowError, WindowState, spawn_window};
use crate::scene_view::Canvas;
use serde::{Deserialize, Serialize};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Condvar, Mutex, PoisonError};

/// Settings of an [`ImageWindow`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImageWindowCfg {
    /// Text of the title bar.
    pub title: String,
    /// Initial size: pixels per row, rows.
    pub size: [usize; 2],
    /// X display, such as `:0`. `None` uses the environment variable `DISPLAY`.
    pub display: Option<String>,
}

impl Default for ImageWindowCfg {
    fn default() -> Self {
        Self { title: "Kinetoscope".into(), size: [640, 480], display: None }
    }
}

/// A window that shows the image of the last call of [`show`](Self::show), like `imshow` of OpenCV.
///
/// The window has its own thread, so it stays responsive while the program computes for minutes. Dropping the value
/// closes the window.
#[derive(Debug)]
pub struct ImageWindow {
    window: Window,
    latest: Arc<LatestImage>,
}

/// The most recent image, shared with the window's thread.
#[derive(Debug, Default)]
struct LatestImage {
    image: Mutex<(u64, Arc<Canvas>)>,
    changed: Condvar,
}

impl ImageWindow {
    /// Opens an empty (black) window.
    ///
    /// # Errors
    /// [`WindowError::NoDisplay`] if no display is available, [`WindowError::Thread`] if no thread can be started.
    pub fn open(cfg: ImageWindowCfg) -> Result<Self, WindowError> {
        let latest = Arc::new(LatestImage::default());
        let own = Arc::clone(&latest);
        let run =
            move |screen: XWindow, own: Arc<LatestImage>, shared: &WindowState| run_image_loop(screen, &own, shared);
        let window = spawn_window(cfg.title, cfg.size, cfg.display, own, |_| (), run)?;
        Ok(Self { window, latest })
    }

    /// Replaces the image of the window and returns at once; has no effect after the window was closed. An image of
    /// another size than the window is scaled to fit, with black bars where the proportions differ.
    pub fn show(&self, image: Canvas) {
        let mut latest = self.latest.image.lock().unwrap_or_else(PoisonError::into_inner);
        *latest = (latest.0 + 1, Arc::new(image));
        self.latest.changed.notify_all();
    }

    /// Handle of the window: reports if the window is open, closes it, and counts its frames.
    pub fn window(&self) -> &Window {
        &self.window
    }
}

impl Drop for ImageWindow {
    fn drop(&mut self) {
        self.window.close();
    }
}

impl LatestImage {
    /// Waits up to [`POLL_INTERVAL`] for an image newer than number `last`. Returns the newest image and its number.
    fn newer_than(&self, last: u64) -> (u64, Arc<Canvas>) {
        let latest = self.image.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.changed.wait_timeout_while(latest, POLL_INTERVAL, |(number, _)| *number == last);
        let latest = waited.unwrap_or_else(PoisonError::into_inner).0;
        (latest.0, Arc::clone(&latest.1))
    }
}

/// Shows images until the window closes.
fn run_image_loop(mut screen: XWindow, latest: &LatestImage, shared: &WindowState) -> Result<Closed, DisplayError> {
    let mut last = 0;
    let mut outdated = true;
    loop {
        for happened in screen.poll()? {
            match happened {
                WindowEvent::Close => return Ok(Closed::ByUser),
                WindowEvent::Exposed | WindowEvent::Input(super::Input::Resize(_)) => outdated = true,
                WindowEvent::Input(_) => {}
            }
        }
        if shared.close.load(Ordering::Acquire) {
            return Ok(Closed::ByUser);
        }
        let (number, image) = latest.newer_than(last);
        if number != last || outdated {
            screen.present(&letterboxed(&image, screen.image_size()))?;
            shared.frames.fetch_add(1, Ordering::AcqRel);
            (last, outdated) = (number, false);
        }
    }
}

/// Scales the image to fit into `size` (pixels per row, rows), by nearest neighbor, centered on black.
fn letterboxed(image: &Canvas, size: [usize; 2]) -> Canvas {
    let [columns, rows] = image.dimensions();
    let mut out = Canvas::new(size[0], size[1]);
    if columns == 0 || rows == 0 {
        return out;
    }
    // The side that limits the scale is filled. Integer arithmetic keeps an image of the window's size unchanged.
    let fitted = if size[0] * rows <= size[1] * columns {
        [size[0], (size[0] * rows / columns).max(1)]
    } else {
        [(size[1] * columns / rows).max(1), size[1]]
    };
    let corner = [0, 1].map(|k| (size[k] - fitted[k].min(size[k])) / 2);
    for y in 0..fitted[1].min(size[1]) {
        let from = y * rows / fitted[1] * columns;
        for x in 0..fitted[0].min(size[0]) {
            let at = 4 * (from + x * columns / fitted[0]);
            let to = 4 * ((corner[1] + y) * size[0] + corner[0] + x);
            out.bytes_mut()[to..to + 4].copy_from_slice(&image.bytes()[at..at + 4]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image whose pixel (x, y) has the color (x, y, 7).
    fn numbered(width: usize, height: usize) -> Canvas {
        let mut image = Canvas::new(width, height);
        (0..height).for_each(|y| (0..width).for_each(|x| image.set(x as i32, y as i32, [x as u8, y as u8, 7])));
        image
    }

    #[test]
    fn letterbox() {
        let image = numbered(4, 2);
        assert_eq!(letterboxed(&image, [4, 2]), image);
        // Twice the size, with bars above and below of one row each.
        let large = letterboxed(&image, [8, 6]);
        for (x, y, color) in [(0, 0, [0; 3]), (0, 1, [0, 0, 7]), (7, 4, [3, 1, 7]), (3, 2, [1, 0, 7]), (7, 5, [0; 3])] {
            assert_eq!(large.pixel(x, y), Some(color), "{x} {y}");
        }
        // Bars at the sides.
        let wide = letterboxed(&image, [9, 2]);
        assert_eq!([0, 1, 2, 5, 6].map(|x| wide.pixel(x, 0).map(|c| c[2])), [0, 0, 7, 7, 0].map(Some));
        for size in [[1, 1], [1, 900], [900, 1], [3, 3]] {
            assert_eq!(letterboxed(&image, size).dimensions(), size);
            assert_eq!(letterboxed(&Canvas::default(), size), Canvas::new(size[0], size[1]));
        }
    }
}
