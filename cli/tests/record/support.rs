//! A scene with something of everything, and MCAP files as lists of messages.

use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use std::borrow::Borrow;
use std::path::Path;

/// Steps between two pictures, and between two measurements of the IMU.
pub(crate) const PICTURE_EVERY: u32 = 5;
pub(crate) const IMU_EVERY: u32 = 2;

/// An arm that moves, a cube, a camera, an IMU and a sensor of joints.
pub(crate) struct World {
    pub(crate) sim: SimulationManager,
    pub(crate) arm: RobotId,
    pub(crate) cube: ObjectId,
    pub(crate) camera: SensorId<Camera>,
    pub(crate) imu: SensorId<Imu>,
    pub(crate) joints: SensorId<JointState>,
}

impl World {
    pub(crate) fn new(num_envs: usize, threads: usize) -> Self {
        let cfg = SimulationManagerCfg { num_envs, threads: Some(threads), ..Default::default() };
        let dt = cfg.physics_dt;
        let mut sim = SimulationManager::new(cfg).unwrap();
        let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
        let arm = sim.add_robot(RobotCfg { uid: "arm".into(), urdf, ..Default::default() }).unwrap();
        let cube = RigidObjectCfg { uid: "cube".into(), shape: ObjectShape::cube(0.1), ..Default::default() };
        let cube = sim.add_rigid_object(cube).unwrap();
        sim.rigid_object_mut(cube).write_pose(&row([0.6, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0]), None).unwrap();
        let channels = Channels { color: true, depth: true, mask: true, ..Channels::default() };
        let mut camera = CameraCfg {
            width: 32,
            height: 24,
            channels,
            intrinsics: Intrinsics::Fovy { radians: 0.9 },
            ..CameraCfg::default()
        };
        camera.update_period = f64::from(PICTURE_EVERY) * dt;
        let camera = sim.add_sensor("camera", camera).unwrap();
        sim.sensor_mut(camera)
            .unwrap()
            .look_at(&[[1.0, 0.6, 0.5]], &[[0.6, 0.2, 0.2]], &[[0.0, 0.0, 1.0]], None)
            .unwrap();
        let sampling = SamplingCfg::every(f64::from(IMU_EVERY) * dt);
        let imu = sim.add_sensor("imu", ImuCfg { sampling, ..ImuCfg::on("cube") }).unwrap();
        let joints = sim.add_sensor("joints", JointStateCfg::default()).unwrap();
        Self { sim, arm, cube, camera, imu, joints }
    }

    /// Targets that change at every step, otherwise in each environment.
    pub(crate) fn step(&mut self, step: u32) {
        let (envs, dof) = (self.sim.num_envs(), self.sim.robot(self.arm).dof());
        let target = |(env, joint)| 0.3 * (0.1 * f64::from(step) + joint as f64 + env as f64).sin();
        let targets = Array2::from_shape_fn((envs, dof), target);
        self.sim.robot_mut(self.arm).set_qpos(&targets, None, None).unwrap();
        self.sim.update(1);
    }
}

pub(crate) fn row<const K: usize>(values: [f64; K]) -> Array2<f64> {
    Array2::from_shape_fn((1, K), |(_, k)| values[k])
}

/// A message of an MCAP file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Message {
    pub(crate) topic: String,
    pub(crate) schema: String,
    pub(crate) time: u64,
    pub(crate) data: Vec<u8>,
}

pub(crate) fn messages(path: &Path) -> Vec<Message> {
    let bytes = std::fs::read(path).unwrap();
    let all = mcap::MessageStream::new(&bytes).unwrap().map(|message| {
        let message = message.unwrap();
        Message {
            topic: message.channel.topic.clone(),
            schema: message.channel.schema.as_ref().unwrap().name.clone(),
            time: message.log_time,
            data: message.data.to_vec(),
        }
    });
    all.collect()
}

/// The messages of one topic.
pub(crate) fn of<'m>(messages: &'m [Message], topic: &str) -> Vec<&'m Message> {
    messages.iter().filter(|message| message.topic == topic).collect()
}

/// The bytes of numbers, as messages have them.
pub(crate) fn bytes(numbers: impl IntoIterator<Item: Borrow<f64>>) -> Vec<u8> {
    numbers.into_iter().flat_map(|x| x.borrow().to_le_bytes()).collect()
}

pub(crate) fn contains(data: &[u8], part: &[u8]) -> bool {
    data.windows(part.len()).any(|window| window == part)
}
