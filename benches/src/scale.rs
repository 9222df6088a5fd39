//! Many environments: time to create them, growth of the time per step with their number, and memory of a large batch.

use crate::interleave::{Contender, MeasurementCfg, measure, median};
use crate::memory;
use crate::models::{Case, STEPS};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use crate::step::Ours;
use std::time::{Duration, Instant};

/// Environments to create, and the time in which that should be done \[s\].
const STARTED: (usize, f64) = (4096, 0.2);
const STARTS: usize = 5;
/// Numbers of environments whose steps are compared: each step of the larger number should take as long per
/// environment, within 5 %.
const GROWTH: [usize; 2] = [4096, 65_536];
/// Environments of one process, and the memory that they should need \[GB\].
const LARGE: (usize, f64) = (100_000, 1.2);
const THREADS: usize = 2;

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let Some(case) = Case::humanoid()? else { return Ok(Vec::new()) };
    Ok(vec![start(&case)?, growth(&case, settings)?, large_batch()?])
}

/// Time to create environments and to write their start states.
fn start(case: &Case) -> BenchResult<Row> {
    let (envs, limit) = STARTED;
    let mut times = Vec::new();
    for _ in 0..STARTS {
        let start = Instant::now();
        let batch = case.batch(envs, THREADS)?;
        times.push(start.elapsed().as_secs_f64());
        drop(batch);
    }
    let time = median(times);
    Ok(Row::new("scale", format!("{}, start of {envs} envs", case.name), "s", THREADS, time)
        .against(&format!("limit {limit} s"), limit, limit / time)
        .with_target_ratio(1.0))
}

/// A side whose positions are not compared, because the other side has another number of environments.
struct Alone<'c>(Ours<'c>);

impl Contender for Alone<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        self.0.restart()
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        self.0.block(steps)
    }
}

/// Time per environment and step with many environments, relative to that with fewer.
fn growth(case: &Case, settings: &Settings) -> BenchResult<Row> {
    let [few, many] = GROWTH;
    let mut sides = [Alone(Ours::new(case, few, THREADS)?), Alone(Ours::new(case, many, THREADS)?)];
    let [first, second] = &mut sides;
    let plan = MeasurementCfg { seconds: settings.seconds, restart_after: STEPS };
    let times = measure(plan, &mut [first, second])?;
    let per_step = |side: usize| 1e6 * times.per_step(side) / GROWTH[side] as f64;
    let ratio = times.ratio(1, 0) * many as f64 / few as f64;
    Ok(Row::new("scale", format!("{}, {many} envs", case.name), "us/env-step", THREADS, per_step(1))
        .against(&format!("{few} envs"), per_step(0), ratio)
        .with_target_ratio(1.0 / 1.05))
}

/// Memory of a process with a large batch.
fn large_batch() -> BenchResult<Row> {
    let (envs, limit) = LARGE;
    let gb = memory::resident(memory::OURS, memory::HUMANOID, envs)? / 1e9;
    Ok(Row::new("scale", format!("humanoid, {envs} envs in one process"), "GB", 1, gb)
        .against(&format!("limit {limit} GB"), limit, limit / gb)
        .with_target_ratio(1.0))
}
