//! Live stream of a simulation to Foxglove: a server whose clients receive the messages of a recording.
//!
//! ```text
//! SimulationManager -> Recorder -> pool of packets -> writer thread -> channels -> server threads -> clients
//! ```
//!
//! Topics, types and bytes of the messages are those of an MCAP file that starts at the same time. A simulation never
//! waits for clients: rows are dropped while all packets are in use, and the oldest messages of a slow client are
//! dropped.

mod gate;
mod server;
mod sink;
#[cfg(test)]
mod tests;

use crate::cfg::RecorderCfg;
use crate::error::Result;
use crate::format::Format;
use crate::overview::OverviewCfg;
use crate::recorder::Recorder;
use crate::ros_writer::RosWriter;
use crate::topic::Topic;
use kinetoscope_http::parse_address;
use kinetoscope_sim::{EnvId, Observer, ObserverId, SimEvent, SimulationManager};
use serde::{Deserialize, Serialize};
use server::LiveServer;
use sink::{ClientSink, FoxgloveWriter};
use std::any::Any;
use std::fmt;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;

/// Port that Foxglove suggests.
const DEFAULT_PORT: u16 = 8765;
/// Origin of Foxglove in a browser.
const FOXGLOVE: &str = "https://app.foxglove.dev";

/// Configuration of a live stream to Foxglove.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FoxgloveCfg {
    /// Address that the server listens on. Port 0 selects a free port. All programs on this machine can connect; other
    /// machines can if the address is not a loopback address, with the token in [`FoxgloveServer::url`]. Clients cannot
    /// change the simulation.
    pub address: SocketAddr,
    /// Origins of the websites whose pages can connect, `https://app.foxglove.dev` by default. Programs that are not
    /// websites need no entry, such as the desktop application (`file://`). `null` accepts sandboxed pages of all websites.
    pub websites: Vec<String>,
    /// Topics of the stream.
    pub topics: Vec<Topic>,
    /// Environments, at least one, in any order without repetitions; `None` for all.
    pub envs: Option<Vec<EnvId>>,
    /// Physics steps between two messages of states, targets and poses. Sensors are sent whenever they measure. See
    /// [`stream_periods`](Self::stream_periods) for other rates.
    pub period_steps: u64,
    /// Periods of single streams, as in [`RecorderCfg::stream_periods`].
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub stream_periods: Vec<(String, u64)>,
    /// Settings of the overview image, if it is among the topics ([`Topic::Overview`]).
    pub overview: OverviewCfg,
}

impl Default for FoxgloveCfg {
    fn default() -> Self {
        let RecorderCfg { topics, envs, period_steps, stream_periods, overview, .. } = RecorderCfg::default();
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, DEFAULT_PORT));
        Self { address, websites: vec![FOXGLOVE.into()], topics, envs, period_steps, stream_periods, overview }
    }
}

impl FoxgloveCfg {
    /// Creates a configuration that streams everything at an address: `8765` (a port alone is on 127.0.0.1),
    /// `localhost:8765`, `0.0.0.0:8765`, `[::1]:8765` or an IP address alone, which gets port 8765.
    ///
    /// # Errors
    /// The text is no such address.
    pub fn at(address: &str) -> Result<Self> {
        Ok(Self { address: parse_address(address, DEFAULT_PORT)?, ..Self::default() })
    }

    /// The settings of the recorder, whose path appears in error messages.
    fn recorder(&self) -> RecorderCfg {
        let Self { address, websites: _, topics, envs, period_steps, stream_periods, overview } = self.clone();
        let (path, format) = (PathBuf::from(format!("ws://{address}")), Some(Format::Mcap));
        RecorderCfg { path, format, topics, envs, period_steps, stream_periods, overview, ..RecorderCfg::default() }
    }
}

/// Live streams of a simulation.
pub trait StreamToFoxglove {
    /// Starts a server for Foxglove. Its clients receive the messages of a recording as long as the simulation is
    /// stepped. Of entities that are added later, only fixed ones are in the stream, as a part of the scene.
    ///
    /// # Errors
    /// The server cannot listen at the address, a website is not an origin, or an error of [`Record::record`](crate::Record::record) that does not
    /// concern a file.
    fn stream_to_foxglove(&mut self, cfg: FoxgloveCfg) -> Result<FoxgloveServer>;
}

