//! Output of the libraries' events.

use std::io::IsTerminal as _;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

/// Installs a subscriber that prints events of the libraries to the standard error stream. Panics if there already is
/// one. `RUST_LOG` selects the events (`RUST_LOG=kinetoscope_sim=debug`); without it, only errors are printed, because
/// the command itself reports warnings.
pub(crate) fn print_to_stderr() {
    let errors = || EnvFilter::builder().with_default_directive(LevelFilter::ERROR.into());
    let filter = errors().from_env().unwrap_or_else(|error| {
        eprintln!("warning: RUST_LOG: {error}; only errors are logged");
        errors().parse_lossy("")
    });
    let ansi = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    tracing_subscriber::fmt().with_env_filter(filter).with_ansi(ansi).with_writer(std::io::stderr).init();
}
