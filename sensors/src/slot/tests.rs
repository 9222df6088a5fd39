use super::*;
use crate::sampling::{Sampled, SamplingCfg};
use crate::sensor::{SensorCfg, SensorContext};
use crate::{JointState, JointStateCfg, Requires};
use ndarray::Array2;
use scene::Random;
use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const ENVS: usize = 3;

fn context() -> SensorContext {
    let joints = ["arm/a", "arm/b"].map(String::from);
    SensorContext { num_envs: ENVS, dt: 0.005, joints: joints.into(), ..SensorContext::default() }
}

/// Environments at these steps; every number says environment, step and how often somebody wrote to it.
fn state(steps: [u64; ENVS], written: [u64; ENVS]) -> SceneState {
    let number =
        |env: usize, joint| (1000 * env + joint) as f64 + 0.001 * steps[env] as f64 + 1e6 * written[env] as f64;
    let numbers = || Some(Array2::from_shape_fn((ENVS, 2), |(env, joint)| number(env, joint)));
    SceneState {
        step: steps.to_vec(),
        time: steps.map(|step| 0.005 * step as f64).to_vec(),
        joint_positions: numbers(),
        joint_velocities: numbers(),
        joint_efforts: numbers(),
        ..SceneState::new(ENVS)
    }
}

fn slot(cfg: &JointStateCfg) -> SensorSlot {
    let context = context();
    let sensor = Box::new(cfg.build(&context).unwrap());
    SensorSlot::new(sensor, cfg.requires(), cfg.lazy(context.dt), ENVS)
}

fn joints(lazy: bool, sampling: SamplingCfg) -> SensorSlot {
    slot(&JointStateCfg { joints: None, sampling: SamplingCfg { lazy, ..sampling } })
}

/// All that a sensor of joints says.
fn said(slot: &SensorSlot) -> (Vec<u64>, Vec<f64>, Vec<f64>) {
    let any: &dyn Any = slot.sensor().unwrap();
    let sensor = any.downcast_ref::<JointState>().unwrap();
    (sensor.sample_counts().to_vec(), sensor.stamps().to_vec(), sensor.positions().iter().copied().collect())
}

/// Steps, resets and writes of single environments, in any order, and somebody who reads now and then: never does a lazy
/// sensor say anything else than an eager one.
#[test]
fn lazy_sensors_say_what_eager_ones_say() {
    for (seed, period) in [(1, 0.0), (2, 0.01), (3, 0.02), (4, 0.035)] {
        let mut random = Random::keyed(seed, 0, "slots");
        let mut slots = [false, true].map(|lazy| joints(lazy, SamplingCfg::every(period)));
        assert_eq!(slots.each_ref().map(SensorSlot::is_lazy), [false, true]);
        let (mut steps, mut written) = ([0; ENVS], [0; ENVS]);
        slots.iter_mut().for_each(|slot| slot.reset(&[0, 1, 2], &state(steps, written)));
        let mut reads = 0;
        for _ in 0..2000 {
            let env = (3.0 * random.uniform()) as usize;
            match random.uniform() {
                x if x < 0.05 => {
                    (steps[env], written[env]) = (0, written[env] + 1);
                    slots.iter_mut().for_each(|slot| slot.reset(&[env], &state(steps, written)));
                }
                x if x < 0.1 => {
                    written[env] += 1;
                    slots.iter_mut().for_each(|slot| slot.refresh(&[env], &state(steps, written)));
                }
                x if x < 0.25 => {
                    reads += 1;
                    assert_eq!(said(&slots[0]), said(&slots[1]));
                }
                // An environment that is put aside stands still.
                x => {
                    let stands = if x < 0.4 { env } else { ENVS };
                    (0..ENVS).filter(|&env| env != stands).for_each(|env| steps[env] += 1);
                    let due = slots.each_ref().map(|slot| slot.due_in(&steps));
                    assert_eq!(due[0], due[1], "both are due at the same time");
                    slots.iter_mut().for_each(|slot| slot.update(&state(steps, written)));
                }
            }
        }
        assert!(reads > 200);
    }
}

#[test]
fn what_depends_on_measurements_before_is_never_lazy() {
    let noise = [("positions".to_string(), crate::NoiseCfg::white(0.1))].into();
    for sampling in [
        SamplingCfg { history_length: 1, ..SamplingCfg::default() },
        SamplingCfg { latency_steps: 1, ..SamplingCfg::default() },
        SamplingCfg { dropout: 0.1, ..SamplingCfg::default() },
        SamplingCfg { noise, ..SamplingCfg::default() },
    ] {
        assert!(!joints(true, sampling.clone()).is_lazy(), "{sampling:?}");
    }
    assert!(joints(true, SamplingCfg::every(0.02)).is_lazy(), "the control");
}

