//! `cargo xtask bench`: Kinetoscope and its baselines on both supported MuJoCo versions, and the page with the results.

use crate::progress::Progress;
use crate::python::{self, Module};
use crate::python_simulation;
use crate::run::{Failure, Repo, XtaskResult};
use crate::setup::{self, MujocoVersion, Requirement, Requirements};
use crate::wheel;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{fs, thread};

const RESULTS: &str = "benches/RESULTS.md";
/// The benchmark of the Python package `kinetoscope`, and the variable with a Python that has the package.
const PACKAGE_BENCH: &str = "python";
const PACKAGE_VARIABLE: &str = "KINETOSCOPE_PYTHON_PACKAGE";
/// Benchmarks with baselines for cameras.
const CAMERA_BENCHES: [&str; 2] = ["camera", "trace"];
/// Python packages of the camera baselines. Other versions are untested.
const CAMERA_BASELINES: &[Module] = &[
    python::OPENGL,
    Module { name: "mujoco_warp", packages: &["mujoco-warp==4.0.0", "warp-lang==1.19.0"] },
    Module { name: "pybullet", packages: &["pybullet==3.2.7"] },
];

const EXTRAS: &[Requirement] = &[Requirement::Models, Requirement::Pip, Requirement::Venv, Requirement::Xvfb];

#[derive(Debug, clap::Args)]
pub(crate) struct BenchArgs {
    /// Only this benchmark
    name: Option<String>,
    /// With a name: replace its tables on the page of results, and leave the others as they are
    #[arg(long, requires = "name")]
    update: bool,
    /// Also write all rows, as JSON, to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(crate) fn run(repo: &Repo, args: &BenchArgs) -> XtaskResult {
    let path = repo.root.join(RESULTS);
    let heading = heading(&machine());
    let old = if args.update {
        let old = fs::read_to_string(&path).map_err(|e| Failure::new(format!("{}: {e}", path.display())))?;
        // Checked before the benchmarks run.
        replace_tables(&old, &heading, "")?;
        Some(old)
    } else {
        None
    };
    let mut rows = Vec::new();
    let prepare = |line| setup::prepare(repo, Requirements { version: Some(line), extras: EXTRAS });
    // The Python package is for one version of MuJoCo.
    let versions = match args.name.as_deref() {
        Some(PACKAGE_BENCH) => vec![(MujocoVersion::Wheel, wheel::VERSION)],
        _ => vec![(MujocoVersion::Debian, "2.2.2"), (MujocoVersion::Wheel, wheel::VERSION)],
    };
    let prepared = versions.iter().map(|(version, _)| prepare(*version)).collect::<XtaskResult<Vec<_>>>()?;
    let python = python::with_mujoco(repo);
    if python.is_none() {
        eprintln!("note: Python baselines are skipped");
    }
    if args.name.as_deref().is_none_or(|name| CAMERA_BENCHES.contains(&name)) {
        setup::try_to_have(Requirement::OsMesa);
        for module in CAMERA_BASELINES {
            if python.as_ref().is_some_and(|python| !module.install(python)) {
                eprintln!("note: this baseline is skipped");
            }
        }
    }
    let wants_package = args.name.as_deref().is_none_or(|name| name == PACKAGE_BENCH);
    let package = if wants_package { Some(python_simulation::bench_environment(repo)?) } else { None };
    let wants_mjbatch = args.name.as_deref().is_none_or(|name| name == "mujoco-batch");
    let mjbatch = if wants_mjbatch { python::with_mjbatch(repo) } else { None };
    let mut progress = Progress::new(prepared.len());
    for (ready, (_, line)) in prepared.into_iter().zip(versions) {
        progress.begin(&format!("{} on MuJoCo {line}", args.name.as_deref().unwrap_or("all benchmarks")));
        let file = repo.target.join("bench-rows.json");
        if file.exists() {
            fs::remove_file(&file).map_err(|e| Failure::new(format!("{}: {e}", file.display())))?;
        }
        let mut cmd = ready.cargo();
        if let Some(python) = &python {
            cmd = cmd.env(python::VARIABLE, python);
        }
        if let Some(package) = &package {
            cmd = cmd.env(PACKAGE_VARIABLE, package);
        }
        if let Some(mjbatch) = &mjbatch {
            cmd = cmd.env(python::MJBATCH_VARIABLE, mjbatch);
        }
        cmd.args(["run", "--release", "--package", "kinetoscope-benches", "--"])
            .args(&args.name)
            .arg("--json")
            .arg(&file)
            .run()?;
        rows.extend(read_rows(&file)?);
    }
    progress.end();
    if let Some(path) = &args.json {
        write(path, &format!("{:#}\n", Value::Array(rows.clone())))?;
    }
    let tables = tables(&rows)?;
    println!("\n{tables}");
    if args.name.is_some() && !args.update {
        return Ok(());
    }
    let page = match &old {
        Some(old) => replace_tables(old, &heading, &tables)?,
        None => format!("{heading}\n{tables}"),
    };
    write(&path, &page)?;
    println!("written to {RESULTS}");
    Ok(())
}

