//! Window rendering during physics: images per second, the real-time factor, and the effect of a slow viewer on the
//! physics rate.
//!
//! Sixteen of the vendor's arms with the bundled hand move all the time. Each image of 960 x 540 pixels shows all of
//! them. The window is in a headless X server (Xvfb), which takes its share of the machine.

use crate::interleave::{Contender, compare};
use crate::models::{arm_with_hand, drive_sr5};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use crate::startup::robots;
use kinetoscope::prelude::*;
use kinetoscope::viewer::{SnapshotRequest, ViewerExt, Window, WindowCfg};
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const ENVS: usize = 16;
const SIZE: [usize; 2] = [960, 540];
/// Target of the images per second.
const TARGET_FPS: f64 = 30.0;
/// Target of the real-time factor.
const TARGET_REAL_TIME_FACTOR: f64 = 0.98;
/// Target of the physics speed with a very slow viewer, relative to no viewer.
const TARGET_SPEED_WITH_SLOW_VIEWER: f64 = 0.9;
/// Rendering time of the slow viewer.
const SLOW: Duration = Duration::from_millis(250);
/// Number of warm-up images, and the time limit for them.
const WARM_UP_IMAGES: u64 = 10;
const PATIENCE: Duration = Duration::from_secs(60);
/// Steps between two changes of the arms' targets.
const SWING: u32 = 100;

/// The arm of the benchmark.
struct Arm {
    name: &'static str,
    file: PathBuf,
    joints: &'static str,
}

impl Arm {
    fn find() -> BenchResult<Self> {
        let vendor = robots().map(|dir| dir.join("rokae_description/urdf/SR5.urdf")).filter(|file| file.exists());
        Ok(match vendor {
            Some(file) => Self { name: "vendor SR5", file, joints: "joint[1-6]" },
            None => {
                eprintln!("  the bundled arm: no vendor robots; set KINETOSCOPE_ROBOTS to their folder");
                Self { name: "SR5", file: assets::path("sr5/SR5.urdf")?, joints: "JOINT[1-6]" }
            }
        })
    }

    fn simulation(&self) -> BenchResult<(SimulationManager, RobotId)> {
        arm_with_hand(&self.file, self.joints, ENVS, cores())
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get)
}

/// A thread that repeats its work until it is dropped.
struct Worker {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    fn start(mut work: impl FnMut() + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let ends = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            while !ends.load(Ordering::Relaxed) {
                work();
            }
        });
        Self { stop, thread: Some(thread) }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // A panic in the thread is ignored: it has ended too.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// A headless X server that runs until it is dropped.
struct Display {
    server: Child,
    name: String,
}

impl Display {
    /// Starts the server; `None` without Xvfb.
    fn start() -> Option<Self> {
        let arguments = ["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-noreset"];
        let mut command = std::process::Command::new("Xvfb");
        let started = command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut display = Self { server: started.ok()?, name: String::new() };
        let mut number = String::new();
        BufReader::new(display.server.stdout.take()?).read_line(&mut number).ok()?;
        display.name = format!(":{}", number.trim());
        Some(display)
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // Errors are ignored: the server has ended either way.
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// Images per second of a window, and simulated seconds per second, in real time.
fn measure_window(arm: &Arm, display: &Display, seconds: f64) -> BenchResult<[f64; 2]> {
    let (mut sim, robot) = arm.simulation()?;
    let cfg = WindowCfg { size: SIZE, display: Some(display.name.clone()), ..WindowCfg::default() };
    let window = sim.open_window_with(cfg)?;
    // The first images allocate memory and build levels of detail for distant objects.
    let start = Instant::now();
    while window.frame_count() < WARM_UP_IMAGES && start.elapsed() < PATIENCE {
        swing(&mut sim, robot, &window, 0.1)?;
    }
    swing(&mut sim, robot, &window, seconds)
}

/// Moves the arms for `seconds` of wall-clock time. Returns images per second, and simulated seconds per second.
fn swing(sim: &mut SimulationManager, robot: RobotId, window: &Window, seconds: f64) -> BenchResult<[f64; 2]> {
    let (start, first, before) = (Instant::now(), sim.observers().steps(), window.frame_count());
    while start.elapsed().as_secs_f64() < seconds {
        let step = sim.observers().steps();
        if step.is_multiple_of(SWING.into()) {
            drive_sr5(sim, robot, (step / u64::from(SWING)).is_multiple_of(2))?;
        }
        sim.update(1);
    }
    let elapsed = start.elapsed().as_secs_f64();
    let images = (window.frame_count() - before) as f64;
    Ok([images / elapsed, (sim.observers().steps() - first) as f64 * sim.cfg().physics_dt / elapsed])
}

/// Arms at free speed, with a viewer that takes a quarter of a second per image, or without a viewer.
struct Arms {
    sim: SimulationManager,
    robot: RobotId,
    step: u32,
    _watcher: Option<Worker>,
}

impl Arms {
    fn new(arm: &Arm, watched: bool) -> BenchResult<Self> {
        let (mut sim, robot) = arm.simulation()?;
        let watcher = watched.then(|| {
            let viewer = sim.viewer(SnapshotRequest { rate: 60.0, ..SnapshotRequest::default() });
            let mut last = 0;
            Worker::start(move || {
                let snapshot = viewer.wait(last, SLOW);
                last = snapshot.as_ref().map_or(last, |snapshot| snapshot.number);
                // The viewer sleeps, so that the benchmark measures waiting and not the use of cores.
                std::thread::sleep(SLOW);
                drop(snapshot);
            })
        });
        Ok(Self { sim, robot, step: 0, _watcher: watcher })
    }
}

impl Contender for Arms {
    fn restart(&mut self) -> BenchResult<()> {
        self.step = 0;
        Ok(self.sim.reset(None)?)
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            if self.step.is_multiple_of(SWING) {
                drive_sr5(&mut self.sim, self.robot, (self.step / SWING).is_multiple_of(2))?;
            }
            self.sim.update(1);
            self.step += 1;
        }
        Ok(start.elapsed())
    }

    fn qpos(&mut self) -> BenchResult<Option<Vec<f64>>> {
        Ok(Some(self.sim.robot(self.robot).qpos().into_iter().collect()))
    }
}

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let arm = Arm::find()?;
    let display = Display::start();
    if display.is_none() {
        eprintln!("  without the window: Xvfb is not there");
    }
    let window = display.map(|display| measure_window(&arm, &display, settings.seconds)).transpose()?;
    let times = compare(settings.seconds, 10 * SWING, || Arms::new(&arm, true), || Arms::new(&arm, false))?;
    let case = |what: &str| format!("{ENVS} x {} + hand, {what}", arm.name);
    let [width, height] = SIZE;
    let mut rows = Vec::new();
    if let Some([images, factor]) = window {
        let row = Row::new("view", case(&format!("window of {width} x {height}")), "images/s", cores(), images);
        rows.push(row.against("target", TARGET_FPS, images / TARGET_FPS).with_target_ratio(1.0));
        let row = Row::new("view", case("physics during rendering"), "x real time", cores(), factor);
        rows.push(row.against("real time", 1.0, factor).with_target_ratio(TARGET_REAL_TIME_FACTOR));
    }
    let row = Row::new("view", case("0.25 s per image"), "env-steps/s", cores(), times.rate(0, ENVS));
    rows.push(
        row.against("no view", times.rate(1, ENVS), times.ratio(0, 1)).with_target_ratio(TARGET_SPEED_WITH_SLOW_VIEWER),
    );
    Ok(rows)
}