impl StreamToFoxglove for SimulationManager {
    fn stream_to_foxglove(&mut self, cfg: FoxgloveCfg) -> Result<FoxgloveServer> {
        let sink = ClientSink::new();
        let server = Arc::new(LiveServer::start(cfg.address, cfg.websites.clone(), &sink)?);
        let address = server.address();
        let recorder_cfg = FoxgloveCfg { address, ..cfg }.recorder();
        let clients = Arc::clone(&server);
        let recorder = Recorder::start_live(self, recorder_cfg, move |sim, streams, start| {
            let messages = RosWriter::create(sink, streams, &sim.cfg().env_origins(), start)?;
            Ok(Box::new(FoxgloveWriter::new(messages, clients)))
        })?;
        let observer =
            self.observers_mut().add(FoxgloveObserver { recorder, server: Arc::clone(&server), has_failed: false });
        // The token stays out of the event: logs are read by more people than may read the stream.
        let has_token = !address.ip().is_loopback();
        tracing::info!(target: "kinetoscope_record", %address, has_token, "streaming to Foxglove");
        Ok(FoxgloveServer { server, observer })
    }
}

/// Handle of a live stream. Dropping the handle has no effect: the stream ends when it is [closed](Self::close) or the
/// simulation is dropped.
#[derive(Clone, Debug)]
pub struct FoxgloveServer {
    server: Arc<LiveServer>,
    observer: ObserverId<FoxgloveObserver>,
}

impl FoxgloveServer {
    /// Address and port that the server listens on.
    pub fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// Address for Foxglove's dialog "Open connection", such as `ws://127.0.0.1:8765`, with the token if one is required.
    pub fn url(&self) -> &str {
        self.server.url()
    }

    /// Number of connected clients; 0 after the stream has ended.
    pub fn clients(&self) -> usize {
        self.server.clients()
    }

    /// Error that stopped the stream: all clients are disconnected then. `None` while it goes on.
    ///
    /// # Errors
    /// The stream was closed.
    ///
    /// # Panics
    /// The stream belongs to another simulation.
    #[track_caller]
    pub fn failure(&self, sim: &SimulationManager) -> kinetoscope_sim::Result<Option<String>> {
        sim.observers().get(self.observer).map(|observer| observer.recorder.failure())
    }

    /// Number of rows that were dropped because the writer thread was too slow, for example to compress images.
    ///
    /// # Errors
    /// The stream was closed.
    ///
    /// # Panics
    /// The stream belongs to another simulation.
    #[track_caller]
    pub fn dropped_rows(&self, sim: &SimulationManager) -> kinetoscope_sim::Result<u64> {
        sim.observers().get(self.observer).map(|observer| observer.recorder.dropped_rows())
    }

    /// Disconnects all clients and stops listening.
    ///
    /// # Errors
    /// The stream was already closed, or it had stopped because of an error, which is returned.
    ///
    /// # Panics
    /// The stream belongs to another simulation.
    #[track_caller]
    pub fn close(&self, sim: &mut SimulationManager) -> Result<()> {
        sim.observers_mut().remove(self.observer)?.recorder.finish().map(drop)
    }
}

/// Observer that records for the clients of a server.
struct FoxgloveObserver {
    recorder: Recorder,
    server: Arc<LiveServer>,
    /// True once a failure of the recorder was reported.
    has_failed: bool,
}

impl FoxgloveObserver {
    /// Reports an error that stopped the recorder, and disconnects the clients: they would see a state that never
    /// changes.
    fn stop_after_failure(&mut self) {
        if let Some(reason) = self.recorder.failure().filter(|_| !self.has_failed) {
            tracing::error!(target: "kinetoscope_record", %reason, "the stream to Foxglove stopped");
            self.server.stop();
            self.has_failed = true;
        }
    }
}

impl fmt::Debug for FoxgloveObserver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FoxgloveObserver").field("recorder", &self.recorder).field("server", &self.server).finish()
    }
}

impl Observer for FoxgloveObserver {
    fn due_in(&self, sim: &SimulationManager) -> u64 {
        if self.recorder.has_failed() && !self.has_failed { 1 } else { self.recorder.due_in(sim) }
    }

    fn on_event(&mut self, sim: &mut SimulationManager, event: &SimEvent) {
        self.recorder.set_paused(self.server.clients() == 0);
        self.recorder.on_event(sim, event);
        self.stop_after_failure();
    }

    fn on_published(&mut self, sim: &mut SimulationManager, event: &dyn Any) {
        self.recorder.set_paused(self.server.clients() == 0);
        self.recorder.on_published(sim, event);
        self.stop_after_failure();
    }
}
