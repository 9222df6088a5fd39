//! `cargo xtask bless`: rewrites the goldens from what the code gives now.

use crate::run::{Cmd, Outcome, Repo};
use crate::setup::{self, Wanted};

/// Tests that compare with a golden rewrite it instead when this is set.
pub(crate) const VARIABLE: &str = "KINETOSCOPE_BLESS";

#[derive(Debug, clap::Args)]
pub(crate) struct BlessArgs {
    /// Only golden tests whose name contains this
    #[arg(default_value = "golden")]
    filter: String,
}

pub(crate) fn run(repo: &Repo, args: &BlessArgs) -> Outcome {
    let ready = setup::prepare(repo, Wanted::default())?;
    ready.cargo().env(VARIABLE, "1").args(["test", "--workspace", &args.filter]).run()?;
    let status = Cmd::new("git").args(["status", "--short", "--", "tests/data"]).current_dir(&repo.root).output()?;
    let status = String::from_utf8_lossy(&status);
    if status.trim().is_empty() {
        println!("\nno golden in tests/data changed");
    } else {
        println!(
            "\nchanged in tests/data; look at each (`git diff -- tests/data`, pictures in a viewer) before you commit:"
        );
        print!("{status}");
    }
    Ok(())
}
