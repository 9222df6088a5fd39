//! `cargo xtask python-cfg`: writes the configuration classes of the Python package from the Rust structs.

use crate::run::{Repo, XtaskResult};
use crate::setup::{self, MujocoVersion, Prepared, Requirements};

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
    let mut cargo = ready.cargo().args(["run", "--quiet", "--package", "kinetoscope-python-cfg"]);
    if check {
        cargo = cargo.args(["--", "--check"]);
    }
    cargo.run()
}
