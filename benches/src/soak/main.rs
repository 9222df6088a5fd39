//! Long runs that look for leaks of memory, file descriptors and threads: `kinetoscope-soak [--minutes M] [--cycles N]`.
//!
//! `cargo xtask soak` runs it. The first part repeats a mixed job in one process ([`job`]), and fits a line to the resident
//! memory at the ends of its cycles. The second part creates and drops a small simulation many times.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod clients;
mod evaluation;
mod job;
mod resources;

use clap::Parser;
use evaluation::{FEWEST_SAMPLES, Slope, Verdict, growth};
use job::{Job, small_simulation};
use resources::Resources;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// The result of a part of the run, or the reason for its failure.
pub(crate) type SoakResult<T> = Result<T, Box<dyn std::error::Error>>;

/// Limit of the growth of resident memory of the mixed job \[MB/h\].
const MEMORY_LIMIT: f64 = 1.0;
/// Limit of the growth of resident memory \[MB\] in [`CYCLE_UNIT`] simulations that are created and dropped: 100 bytes for
/// each of them.
const CYCLE_LIMIT: f64 = 1.0;
const CYCLE_UNIT: f64 = 10_000.0;
/// The first samples of each part, which are left out: 1 of 5. Caches, pools and the allocator fill up.
const WARM_UP: usize = 5;
/// Smallest time between two samples of the mixed job.
const SAMPLE_INTERVAL: Duration = Duration::from_secs(1);
/// Simulations between two samples of the second part.
const SAMPLE_EVERY: u64 = 20;
const PROGRESS_INTERVAL: Duration = Duration::from_secs(60);
/// Bytes per MB.
const MEGA: f64 = 1e6;

/// Long runs that look for leaks of memory, file descriptors and threads.
#[derive(Debug, Parser)]
#[command(name = "kinetoscope-soak")]
struct Args {
    /// Duration of the mixed job, in minutes; 0 to leave it out
    #[arg(long, default_value_t = 60.0)]
    minutes: f64,
    /// Number of simulations that are created and dropped after it; 0 to leave them out
    #[arg(long, default_value_t = 10_000)]
    cycles: u64,
    /// Also write all samples, as comma-separated values, to this file
    #[arg(long, value_name = "FILE")]
    samples: Option<PathBuf>,
    /// Leak this number of bytes in each cycle of both parts, to show that the check can fail
    #[arg(long, hide = true, default_value_t = 0)]
    leak: usize,
}

/// Samples of one part of the run.
#[derive(Debug)]
struct Samples {
    /// Name of the part.
    part: &'static str,
    /// Unit of the positions of the samples.
    unit: &'static str,
    /// Largest growth of memory \[MB\] per unit.
    limit: f64,
    /// Position and resources of each sample.
    list: Vec<(f64, Resources)>,
}

impl Samples {
    /// Adds a sample, when files and threads have reached those of the last one, or after a second.
    fn add(&mut self, at: f64) -> SoakResult<()> {
        let now = Resources::settled(self.list.last().map(|(_, last)| last))?;
        self.list.push((at, now));
        Ok(())
    }

