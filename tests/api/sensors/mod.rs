//! Sensors in a running simulation: schedule, values, resets, and sensors of a user's own.

mod contact;
mod contact_pairs;
mod debug_vis;
mod every_kind;
mod frames;
mod history;
mod imu;
mod past_values;
mod refused;
mod same_bits;
mod ticks;
mod worlds;
mod wrench;

use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::scene::SceneState;
use kinetoscope::sensors::{Channel, Requires, Sampler, Schedule, Sensor, SensorCfg, SensorContext, SensorError};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

fn arm(num_envs: usize) -> (SimulationManager, RobotId) {
    let cfg = SimulationManagerCfg { num_envs, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    let robot = sim.add_robot(RobotCfg { urdf, ..Default::default() }).unwrap();
    sim.robot_mut(robot).set_qpos(&array![[0.1, 0.2, -0.3, 0.4, -0.5, 0.6]], None, None).unwrap();
    (sim, robot)
}

/// A sensor with a period of 5 steps holds what the robot had at the last multiple of 5, newest first.
#[test]
fn a_joint_sensor_samples_on_its_ticks() {
    let (mut sim, robot) = arm(2);
    let cfg =
        JointStateCfg { sampling: SamplingCfg { history_length: 3, ..SamplingCfg::every(0.05) }, ..Default::default() };
    let id = sim.add_sensor("joints", cfg).unwrap();
    let mut sampled = Vec::new();
    for step in 1..=17_u32 {
        sim.update(1);
        if step % 5 == 0 {
            sampled.push(sim.robot(robot).get_qpos());
        }
        let sensor = sim.sensor(id).unwrap();
        assert_eq!(sensor.sample_counts().to_vec(), vec![u64::from(step / 5); 2], "step {step}");
        if let Some(last) = sampled.last() {
            assert_eq!(sensor.positions(), last.view(), "step {step}");
        }
    }
    let history = sim.sensor(id).unwrap().position_history();
    for (age, expected) in sampled.iter().rev().enumerate() {
        for env in 0..2 {
            for joint in 0..6 {
                assert_eq!(history[(env, age, joint)], expected[(env, joint)], "age {age}");
            }
        }
    }
    assert!((sim.sensor(id).unwrap().stamps()[0] - 0.15).abs() < 1e-12);
}

/// A reset starts one environment's clock again and leaves the other's alone.
#[test]
fn a_reset_restarts_the_clock_of_its_environment_only() {
    let (mut sim, robot) = arm(2);
    let cfg = JointStateCfg { sampling: SamplingCfg::every(0.05), ..Default::default() };
    let id = sim.add_sensor("joints", cfg).unwrap();
    sim.update(7);
    sim.reset(Some(&[EnvId(1)])).unwrap();
    assert_eq!(sim.sensor(id).unwrap().positions().row(1), sim.robot(robot).get_qpos().row(1), "nothing stale");
    sim.update(3);
    assert_eq!(sim.sensor(id).unwrap().sample_counts().to_vec(), [2, 0]);
    sim.update(2);
    assert_eq!(sim.sensor(id).unwrap().sample_counts().to_vec(), [2, 1]);
}

/// Sensors see the drives' efforts: at rest, that of the vertical JOINT1 is zero and that of JOINT2 is gravity's.
#[test]
fn efforts_are_those_of_the_drives() {
    let (mut sim, robot) = arm(1);
    let id = sim.add_sensor("joints", JointStateCfg::default()).unwrap();
    sim.update(400);
    assert_eq!(sim.sensor(id).unwrap().efforts(), sim.robot(robot).get_qf().view());
    assert!(sim.robot(robot).get_qf()[(0, 1)].abs() > 5.0);
}

/// Height of the last link: what a user's crate would bring.
#[derive(Debug)]
struct Height(Vec<f64>);

struct HeightCfg;

impl SensorCfg for HeightCfg {
    type Sensor = Height;

    fn requires(&self) -> Requires {
        Requires::POSES
    }

    fn build(&self, context: &SensorContext) -> Result<Height, SensorError> {
        Ok(Height(vec![f64::NAN; context.num_envs]))
    }
}

impl Sensor for Height {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        let poses = state
            .body_poses
            .as_ref()
            .ok_or(SensorError::MissingFields { sensor: "height", missing: Requires::POSES })?;
        for (env, height) in self.0.iter_mut().enumerate() {
            *height = poses[(env, poses.dim().1 - 1, 2)];
        }
        Ok(())
    }

    fn reset(&mut self, _env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.update(state)
    }

    fn refresh(&mut self, _env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.update(state)
    }
}

#[test]
fn a_sensor_of_another_crate_is_added_like_any_other() {
    let (mut sim, robot) = arm(3);
    let id = sim.add_sensor("height", HeightCfg).unwrap();
    for _ in 0..2 {
        sim.update(10);
        let expected = sim.robot(robot).link_pose("ee_link").unwrap();
        assert_eq!(sim.sensor(id).unwrap().0, expected.column(2).to_vec());
    }
}

/// Height of the last link too, but only when it is asked for: counts how often it measures.
#[derive(Clone, Default)]
struct SeldomCfg(Arc<AtomicUsize>);

#[derive(Debug)]
struct Seldom(Height, Arc<AtomicUsize>);

impl SensorCfg for SeldomCfg {
    type Sensor = Seldom;

    fn requires(&self) -> Requires {
        HeightCfg.requires()
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        Schedule::new(0.03, dt, false).ok()
    }

