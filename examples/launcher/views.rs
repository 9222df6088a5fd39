//! The window and the browser view of an example, for builds with the feature `viewer`.

use super::{Launcher, Result};
use kinetoscope::prelude::*;
#[cfg(feature = "viewer")]
use kinetoscope::viewer::{ImageWindow, ImageWindowCfg, RecordButton, ServeCfg, Window, WindowCfg};

#[cfg(feature = "viewer")]
pub(crate) use shown::*;

#[cfg(feature = "viewer")]
mod shown {
    use super::*;
    use embedded_graphics::mono_font::ascii::FONT_10X20;
    use image::RgbImage;
    use kinetoscope::viewer::{Canvas, Command, SnapshotRequest, Speed, Viewer, ViewerExt};
    use std::sync::{Arc, OnceLock};

    /// The window of an example once it is open.
    #[derive(Clone, Debug, Default)]
    pub(crate) struct SharedWindow(Arc<OnceLock<Window>>);

    impl SharedWindow {
        /// True if a window was opened and then closed, by the user or by a lost display.
        pub(crate) fn is_closed(&self) -> bool {
            self.0.get().is_some_and(|window| !window.is_open())
        }
    }

    /// Viewer handle that resumes a paused simulation.
    static RESUME_HANDLE: OnceLock<Viewer> = OnceLock::new();

    /// Makes Ctrl+C end an example even if a window or a browser has paused the simulation.
    fn install_resume_handle(sim: &mut SimulationManager) {
        // One handle serves window and browser.
        RESUME_HANDLE.get_or_init(|| {
            sim.viewer(SnapshotRequest { rate: 0.0, contacts: None, markers: false, joints: false, cameras: false })
        });
    }

    /// Resumes a paused simulation and sets it to unlimited speed, so that the program can end.
    pub(crate) fn release_pause() {
        if let Some(key) = RESUME_HANDLE.get() {
            key.send(Command::Resume);
            key.send(Command::SetSpeed(Speed::Unlimited));
        }
    }

    /// A window with the images of a sensor.
    #[derive(Debug)]
    pub(crate) struct SensorWindow {
        cfg: ImageWindowCfg,
        window: ImageWindow,
        last: Canvas,
    }

    impl SensorWindow {
        /// Shows an image.
        pub(crate) fn show(&mut self, image: &RgbImage) {
            let (width, height) = image.dimensions();
            self.last = Canvas::new(width as usize, height as usize);
            for (to, from) in self.last.bytes_mut().chunks_exact_mut(4).zip(image.as_raw().chunks_exact(3)) {
                to[..3].copy_from_slice(from);
            }
            // As with `imshow`, the next image reopens a window that the user has closed.
            if !self.window.window().is_open()
                && let Ok(window) = ImageWindow::open(self.cfg.clone())
            {
                self.window = window;
            }
            self.window.show(self.last.clone());
        }

        /// Shows a line of text over the last image until the next one.
        pub(crate) fn announce(&self, text: &str) {
            let mut image = self.last.clone();
            image.text(text, [12, 34], &FONT_10X20, [255, 210, 60]);
            self.window.show(image);
        }
    }

    impl Launcher {
        /// Opens a window for sensor images of `size` (width, height), scaled down to at most 1600 by 1200 \[pixels\].
        /// `None` if the simulation itself has no window, or if no window can be opened.
        pub(crate) fn open_sensor_window(&self, title: &str, size: [usize; 2]) -> Option<SensorWindow> {
            self.window.0.get()?;
            let scale = [1600.0, 1200.0].iter().zip(size).fold(1.0_f64, |scale, (most, n)| scale.min(most / n as f64));
            let cfg = ImageWindowCfg {
                title: title.into(),
                size: size.map(|n| (n as f64 * scale) as usize),
                ..ImageWindowCfg::default()
            };
            match ImageWindow::open(cfg.clone()) {
                Ok(window) => Some(SensorWindow { cfg, window, last: Canvas::new(size[0], size[1]) }),
                Err(error) => {
                    println!("{error}\nImages are written to files.");
                    None
                }
            }
        }

