//! `cargo xtask fuzz`: runs the fuzz targets of `fuzz/`, which feed arbitrary input to the readers of files and requests.
//!
//! The targets need a nightly compiler, and run under the address sanitizer. New inputs of a run are in
//! `target/fuzz/TARGET`; the committed corpus is only read.

use crate::python::CARGO_FUZZ;
use crate::run::{Cmd, Failure, Repo, XtaskResult, in_ci};
use crate::setup::{self, MujocoVersion, Requirements};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;
use std::{fs, thread};

/// The toolchain of the targets only.
const TOOLCHAIN: &str = "nightly";

/// Limits of one input. Most inputs take milliseconds; the sanitizer's own memory is part of the 2 GiB.
const LIMITS: [&str; 4] = ["-max_len=20480", "-timeout=10", "-rss_limit_mb=2048", "-detect_leaks=0"];

#[derive(Clone, Debug, clap::Args)]
pub(crate) struct FuzzArgs {
    /// Only this target: a file of fuzz/targets
    target: Option<String>,
    /// Minutes for each target
    #[arg(long, default_value_t = 1.0)]
    minutes: f64,
}

/// Result of one target.
#[derive(Debug, PartialEq, Eq)]
struct Outcome {
    target: String,
    executions: u64,
    /// Covered edges of the program, all of its edges, and features: edges with the number of their executions.
    coverage: u64,
    edges: u64,
    features: u64,
    /// File of an input that failed.
    failing_input: Option<PathBuf>,
}

/// Folders and files of the runs.
#[derive(Debug)]
struct Fuzzer<'a> {
    repo: &'a Repo,
    time: Duration,
}

pub(crate) fn run(repo: &Repo, args: &FuzzArgs) -> XtaskResult {
    let time = Duration::try_from_secs_f64(60.0 * args.minutes)
        .ok()
        .filter(|time| time.as_secs() > 0)
        .ok_or_else(|| Failure::new(format!("--minutes {}: expected at least one second", args.minutes)))?;
    let all = targets(repo)?;
    let chosen = match &args.target {
        None => all,
        Some(name) if all.contains(name) => vec![name.clone()],
        Some(name) => return Err(Failure::new(format!("there is no target {name}; there are {}", all.join(", ")))),
    };
    fuzz(repo, &chosen, time)
}

/// Runs each target for 20 s from the committed corpus alone.
pub(crate) fn check(repo: &Repo) -> XtaskResult {
    let targets = targets(repo)?;
    for target in &targets {
        let folder = repo.target.join("fuzz").join(target);
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(|error| io_failure(&folder, &error))?;
        }
    }
    fuzz(repo, &targets, Duration::from_secs(20))
}

fn fuzz(repo: &Repo, targets: &[String], time: Duration) -> XtaskResult {
    let wanted = Requirements { version: Some(MujocoVersion::Debian), extras: &[] };
    setup::prepare(repo, wanted)?;
    if !has_toolchain()? {
        return Ok(());
    }
    let Some(program) = CARGO_FUZZ.obtain(repo, "reading of arbitrary input")? else { return Ok(()) };
    let fuzzer = Fuzzer { repo, time };
    let build = Cmd::new(&program).args(["build", "--dev", "--fuzz-dir"]).arg(repo.root.join("fuzz"));
    let build = build.arg("--target-dir").arg(fuzzer.build_folder());
    // Cargo sets variables of the toolchain in use for the programs that it starts.
    let build = build.env("RUSTUP_TOOLCHAIN", TOOLCHAIN).env_remove("CARGO").env_remove("RUSTC");
    let build = build.env_remove("CARGO_TARGET_DIR").env_remove("MUJOCO_DIR").current_dir(&repo.root);
    match targets {
        [target] => build.arg(target).run()?,
        _ => build.run()?,
    }
    let outcomes = fuzzer.run_all(targets)?;
    report(repo, &outcomes)
}

/// Installs the toolchain if it is missing.
///
/// # Errors
/// In CI: the toolchain could not be installed. Elsewhere this is false, with a note.
fn has_toolchain() -> XtaskResult<bool> {
    let has = || Cmd::new("rustup").args(["run", TOOLCHAIN, "rustc", "--version"]).quiet().succeeds();
    let install = || Cmd::new("rustup").args(["toolchain", "install", TOOLCHAIN, "--profile", "minimal"]).run();
    if has() || install().is_ok() && has() {
        return Ok(true);
    }
    let message = format!("fuzz targets need the toolchain {TOOLCHAIN}, which rustup could not install");
    if in_ci() {
        return Err(Failure::new(message));
    }
    eprintln!("note: {message}");
    Ok(false)
}

