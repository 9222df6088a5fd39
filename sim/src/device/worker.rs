//! A worker process with the physics of a device: the module `kinetoscope.warp.worker` of the Python package.
//!
//! Requests and answers go through the pipes of the process. Each is a line of JSON, followed by as many bytes as its
//! field `bytes` says: numbers in little-endian order.

use super::{Device, DeviceError, DevicePhysics};
use serde::Deserialize;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Names the Python interpreter of the worker; `python3` without it.
const PYTHON: &str = "KINETOSCOPE_PYTHON";

/// Lines of the error output of a worker that an error quotes.
const QUOTED_LINES: usize = 12;

/// A running worker process. Dropping it ends the process.
#[derive(Debug)]
pub(super) struct Worker {
    device: Device,
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
    /// Error output of the process.
    log: tempfile::NamedTempFile,
}

/// Line of an answer.
#[derive(Debug, Deserialize)]
struct Answer {
    ok: bool,
    /// Bytes that follow.
    #[serde(default)]
    bytes: usize,
    /// Report on a step.
    #[serde(default)]
    report: Option<Value>,
    /// Error of the worker.
    #[serde(default)]
    error: String,
    /// Kind of the error.
    #[serde(default)]
    kind: String,
}

impl Worker {
    /// Starts the worker of a device and waits until it is ready.
    pub(super) fn start(device: Device) -> Result<Self, DeviceError> {
        let python = std::env::var_os(PYTHON).unwrap_or_else(|| "python3".into());
        Self::start_with(device, &python)
    }

    fn start_with(device: Device, python: &OsString) -> Result<Self, DeviceError> {
        let name = python.display();
        let unavailable = |message: String| DeviceError::Unavailable { device, message };
        let no_log = |error: std::io::Error| unavailable(format!("no temporary file for its messages: {error}"));
        let log = tempfile::NamedTempFile::new().map_err(no_log)?;
        let mut command = Command::new(python);
        command.args(["-m", "kinetoscope.warp.worker", "--device", &device.to_string()]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        command.stderr(Stdio::from(log.reopen().map_err(no_log)?));
        let mut child = command.spawn().map_err(|error| {
            unavailable(format!("{name} does not start: {error}; name a Python 3.11 or newer in {PYTHON}"))
        })?;
        let (Some(requests), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(unavailable("the worker has no pipes".into()));
        };
        let mut worker = Self { device, child, requests, answers: BufReader::new(answers), log };
        let answer = worker.answer().map_err(|error| {
            unavailable(format!(
                "{error}; it needs the Python package kinetoscope, which names packages that are missing; {PYTHON} can name \
                 another Python"
            ))
        })?;
        if answer.ok { Ok(worker) } else { Err(unavailable(answer.error)) }
    }

    /// Reads the line of an answer. The error says how the worker ended.
    fn answer(&mut self) -> Result<Answer, String> {
        let mut line = String::new();
        match self.answers.read_line(&mut line) {
            Ok(0) => Err(self.describe_end()),
            Ok(_) => serde_json::from_str(&line).map_err(|error| format!("the worker answered {line:?}: {error}")),
            Err(error) => Err(format!("{}: {error}", self.describe_end())),
        }
    }

    /// Exit status of the worker, with the end of its error output.
    fn describe_end(&mut self) -> String {
        // It closed its pipe, so it ends, or does not answer again.
        let _ = self.child.kill();
        let status = self.child.wait().map_or_else(|error| error.to_string(), |status| status.to_string());
        let mut text = String::new();
        if let Ok(mut log) = File::open(self.log.path()) {
            let mut bytes = Vec::new();
            let _ = log.read_to_end(&mut bytes);
            text = String::from_utf8_lossy(&bytes).into_owned();
        }
        let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
        let quoted = lines[lines.len().saturating_sub(QUOTED_LINES)..].join("\n");
        let quoted = if quoted.is_empty() { String::new() } else { format!(":\n{quoted}") };
        format!("the worker process ended ({status}){quoted}")
    }

    /// Sends a request with bytes and waits for the answer, whose bytes it returns.
    fn request(&mut self, mut request: Value, bytes: &[u8]) -> Result<(Answer, Vec<u8>), DeviceError> {
        request["bytes"] = bytes.len().into();
        let sent = writeln!(self.requests, "{request}")
            .and_then(|()| self.requests.write_all(bytes))
            .and_then(|()| self.requests.flush());
        if sent.is_err() {
            return Err(DeviceError::Failed(self.describe_end()));
        }
        let answer = self.answer().map_err(DeviceError::Failed)?;
        let mut bytes = vec![0; answer.bytes];
        if self.answers.read_exact(&mut bytes).is_err() {
            return Err(DeviceError::Failed(self.describe_end()));
        }
        match (answer.ok, answer.kind.as_str()) {
            (true, _) => Ok((answer, bytes)),
            (false, "unsupported") => {
                Err(DeviceError::Unsupported { what: format!("this scene on {}", self.device), expected: answer.error })
            }
            (false, _) => Err(DeviceError::Failed(answer.error)),
        }
    }
}

impl DevicePhysics for Worker {
    fn load(&mut self, folder: &Path, scene: &str, num_envs: usize) -> Result<(), DeviceError> {
        let request = json!({ "op": "load", "folder": folder, "scene": scene, "num_envs": num_envs });
        self.request(request, &[]).map(|_| ())
    }

    fn write(&mut self, array: &str, envs: &[i32], values: &[f32]) -> Result<(), DeviceError> {
        let mut bytes = Vec::with_capacity(size_of_val(envs) + size_of_val(values));
        envs.iter().for_each(|env| bytes.extend_from_slice(&env.to_le_bytes()));
        values.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
        self.request(json!({ "op": "write", "name": array, "envs": envs.len() }), &bytes).map(|_| ())
    }

    fn step(&mut self, steps: u32, capture: &[&str]) -> Result<String, DeviceError> {
        let (answer, _) = self.request(json!({ "op": "step", "steps": steps, "capture": capture }), &[])?;
        let report = answer.report.map(|report| report.to_string());
        report.ok_or_else(|| DeviceError::Failed("the worker sent no report on a step".into()))
    }

    fn read(&mut self, array: &str) -> Result<Vec<f32>, DeviceError> {
        let (_, bytes) = self.request(json!({ "op": "read", "name": array }), &[])?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|number| f32::from_le_bytes(*number)).collect())
    }

    fn as_any(&self) -> &dyn std::any::Any {
        self
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // It has nothing to save.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals() {
        for (python, message) in [
            ("/nonexistent/python", "/nonexistent/python does not start: No such file or directory"),
            ("false", "the worker process ended (exit status: 1); it needs the Python package kinetoscope"),
        ] {
            let error = Worker::start_with(Device::WarpCpu, &python.into()).expect_err("no worker").to_string();
            assert!(error.starts_with(&format!("device warp-cpu: {message}")), "{error}");
        }
    }
}
