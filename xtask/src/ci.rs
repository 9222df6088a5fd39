//! `cargo xtask ci`: all checks of a change, stage by stage, on both supported MuJoCo versions.

use crate::docs_check::TEST_COMMAND;
use crate::examples::RowSelection;
use crate::physics_report::{self, PhysicsReportArgs};
use crate::run::{Cmd, Failure, Repo, XtaskResult, in_ci, no_findings};
use crate::setup::{self, MujocoVersion, Prepared, Requirement, Requirements};
use crate::source_check::files_below;
use crate::test::{self, TestArgs};
use crate::{
    deny, dependencies, docs_check, examples, fuzz, import_cycles, language, msrv, mutate, own_time, package,
    python_cfg, python_package, python_simulation, site, source_check, spelling, wheel,
};
use serde_json::json;
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

#[derive(Debug, clap::Args)]
pub(crate) struct CiArgs {
    /// Only fast checks: formatting, rules of the tree, clippy, unit tests
    #[arg(long)]
    quick: bool,
    /// Only this stage
    #[arg(long, value_name = "STAGE", value_parser = clap::builder::PossibleValuesParser::new(STAGES.iter().map(|s| s.name)), conflicts_with = "quick")]
    only: Option<String>,
}

/// One stage of the run.
#[derive(Debug)]
struct Stage {
    name: &'static str,
    what: &'static str,
    when: When,
    run: fn(&Context<'_>) -> XtaskResult,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum When {
    Always,
    /// Left out by `--quick`.
    Full,
    /// Left out without `--quick`: a larger stage covers it.
    Quick,
    /// Left out by `--quick`, and on a developer's machine that cannot download the wheel.
    Wheel,
    /// Left out unless `--only` names it.
    Named,
}

#[derive(Debug)]
struct Context<'a> {
    repo: &'a Repo,
    /// Lines of `git status` before the first stage; `None` outside of a git repository.
    changed_before: Option<BTreeSet<String>>,
}

impl Context<'_> {
    fn debian(&self) -> XtaskResult<Prepared> {
        setup::prepare(self.repo, Requirements { version: Some(MujocoVersion::Debian), extras: &[] })
    }

    fn wheel(&self) -> XtaskResult<Prepared> {
        setup::prepare(self.repo, Requirements { version: Some(MujocoVersion::Wheel), extras: &[] })
    }
}

const STAGES: &[Stage] = &[
    Stage { name: "setup", what: "what the machine lacks", when: When::Always, run: install },
    Stage { name: "fmt", what: "formatting", when: When::Always, run: fmt },
    Stage {
        name: "dependencies",
        what: "dependencies between crates",
        when: When::Always,
        run: |c| dependencies::run(c.repo),
    },
    Stage {
        name: "cycles",
        what: "import cycles between files",
        when: When::Always,
        run: |c| import_cycles::run(c.repo),
    },
    Stage { name: "rules", what: "rules of the tree", when: When::Always, run: rules },
    Stage {
        name: "language",
        what: "words of comments, messages and pages; spelling",
        when: When::Always,
        run: language,
    },
    Stage {
        name: "docs",
        what: "commands and links of the pages",
        when: When::Always,
        run: |c| docs_check::run(c.repo),
    },
    Stage {
        name: "deny",
        what: "licenses, sources and known faults of third-party crates",
        // It asks the registry.
        when: When::Full,
        run: |c| deny::run(c.repo),
    },
    Stage {
        name: "package",
        what: "packages for crates.io",
        // It asks the registry.
        when: When::Full,
        run: |c| package::run(c.repo, &c.debian()?),
    },
    Stage {
        name: "msrv",
        what: "the oldest supported Rust",
        when: When::Full,
        run: |c| msrv::run(c.repo, &c.debian()?),
    },
    Stage { name: "clippy", what: "lints", when: When::Always, run: |c| clippy(&c.debian()?, &["--workspace"]) },
    Stage { name: "unit", what: "unit tests, MuJoCo 2.2.2", when: When::Quick, run: unit_tests },
    Stage {
        name: "python-cfg",
        what: "the configuration classes of the Python package",
        when: When::Full,
        run: |c| python_cfg::check(&c.debian()?),
    },
    Stage { name: "rustdoc", what: "documentation", when: When::Full, run: rustdoc },
    Stage {
        name: "docs-rs",
        what: "documentation without MuJoCo, as on docs.rs",
        when: When::Full,
        run: |c| package::docs_rs(c.repo, &c.debian()?),
    },
    Stage { name: "demo", what: "the README's first command", when: When::Full, run: demo },
    Stage { name: "test", what: "the README's second command, MuJoCo 2.2.2", when: When::Full, run: readme_test },
    Stage {
        name: "examples",
        what: "examples, MuJoCo 2.2.2",
        when: When::Full,
        run: |c| examples::run(c.repo, &c.debian()?, &["--workspace"], RowSelection::All),
    },
    Stage {
        name: "clippy-4",
        what: "lints, MuJoCo 4",
        when: When::Wheel,
        // Only their build scripts know the version's `cfg`; the compiler's lint `unexpected_cfgs` rejects it elsewhere.
        run: |c| clippy(&c.wheel()?, &["--package", "kinetoscope-mujoco-sys", "--package", "kinetoscope-mujoco"]),
    },
    Stage { name: "test-4", what: "tests, MuJoCo 4", when: When::Wheel, run: wheel_test },
    Stage { name: "physics", what: "the physics page, both MuJoCo versions", when: When::Wheel, run: physics },
    Stage {
        name: "examples-4",
        what: "examples, MuJoCo 4",
        when: When::Wheel,
        run: |c| {
            examples::run(c.repo, &c.wheel()?, &test::version_dependent_packages(), RowSelection::VersionDependent)
        },
    },
    Stage {
        name: "python",
        what: "the Python package kinetoscope-render with several versions of mujoco",
        when: When::Wheel,
        run: |c| python_package::test(c.repo),
    },
    Stage {
        name: "python-sim",
        what: "the Python package kinetoscope",
        when: When::Wheel,
        run: |c| python_simulation::test(c.repo),
    },
    Stage {
        name: "fuzz",
        what: "arbitrary input, 20 s for each reader",
        // It compiles most of the workspace again, for the sanitizer.
        when: When::Named,
        run: |c| fuzz::check(c.repo),
    },
    Stage { name: "leftovers", what: "nothing left behind in the tree", when: When::Full, run: leftovers },
];

