//! Generates `python/sim/kinetoscope/cfg/`: the configuration structs as dataclasses.
//!
//! Names, types and documentation come from the Rust sources, default values from the running program. With `--check`,
//! the files are compared instead of written. Run it with `cargo xtask python-cfg`.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]
#![forbid(unsafe_code)]

mod python;
mod source;
mod types;
mod words;

use std::path::Path;
use std::process::ExitCode;

/// Folder of the generated modules.
const FOLDER: &str = "python/sim/kinetoscope/cfg";

fn main() -> ExitCode {
    let checks = std::env::args().any(|argument| argument == "--check");
    match run(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."), checks) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

fn run(root: &Path, checks: bool) -> Result<(), String> {
    let folder = root.join(FOLDER);
    let files = python::modules(root)?;
    for (name, text) in &files {
        let file = folder.join(name);
        let current = std::fs::read_to_string(&file).unwrap_or_default();
        if !checks {
            let written = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&file, text));
            written.map_err(|error| format!("{}: {error}", file.display()))?;
        } else if current != *text {
            let first = current.lines().zip(text.lines()).position(|(old, new)| old != new);
            let first = first.unwrap_or_else(|| current.lines().count().min(text.lines().count())) + 1;
            return Err(format!(
                "{FOLDER}/{name} does not fit the Rust structs (first difference in line {first}); run cargo xtask python-cfg"
            ));
        }
    }
    let other = |name: &String| name.ends_with(".py") && files.iter().all(|(known, _)| known != name);
    let entries = std::fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    match names.find(other) {
        Some(name) => Err(format!("{FOLDER}/{name} is not generated: remove it")),
        None => Ok(()),
    }
}
