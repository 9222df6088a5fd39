//! An X server without a screen (Xvfb).

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use x11rb::rust_connection::RustConnection;

/// An X server without a screen; it ends with the value.
#[derive(Debug)]
pub struct Display {
    /// The process.
    pub server: Child,
    /// The name that clients connect to, for example `:1`.
    pub name: String,
}

impl Display {
    /// Starts a server with a screen of this size, for example `800x600`.
    ///
    /// # Panics
    /// If Xvfb is not installed.
    #[must_use]
    pub fn start(screen: &str) -> Self {
        let screen = format!("{screen}x24");
        let command = ["-displayfd", "1", "-screen", "0", &screen, "-nolisten", "tcp", "-noreset"];
        let started = Command::new("Xvfb").args(command).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut server = started.expect("Xvfb: apt-get install xvfb, or `cargo xtask test`");
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Self { server, name: format!(":{}", number.trim()) }
    }

    /// Sends the server a signal by its name.
    ///
    /// # Panics
    /// If it cannot be sent.
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill").args(["-s", name, &self.server.id().to_string()]).status().unwrap();
        assert!(sent.success(), "{name}");
    }

    /// Connects as a client.
    ///
    /// # Panics
    /// If the server does not accept.
    #[must_use]
    pub fn connect(&self) -> RustConnection {
        x11rb::connect(Some(&self.name)).unwrap().0
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}
