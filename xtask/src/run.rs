//! Child processes, the repository, and the failure type of all commands.

use crate::own_time::OwnTime;
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use std::{env, fmt, thread};

/// An error message, the command that repeats the failure, and the exit code.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) message: String,
    pub(crate) repeat_command: Option<String>,
    pub(crate) code: u8,
}

pub(crate) type XtaskResult<T = ()> = Result<T, Failure>;

impl Failure {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), repeat_command: None, code: 1 }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error: {}", self.message)?;
        match &self.repeat_command {
            Some(again) => write!(f, "\nto repeat it: {again}"),
            None => Ok(()),
        }
    }
}

impl From<String> for Failure {
    fn from(message: String) -> Self {
        Self::new(message)
    }
}

/// Combines several findings of one check into one failure; `Ok` without findings.
pub(crate) fn no_findings(what: &str, findings: &[String]) -> XtaskResult {
    if findings.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!("{what}:\n  {}", findings.join("\n  "))))
}

/// True on a build machine, where skipping is not allowed.
pub(crate) fn in_ci() -> bool {
    env::var("CI").is_ok_and(|v| !v.is_empty() && v != "false" && v != "0")
}

/// The first file called `name` on the search path.
pub(crate) fn which(name: &str) -> Option<PathBuf> {
    env::split_paths(&env::var_os("PATH")?).map(|dir| dir.join(name)).find(|file| file.is_file())
}

/// The checked-out repository.
#[derive(Debug)]
pub(crate) struct Repo {
    pub(crate) root: PathBuf,
    /// Cargo's target folder; everything downloaded or unpacked goes below it.
    pub(crate) target: PathBuf,
    /// `cargo metadata --no-deps`.
    pub(crate) metadata: Value,
}

impl Repo {
    pub(crate) fn find() -> XtaskResult<Self> {
        // Cargo sets the variable for `cargo run`; the compiled-in value serves a binary started directly.
        let manifest_dir =
            env::var_os("CARGO_MANIFEST_DIR").map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
        let output = Cmd::new("cargo")
            .args(["metadata", "--format-version", "1", "--no-deps"])
            .current_dir(&manifest_dir)
            .output()?;
        let metadata: Value = serde_json::from_slice(&output)
            .map_err(|e| Failure::new(format!("`cargo metadata` did not print JSON: {e}")))?;
        let folder = |key: &str| {
            metadata[key].as_str().map(PathBuf::from).ok_or_else(|| format!("`cargo metadata` has no `{key}`"))
        };
        Ok(Self { root: folder("workspace_root")?, target: folder("target_directory")?, metadata })
    }

    pub(crate) fn read(&self, path: &str) -> XtaskResult<String> {
        std::fs::read_to_string(self.root.join(path)).map_err(|e| Failure::new(format!("{path}: {e}")))
    }
}

/// A child process that can be printed as the command line a user would type.
#[derive(Debug)]
pub(crate) struct Cmd {
    inner: Command,
    program: String,
    shown_env: Vec<(String, String)>,
    shown_args: Vec<String>,
}

impl Cmd {
    /// Creates a command with closed standard input, so that a program that asks a question does not wait.
    pub(crate) fn new(program: impl AsRef<OsStr>) -> Self {
        let program = program.as_ref();
        let mut inner = match env::var_os("CARGO") {
            Some(cargo) if program == "cargo" => Command::new(cargo),
            _ => Command::new(program),
        };
        inner.stdin(Stdio::null());
        Self { inner, program: program.to_string_lossy().into_owned(), shown_env: Vec::new(), shown_args: Vec::new() }
    }

    pub(crate) fn arg(mut self, arg: impl AsRef<OsStr>) -> Self {
        self.shown_args.push(arg.as_ref().to_string_lossy().into_owned());
        self.inner.arg(arg);
        self
    }

