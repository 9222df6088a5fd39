//! A baseline in Python: a process that receives commands over pipes (see `baselines/*.py`), one line each way.

use crate::settings::BenchResult;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

/// Environment variable with a python that can import mujoco 4; set by `cargo xtask bench`.
const PYTHON: &str = "KINETOSCOPE_PYTHON4";

/// Environment variable with a python that can import this project's package `kinetoscope`; set by `cargo xtask bench`.
const PACKAGE: &str = "KINETOSCOPE_PYTHON_PACKAGE";

/// The python with this project's package; `None` with a message if no such Python is named, or if this build is for
/// another MuJoCo version than the package.
pub(crate) fn python_with_package() -> Option<OsString> {
    if BUILD_VERSION != SupportedVersion::V4 {
        eprintln!("  left out: the Python package is for MuJoCo 4, and this build is for 2.2.2");
        return None;
    }
    let python = std::env::var_os(PACKAGE);
    if python.is_none() {
        eprintln!("  left out: {PACKAGE} is not set to a Python that can import kinetoscope");
    }
    python
}

/// Environment variable with a python that can import mjbatch; set by `cargo xtask bench`.
const MJBATCH: &str = "KINETOSCOPE_PYTHON_MJBATCH";

/// The python with the package `mjbatch`; `None` with a message if no such Python is named, or if this build is for
/// MuJoCo 2.2.2.
pub(crate) fn python_with_mjbatch() -> Option<OsString> {
    let python = std::env::var_os(MJBATCH).filter(|_| BUILD_VERSION == SupportedVersion::V4);
    if python.is_none() {
        eprintln!(
            "  without mjbatch: {MJBATCH} is not set to a Python that can import mjbatch, or this is MuJoCo 2.2.2"
        );
    }
    python
}

/// The python of the baselines; `None` with a message if there is no such python, or if this build is for another
/// MuJoCo version.
pub(crate) fn python(baselines: &str) -> Option<OsString> {
    if BUILD_VERSION != SupportedVersion::V4 {
        eprintln!("  without {baselines}: MuJoCo 4 is needed, and this build is for 2.2.2");
        return None;
    }
    let python = std::env::var_os(PYTHON);
    if python.is_none() {
        eprintln!("  without {baselines}: {PYTHON} is not set to a Python that can import mujoco 4");
    }
    python
}

/// True if `python` runs this line without an error.
pub(crate) fn can_run(python: &OsString, line: &str) -> bool {
    let mut command = Command::new(python);
    command.args(["-c", line]).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// A script that runs until it is dropped.
#[derive(Debug)]
pub(crate) struct Process {
    script: &'static str,
    process: Child,
    /// Standard input of the script; closing it ends the process.
    commands: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
    _job: tempfile::TempDir,
}

impl Process {
    /// Starts a script of `baselines/` with a job, which may name files in `folder`.
    pub(crate) fn start(
        python: &OsString,
        script: &'static str,
        job: &serde_json::Value,
        folder: tempfile::TempDir,
    ) -> BenchResult<Self> {
        let file = folder.path().join("job.json");
        std::fs::write(&file, job.to_string())?;
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("baselines").join(script);
        let mut process =
            Command::new(python).arg(path).arg(file).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let commands = process.stdin.take();
        let answers = BufReader::new(process.stdout.take().ok_or("the baseline has no standard output")?);
        Ok(Self { script, process, commands, answers, _job: folder })
    }

    /// Sends a line and waits for the answer.
    pub(crate) fn request(&mut self, command: &str) -> BenchResult<String> {
        let commands = self.commands.as_mut().ok_or("the baseline has exited")?;
        writeln!(commands, "{command}")?;
        commands.flush()?;
        let mut line = String::new();
        self.answers.read_line(&mut line)?;
        if line.is_empty() { Err(format!("{} ended early", self.script).into()) } else { Ok(line.trim().into()) }
    }

    /// Sends the command `block`; returns the time of these steps.
    pub(crate) fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        Ok(Duration::from_secs_f64(self.request(&format!("block {steps}"))?.parse()?))
    }

    /// Sends a command with an answer in hexadecimal bytes.
    pub(crate) fn bytes(&mut self, command: &str) -> BenchResult<Vec<u8>> {
        let hex = self.request(command)?;
        let byte = |i: usize| u8::from_str_radix(hex.get(i..i + 2).unwrap_or(""), 16);
        Ok((0..hex.len()).step_by(2).map(byte).collect::<Result<_, _>>()?)
    }

    /// Process id.
    pub(crate) fn id(&self) -> u32 {
        self.process.id()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Closing its standard input ends the process.
        self.commands = None;
        let _ = self.process.wait();
    }
}
