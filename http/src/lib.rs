//! The part of an HTTP server that decides about a connection: its address, the head of its request, its origin and its
//! token.
//!
//! ```text
//! parse_address -> listen -> RequestHead -> AccessPolicy::check -> the server, or an error response
//! ```
//!
//! The browser view and the live stream to Foxglove use it. What follows an accepted request is theirs.
#![forbid(unsafe_code)]

mod access_policy;
mod address;
mod error;
mod request_head;
mod response;
mod token;

pub use access_policy::AccessPolicy;
pub use address::{listen, parse_address, reachable_address};
pub use error::ServeError;
pub use request_head::RequestHead;
pub use response::{Status, drain, error_response, send, send_error};
pub use token::{Token, random_hex, random_loopback};