/// Wall and CPU time of a stage.
#[derive(Debug)]
struct StageTime {
    stage: &'static str,
    /// "passed", "failed" or "skipped".
    result: &'static str,
    wall: Duration,
    /// User and system processor time of all programs that the stage started; zero if the kernel does not report it.
    cpu: Duration,
}

pub(crate) fn run(repo: &Repo, args: &CiArgs) -> XtaskResult {
    let context = Context { repo, changed_before: changed_files(repo) };
    // Rows of an earlier run belong to earlier code.
    physics_report::clear_rows(repo)?;
    let chosen = chosen(args);
    let start = Instant::now();
    let mut table = Vec::new();
    for (at, stage) in chosen.iter().enumerate() {
        println!("\n=== {}/{} {}: {} [{}]", at + 1, chosen.len(), stage.name, stage.what, clock(start.elapsed()));
        if stage.when == When::Wheel && !in_ci() && !wheel::is_available(repo) {
            println!("skipped: MuJoCo {} is downloaded with pip, and pip is missing", wheel::VERSION);
            table.push(StageTime { stage: stage.name, result: "skipped", wall: Duration::ZERO, cpu: Duration::ZERO });
            continue;
        }
        let (wall, cpu) = (Instant::now(), own_time::of_children());
        let result = (stage.run)(&context);
        table.push(StageTime {
            stage: stage.name,
            result: if result.is_ok() { "passed" } else { "failed" },
            wall: wall.elapsed(),
            cpu: own_time::of_children().saturating_sub(cpu),
        });
        if let Err(failure) = result {
            report(repo, &table, start.elapsed())?;
            let again = failure.repeat_command.unwrap_or_else(|| format!("cargo xtask ci --only {}", stage.name));
            let message = format!("stage `{}` failed: {}", stage.name, failure.message);
            return Err(Failure { message, repeat_command: Some(again), code: 1 });
        }
    }
    report(repo, &table, start.elapsed())
}

/// Prints the table of stages and writes it to `ci-times.json` in the target folder.
fn report(repo: &Repo, table: &[StageTime], total: Duration) -> XtaskResult {
    print!("\n{}", lines(table, total));
    let seconds = |time: Duration| (10.0 * time.as_secs_f64()).round() / 10.0;
    let stage = |took: &StageTime| {
        json!({
            "stage": took.stage,
            "result": took.result,
            "wall_seconds": seconds(took.wall),
            "cpu_seconds": seconds(took.cpu),
        })
    };
    let cpu: Duration = table.iter().map(|took| took.cpu).sum();
    let report = json!({
        "stages": table.iter().map(stage).collect::<Vec<_>>(),
        "wall_seconds": seconds(total),
        "cpu_seconds": seconds(cpu),
    });
    let path = repo.target.join("ci-times.json");
    std::fs::write(&path, format!("{report:#}\n")).map_err(|e| Failure::new(format!("{}: {e}", path.display())))
}

