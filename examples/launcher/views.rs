//! The window and the browser view of an example, where the build has them: the feature `view`.

use super::{Launcher, Result};
use kinetoscope::prelude::*;

#[cfg(feature = "view")]
pub(crate) use shown::let_go;

#[cfg(feature = "view")]
mod shown {
    use super::*;
    use kinetoscope::view::{Command, Speed, Viewer, Viewing, Wants};
    use std::sync::OnceLock;

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

    impl Launcher {
        /// Shows the simulation in browsers where `--serve` asks for it.
        ///
        /// # Errors
        /// The address is none, or in use.
        pub(crate) fn serve(&self, sim: &mut SimulationManager) -> Result {
            let Some(address) = &self.serve else { return Ok(()) };
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

        /// Opens a window onto the simulation, unless `--headless` says otherwise. Where there is no display, that is said, and
        /// the example goes on without.
        pub(crate) fn open_window(&self, sim: &mut SimulationManager) {
            if self.headless {
                return;
            }
            match sim.open_window_with(WindowCfg { recording: self.record_button(), ..WindowCfg::default() }) {
                Ok(_) => {
                    println!("A window is open, in real time: H in it shows the keys.");
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

/// Nothing holds a simulation that nobody views.
#[cfg(not(feature = "view"))]
pub(crate) fn let_go() {}

#[cfg(not(feature = "view"))]
impl Launcher {
    /// This build serves nothing.
    ///
    /// # Errors
    /// `--serve` asks for it.
    pub(crate) fn serve(&self, _: &mut SimulationManager) -> Result {
        match self.serve {
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

    /// Says that this build opens no window, unless `--headless` wants none.
    pub(crate) fn open_window(&self, _: &mut SimulationManager) {
        if !self.headless {
            println!("This build has no window (its feature `view` is off).\nGoing on without, as with --headless.");
        }
    }
}
