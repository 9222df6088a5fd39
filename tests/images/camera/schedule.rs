//! Capture times of cameras, and the images captured at them.

use kinetoscope::prelude::*;
use kinetoscope::render::frame::Depth;
use kinetoscope::sensors::camera::imperfection::DepthNoise;
use kinetoscope::sensors::camera::{Camera, Imperfections};
use kinetoscope::sensors::{JointStateCfg, NoiseCfg};
use kinetoscope_testkit::worlds::{cfg, look_at, object};

/// A camera on the ground, below a falling ball.
fn world(num_envs: usize, camera: CameraCfg) -> (SimulationManager, SensorId<Camera>) {
    let mut sim = kinetoscope_testkit::worlds::sim(cfg(num_envs, 2));
    sim.add_rigid_object(object("ball", ObjectShape::Sphere { radius: 0.1 }, [0.0, 0.0, 3.0])).unwrap();
    let id = sim.add_sensor("camera", camera).unwrap();
    (sim, id)
}

fn below(update_period: f64) -> CameraCfg {
    CameraCfg {
        width: 32,
        height: 32,
        intrinsics: Intrinsics::Fovy { radians: 0.6 },
        extrinsics: look_at([0.0, 0.0, 0.1], [0.0, 0.0, 1.0]),
        channels: Channels { depth: true, ..Default::default() },
        update_period,
        ..Default::default()
    }
}

/// Expected depth of the falling ball at pixel (15, 15) \[m\], half a pixel off the optical axis in both directions.
///
/// The ball's center is c above the camera: after n steps of MuJoCo's semi-implicit Euler c = 2.9 - g h² n (n + 1) / 2.
/// The ray t (a, a, 1) with a = 0.5 / f meets the sphere of radius r where |t (a, a, 1) - (0, 0, c)| = r.
fn expected_depth(step: u64) -> f64 {
    let (h, n, r) = (0.01, step as f64, 0.1);
    let c = 2.9 - 9.81 * h * h * n * (n + 1.0) / 2.0;
    let a = 0.5 / (16.0 / 0.3f64.tan());
    let square = 1.0 + 2.0 * a * a;
    (c - (c * c - square * (c * c - r * r)).sqrt()) / square
}

/// True if `found` is the depth at a step, to the renderer's single precision.
fn is_depth_at(found: f64, step: u64) -> bool {
    (found / expected_depth(step) - 1.0).abs() < 1e-5
}

fn middle(sim: &SimulationManager, id: SensorId<Camera>) -> [f64; 2] {
    let depth = sim.sensor(id).unwrap().depth().unwrap();
    [0, 1].map(|env| f64::from(depth[(env, 15, 15)]))
}

/// An image shows its scheduled instant even if it is read later, and is rendered once. A reset of one environment
/// refreshes its image and restarts its schedule; the other environment is unaffected.
#[test]
fn due_instant_and_reset() {
    let (mut sim, id) = world(2, below(0.05));
    assert!(is_depth_at(middle(&sim, id)[1], 0));
    sim.update(7);
    assert!(is_depth_at(middle(&sim, id)[1], 5), "{:?} {}", middle(&sim, id), expected_depth(5));
    assert!(!is_depth_at(expected_depth(7), 5), "the control: seven steps differ from five");
    let camera = sim.sensor(id).unwrap();
    assert!((camera.stamps()[0] - 0.05).abs() < 1e-12 && camera.frame_counts()[0] == 1);
    let draws = camera.render_count();
    sim.update(2);
    middle(&sim, id);
    assert_eq!(sim.sensor(id).unwrap().render_count(), draws, "nothing new to draw");
    sim.update(40);
    assert_eq!(sim.sensor(id).unwrap().render_count(), draws, "no read");
    assert!(is_depth_at(middle(&sim, id)[1], 45));
    assert_eq!(sim.sensor(id).unwrap().render_count(), draws + 2);
    assert_eq!(sim.sensor(id).unwrap().frame_counts()[0], 9);
    sim.update(4);
    sim.reset(Some(&[EnvId(0)])).unwrap();
    let [of_reset, other] = middle(&sim, id);
    assert!(is_depth_at(of_reset, 0) && is_depth_at(other, 50));
    assert_eq!(sim.sensor(id).unwrap().frame_counts().to_vec(), [0, 10]);
    sim.update(5);
    assert_eq!(sim.sensor(id).unwrap().frame_counts().to_vec(), [1, 11]);
}

/// `update(n)` equals n calls of `update(1)`, including images.
#[test]
fn strides() {
    let noise = [("depth".to_string(), NoiseCfg { std: 0.01, bias_walk: 0.1, ..Default::default() })].into();
    let imperfections = Imperfections { depth_noise: Some(DepthNoise::default()), ..Default::default() };
    let exact = CameraCfg { history_length: 2, ..below(0.03) };
    let noisy = CameraCfg { latency_steps: 4, dropout: 0.2, noise, imperfections, ..exact.clone() };
    for cfg in [exact, noisy] {
        let images = |stride: u32| {
            let (mut sim, id) = world(1, cfg.clone());
            let joints = sim.add_sensor("every step", JointStateCfg::default()).unwrap();
            (0..36 / stride).for_each(|_| sim.update(stride));
            assert_eq!(sim.sensor(joints).unwrap().sample_counts()[0], 36);
            let camera = sim.sensor(id).unwrap();
            let (depth, history) = (camera.depth().unwrap().to_owned(), camera.history::<Depth>().unwrap().to_owned());
            (depth, history, camera.frame_counts()[0], camera.stamps()[0].to_bits())
        };
        let one = images(1);
        assert_eq!(images(36), one);
        assert_eq!(images(12), one);
        assert!(one.2 == 12 || cfg.latency_steps > 0, "{} images", one.2);
    }
}

/// Steps of 10 ms, images every two steps with a latency of three steps: after 20 steps, the newest visible image is
/// that of step 16. A write to the state refreshes the image at once.
#[test]
fn latency() {
    let (mut sim, id) = world(2, CameraCfg { latency_steps: 3, history_length: 4, ..below(0.02) });
    sim.update(20);
    assert!(is_depth_at(middle(&sim, id)[1], 16), "{:?}", middle(&sim, id));
    assert!(!is_depth_at(expected_depth(20), 16), "the control: a ball without delay is elsewhere");
    let camera = sim.sensor(id).unwrap();
    assert!((camera.stamps()[1] - 0.16).abs() < 1e-12);
    let history = camera.history::<Depth>().unwrap();
    assert_eq!(history.dim(), (2, 4, 32, 32));
    for (age, step) in [16, 14, 12, 10].into_iter().enumerate() {
        assert!(is_depth_at(f64::from(history[(1, age, 15, 15)]), step), "{age}");
    }
    assert_eq!(camera.frame_counts().to_vec(), [8, 8]);
    sim.reset(Some(&[EnvId(0)])).unwrap();
    let [of_reset, other] = middle(&sim, id);
    assert!(is_depth_at(of_reset, 0) && is_depth_at(other, 16));
    assert_eq!([0, 1].map(|env| sim.sensor(id).unwrap().history_filled(env).unwrap()), [0, 4]);
}
