//! `cargo xtask soak`: a mixed job for a long time, and many simulations that are created and dropped, in one process. It
//! fails if memory, file descriptors or threads grow (`benches/src/soak`).

use crate::run::{Repo, XtaskResult};
use crate::setup::{self, MujocoVersion, Requirements};

/// Settings of glibc's allocator that lower the noise of the resident memory, from 25 MB to 3 MB.
///
/// The usual eight memory areas per core, each with the largest memory that a view session has used, fill up one after the
/// other, which takes more than ten minutes on two cores. Large freed blocks return to the system at once.
const ALLOCATOR: [(&str, &str); 3] =
    [("MALLOC_ARENA_MAX", "2"), ("MALLOC_MMAP_THRESHOLD_", "65536"), ("MALLOC_TRIM_THRESHOLD_", "65536")];

#[derive(Debug, clap::Args)]
pub(crate) struct SoakArgs {
    /// Duration of the mixed job, in minutes; 0 to leave it out
    #[arg(long, default_value_t = 60.0)]
    minutes: f64,
    /// Number of simulations that are created and dropped after it; 0 to leave them out
    #[arg(long, default_value_t = 10_000)]
    cycles: u64,
    /// Leak this number of bytes in each cycle, to show that the check can fail
    #[arg(long, hide = true, default_value_t = 0)]
    leak: usize,
}

pub(crate) fn run(repo: &Repo, args: &SoakArgs) -> XtaskResult {
    let ready = setup::prepare(repo, Requirements { version: Some(MujocoVersion::Debian), extras: &[] })?;
    let samples = repo.target.join("soak.csv");
    let cmd = ALLOCATOR.iter().fold(ready.cargo(), |cmd, (variable, value)| cmd.env(variable, value));
    let cmd = cmd.args(["run", "--release", "--package", "kinetoscope-benches", "--bin", "kinetoscope-soak"]);
    let cmd = cmd.arg("--").args(["--minutes", &args.minutes.to_string(), "--cycles", &args.cycles.to_string()]);
    cmd.args(["--leak", &args.leak.to_string()]).arg("--samples").arg(samples).run()
}
