//! Examples that look at a model: what they do where somebody wants to watch it move.

use super::{Launcher, Progress, Result};
use clap::Parser as _;
use kinetoscope::prelude::*;
use std::path::PathBuf;

/// `--serve`, `--record` and `--headless` of examples that look at a model and step nothing by themselves.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct StillFlags {
    /// Then show the model in browsers, in real time, until Ctrl+C; at 127.0.0.1:8080 where no address is given
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = "127.0.0.1:8080")]
    serve: Option<String>,
    /// Then record the model as it moves, until Ctrl+C; the format is that of the name, as in every example
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Physics steps that are shown or recorded, in the place of Ctrl+C
    #[arg(long)]
    steps: Option<u64>,
    /// As every example has it; this one never opens a window
    #[arg(long, hide_short_help = true)]
    headless: bool,
}

/// The flags of every example, with nobody who typed them.
#[derive(Debug, clap::Parser)]
struct Untyped {
    #[command(flatten)]
    launcher: Launcher,
}

impl StillFlags {
    /// Whether the model is to move at all.
    pub(crate) fn wants_motion(&self) -> bool {
        self.serve.is_some() || self.record.is_some()
    }

    /// Steps a model, shown and recorded as the flags say.
    ///
    /// # Errors
    /// The address is none, or in use; the file cannot be written.
    pub(crate) fn show(&self, sim: &mut SimulationManager) -> Result {
        let Untyped { launcher } = Untyped::try_parse_from(["model", "--headless"])?;
        let (serve, record) = (self.serve.clone(), self.record.clone());
        let launcher = Launcher { serve, record, steps: self.steps, ..launcher };
        launcher.serve(sim)?;
        let recording = launcher.start_recording(sim)?;
        let progress = Progress::new(&launcher, 1000);
        let mut step = 0;
        while !progress.stop(step) {
            sim.update(1);
            step += 1;
            progress.advance(step);
        }
        recording.finish(sim)
    }
}
