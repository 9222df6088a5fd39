//! Sensors allocate no memory after they were built, with any configuration.

use crate::{AllocationCounter, allocations, assert_settles};
use kinetoscope_render::Intrinsics;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::frame::{Color, Depth};
use kinetoscope_scene::StateFields;
use kinetoscope_scene::shape::{Plane, Sphere};
use kinetoscope_scene::{Contact, Contacts};
use kinetoscope_scene::{Instance, Light, Material, PoseF32, PoseF64, RenderScene, SceneState, VisibleState};
use kinetoscope_sensors::camera::CameraCfg;
use kinetoscope_sensors::camera::{Extrinsics, Imperfections, Placement};
use kinetoscope_sensors::ray::HitTargets;
use kinetoscope_sensors::ray::pattern::Lidar;
use kinetoscope_sensors::ray::{RayCasterCameraCfg, RayCasterCfg};
use kinetoscope_sensors::{
    ContactSensorCfg, EngineSensor, FrameTransformerCfg, ImuCfg, JointWrenchCfg, MujocoSensorCfg, NoiseCfg,
    SamplingCfg, Schedule, Sensor, SensorCfg, SensorContext, SensorError, SensorSlot, TargetFrameCfg,
};
use ndarray::{Array2, Array3};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const NOISE: NoiseCfg = NoiseCfg { std: 0.1, bias_std: 0.1, bias_walk: 0.1, resolution: 0.01 };

/// A state with the given numbers of contacts in two environments.
fn state([a, b]: [usize; 2]) -> SceneState {
    let (normal, force) = ([0.0, 0.0, 1.0], [1.0, 2.0, 3.0]);
    let bodies = [None, Some(1)];
    let contact = Contact { bodies, point: [0.1, 0.2, 0.3], normal, distance: 0.0, force, normal_force: 3.0 };
    let rows = |width| Some(Array3::from_shape_fn((2, 3, width), |(e, b, k)| (1 + e + b + k) as f64));
    SceneState {
        contacts: Some(Contacts { first: vec![0, a, a + b], list: vec![contact; a + b] }),
        body_poses: rows(7),
        force_poses: rows(7),
        force_velocities: rows(6),
        body_accelerations: rows(6),
        joint_wrenches: rows(6),
        sensordata: Some(Array2::from_elem((2, 3), 0.5)),
        ..SceneState::new(2)
    }
}

/// Contact, IMU, frame, MuJoCo and wrench sensors, read at every step, and lazily.
#[test]
fn numeric_sensors() {
    let bodies = ["a", "b", "c"].map(String::from);
    let engine_sensors = [EngineSensor { name: "a/own".into(), width: 3, ..EngineSensor::default() }].into();
    let context =
        SensorContext { num_envs: 2, dt: 0.01, bodies: bodies.into(), engine_sensors, ..SensorContext::default() };
    let sampling = || SamplingCfg { history_length: 3, latency_steps: 4, ..SamplingCfg::every(0.02) };
    let contact = ContactSensorCfg {
        filters: vec!["ground".into(), ".*".into()],
        track_pose: true,
        track_air_time: true,
        track_contact_points: true,
        track_friction_forces: true,
        sampling: sampling(),
        ..ContactSensorCfg::for_bodies(".*")
    };
    let noisy = SamplingCfg { dropout: 0.1, noise: [("lin_acc_b".to_string(), NOISE)].into(), ..sampling() };
    let imu = ImuCfg { sampling: noisy, ..ImuCfg::on("b") };
    let targets = vec![TargetFrameCfg::for_bodies(".*")];
    let frames = FrameTransformerCfg { sampling: sampling(), ..FrameTransformerCfg::new("a", targets) };
    let (links, frame) = (vec!["[ab]".into()], vec!["c".into()]);
    let wrench = JointWrenchCfg { links, frames: frame, sampling: sampling(), debug_vis: true };
    let own = MujocoSensorCfg { sensors: Some(vec!["own".into()]), sampling: sampling() };
    let schedule = Schedule::new(0.02, context.dt, false).unwrap();
    // For the wrench sensor, the third body is fused to the second.
    let fused = SensorContext { moving_bodies: [0, 1, 1].into(), ..context.clone() };
    let sensors: [Box<dyn Sensor>; 5] = [
        Box::new(contact.build(&context).unwrap()),
        Box::new(imu.build(&context).unwrap()),
        Box::new(frames.build(&context).unwrap()),
        Box::new(own.build(&context).unwrap()),
        Box::new(wrench.build(&fused).unwrap()),
    ];
    for mut sensor in sensors {
        let mut state = state([3, 3]);
        let count = allocations(|| {
            sensor.reset(&[0, 1], &state).unwrap();
            for step in 1..=50 {
                state.step.fill(step);
                sensor.due_in(&state.step);
                sensor.update(&state).unwrap();
                sensor.refresh(&[1], &state).unwrap();
            }
        });
        assert_eq!(count, 0, "{sensor:?}");
        lazy(sensor, schedule);
    }
}

