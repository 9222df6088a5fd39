//! Access control: refuses requests from other websites and requests without the token.

use crate::error::ServeError;
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
    /// Websites whose pages may connect; `None` if only the pages of this server may, and no other program with an origin.
    websites: Option<Vec<String>>,
}

impl AccessPolicy {
    /// Creates the policy of an address, with a token if other machines can reach it.
    pub fn new(address: SocketAddr, token: Option<Token>) -> Self {
        Self { local: address.ip().is_loopback(), token, websites: None }
    }

    /// Also accepts the pages of some websites, such as `https://app.foxglove.dev`, and programs that send an origin but
    /// are no websites, such as `file://`.
    ///
    /// # Errors
    /// A text is not the origin of a website.
    pub fn with_websites(self, websites: Vec<String>) -> Result<Self, ServeError> {
        match websites.iter().find(|origin| !is_origin(origin)) {
            Some(wrong) => Err(ServeError::Origin { given: wrong.clone() }),
            None => Ok(Self { websites: Some(websites), ..self }),
        }
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
        if head.header("origin")?.is_some_and(|origin| !same(origin) && !self.accepts_foreign(origin)) {
            return Err(Status::Forbidden);
        }
        let known = |token: &Token| head.query("token").is_some_and(|given| token.matches(given));
        if self.token.as_ref().is_some_and(|token| !known(token)) {
            return Err(Status::Forbidden);
        }
        Ok(())
    }

    fn accepts_foreign(&self, origin: &str) -> bool {
        let is_named = |websites: &Vec<String>| websites.iter().any(|website| website.eq_ignore_ascii_case(origin));
        self.websites.as_ref().is_some_and(|websites| !is_website(origin) || is_named(websites))
    }
}

/// True for the text of an `Origin` header: scheme, host and port, or `null`.
fn is_origin(text: &str) -> bool {
    let host = text.split_once("://").map(|(_, host)| host);
    text == "null" || host.is_some_and(|host| !host.is_empty() && !host.contains(['/', '?', '#', ' ', '*']))
}

/// True for the origin of pages from the network. A sandboxed page of any website has the origin `null`.
fn is_website(origin: &str) -> bool {
    let scheme = origin.split_once("://").map(|(scheme, _)| scheme);
    scheme.is_none_or(|scheme| ["http", "https"].into_iter().any(|one| one.eq_ignore_ascii_case(scheme)))
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

    fn check(policy: &AccessPolicy, more: &str) -> Result<(), Status> {
        let head = format!("GET / HTTP/1.1\r\nHost: 127.0.0.1:80\r\n{more}\r\n");
        policy.check(&RequestHead::parse(head.as_bytes())?.expect("a complete head"))
    }

    #[test]
    fn websites() {
        let own_pages = AccessPolicy::new(SocketAddr::from(([127, 0, 0, 1], 80)), None);
        let named = vec!["https://app.example.org".to_string()];
        let with_websites = own_pages.clone().with_websites(named).expect("an origin");
        for (origin, by_own_pages, by_named) in [
            ("http://127.0.0.1:80", true, true),
            ("https://app.example.org", false, true),
            ("HTTPS://app.example.org", false, true),
            ("file://", false, true),
            ("app://viewer", false, true),
            ("http://app.example.org", false, false),
            ("https://app.example.org:8443", false, false),
            ("https://app.example.org.example.com", false, false),
            ("HTTP://example.com", false, false),
            ("http://127.0.0.1:81", false, false),
            ("null", false, false),
            ("", false, false),
        ] {
            let header = format!("Origin: {origin}\r\n");
            assert_eq!(check(&own_pages, &header).is_ok(), by_own_pages, "{origin}");
            assert_eq!(check(&with_websites, &header).is_ok(), by_named, "{origin}");
        }
        assert_eq!(check(&with_websites, ""), Ok(()), "programs that are no browsers");
        let twice = "Origin: https://app.example.org\r\nOrigin: file://\r\n";
        assert_eq!(check(&with_websites, twice), Err(Status::BadRequest));
        for (text, accepted) in [
            ("null", true),
            ("http://localhost:8080", true),
            ("https://example.org/", false),
            ("example.org", false),
            ("https://*", false),
            ("", false),
        ] {
            let policy = own_pages.clone().with_websites(vec![text.into()]);
            assert_eq!(policy.is_ok(), accepted, "{text}");
        }
        let null = own_pages.with_websites(vec!["null".into()]).expect("an origin");
        assert_eq!(check(&null, "Origin: null\r\n"), Ok(()));
    }

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
