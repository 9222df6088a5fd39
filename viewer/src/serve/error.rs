//! What can go wrong before the browser view listens.

use std::net::SocketAddr;

/// Why there is no browser view.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// It is not an address that can be listened on.
    #[error("cannot serve at {given:?}: {reason}{}", hint(candidates))]
    Address {
        /// What was asked for.
        given: String,
        /// What is wrong with it.
        reason: String,
        /// Addresses that would do.
        candidates: Vec<String>,
    },
    /// Another program, or another simulation, listens there.
    #[error(
        "cannot serve at {address}: port {} is in use{}",
        address.port(),
        hint(&next.iter().map(ToString::to_string).collect::<Vec<_>>())
    )]
    PortInUse {
        /// What was asked for.
        address: SocketAddr,
        /// The next port that is free.
        next: Option<SocketAddr>,
    },
    /// The system refused for another reason.
    #[error("cannot serve at {address}: {error}")]
    Listen {
        /// What was asked for.
        address: SocketAddr,
        /// What the system says.
        #[source]
        error: std::io::Error,
    },
    /// The system gives no random numbers, or no thread.
    #[error("cannot serve: {0}")]
    System(String),
    /// The simulation cannot be looked at.
    #[error("cannot serve: {0}")]
    Simulation(#[from] kinetoscope_sim::Error),
}

fn hint(candidates: &[String]) -> String {
    if candidates.is_empty() { String::new() } else { format!("; try {}", candidates.join(" or ")) }
}
