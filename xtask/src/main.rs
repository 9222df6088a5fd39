//! The project's commands: `cargo xtask demo | test | ci | docs | wheel | bench | physics-report | mutate | fuzz | soak |
//! bless | package | python-cfg`.
//!
//! Every command first installs missing software on the machine (`setup.rs`). This crate depends on no crate with
//! MuJoCo, so that it builds before MuJoCo is installed.
//!
//! | module | content |
//! |---|---|
//! | `demo`, `test`, `ci`, `site` (`docs`), `python_package`, `python_simulation` (`wheel`), `python_cfg`, `bench`, `physics_report`, `mutate`, `fuzz`, `soak`, `bless`, `package` | the commands |
//! | `setup`, `wheel`, `robots`, `python` | installation of MuJoCo, robots and Python packages |
//! | `run`, `own_time`, `progress` | child processes, their processor time, progress lines |
//! | `dependencies`, `import_cycles`, `source_check`, `docs_check`, `faults` | checks of dependencies, import cycles, sources and pages |
//! | `language`, `spelling` | checks of words, retired names and spelling |
//! | `examples`, `same_images` | the table of example runs, and the comparison of their images |
//! | `physics_page`, `svg` | the page of the laws of physics, and its plots |
//! | `mutations` | the lists of code mutations |
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]
#![forbid(unsafe_code)]

mod bench;
mod bless;
mod ci;
mod demo;
mod deny;
mod dependencies;
mod docs_check;
mod examples;
mod faults;
mod fuzz;
mod import_cycles;
mod language;
mod msrv;
mod mutate;
mod mutations;
mod own_time;
mod package;
mod physics_page;
mod physics_report;
mod progress;
mod python;
mod python_cfg;
mod python_package;
mod python_simulation;
mod robots;
mod run;
mod same_images;
mod setup;
mod site;
mod soak;
mod source_check;
mod spelling;
mod svg;
mod test;
mod wheel;

use clap::{Parser, Subcommand};
use run::{Repo, XtaskResult};
use std::process::ExitCode;

/// Kinetoscope's commands.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Install missing software and run the first example, without a window
    Demo(demo::DemoArgs),
    /// Install missing software and run all tests
    Test(test::TestArgs),
    /// Run all checks of a change
    Ci(ci::CiArgs),
    /// Build the book and the API documentation into target/site, a folder that a web server can serve as it is
    ///
    /// The first run compiles mdbook into target/tools, which takes some minutes. Links between pages, to the API and to
    /// source files are checked.
    Docs(site::DocsArgs),
    /// Build the wheels of the Python packages kinetoscope-render and kinetoscope into target/wheels
    Wheel(python_package::WheelArgs),
    /// Compare with the baselines; without a name also writes benches/RESULTS.md
    Bench(bench::BenchArgs),
    /// Check the laws of physics on both supported MuJoCo versions; writes docs/physics.md
    PhysicsReport(physics_report::PhysicsReportArgs),
    /// Mutate the code in many places, one at a time, and report the tests that fail
    Mutate(mutate::MutateArgs),
    /// Feed arbitrary input to the readers of files and requests, with a nightly compiler
    Fuzz(fuzz::FuzzArgs),
    /// Run a mixed job for a long time, and fail if memory, file descriptors or threads grow
    ///
    /// A short run says which growth it could have found. All samples are written to target/soak.csv.
    Soak(soak::SoakArgs),
    /// Rewrite the golden files of the tests with the current output
    Bless(bless::BlessArgs),
    /// Make the packages for crates.io, and compile each from its archive
    Package,
    /// Write the configuration classes of the Python package from the Rust structs
    PythonCfg(python_cfg::PythonCfgArgs),
}

impl Cli {
    fn run(&self, repo: &Repo) -> XtaskResult {
        match &self.command {
            Task::Demo(args) => demo::run(repo, args),
            Task::Test(args) => test::run(repo, args),
            Task::Ci(args) => ci::run(repo, args),
            Task::Docs(args) => site::run(repo, args),
            Task::Wheel(args) => python_package::run(repo, args),
            Task::Bench(args) => bench::run(repo, args),
            Task::PhysicsReport(args) => physics_report::run(repo, args),
            Task::Mutate(args) => mutate::run(repo, args),
            Task::Fuzz(args) => fuzz::run(repo, args),
            Task::Soak(args) => soak::run(repo, args),
            Task::Bless(args) => bless::run(repo, args),
            Task::Package => package::compile_all(repo),
            Task::PythonCfg(args) => python_cfg::run(repo, args),
        }
    }

    fn test_args(&self) -> Option<&test::TestArgs> {
        match &self.command {
            Task::Test(args) => Some(args),
            _ => None,
        }
    }
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match Repo::find().and_then(|repo| cli.run(&repo)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::from(failure.code)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn command_line() {
        Cli::command().debug_assert();
        for (line, valid) in [("4", true), ("3", false)] {
            assert_eq!(Cli::try_parse_from(["cargo xtask", "test", "--mujoco", line]).is_ok(), valid, "{line}");
        }
    }

    #[test]
    fn test_arguments() {
        let cli = Cli::try_parse_from(["cargo xtask", "test", "gravity", "--", "--nocapture"]).expect("valid");
        let Task::Test(args) = cli.command else { panic!("parsed as another task") };
        assert_eq!(args.filter.as_deref(), Some("gravity"));
        assert_eq!(args.test_args, ["--nocapture"]);
    }

    #[test]
    fn demo_flags() {
        for line in [
            &["cargo xtask", "demo", "--steps", "7"][..],
            &["cargo xtask", "demo", "--", "--steps", "7"],
            &["cargo xtask", "demo", "--yes", "--steps", "7"],
        ] {
            let cli = Cli::try_parse_from(line).expect("valid");
            let Task::Demo(args) = cli.command else { panic!("parsed as another task") };
            assert_eq!(args.args, ["--steps", "7"]);
        }
    }
}
