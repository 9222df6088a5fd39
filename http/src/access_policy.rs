//! Access control: refuses requests from other websites and requests without the token.

use crate::request_head::RequestHead;
use crate::response::Status;
use crate::token::Token;
use std::net::{IpAddr, SocketAddr};

/// Access policy of one server.
#[derive(Clone, Debug)]
pub struct AccessPolicy {
    /// True if the server listens on loopback only.
    local: bool,
    token: Option<Token>,
}

impl AccessPolicy {
    /// Creates the policy of an address, with a token if other machines can reach it.
    pub fn new(address: SocketAddr, token: Option<Token>) -> Self {
        Self { local: address.ip().is_loopback(), token }
    }

    /// Accepts a request, or returns the status of the refusal.
    ///
    /// Even on a loopback address, any website can make a local browser send requests to this server. The `Origin`
    /// header reveals such requests. With DNS rebinding the origin matches, but the `Host` header names the website, so
    /// a loopback server accepts only host names of this machine. The port may differ, because of tunnels.
    ///
    /// # Errors
    /// The status of the refusal.
    pub fn check(&self, head: &RequestHead) -> Result<(), Status> {
        let host = head.header("host")?.ok_or(Status::BadRequest)?;
        if self.local && !is_local(host) {
            return Err(Status::Forbidden);
        }
        let same = |origin: &str| {
            let at = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
            at.is_some_and(|at| at.eq_ignore_ascii_case(host))
        };
        // Non-browser clients send no `Origin` header and are not exposed to cross-site requests.
        if head.header("origin")?.is_some_and(|origin| !same(origin)) {
            return Err(Status::Forbidden);
        }
        let known = |token: &Token| head.query("token").is_some_and(|given| token.matches(given));
        if self.token.as_ref().is_some_and(|token| !known(token)) {
            return Err(Status::Forbidden);
        }
        Ok(())
    }
}

/// True if a `Host` header names this machine.
fn is_local(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if !port.is_empty() && port.bytes().all(|b| b.is_ascii_digit()) => name,
        // An IPv6 address without a port ends with a bracket.
        Some(_) if !host.ends_with(']') => return false,
        _ => host,
    };
    let ip = name.strip_prefix('[').and_then(|n| n.strip_suffix(']')).unwrap_or(name);
    name.eq_ignore_ascii_case("localhost") || ip.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn local_names() {
        let local = "localhost LOCALHOST:1 127.0.0.1:8080 127.0.0.2 [::1] [::1]:8080";
        let other = "example.org example.org:8080 localhost.example.org 127.0.0.1.example.org:80 10.0.0.1 : localhost: \
                     [::2]:1 0.0.0.0:80";
        let (local, other) = (local.split(' '), other.split(' ').chain([""]));
        for (host, expected) in local.map(|host| (host, true)).chain(other.map(|host| (host, false))) {
            assert_eq!(is_local(host), expected, "{host}");
        }
    }
}
