//! `cargo xtask test`: every test of the workspace, doctests included, against one MuJoCo.

use crate::run::{Failure, Outcome, Repo, in_ci};
use crate::setup::{self, Line, Need, Wanted};
use crate::{physics_report, python};

#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct TestArgs {
    /// MuJoCo to test against: 2 is Debian's 2.2.2, 4 the wheel's 4.0.0 [default: MUJOCO_DIR if set, else 2]
    #[arg(long, value_enum)]
    pub(crate) mujoco: Option<Line>,
    /// Only this package, for example kinetoscope-sim
    #[arg(long, short)]
    pub(crate) package: Option<String>,
    /// Only tests whose name contains this
    pub(crate) filter: Option<String>,
    /// Arguments of the test binaries
    #[arg(last = true)]
    pub(crate) test_args: Vec<String>,
}

pub(crate) fn run(repo: &Repo, args: &TestArgs) -> Outcome {
    // MuJoCo's own renderer is a judge of our pictures where both have the same MuJoCo.
    let judged = args.mujoco == Some(Line::Wheel);
    // Readers that nobody here wrote are judges of our recordings.
    let extras: &[Need] = match judged {
        true => &[Need::Xvfb, Need::Pip, Need::Venv, Need::OsMesa],
        false => &[Need::Xvfb, Need::Pip, Need::Venv],
    };
    let ready = setup::prepare(repo, Wanted { line: args.mujoco, extras })?;
    // A variable left over from a bless must not turn the tests into a rewrite of what they compare with.
    let mut cargo = ready.cargo().env_remove(crate::bless::VARIABLE).args(cargo_args(args));
    // The laws of physics write what they measure, for the page of numbers to be compared with.
    let everything = args.package.is_none() && args.filter.is_none() && args.test_args.is_empty();
    if let Some(line) = args.mujoco.filter(|_| everything) {
        cargo = cargo.env(physics_report::VARIABLE, physics_report::fresh_folder(repo, line)?);
    }
    if judged {
        match python::with_mujoco(repo).filter(|python| python::OPENGL.install(python)) {
            Some(python) => cargo = cargo.env(python::VARIABLE, python),
            None if in_ci() => return Err(Failure::new("MuJoCo's renderer, a judge of our pictures, is not there")),
            None => eprintln!("note: pictures are not compared with those of MuJoCo's renderer"),
        }
    }
    match python::with_readers(repo) {
        Some(python) => cargo = cargo.env(python::READERS_VARIABLE, python),
        None if in_ci() => return Err(Failure::new("the readers of recordings, their judges, are not there")),
        None => eprintln!("note: recordings are not read by other programs"),
    }
    cargo.run()
}

fn cargo_args(args: &TestArgs) -> Vec<String> {
    let mut words = vec!["test".to_string()];
    match &args.package {
        Some(package) => words.extend(["--package".to_string(), package.clone()]),
        None => words.push("--workspace".to_string()),
    }
    words.extend(features(args.package.as_deref()));
    words.extend(args.filter.clone());
    if !args.test_args.is_empty() {
        words.push("--".to_string());
        words.extend(args.test_args.iter().cloned());
    }
    words
}

/// Crates that have the feature of recordings as HDF5, which is off by default.
const WITH_HDF5: [&str; 3] = ["kinetoscope", "kinetoscope-cli", "kinetoscope-record"];

/// What is off by default and is to be checked too, in the whole workspace or in a package.
pub(crate) fn features(package: Option<&str>) -> Vec<String> {
    let feature = match package {
        None => "kinetoscope-cli/hdf5",
        Some(package) if WITH_HDF5.contains(&package) => "hdf5",
        Some(_) => return Vec::new(),
    };
    ["--features", feature].map(String::from).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_arguments_everything_is_tested() {
        assert_eq!(cargo_args(&TestArgs::default()), ["test", "--workspace", "--features", "kinetoscope-cli/hdf5"]);
    }

    #[test]
    fn packages_are_tested_with_their_feature() {
        for package in WITH_HDF5 {
            assert_eq!(features(Some(package)), ["--features", "hdf5"]);
        }
        assert!(features(Some("kinetoscope-sim")).is_empty());
    }

    #[test]
    fn package_filter_and_test_arguments_are_handed_on() {
        let args = TestArgs {
            package: Some("xtask".into()),
            filter: Some("wheel".into()),
            test_args: vec!["--nocapture".into()],
            ..TestArgs::default()
        };
        assert_eq!(cargo_args(&args), ["test", "--package", "xtask", "wheel", "--", "--nocapture"]);
    }
}
