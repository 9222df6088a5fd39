//! `cargo xtask bless`: rewrites the golden files with the current output.

use crate::run::{Cmd, Repo, XtaskResult};
use crate::setup::{self, MujocoVersion, Requirements};

/// Environment variable that makes golden tests rewrite their files.
pub(crate) const VARIABLE: &str = "KINETOSCOPE_BLESS";

#[derive(Debug, clap::Args)]
pub(crate) struct BlessArgs {
    /// Only golden tests whose name contains this
    #[arg(default_value = "golden")]
    filter: String,
}

pub(crate) fn run(repo: &Repo, args: &BlessArgs) -> XtaskResult {
    // Some golden files belong to one supported MuJoCo version.
    for line in [MujocoVersion::Debian, MujocoVersion::Wheel] {
        let ready = setup::prepare(repo, Requirements { version: Some(line), extras: &[] })?;
        ready.cargo().env(VARIABLE, "1").args(["test", "--workspace", &args.filter]).run()?;
    }
    let status = Cmd::new("git")
        .args(["status", "--short", "--", "tests/data", "render/tests/data"])
        .current_dir(&repo.root)
        .output()?;
    let status = String::from_utf8_lossy(&status);
    if status.trim().is_empty() {
        println!("\nno golden changed");
    } else {
        println!("\nchanged; look at each (`git diff`, images in a viewer) before you commit:");
        print!("{status}");
    }
    Ok(())
}