/// Names of all targets: the programs in the manifest of `fuzz/`.
fn targets(repo: &Repo) -> XtaskResult<Vec<String>> {
    let manifest = repo.read("fuzz/Cargo.toml")?;
    let names = manifest.split("[[bin]]").skip(1).filter_map(|program| program.split('"').nth(1));
    Ok(names.map(str::to_string).collect())
}

fn io_failure(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(format!("{}: {error}", path.display()))
}

impl Fuzzer<'_> {
    fn build_folder(&self) -> PathBuf {
        self.repo.target.join("fuzz-build")
    }

    /// Runs the targets, as many at a time as the machine has cores.
    fn run_all(&self, targets: &[String]) -> XtaskResult<Vec<Outcome>> {
        let processes = thread::available_parallelism().map_or(1, usize::from).min(targets.len());
        let (queue, outcomes) = (Mutex::new(targets.iter()), Mutex::new(Vec::new()));
        thread::scope(|scope| {
            let worker = || {
                loop {
                    let next = queue.lock().ok().and_then(|mut queue| queue.next());
                    let Some(target) = next else { return Ok(()) };
                    let outcome = self.run_target(target)?;
                    if let Ok(mut outcomes) = outcomes.lock() {
                        outcomes.push(outcome);
                    }
                }
            };
            let workers: Vec<_> = (0..processes).map(|_| scope.spawn(worker)).collect();
            workers
                .into_iter()
                .try_for_each(|one| one.join().unwrap_or_else(|_| Err(Failure::new("a worker panicked"))))
        })?;
        let mut outcomes = outcomes.into_inner().unwrap_or_default();
        outcomes.sort_by_key(|outcome: &Outcome| targets.iter().position(|target| *target == outcome.target));
        Ok(outcomes)
    }

    fn run_target(&self, target: &str) -> XtaskResult<Outcome> {
        let folder = self.repo.target.join("fuzz").join(target);
        let [found, failing] = ["found", "failing"].map(|name| folder.join(name));
        // In memory if possible: recovered files are synchronized with the disk.
        let memory = Path::new("/dev/shm");
        let files = match memory.is_dir() {
            true => memory.join(format!("kinetoscope-fuzz-{}-{target}", std::process::id())),
            false => folder.join("files"),
        };
        let log = folder.join("log.txt");
        for folder in [&found, &failing, &files] {
            fs::create_dir_all(folder).map_err(|error| io_failure(folder, &error))?;
        }
        let corpus = self.repo.root.join("fuzz/corpus").join(target);
        let dictionary = self.repo.root.join("fuzz/dictionaries").join(format!("{target}.dict"));
        let mut cmd = Cmd::new(program(&self.build_folder(), target)?)
            .args(LIMITS)
            .args(["-print_final_stats=1", "-verbosity=1", "-seed=1"])
            .arg(format!("-max_total_time={}", self.time.as_secs()))
            .arg(format!("-artifact_prefix={}/", failing.display()))
            // Files of the target, and MuJoCo's log, which goes to the current folder.
            .unprinted_env("TMPDIR", &files)
            .unprinted_env("ASAN_OPTIONS", "detect_odr_violation=0:allocator_may_return_null=1")
            .current_dir(&files);
        if dictionary.exists() {
            cmd = cmd.arg(format!("-dict={}", dictionary.display()));
        }
        // Only the first folder is written.
        let success = cmd.arg(&found).arg(&corpus).run_logged(&log)?;
        let _ = fs::remove_dir_all(&files);
        let text = fs::read(&log).map_err(|error| io_failure(&log, &error))?;
        let mut outcome = outcome(target, &String::from_utf8_lossy(&text));
        if !success && outcome.failing_input.is_none() {
            outcome.failing_input = Some(log);
        }
        Ok(outcome)
    }
}

/// The compiled target, below the folder of its platform.
fn program(build: &Path, target: &str) -> XtaskResult<PathBuf> {
    let platforms = fs::read_dir(build).map_err(|error| io_failure(build, &error))?;
    let programs = platforms.flatten().map(|platform| platform.path().join("debug").join(target));
    let mut found = programs.filter(|program| program.is_file());
    found.next().ok_or_else(|| Failure::new(format!("cargo-fuzz built no {target} below {}", build.display())))
}

/// Reads the output of libFuzzer.
fn outcome(target: &str, log: &str) -> Outcome {
    let number = |word: Option<&str>| word.and_then(|word| word.parse().ok()).unwrap_or(0);
    let after = |line: &str, key: &str| {
        let mut words = line.split_whitespace();
        words.find(|word| *word == key);
        number(words.next())
    };
    let last = |key: &str| log.lines().rev().find(|line| line.contains(key)).map_or(0, |line| after(line, key));
    let started = |line: &str| line.strip_prefix('#').map_or(0, |rest| number(rest.split_whitespace().next()));
    let written = log.lines().find_map(|line| line.split_once("Test unit written to "));
    Outcome {
        target: target.into(),
        // A crash ends the program without statistics.
        executions: last("stat::number_of_executed_units:").max(log.lines().map(started).max().unwrap_or(0)),
        coverage: last("cov:"),
        edges: log
            .lines()
            .find(|line| line.contains(" PC tables ("))
            .map_or(0, |line| after(&line.replace('(', " "), "tables")),
        features: last("ft:"),
        failing_input: written.map(|(_, path)| PathBuf::from(path.trim())),
    }
}

