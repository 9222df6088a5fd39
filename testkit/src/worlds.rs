//! Simulations, robots, objects and cameras for tests. Poses are in the environment frame \[m\].

use crate::urdf::TempFiles;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sensors::{Imu, JointState, JointStateCfg};
use kinetoscope::sim::env::SimEnv;
use kinetoscope::sim::{DriveType, RigidObjectId};

/// A configuration with this number of environments and threads.
pub fn cfg(num_envs: usize, threads: usize) -> SimulationManagerCfg {
    SimulationManagerCfg { num_envs, threads: Some(threads), ..Default::default() }
}

/// A configuration with two threads, and without ground and lights.
pub fn empty_cfg(num_envs: usize) -> SimulationManagerCfg {
    SimulationManagerCfg { ground: None, lights: vec![], ..cfg(num_envs, 2) }
}

/// The configuration of [`empty_cfg`], without gravity.
pub fn weightless_cfg(num_envs: usize) -> SimulationManagerCfg {
    SimulationManagerCfg { gravity: [0.0; 3].into(), ..empty_cfg(num_envs) }
}

/// A simulation with this configuration.
#[track_caller]
pub fn sim(cfg: SimulationManagerCfg) -> SimulationManager {
    SimulationManager::new(cfg).unwrap()
}

/// An object of the default density with its origin at a point.
pub fn object(uid: &str, shape: ObjectShape, [x, y, z]: [f64; 3]) -> RigidObjectCfg {
    RigidObjectCfg { uid: uid.into(), shape, init_pose: Pose::translation(x, y, z), ..Default::default() }
}

/// A cube of this side \[m\] and mass \[kg\].
pub fn cube(uid: &str, side: f64, mass: f64, at: [f64; 3]) -> RigidObjectCfg {
    RigidObjectCfg { mass: Some(mass), ..object(uid, ObjectShape::cube(side), at) }
}

/// A ball of this radius \[m\] and mass \[kg\].
pub fn ball(uid: &str, radius: f64, mass: f64, at: [f64; 3]) -> RigidObjectCfg {
    RigidObjectCfg { mass: Some(mass), ..object(uid, ObjectShape::Sphere { radius }, at) }
}

/// The object, fixed in the world.
pub fn fixed(object: RigidObjectCfg) -> RigidObjectCfg {
    RigidObjectCfg { body_type: BodyType::Static, ..object }
}

/// A robot of one URDF file.
pub fn urdf_robot(uid: &str, urdf: impl AsRef<std::path::Path>) -> RobotCfg {
    RobotCfg { uid: uid.into(), urdf: UrdfCfg::single(urdf), ..Default::default() }
}

/// A robot of URDF text, which is written to `{uid}.urdf`.
pub fn text_robot(files: &TempFiles, uid: &str, urdf: &str) -> RobotCfg {
    urdf_robot(uid, files.write(&format!("{uid}.urdf"), urdf))
}

/// A robot of MJCF text.
pub fn mjcf_robot(uid: &str, mjcf: &str) -> RobotCfg {
    RobotCfg { uid: uid.into(), mjcf: Some(MjcfFile::text(mjcf)), ..Default::default() }
}

/// The robot without drives.
pub fn passive(robot: RobotCfg) -> RobotCfg {
    RobotCfg { drive: DriveCfg { drive_type: DriveType::None, ..Default::default() }, ..robot }
}

/// A drive configuration with these gains for all joints.
pub fn gains(stiffness: f64, damping: f64) -> DriveCfg {
    DriveCfg { stiffness: stiffness.into(), damping: damping.into(), ..Default::default() }
}

/// The bundled arm of six joints.
pub fn sr5(uid: &str) -> RobotCfg {
    urdf_robot(uid, assets::path("sr5/SR5.urdf").unwrap())
}

/// The bundled arm with the bundled hand.
pub fn arm_and_hand(uid: &str) -> RobotCfg {
    let part = |name, file| ComponentCfg::new(name, assets::path(file).unwrap());
    let components = vec![part("arm", "sr5/SR5.urdf"), part("hand", "revo1_left/revo1_left.urdf")];
    RobotCfg { uid: uid.into(), urdf: UrdfCfg { components, ..Default::default() }, ..Default::default() }
}

/// A batch of one row.
pub fn row<const K: usize>(values: [f64; K]) -> Array2<f64> {
    Array2::from_shape_fn((1, K), |(_, k)| values[k])
}

/// A camera at `eye` that looks at `target`, z up, with a vertical field of view of 0.9 rad.
pub fn camera([width, height]: [usize; 2], eye: [f64; 3], target: [f64; 3], channels: Channels) -> CameraCfg {
    let placement = Placement::LookAt { eye, target, up: [0.0, 0.0, 1.0] };
    CameraCfg {
        width,
        height,
        channels,
        intrinsics: Intrinsics::Fovy { radians: 0.9 },
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        ..CameraCfg::default()
    }
}

/// Bits of time, state, warm start, position targets and efforts of an environment, and its number of contacts.
pub fn bits_of(env: &SimEnv) -> Vec<u64> {
    let data = env.data();
    [&[data.time()], data.qpos(), data.qvel(), data.qacc_warmstart(), &env.drives.position, &env.drives.effort]
        .into_iter()
        .flatten()
        .map(|x| x.to_bits())
        .chain([data.contact().len() as u64])
        .collect()
}

