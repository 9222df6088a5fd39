//! A served simulation that steps on its own thread, and playback of a recording.

use kinetoscope::RecordingPlayback;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::record::{Playback, RecorderCfg, Recording};
use kinetoscope::viewer::{Command, ServeCfg, ServerHandle, SnapshotRequest, Viewer, ViewerExt};
use kinetoscope::viewer::{Play, Speed};
use kinetoscope_testkit::wait;
use kinetoscope_testkit::worlds::{camera, cfg, cube, gains, sr5};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// State of the simulation, as seen by the stepping program.
#[derive(Clone, Debug, Default)]
pub(crate) struct SimState {
    pub(crate) steps: u64,
    pub(crate) positions: Array2<f64>,
    /// Longest duration of a step \[s\].
    pub(crate) longest_step: f64,
}

/// A served simulation. Dropping the value stops it.
pub(crate) struct ServedSimulation {
    pub(crate) url: String,
    pub(crate) address: SocketAddr,
    served: ServerHandle,
    now: Arc<Mutex<SimState>>,
    stop: Arc<AtomicBool>,
    /// A viewer in addition to the browsers.
    pub(crate) viewer: Viewer,
    thread: Option<JoinHandle<()>>,
}

/// Builds the bundled arm with six driven joints beside a red cube of 0.4 m and 1 kg, with a camera that observes both.
pub(crate) fn scene(num_envs: usize) -> SimulationManager {
    let cfg = SimulationManagerCfg { physics_dt: 0.005, arena_space: 3.0, ..cfg(num_envs, 1) };
    let mut sim = SimulationManager::new(cfg).unwrap();
    sim.add_robot(RobotCfg { drive: gains(1e4, 1e3), ..sr5("arm") }).unwrap();
    let cube = cube("cube", 0.4, 1.0, [0.7, 0.0, 0.2]);
    sim.add_rigid_object(RigidObjectCfg { rgba: [0.9, 0.05, 0.05, 1.0], ..cube }).unwrap();
    let channels = Channels { color: true, depth: true, mask: true, normal: true, ..Default::default() };
    let eye = camera([64, 48], [2.0, 1.0, 1.2], [0.4, 0.0, 0.2], channels);
    sim.add_sensor("eye", CameraCfg { intrinsics: Intrinsics::Fovy { radians: 1.0 }, ..eye }).unwrap();
    sim
}

impl ServedSimulation {
    /// Serves [`scene`] on a free port.
    pub(crate) fn start(num_envs: usize) -> Self {
        Self::start_at(num_envs, "127.0.0.1:0", ServeCfg::default())
    }

    /// Serves [`scene`] at an address.
    pub(crate) fn start_at(num_envs: usize, address: &str, cfg: ServeCfg) -> Self {
        let mut sim = scene(num_envs);
        let served = sim.serve_with(address, cfg).unwrap();
        let viewer =
            sim.viewer(SnapshotRequest { rate: 0.0, contacts: None, markers: false, joints: false, cameras: false });
        let (now, stop) = (Arc::<Mutex<SimState>>::default(), Arc::new(AtomicBool::new(false)));
        let robot = sim.entities().robot_id("arm").unwrap();
        let shared = (Arc::clone(&now), Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            let (now, stop) = shared;
            while !stop.load(Ordering::SeqCst) {
                let start = Instant::now();
                sim.update(1);
                let took = start.elapsed().as_secs_f64();
                let mut now = now.lock().unwrap();
                now.steps += 1;
                now.positions = sim.robot(robot).qpos();
                now.longest_step = now.longest_step.max(took);
                drop(now);
                // Like a program with work of its own; both cores are needed by the tests too.
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        Self { url: served.url().into(), address: served.address(), served, now, stop, viewer, thread: Some(thread) }
    }

    pub(crate) fn now(&self) -> SimState {
        self.now.lock().unwrap().clone()
    }

    /// Restarts the measurement of the longest step.
    pub(crate) fn reset_longest_step(&self) {
        self.now.lock().unwrap().longest_step = 0.0;
    }

    /// Returns the number of viewers.
    pub(crate) fn viewers(&self) -> usize {
        self.served.viewers()
    }

    /// Waits until a condition holds.
    #[track_caller]
    pub(crate) fn wait_until(&self, what: &str, holds: impl Fn(&SimState) -> bool) {
        wait::until(what, || holds(&self.now()));
    }

    /// Waits for `more` further steps.
    #[track_caller]
    pub(crate) fn wait_for_steps(&self, more: u64) {
        let before = self.now().steps;
        self.wait_until("it steps", |now| now.steps > before + more);
    }
}

impl Drop for ServedSimulation {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        self.viewer.send(Command::Resume);
        let ended = self.thread.take().unwrap().join();
        assert!(ended.is_ok() || std::thread::panicking(), "the simulation's thread panicked");
    }
}

/// Plays a recording of half a second, in which the cube of [`scene`] falls from `height`, while `watch` runs.
pub(crate) fn play_fall(height: f64, watch: impl FnOnce(SocketAddr, &str) + Send) {
    struct Ends<'a>(&'a AtomicBool);
    impl Drop for Ends<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Release);
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fall.mcap");
    let mut sim = scene(1);
    let cube = sim.entities().rigid_object_id("cube").unwrap();
    sim.rigid_object_mut(cube).write_pose(&array![[0.7, 0.0, height, 1.0, 0.0, 0.0, 0.0]], None).unwrap();
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(100);
    sim.finish_recording(recorder).unwrap();
    let (playback, mut sim) = Playback::open(&Recording::open(&path).unwrap(), None).unwrap();
    let served =
        sim.serve_with("127.0.0.1:0", ServeCfg { speed: Some(Speed::REAL_TIME), ..ServeCfg::default() }).unwrap();
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let _ends = Ends(&over);
            watch(served.address(), served.url());
        });
        sim.play(&mut RecordingPlayback(playback), &mut || !over.load(Ordering::Acquire)).unwrap();
    });
    served.close(&mut sim).unwrap();
}
