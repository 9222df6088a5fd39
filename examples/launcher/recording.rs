//! What an example records, where the build can: the feature `record`.

use super::{Launcher, Result};
use kinetoscope::prelude::*;

#[cfg(feature = "record")]
mod recorded {
    use super::*;
    use std::path::PathBuf;

    impl Launcher {
        /// Begins to record to the file of `--record`.
        ///
        /// # Errors
        /// The file cannot be written, or has no place for anything of this example.
        pub(crate) fn start_recording(&self, sim: &mut SimulationManager) -> Result<Recording> {
            let record =
                |path: &PathBuf| sim.record(RecorderCfg { overwrite: self.overwrite, ..RecorderCfg::new(path) });
            let recorder = self.record.as_ref().map(record).transpose().map_err(|error| format!("--record {error}"))?;
            Ok(Recording { recorder })
        }
    }

    /// What `--record` has begun, if anything.
    #[derive(Debug)]
    pub(crate) struct Recording {
        recorder: Option<RecorderId>,
    }

    impl Recording {
        /// Ends the recording: the file is whole.
        ///
        /// # Errors
        /// It could not be written.
        pub(crate) fn finish(&self, sim: &mut SimulationManager) -> Result {
            if let Some(recorder) = self.recorder {
                let recorded = sim.finish_recording(recorder).map_err(|error| format!("--record {error}"))?;
                println!("Recorded to {recorded}");
            }
            Ok(())
        }
    }
}

#[cfg(feature = "record")]
pub(crate) use recorded::Recording;

/// Nothing: this build does not record.
#[cfg(not(feature = "record"))]
#[derive(Debug)]
pub(crate) struct Recording;

#[cfg(not(feature = "record"))]
impl Launcher {
    /// This build records nothing.
    ///
    /// # Errors
    /// `--record` asks for it.
    pub(crate) fn start_recording(&self, _: &mut SimulationManager) -> Result<Recording> {
        match self.record {
            Some(_) => {
                Err("--record: this build does not record; build with the feature `record`, which is on by default"
                    .into())
            }
            None => Ok(Recording),
        }
    }
}

#[cfg(not(feature = "record"))]
impl Recording {
    /// There is nothing to end.
    ///
    /// # Errors
    /// None.
    pub(crate) fn finish(&self, _: &mut SimulationManager) -> Result {
        Ok(())
    }
}
