//! Generates `python/sim/kinetoscope/cfg.py`: the configuration structs as dataclasses.
//!
//! Names, types and documentation come from the Rust sources, default values from the running program. With `--check`,
//! the file is compared instead of written. Run it with `cargo xtask python-cfg`.
#![forbid(unsafe_code)]

mod python;
mod source;
mod types;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let file: PathBuf = root.join("python/sim/kinetoscope/cfg.py");
    let text = match python::module(&root) {
        Ok(text) => text,
        Err(problem) => {
            eprintln!("{problem}");
            return ExitCode::FAILURE;
        }
    };
    let checks = std::env::args().any(|argument| argument == "--check");
    let current = std::fs::read_to_string(&file).unwrap_or_default();
    if checks && current != text {
        let first = current.lines().zip(text.lines()).position(|(old, new)| old != new);
        eprintln!(
            "python/sim/kinetoscope/cfg.py does not fit the Rust structs (first difference in line {}); run cargo xtask python-cfg",
            first.map_or_else(|| current.lines().count().min(text.lines().count()) + 1, |line| line + 1)
        );
        return ExitCode::FAILURE;
    }
    if !checks && let Err(error) = std::fs::write(&file, text) {
        eprintln!("{}: {error}", file.display());
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