/// A page with the tables of the same name replaced; new tables come last. The page must be of the same machine,
/// because the remaining tables must be comparable.
fn replace_tables(page: &str, heading: &str, tables: &str) -> XtaskResult<String> {
    let split = |text: &str| -> Vec<String> {
        let parts = text.split("\n## ").filter(|part| !part.trim().is_empty());
        parts.map(|part| part.trim_start_matches("## ").trim_end().to_string()).collect()
    };
    let Some(old) = page.strip_prefix(heading) else {
        return Err(Failure::new(format!("{RESULTS} is of another machine: run all benchmarks, without a name")));
    };
    let mut sections = split(old);
    let name = |section: &str| section.lines().next().map(str::to_string);
    for table in split(tables) {
        match sections.iter_mut().find(|section| name(section) == name(&table)) {
            Some(section) => *section = table,
            None => sections.push(table),
        }
    }
    Ok(format!("{heading}\n## {}\n", sections.join("\n\n## ")))
}

fn write(path: &Path, text: &str) -> XtaskResult {
    fs::write(path, text).map_err(|e| Failure::new(format!("{}: {e}", path.display())))
}

fn read_rows(file: &Path) -> XtaskResult<Vec<Value>> {
    let text = fs::read_to_string(file)
        .map_err(|e| Failure::new(format!("the benchmarks wrote no rows to {}: {e}", file.display())))?;
    match serde_json::from_str(&text) {
        Ok(Value::Array(rows)) if !rows.is_empty() => Ok(rows),
        Ok(_) => Err(Failure::new(format!("{}: not an array of rows", file.display()))),
        Err(e) => Err(Failure::new(format!("{}: {e}", file.display()))),
    }
}

/// One table per benchmark, in the order of the rows.
fn tables(rows: &[Value]) -> XtaskResult<String> {
    let mut benches: Vec<&str> = Vec::new();
    for row in rows {
        let bench = text(row, "bench")?;
        if !benches.contains(&bench) {
            benches.push(bench);
        }
    }
    let mut out = String::new();
    for bench in benches {
        let _ = writeln!(out, "## {bench}\n");
        out.push_str(
            "| case | unit | threads | MuJoCo | ours | baseline | | ratio |\n|---|---|--:|---|--:|--:|---|--:|\n",
        );
        for row in rows.iter().filter(|row| row["bench"] == bench) {
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} | {} | {} | {} | {} |",
                text(row, "case")?,
                text(row, "unit")?,
                row["threads"],
                row["mujoco"].as_str().map_or_else(|| row["mujoco"].to_string(), str::to_string),
                number(&row["ours"]),
                number(&row["rival"]),
                row["rival_name"].as_str().unwrap_or("-"),
                row["ratio"].as_f64().map_or_else(|| "-".to_string(), |ratio| format!("**{ratio:.2}**")),
            );
        }
        out.push('\n');
    }
    Ok(format!("{}\n", out.trim_end()))
}

fn text<'a>(row: &'a Value, key: &str) -> XtaskResult<&'a str> {
    row[key].as_str().ok_or_else(|| Failure::new(format!("a row without the text `{key}`: {row}")))
}

/// Rounded number: whole from 100 on, with at most three decimals below; `-` without a number.
fn number(value: &Value) -> String {
    match value.as_f64() {
        None => "-".to_string(),
        Some(x) if x.abs() >= 100.0 => format!("{x:.0}"),
        Some(x) if x.abs() >= 10.0 => format!("{x:.1}"),
        Some(x) if x.abs() >= 1.0 || x == 0.0 => format!("{x:.2}"),
        Some(x) => format!("{x:.3}"),
    }
}

fn machine() -> String {
    let cpuinfo = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':')).map(|(_, name)| name.trim());
    let cores = thread::available_parallelism().map_or(1, usize::from);
    format!("{cores} cores of an {}", model.unwrap_or(std::env::consts::ARCH))
}