    fn build(&self, context: &SensorContext) -> Result<Seldom, SensorError> {
        HeightCfg.build(context).map(|height| Seldom(height, Arc::clone(&self.0)))
    }
}

impl Sensor for Seldom {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.update(state)
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.0.reset(env_ids, state)
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.0.refresh(env_ids, state)
    }
}

/// A sensor of a user's crate is lazy by one method: it then holds what it would have measured when it was due, and measures
/// once for all readers.
#[test]
fn a_sensor_of_another_crate_can_be_lazy() {
    let (mut sim, robot) = arm(2);
    let cfg = SeldomCfg::default();
    let id = sim.add_sensor("height", cfg.clone()).unwrap();
    let height = |sim: &SimulationManager| sim.robot(robot).link_pose("ee_link").unwrap().column(2).to_vec();
    let start = height(&sim);
    sim.update(2);
    assert_eq!(sim.sensor(id).unwrap().0.0, start, "nothing was due");
    sim.update(10);
    let due = height(&sim);
    assert_ne!(due, start);
    // The instant of the last measurement, not that of the reading: 12 steps are 4 periods of 3.
    sim.update(2);
    for _ in 0..3 {
        assert_eq!(sim.sensor(id).unwrap().0.0, due);
    }
    assert_eq!(cfg.0.load(Ordering::Relaxed), 1, "four measurements were due, one was made");
}

/// Speed of a body, with all that a sampler gives: rate, latency, noise.
#[derive(Debug)]
struct Speed {
    body: usize,
    sampler: Sampler,
}

struct SpeedCfg(&'static str, SamplingCfg);

impl SensorCfg for SpeedCfg {
    type Sensor = Speed;

    fn requires(&self) -> Requires {
        Requires::VELOCITIES
    }

    fn build(&self, context: &SensorContext) -> Result<Speed, SensorError> {
        let channels = [Channel::new("speed", 1)];
        let sampler = Sampler::new("speed", self.requires(), context, &self.1, &channels)?;
        Ok(Speed { body: context.body(self.0)?, sampler })
    }
}

fn speed(body: usize, state: &SceneState, env: usize) -> f64 {
    let velocity = |k| state.body_velocities.as_ref().map_or(0.0, |v| v[(env, body, k)]);
    (0..3).map(|k| velocity(k).powi(2)).sum::<f64>().sqrt()
}

impl Sensor for Speed {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.sampler.update(state, |env, row| row[0] = speed(self.body, state, env))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.reset(env_ids, state, |env, row| row[0] = speed(self.body, state, env))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.refresh(env_ids, state, |env, row| row[0] = speed(self.body, state, env))
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }
}

/// A free fall is `g t` fast, and what is read is 4 steps old.
#[test]
fn a_sampler_serves_sensors_of_other_crates_too() {
    let mut sim = SimulationManager::new(worlds::cfg(2)).unwrap();
    sim.add_rigid_object(worlds::cube("ball", 1.0, 0.1, [0.0, 0.0, 90.0])).unwrap();
    let late = SamplingCfg { latency_steps: 4, ..SamplingCfg::every(0.01) };
    let id = sim.add_sensor("speed", SpeedCfg("ball", late)).unwrap();
    sim.update(101);
    let seen = sim.sensor(id).unwrap().sampler.values("speed").to_owned();
    // The newest capture that is 4 steps old is that of step 96.
    worlds::assert_near(seen, &[9.81 * 96.0 * 0.005; 2], 1e-12);
}

#[test]
fn what_is_wrong_is_said() {
    let (mut sim, _) = arm(1);
    let odd = JointStateCfg { sampling: SamplingCfg::every(0.013), ..Default::default() };
    let text = sim.add_sensor("odd", odd).unwrap_err().to_string();
    assert!(text.contains("odd") && text.contains("0.013"), "{text}");
    sim.add_sensor("joints", JointStateCfg::default()).unwrap();
    assert!(matches!(sim.add_sensor("joints", JointStateCfg::default()), Err(Error::DuplicateUid(_))));
    let beyond = JointStateCfg { joints: Some(vec!["JOINT7".into()]), ..Default::default() };
    let text = sim.add_sensor("beyond", beyond).unwrap_err().to_string();
    assert!(text.contains("no joint \"JOINT7\"") && text.contains("JOINT6"), "{text}");
}

/// As for robots: a handle of one manager names nothing of another, though that has a sensor of the same kind in its place.
#[test]
fn handles_are_of_one_manager() {
    let [(mut sim, _), (mut other, _)] = [arm(1), arm(1)];
    let id = sim.add_sensor("joints", JointStateCfg::default()).unwrap();
    let own = other.add_sensor("joints", JointStateCfg::default()).unwrap();
    assert!(sim.sensor(id).is_ok() && sim.sensor_mut(id).is_ok() && sim.debug_vis(id).is_ok());
    assert!(other.sensor(own).is_ok(), "the control");
    let mut says = |ask: &dyn Fn(&mut SimulationManager)| {
        let asked = std::panic::AssertUnwindSafe(|| ask(&mut other));
        *std::panic::catch_unwind(asked).unwrap_err().downcast::<&str>().unwrap()
    };
    let wrong = "this handle is of another SimulationManager";
    assert_eq!(says(&|other| assert!(other.sensor(id).is_ok())), wrong);
    assert_eq!(says(&|other| assert!(other.sensor_mut(id).is_ok())), wrong);
    assert_eq!(says(&|other| assert!(other.debug_vis(id).is_ok())), wrong);
    assert_eq!(says(&|other| assert!(other.set_debug_vis(id, true).is_ok())), wrong);
}
