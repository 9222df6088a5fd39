//! The simulation in a browser: one page, with pictures drawn here, sliders, plots and buttons.
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
//! Everybody on this machine may look and act, and nobody else. At an address that other machines reach, a token is needed,
//! which is in [`Served::url`]. Nothing is encrypted: where the network between is not to be trusted, listen on loopback and
//! come through a tunnel (`ssh -L 8080:localhost:8080 robot`).
//!
//! Each viewer has a thread that draws its pictures of the newest [`Snapshot`](crate::Snapshot), one at a time among all
//! viewers of a server: together they use one core at most. The simulation waits for none of them.

mod address;
mod answer;
mod command;
mod door;
mod error;
mod eyes;
mod head;
mod page;
mod server;
mod show;
mod state;
mod token;
mod viewer;

pub use error::ServeError;

use crate::control::{RecordButton, Speed, Viewing, Wants};
use door::Door;
use eyes::Theatre;
use kinetoscope_sim::{Moment, Observer, ObserverId, SimulationManager};
use server::{House, Server};
use std::net::SocketAddr;
use std::sync::{Arc, Weak};
use token::Token;

/// How a simulation is served.
#[derive(Clone, Debug, PartialEq)]
pub struct ServeCfg {
    /// Viewers at a time, at most. A further one is told to come later.
    pub max_viewers: usize,
    /// Pictures per second for each viewer, at most.
    pub rate: f64,
    /// Quality of the pictures, 1 to 100: how much of what JPEG leaves out is kept.
    pub quality: u8,
    /// How fast simulated time passes until some viewer says otherwise, and again when the last one has gone; `None` leaves it as
    /// it is: what a window set, else as fast as can be.
    pub speed: Option<Speed>,
    /// The simulation's record button; where `None`, the one that another view has brought, if any.
    pub recording: Option<RecordButton>,
}

impl Default for ServeCfg {
    fn default() -> Self {
        Self { max_viewers: 16, rate: 30.0, quality: 85, speed: None, recording: None }
    }
}

/// A view that is being served. It is served until it is [closed](Self::close) or the simulation is dropped.
#[derive(Debug)]
pub struct Served {
    url: String,
    address: SocketAddr,
    house: Weak<House>,
    host: ObserverId<Host>,
}

impl Served {
    /// What to open in a browser, with the token where one is needed.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// How many look at it now.
    pub fn viewers(&self) -> usize {
        self.house.upgrade().map_or(0, |house| house.viewers())
    }

    /// Sends all viewers away and listens no more.
    ///
    /// # Errors
    /// It was closed before.
    ///
    /// # Panics
    /// It is served by another simulation.
    pub fn close(&self, sim: &mut SimulationManager) -> kinetoscope_sim::Result<()> {
        sim.observers_mut().remove(self.host).map(drop)
    }
}

/// Simulations that can be seen in a browser.
pub trait Serve {
    /// Shows the simulation in browsers at `address`: `127.0.0.1:8080`, `[::1]:8080`, `localhost:8080`, `8080`; port 0 takes
    /// any that is free. It is seen and can be acted on while the program steps it.
    ///
    /// # Errors
    /// The address is none, is not of this machine, or is in use; the error says what would do.
    fn serve(&mut self, address: &str) -> Result<Served, ServeError> {
        self.serve_with(address, ServeCfg::default())
    }

    /// As [`serve`](Self::serve), with more to choose.
    ///
    /// # Errors
    /// As there.
    fn serve_with(&mut self, address: &str, cfg: ServeCfg) -> Result<Served, ServeError>;
}

impl Serve for SimulationManager {
    fn serve_with(&mut self, address: &str, mut cfg: ServeCfg) -> Result<Served, ServeError> {
        let (button, max_viewers) = (cfg.recording.take(), cfg.max_viewers);
        let asked = address::parse(address)?;
        let listener = address::listen(asked)?;
        let address = listener.local_addr().map_err(|error| ServeError::Listen { address: asked, error })?;
        let token = if address.ip().is_loopback() { None } else { Some(Token::random()?) };
        let secret = token.as_ref().map_or_else(String::new, |token| format!("?token={}", token.as_str()));
        let url = format!("http://{}/{secret}", address::reachable(address));
        // Who comes in later finds how things were half a second ago, also where the program does not step just then.
        let usher = self.viewer(Wants { rate: 2.0, ..Wants::default() });
        let theatre = Arc::new(Theatre::new(usher, cfg));
        let server = Server::start(listener, Door::new(address, token), theatre, max_viewers)?;
        button.into_iter().for_each(|button| self.record_button(button));
        let house = server.house();
        let host = self.observers_mut().add(Host(server));
        Ok(Served { url, address, house, host })
    }
}

/// Keeps a server for as long as there is its simulation.
struct Host(Server);

impl std::fmt::Debug for Host {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Host").field("viewers", &self.0.viewers()).finish()
    }
}

impl Observer for Host {
    fn due_in(&self, _: &SimulationManager) -> u64 {
        u64::MAX
    }

    fn observe(&mut self, _: &mut SimulationManager, _: &Moment) {}
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::control::Command;
    use crate::sample::sample;

    /// Serving leaves the speed that a window set, unless it sets one.
    #[test]
    fn speed() {
        let mut sim = sample(1).sim;
        let window = sim.viewer(Wants { rate: 1000.0, ..Wants::default() });
        window.send(Command::SetSpeed(Speed::REAL));
        let until = |sim: &mut SimulationManager, speed: Speed| {
            kinetoscope_testkit::wait::until(&format!("{speed:?}"), || {
                sim.update(1);
                window.newest().unwrap().run.speed == speed
            });
        };
        until(&mut sim, Speed::REAL);
        let _served = sim.serve("127.0.0.1:0").unwrap();
        // Commands are obeyed within some milliseconds, steps are 10 ms long.
        sim.update(10);
        assert_eq!(window.newest().unwrap().run.speed, Speed::REAL);
        let cfg = ServeCfg { speed: Some(Speed::Times(2.0)), ..ServeCfg::default() };
        let other = sim.serve_with("127.0.0.1:0", cfg).unwrap();
        until(&mut sim, Speed::Times(2.0));
        other.close(&mut sim).unwrap();
        until(&mut sim, Speed::REAL);
    }
}
