use super::*;
use crate::sampling::{Sampled, SamplingCfg};
use crate::sensor::{SensorCfg, SensorContext};
use crate::{JointState, JointStateCfg};
use kinetoscope_scene::KeyedRng;
use ndarray::Array2;
use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const ENVS: usize = 3;
const NOT_WRITTEN: [u64; ENVS] = [0; ENVS];

/// A state with environments at these steps; every number encodes environment, step and number of writes.
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

fn joints(lazy: bool, sampling: SamplingCfg) -> SensorSlot {
    let joints = ["arm/a", "arm/b"].map(String::from).into();
    let context = SensorContext { num_envs: ENVS, dt: 0.005, joints, ..SensorContext::default() };
    let cfg = JointStateCfg { joints: None, sampling: SamplingCfg { lazy, ..sampling } };
    SensorSlot::new(Box::new(cfg.build(&context).unwrap()), cfg.requires(), cfg.lazy(context.dt), ENVS)
}

/// Sample counts, stamps and positions.
fn measured(slot: &SensorSlot) -> (Vec<u64>, Vec<f64>, Vec<f64>) {
    let any: &dyn Any = slot.sensor().unwrap();
    let sensor = any.downcast_ref::<JointState>().unwrap();
    (sensor.sample_counts().to_vec(), sensor.stamps().to_vec(), sensor.positions().iter().copied().collect())
}

/// Steps, resets, writes of single environments and reads in random order: a lazy sensor equals an eager one. Sensors
/// whose values depend on earlier measurements are never lazy.
#[test]
fn lazy_and_eager() {
    for (seed, period) in [(1, 0.0), (2, 0.01), (3, 0.02), (4, 0.035)] {
        let mut random = KeyedRng::keyed(seed, 0, "slots");
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
                    assert_eq!(measured(&slots[0]), measured(&slots[1]));
                }
                // Sometimes an environment does not step.
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
    let noise = [("positions".to_string(), crate::NoiseCfg::white(0.1))].into();
    for (lazy, sampling) in [
        (false, SamplingCfg { history_length: 1, ..SamplingCfg::default() }),
        (false, SamplingCfg { latency_steps: 1, ..SamplingCfg::default() }),
        (false, SamplingCfg { dropout: 0.1, ..SamplingCfg::default() }),
        (false, SamplingCfg { noise, ..SamplingCfg::default() }),
        (true, SamplingCfg::every(0.02)),
    ] {
        assert_eq!(joints(true, sampling.clone()).is_lazy(), lazy, "{sampling:?}");
    }
}

/// A user-defined sensor that counts its measurements.
#[derive(Debug, Default)]
struct Counting {
    count: Arc<AtomicUsize>,
    fails: bool,
    panics: bool,
}

impl Sensor for Counting {
    fn update(&mut self, _: &SceneState) -> Result<(), SensorError> {
        self.count.fetch_add(1, Ordering::Relaxed);
        assert!(!self.panics, "on purpose");
        if self.fails { Err(SensorError::Pattern("on purpose".into())) } else { Ok(()) }
    }

    fn reset(&mut self, _: &[usize], _: &SceneState) -> Result<(), SensorError> {
        Ok(())
    }

    fn refresh(&mut self, _: &[usize], _: &SceneState) -> Result<(), SensorError> {
        Ok(())
    }
}

fn counting(fails: bool, panics: bool) -> (SensorSlot, Arc<AtomicUsize>) {
    let count = Arc::new(AtomicUsize::new(0));
    let sensor = Counting { count: Arc::clone(&count), fails, panics };
    let schedule = Schedule::new(0.01, 0.005, false).unwrap();
    let mut slot = SensorSlot::new(Box::new(sensor), StateFields::JOINT_STATE, Some(schedule), ENVS);
    slot.reset(&[0, 1, 2], &state([0; ENVS], NOT_WRITTEN));
    (slot, count)
}

#[test]
fn measurements_on_demand() {
    let (mut slot, count) = counting(false, false);
    let count = || count.load(Ordering::Relaxed);
    (1..=9).for_each(|step| slot.update(&state([step; ENVS], NOT_WRITTEN)));
    assert_eq!(count(), 0);
    assert!(slot.sensor().is_ok() && slot.sensor().is_ok() && slot.sensor_mut().is_ok());
    assert_eq!(count(), 1, "once, however often it is read");
    slot.update(&state([10; ENVS], NOT_WRITTEN));
    slot.reset(&[0, 1, 2], &state([0; ENVS], NOT_WRITTEN));
    assert_eq!(count(), 1, "a reset drops what was due");
    slot.update(&state([2; ENVS], NOT_WRITTEN));
    slot.refresh(&[1], &state([2; ENVS], [0, 1, 0]));
    assert_eq!(count(), 2, "a refresh comes after what was due before");
    slot.update(&state([3; ENVS], [0, 1, 0]));
    assert!(slot.sensor().is_ok());
    assert_eq!(count(), 2, "nothing was due");
    // Several threads may read at once; one of them measures.
    for _ in 0..50 {
        let (mut slot, count) = counting(false, false);
        slot.update(&state([2; ENVS], NOT_WRITTEN));
        std::thread::scope(|scope| {
            (0..3).for_each(|_| drop(scope.spawn(|| assert!(slot.sensor().is_ok()))));
        });
        assert_eq!(count.load(Ordering::Relaxed), 1);
    }
}

/// Errors of a lazy sensor are returned when it is read; errors of the state are the same as for an eager sensor.
#[test]
fn errors() {
    let (mut slot, _) = counting(true, false);
    slot.update(&state([2; ENVS], NOT_WRITTEN));
    assert!(!slot.has_failed(), "not known yet");
    assert_eq!(slot.sensor().unwrap_err().to_string(), "on purpose");
    assert!(slot.has_failed());
    let reset = || {
        let mut slot = joints(true, SamplingCfg::default());
        slot.reset(&[0, 1, 2], &state([0; ENVS], NOT_WRITTEN));
        slot
    };
    let mut slot = reset();
    slot.update(&SceneState::new(ENVS));
    assert!(matches!(slot.sensor(), Err(SensorError::MissingFields { .. })));
    let mut slot = reset();
    slot.update(&SceneState::new(2));
    assert!(slot.has_failed());
    // A panic is an error like others, and the sensor is not called again.
    let (mut slot, count) = counting(false, true);
    slot.update(&state([2; ENVS], NOT_WRITTEN));
    let panicked = SensorError::Panicked { message: "on purpose".into() };
    assert_eq!(slot.sensor().unwrap_err(), &panicked);
    assert!(slot.has_failed());
    slot.update(&state([4; ENVS], NOT_WRITTEN));
    slot.reset(&[0, 1, 2], &state([0; ENVS], NOT_WRITTEN));
    assert!(slot.has_failed());
    assert_eq!((slot.sensor_mut().unwrap_err(), count.load(Ordering::Relaxed)), (&panicked, 1));
}
