//! When cameras capture, and when they draw.

use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::channel::Depth;
use kinetoscope::sensors::camera::imperfection::DepthNoise;

fn sim(num_envs: usize) -> (SimulationManager, ObjectId) {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs, ..Default::default() }).unwrap();
    let ball = RigidObjectCfg {
        uid: "ball".into(),
        shape: ObjectShape::Sphere { radius: 0.1 },
        init_pose: Pose::translation(0.0, 0.0, 3.0),
        ..Default::default()
    };
    let ball = sim.add_rigid_object(ball).unwrap();
    (sim, ball)
}

fn below(update_period: f64) -> CameraCfg {
    CameraCfg {
        width: 32,
        height: 32,
        intrinsics: Intrinsics::Fovy { radians: 0.6 },
        extrinsics: Extrinsics {
            placement: Placement::LookAt { eye: [0.0, 0.0, 0.1], target: [0.0, 0.0, 1.0], up: [0.0, 0.0, 1.0] },
            ..Default::default()
        },
        channels: Channels { depth: true, ..Default::default() },
        update_period,
        ..Default::default()
    }
}

/// The depth of the falling ball at pixel (15, 15), half a pixel off the optical axis along both directions.
///
/// The ball's centre is c above the camera: after n steps of MuJoCo's semi-implicit Euler c = 2.9 - g h² n (n + 1) / 2. The
/// ray t (a, a, 1) with a = 0.5 / f meets the sphere of radius r where |t (a, a, 1) - (0, 0, c)| = r.
fn gap(step: u64) -> f64 {
    let (h, n, r) = (0.01, step as f64, 0.1);
    let c = 2.9 - 9.81 * h * h * n * (n + 1.0) / 2.0;
    let a = 0.5 / (16.0 / 0.3f64.tan());
    let square = 1.0 + 2.0 * a * a;
    (c - (c * c - square * (c * c - r * r)).sqrt()) / square
}

/// Single precision of the renderer.
fn near(found: f32, expected: f64) -> bool {
    (f64::from(found) / expected - 1.0).abs() < 1e-5
}

/// Pictures show the instant that was due, however late they are read, and are drawn once.
#[test]
fn a_picture_shows_the_instant_it_was_due_at() {
    let (mut sim, _) = sim(2);
    let id = sim.add_sensor("camera", below(0.05)).unwrap();
    let middle = |sim: &SimulationManager| {
        let camera = sim.sensor(id).unwrap();
        camera.depth().unwrap()[(1, 15, 15)]
    };
    assert!(near(middle(&sim), gap(0)));
    sim.update(7);
    assert!(near(middle(&sim), gap(5)), "{} {}", middle(&sim), gap(5));
    assert!(!near(gap(7) as f32, gap(5)), "the control: seven steps are told from five");
    let camera = sim.sensor(id).unwrap();
    assert!((camera.stamps()[0] - 0.05).abs() < 1e-12 && camera.frame_counts()[0] == 1);
    let draws = camera.draws();
    middle(&sim);
    sim.update(2);
    middle(&sim);
    assert_eq!(sim.sensor(id).unwrap().draws(), draws, "nothing new to draw");
    sim.update(40);
    assert_eq!(sim.sensor(id).unwrap().draws(), draws, "nobody looked");
    assert!(near(middle(&sim), gap(45)));
    assert_eq!(sim.sensor(id).unwrap().draws(), draws + 2);
    assert_eq!(sim.sensor(id).unwrap().frame_counts()[0], 9);
}

/// `update(n)` is n times `update(1)`, pictures included.
#[test]
fn many_steps_at_once_give_the_same_pictures() {
    let noise = [("depth".to_string(), NoiseCfg { std: 0.01, bias_walk: 0.1, ..Default::default() })];
    let imperfections = Imperfections { depth_noise: Some(DepthNoise::default()), ..Default::default() };
    let troubled = CameraCfg {
        latency_steps: 4,
        history_length: 2,
        dropout: 0.2,
        noise: noise.into(),
        imperfections,
        ..below(0.03)
    };
    let late = |stride: u32| {
        let (mut sim, _) = sim(1);
        let id = sim.add_sensor("camera", troubled.clone()).unwrap();
        (0..36 / stride).for_each(|_| sim.update(stride));
        let camera = sim.sensor(id).unwrap();
        (camera.depth().unwrap().to_owned(), camera.history::<Depth>().unwrap().to_owned(), camera.stamps()[0])
    };
    assert_eq!(late(36), late(1));
    assert_eq!(late(12), late(1));
    let pictures = |stride: u32| {
        let (mut sim, _) = sim(1);
        let id = sim.add_sensor("camera", below(0.03)).unwrap();
        let joints = sim.add_sensor("every step", JointStateCfg::default()).unwrap();
        for _ in 0..36 / stride {
            sim.update(stride);
        }
        assert_eq!(sim.sensor(joints).unwrap().sample_counts()[0], 36);
        let camera = sim.sensor(id).unwrap();
        (camera.depth().unwrap().to_owned(), camera.frame_counts()[0], camera.stamps()[0].to_bits())
    };
    assert_eq!(pictures(36), pictures(1));
    assert_eq!(pictures(12), pictures(1));
    assert_eq!(pictures(1).1, 12);
}

/// A reset of one environment refreshes its picture and restarts its clock, and leaves the other's alone.
#[test]
fn a_reset_is_seen_at_once_and_alone() {
    let (mut sim, _) = sim(2);
    let id = sim.add_sensor("camera", below(0.05)).unwrap();
    sim.update(13);
    sim.reset(Some(&[EnvId(0)])).unwrap();
    let camera = sim.sensor(id).unwrap();
    let depth = camera.depth().unwrap();
    assert!(near(depth[(0, 15, 15)], gap(0)));
    assert!(near(depth[(1, 15, 15)], gap(10)));
    assert_eq!(camera.frame_counts().to_vec(), [0, 2]);
    sim.update(5);
    assert_eq!(sim.sensor(id).unwrap().frame_counts().to_vec(), [1, 3]);
}

/// Steps are 10 ms, pictures two steps apart and three steps late: after 20 steps, the newest to be seen is that of step 16.
/// What somebody writes is seen at once.
#[test]
fn a_late_camera_sees_the_ball_where_it_was() {
    let (mut sim, _) = sim(2);
    let id = sim.add_sensor("camera", CameraCfg { latency_steps: 3, history_length: 4, ..below(0.02) }).unwrap();
    sim.update(20);
    let camera = sim.sensor(id).unwrap();
    let depth = camera.depth().unwrap();
    assert!(near(depth[(1, 15, 15)], gap(16)), "{}", depth[(1, 15, 15)]);
    assert!(!near(gap(20) as f32, gap(16)), "the control: a ball without delay is elsewhere");
    assert!((camera.stamps()[1] - 0.16).abs() < 1e-12);
    let history = camera.history::<Depth>().unwrap();
    assert_eq!(history.dim(), (2, 4, 32, 32));
    for (age, step) in [16, 14, 12, 10].into_iter().enumerate() {
        assert!(near(history[(1, age, 15, 15)], gap(step)), "{age}");
    }
    assert_eq!(camera.frame_counts().to_vec(), [8, 8]);
    sim.reset(Some(&[EnvId(0)])).unwrap();
    let camera = sim.sensor(id).unwrap();
    assert!(near(camera.depth().unwrap()[(0, 15, 15)], gap(0)));
    assert!(near(camera.depth().unwrap()[(1, 15, 15)], gap(16)));
    assert_eq!((camera.history_filled(0).unwrap(), camera.history_filled(1).unwrap()), (0, 4));
}