        /// Serves the browser view, if `--serve` is given.
        ///
        /// # Errors
        /// The address is invalid or in use.
        pub(crate) fn serve(&self, sim: &mut SimulationManager) -> Result {
            let Some(address) = self.serve_address() else { return Ok(()) };
            let cfg =
                ServeCfg { speed: Some(Speed::REAL_TIME), record_button: self.record_button(), ..ServeCfg::default() };
            let served = sim.serve_with(address, cfg).map_err(|error| format!("--serve: {error}"))?;
            println!("Open {} in a browser", served.url());
            install_resume_handle(sim);
            Ok(())
        }

        /// Renders all environments as in a newly opened window to a PNG in the folder of `--out`, if given.
        ///
        /// # Errors
        /// The file cannot be written.
        pub(crate) fn screenshot(&self, sim: &mut SimulationManager, name: &str) -> Result {
            let Some(out) = &self.out else { return Ok(()) };
            super::super::make_folder(out)?;
            let path = out.join(name);
            sim.screenshot(&path)?;
            println!("Image written to {}", path.display());
            Ok(())
        }

        /// Opens a window onto the simulation, except with `--headless`. Closing it ends the example as Ctrl+C does.
        /// Without a display, the example prints a message and runs without a window.
        pub(crate) fn open_window(&self, sim: &mut SimulationManager) {
            if self.headless {
                return;
            }
            match sim.open_window_with(WindowCfg { record_button: self.record_button(), ..WindowCfg::default() }) {
                Ok(window) => {
                    println!("A window is open, in real time: H in it shows the keys; closing it ends the example.");
                    let _ = self.window.0.set(window);
                    install_resume_handle(sim);
                }
                Err(error) => println!("{error}\nThe example continues without a window, as with --headless."),
            }
        }

        /// The record button of window and browser, in builds that record.
        fn record_button(&self) -> Option<RecordButton> {
            #[cfg(feature = "record")]
            return Some(RecordButton::shared(std::sync::Arc::clone(self.recording())));
            #[cfg(not(feature = "record"))]
            None
        }
    }
}

/// Placeholder for builds without the feature `viewer`: no such value exists.
#[cfg(not(feature = "viewer"))]
#[derive(Debug)]
pub(crate) enum SensorWindow {}

#[cfg(not(feature = "viewer"))]
impl SensorWindow {
    /// Never called.
    pub(crate) fn show(&mut self, _: &image::RgbImage) {
        match *self {}
    }

    /// Never called.
    pub(crate) fn announce(&self, _: &str) {
        match *self {}
    }
}

/// Does nothing: without the feature `viewer`, a simulation cannot be paused.
#[cfg(not(feature = "viewer"))]
pub(crate) fn release_pause() {}

/// Placeholder for builds without the feature `viewer`.
#[cfg(not(feature = "viewer"))]
#[derive(Clone, Debug, Default)]
pub(crate) struct SharedWindow;

#[cfg(not(feature = "viewer"))]
impl SharedWindow {
    /// Always false: this build has no window.
    pub(crate) fn is_closed(&self) -> bool {
        false
    }
}

#[cfg(not(feature = "viewer"))]
impl Launcher {
    /// Serves nothing: this build has no browser view.
    ///
    /// # Errors
    /// `--serve` is given.
    pub(crate) fn serve(&self, _: &mut SimulationManager) -> Result {
        match self.serve_address() {
            Some(_) => {
                Err("--serve: this build has no views; build with the feature `viewer`, which is on by default".into())
            }
            None => Ok(()),
        }
    }

    /// Renders nothing: this build has no overview of the environments.
    ///
    /// # Errors
    /// `--out` is given.
    pub(crate) fn screenshot(&self, _: &mut SimulationManager, _: &str) -> Result {
        match self.out {
            Some(_) => {
                Err("--out: this build has no views; build with the feature `viewer`, which is on by default".into())
            }
            None => Ok(()),
        }
    }

    /// Always `None`: this build has no window.
    pub(crate) fn open_sensor_window(&self, _: &str, _: [usize; 2]) -> Option<SensorWindow> {
        None
    }

    /// Prints that this build opens no window, except with `--headless`.
    pub(crate) fn open_window(&self, _: &mut SimulationManager) {
        if !self.headless {
            println!(
                "This build has no window (the feature `viewer` is off).\nThe example continues without a window, as with --headless."
            );
        }
    }
}
