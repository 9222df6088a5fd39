//! `cargo xtask test`: all tests of the workspace against one MuJoCo version, including tests that need installed
//! software.

use crate::robots::{self, Robots};
use crate::run::{Cmd, Failure, Repo, XtaskResult};
use crate::setup::{self, MujocoVersion, Requirement, Requirements};
use crate::{physics_report, python};

#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct TestArgs {
    /// MuJoCo to test against: 2 is Debian's 2.2.2, 4 the wheel's 4.0.1 [default: MUJOCO_DIR if set, else 2]
    #[arg(long, value_enum)]
    pub(crate) mujoco: Option<MujocoVersion>,
    /// Only this package, for example kinetoscope-sim
    #[arg(long, short)]
    pub(crate) package: Option<String>,
    /// Only tests whose name contains this
    pub(crate) filter: Option<String>,
    /// Arguments of the test binaries
    #[arg(last = true)]
    pub(crate) test_args: Vec<String>,
}

/// A reason for skipped tests, and the part of their names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SkippedTests {
    name: &'static str,
    why: &'static str,
}

const NEEDS_MUJOCO_4: SkippedTests =
    SkippedTests { name: "mujoco_renderer", why: "MuJoCo's own renderer draws files of MuJoCo 4" };
const NEEDS_MUJOCO_2: SkippedTests =
    SkippedTests { name: "batch::sample_models", why: "MuJoCo's sample models are of 2.2.2" };
const NEEDS_VENDOR_ROBOTS: SkippedTests = SkippedTests {
    name: "vendor",
    why: "these tests need robots that PyPI does not have; KINETOSCOPE_ROBOTS names others",
};

const NEEDS_LEROBOT: SkippedTests =
    SkippedTests { name: "lerobot::own_loader", why: "LeRobot's own loader brings some gigabytes" };

/// Arguments for commands that do not build the whole workspace: packages whose dependencies have the features that the
/// whole workspace has. Without them, cargo compiles dependencies again, a third of all crates.
pub(crate) const SHARED_FEATURES: [&str; 8] = [
    "--package",
    "kinetoscope-cli",
    "--package",
    "kinetoscope-python",
    "--package",
    "kinetoscope-python-render",
    "--features",
    "kinetoscope-cli/foxglove,kinetoscope-cli/lerobot",
];

/// Cargo arguments that select the packages for the tests on the second MuJoCo version: packages with version-dependent
/// code, and the integration tests.
///
/// The Python packages are for this version, so their lints count here. They have no Rust tests, but their dependencies
/// have features that the whole workspace has: without them, cargo compiles a third of the crates again.
pub(crate) fn version_dependent_packages() -> [&'static str; 12] {
    [
        "--package",
        "kinetoscope-mujoco-sys",
        "--package",
        "kinetoscope-mujoco",
        "--package",
        "kinetoscope-sim",
        "--package",
        "kinetoscope",
        "--package",
        "kinetoscope-python",
        "--package",
        "kinetoscope-python-render",
    ]
}

pub(crate) fn run(repo: &Repo, args: &TestArgs) -> XtaskResult {
    match &args.package {
        Some(package) => run_packages(repo, args, &["--package", package.as_str()]),
        None => run_packages(repo, args, &["--workspace"]),
    }
}

pub(crate) fn run_packages(repo: &Repo, args: &TestArgs, packages: &[&str]) -> XtaskResult {
    const NEEDS: [Requirement; 8] = [
        Requirement::Xvfb,
        Requirement::Chromium,
        Requirement::Models,
        Requirement::Readelf,
        Requirement::Groff,
        Requirement::Pip,
        Requirement::Venv,
        Requirement::OsMesa,
    ];
    // Images are compared with MuJoCo's own renderer only if both use the same MuJoCo version.
    let with_renderer = args.mujoco == Some(MujocoVersion::Wheel);
    let needs = if with_renderer { &NEEDS[..] } else { &NEEDS[..7] };
    let ready = setup::prepare(repo, Requirements { version: args.mujoco, extras: needs })?;
    let mut left_out = vec![if with_renderer { NEEDS_MUJOCO_2 } else { NEEDS_MUJOCO_4 }];
    // A variable left over from a bless must not turn the tests into a rewrite of the golden files.
    let mut cargo = ready.cargo_once().env_remove(crate::bless::VARIABLE);
    if let Robots::FromPyPi(folder) = robots::obtain(repo)? {
        cargo = cargo.env(robots::VARIABLE, folder);
        left_out.push(NEEDS_VENDOR_ROBOTS);
    }
    // The laws of physics write their results for the comparison with the physics page.
    let everything = args.package.is_none() && args.filter.is_none() && args.test_args.is_empty();
    if let Some(line) = args.mujoco.filter(|_| everything) {
        cargo = cargo.env(physics_report::VARIABLE, physics_report::fresh_folder(repo, line)?);
    }
    if with_renderer {
        let python = python::with_mujoco(repo).filter(|python| python::OPENGL.install(python));
        cargo = cargo.env(python::VARIABLE, python.ok_or_else(|| Failure::new("no Python with MuJoCo's renderer"))?);
    }
    let readers = python::with_readers(repo).ok_or_else(|| Failure::new("no Python with readers of recordings"))?;
    if !Cmd::new(&readers).args(["-c", "import lerobot"]).quiet().succeeds() {
        left_out.push(NEEDS_LEROBOT);
    }
    cargo = cargo.env(python::READERS_VARIABLE, readers);
    for SkippedTests { name, why } in &left_out {
        eprintln!("left out: tests named `{name}`: {why}");
    }
    cargo.args(cargo_args(args, packages, &left_out)).run()
}

