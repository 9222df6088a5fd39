//! Test fixtures: a small simulation (an arm with one joint, a cube on the ground, a camera above it) and a stepping
//! thread.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use crate::scene_view::Canvas;
use kinetoscope_render::Intrinsics;
use kinetoscope_render::frame::Channels;
use kinetoscope_robot::urdf::UrdfCfg;
use kinetoscope_scene::Pose;
use kinetoscope_sensors::camera::{Camera, CameraCfg, Extrinsics, Placement};
use kinetoscope_sim::{
    DriveCfg, ObjectShape, RigidObjectCfg, RobotCfg, RobotId, SensorId, SimulationManager, SimulationManagerCfg,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

/// Half the edge length of the cube \[m\].
pub(crate) const CUBE_HALF_EDGE: f64 = 0.1;
/// Mass of the cube \[kg\].
pub(crate) const MASS: f64 = 2.0;

/// URDF of a plate that turns about a vertical axis, 1 m beside the cube.
const ARM: &str = r#"<robot name="arm"><link name="base"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="plate"/><origin xyz="1 0 0.5"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="50" velocity="5"/></joint>
  <link name="plate">
    <inertial><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><box size="0.4 0.4 0.05"/></geometry></visual>
    <collision><geometry><box size="0.4 0.4 0.05"/></geometry></collision>
  </link></robot>"#;

pub(crate) struct Sample {
    pub(crate) sim: SimulationManager,
    pub(crate) robot: RobotId,
    pub(crate) camera: SensorId<Camera>,
}

/// Builds the sample simulation with `num_envs` environments and a time step of 10 ms.
pub(crate) fn sample(num_envs: usize) -> Sample {
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        num_envs,
        physics_dt: 0.01,
        threads: Some(1),
        arena_space: 4.0,
        ..Default::default()
    })
    .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("arm.urdf");
    std::fs::write(&file, ARM).unwrap();
    let drive =
        DriveCfg { stiffness: [("turn", 100.0)].into(), damping: [("turn", 10.0)].into(), ..Default::default() };
    let cfg = RobotCfg { uid: "arm".into(), urdf: UrdfCfg::single(&file), drive, ..Default::default() };
    let robot = sim.add_robot(cfg).unwrap();
    sim.add_rigid_object(RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(2.0 * CUBE_HALF_EDGE),
        mass: Some(MASS),
        init_pose: Pose::translation(0.0, 0.0, CUBE_HALF_EDGE),
        rgba: [0.8, 0.1, 0.1, 1.0],
        ..Default::default()
    })
    .unwrap();
    let placement = Placement::LookAt { eye: [0.6, 0.5, 0.8], target: [0.2, 0.0, 0.1], up: [0.0, 0.0, 1.0] };
    let cfg = CameraCfg {
        width: 64,
        height: 48,
        intrinsics: Intrinsics::Fovy { radians: 0.9 },
        extrinsics: Extrinsics { placement, ..Default::default() },
        channels: Channels { color: true, depth: true, mask: true, normal: true, ..Channels::default() },
        ..Default::default()
    };
    let camera = sim.add_sensor("eye", cfg).unwrap();
    Sample { sim, robot, camera }
}

/// Counts the pixels that differ between two canvases.
pub(crate) fn differing_pixels(one: &Canvas, other: &Canvas) -> usize {
    one.bytes().chunks(4).zip(other.bytes().chunks(4)).filter(|(a, b)| a != b).count()
}

/// A simulation stepped by its own thread until [`end`](Self::end).
pub(crate) struct SteppingThread {
    steps: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<SimulationManager>,
}

impl SteppingThread {
    pub(crate) fn start(mut sim: SimulationManager) -> Self {
        let (steps, stop) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
        let (count, ends) = (Arc::clone(&steps), Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            while !ends.load(Ordering::SeqCst) {
                sim.update(1);
                count.fetch_add(1, Ordering::SeqCst);
            }
            sim
        });
        Self { steps, stop, thread }
    }

    /// Returns the number of completed steps.
    pub(crate) fn steps(&self) -> u64 {
        self.steps.load(Ordering::SeqCst)
    }

    /// Waits until the thread has completed more than `steps` steps.
    #[track_caller]
    pub(crate) fn wait_for_steps_beyond(&self, steps: u64) {
        kinetoscope_testkit::wait::until("it goes on", || self.steps() > steps);
    }

    /// Stops the thread and returns the simulation. No viewer may hold it paused any more.
    pub(crate) fn end(self) -> SimulationManager {
        self.stop.store(true, Ordering::SeqCst);
        self.thread.join().unwrap()
    }
}