/// The table: wall and CPU time of each stage.
fn lines(table: &[StageTime], total: Duration) -> String {
    let mut lines = format!("{:<12} {:>7} {:>7}\n", "stage", "wall", "CPU");
    for StageTime { stage, result, wall, cpu } in table {
        let note = if *result == "passed" { "" } else { result };
        lines.push_str(format!("{stage:<12} {:>7} {:>7} {note}", clock(*wall), clock(*cpu)).trim_end());
        lines.push('\n');
    }
    let cpu = table.iter().map(|took| took.cpu).sum();
    lines + &format!("{:<12} {:>7} {:>7}\n", "total", clock(total), clock(cpu))
}

fn chosen(args: &CiArgs) -> Vec<&'static Stage> {
    STAGES
        .iter()
        .filter(|stage| match &args.only {
            Some(name) => stage.name == name,
            None if args.quick => matches!(stage.when, When::Always | When::Quick),
            None => !matches!(stage.when, When::Quick | When::Named),
        })
        .collect()
}

fn clock(time: Duration) -> String {
    format!("{}:{:02}", time.as_secs() / 60, time.as_secs() % 60)
}

fn install(context: &Context<'_>) -> XtaskResult {
    setup::prepare(
        context.repo,
        Requirements {
            version: Some(MujocoVersion::Debian),
            extras: &[Requirement::Models, Requirement::Pip, Requirement::Chromium],
        },
    )
    .map(|_| ())
}

fn rules(context: &Context<'_>) -> XtaskResult {
    source_check::run(context.repo)?;
    mutate::check(&context.repo.root)
}

fn language(context: &Context<'_>) -> XtaskResult {
    language::run(context.repo)?;
    spelling::run(context.repo)
}

fn fmt(context: &Context<'_>) -> XtaskResult {
    // `cargo fmt` does not see the modules that the lists of variants declare in macros.
    let root = &context.repo.root;
    let files = files_below(root).into_iter().filter(|path| path.ends_with(".rs"));
    let check = Cmd::new("rustfmt").args(["--edition", "2024", "--check"]).args(files).current_dir(root);
    // The message of a failed command would name every file.
    let hint = "rustfmt failed, or files are not formatted; CONTRIBUTING.md has the command that formats all";
    check.run().map_err(|_| Failure::new(hint))
}

fn clippy(ready: &Prepared, packages: &[&str]) -> XtaskResult {
    let cargo = ready.cargo().arg("clippy").args(packages).arg("--all-targets").args(test::features(packages));
    cargo.args(["--", "-D", "warnings"]).run()
}

fn unit_tests(context: &Context<'_>) -> XtaskResult {
    context
        .debian()?
        .cargo()
        .args(["test", "--workspace", "--lib", "--bins"])
        // An extension module links no Python, so its tests cannot be linked.
        .args(["--exclude", "kinetoscope-python", "--exclude", "kinetoscope-python-render"])
        .args(test::features(&["--workspace"]))
        .run()
}

fn rustdoc(context: &Context<'_>) -> XtaskResult {
    let cargo = context.debian()?.cargo().env("RUSTDOCFLAGS", "-D warnings");
    cargo.args(["doc", "--no-deps"]).args(site::PUBLISHED).args(test::features(&["--workspace"])).run()?;
    // The packages without published documentation have internals in their links.
    let cargo = context.debian()?.cargo().env("RUSTDOCFLAGS", "-D warnings");
    let packages = ["--package", "kinetoscope-benches", "--package", "kinetoscope-testkit", "--package", "xtask"];
    cargo.args(["doc", "--no-deps"]).args(packages).args(test::SHARED_FEATURES).run()
}

fn demo(context: &Context<'_>) -> XtaskResult {
    let [command, _] = docs_check::README_COMMANDS;
    docs_check::parse(command).map_err(|e| Failure::new(e.to_string()))?.run(context.repo)
}

/// Parses the command line of the README, so that CI runs exactly the documented command.
fn readme_test(context: &Context<'_>) -> XtaskResult {
    let cli = docs_check::parse(TEST_COMMAND).map_err(|e| Failure::new(e.to_string()))?;
    let args = cli.test_args().ok_or_else(|| Failure::new(format!("`{TEST_COMMAND}` is not a test command")))?;
    // Without a version in the command, CI tests 2.2.2 here and ignores a MUJOCO_DIR of the caller: another stage tests
    // the other version.
    test::run(context.repo, &TestArgs { mujoco: Some(args.mujoco.unwrap_or(MujocoVersion::Debian)), ..args.clone() })
        .map_err(|failure| Failure { repeat_command: Some(TEST_COMMAND.to_string()), ..failure })
}

