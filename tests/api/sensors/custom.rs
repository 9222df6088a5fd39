//! Sensors that another crate defines.

use super::worlds::{ball, sim, sr5};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::record::{RecorderCfg, Topic};
use kinetoscope::scene::SceneState;
use kinetoscope::scene::StateFields;
use kinetoscope::sensors::{SampleChannel, Sampler, Schedule, Sensor, SensorCfg, SensorContext, SensorError};
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::tolerance::{Tolerance, assert_close};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Height of the last body, eager at every step or lazy every 0.03 s; counts its measurements.
#[derive(Clone, Default)]
struct HeightCfg {
    lazy: bool,
    measured: Arc<AtomicUsize>,
}

#[derive(Debug)]
struct Height(Vec<f64>, Arc<AtomicUsize>);

impl SensorCfg for HeightCfg {
    type Sensor = Height;

    fn requires(&self) -> StateFields {
        StateFields::POSES
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.lazy.then(|| Schedule::new(0.03, dt, false).unwrap())
    }

    fn build(&self, context: &SensorContext) -> Result<Height, SensorError> {
        Ok(Height(vec![f64::NAN; context.num_envs], Arc::clone(&self.measured)))
    }
}

impl Sensor for Height {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.refresh(&[], state)
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.refresh(env_ids, state)
    }

    fn refresh(&mut self, _env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        let missing = SensorError::MissingFields { sensor: "height", missing: StateFields::POSES };
        let poses = state.body_poses.as_ref().ok_or(missing)?;
        self.0.iter_mut().enumerate().for_each(|(env, height)| *height = poses[(env, poses.dim().1 - 1, 2)]);
        Ok(())
    }
}

/// A lazy sensor holds the measurement of its due time, and measures once for all readers.
#[test]
fn eager_and_lazy() {
    let mut sim = kinetoscope_testkit::worlds::sim(kinetoscope_testkit::worlds::cfg(3, 2));
    let robot = sim.add_robot(sr5("robot")).unwrap();
    sim.robot_mut(robot).set_qpos_target(&array![[0.1, 0.2, -0.3, 0.4, -0.5, 0.6]], None, None).unwrap();
    let cfg = HeightCfg { lazy: true, ..Default::default() };
    let eager = sim.add_sensor("eager", HeightCfg::default()).unwrap();
    let lazy = sim.add_sensor("lazy", cfg.clone()).unwrap();
    let height = |sim: &SimulationManager| sim.robot(robot).link_pose("ee_link").unwrap().column(2).to_vec();
    let start = height(&sim);
    assert_eq!(sim.sensor(lazy).unwrap().0, start);
    // The time of the last measurement, not that of the reading: periods are three steps.
    for (steps, moves) in [(2, false), (10, true), (2, false)] {
        let before = sim.sensor(lazy).unwrap().0.clone();
        sim.update(steps);
        assert_eq!(sim.sensor(eager).unwrap().0, height(&sim));
        let expected = if moves { height(&sim) } else { before };
        for _ in 0..3 {
            assert_eq!(sim.sensor(lazy).unwrap().0, expected, "{steps} steps");
        }
    }
    assert_ne!(height(&sim), start);
    assert_eq!(cfg.measured.load(Ordering::Relaxed), 1, "four measurements were due, one was made");
}

/// Speed of a body above a height, with everything that a sampler provides: rate, latency, noise.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SpeedCfg {
    body: String,
    #[serde(default)]
    level: f64,
    #[serde(default)]
    sampling: SamplingCfg,
}

#[derive(Debug)]
pub(crate) struct Speed {
    body: usize,
    level: f64,
    pub(crate) sampler: Sampler,
}

impl SensorCfg for SpeedCfg {
    type Sensor = Speed;

    fn requires(&self) -> StateFields {
        StateFields::VELOCITIES
    }

    fn build(&self, context: &SensorContext) -> Result<Speed, SensorError> {
        let channels = [SampleChannel::new("speed", 1)];
        let sampler = Sampler::new("speed", self.requires(), context, &self.sampling, &channels)?;
        Ok(Speed { body: context.body(&self.body)?, level: self.level, sampler })
    }
}

