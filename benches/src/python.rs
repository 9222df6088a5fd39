//! The Python package `kinetoscope`: a loop in Python compared with the same loop in Rust, small calls, images, and the
//! first start. The loops are two processes, created in both orders, half the time each.

use crate::baseline::{self, Process};
use crate::interleave::{Contender, MeasurementCfg, in_both_orders, measure, median};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::assets;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::sim::Snapshot;
use serde_json::json;
use std::ffi::OsString;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const ENVS: usize = 1024;
const THREADS: usize = 2;
/// Steps between restarts.
const STEPS: u32 = 400;
/// Steps between changes of the targets.
const PHASE: u32 = 10;
/// Target: Python takes at most 3 % more time than Rust.
const LOOP_TARGET: f64 = 1.0 / 1.03;
/// Target of a small call \[us\].
const CALL_LIMIT: f64 = 2.0;
/// Number of small calls in a turn.
const CALLS: u32 = 20_000;
/// Number of images in a turn.
const READS: u32 = 50;
const TURNS: usize = 15;
/// Targets of the import and of the first image \[s\].
const IMPORT_LIMIT: f64 = 0.15;
const IMAGE_LIMIT: f64 = 0.5;
const STARTS: usize = 9;

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let Some(python) = baseline::python_with_package() else { return Ok(Vec::new()) };
    let mut rows = vec![loops(settings, &python)?];
    rows.extend(calls(&python)?);
    rows.push(images(&python)?);
    rows.push(start(&python, "import", IMPORT_LIMIT, "import kinetoscope")?);
    rows.push(start(&python, "import to first image, 640x480", IMAGE_LIMIT, FIRST_IMAGE)?);
    Ok(rows)
}

/// `update(1)`, new targets and positions of many quadrupeds.
fn loops(settings: &Settings, python: &OsString) -> BenchResult<Row> {
    let times = in_both_orders(|order| {
        let (mut ours, mut rust) = order.create(|| PythonLoop::start(python), RustLoop::new)?;
        let plan = MeasurementCfg { seconds: 0.5 * settings.seconds, restart_after: STEPS };
        measure(plan, &mut [&mut ours, &mut rust])
    })?;
    let case = format!("update, qpos and set_qpos_target, quadruped, {ENVS} envs");
    let row = Row::new("python", case, "env-steps/s", THREADS, times.rate(0, ENVS));
    Ok(row.against("Rust loop", times.rate(1, ENVS), times.ratio(0, 1)).with_target_ratio(LOOP_TARGET))
}

fn start_process(python: &OsString, job: &serde_json::Value) -> BenchResult<Process> {
    Process::start(python, "kinetoscope_package.py", job, tempfile::tempdir()?)
}

struct PythonLoop(Process);

impl PythonLoop {
    fn start(python: &OsString) -> BenchResult<Self> {
        let mut side = Self(start_process(python, &json!({"case": "loop", "envs": ENVS, "threads": THREADS}))?);
        // The process answers once its memory is allocated.
        side.restart()?;
        Ok(side)
    }
}

impl Contender for PythonLoop {
    fn restart(&mut self) -> BenchResult<()> {
        self.0.request("restart").map(drop)
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        self.0.block(steps)
    }

    fn process(&self) -> Option<u32> {
        Some(self.0.id())
    }

    fn qpos(&mut self) -> BenchResult<Option<Vec<f64>>> {
        let bytes = self.0.bytes("qpos")?;
        Ok(Some(bytes.as_chunks::<8>().0.iter().map(|chunk| f64::from_le_bytes(*chunk)).collect()))
    }
}

struct RustLoop {
    sim: SimulationManager,
    robot: RobotId,
    targets: [Array2<f64>; 2],
    start: Snapshot,
    steps: u32,
    last: Array2<f64>,
}

impl RustLoop {
    fn new() -> BenchResult<Self> {
        let cfg = SimulationManagerCfg { num_envs: ENVS, threads: Some(THREADS), ..SimulationManagerCfg::legged() };
        let mut sim = SimulationManager::new(cfg)?;
        let robot = sim.add_robot(assets::quadruped()?)?;
        let start = sim.robot(robot).default_qpos();
        let targets = [&start + 0.05, &start - 0.05];
        let (start, last) = (sim.snapshot(None)?, sim.robot(robot).qpos());
        Ok(Self { sim, robot, targets, start, steps: 0, last })
    }
}