fn wheel_test(context: &Context<'_>) -> XtaskResult {
    // Tests in documentation do not depend on the version, and examples have a stage of their own.
    let packages = [&test::version_dependent_packages()[..], &["--tests"]].concat();
    test::run_packages(context.repo, &TestArgs { mujoco: Some(MujocoVersion::Wheel), ..TestArgs::default() }, &packages)
        .map_err(|failure| Failure { repeat_command: Some(format!("{TEST_COMMAND} --mujoco 4")), ..failure })
}

/// Checks the physics page against the rows that the tests of both versions wrote. If they have not run before this
/// stage, they run now.
fn physics(context: &Context<'_>) -> XtaskResult {
    if physics_report::has_rows(context.repo) {
        return physics_report::check_rows(context.repo);
    }
    physics_report::run(context.repo, &PhysicsReportArgs { check: true })
}

/// Reports MuJoCo's log file, and files that tests or examples wrote into the tree.
fn leftovers(context: &Context<'_>) -> XtaskResult {
    let mut findings: Vec<String> =
        files_below(&context.repo.root).into_iter().filter(|path| path.ends_with("MUJOCO_LOG.TXT")).collect();
    match (&context.changed_before, changed_files(context.repo)) {
        (Some(before), Some(after)) => findings.extend(after.difference(before).cloned()),
        _ => println!("not a git repository: only looked for MUJOCO_LOG.TXT"),
    }
    no_findings("these files were left behind or changed while CI ran", &findings)
}

/// Lines of `git status`: all changes and all untracked files that are not ignored.
fn changed_files(repo: &Repo) -> Option<BTreeSet<String>> {
    let status = Cmd::new("git")
        .args(["status", "--porcelain", "--untracked-files=all"])
        .current_dir(&repo.root)
        .output()
        .ok()?;
    Some(String::from_utf8_lossy(&status).lines().map(|line| line.trim_end().to_string()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(quick: bool, only: Option<&str>) -> Vec<&'static str> {
        chosen(&CiArgs { quick, only: only.map(str::to_string) }).iter().map(|stage| stage.name).collect()
    }

    #[test]
    fn quick_run() {
        assert_eq!(
            names(true, None),
            ["setup", "fmt", "dependencies", "cycles", "rules", "language", "docs", "clippy", "unit"]
        );
    }

    #[test]
    fn full_run() {
        let names = names(false, None);
        assert!(!names.contains(&"unit"));
        assert!(names.contains(&"test") && names.contains(&"test-4"));
        let at = |name| names.iter().position(|other| *other == name);
        assert!(at("physics") > at("test-4"), "it compares what the tests wrote");
        assert_eq!(names.last(), Some(&"leftovers"));
    }

    #[test]
    fn one_stage() {
        for stage in STAGES {
            assert_eq!(names(false, Some(stage.name)), [stage.name]);
        }
    }

    #[test]
    fn table_of_times() {
        let second = Duration::from_secs(1);
        let took = |stage, result, wall, cpu| StageTime { stage, result, wall: wall * second, cpu: cpu * second };
        let table = [took("fmt", "passed", 1, 2), took("test", "failed", 61, 119)];
        let lines = lines(&table, 63 * second);
        let words: Vec<Vec<&str>> = lines.lines().map(|line| line.split_whitespace().collect()).collect();
        let expected = ["stage wall CPU", "fmt 0:01 0:02", "test 1:01 1:59 failed", "total 1:03 2:01"];
        assert_eq!(words, expected.map(|line| line.split(' ').collect::<Vec<_>>()));
    }

    /// A new file is reported, and so is MuJoCo's log although git ignores it.
    #[test]
    fn files_left_behind() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        let git = |args: &[&str]| Cmd::new("git").args(args).current_dir(dir.path()).output().expect("git works");
        git(&["init", "--quiet"]);
        let repo =
            Repo { root: dir.path().into(), target: dir.path().join("target"), metadata: serde_json::Value::Null };
        let write = |file: &str| crate::wheel::tests::write(&dir.path().join(file), "");
        write("before.txt");
        let context = Context { repo: &repo, changed_before: changed_files(&repo) };
        assert!(leftovers(&context).is_ok());
        write("sub/dump.xml");
        let failure = leftovers(&context).expect_err("a new file");
        assert!(failure.message.contains("sub/dump.xml"), "{failure}");
        let context = Context { repo: &repo, changed_before: None };
        assert!(leftovers(&context).is_ok());
        write("sim/MUJOCO_LOG.TXT");
        assert!(leftovers(&context).is_err());
    }
}
