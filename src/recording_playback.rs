//! Playback of recordings in viewers.

use kinetoscope_record::Playback;
use kinetoscope_sim::SimulationManager;

/// Wrapper of a [`Playback`] that viewers can play with [`Play::play`](kinetoscope_viewer::Play::play).
///
/// ```no_run
/// use kinetoscope::RecordingPlayback;
/// use kinetoscope::prelude::*;
/// use kinetoscope::record::{Playback, Recording};
/// use kinetoscope::viewer::Play;
///
/// let (playback, mut sim) = Playback::open(&Recording::open("run.mcap")?, None)?;
/// let window = sim.open_window()?;
/// sim.play(&mut RecordingPlayback(playback), &mut || window.is_open())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct RecordingPlayback(pub Playback);

impl kinetoscope_viewer::PlaybackSource for RecordingPlayback {
    fn times(&self) -> &[f64] {
        self.0.times()
    }

    fn show(&mut self, sim: &mut SimulationManager, frame: usize) -> Result<(), String> {
        self.0.seek(sim, frame).map_err(|error| error.to_string())
    }
}
