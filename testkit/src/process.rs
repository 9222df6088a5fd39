//! Tests in their own process, which count its threads, memory and files, set its variables, or may end it.
//!
//! The scenario is a test marked `#[ignore = "runs in a process of its own"]` that returns at once unless [`is_child`].
//! The test that checks the scenario calls [`run`].

use std::path::Path;
use std::process::{Command, Output};

/// Environment variable that is set in child processes only.
const CHILD_VARIABLE: &str = "KINETOSCOPE_TEST_CHILD";

/// True in a process that [`run`] or [`command`] started.
pub fn is_child() -> bool {
    std::env::var_os(CHILD_VARIABLE).is_some()
}

/// Command that runs one test of this binary alone. `module` is `module_path!()` of the test, `test` its name.
pub fn command(module: &str, test: &str) -> Command {
    // Names of tests lack the name of the binary.
    let name = module.split_once("::").map_or_else(|| test.to_string(), |(_, path)| format!("{path}::{test}"));
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", &name, "--include-ignored", "--nocapture", "--test-threads=1"]).env(CHILD_VARIABLE, "1");
    command
}

/// Runs one test of this binary in folder `dir` and waits for its end.
pub fn run(module: &str, test: &str, dir: &Path, variables: &[(&str, &str)]) -> Output {
    command(module, test).current_dir(dir).envs(variables.iter().copied()).output().unwrap()
}

/// Output as text.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs one test of this binary and asserts that it passes. Otherwise, its output is the panic message.
#[track_caller]
pub fn assert_passes(module: &str, test: &str, variables: &[(&str, &str)]) {
    let output = run(module, test, &std::env::temp_dir(), variables);
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| text(bytes));
    assert!(output.status.success() && out.contains("1 passed"), "{module}::{test}: {out}{err}");
}
