//! Browser view: a web page with live images, joint sliders, plots and controls of the simulation.
//!
//! ```no_run
//! use kinetoscope_sim::{SimulationManager, SimulationManagerCfg};
//! use kinetoscope_viewer::Serve;
//!
//! let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
//! let served = sim.serve("127.0.0.1:8080")?;
//! println!("Look at {}", served.url());
//! loop {
//!     sim.update(1);
//! }
//! # #[allow(unreachable_code)]
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! On a loopback address, every program and user of this machine can watch and control the simulation. On an address
//! that other machines can reach, a token is required, which is part of [`ServerHandle::url`]. The connection is not
//! encrypted: over an untrusted network, listen on loopback and use a tunnel (`ssh -L 8080:localhost:8080 robot`).
//!
//! Each viewer has its own thread, which renders images of the newest [`Snapshot`](crate::Snapshot). Only one viewer of
//! a server renders at a time, so all viewers together use at most one core. The simulation does not wait for images.

mod command;
mod page;
mod server;
mod state;
mod view_backend;
mod viewer_session;
mod websocket_session;

pub use kinetoscope_http::ServeError;

use crate::control::{RecordButton, SnapshotRequest, Speed, ViewerExt};
use kinetoscope_http::{AccessPolicy, Token, listen, parse_address, reachable_address};
use kinetoscope_sim::{Observer, ObserverId, SimEvent, SimulationManager};
use page::FrameAncestors;
use serde::{Deserialize, Serialize};
use server::{Server, ServerContext};
use std::fmt;
use std::net::SocketAddr;
use std::sync::{Arc, Weak};
use viewer_session::ViewerHub;

/// Port of an address without a port.
const DEFAULT_PORT: u16 = 8080;

/// Settings of the browser view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ServeCfg {
    /// Maximum number of simultaneous viewers. Further viewers are refused with status 503 (Service Unavailable).
    pub max_viewers: usize,
    /// Number of snapshots per second that each viewer requests, and so the number of its images per second, up to 40.
    /// Another viewer or a window with a higher rate raises both.
    pub max_fps: f64,
    /// JPEG quality of the images, clamped to 1 to 100.
    pub jpeg_quality: u8,
    /// Speed of simulated time until a viewer changes it, and again 10 s after the last viewer has left. `None` keeps
    /// the current speed: that set by a window, otherwise as fast as the machine can step.
    pub speed: Option<Speed>,
    /// True to let web pages of this machine show the view in a frame, as notebooks do: pages of `localhost` and
    /// `127.0.0.1` at any port. By default, browsers refuse to show the view in a frame, because a page with a frame can
    /// lure users into clicks on it.
    pub allow_local_frames: bool,
    /// Record button of the simulation. `None` keeps the button that another view has set, if any. Not part of files.
    #[serde(skip)]
    pub record_button: Option<RecordButton>,
}

impl Default for ServeCfg {
    fn default() -> Self {
        Self {
            max_viewers: 16,
            max_fps: 30.0,
            jpeg_quality: 85,
            speed: None,
            allow_local_frames: false,
            record_button: None,
        }
    }
}

/// Handle of a browser view. Dropping the handle has no effect: the view ends when it is [closed](Self::close) or the
/// simulation is dropped.
pub struct ServerHandle {
    url: String,
    address: SocketAddr,
    context: Weak<ServerContext>,
    host: ObserverId<ServerObserver>,
}

impl fmt::Debug for ServerHandle {
    /// Without the token, so that a log does not give access.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ServerHandle").field("address", &self.address).finish_non_exhaustive()
    }
}

impl ServerHandle {
    /// Address to open in a browser, with the token if one is required.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Address and port that the server listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Number of connected viewers; 0 after the view has ended.
    pub fn viewers(&self) -> usize {
        self.context.upgrade().map_or(0, |context| context.viewers())
    }

    /// Disconnects all viewers and stops listening.
    ///
    /// # Errors
    /// The view was already closed.
    ///
    /// # Panics
    /// The view belongs to another simulation.
    pub fn close(&self, sim: &mut SimulationManager) -> kinetoscope_sim::Result<()> {
        sim.observers_mut().remove(self.host).map(drop)
    }
}