/// A user's own sensor: counts how often it measures.
#[derive(Debug, Default)]
struct Counting {
    measured: Arc<AtomicUsize>,
    fails: bool,
    panics: bool,
}

impl Sensor for Counting {
    fn update(&mut self, _: &SceneState) -> Result<(), SensorError> {
        self.measured.fetch_add(1, Ordering::Relaxed);
        assert!(!self.panics, "told to");
        if self.fails { Err(SensorError::Pattern("told to".into())) } else { Ok(()) }
    }

    fn reset(&mut self, _: &[usize], _: &SceneState) -> Result<(), SensorError> {
        Ok(())
    }

    fn refresh(&mut self, _: &[usize], _: &SceneState) -> Result<(), SensorError> {
        Ok(())
    }
}

fn counting(sensor: Counting) -> SensorSlot {
    let schedule = Schedule::new(0.01, 0.005, false).unwrap();
    let mut slot = SensorSlot::new(Box::new(sensor), Requires::JOINT_STATE, Some(schedule), ENVS);
    slot.reset(&[0, 1, 2], &state([0; ENVS], [0; ENVS]));
    slot
}

#[test]
fn nobody_reads_nothing_is_measured() {
    let measured = Arc::new(AtomicUsize::new(0));
    let mut slot = counting(Counting { measured: Arc::clone(&measured), ..Counting::default() });
    let count = || measured.load(Ordering::Relaxed);
    for step in 1..=9 {
        slot.update(&state([step; ENVS], [0; ENVS]));
    }
    assert_eq!(count(), 0);
    assert!(slot.sensor().is_ok() && slot.sensor().is_ok() && slot.sensor_mut().is_ok());
    assert_eq!(count(), 1, "once, however often it is read");
    slot.update(&state([10; ENVS], [0; ENVS]));
    slot.reset(&[0, 1, 2], &state([0; ENVS], [0; ENVS]));
    assert_eq!(count(), 1, "what a reset makes past is not measured");
    slot.update(&state([2; ENVS], [0; ENVS]));
    slot.refresh(&[1], &state([2; ENVS], [0, 1, 0]));
    assert_eq!(count(), 2, "a refresh comes after what was due before");
    slot.update(&state([3; ENVS], [0, 1, 0]));
    assert!(slot.sensor().is_ok());
    assert_eq!(count(), 2, "nothing was due");
}

/// Several threads may read at once; one of them measures.
#[test]
fn readers_share_one_measurement() {
    for _ in 0..50 {
        let measured = Arc::new(AtomicUsize::new(0));
        let mut slot = counting(Counting { measured: Arc::clone(&measured), ..Counting::default() });
        slot.update(&state([2; ENVS], [0; ENVS]));
        std::thread::scope(|scope| {
            for _ in 0..3 {
                scope.spawn(|| assert!(slot.sensor().is_ok()));
            }
        });
        assert_eq!(measured.load(Ordering::Relaxed), 1);
    }
}

#[test]
fn a_lazy_sensor_says_what_is_wrong_when_it_is_read() {
    let mut slot = counting(Counting { fails: true, ..Counting::default() });
    slot.update(&state([2; ENVS], [0; ENVS]));
    assert!(!slot.has_failed(), "nobody knows yet");
    assert_eq!(slot.sensor().unwrap_err().to_string(), "told to");
    assert!(slot.has_failed());
    // A state of another scene is said to be that, as an eager sensor says it.
    let mut slot = joints(true, SamplingCfg::default());
    slot.reset(&[0, 1, 2], &state([0; ENVS], [0; ENVS]));
    slot.update(&SceneState::new(ENVS));
    assert!(matches!(slot.sensor(), Err(SensorError::MissingFields { .. })));
    let mut slot = joints(true, SamplingCfg::default());
    slot.reset(&[0, 1, 2], &state([0; ENVS], [0; ENVS]));
    slot.update(&SceneState::new(2));
    assert!(slot.has_failed());
    // Nor does a panic take others with it.
    let mut slot = counting(Counting { panics: true, ..Counting::default() });
    slot.update(&state([2; ENVS], [0; ENVS]));
    let read = std::panic::AssertUnwindSafe(|| slot.sensor().is_ok());
    let cause = std::panic::catch_unwind(read).unwrap_err();
    assert_eq!(cause.downcast_ref::<&str>(), Some(&"told to"));
    assert!(slot.has_failed(), "known at once");
    slot.update(&state([4; ENVS], [0; ENVS]));
    assert!(slot.has_failed(), "and for good");
    assert_eq!(slot.sensor().unwrap_err(), &SensorError::BrokenOff);
}
