//! Recording flags of the examples, for builds with the features `record` and `viewer`.

use super::{Launcher, Result};
#[cfg(all(feature = "record", feature = "viewer"))]
use kinetoscope::FileRecording;
use kinetoscope::prelude::*;
#[cfg(all(feature = "record", feature = "viewer"))]
use kinetoscope::record::{RecorderCfg, Topic};

#[cfg(all(feature = "record", feature = "viewer"))]
mod recorded {
    use super::*;
    use kinetoscope::record::Format;
    use kinetoscope::sim::{Moment, Observer};
    use std::sync::{Arc, Mutex, PoisonError};
    use std::time::{Duration, Instant};

    impl Launcher {
        /// The recording of `--record` and of the record button. It goes to the file of `--record`, or without the flag
        /// to `recording.mcap` in the folder of `--out`.
        pub(in super::super) fn files(&self) -> &Arc<Mutex<FileRecording>> {
            self.files.get_or_init(|| {
                let folder = || self.out.clone().unwrap_or_default().join("recording.mcap");
                let path = self.record.clone().unwrap_or_else(folder);
                let (every, rates) = (self.record_every, self.record_rate.clone());
                let cfg = RecorderCfg { overwrite: self.overwrite, every, rates, ..RecorderCfg::new(path) };
                let cfg = self.record_view.as_ref().map_or_else(|| cfg.clone(), |view| showing(cfg.clone(), view));
                Arc::new(Mutex::new(FileRecording::new(cfg)))
            })
        }

        /// Begins to record to the file of `--record`.
        ///
        /// # Errors
        /// The file cannot be written, or its format cannot hold any stream of this example.
        pub(crate) fn start_recording(&self, sim: &mut SimulationManager) -> Result<Recording> {
            let files = self.files();
            if self.record.is_some() {
                let begun = files.lock().unwrap_or_else(PoisonError::into_inner).begin(sim);
                begun.map_err(|error| format!("--record {error}"))?;
                sim.observers_mut().add(Watch { files: Arc::clone(files), looked: Instant::now(), told: false });
            }
            Ok(Recording { files: Arc::clone(files) })
        }
    }

    /// `cfg` with the topics that `--record-view` selects.
    fn showing(cfg: RecorderCfg, view: &str) -> RecorderCfg {
        let film = Format::of_path(&cfg.path).is_ok_and(Format::is_animation);
        match (view, film) {
            ("stage", true) => cfg.with_topics([Topic::Stage]),
            ("stage", false) => cfg.with_topics([Topic::Everything, Topic::Stage]),
            // An unknown camera is an error that lists the cameras of the scene.
            (camera, true) => {
                RecorderCfg { envs: Some(vec![EnvId(0)]), ..cfg }.with_topics([Topic::channel(camera, "color")])
            }
            (camera, false) => cfg.with_topics([Topic::Everything, Topic::channel(camera, "color")]),
        }
    }

    /// Reports a failed recording at once, not only at the end.
    struct Watch {
        files: Arc<Mutex<FileRecording>>,
        looked: Instant,
        told: bool,
    }

    impl Observer for Watch {
        fn due_in(&self, _: &SimulationManager) -> u64 {
            if self.told { u64::MAX } else { LOOK_EVERY }
        }

        fn observe(&mut self, sim: &mut SimulationManager, _: &Moment) {
            if self.told || self.looked.elapsed() < Duration::from_secs(1) {
                return;
            }
            self.looked = Instant::now();
            // A holder of the lock, such as the record button, reports the same failure itself.
            let failure = self.files.try_lock().ok().and_then(|files| files.failure(sim));
            if let Some(why) = &failure {
                eprintln!("--record {why}; nothing is recorded any more");
            }
            self.told = failure.is_some();
        }
    }

    /// Steps between two looks at the clock.
    const LOOK_EVERY: u64 = 10;

    /// The recording that `--record` or the record button has begun, if any.
    #[derive(Debug)]
    pub(crate) struct Recording {
        files: Arc<Mutex<FileRecording>>,
    }

    impl Recording {
        /// Ends the recording and completes the file.
        ///
        /// # Errors
        /// The file could not be written.
        pub(crate) fn finish(&self, sim: &mut SimulationManager) -> Result {
            let ended = self.files.lock().unwrap_or_else(PoisonError::into_inner).end(sim);
            for recorded in ended.map_err(|error| format!("--record {error}"))? {
                println!("Recorded to {recorded}");
            }
            Ok(())
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
    /// `--record` is given.
    pub(crate) fn start_recording(&self, _: &mut SimulationManager) -> Result<Recording> {
        match self.record {
            Some(_) => {
                Err("--record: this build does not record; build with the features `record` and `view`, which are on by default"
                    .into())
            }
            None => Ok(Recording),
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
