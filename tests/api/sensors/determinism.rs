//! Sensors do not change the motion in any bit. The readings of all types of sensors, eager or lazy, are bit-identical
//! for all numbers of threads, strides and environments.

use super::worlds::{cfg, cube, look_at, sr5};
use kinetoscope::mujoco as mj;
use kinetoscope::ndarray::{Array2, ArrayBase, Axis, Data, RemoveAxis, array};
use kinetoscope::prelude::*;
use kinetoscope::render::frame::Depth;
use kinetoscope::sensors::camera::StereoCameraCfg;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{RayCaster, RayCasterCameraCfg};
use kinetoscope::sensors::{
    ActuatorStateCfg, FrameTransformerCfg, JointStateCfg, JointWrenchCfg, MujocoSensorCfg, NoiseCfg, SensorCfg,
    TargetFrameCfg,
};
use kinetoscope::sim::{EntityTypes, Integrator};
use kinetoscope_testkit::bits::Bits;
use std::collections::BTreeMap;

/// A pendulum with MJCF sensors.
const PENDULUM: &str = r#"<mujoco><worldbody><body name="rod" pos="1.2 0.3 0.8"><joint name="hinge" axis="0 1 0.3"/>
    <geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0.1"/><site name="tip" pos="0.4 0 0.1" euler="20 0 30"/></body></worldbody>
  <sensor><accelerometer name="acc" site="tip"/><gyro name="gyro" site="tip"/><framequat name="turn" objtype="site" objname="tip"/>
    <force name="force" site="tip"/></sensor></mujoco>"#;

/// A sampling with latency, dropout, and noise in one channel.
fn noisy(channel: &str, seconds: f64) -> SamplingCfg {
    let noise = NoiseCfg { bias_walk: 0.1, ..NoiseCfg::white(0.1) };
    let noise = [(channel.to_string(), noise)].into();
    SamplingCfg { latency_steps: 2, dropout: 0.1, history_length: 3, noise, ..SamplingCfg::every(seconds) }
}

/// The sampling of one sensor, by its noisy channel and its period.
type Sampling = fn(&str, f64) -> SamplingCfg;

fn spin(num_envs: usize) -> Array2<f64> {
    Array2::from_shape_fn((num_envs, 6), |(env, axis)| (1.3 * env as f64 + 0.7 * axis as f64).sin())
}

/// An arm with saturating drives (if `with_arm`), tumbling boxes and a pendulum. All environments differ. The contacts
/// exceed the initial buffers, so steps are repeated while they are captured.
fn world(settings: SimulationManagerCfg, with_arm: bool) -> (SimulationManager, Option<RobotId>) {
    let n = settings.num_envs;
    let mut sim = kinetoscope_testkit::worlds::sim(settings);
    let arm = with_arm.then(|| sim.add_robot(sr5("arm")).unwrap());
    for k in 0..4 {
        let at = [0.8 + 0.05 * f64::from(k), 0.1, 0.15 + 0.25 * f64::from(k)];
        let id = sim.add_rigid_object(cube(&format!("box{k}"), 0.2, 1.0, at)).unwrap();
        sim.rigid_object_mut(id).write_velocity(&spin(n), None).unwrap();
    }
    for k in 0..5 {
        sim.add_rigid_object(cube(&format!("pile{k}"), 0.2, 1.0, [-1.0 - 0.5 * f64::from(k), 0.0, 0.11])).unwrap();
    }
    let part = sim.add_mjcf(MjcfPartCfg::text("m", PENDULUM)).unwrap();
    sim.mjcf_part_mut(part).write_qvel(&Array2::from_shape_fn((n, 1), |(env, _)| env as f64), None).unwrap();
    if let Some(arm) = arm {
        let targets = Array2::from_shape_fn((n, 6), |(env, joint)| 0.3 * (env as f64 - 2.0) + 0.1 * joint as f64);
        sim.robot_mut(arm).set_qpos_target(&targets, None, None).unwrap();
    }
    (sim, arm)
}

/// Bits of all readings of an environment, by the name of the type in scene files.
type Readings = BTreeMap<&'static str, Vec<u64>>;

/// Bits of one environment of several batches. The first axis of a batch is the environment.
struct EnvBits(usize, Vec<u64>);

impl EnvBits {
    fn add<T: Bits, S: Data<Elem = T>, D: RemoveAxis>(&mut self, batch: &ArrayBase<S, D>) {
        self.1.extend(batch.index_axis(Axis(0), self.0).iter().map(|x| x.bits()));
    }

