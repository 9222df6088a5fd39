//! Who may come in: not the pages of other sites, and not those without the token.

use super::answer::Status;
use super::head::Head;
use super::token::Token;
use std::net::{IpAddr, SocketAddr};

/// The rules of one view.
#[derive(Clone, Debug)]
pub(super) struct Door {
    /// Only this machine can reach it.
    local: bool,
    token: Option<Token>,
}

impl Door {
    /// A door at the address, with a token where other machines can reach it.
    pub(super) fn new(address: SocketAddr, token: Option<Token>) -> Self {
        Self { local: address.ip().is_loopback(), token }
    }

    /// Lets a request in or says why not.
    ///
    /// Where only this machine can reach the view, a browser on it still can be told by any page to ask us. The page's own
    /// origin gives it away, or, where its name was made to point to this machine (DNS rebinding), the host it asks for: on
    /// a local view that has to be this machine's. The port may differ, because of tunnels.
    pub(super) fn check(&self, head: &Head) -> Result<(), Status> {
        let host = head.header("host")?.ok_or(Status::BadRequest)?;
        if self.local && !is_local(host) {
            return Err(Status::Forbidden);
        }
        let same = |origin: &str| {
            let at = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
            at.is_some_and(|at| at.eq_ignore_ascii_case(host))
        };
        // Programs that are no browsers send none: nobody can make them come here against their will.
        if head.header("origin")?.is_some_and(|origin| !same(origin)) {
            return Err(Status::Forbidden);
        }
        let known = |token: &Token| head.query("token").is_some_and(|given| token.is(given));
        if self.token.as_ref().is_some_and(|token| !known(token)) {
            return Err(Status::Forbidden);
        }
        Ok(())
    }
}

/// Whether a `Host` header names this machine.
fn is_local(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if !port.is_empty() && port.bytes().all(|b| b.is_ascii_digit()) => name,
        // An IPv6 address without a port ends with its bracket.
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
