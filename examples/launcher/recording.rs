//! Recording flags of the examples, for builds with the features `record` and `viewer`.

use super::{Launcher, Result};
use kinetoscope::prelude::*;
#[cfg(all(feature = "record", feature = "viewer"))]
use kinetoscope::record::{RecorderCfg, Topic};
#[cfg(all(feature = "record", feature = "viewer"))]
use kinetoscope::{FileRecording, FoxgloveStream};

#[cfg(all(feature = "record", feature = "viewer"))]
mod recorded {
    use super::*;
    use kinetoscope::record::Format;
    use kinetoscope::sim::{Observer, SimEvent};
    use std::sync::{Arc, Mutex, PoisonError};
    use std::time::{Duration, Instant};

    impl Launcher {
        /// The recording of `--record` and of the record button. It goes to the file of `--record`, or without the flag
        /// to `recording.mcap` in the folder of `--out`.
        pub(in super::super) fn recording(&self) -> &Arc<Mutex<FileRecording>> {
            self.files.get_or_init(|| {
                let folder = || self.out.clone().unwrap_or_default().join("recording.mcap");
                let path = self.record.clone().unwrap_or_else(folder);
                let (period_steps, stream_periods) = (self.record_every, self.record_rate.clone());
                let cfg =
                    RecorderCfg { overwrite: self.overwrite, period_steps, stream_periods, ..RecorderCfg::new(path) };
                let cfg = self.record_view.as_ref().map_or_else(|| cfg.clone(), |view| with_view(cfg.clone(), view));
                Arc::new(Mutex::new(FileRecording::new(cfg)))
            })
        }

        /// Begins to record to the file of `--record`, and to stream to Foxglove with `--foxglove`.
        ///
        /// # Errors
        /// The file cannot be written, its format cannot hold any stream of this example, or the address of `--foxglove`
        /// is invalid or in use.
        pub(crate) fn start_recording(&self, sim: &mut SimulationManager) -> Result<Recording> {
            let stream = self.foxglove.as_deref().map(|address| FoxgloveStream::start(sim, address));
            let stream = stream.transpose().map_err(|error| format!("--foxglove: {error}"))?;
            stream.iter().for_each(|stream| println!("{stream}"));
            let files = self.recording();
            if self.record.is_some() {
                let begun = files.lock().unwrap_or_else(PoisonError::into_inner).start(sim);
                begun.map_err(|error| format!("--record {error}"))?;
                sim.observers_mut().add(FailureMonitor {
                    files: Arc::clone(files),
                    last_check: Instant::now(),
                    reported: false,
                });
            }
            Ok(Recording { files: Arc::clone(files), stream })
        }
    }

    /// `cfg` with the topics that `--record-view` selects.
    fn with_view(cfg: RecorderCfg, view: &str) -> RecorderCfg {
        let animation = Format::of_path(&cfg.path).is_ok_and(Format::is_animation);
        match (view, animation) {
            ("stage", true) => cfg.with_topics([Topic::Overview]),
            ("stage", false) => cfg.with_topics([Topic::Everything, Topic::Overview]),
            // An unknown camera is an error that lists the cameras of the scene.
            (camera, true) => {
                RecorderCfg { envs: Some(vec![EnvId(0)]), ..cfg }.with_topics([Topic::channel(camera, "color")])
            }
            (camera, false) => cfg.with_topics([Topic::Everything, Topic::channel(camera, "color")]),
        }
    }

    /// Reports a failed recording at once, not only at the end.
    struct FailureMonitor {
        files: Arc<Mutex<FileRecording>>,
        last_check: Instant,
        reported: bool,
    }

    impl Observer for FailureMonitor {
        fn due_in(&self, sim: &SimulationManager) -> u64 {
            // Counted from the steps of the simulation: each call of `update` asks again.
            if self.reported { u64::MAX } else { CHECK_INTERVAL - sim.observers().steps() % CHECK_INTERVAL }
        }

        fn on_event(&mut self, sim: &mut SimulationManager, _: &SimEvent) {
            if self.reported || self.last_check.elapsed() < Duration::from_secs(1) {
                return;
            }
            self.last_check = Instant::now();
            // A holder of the lock, such as the record button, reports the same failure itself.
            let failure = self.files.try_lock().ok().and_then(|files| files.failure(sim));
            if let Some(why) = &failure {
                eprintln!("--record {why}; recording has stopped");
            }
            self.reported = failure.is_some();
        }
    }

    /// Steps between two looks at the clock.
    const CHECK_INTERVAL: u64 = 10;

    /// The recording that `--record` or the record button has begun, and the stream of `--foxglove`, if any.
    pub(crate) struct Recording {
        files: Arc<Mutex<FileRecording>>,
        stream: Option<FoxgloveStream>,
    }

    impl Recording {
        /// Ends the recording and the stream, and completes the file.
        ///
        /// # Errors
        /// The file could not be written, or the stream had stopped.
        pub(crate) fn finish(&self, sim: &mut SimulationManager) -> Result {
            let ended = self.files.lock().unwrap_or_else(PoisonError::into_inner).finish(sim);
            for recorded in ended.map_err(|error| format!("--record {error}"))? {
                println!("Recorded to {recorded}");
            }
            let stream = self.stream.as_ref();
            stream.map_or(Ok(()), |stream| stream.end(sim).map_err(|error| format!("--foxglove: {error}").into()))
        }
    }
}

/// Placeholder for builds without recordings.
#[cfg(not(all(feature = "record", feature = "viewer")))]
#[derive(Debug)]
pub(crate) struct Recording;

#[cfg(not(all(feature = "record", feature = "viewer")))]
impl Launcher {
    /// Returns a placeholder: this build does not record.
    ///
    /// # Errors
    /// `--record` or `--foxglove` is given.
    pub(crate) fn start_recording(&self, _: &mut SimulationManager) -> Result<Recording> {
        match (&self.record, &self.foxglove) {
            (None, None) => Ok(Recording),
            _ => Err("--record, --foxglove: this build does not record; build with the features `record` and `viewer`, which \
                      are on by default"
                .into()),
        }
    }
}

#[cfg(not(all(feature = "record", feature = "viewer")))]
impl Recording {
    /// Does nothing.
    ///
    /// # Errors
    /// Never fails.
    pub(crate) fn finish(&self, _: &mut SimulationManager) -> Result {
        Ok(())
    }
}
