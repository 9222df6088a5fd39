//! A simulation that steps on a thread of its own while it is served.

use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::view::{Command, Viewer, Viewing, Wants};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Bundled arm of six driven joints.
pub(crate) const ARM: &str = "sr5/SR5.urdf";

/// How it stands, as the program that steps sees it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Now {
    pub(crate) steps: u64,
    pub(crate) positions: Array2<f64>,
    /// The longest time that one step took \[s\].
    pub(crate) longest_step: f64,
}

/// A simulation that is served, and stops when it is dropped.
pub(crate) struct Running {
    pub(crate) url: String,
    pub(crate) address: SocketAddr,
    served: Served,
    now: Arc<Mutex<Now>>,
    stop: Arc<AtomicBool>,
    /// Lets it go on where somebody paused it.
    pub(crate) key: Viewer,
    thread: Option<JoinHandle<()>>,
}

/// The arm beside a red cube, with a camera that looks at both, `num_envs` times.
pub(crate) fn scene(num_envs: usize) -> SimulationManager {
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        num_envs,
        physics_dt: 0.005,
        threads: Some(1),
        arena_space: 3.0,
        ..Default::default()
    })
    .unwrap();
    sim.add_robot(RobotCfg {
        uid: "arm".into(),
        urdf: UrdfCfg { components: vec![ComponentCfg::new("arm", assets::path(ARM).unwrap())], ..Default::default() },
        drive: DriveCfg { stiffness: 1e4.into(), damping: 1e3.into(), ..Default::default() },
        ..Default::default()
    })
    .unwrap();
    sim.add_rigid_object(RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(0.4),
        mass: Some(1.0),
        init_pose: Pose::translation(0.7, 0.0, 0.2),
        rgba: [0.9, 0.05, 0.05, 1.0],
        ..Default::default()
    })
    .unwrap();
    sim.add_sensor(
        "eye",
        CameraCfg {
            width: 64,
            height: 48,
            intrinsics: Intrinsics::Fovy { radians: 1.0 },
            extrinsics: Extrinsics {
                parent: None,
                placement: Placement::LookAt { eye: [2.0, 1.0, 1.2], target: [0.4, 0.0, 0.2], up: [0.0, 0.0, 1.0] },
                ..Default::default()
            },
            channels: Channels { color: true, depth: true, mask: true, normal: true, ..Default::default() },
            ..Default::default()
        },
    )
    .unwrap();
    sim
}

impl Running {
    /// Serves [`scene`] where a free port is.
    pub(crate) fn start(num_envs: usize) -> Self {
        Self::start_at(num_envs, "127.0.0.1:0", ServeCfg::default())
    }

    /// Serves [`scene`] at an address.
    pub(crate) fn start_at(num_envs: usize, address: &str, cfg: ServeCfg) -> Self {
        let mut sim = scene(num_envs);
        let served = sim.serve_with(address, cfg).unwrap();
        let key = sim.viewer(Wants { rate: 0.0, contacts: None, markers: false, joints: false, cameras: false });
        let (now, stop) = (Arc::<Mutex<Now>>::default(), Arc::new(AtomicBool::new(false)));
        let robot = sim.robot_id("arm").unwrap();
        let shared = (Arc::clone(&now), Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            let (now, stop) = shared;
            while !stop.load(Ordering::SeqCst) {
                let start = Instant::now();
                sim.update(1);
                let took = start.elapsed().as_secs_f64();
                let mut now = now.lock().unwrap();
                now.steps += 1;
                now.positions = sim.robot(robot).get_qpos();
                now.longest_step = now.longest_step.max(took);
                drop(now);
                // As a program with work of its own; both cores are for the tests too.
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        Self { url: served.url().into(), address: served.address(), served, now, stop, key, thread: Some(thread) }
    }

    /// How it stands.
    pub(crate) fn now(&self) -> Now {
        self.now.lock().unwrap().clone()
    }

    /// Begins to measure the longest step anew.
    pub(crate) fn forget_longest_step(&self) {
        self.now.lock().unwrap().longest_step = 0.0;
    }

    /// Viewers there are.
    pub(crate) fn viewers(&self) -> usize {
        self.served.viewers()
    }

    /// Waits until something holds.
    pub(crate) fn wait_until(&self, what: &str, holds: impl Fn(&Now) -> bool) {
        wait_until(what, || holds(&self.now()));
    }
}

/// Waits until something holds; a minute is more than anything here takes on a busy machine.
pub(crate) fn wait_until(what: &str, holds: impl Fn() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited for a minute: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        self.key.send(Command::Resume);
        let ended = self.thread.take().unwrap().join();
        assert!(ended.is_ok() || std::thread::panicking(), "the simulation's thread panicked");
    }
}