impl Contender for RustLoop {
    fn restart(&mut self) -> BenchResult<()> {
        self.sim.restore(&self.start, None)?;
        self.steps = 0;
        self.last = self.sim.robot(self.robot).qpos();
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let begin = Instant::now();
        for step in self.steps..self.steps + steps {
            let targets = &self.targets[(step / PHASE % 2) as usize];
            self.sim.robot_mut(self.robot).set_qpos_target(targets, None, None)?;
            self.sim.update(1);
            self.last = self.sim.robot(self.robot).qpos();
        }
        self.steps += steps;
        Ok(begin.elapsed())
    }

    fn qpos(&mut self) -> BenchResult<Option<Vec<f64>>> {
        Ok(Some(self.last.iter().copied().collect()))
    }
}

/// Small calls of one arm.
fn calls(python: &OsString) -> BenchResult<Vec<Row>> {
    let mut process = start_process(python, &json!({"case": "calls"}))?;
    let mut rows = Vec::new();
    for call in ["time", "qpos", "set_qpos_target"] {
        let mut times = Vec::new();
        for _ in 0..TURNS {
            let seconds: f64 = process.request(&format!("call {call} {CALLS}"))?.parse()?;
            times.push(1e6 * seconds / f64::from(CALLS));
        }
        let time = median(times);
        let row = Row::new("python", format!("call of {call}, arm, 1 env"), "us", 1, time);
        rows.push(row.against(&format!("limit {CALL_LIMIT} us"), CALL_LIMIT, CALL_LIMIT / time).with_target_ratio(1.0));
    }
    Ok(rows)
}

/// Images that are read into an array of the caller, compared with a copy of an array.
fn images(python: &OsString) -> BenchResult<Row> {
    let (envs, [width, height]) = (4, [640, 480]);
    let mut process = start_process(python, &json!({"case": "image", "envs": envs, "size": [width, height]}))?;
    let bytes = f64::from(READS) * (4 * envs * width * height) as f64;
    let (mut rates, mut copies, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    for turn in 0..=TURNS {
        let read: f64 = process.request(&format!("read {READS}"))?.parse()?;
        let copy: f64 = process.request(&format!("copy {READS}"))?.parse()?;
        // The first turn loads the memory.
        if turn > 0 {
            rates.push(1e-9 * bytes / read);
            copies.push(1e-9 * bytes / copy);
            ratios.push(copy / read);
        }
    }
    let case = format!("read of {envs} images, {width}x{height} RGBA");
    let row = Row::new("python", case, "GB/s", 1, median(rates));
    Ok(row.against("copy of an array", median(copies), median(ratios)).with_target_ratio(0.9))
}

const FIRST_IMAGE: &str = "\
import kinetoscope as ks
sim = ks.SimulationManager(threads=1)
sim.add_robot(ks.bundled_robot('sr5'))
look = ks.Extrinsics(placement=ks.Placement.look_at(eye=[2, 0, 1], target=[0, 0, 0.3]))
assert sim.add_sensor('camera', ks.CameraCfg(extrinsics=look))['color'].any()";

/// Time of some lines in a new process, with the import of NumPy.
fn start(python: &OsString, case: &str, limit: f64, code: &str) -> BenchResult<Row> {
    let mut times = Vec::new();
    for _ in 0..STARTS {
        let code = format!("import time\nbegin = time.perf_counter()\n{code}\nprint(time.perf_counter() - begin)");
        let mut command = Command::new(python);
        command.args(["-c", &code]).stdin(Stdio::null()).stderr(Stdio::inherit());
        let output = command.output()?;
        times.push(String::from_utf8(output.stdout)?.trim().parse::<f64>().map_err(|_| format!("{case} failed"))?);
    }
    let time = median(times);
    Ok(Row::new("python", case, "s", 1, time)
        .against(&format!("limit {limit} s"), limit, limit / time)
        .with_target_ratio(1.0))
}
