//! An X server without a screen (Xvfb).

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use x11rb::rust_connection::RustConnection;

/// An X server of its own.
pub(crate) struct Display {
    pub(crate) server: Child,
    pub(crate) name: String,
}

impl Display {
    /// `None` where there is no Xvfb; in CI that is a failure. `cargo xtask test` installs it.
    pub(crate) fn start(screen: &str) -> Option<Self> {
        let screen = format!("{screen}x24");
        let command = ["-displayfd", "1", "-screen", "0", &screen, "-nolisten", "tcp", "-noreset"];
        let started = Command::new("Xvfb").args(command).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let Ok(mut server) = started else {
            assert!(std::env::var_os("CI").is_none(), "Xvfb is not there; cargo xtask test installs it");
            eprintln!("note: without Xvfb no window is opened (cargo xtask test installs it)");
            return None;
        };
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Some(Self { server, name: format!(":{}", number.trim()) })
    }

    /// Sends the server a signal by its name.
    pub(crate) fn signal(&self, name: &str) {
        let sent = Command::new("kill").args(["-s", name, &self.server.id().to_string()]).status().unwrap();
        assert!(sent.success(), "{name}");
    }

    pub(crate) fn connect(&self) -> RustConnection {
        x11rb::connect(Some(&self.name)).unwrap().0
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}
