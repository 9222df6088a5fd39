//! Benchmarks of Kinetoscope and its baselines in one run: `kinetoscope-benches [NAME]... [--json FILE] [--seconds S]`.
//!
//! `cargo xtask bench` runs them on both supported MuJoCo versions. A table goes to standard error, the rows as JSON to
//! a file.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod baseline;
mod camera;
mod contacts;
mod drive;
mod ik;
mod interleave;
mod memory;
mod models;
mod mujoco_batch;
mod mujoco_batch_reads;
mod other_load;
mod python;
mod randomize;
mod rays;
mod record;
mod row;
mod scale;
mod sensor_rates;
mod settings;
mod startup;
mod step;
mod tasks;
mod thread_time;
mod trace;
mod view;

use clap::Parser;
use row::Row;
use settings::{BenchResult, Settings};
use std::path::PathBuf;
use std::process::ExitCode;

/// The benchmarks in the order in which they run: name and function.
const BENCHES: &[(&str, Bench)] = &[
    ("step", step::run),
    ("drive", drive::run),
    ("mujoco-batch", mujoco_batch::run),
    ("camera", camera::run),
    ("rays", rays::run),
    ("record", record::run),
    ("view", view::run),
    ("trace", trace::run),
    ("contacts", contacts::run),
    ("sensors", sensor_rates::run),
    ("tasks", tasks::run),
    ("ik", ik::run),
    ("randomize", randomize::run),
    ("python", python::run),
    ("startup", startup::run),
    ("memory", memory::run),
    ("scale", scale::run),
];

type Bench = fn(&Settings) -> BenchResult<Vec<Row>>;

/// Benchmarks of Kinetoscope and its baselines in one run.
#[derive(Debug, Parser)]
#[command(name = "kinetoscope-benches")]
struct Args {
    /// Only these benchmarks: step, drive, mujoco-batch, camera, rays, record, view, trace, contacts, sensors, tasks,
    /// ik, randomize, python, startup, memory, scale
    names: Vec<String>,
    /// Also write all rows, as JSON, to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Time for one comparison, in seconds
    #[arg(long, default_value_t = 8.0)]
    seconds: f64,
    /// Build one side of the memory benchmark and print the memory of this process
    #[arg(long, hide = true, num_args = 3, value_names = ["SIDE", "CASE", "ENVS"])]
    memory_of: Option<Vec<String>>,
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("kinetoscope-benches: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> BenchResult<()> {
    if let Some(child) = &args.memory_of {
        return memory::child(child);
    }
    let known: Vec<&str> = BENCHES.iter().map(|(name, _)| *name).collect();
    if let Some(name) = args.names.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(format!("no benchmark {name:?}; known are {}", known.join(", ")).into());
    }
    if !(args.seconds.is_finite() && args.seconds > 0.0) {
        return Err(format!("--seconds {}: it must be above 0", args.seconds).into());
    }
    let settings = Settings { seconds: args.seconds };
    let mut rows = Vec::new();
    for (name, bench) in BENCHES {
        if args.names.is_empty() || args.names.iter().any(|wanted| wanted == name) {
            eprintln!("{name} ...");
            rows.extend(bench(&settings)?);
        }
    }
    eprint!("\n{}", row::table(&rows));
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(&rows)? + "\n";
        std::fs::write(path, text).map_err(|e| format!("--json {}: {e}", path.display()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn command_line() {
        Args::command().debug_assert();
        let help = Args::command().render_help().to_string();
        for (name, _) in BENCHES {
            assert!(help.contains(name), "{name}");
        }
    }

    #[test]
    fn unknown_name() {
        let error = run(&Args::parse_from(["x", "setp"])).map_err(|e| e.to_string()).err().unwrap_or_default();
        assert!(error.contains("setp") && error.contains("startup"), "{error}");
    }
}
