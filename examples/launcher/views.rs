//! The window and the browser view of an example, where the build has them: the feature `view`.

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
    use kinetoscope::viewer::{Canvas, Command, Speed, Viewer, Viewing, Wants};
    use std::sync::{Arc, OnceLock};

    /// The window of an example, once it is open.
    #[derive(Clone, Debug, Default)]
    pub(crate) struct Shown(Arc<OnceLock<Window>>);

    impl Shown {
        /// True when there was a window and it is closed, by the user or by a lost display.
        pub(crate) fn is_closed(&self) -> bool {
            self.0.get().is_some_and(|window| !window.is_open())
        }
    }

    /// Lets a simulation go on that somebody paused.
    static KEY: OnceLock<Viewer> = OnceLock::new();

    /// Ctrl+C ends an example also while somebody holds it, in a window or in a browser.
    fn keep_key(sim: &mut SimulationManager) {
        // One is enough for both.
        KEY.get_or_init(|| {
            sim.viewer(Wants { rate: 0.0, contacts: None, markers: false, joints: false, cameras: false })
        });
    }

    /// A viewer that holds the simulation does not hold the program.
    pub(crate) fn let_go() {
        if let Some(key) = KEY.get() {
            key.send(Command::Resume);
            key.send(Command::SetSpeed(Speed::Free));
        }
    }

    /// A window that shows what a sensor measured.
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
            // As with `imshow`, the next image opens a window again that the user has closed.
            if !self.window.window().is_open()
                && let Ok(window) = ImageWindow::open(self.cfg.clone())
            {
                self.window = window;
            }
            self.window.show(self.last.clone());
        }

        /// Shows a line of text over the last image, until the next one.
        pub(crate) fn announce(&self, text: &str) {
            let mut image = self.last.clone();
            image.text(text, [12, 34], &FONT_10X20, [255, 210, 60]);
            self.window.show(image);
        }
    }

    impl Launcher {
        /// Opens a window for the images of a sensor, of `size` (pixels per row, rows), at most 1600 by 1200; `None` where there
        /// is no window of the simulation either.
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

        /// Shows the simulation in browsers where `--serve` asks for it.
        ///
        /// # Errors
        /// The address is none, or in use.
        pub(crate) fn serve(&self, sim: &mut SimulationManager) -> Result {
            let Some(address) = self.serve_address() else { return Ok(()) };
            let cfg = ServeCfg { speed: Some(Speed::REAL), recording: self.record_button(), ..ServeCfg::default() };
            let served = sim.serve_with(address, cfg).map_err(|error| format!("--serve: {error}"))?;
            println!("Open {} in a browser", served.url());
            keep_key(sim);
            Ok(())
        }

        /// Draws the stage as a window first shows it, to a PNG in the folder of `--out`, where that is given.
        ///
        /// # Errors
        /// The file cannot be written.
        pub(crate) fn screenshot(&self, sim: &mut SimulationManager, name: &str) -> Result {
            let Some(out) = &self.out else { return Ok(()) };
            super::super::make_folder(out)?;
            let path = out.join(name);
            sim.screenshot(&path)?;
            println!("Drawn to {}", path.display());
            Ok(())
        }

        /// Opens a window onto the simulation, unless `--headless` says otherwise. Closing it ends the example as Ctrl+C does.
        /// Without a display, a message says so and the example runs without a window.
        pub(crate) fn open_window(&self, sim: &mut SimulationManager) {
            if self.headless {
                return;
            }
            match sim.open_window_with(WindowCfg { recording: self.record_button(), ..WindowCfg::default() }) {
                Ok(window) => {
                    println!("A window is open, in real time: H in it shows the keys; closing it ends the example.");
                    let _ = self.window.0.set(window);
                    keep_key(sim);
                }
                Err(error) => println!("{error}\nGoing on without a window, as with --headless."),
            }
        }

        /// The record button of window and browser, where the build records.
        fn record_button(&self) -> Option<RecordButton> {
            #[cfg(feature = "record")]
            return Some(RecordButton::shared(std::sync::Arc::clone(self.files())));
            #[cfg(not(feature = "record"))]
            None
        }
    }
}

/// Without the feature `view`, there is no window of a sensor.
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

/// Without the feature `view`, no viewer holds a simulation.
#[cfg(not(feature = "viewer"))]
pub(crate) fn let_go() {}

/// Without the feature `view`, there is no window to close.
#[cfg(not(feature = "viewer"))]
#[derive(Clone, Debug, Default)]
pub(crate) struct Shown;

#[cfg(not(feature = "viewer"))]
impl Shown {
    /// Always false: there is no window.
    pub(crate) fn is_closed(&self) -> bool {
        false
    }
}

#[cfg(not(feature = "viewer"))]
impl Launcher {
    /// This build serves nothing.
    ///
    /// # Errors
    /// `--serve` asks for it.
    pub(crate) fn serve(&self, _: &mut SimulationManager) -> Result {
        match self.serve_address() {
            Some(_) => {
                Err("--serve: this build has no views; build with the feature `view`, which is on by default".into())
            }
            None => Ok(()),
        }
    }

    /// This build draws no stage.
    ///
    /// # Errors
    /// `--out` asks for it.
    pub(crate) fn screenshot(&self, _: &mut SimulationManager, _: &str) -> Result {
        match self.out {
            Some(_) => {
                Err("--out: this build has no views; build with the feature `view`, which is on by default".into())
            }
            None => Ok(()),
        }
    }

    /// This build has no window.
    pub(crate) fn open_sensor_window(&self, _: &str, _: [usize; 2]) -> Option<SensorWindow> {
        None
    }

    /// Says that this build opens no window, unless `--headless` wants none.
    pub(crate) fn open_window(&self, _: &mut SimulationManager) {
        if !self.headless {
            println!("This build has no window (its feature `view` is off).\nGoing on without, as with --headless.");
        }
    }
}