fn heading(machine: &str) -> String {
    let baselines: Vec<&str> = CAMERA_BASELINES.iter().flat_map(|module| module.packages).copied().collect();
    format!(
        "# Benchmark results\n\nWritten by `cargo xtask bench`; do not edit. Machine: {machine}. `cargo xtask bench` \
         measures everything again; `cargo xtask bench NAME --update` measures one benchmark again and replaces its \
         tables, on the same machine.\n\nBoth sides run in turns in one run. Numbers are medians over the turns. The \
         ratio is computed for each turn; its median can differ from the ratio of the two numbers. `step`, `scaling`, \
         `drive`, `mujoco-batch`, `rays`, `record` (without real time), `view` (without the window) and `contacts` \
         run twice, so that each side is created first once: their numbers are means of the two medians, their ratios \
         geometric means. `startup` has medians of several starts, `memory` a single measurement.\n\n`ratio > 1`: \
         Kinetoscope is better, that is faster, smaller (`memory`) or more often successful (`solved`). `-`: there is \
         no baseline, it was not on the machine, or it needs another MuJoCo version. `bare loop` calls MuJoCo's \
         functions on the same number of threads; `copy loop` and `compute loop` measure limits of the machine. The \
         baselines `target`, `limit` and `real time` are targets, not programs.\n\nRows of `trace` with `time` in \
         their name are the time of the same work without one part, in percent of the time of the whole \
         work.\n\n`plain` images have one sample per pixel and no shadows, `full` images have four samples and \
         shadows. `MuJoCo on OSMesa` is `mujoco.Renderer` with the settings of the row, or with its default settings \
         if the row says so. `OSMesa by hand` is the same library with two passes per image instead of three. `scans` \
         are height scans with parallel rays; `mj_multiRay` casts rays from the middle of each scanner to the same \
         points. `fans` are rays from one point.\n\nPython baselines: {}, mujoco=={}.\n",
        baselines.join(", "),
        wheel::PYTHON_VERSION
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn row(bench: &str, mujoco: &str, baseline: Value, ratio: Value) -> Value {
        json!({"bench": bench, "case": "arm, 64 envs", "unit": "env-steps/s", "ours": 251_000.4, "rival": baseline,
               "rival_name": "mj_step", "ratio": ratio, "threads": 2, "mujoco": mujoco})
    }

    #[test]
    fn both_runs() {
        let rows = [
            row("step", "2.2.2", json!(200_000.0), json!(1.255)),
            row("camera", "2.2.2", json!(12.345), json!(3.0)),
            row("step", "4.0.0", Value::Null, Value::Null),
        ];
        let page = tables(&rows).expect("complete rows");
        assert_eq!(page.matches("## ").count(), 2);
        assert!(
            page.contains("| arm, 64 envs | env-steps/s | 2 | 2.2.2 | 251000 | 200000 | mj_step | **1.25** |"),
            "{page}"
        );
        assert!(page.contains("| 4.0.0 | 251000 | - | mj_step | - |"), "{page}");
        assert!(page.find("4.0.0") < page.find("## camera"), "{page}");
    }

    #[test]
    fn one_benchmark() {
        let page = |step: f64, camera: f64| {
            let rows =
                [row("step", "2.2.2", json!(step), json!(1.0)), row("camera", "2.2.2", json!(camera), json!(2.0))];
            tables(&rows).expect("complete rows")
        };
        let heading = heading("a machine");
        let old = format!("{heading}\n{}", page(100.0, 200.0));
        let new = tables(&[row("camera", "2.2.2", json!(300.0), json!(2.0))]).expect("complete");
        assert_eq!(
            replace_tables(&old, &heading, &new).expect("the same machine"),
            format!("{heading}\n{}", page(100.0, 300.0))
        );
        let more = tables(&[row("rays", "2.2.2", json!(1.0), json!(2.0))]).expect("complete");
        let page = replace_tables(&old, &heading, &more).expect("the same machine");
        assert!(page.starts_with(old.trim_end()) && page.contains("## rays"), "{page}");
        assert!(replace_tables(&old, &super::heading("another machine"), &more).is_err());
    }

    #[test]
    fn broken_rows() {
        assert!(tables(&[json!({"case": "x"})]).is_err());
        let dir = tempfile::tempdir().expect("a scratch folder");
        let file = dir.path().join("rows.json");
        assert!(read_rows(&file).is_err());
        for text in ["", "[]", "{}"] {
            fs::write(&file, text).expect("writable");
            assert!(read_rows(&file).is_err(), "{text}");
        }
    }

    #[test]
    fn numbers_keep_three_digits() {
        let shown: Vec<String> = [0.12345, 1.2345, 12.345, 1234.5].iter().map(|x| number(&json!(x))).collect();
        assert_eq!(shown, ["0.123", "1.23", "12.3", "1234"]);
        assert_eq!(number(&Value::Null), "-");
    }
}