    /// Prints the evaluation. Returns the reasons of a failure.
    fn report(&self) -> Vec<String> {
        let Self { part, unit, limit, list } = self;
        let warm = &list[list.len() / WARM_UP..];
        let most = |count: fn(&Resources) -> usize| list.iter().map(|(_, now)| count(now)).max().unwrap_or(0);
        println!(
            "{part}: {} samples, the first {} of them for the warm-up; at most {} files and {} threads",
            list.len(),
            list.len() - warm.len(),
            most(|now| now.files),
            most(|now| now.threads)
        );
        if let (Some((_, first)), Some((_, last))) = (warm.first(), warm.last()) {
            let [first, last] = [first, last].map(|sample| sample.memory as f64 / MEGA);
            println!("  resident memory after the warm-up {first:.1} MB, at the end {last:.1} MB");
        }
        let mut failures = Vec::new();
        let points: Vec<[f64; 2]> = warm.iter().map(|(at, now)| [*at, now.memory as f64 / MEGA]).collect();
        match Slope::fit(&points) {
            None => println!(
                "  undecided: {} samples after the warm-up; expected at least {FEWEST_SAMPLES}, from a longer run",
                points.len()
            ),
            Some(slope) => {
                println!("  growth of memory {slope} MB/{unit}; limit {limit} MB/{unit}");
                let found = slope.smallest_found(*limit);
                match slope.compare(*limit) {
                    Verdict::Flat => println!("  memory does not grow by {limit} MB/{unit}"),
                    Verdict::Growing => failures.push(format!("{part}: memory grows by {slope} MB/{unit}")),
                    Verdict::Undecided => println!(
                        "  undecided: the noise of a run of this length hides growth of {limit} MB/{unit}; growth from \
                         {found:.1} MB/{unit} on would have been found. A longer run decides."
                    ),
                }
            }
        }
        let counts = |count: fn(&Resources) -> usize| warm.iter().map(|(_, now)| count(now)).collect::<Vec<_>>();
        for (what, counts) in [("files", counts(|now| now.files)), ("threads", counts(|now| now.threads))] {
            let more = growth(&counts);
            if more > 0 {
                failures.push(format!("{part}: {more} more {what} in the last quarter than in the first"));
            }
        }
        failures
    }
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(failures) if failures.is_empty() => ExitCode::SUCCESS,
        Ok(failures) => {
            eprintln!("kinetoscope-soak: {}", failures.join("\n  "));
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("kinetoscope-soak: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs both parts. Returns the reasons of a failure.
fn run(args: &Args) -> SoakResult<Vec<String>> {
    let time = Duration::try_from_secs_f64(60.0 * args.minutes)
        .map_err(|_| format!("--minutes {}: expected a number of minutes from 0 on", args.minutes))?;
    let mut parts = Vec::new();
    if !time.is_zero() {
        parts.push(mixed_job(time, args.leak)?);
    }
    if args.cycles > 0 {
        parts.push(many_simulations(args.cycles, args.leak)?);
    }
    if let Some(path) = &args.samples {
        std::fs::write(path, table(&parts)).map_err(|error| format!("--samples {}: {error}", path.display()))?;
    }
    println!();
    Ok(parts.iter().flat_map(Samples::report).collect())
}

/// Repeats the mixed job for a time.
fn mixed_job(time: Duration, leak: usize) -> SoakResult<Samples> {
    let mut samples = Samples { part: "mixed job", unit: "h", limit: MEMORY_LIMIT, list: Vec::new() };
    let mut job = Job::new()?;
    let start = Instant::now();
    let (mut sampled, mut shown) = (start, start);
    while start.elapsed() < time {
        job.cycle().map_err(|error| format!("cycle {}: {error}", job.counts().cycles))?;
        leak_on_purpose(leak);
        if sampled.elapsed() >= SAMPLE_INTERVAL {
            sampled = Instant::now();
            samples.add(start.elapsed().as_secs_f64() / 3600.0)?;
        }
        if shown.elapsed() >= PROGRESS_INTERVAL {
            shown = Instant::now();
            show_progress(&samples, &format!("{} min", start.elapsed().as_secs() / 60));
        }
    }
    println!("mixed job: {}", job.counts());
    Ok(samples)
}

/// Creates and drops a simulation with a robot and a camera image, again and again.
fn many_simulations(cycles: u64, leak: usize) -> SoakResult<Samples> {
    let unit = "10,000 simulations";
    let mut samples = Samples { part: "simulations created and dropped", unit, limit: CYCLE_LIMIT, list: Vec::new() };
    let mut shown = Instant::now();
    for cycle in 1..=cycles {
        let (mut sim, camera) = small_simulation(1, 2)?;
        sim.update(2);
        if sim.sensor(camera)?.color()?.iter().all(|&value| value == 0) {
            return Err(format!("simulation {cycle}: its image is black").into());
        }
        drop(sim);
        leak_on_purpose(leak);
        if cycle.is_multiple_of(SAMPLE_EVERY) {
            samples.add(cycle as f64 / CYCLE_UNIT)?;
        }
        if shown.elapsed() >= PROGRESS_INTERVAL {
            shown = Instant::now();
            show_progress(&samples, &format!("{cycle} of {cycles} simulations"));
        }
    }
    Ok(samples)
}

/// Leaks touched memory, so that it is resident.
fn leak_on_purpose(bytes: usize) {
    std::mem::forget(std::hint::black_box(vec![1u8; bytes]));
}

fn show_progress(samples: &Samples, at: &str) {
    if let Some((_, Resources { memory, files, threads })) = samples.list.last() {
        eprintln!("{at}: {:.1} MB resident, {files} files, {threads} threads", *memory as f64 / MEGA);
    }
}

/// All samples as comma-separated values.
fn table(parts: &[Samples]) -> String {
    let mut text = String::from("part,position,unit,memory_bytes,files,threads\n");
    for Samples { part, unit, list, .. } in parts {
        for (at, Resources { memory, files, threads }) in list {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{part},{at:.6},\"{unit}\",{memory},{files},{threads}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn samples(limit: f64, count: u32, memory: impl Fn(u32) -> f64, files: impl Fn(u32) -> usize) -> Samples {
        let sample = |k| {
            let memory = (memory(k) * MEGA) as u64;
            (f64::from(k) / 3600.0, Resources { memory, files: files(k), threads: 7 })
        };
        Samples { part: "mixed job", unit: "h", limit, list: (0..count).map(sample).collect() }
    }

    #[test]
    fn command_line() {
        Args::command().debug_assert();
        for minutes in ["-1", "NaN", "1e300"] {
            let args = Args::parse_from(["x", &format!("--minutes={minutes}")]);
            let error = run(&args).map_err(|error| error.to_string()).err().unwrap_or_default();
            assert!(error.contains("--minutes"), "{minutes}: {error}");
        }
    }

    /// Leaks of memory and of files fail; growth in the first fifth is the warm-up.
    #[test]
    fn failures() {
        let wave = |k: u32| 200.0 + 0.2 * f64::from(k % 7);
        let warm_up = |k: u32| wave(k) + 50.0 * f64::from(k.min(600)) / 600.0;
        let leak = |k: u32| wave(k) + 3.0 * f64::from(k) / 3600.0;
        for (what, samples, expected) in [
            ("flat", samples(1.0, 3600, wave, |_| 12), &[][..]),
            ("warm-up", samples(1.0, 3600, warm_up, |_| 12), &[]),
            ("leak", samples(1.0, 3600, leak, |_| 12), &["memory grows"]),
            ("files", samples(1.0, 3600, wave, |k| 12 + k as usize / 900), &["more files"]),
            ("both", samples(1.0, 3600, leak, |k| 12 + k as usize / 900), &["memory grows", "more files"]),
            // Nothing is said about a run without enough samples.
            ("short", samples(1.0, 20, leak, |_| 12), &[]),
        ] {
            let failures = samples.report();
            assert_eq!(failures.len(), expected.len(), "{what}: {failures:?}");
            assert!(failures.iter().zip(expected).all(|(found, part)| found.contains(part)), "{what}: {failures:?}");
        }
    }

    #[test]
    fn written_samples() {
        let text = table(&[samples(1.0, 3, |_| 5.0, |_| 12)]);
        assert_eq!(text.lines().count(), 4);
        assert_eq!(text.lines().last(), Some("mixed job,0.000556,\"h\",5000000,12,7"));
    }
}