/// Lazy sensor that is read every 7 steps and refreshed every 11, with changing numbers of contacts.
fn lazy(sensor: Box<dyn Sensor>, schedule: Schedule) {
    let mut states = [[3, 3], [0, 5], [6, 1]].map(state);
    let measured = Arc::new(AtomicUsize::new(0));
    let sensor = Box::new(CountedSensor { sensor, measured: Arc::clone(&measured) });
    let mut slot = SensorSlot::new(sensor, StateFields::present_in(&states[0]), Some(schedule), 2);
    slot.reset(&[0, 1], &states[0]);
    let mut steps = |slot: &mut SensorSlot| {
        let (before, mut asked) = (measured.load(Ordering::Relaxed), 0);
        for step in 1..=50 {
            let state = &mut states[step % 3];
            state.step.fill(step as u64);
            slot.update(state);
            if step % 11 == 0 {
                slot.refresh(&[1], state);
                asked += 1;
            }
            if step % 7 == 0 {
                assert!(slot.sensor().is_ok());
                asked += 1;
            }
        }
        // Every second step is due, and between any two of these accesses at least one due step lies.
        assert_eq!((asked, measured.load(Ordering::Relaxed) - before), (11, 11), "{slot:?}");
        states[0].step.fill(0);
        slot.reset(&[0, 1], &states[0]);
    };
    // The contact list grows in the first round.
    steps(&mut slot);
    assert_eq!(allocations(|| steps(&mut slot)), 0, "{slot:?}");
}

/// Wrapper that counts the measurements of a sensor.
#[derive(Debug)]
struct CountedSensor {
    sensor: Box<dyn Sensor>,
    measured: Arc<AtomicUsize>,
}

impl Sensor for CountedSensor {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.measured.fetch_add(1, Ordering::Relaxed);
        self.sensor.update(state)
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sensor.reset(env_ids, state)
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sensor.refresh(env_ids, state)
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sensor.due_in(step)
    }
}

/// Scene of a plane and moving balls.
fn balls(num_envs: usize, count: usize) -> (SensorContext, Vec<SceneState>) {
    let mut instances = vec![Instance::new(Plane::INFINITE, Material::default(), 1).into_fixed()];
    let ball = |k: usize| Instance::new(Sphere { radius: 0.3 }, Material::default(), 2 + k as i32).with_body(k as u32);
    instances.extend((0..count).map(ball));
    let scene = Some(Arc::new(RenderScene::new(instances).unwrap()));
    let bodies: Vec<String> = (0..count).map(|k| format!("ball{k}")).collect();
    let at = |step: u64, k: usize| match k {
        0 => [0.0; 3],
        _ => [0.01 * step as f64 + 0.4 * (k - 1) as f64, (k - 1) as f64 / 20.0, 0.5],
    };
    let state = |step: u64| {
        let pose = |(_, k)| PoseF32::from_translation(at(step, k).map(|x| x as f32));
        let instance_poses = Array2::from_shape_fn((num_envs, 1 + count), pose);
        let lights = Array2::from_elem((num_envs, 1), Light::default());
        let body = |(_, k, axis): (usize, usize, usize)| {
            let [x, y, z] = at(step, k + 1);
            [x, y, z, 1.0, 0.0, 0.0, 0.0][axis]
        };
        SceneState {
            step: vec![step; num_envs],
            time: vec![0.01 * step as f64; num_envs],
            visible: Some(VisibleState { instance_poses, lights, scenes: Vec::new() }),
            body_poses: Some(Array3::from_shape_fn((num_envs, count, 7), body)),
            instance_poses: Some(Array2::from_shape_fn((num_envs, 1 + count), |(_, k)| {
                PoseF64::from_translation(at(step, k))
            })),
            ..SceneState::new(num_envs)
        }
    };
    let context = SensorContext { num_envs, dt: 0.01, scene, bodies: bodies.into(), ..SensorContext::default() };
    (SensorContext { threads: 1, ..context }, (0..=60).map(state).collect())
}

