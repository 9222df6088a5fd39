//! What a window shows while physics runs: pictures per second, how well real time is kept, and whether whoever draws slowly
//! holds physics up.
//!
//! Sixteen of the vendor's arms with the bundled hand move all the time; of 960 x 540 pixels each picture shows them all. It
//! is drawn as the window draws it, without an X server.

use crate::interleave::{Plan, Side, in_both_orders, measure};
use crate::models::{arm_with_hand, drive_sr5};
use crate::row::Row;
use crate::startup::robots;
use crate::{Outcome, Settings};
use kinetoscope::prelude::*;
use kinetoscope::view::window::App;
use kinetoscope::view::{Canvas, Command, Speed, Viewer, Wants};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const ENVS: usize = 16;
const SIZE: [usize; 2] = [960, 540];
/// Pictures per second that are wanted at least.
const PICTURES: f64 = 30.0;
/// Simulated seconds per second that are wanted, of real time.
const REAL: f64 = 0.98;
/// What is left of the speed of physics where somebody takes very long to draw.
const UNHINDERED: f64 = 0.9;
/// How long that is.
const SLOW: Duration = Duration::from_millis(250);
/// Pictures that are drawn before it counts, and how long is waited for them.
const FIRST: u64 = 10;
const PATIENCE: Duration = Duration::from_secs(60);
/// Steps between two changes of the arms' targets.
const SWING: u32 = 100;

/// The arm that is shown.
struct Arm {
    name: &'static str,
    file: PathBuf,
    joints: &'static str,
}

impl Arm {
    fn find() -> Outcome<Self> {
        let vendor = robots().map(|dir| dir.join("rokae_description/urdf/SR5.urdf")).filter(|file| file.exists());
        Ok(match vendor {
            Some(file) => Self { name: "vendor SR5", file, joints: "joint[1-6]" },
            None => {
                eprintln!("  the bundled arm: no vendor robots; set KINETOSCOPE_ROBOTS to their folder");
                Self { name: "SR5", file: assets::path("sr5/SR5.urdf")?, joints: "JOINT[1-6]" }
            }
        })
    }

    fn simulation(&self) -> Outcome<(SimulationManager, RobotId)> {
        arm_with_hand(&self.file, self.joints, ENVS, cores())
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get)
}

/// A thread that works until it is dropped.
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
        // One that panicked has ended, too.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Draws every snapshot as a window does, and counts them.
fn window(viewer: Viewer, drawn: Arc<AtomicU64>) -> Worker {
    let mut app = App::new(SIZE, cores());
    app.keep_pace();
    viewer.set_wants(app.wants());
    let (mut canvas, mut last) = (Canvas::default(), 0);
    Worker::start(move || {
        if let Some(snapshot) = viewer.wait(last, Duration::from_millis(10)) {
            last = snapshot.number;
            app.show(snapshot);
            app.draw(&mut canvas, Instant::now());
            drawn.fetch_add(1, Ordering::Relaxed);
        }
    })
}

/// Pictures per second, and simulated seconds per second, in real time.
fn shown(arm: &Arm, seconds: f64) -> Outcome<[f64; 2]> {
    let (mut sim, robot) = arm.simulation()?;
    let key = sim.viewer(Wants { rate: 0.0, contacts: None, markers: false, joints: false, cameras: false });
    key.send(Command::SetSpeed(Speed::REAL));
    let drawn = Arc::new(AtomicU64::new(0));
    let window = window(sim.viewer(Wants::default()), Arc::clone(&drawn));
    // The first picture makes coarser meshes for what is far away, and finds no memory.
    let start = Instant::now();
    while drawn.load(Ordering::Relaxed) < FIRST && start.elapsed() < PATIENCE {
        swing(&mut sim, robot, &drawn, 0.1)?;
    }
    let measured = swing(&mut sim, robot, &drawn, seconds)?;
    drop(window);
    Ok(measured)
}

/// Moves the arms for some seconds.
fn swing(sim: &mut SimulationManager, robot: RobotId, drawn: &AtomicU64, seconds: f64) -> Outcome<[f64; 2]> {
    let (start, first, before) = (Instant::now(), sim.steps(), drawn.load(Ordering::Relaxed));
    while start.elapsed().as_secs_f64() < seconds {
        let step = sim.steps();
        if step.is_multiple_of(SWING.into()) {
            drive_sr5(sim, robot, (step / u64::from(SWING)).is_multiple_of(2))?;
        }
        sim.update(1);
    }
    let elapsed = start.elapsed().as_secs_f64();
    let pictures = (drawn.load(Ordering::Relaxed) - before) as f64;
    Ok([pictures / elapsed, (sim.steps() - first) as f64 * sim.cfg().physics_dt / elapsed])
}

/// Arms at free speed, watched by somebody who takes a quarter of a second for each picture, or by nobody.
struct Arms {
    sim: SimulationManager,
    robot: RobotId,
    step: u32,
    _watcher: Option<Worker>,
}

impl Arms {
    fn new(arm: &Arm, watched: bool) -> Outcome<Self> {
        let (mut sim, robot) = arm.simulation()?;
        let watcher = watched.then(|| {
            let viewer = sim.viewer(Wants { rate: 60.0, ..Wants::default() });
            let mut last = 0;
            Worker::start(move || {
                let snapshot = viewer.wait(last, SLOW);
                last = snapshot.as_ref().map_or(last, |snapshot| snapshot.number);
                // Asleep: what is measured is who waits for whom, not who takes which core.
                std::thread::sleep(SLOW);
                drop(snapshot);
            })
        });
        Ok(Self { sim, robot, step: 0, _watcher: watcher })
    }
}

impl Side for Arms {
    fn restart(&mut self) -> Outcome<()> {
        self.step = 0;
        Ok(self.sim.reset(None)?)
    }

    fn block(&mut self, steps: u32) -> Outcome<Duration> {
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

    fn qpos(&mut self) -> Outcome<Option<Vec<f64>>> {
        Ok(Some(self.sim.robot(self.robot).get_qpos().into_iter().collect()))
    }
}

pub(crate) fn run(settings: &Settings) -> Outcome<Vec<Row>> {
    let arm = Arm::find()?;
    let [pictures, factor] = shown(&arm, settings.seconds)?;
    let times = in_both_orders(|order| {
        let (mut watched, mut alone) = order.create(|| Arms::new(&arm, true), || Arms::new(&arm, false))?;
        let plan = Plan { seconds: settings.seconds / 2.0, restart_after: 10 * SWING };
        measure(plan, &mut [&mut watched, &mut alone])
    })?;
    let case = |what: &str| format!("{ENVS} x {} + hand, {what}", arm.name);
    let [width, height] = SIZE;
    let pictures_row = Row::new("view", case(&format!("{width} x {height}")), "pictures/s", cores(), pictures);
    let factor_row = Row::new("view", case("physics meanwhile"), "x real time", cores(), factor);
    let slow_row = Row::new("view", case("drawn in 0.25 s each"), "env-steps/s", cores(), times.rate(0, ENVS));
    Ok(vec![
        pictures_row.against("wanted", PICTURES, pictures / PICTURES).wanted(1.0),
        factor_row.against("real time", 1.0, factor).wanted(REAL),
        slow_row.against("nobody watches", times.rate(1, ENVS), times.ratio(0, 1)).wanted(UNHINDERED),
    ])
}