    /// Appends all data of a sampler: all channels and stamps, with their histories.
    fn add_sampled(&mut self, sensor: &impl Sampled) {
        let sampler = sensor.sampler();
        self.add(&sensor.sample_counts());
        self.add(&sensor.stamps());
        self.add(&sensor.force_stamps());
        self.add(&sensor.stamp_history());
        for channel in sampler.channels().map(|channel| channel.name) {
            self.add(&sampler.values(channel));
            self.add(&sampler.history(channel));
        }
    }
}

type Reader = Box<dyn Fn(&SimulationManager, &mut EnvBits)>;

/// Sensors, by the name of their type in scene files, each with its reader.
#[derive(Default)]
struct Readers(Vec<(&'static str, Reader)>);

impl Readers {
    fn add<C>(&mut self, sim: &mut SimulationManager, kind: &'static str, cfg: C, read: fn(&C::Sensor, &mut EnvBits))
    where
        C: SensorCfg + Send + 'static,
        C::Sensor: 'static,
    {
        let id = sim.add_sensor(kind, cfg).unwrap();
        self.0.push((
            kind,
            Box::new(move |sim: &SimulationManager, words: &mut EnvBits| {
                read(sim.sensor(id).unwrap(), words);
            }),
        ));
    }

    /// Appends the readings of every sensor in each environment.
    fn read(&self, sim: &SimulationManager, readings: &mut [Readings]) {
        for (env, readings) in readings.iter_mut().enumerate() {
            for (kind, read) in &self.0 {
                let mut words = EnvBits(env, Vec::new());
                read(sim, &mut words);
                readings.entry(kind).or_default().extend(words.1);
            }
        }
    }
}

/// Adds a sensor of every type, with enough work for three threads: 5 cameras of 128 by 96 pixels take some 2 ms; the
/// rays are 13000 and 15000.
fn add_sensors(sim: &mut SimulationManager, sampling: Sampling) -> Readers {
    let on = |name: &str| Extrinsics { parent: Some(name.into()), ..Default::default() };
    let camera = CameraCfg {
        width: 128,
        height: 96,
        extrinsics: Extrinsics { parent: Some("box0".into()), ..look_at([1.5, -1.0, 1.0], [0.0; 3]) },
        channels: Channels::ALL,
        update_period: 0.01,
        ..Default::default()
    };
    let rays = RayCasterCfg {
        parent: Some("box3".into()),
        offset: Pose::translation(0.0, 0.0, 1.0),
        pattern: Grid { resolution: 0.04, size: [2.0; 2], ..Grid::default() }.into(),
        drift: [-0.1, 0.1],
        sampling: sampling("distances", 0.0),
        ..Default::default()
    };
    let (width, height, extrinsics) = (64, 48, on("m/tip"));
    let sampling_of_rays = sampling("distances", 0.01);
    let ray_camera = RayCasterCameraCfg { width, height, extrinsics, sampling: sampling_of_rays, ..Default::default() };
    let SamplingCfg { latency_steps, dropout, history_length, noise, .. } = sampling("depth", 0.01);
    let one = CameraCfg {
        width,
        height,
        intrinsics: Intrinsics::Fovy { radians: 1.0 },
        extrinsics: on("m/tip"),
        channels: Channels { color: true, depth: true, mask: true, position: true, ..Channels::NONE },
        update_period: 0.01,
        latency_steps,
        dropout,
        history_length,
        noise,
        ..Default::default()
    };
    let stereo = StereoCameraCfg { camera: one, left_to_right_pos: [0.05, 0.0, 0.0], ..Default::default() };
    let contact = ContactSensorCfg {
        filters: vec!["ground".into(), "box.*".into()],
        track_pose: true,
        track_air_time: sampling("", 0.0).history_length > 0,
        track_contact_points: true,
        track_friction_forces: true,
        sampling: sampling("net_forces_w", 0.01),
        ..ContactSensorCfg::for_bodies("box.*")
    };
    let targets = vec![TargetFrameCfg::for_bodies("box.*"), TargetFrameCfg::for_bodies("m/tip")];
    let sampling_of_frames = sampling("target_pos_source", 0.01);
    let frames = FrameTransformerCfg { sampling: sampling_of_frames, ..FrameTransformerCfg::new("ee_link", targets) };
    let wrench = JointWrenchCfg {
        links: vec!["link[36]".into()],
        frames: vec!["m/tip".into()],
        sampling: sampling("torques", 0.01),
        debug_vis: true,
    };
    let own = Some(["acc", "gyro", "force"].map(String::from).into());
    let imu = ImuCfg { sampling: sampling("lin_acc_b", 0.0), ..ImuCfg::on("box1") };
    let joints = JointStateCfg { joints: None, sampling: sampling("velocities", 0.0) };
    let actuators = ActuatorStateCfg { actuators: None, sampling: sampling("forces", 0.01) };
    let own = MujocoSensorCfg { sensors: own, sampling: sampling("values", 0.01) };
    let mut readers = Readers::default();
    readers.add(sim, "camera", camera, |camera, words| {
        words.add(&camera.color().unwrap());
        words.add(&camera.mask().unwrap());
        [camera.depth(), camera.distance()].into_iter().for_each(|depth| words.add(&depth.unwrap()));
        for vectors in [camera.normal(), camera.shading_normal(), camera.position()] {
            words.add(&vectors.unwrap());
        }
    });
    readers.add(sim, "ray_caster", rays, |rays, words| {
        words.add_sampled(rays);
        words.add(&rays.hits());
    });
    readers.add(sim, "ray_caster_camera", ray_camera, |camera, words| {
        words.add_sampled(camera);
        [camera.depth(), camera.distance()].into_iter().for_each(|depth| words.add(&depth));
        words.add(&camera.mask());
    });
    readers.add(sim, "stereo_camera", stereo, |stereo, words| {
        for camera in [stereo.left(), stereo.right()] {
            words.add(&camera.stamps());
            words.add(&camera.stamp_history());
            words.add(&camera.color().unwrap());
            words.add(&camera.depth().unwrap());
            words.add(&camera.position().unwrap());
            words.add(&camera.history::<Depth>().unwrap());
        }
        words.add(&stereo.disparity().unwrap());
    });
    readers.add(sim, "contact_sensor", contact, |sensor, words| words.add_sampled(sensor));
    readers.add(sim, "imu", imu, |sensor, words| words.add_sampled(sensor));
    readers.add(sim, "frame_transformer", frames, |sensor, words| words.add_sampled(sensor));
    readers.add(sim, "joint_state", joints, |sensor, words| words.add_sampled(sensor));
    readers.add(sim, "actuator_state", actuators, |sensor, words| words.add_sampled(sensor));
    readers.add(sim, "joint_wrench", wrench, |sensor, words| words.add_sampled(sensor));
    readers.add(sim, "mujoco_sensor", own, |sensor, words| words.add_sampled(sensor));
    readers
}

/// Returns the readings of all environments, with a reset in the middle.
fn readings(num_envs: usize, threads: usize, seed: u64, stride: u32) -> Vec<Readings> {
    let settings = SimulationManagerCfg { threads: Some(threads), seed, ..cfg(num_envs) };
    let (mut sim, _) = world(settings, true);
    let readers = add_sensors(&mut sim, noisy);
    let mut readings = vec![Readings::new(); num_envs];
    for k in 0..12 {
        if k == 6 {
            sim.reset(Some(&[EnvId(1)])).unwrap();
        }
        (0..6 / stride).for_each(|_| sim.update(stride));
        readers.read(&sim, &mut readings);
    }
    readings
}

fn assert_same(what: &str, found: &[Readings], expected: &[Readings]) {
    assert_eq!(found.len(), expected.len());
    for (env, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!(found.keys().eq(expected.keys()));
        for (kind, words) in found {
            assert!(words == &expected[kind], "{kind} with {what}, environment {env}");
        }
    }
}

#[test]
fn threads_environments_and_strides() {
    let one = readings(5, 1, 5, 6);
    assert_same("2 threads", &readings(5, 2, 5, 6), &one);
    assert_same("3 threads and single steps", &readings(5, 3, 5, 1), &one);
    assert_same("2 environments", &readings(2, 1, 5, 6), &one[..2]);
    // Controls: environments differ, and noise depends on the seed for all sensors but the camera, which has no noise.
    let other = readings(5, 1, 6, 6);
    for (kind, words) in &one[0] {
        assert!(words != &one[1][kind], "{kind} is the same in two environments");
        assert!((0..5).all(|env| one[env][kind] == other[env][kind]) == (*kind == "camera"), "{kind}");
    }
    // A new sensor type must be added here, too.
    let entity_types = ["robot", "articulation", "rigid_object", "rigid_object_group", "terrain", "mjcf", "weld"];
    let types = EntityTypes::default();
    let mut kinds: Vec<&str> = types.names().filter(|name| !entity_types.contains(name)).collect();
    kinds.sort_unstable();
    assert!(one[0].keys().eq(&kinds), "{kinds:?}");
}

/// Eager and lazy sensors have equal readings, for readings with several measurements in between, with resets and
/// writes. Lazy sensors count the measurements that were due.
#[test]
fn eager_and_lazy() {
    let exact: [Sampling; 2] = [
        |_, seconds| SamplingCfg::every(seconds),
        |_, seconds| SamplingCfg { lazy: true, ..SamplingCfg::every(seconds) },
    ];
    let [eager, lazy] = exact.map(|sampling| {
        let (mut sim, _) = world(SimulationManagerCfg { seed: 5, ..cfg(5) }, true);
        let readers = add_sensors(&mut sim, sampling);
        let mut all = vec![Readings::new(); 5];
        for k in 0..10_u32 {
            match k {
                3 | 6 => sim.reset(Some(&[EnvId(k as usize / 3)])).unwrap(),
                5 => {
                    let box_ = sim.entities().rigid_object_id("box1").unwrap();
                    let speed = Array2::from_elem((1, 6), 0.5);
                    sim.rigid_object_mut(box_).write_velocity(&speed, Some(&[EnvId(3)])).unwrap();
                }
                _ => {}
            }
            sim.update([7, 1, 7, 0][k as usize % 4]);
            readers.read(&sim, &mut all);
        }
        let counts = sim.sensor(sim.entities().sensor_ids::<RayCaster>()[0].1).unwrap().sample_counts().to_vec();
        assert_eq!(counts, [38, 23, 15, 38, 38], "every step since the last reset");
        all
    });
    assert_same("lazy sensors", &lazy, &eager);
}

/// Returns the states of a simulation with targets, writes and resets.
fn states(settings: SimulationManagerCfg, with_arm: bool, with_sensors: bool) -> Vec<Vec<u64>> {
    let n = settings.num_envs;
    let (mut sim, arm) = world(settings, with_arm);
    if with_sensors && with_arm {
        add_sensors(&mut sim, noisy);
    } else if with_sensors {
        let sampling = || noisy("lin_acc_b", 0.0);
        sim.add_sensor("imu", ImuCfg { sampling: sampling(), ..ImuCfg::on("box1") }).unwrap();
        let filters = vec!["ground".into()];
        sim.add_sensor("contact", ContactSensorCfg { filters, ..ContactSensorCfg::for_bodies("box.*") }).unwrap();
    }
    let boxes = ["box0", "box1"].map(|name| sim.entities().rigid_object_id(name).unwrap());
    let mut states = Vec::new();
    for k in 0..40 {
        if let Some(arm) = arm {
            let target = 0.5 * f64::from(k % 5) - 1.0;
            sim.robot_mut(arm).set_qpos_target(&array![[target, 1.0, -target, 0.3, target, 0.0]], None, None).unwrap();
        }
        match k {
            10 => sim.reset(Some(&[EnvId(1)])).unwrap(),
            20 => sim.rigid_object_mut(boxes[1]).write_velocity(&spin(n), None).unwrap(),
            30 => {
                let pose = array![[0.8, 0.0, 0.09, 2.0, 0.1, 0.0, 0.0]];
                sim.rigid_object_mut(boxes[0]).write_pose(&pose, Some(&[EnvId(0)])).unwrap();
            }
            _ => {}
        }
        sim.update(7);
        states.extend(kinetoscope_testkit::worlds::all_bits(&sim));
    }
    assert!(
        sim.warnings().buffer_growths() > 0 || mj::BUILD_VERSION == mj::SupportedVersion::V4,
        "the arena of 4.x is large enough"
    );
    states
}

#[test]
fn motion_with_and_without_sensors() {
    let substeps = || SimulationManagerCfg { substeps: 2, ..cfg(3) };
    assert!(states(substeps(), true, true) == states(substeps(), true, false));
    // RK4 solves within its steps; sensors get values solved for the beginning of the step.
    let rk4 = || SimulationManagerCfg { integrator: Integrator::Rk4, ..cfg(3) };
    assert!(states(rk4(), false, true) == states(rk4(), false, false));
}
