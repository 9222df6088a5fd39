//! Errors of starting a server.

use std::net::SocketAddr;

/// An error of starting a server.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The address is invalid or not available.
    #[error("cannot serve at {given:?}: {reason}{}", hint(candidates))]
    Address {
        /// The requested address.
        given: String,
        /// Reason of the refusal.
        reason: String,
        /// Alternative addresses.
        candidates: Vec<String>,
    },
    /// Another program or another simulation listens at the address.
    #[error(
        "cannot serve at {address}: port {} is in use{}",
        address.port(),
        hint(&next.iter().map(ToString::to_string).collect::<Vec<_>>())
    )]
    PortInUse {
        /// The requested address.
        address: SocketAddr,
        /// The next free port, if one was found.
        next: Option<SocketAddr>,
    },
    /// The operating system refused to listen for another reason.
    #[error("cannot serve at {address}: {error}")]
    Listen {
        /// The requested address.
        address: SocketAddr,
        /// Error of the operating system.
        #[source]
        error: std::io::Error,
    },
    /// A text is not the origin of a website.
    #[error(
        "{given:?} is no origin of a website: write scheme, host and port without a path, such as https://example.org or http://localhost:8080"
    )]
    Origin {
        /// The text.
        given: String,
    },
    /// The operating system provides no random numbers or no thread.
    #[error("cannot serve: {0}")]
    System(String),
}

fn hint(candidates: &[String]) -> String {
    if candidates.is_empty() { String::new() } else { format!("; try {}", candidates.join(" or ")) }
}