/// An ideal camera, and a delayed camera with noise and every imperfection.
#[test]
fn cameras() {
    let (context, states) = balls(2, 1);
    let placement = Placement::LookAt { eye: [-1.6, 0.0, 0.9], target: [0.0, 0.0, 0.5], up: [0.0, 0.0, 1.0] };
    let perfect = CameraCfg {
        width: 64,
        height: 48,
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        channels: Channels { flow: false, ..Channels::ALL },
        ..CameraCfg::default()
    };
    let degraded = CameraCfg {
        update_period: 0.02,
        history_length: 3,
        latency_steps: 5,
        dropout: 0.2,
        noise: ["color", "depth", "distance"].map(|name| (name.to_string(), NOISE)).into(),
        imperfections: Imperfections {
            vignetting: Some(Default::default()),
            exposure: Some(Default::default()),
            shot_noise: Some(Default::default()),
            read_noise: Some(Default::default()),
            holes: Some(Default::default()),
            depth_noise: Some(Default::default()),
        },
        ..perfect.clone()
    };
    for (cfg, images, lazy) in
        [(&perfect, 60, true), (&perfect, 60, false), (&degraded, 15, true), (&degraded, 15, false)]
    {
        let mut camera = CameraCfg { lazy, ..cfg.clone() }.build(&context).unwrap();
        camera.reset(&[0, 1], &states[0]).unwrap();
        let mut steps = |range: std::ops::RangeInclusive<usize>| {
            for step in range {
                camera.update(&states[step]).unwrap();
                camera.due_in(&states[step].step);
                if step % 3 == 0 {
                    camera.channel::<Color>().unwrap();
                    camera.history::<Depth>().unwrap();
                }
            }
        };
        steps(1..=20);
        assert_eq!(allocations(|| steps(21..=60)), 0, "{camera:?}, lazy {lazy}");
        assert!(camera.frame_counts()[0] >= images, "the control: {}", camera.frame_counts());
    }
}

/// Rays of 6 environments, enough work for four threads: no worker allocates memory.
#[test]
fn rays() {
    let (context, states) = balls(6, 20);
    let lidar = Lidar { channels: 16, ..Lidar::default() };
    let everything = HitTargets::Everything { exclude_parent: false };
    let offset = kinetoscope_scene::Pose::translation(0.0, 0.0, 1.0);
    let caster =
        RayCasterCfg { pattern: lidar.into(), targets: everything, offset, max_distance: 50.0, ..Default::default() };
    let intrinsics = Intrinsics::Pixels { fx: 50.0, fy: 60.0, cx: 60.0, cy: 40.0 };
    let placement = Placement::LookAt { eye: [-2.0, 1.0, 2.5], target: [0.5, 0.0, 0.3], up: [0.0, 0.0, 1.0] };
    let extrinsics = Extrinsics { placement, ..Extrinsics::default() };
    let camera = RayCasterCameraCfg { width: 120, height: 80, intrinsics, extrinsics, ..Default::default() };
    for threads in [1, 4] {
        let counting = Arc::new(AllocationCounter::default());
        let context = SensorContext { threads, pool: counting.pool(threads), ..context.clone() };
        let sensors: [(&str, Box<dyn Sensor>); 2] = [
            ("caster", Box::new(caster.build(&context).unwrap())),
            ("camera", Box::new(camera.build(&context).unwrap())),
        ];
        for (what, mut sensor) in sensors {
            sensor.reset(&[0, 1, 2, 3, 4, 5], &states[0]).unwrap();
            sensor.update(&states[1]).unwrap();
            if threads == 1 {
                assert_eq!(allocations(|| states[2..].iter().for_each(|s| sensor.update(s).unwrap())), 0, "{what}");
                continue;
            }
            let mut step = 1;
            assert_settles(what, || {
                step += 1;
                let mut state = states[step % states.len()].clone();
                state.step.fill(step as u64);
                counting.allocations.store(0, Ordering::Relaxed);
                let before = counting.visits.load(Ordering::Relaxed);
                sensor.update(&state).unwrap();
                assert_eq!(counting.visits.load(Ordering::Relaxed) - before, 4, "{what}: all threads work");
                counting.allocations.load(Ordering::Relaxed)
            });
        }
    }
}
