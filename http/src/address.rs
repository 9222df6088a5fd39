//! Address parsing and listening.

use crate::error::ServeError;
use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, UdpSocket};

/// Port that needs no privileges, as a suggestion.
const UNPRIVILEGED_PORT: u16 = 8080;
/// Number of following ports that are tried as alternatives to a port in use.
const PORT_CANDIDATES: u16 = 64;

/// Parses an address such as `127.0.0.1:8080`, `[::1]:8080`, `localhost:8080`, `127.0.0.1`, which gets the default port, or
/// `8080`. Host names other than `localhost` are not resolved.
///
/// # Errors
/// The text is no such address; the error suggests others.
pub fn parse_address(given: &str, default_port: u16) -> Result<SocketAddr, ServeError> {
    let text = given.trim();
    let local = |port| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    if let Ok(address) = text.parse::<SocketAddr>() {
        return Ok(address);
    }
    if let Ok(ip) = text.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>() {
        return Ok(SocketAddr::new(ip, default_port));
    }
    if let Ok(port) = text.parse::<u16>() {
        return Ok(local(port));
    }
    let (host, port) = text.rsplit_once(':').unwrap_or((text, ""));
    let wanted = if port.is_empty() { Some(default_port) } else { port.parse::<u16>().ok() };
    if let (true, Some(port)) = (host.is_empty() || host.eq_ignore_ascii_case("localhost"), wanted) {
        return Ok(local(port));
    }
    let reason = match wanted {
        None => format!("invalid port {port:?}: ports are 0 to 65535"),
        Some(_) => format!("{host:?} is neither an IP address of this machine nor localhost"),
    };
    let port = wanted.unwrap_or(default_port);
    let candidates = vec![local(port).to_string(), SocketAddr::from((Ipv4Addr::UNSPECIFIED, port)).to_string()];
    Err(ServeError::Address { given: given.into(), reason, candidates })
}

/// Listens at an address.
///
/// # Errors
/// The operating system refuses. If the port is in use, the error suggests the next free port.
pub fn listen(address: SocketAddr) -> Result<TcpListener, ServeError> {
    let error = match TcpListener::bind(address) {
        Ok(listener) => return Ok(listener),
        Err(error) => error,
    };
    let ip = address.ip();
    match error.kind() {
        ErrorKind::AddrInUse => Err(ServeError::PortInUse { address, next: next_free(address) }),
        ErrorKind::PermissionDenied => {
            let next = next_free(SocketAddr::new(ip, UNPRIVILEGED_PORT - 1));
            Err(ServeError::Address {
                given: address.to_string(),
                reason: format!(
                    "listening on port {} needs privileges that this program does not have",
                    address.port()
                ),
                candidates: next.iter().map(ToString::to_string).collect(),
            })
        }
        ErrorKind::AddrNotAvailable => Err(ServeError::Address {
            given: address.to_string(),
            reason: format!("{ip} is not an address of this machine"),
            candidates: [IpAddr::from(Ipv4Addr::LOCALHOST), Ipv4Addr::UNSPECIFIED.into()]
                .map(|ip| SocketAddr::new(ip, address.port()).to_string())
                .to_vec(),
        }),
        _ => Err(ServeError::Listen { address, error }),
    }
}

/// Returns the same address with the next free port; `None` if the following 64 ports are in use.
fn next_free(address: SocketAddr) -> Option<SocketAddr> {
    let ports = (1..=PORT_CANDIDATES).filter_map(|k| address.port().checked_add(k));
    ports.map(|port| SocketAddr::new(address.ip(), port)).find(|address| TcpListener::bind(address).is_ok())
}

/// Returns the address under which other machines reach the server. For an unspecified address, this is the IPv4
/// address of the default network interface, or 127.0.0.1 without one.
pub fn reachable_address(address: SocketAddr) -> SocketAddr {
    if !address.ip().is_unspecified() {
        return address;
    }
    // Connecting a UDP socket sends no packet; it only selects the network interface. The destination is a reserved
    // documentation address (RFC 5737).
    let outgoing = || {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
        socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9)).ok()?;
        Some(socket.local_addr().ok()?.ip())
    };
    let ip = outgoing().filter(|ip| !ip.is_unspecified()).unwrap_or(Ipv4Addr::LOCALHOST.into());
    SocketAddr::new(ip, address.port())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;

    #[test]
    fn parsing() {
        for (given, expected) in [
            ("127.0.0.1:8080", "127.0.0.1:8080"),
            ("localhost:9000", "127.0.0.1:9000"),
            ("localhost", "127.0.0.1:8080"),
            ("9000", "127.0.0.1:9000"),
            (":9000", "127.0.0.1:9000"),
            ("0.0.0.0:80", "0.0.0.0:80"),
            ("::1", "[::1]:8080"),
            ("[::1]", "[::1]:8080"),
            ("[::1]:0", "[::1]:0"),
            (" 10.0.0.7 ", "10.0.0.7:8080"),
            ("", "127.0.0.1:8080"),
        ] {
            assert_eq!(parse_address(given, 8080).expect(given).to_string(), expected, "{given:?}");
        }
        for (given, says, candidate) in [
            ("127.0.0.1:99999", "invalid port", "127.0.0.1:8080"),
            ("example.org:8080", "neither an IP address", "127.0.0.1:8080"),
            ("localhost:eighty", "invalid port", "127.0.0.1:8080"),
            ("1.2.3:70", "neither an IP address", "127.0.0.1:70"),
            ("-1", "neither an IP address", "127.0.0.1:8080"),
        ] {
            let Err(ServeError::Address { reason, candidates, .. }) = parse_address(given, 8080) else {
                panic!("{given:?}")
            };
            assert!(reason.contains(says), "{given:?}: {reason}");
            assert_eq!(candidates[0], candidate, "{given:?}");
        }
    }

    #[test]
    fn refused_by_the_system() {
        // A reserved documentation address (RFC 5737), which no machine has.
        let error = listen("192.0.2.1:0".parse().unwrap()).unwrap_err();
        assert!(matches!(&error, ServeError::Address { .. }), "{error}");
        assert!(error.to_string().contains("not an address of this machine"), "{error}");
    }
}
