//! Live streams to Foxglove, for flags of programs.

use kinetoscope_record::Result;
use kinetoscope_sim::SimulationManager;
use std::fmt;

/// Live stream to Foxglove at an address that the user of a program gives as text.
///
/// The type exists without the feature `foxglove` too, so that a program can offer a flag in every build: starting a stream
/// is then an error that names the feature.
///
/// ```no_run
/// use kinetoscope::FoxgloveStream;
/// use kinetoscope::prelude::*;
///
/// let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
/// let stream = FoxgloveStream::start(&mut sim, "8765")?;
/// println!("{stream}"); // Open ws://127.0.0.1:8765 in Foxglove ..
/// sim.update(1000);
/// stream.end(&mut sim)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct FoxgloveStream {
    #[cfg(feature = "foxglove")]
    server: kinetoscope_record::FoxgloveServer,
    #[cfg(not(feature = "foxglove"))]
    not_built: std::convert::Infallible,
}

#[cfg(feature = "foxglove")]
impl FoxgloveStream {
    /// Streams all topics of a simulation at an address, as
    /// [`FoxgloveCfg::at`](kinetoscope_record::FoxgloveCfg::at) reads it: `8765`, `127.0.0.1:8765` or `0.0.0.0:8765`.
    ///
    /// # Errors
    /// The address is invalid or in use, there is nothing to stream, or this build does not have the feature `foxglove`.
    pub fn start(sim: &mut SimulationManager, address: &str) -> Result<Self> {
        use kinetoscope_record::{FoxgloveCfg, StreamToFoxglove as _};
        Ok(Self { server: sim.stream_to_foxglove(FoxgloveCfg::at(address)?)? })
    }

    /// Address for Foxglove's dialog "Open connection", with the token if one is required.
    pub fn url(&self) -> &str {
        self.server.url()
    }

    /// Disconnects all clients and stops listening.
    ///
    /// # Errors
    /// The stream was ended before, or it had stopped because of an error, which is returned.
    ///
    /// # Panics
    /// The stream belongs to another simulation.
    pub fn end(&self, sim: &mut SimulationManager) -> Result<()> {
        self.server.close(sim)
    }
}

#[cfg(not(feature = "foxglove"))]
#[allow(missing_docs, reason = "documented above")]
impl FoxgloveStream {
    pub fn start(_: &mut SimulationManager, _: &str) -> Result<Self> {
        Err(kinetoscope_record::RecordError::NoFoxglove)
    }

    pub fn url(&self) -> &str {
        match self.not_built {}
    }

    pub fn end(&self, _: &mut SimulationManager) -> Result<()> {
        match self.not_built {}
    }
}

/// Instruction for the user of the program: the address, and where Foxglove takes it.
impl fmt::Display for FoxgloveStream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Open {} in Foxglove (Open connection, Foxglove WebSocket)", self.url())
    }
}