/// Prints the outcomes and writes them to `fuzz.json` in the target folder.
///
/// # Errors
/// A target failed.
fn report(repo: &Repo, outcomes: &[Outcome]) -> XtaskResult {
    print!("\n{}", table(outcomes));
    let rows = outcomes.iter().map(|outcome| {
        json!({
            "target": outcome.target,
            "executions": outcome.executions,
            "covered_edges": outcome.coverage,
            "edges": outcome.edges,
            "features": outcome.features,
            "failing_input": outcome.failing_input,
        })
    });
    let path = repo.target.join("fuzz.json");
    let text = format!("{:#}\n", json!({ "targets": rows.collect::<Vec<_>>() }));
    fs::write(&path, text).map_err(|error| io_failure(&path, &error))?;
    let failed = outcomes.iter().filter_map(|outcome| Some((&outcome.target, outcome.failing_input.as_ref()?)));
    let failed: Vec<_> = failed.collect();
    let Some((target, input)) = failed.first() else { return Ok(()) };
    let again = format!("{} {}", program(&repo.target.join("fuzz-build"), target)?.display(), input.display());
    let names: Vec<&str> = failed.iter().map(|(target, _)| target.as_str()).collect();
    let log = repo.target.join("fuzz").join(target).join("log.txt");
    Err(Failure {
        message: format!("fuzz targets failed: {}; the log of {target} is {}", names.join(", "), log.display()),
        repeat_command: Some(again),
        code: 1,
    })
}

fn table(outcomes: &[Outcome]) -> String {
    let mut lines =
        format!("{:<12} {:>11} {:>8} {:>9} {:>9}\n", "target", "executions", "covered", "of edges", "features");
    for Outcome { target, executions, coverage, edges, features, failing_input } in outcomes {
        let note = if failing_input.is_some() { " failed" } else { "" };
        lines.push_str(&format!("{target:<12} {executions:>11} {coverage:>8} {edges:>9} {features:>9}{note}\n"));
    }
    let sum: u64 = outcomes.iter().map(|outcome| outcome.executions).sum();
    lines + &format!("{:<12} {sum:>11}\n", "total")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn output_of_the_fuzzer() {
        let done = "INFO: Loaded 1 PC tables (4000 PCs): 4000 [0x1,0x2), \n#2\tINITED cov: 10 ft: 11 corp: 1/1b exec/s: 0 rss: 40Mb\n#900\tNEW    cov: 120 ft: 300 corp: 2/9b\n\
                    #1000\tDONE   cov: 121 ft: 301 corp: 2/9b\nstat::number_of_executed_units: 1000\n";
        let expected = Outcome {
            target: "stl".into(),
            executions: 1000,
            coverage: 121,
            edges: 4000,
            features: 301,
            failing_input: None,
        };
        assert_eq!(outcome("stl", done), expected);
        let crashed = "#7\tNEW    cov: 12 ft: 13 corp: 2/9b\n==1== ERROR: libFuzzer: deadly signal\n\
                       artifact_prefix='/t/'; Test unit written to /t/crash-1\nBase64: AA==\n";
        let crash = outcome("stl", crashed);
        assert_eq!((crash.executions, crash.coverage, crash.features), (7, 12, 13));
        assert_eq!(crash.failing_input, Some("/t/crash-1".into()));
        let lines = table(&[expected, crash]);
        assert!(lines.contains("1007") && lines.lines().nth(2).is_some_and(|line| line.ends_with("failed")), "{lines}");
    }

    /// Each target is a file, and each file is a target with a corpus.
    #[test]
    fn list_of_targets() {
        let repo = Repo::find().expect("the repository");
        let mut names = targets(&repo).expect("a manifest");
        names.sort_unstable();
        let entries = |folder: &str| {
            let entries = fs::read_dir(repo.root.join(folder)).expect("a folder").flatten().map(|entry| entry.path());
            let mut stems: Vec<String> =
                entries.filter_map(|path| Some(path.file_stem()?.to_str()?.to_string())).collect();
            stems.sort_unstable();
            stems
        };
        assert!(names.len() > 10);
        assert_eq!(entries("fuzz/targets"), names);
        assert_eq!(entries("fuzz/corpus"), names);
        let unknown: Vec<_> = entries("fuzz/dictionaries").into_iter().filter(|name| !names.contains(name)).collect();
        assert!(unknown.is_empty(), "dictionaries without a target: {unknown:?}");
    }
}