    pub(crate) fn args(self, args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Self {
        args.into_iter().fold(self, |cmd, arg| cmd.arg(arg))
    }

    pub(crate) fn env(mut self, key: &str, value: impl AsRef<OsStr>) -> Self {
        self.shown_env.retain(|(known, _)| known != key);
        self.shown_env.push((key.to_string(), value.as_ref().to_string_lossy().into_owned()));
        self.inner.env(key, value);
        self
    }

    /// Sets a variable whose value is no use in a command line.
    pub(crate) fn unprinted_env(mut self, key: &str, value: impl AsRef<OsStr>) -> Self {
        self.inner.env(key, value);
        self
    }

    pub(crate) fn env_remove(mut self, key: &str) -> Self {
        self.inner.env_remove(key);
        self
    }

    pub(crate) fn current_dir(mut self, dir: impl AsRef<Path>) -> Self {
        self.inner.current_dir(dir);
        self
    }

    pub(crate) fn quiet(mut self) -> Self {
        self.inner.stdout(Stdio::null()).stderr(Stdio::null());
        self
    }

    pub(crate) fn inherit_stdin(mut self) -> Self {
        self.inner.stdin(Stdio::inherit());
        self
    }

    /// Prints the command line, streams the output, and fails unless the exit code is 0.
    pub(crate) fn run(mut self) -> XtaskResult {
        eprintln!("$ {self}");
        let status = self.inner.status().map_err(|e| self.not_started(&e))?;
        self.check(status)
    }

    /// True if the program started and its exit code is 0; prints nothing of its own.
    pub(crate) fn succeeds(mut self) -> bool {
        self.inner.status().is_ok_and(|status| status.success())
    }

    /// Standard output of a silent run; standard error goes into the failure's message.
    pub(crate) fn output(mut self) -> XtaskResult<Vec<u8>> {
        let output = self.inner.output().map_err(|e| self.not_started(&e))?;
        self.check(output.status).map_err(|mut failure| {
            failure.message = format!("{}\n{}", failure.message, String::from_utf8_lossy(&output.stderr).trim_end());
            failure
        })?;
        Ok(output.stdout)
    }

    /// Runs the program with visible standard error. Returns true for exit code 0, and the standard output.
    pub(crate) fn success_and_output(mut self) -> XtaskResult<(bool, String)> {
        eprintln!("$ {self}");
        self.inner.stderr(Stdio::inherit());
        let output = self.inner.output().map_err(|e| self.not_started(&e))?;
        Ok((output.status.success(), String::from_utf8_lossy(&output.stdout).into_owned()))
    }

    /// Runs the program with both outputs in a file. Returns true for exit code 0.
    pub(crate) fn run_logged(mut self, log: &Path) -> XtaskResult<bool> {
        eprintln!("$ {self}");
        let file = || std::fs::File::options().append(true).open(log);
        let outputs = std::fs::write(log, "").and_then(|()| Ok((file()?, file()?)));
        let (out, err) = outputs.map_err(|e| Failure::new(format!("{}: {e}", log.display())))?;
        let status = self.inner.stdout(out).stderr(err).status().map_err(|e| self.not_started(&e))?;
        Ok(status.success())
    }

    /// The exit code, and the estimated run time without the load of other programs. Fails if the program runs longer
    /// than `limit`, after killing it, or if a signal ended it.
    pub(crate) fn exit_code_within(mut self, limit: Duration) -> XtaskResult<(i32, Duration)> {
        eprintln!("$ {self}");
        let mut child = self.inner.spawn().map_err(|e| self.not_started(&e))?;
        let start = Instant::now();
        let mut own = OwnTime::of(child.id());
        loop {
            own.update();
            if let Some(status) = child.try_wait().map_err(|e| self.not_started(&e))? {
                return match status.code() {
                    Some(code) => Ok((code, own.elapsed())),
                    None => Err(self.failure(format!("`{self}` was ended by a signal ({status})"), 1)),
                };
            }
            if start.elapsed() > limit {
                let _ = child.kill();
                let _ = child.wait();
                return Err(self.failure(format!("`{self}` still ran after {} s", limit.as_secs()), 1));
            }
            thread::sleep(Duration::from_millis(20));
        }
    }

    fn check(&self, status: ExitStatus) -> XtaskResult {
        if status.success() {
            return Ok(());
        }
        let code = status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1);
        Err(self.failure(format!("`{self}` failed ({status})"), code))
    }

    fn not_started(&self, error: &std::io::Error) -> Failure {
        self.failure(format!("`{self}` could not be run: {error}"), 1)
    }

    fn failure(&self, message: String, code: u8) -> Failure {
        Failure { message, repeat_command: Some(self.to_string()), code }
    }
}

impl fmt::Display for Cmd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (key, value) in &self.shown_env {
            write!(f, "{key}={} ", quoted(value))?;
        }
        write!(f, "{}", quoted(&self.program))?;
        self.shown_args.iter().try_for_each(|arg| write!(f, " {}", quoted(arg)))
    }
}

/// Quotes a word for a shell if needed.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_string()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shown() {
        let cmd = Cmd::new("cargo").args(["doc", "--no-deps", "joint[1-6]"]).env("RUSTDOCFLAGS", "-D warnings");
        assert_eq!(cmd.to_string(), "RUSTDOCFLAGS='-D warnings' cargo doc --no-deps 'joint[1-6]'");
    }

    #[test]
    fn exit_code() {
        let failure = Cmd::new("sh").args(["-c", "exit 7"]).run().expect_err("exit code 7");
        assert_eq!(failure.code, 7);
        assert_eq!(failure.repeat_command.as_deref(), Some("sh -c 'exit 7'"));
    }

    #[test]
    fn time_limit() {
        let start = Instant::now();
        let result = Cmd::new("sleep").arg("60").exit_code_within(Duration::from_millis(100));
        assert!(result.is_err());
        assert!(start.elapsed() < Duration::from_secs(20));
    }

    #[test]
    fn no_program() {
        assert!(Cmd::new("no-such-program-here").output().is_err());
        assert!(!Cmd::new("no-such-program-here").succeeds());
    }
}
