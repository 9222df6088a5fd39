//! `cargo xtask python-cfg`: writes the configuration classes of the Python package from the Rust structs.

use crate::run::{Repo, XtaskResult};
use crate::setup::{self, MujocoVersion, Prepared, Requirements};
use crate::test;

const PACKAGE: &str = "kinetoscope-python-cfg";

#[derive(Debug, clap::Args)]
pub(crate) struct PythonCfgArgs {
    /// Compare with the committed files; write nothing
    #[arg(long)]
    check: bool,
}

pub(crate) fn run(repo: &Repo, args: &PythonCfgArgs) -> XtaskResult {
    let ready = setup::prepare(repo, Requirements { version: Some(MujocoVersion::Debian), extras: &[] })?;
    generate(&ready, args.check)
}

/// Reports a difference between the committed files and the structs.
pub(crate) fn check(ready: &Prepared) -> XtaskResult {
    generate(ready, true)
}

fn generate(ready: &Prepared, check: bool) -> XtaskResult {
    // With the features of the whole workspace, the tests use the same compiled crates.
    let all = ["--workspace"];
    ready.cargo().args(["build", "--quiet"]).args(all).args(test::features(&all)).args(["--bin", PACKAGE]).run()?;
    let program = ready.program(ready.binary(PACKAGE));
    if check { program.arg("--check").run() } else { program.run() }
}
