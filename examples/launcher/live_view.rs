//! Live view and recording for the examples that inspect a model.

use super::{Launcher, MainLoop, Result};
use clap::Parser as _;
use kinetoscope::prelude::*;
use std::path::PathBuf;

/// `--serve`, `--record`, `--steps` and `--headless` of examples that inspect a model and take no steps by themselves.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct LiveViewFlags {
    /// Simulate the model and show it in browsers, in real time, until Ctrl+C; the address defaults to 127.0.0.1:8080
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = "127.0.0.1:8080")]
    serve: Option<String>,
    /// Simulate the model and record it until Ctrl+C; the file name selects the format, as in every example
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Number of physics steps to show or record [default: until Ctrl+C]
    #[arg(long)]
    steps: Option<u64>,
    /// Accepted as in every example; this one never opens a window
    #[arg(long, hide_short_help = true)]
    headless: bool,
}

/// The default values of every example's flags.
#[derive(Debug, clap::Parser)]
struct DefaultFlags {
    #[command(flatten)]
    launcher: Launcher,
}

impl LiveViewFlags {
    /// True if the flags make the model move.
    pub(crate) fn wants_motion(&self) -> bool {
        self.serve.is_some() || self.record.is_some()
    }

    /// Steps a model while it is shown and recorded.
    ///
    /// # Errors
    /// The address is invalid or in use, or the file cannot be written.
    pub(crate) fn show(&self, sim: &mut SimulationManager) -> Result {
        let DefaultFlags { launcher } = DefaultFlags::try_parse_from(["model", "--headless"])?;
        let (serve, record) = (self.serve.clone(), self.record.clone());
        let launcher = Launcher { serve, record, steps: self.steps, ..launcher };
        launcher.serve(sim)?;
        let recording = launcher.start_recording(sim)?;
        let progress = MainLoop::new(&launcher, 1000);
        let mut step = 0;
        while !progress.should_stop(step) {
            sim.update(1);
            step += 1;
            progress.advance(step);
        }
        recording.finish(sim)
    }
}