/// [`bits_of`] each environment of a simulation.
pub fn all_bits(sim: &SimulationManager) -> Vec<Vec<u64>> {
    let mut bits = Vec::new();
    sim.batch().for_each(|_, env| bits.push(bits_of(env)));
    bits
}

/// A simulation to record: a moving arm, a cube, a camera, an IMU and a joint sensor.
#[derive(Debug)]
pub struct RecordedWorld {
    /// The simulation.
    pub sim: SimulationManager,
    /// The bundled arm.
    pub arm: RobotId,
    /// A cube with edges of 0.1 m.
    pub cube: RigidObjectId,
    /// A camera of 32x24 pixels with color, depth and mask.
    pub camera: SensorId<Camera>,
    /// An IMU on the cube.
    pub imu: SensorId<Imu>,
    /// A sensor of the joints, at every step.
    pub joints: SensorId<JointState>,
}

impl RecordedWorld {
    /// Steps between two images.
    pub const IMAGE_EVERY: u32 = 5;
    /// Steps between two measurements of the IMU.
    pub const IMU_EVERY: u32 = 2;

    /// Builds the simulation.
    pub fn new(num_envs: usize, threads: usize) -> Self {
        let cfg = cfg(num_envs, threads);
        let dt = cfg.physics_dt;
        let mut sim = sim(cfg);
        let arm = sim.add_robot(sr5("arm")).unwrap();
        let cube = sim.add_rigid_object(object("cube", ObjectShape::cube(0.1), [0.0; 3])).unwrap();
        sim.rigid_object_mut(cube).write_pose(&row([0.6, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0]), None).unwrap();
        let channels = Channels { color: true, depth: true, mask: true, ..Channels::default() };
        let mut camera = CameraCfg {
            width: 32,
            height: 24,
            channels,
            intrinsics: Intrinsics::Fovy { radians: 0.9 },
            ..CameraCfg::default()
        };
        camera.update_period = f64::from(Self::IMAGE_EVERY) * dt;
        let camera = sim.add_sensor("camera", camera).unwrap();
        let placed =
            sim.sensor_mut(camera).unwrap().look_at(&[[1.0, 0.6, 0.5]], &[[0.6, 0.2, 0.2]], &[[0.0, 0.0, 1.0]], None);
        placed.unwrap();
        let sampling = SamplingCfg::every(f64::from(Self::IMU_EVERY) * dt);
        let imu = sim.add_sensor("imu", ImuCfg { sampling, ..ImuCfg::on("cube") }).unwrap();
        let joints = sim.add_sensor("joints", JointStateCfg::default()).unwrap();
        Self { sim, arm, cube, camera, imu, joints }
    }

    /// Sets targets that differ between steps and environments, and runs one step.
    pub fn step(&mut self, step: u32) {
        let (envs, dof) = (self.sim.num_envs(), self.sim.robot(self.arm).dof());
        let target = |(env, joint)| 0.3 * (0.1 * f64::from(step) + joint as f64 + env as f64).sin();
        let targets = Array2::from_shape_fn((envs, dof), target);
        self.sim.robot_mut(self.arm).set_qpos_target(&targets, None, None).unwrap();
        self.sim.update(1);
    }
}

/// Pose in a row of a batch of poses.
pub fn pose_of_row(poses: &Array2<f64>, row: usize) -> Pose {
    kinetoscope::scene::pose::from_row(&std::array::from_fn(|k| poses[(row, k)]))
}

/// Distance \[m\] and angle \[rad\] between two poses.
pub fn pose_error(a: &Pose, b: &Pose) -> (f64, f64) {
    ((a.translation.vector - b.translation.vector).norm(), a.rotation.angle_to(&b.rotation))
}

/// Number of diagnostics whose text contains all of these words.
pub fn count_diagnostics(sim: &SimulationManager, words: &[&str]) -> usize {
    sim.diagnostics()
        .iter()
        .map(ToString::to_string)
        .filter(|text| words.iter().all(|word| text.contains(word)))
        .count()
}

/// Extrinsics of a camera without a parent at `eye` that looks at `target`, z up.
pub fn look_at(eye: [f64; 3], target: [f64; 3]) -> Extrinsics {
    let placement = Placement::LookAt { eye, target, up: [0.0, 0.0, 1.0] };
    Extrinsics { placement, ..Extrinsics::default() }
}

/// The mask id of an object, or the first one if it has several links.
pub fn mask_id(sim: &SimulationManager, object: &str) -> i32 {
    sim.scene().mask_ids().iter().find(|id| id.object == object).expect("an object of this name").id
}

/// A drive configuration in which no joint has a drive.
pub fn no_drive() -> DriveCfg {
    DriveCfg { drive_type: DriveType::None, ..Default::default() }
}

/// Adds a small ball of the default density at `at`, which compiles the model again.
#[track_caller]
pub fn add_ball(sim: &mut SimulationManager, uid: &str, at: [f64; 3]) -> RigidObjectId {
    sim.add_rigid_object(object(uid, ObjectShape::Sphere { radius: 0.1 }, at)).unwrap()
}
