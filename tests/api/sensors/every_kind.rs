//! Every kind of sensor at once: threads change no bit of what any of them says.

use crate::sensors::worlds::{cfg, cube};
use kinetoscope::ndarray::{Array2, ArrayBase, Axis, Data, Dimension};
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::channel::Depth;
use kinetoscope::sensors::ray::pattern::Grid;
use std::collections::BTreeMap;

/// A pendulum with sensors of its own.
const PENDULUM: &str = r#"<mujoco><worldbody><body name="rod" pos="1.2 0.3 0.8"><joint name="hinge" axis="0 1 0.3"/>
    <geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0.1"/><site name="tip" pos="0.4 0 0.1" euler="20 0 30"/></body></worldbody>
  <sensor><accelerometer name="acc" site="tip"/><gyro name="gyro" site="tip"/><framequat name="turn" objtype="site" objname="tip"/>
    <force name="force" site="tip"/></sensor></mujoco>"#;

/// What each kind of sensor said, bit for bit, by the name of the kind in scene files.
type Said = BTreeMap<&'static str, Vec<u64>>;

struct Ids {
    camera: SensorId<Camera>,
    rays: SensorId<RayCaster>,
    eye: SensorId<RayCasterCamera>,
    pair: SensorId<StereoCamera>,
    contact: SensorId<ContactSensor>,
    imu: SensorId<Imu>,
    frames: SensorId<FrameTransformer>,
    joints: SensorId<JointState>,
    actuators: SensorId<ActuatorState>,
    wrench: SensorId<JointWrench>,
    own: SensorId<MujocoSensor>,
}

/// Late, lossy, and noisy in one channel.
fn sampling(channel: &str, seconds: f64) -> SamplingCfg {
    let noise = NoiseCfg { bias_walk: 0.1, ..NoiseCfg::white(0.1) };
    let noise = [(channel.to_string(), noise)].into();
    SamplingCfg { latency_steps: 2, dropout: 0.1, history_length: 3, noise, ..SamplingCfg::every(seconds) }
}

/// The sampling of one sensor, by its noisy channel and its period.
type Sampling = fn(&str, f64) -> SamplingCfg;