fn read(body: usize, level: f64) -> impl Fn(&SceneState, usize, &mut [f64]) {
    move |state, env, row| {
        let velocity = |k| state.body_velocities.as_ref().map_or(0.0, |v| v[(env, body, k)]);
        row[0] = (0..3).map(|k| velocity(k).powi(2)).sum::<f64>().sqrt() - level;
    }
}

impl Sensor for Speed {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        let read = read(self.body, self.level);
        self.sampler.update(state, |env, row| read(state, env, row))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        let read = read(self.body, self.level);
        self.sampler.reset(env_ids, state, |env, row| read(state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        let read = read(self.body, self.level);
        self.sampler.refresh(env_ids, state, |env, row| read(state, env, row))
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }
}

/// The speed of a free fall is `g t`, and the reading is 4 steps old.
#[test]
fn sampler() {
    let mut sim = sim(2);
    sim.add_rigid_object(ball("ball", 0.05, 1.0, [0.0, 0.0, 90.0])).unwrap();
    let sampling = SamplingCfg { latency_steps: 4, ..SamplingCfg::every(0.01) };
    let id = sim.add_sensor("speed", SpeedCfg { body: "ball".into(), level: 0.0, sampling }).unwrap();
    sim.update(101);
    // The newest sample of at least 4 steps of age is that of step 96.
    let limit = Tolerance::absolute(1e-12, "rounding of 96 sums of numbers up to 5");
    assert_close("speed", sim.sensor(id).unwrap().sampler.values("speed"), [9.81 * 96.0 * 0.005; 2], limit);
}

/// A sensor whose measurement panics at the third step.
#[derive(Clone, Copy)]
struct FragileCfg {
    lazy: bool,
}

#[derive(Debug)]
struct Fragile;

impl SensorCfg for FragileCfg {
    type Sensor = Fragile;

    fn requires(&self) -> StateFields {
        StateFields::POSES
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.lazy.then(|| Schedule::new(0.0, dt, false).unwrap())
    }

    fn build(&self, _: &SensorContext) -> Result<Fragile, SensorError> {
        Ok(Fragile)
    }
}

impl Sensor for Fragile {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        assert!(state.step[0] < 3, "a mistake in the sensor at step {}", state.step[0]);
        Ok(())
    }

    fn reset(&mut self, _: &[usize], _: &SceneState) -> Result<(), SensorError> {
        Ok(())
    }

    fn refresh(&mut self, _: &[usize], _: &SceneState) -> Result<(), SensorError> {
        Ok(())
    }
}

/// Root cause: a panic of an eager sensor ended the step, so that later sensors and all observers missed it. A sensor that
/// panics has an error, which names it. The others have the values that they have without it, until it is rebuilt.
#[test]
fn panics() {
    let readings = |fragile: Option<FragileCfg>| {
        let mut sim = sim(2);
        sim.add_rigid_object(ball("ball", 0.05, 1.0, [0.0, 0.0, 90.0])).unwrap();
        let fragile = fragile.map(|cfg| sim.add_sensor("fragile", cfg).unwrap());
        let imu = sim.add_sensor("imu", ImuCfg::on("ball")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.npz");
        let topics = [Topic::ObjectPose("ball".into())];
        let recorder = sim.record(RecorderCfg::new(&path).with_topics(topics)).unwrap();
        for step in 1..=6 {
            sim.update(1);
            if let Some(id) = fragile {
                let read = sim.sensor(id);
                assert_eq!(read.is_ok(), step < 3, "step {step}");
                if step >= 3 {
                    assert_error(
                        read,
                        "SensorFault",
                        &["\"fragile\"", "panicked", "a mistake in the sensor at step 3"],
                    );
                }
            }
        }
        let summary = sim.finish_recording(recorder).unwrap();
        let imu = sim.sensor(imu).unwrap();
        let values =
            (imu.pos_w().to_owned(), imu.lin_vel_b().to_owned(), imu.sample_counts().to_vec(), summary.packets);
        if let Some(id) = fragile {
            // A new entity rebuilds all sensors; a reset restarts them.
            sim.add_rigid_object(ball("other", 0.05, 1.0, [5.0, 0.0, 90.0])).unwrap();
            sim.reset(None).unwrap();
            assert!(sim.sensor(id).is_ok());
        }
        values
    };
    let expected = readings(None);
    for lazy in [false, true] {
        assert_eq!(readings(Some(FragileCfg { lazy })), expected, "lazy: {lazy}");
    }
}