fn cargo_args(args: &TestArgs, packages: &[&str], left_out: &[SkippedTests]) -> Vec<String> {
    let mut words = vec!["test".to_string()];
    words.extend(packages.iter().map(|word| (*word).to_string()));
    words.extend(features(packages));
    words.extend(args.filter.clone());
    // The requirements are installed, so ignored tests run too.
    words.extend(["--", "--include-ignored"].map(String::from));
    words.extend(left_out.iter().flat_map(|left| ["--skip", left.name]).map(String::from));
    words.extend(args.test_args.iter().cloned());
    words
}

/// Features that are off by default, and crates that have them.
const FEATURES: [&str; 2] = ["foxglove", "lerobot"];
const WITH_FEATURES: [&str; 3] = ["kinetoscope", "kinetoscope-cli", "kinetoscope-record"];

/// Cargo arguments for the features to test besides the default ones, for these packages.
pub(crate) fn features(packages: &[&str]) -> Vec<String> {
    let package = match packages {
        ["--workspace"] => Some("kinetoscope-cli"),
        _ => WITH_FEATURES.into_iter().find(|name| packages.contains(name)),
    };
    let Some(package) = package else { return Vec::new() };
    let features = FEATURES.map(|feature| format!("{package}/{feature}"));
    vec!["--features".into(), features.join(",")]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// The crates that a command builds, each with its version and features. `kinds` are the dependencies that count:
    /// those of tests and examples are among them, or not.
    fn crates(kinds: &str, args: &[&str]) -> BTreeSet<String> {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
        let tree = ["tree", "--locked", "--offline", "--prefix", "none"];
        let tree = Cmd::new(env!("CARGO")).args(tree).args(["--format", "{p} [{f}]", "--edges", kinds]).args(args);
        let lines = tree.current_dir(root).output().expect("cargo knows the crates");
        let name = |line: &str| {
            let (package, features) = line.split_once(" [")?;
            // Without the folder of crates of the workspace, and marks of procedural macros and of repeated lines.
            let package: Vec<&str> = package.split_whitespace().take(2).collect();
            Some(format!("{} [{}", package.join(" "), features.trim_end_matches(" (*)")))
        };
        String::from_utf8_lossy(&lines).lines().filter_map(name).collect()
    }

    /// These commands compile no crate with other features than the tests do, but for the packages that are named.
    #[test]
    fn shared_features() {
        let all = "normal,build,dev";
        let features = features(&["--workspace"]);
        let with = |args: &[&'static str]| [args, &features.iter().map(String::as_str).collect::<Vec<_>>()].concat();
        let tests = crates(all, &with(&["--workspace"]));
        assert!(tests.len() > 100, "{tests:?}");
        let four = [&version_dependent_packages()[..], &SHARED_FEATURES].concat();
        let render = ["--package", "kinetoscope-python-render", "--features", "shared"];
        let python = ["--package", "kinetoscope-python", "--features", "shared"];
        let commands: [(&str, &[&str], &[&str]); 7] = [
            ("normal,build", &["--package", "xtask"], &["kinetoscope-workspace-hack"]),
            (all, &["--package", "kinetoscope", "--no-default-features"], &["kinetoscope", "kinetoscope-testkit"]),
            (all, &["--workspace"], &["kinetoscope-cli"]),
            (
                all,
                &with(&["--workspace", "--exclude", "kinetoscope-python", "--exclude", "kinetoscope-python-render"]),
                &[],
            ),
            (all, &four, &["kinetoscope-testkit"]),
            ("normal,build", &render, &["kinetoscope-python-render", "pyo3", "pyo3-macros"]),
            ("normal,build", &python, &["kinetoscope", "kinetoscope-python", "pyo3", "pyo3-ffi"]),
        ];
        for (kinds, args, own) in commands {
            let others = crates(kinds, args).into_iter().filter(|line| !tests.contains(line));
            let others: Vec<String> =
                others.filter(|line| !own.contains(&line.split(' ').next().unwrap_or_default())).collect();
            assert_eq!(others, [""; 0], "{args:?}: workspace-hack/Cargo.toml lacks features of the tests");
        }
    }

    #[test]
    fn whole_workspace() {
        let words = cargo_args(&TestArgs::default(), &["--workspace"], &[NEEDS_MUJOCO_4]);
        let expected = "test --workspace --features kinetoscope-cli/foxglove,kinetoscope-cli/lerobot -- --include-ignored --skip mujoco_renderer";
        assert_eq!(words.join(" "), expected);
    }

    #[test]
    fn features_of_packages() {
        for package in WITH_FEATURES {
            let expected = format!("{package}/foxglove,{package}/lerobot");
            assert_eq!(features(&["--package", package]), ["--features".to_string(), expected]);
        }
        assert!(features(&["--package", "kinetoscope-sim"]).is_empty());
        assert_eq!(features(&version_dependent_packages()), ["--features", "kinetoscope/foxglove,kinetoscope/lerobot"]);
    }

    #[test]
    fn filter_and_arguments() {
        let args =
            TestArgs { filter: Some("wheel".into()), test_args: vec!["--nocapture".into()], ..TestArgs::default() };
        let words = cargo_args(&args, &["--package", "xtask"], &[]);
        assert_eq!(words.join(" "), "test --package xtask wheel -- --include-ignored --nocapture");
    }
}