/// An arm, boxes that tumble and a pendulum, with a sensor of every kind. There is enough to see for three threads: 5 cameras
/// of 128 by 96 pixels take some 2 ms, rays are 13000 and 15000.
fn world(threads: usize, seed: u64, sampling: Sampling) -> (SimulationManager, Ids) {
    let settings = SimulationManagerCfg { threads: Some(threads), seed, ..cfg(5) };
    let mut sim = SimulationManager::new(settings).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    let arm = sim.add_robot(RobotCfg { uid: "arm".into(), urdf, ..Default::default() }).unwrap();
    for k in 0..4 {
        let box_ = cube(&format!("box{k}"), 1.0, 0.2, [0.8 + 0.05 * f64::from(k), 0.1, 0.15 + 0.25 * f64::from(k)]);
        let id = sim.add_rigid_object(box_).unwrap();
        let spin = Array2::from_shape_fn((5, 6), |(env, axis)| (1.3 * env as f64 + 0.7 * axis as f64).sin());
        sim.rigid_object_mut(id).write_velocity(&spin, None).unwrap();
    }
    let part = sim.add_mjcf(MjcfCfg::text("m", PENDULUM)).unwrap();
    let speeds = Array2::from_shape_fn((5, 1), |(env, _)| env as f64);
    sim.mjcf_part_mut(part).write_qvel(&speeds, None).unwrap();
    let parent = |name: &str| Extrinsics { parent: Some(name.into()), ..Default::default() };
    let placement = Placement::LookAt { eye: [1.5, -1.0, 1.0], target: [0.0; 3], up: [0.0, 0.0, 1.0] };
    let camera = CameraCfg {
        width: 128,
        height: 96,
        extrinsics: Extrinsics { placement, ..parent("box0") },
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
    let eye = RayCasterCameraCfg {
        width: 64,
        height: 48,
        extrinsics: parent("m/tip"),
        sampling: sampling("distances", 0.01),
        ..Default::default()
    };
    let SamplingCfg { latency_steps, dropout, history_length, noise, .. } = sampling("depth", 0.01);
    let one_eye = CameraCfg {
        width: 64,
        height: 48,
        intrinsics: Intrinsics::Fovy { radians: 1.0 },
        extrinsics: parent("m/tip"),
        channels: Channels { color: true, depth: true, mask: true, ..Channels::NONE },
        update_period: 0.01,
        latency_steps,
        dropout,
        history_length,
        noise,
        ..Default::default()
    };
    let pair = StereoCameraCfg { camera: one_eye, left_to_right_pos: [0.05, 0.0, 0.0], ..Default::default() };
    let contact = ContactSensorCfg {
        filters: vec!["ground".into(), "box.*".into()],
        track_pose: true,
        track_air_time: sampling("", 0.0).history_length > 0,
        track_contact_points: true,
        track_friction_forces: true,
        sampling: sampling("net_forces_w", 0.01),
        ..ContactSensorCfg::of("box.*")
    };
    let targets = vec![TargetFrameCfg::of("box.*"), TargetFrameCfg::of("m/tip")];
    let frames = FrameTransformerCfg {
        sampling: sampling("target_pos_source", 0.01),
        ..FrameTransformerCfg::from("ee_link", targets)
    };
    let wrench = JointWrenchCfg {
        links: vec!["link[36]".into()],
        frames: vec!["m/tip".into()],
        sampling: sampling("torques", 0.01),
        debug_vis: true,
    };
    let own = MujocoSensorCfg {
        sensors: Some(["acc", "gyro", "force"].map(String::from).into()),
        sampling: sampling("values", 0.01),
    };
    let ids = Ids {
        camera: sim.add_sensor("camera", camera).unwrap(),
        rays: sim.add_sensor("rays", rays).unwrap(),
        eye: sim.add_sensor("eye", eye).unwrap(),
        pair: sim.add_sensor("pair", pair).unwrap(),
        contact: sim.add_sensor("contact", contact).unwrap(),
        imu: sim.add_sensor("imu", ImuCfg { sampling: sampling("lin_acc_b", 0.0), ..ImuCfg::on("box1") }).unwrap(),
        frames: sim.add_sensor("frames", frames).unwrap(),
        joints: sim
            .add_sensor("joints", JointStateCfg { joints: None, sampling: sampling("velocities", 0.0) })
            .unwrap(),
        actuators: sim
            .add_sensor("actuators", ActuatorStateCfg { actuators: None, sampling: sampling("forces", 0.01) })
            .unwrap(),
        wrench: sim.add_sensor("wrench", wrench).unwrap(),
        own: sim.add_sensor("own", own).unwrap(),
    };
    let targets = Array2::from_shape_fn((5, 6), |(env, joint)| 0.3 * (env as f64 - 2.0) + 0.1 * joint as f64);
    sim.robot_mut(arm).set_qpos(&targets, None, None).unwrap();
    (sim, ids)
}

fn bits<S: Data<Elem = f64>, D: Dimension>(values: &ArrayBase<S, D>) -> impl Iterator<Item = u64> {
    values.iter().map(|x| x.to_bits())
}

/// Everything that a sampler has: all channels and stamps, now and before.
fn sampled(sensor: &impl Sampled) -> Vec<u64> {
    let sampler = sensor.sampler();
    let mut all: Vec<u64> = sensor.sample_counts().to_vec();
    all.extend(bits(&sensor.stamps()).chain(bits(&sensor.force_stamps())).chain(bits(&sensor.stamp_history())));
    for channel in sampler.channels() {
        all.extend(bits(&sampler.values(channel)).chain(bits(&sampler.history(channel))));
    }
    all
}

fn pictures(camera: &Camera) -> Vec<u64> {
    let mut all: Vec<u64> = camera.color().unwrap().iter().map(|x| u64::from(*x)).collect();
    all.extend(camera.mask().unwrap().iter().map(|x| u64::from(x.cast_unsigned())));
    for depth in [camera.depth().unwrap(), camera.distance().unwrap()] {
        all.extend(depth.iter().map(|x| u64::from(x.to_bits())));
    }
    for vectors in [camera.normal().unwrap(), camera.shading_normal().unwrap(), camera.position().unwrap()] {
        all.extend(vectors.iter().map(|x| u64::from(x.to_bits())));
    }
    all
}

/// What both eyes of a pair show and remember.
fn both(pair: &StereoCamera) -> Vec<u64> {
    let mut all = Vec::new();
    for eye in [pair.left(), pair.right()] {
        all.extend(bits(&eye.stamps()).chain(bits(&eye.stamp_history())));
        all.extend(eye.color().unwrap().iter().map(|x| u64::from(*x)));
        all.extend(eye.depth().unwrap().iter().map(|x| u64::from(x.to_bits())));
        all.extend(eye.history::<Depth>().unwrap().iter().map(|x| u64::from(x.to_bits())));
    }
    all.extend(pair.disparity().unwrap().iter().map(|x| u64::from(x.to_bits())));
    all
}

/// What is made of the numbers of a camera of rays: pictures in single precision.
fn seen(eye: &RayCasterCamera) -> impl Iterator<Item = u64> {
    let depth = eye.depth().into_iter().chain(eye.distance()).map(|x| u64::from(x.to_bits())).collect::<Vec<_>>();
    depth.into_iter().chain(eye.mask().into_iter().map(|x| u64::from(x.cast_unsigned())))
}

fn said(threads: usize, seed: u64) -> Said {
    let (mut sim, ids) = world(threads, seed, sampling);
    let mut said = Said::new();
    for k in 0..12 {
        if k == 6 {
            sim.reset(Some(&[EnvId(1)])).unwrap();
        }
        sim.update(5);
        listen(&sim, &ids, &mut said);
    }
    said
}

/// Reads every sensor.
fn listen(sim: &SimulationManager, ids: &Ids, said: &mut Said) {
    let mut add = |kind, words: Vec<u64>| said.entry(kind).or_default().extend(words);
    add("camera", pictures(sim.sensor(ids.camera).unwrap()));
    let rays = sim.sensor(ids.rays).unwrap();
    add("ray_caster", sampled(rays).into_iter().chain(bits(&rays.hits())).collect());
    let eye = sim.sensor(ids.eye).unwrap();
    add("ray_caster_camera", sampled(eye).into_iter().chain(seen(eye)).collect());
    let pair = sim.sensor(ids.pair).unwrap();
    add("stereo_camera", both(pair));
    add("contact_sensor", sampled(sim.sensor(ids.contact).unwrap()));
    add("imu", sampled(sim.sensor(ids.imu).unwrap()));
    add("frame_transformer", sampled(sim.sensor(ids.frames).unwrap()));
    add("joint_state", sampled(sim.sensor(ids.joints).unwrap()));
    add("actuator_state", sampled(sim.sensor(ids.actuators).unwrap()));
    add("joint_wrench", sampled(sim.sensor(ids.wrench).unwrap()));
    add("mujoco_sensor", sampled(sim.sensor(ids.own).unwrap()));
}

#[test]
fn threads_change_no_bit_of_any_kind_of_sensor() {
    let one = said(1, 5);
    for threads in [2, 3] {
        for (kind, words) in said(threads, 5) {
            assert!(words == one[kind], "{kind} with {threads} threads");
        }
    }
    // The control: noise comes from the seed, in all but the camera, which has none.
    for (kind, words) in said(1, 6) {
        assert_eq!(words == one[kind], kind == "camera", "{kind}");
    }
    // A kind that is new is to be here, too.
    let things = ["robot", "articulation", "rigid_object", "rigid_object_group", "terrain", "mjcf", "weld"];
    let types = EntityTypes::default();
    let mut kinds: Vec<&str> = types.names().filter(|name| !things.contains(name)).collect();
    kinds.sort_unstable();
    assert_eq!(one.keys().copied().collect::<Vec<_>>(), kinds);
}

/// Eager and lazy, reading after more than one measurement, with resets and writes in between: one bit of either is one bit
/// of the other, for every kind of sensor. What lazy sensors count is what was due.
#[test]
fn lazy_sensors_say_what_eager_ones_say() {
    let exact: [Sampling; 2] = [
        |_, seconds| SamplingCfg::every(seconds),
        |_, seconds| SamplingCfg { lazy: true, ..SamplingCfg::every(seconds) },
    ];
    let [eager, lazy] = exact.map(|sampling| {
        let (mut sim, ids) = world(2, 5, sampling);
        let mut said = Said::new();
        for k in 0..10_u32 {
            match k {
                3 | 6 => sim.reset(Some(&[EnvId(k as usize / 3)])).unwrap(),
                5 => {
                    let box_ = sim.rigid_object_id("box1").unwrap();
                    let speed = Array2::from_elem((1, 6), 0.5);
                    sim.rigid_object_mut(box_).write_velocity(&speed, Some(&[EnvId(3)])).unwrap();
                }
                _ => {}
            }
            // One step, or seven, or none: nobody reads before that.
            sim.update([7, 1, 7, 0][k as usize % 4]);
            listen(&sim, &ids, &mut said);
        }
        let counts = sim.sensor(ids.rays).unwrap().sample_counts().to_vec();
        assert_eq!(counts, [38, 23, 15, 38, 38], "every step since the last reset");
        said
    });
    assert_eq!(eager.keys().collect::<Vec<_>>(), lazy.keys().collect::<Vec<_>>());
    for (kind, words) in &eager {
        assert!(words == &lazy[kind], "{kind}");
    }
}

/// What is compared is not nothing: boxes touch, the pendulum swings, rays and pictures show things, environments differ.
#[test]
fn there_is_something_to_compare() {
    let (mut sim, ids) = world(2, 5, sampling);
    sim.update(60);
    let contact = sim.sensor(ids.contact).unwrap();
    assert!(contact.contact_counts().unwrap().iter().any(|n| *n > 0.0));
    assert!(contact.friction_matrix_w().unwrap().iter().any(|f| f.abs() > 0.1));
    assert!(sim.sensor(ids.own).unwrap().value("gyro").unwrap().iter().any(|w| w.abs() > 0.1));
    let eye = sim.sensor(ids.eye).unwrap();
    assert!(eye.mask().iter().any(|id| *id != 0) && eye.mask().iter().any(|id| *id == 0));
    let camera = sim.sensor(ids.camera).unwrap();
    let first = |env| camera.depth().unwrap().index_axis(Axis(0), env).to_owned();
    assert_ne!(first(0), first(3));
    assert_eq!(camera.draws(), 5, "drawn when read, once");
    let imu = sim.sensor(ids.imu).unwrap();
    assert!(imu.lin_acc_b().row(0) != imu.lin_acc_b().row(1));
}