/// Browser views of a simulation.
pub trait Serve {
    /// Serves the simulation to browsers at `address`: `127.0.0.1:8080`, `[::1]:8080`, `localhost:8080` or `8080` (a
    /// port alone is on 127.0.0.1; an address alone has port 8080). Port 0 selects a free port. Viewers can watch and
    /// control the simulation while the program steps it.
    ///
    /// # Errors
    /// The address is invalid, does not belong to this machine, or is in use (these errors suggest alternatives), or
    /// the operating system provides no thread or no random numbers.
    fn serve(&mut self, address: &str) -> Result<ServerHandle, ServeError> {
        self.serve_with(address, ServeCfg::default())
    }

    /// Serves the simulation to browsers, like [`serve`](Self::serve), with the settings `cfg`.
    ///
    /// # Errors
    /// The errors of [`serve`](Self::serve).
    fn serve_with(&mut self, address: &str, cfg: ServeCfg) -> Result<ServerHandle, ServeError>;
}

impl Serve for SimulationManager {
    fn serve_with(&mut self, address: &str, mut cfg: ServeCfg) -> Result<ServerHandle, ServeError> {
        let (button, max_viewers) = (cfg.record_button.take(), cfg.max_viewers);
        let frames = if cfg.allow_local_frames { FrameAncestors::ThisMachine } else { FrameAncestors::None };
        let asked = parse_address(address, DEFAULT_PORT)?;
        let listener = listen(asked)?;
        let address = listener.local_addr().map_err(|error| ServeError::Listen { address: asked, error })?;
        let token = if address.ip().is_loopback() { None } else { Some(Token::random()?) };
        let token_query = token.as_ref().map_or_else(String::new, |token| format!("?token={}", token.as_str()));
        let has_token = token.is_some();
        let url = format!("http://{}/{token_query}", reachable_address(address));
        // Requests two snapshots per second. A new viewer thus starts with a state at most half a second old, even if
        // the program does not step then.
        let host_viewer = self.viewer(SnapshotRequest { rate: 2.0, ..SnapshotRequest::default() });
        let backend = Arc::new(ViewerHub::new(host_viewer, cfg));
        let server = Server::start(listener, AccessPolicy::new(address, token), frames, backend, max_viewers)?;
        button.into_iter().for_each(|button| self.set_record_button(button));
        let context = server.context();
        let host = self.observers_mut().add(ServerObserver(server));
        // The URL stays out of the event: logs are read by more people than may control the simulation.
        tracing::info!(target: "kinetoscope_viewer", %address, has_token, "serving a browser view");
        Ok(ServerHandle { url, address, context, host })
    }
}

/// Observer that owns the server, which thus ends with its simulation.
struct ServerObserver(Server);

impl std::fmt::Debug for ServerObserver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Host").field("viewers", &self.0.viewers()).finish()
    }
}

impl Observer for ServerObserver {
    fn due_in(&self, _: &SimulationManager) -> u64 {
        u64::MAX
    }

    fn on_event(&mut self, _: &mut SimulationManager, _: &SimEvent) {}
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::control::Command;
    use crate::sample::sample;

    /// Serving keeps the speed that a window set, unless the settings have a speed.
    #[test]
    fn speed() {
        let mut sim = sample(1).sim;
        let window = sim.viewer(SnapshotRequest { rate: 1000.0, ..SnapshotRequest::default() });
        window.send(Command::SetSpeed(Speed::REAL_TIME));
        let until = |sim: &mut SimulationManager, speed: Speed| {
            kinetoscope_testkit::wait::until(&format!("{speed:?}"), || {
                sim.update(1);
                window.newest().unwrap().run.speed == speed
            });
        };
        until(&mut sim, Speed::REAL_TIME);
        let _served = sim.serve("127.0.0.1:0").unwrap();
        // Commands run within some milliseconds; steps take 10 ms.
        sim.update(10);
        assert_eq!(window.newest().unwrap().run.speed, Speed::REAL_TIME);
        let cfg = ServeCfg { speed: Some(Speed::Factor(2.0)), ..ServeCfg::default() };
        let other = sim.serve_with("127.0.0.1:0", cfg).unwrap();
        until(&mut sim, Speed::Factor(2.0));
        other.close(&mut sim).unwrap();
        until(&mut sim, Speed::REAL_TIME);
    }
}
