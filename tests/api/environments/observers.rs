//! Observers are called at their requested steps, receive the changes of other observers, and do not affect the
//! results.

use kinetoscope::prelude::*;
use kinetoscope::sensors::Imu;
use kinetoscope::sim::{Error, Observer, ObserverId, RigidObjectId, SimEvent};
use kinetoscope_testkit::worlds::{add_ball, object, row};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};

/// The received events, with the step of the first environment.
type EventLog = Arc<Mutex<Vec<(u64, SimEvent)>>>;

/// An observer that is due at every `every`-th step of the first environment and runs `act`.
struct TestObserver {
    every: u64,
    log: EventLog,
    act: fn(&mut SimulationManager, &SimEvent),
}

impl TestObserver {
    fn new(every: u64, act: fn(&mut SimulationManager, &SimEvent)) -> (Self, EventLog) {
        let diary = EventLog::default();
        (Self { every, log: Arc::clone(&diary), act }, diary)
    }
}

impl Observer for TestObserver {
    fn due_in(&self, sim: &SimulationManager) -> u64 {
        self.every - steps(sim) % self.every
    }

    fn on_event(&mut self, sim: &mut SimulationManager, moment: &SimEvent) {
        self.log.lock().unwrap().push((steps(sim), moment.clone()));
        (self.act)(sim, moment);
    }
}

fn steps(sim: &SimulationManager) -> u64 {
    (sim.time()[0] / sim.cfg().physics_dt).round() as u64
}

fn read_log(diary: &EventLog) -> Vec<(u64, SimEvent)> {
    diary.lock().unwrap().clone()
}

fn every(period: u64, up_to: u64) -> Vec<(u64, SimEvent)> {
    (1..=up_to / period).map(|k| (period * k, SimEvent::Stepped)).collect()
}

/// A tumbling box with a sensor on it.
fn scene() -> (SimulationManager, RigidObjectId, SensorId<Imu>) {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    let cfg = object("box", ObjectShape::Box { size: [0.1, 0.2, 0.3] }, [0.0, 0.0, 0.4]);
    let object = sim.add_rigid_object(RigidObjectCfg { mass: Some(1.0), ..cfg }).unwrap();
    let imu = sim.add_sensor("imu", ImuCfg { sampling: SamplingCfg::every(0.07), ..ImuCfg::on("box") }).unwrap();
    (sim, object, imu)
}

#[test]
fn steps_of_their_own() {
    let (mut alone, object, imu) = scene();
    alone.update(100);
    for blocks in [vec![100], vec![1; 100], vec![33, 67]] {
        let (mut sim, same_object, same_imu) = scene();
        let (three, threes) = TestObserver::new(3, |_, _| {});
        let (seven, sevens) = TestObserver::new(7, |_, _| {});
        sim.observers_mut().add(three);
        sim.observers_mut().add(seven);
        blocks.into_iter().for_each(|block| sim.update(block));
        assert_eq!(read_log(&threes), every(3, 100));
        assert_eq!(read_log(&sevens), every(7, 100));
        assert_eq!(sim.rigid_object(same_object).pose(), alone.rigid_object(object).pose());
        let (here, there) = (sim.sensor(same_imu).unwrap(), alone.sensor(imu).unwrap());
        assert_eq!(here.lin_acc_b(), there.lin_acc_b());
        assert_eq!(here.sample_counts(), there.sample_counts());
    }
}

/// The panic of an observer reaches the caller after the others were notified, and the observer stays.
#[test]
fn panic() {
    let (mut sim, ..) = scene();
    let (first, failing) = TestObserver::new(1, |sim, _| assert_ne!(steps(sim), 2, "at step 2"));
    let (second, later) = TestObserver::new(1, |sim, _| assert_ne!(steps(sim), 2, "of the second"));
    sim.observers_mut().add(first);
    sim.observers_mut().add(second);
    sim.update(1);
    let panic = catch_unwind(AssertUnwindSafe(|| sim.update(1))).unwrap_err();
    let message = panic.downcast_ref::<String>().unwrap();
    assert!(message.contains("at step 2"), "{message}");
    sim.update(2);
    assert_eq!((read_log(&failing), read_log(&later)), (every(1, 4), every(1, 4)));
}

/// Look-up by type, in the order of addition. Removed observers and observers of another simulation are not found.
#[test]
fn by_type() {
    struct Other;
    impl Observer for Other {
        fn due_in(&self, _: &SimulationManager) -> u64 {
            1000
        }

        fn on_event(&mut self, _: &mut SimulationManager, _: &SimEvent) {}
    }
    let (mut sim, ..) = scene();
    let watches = [3, 7].map(|every| sim.observers_mut().add(TestObserver::new(every, |_, _| {}).0));
    let other = sim.observers_mut().add(Other);
    let same = |found: Vec<ObserverId<TestObserver>>, expected: &[ObserverId<TestObserver>]| {
        format!("{found:?}") == format!("{expected:?}")
    };
    assert!(same(sim.observers().ids(), &watches));
    assert_eq!(format!("{:?}", sim.observers().ids::<Other>()), format!("{:?}", [other]));
    assert_eq!(sim.observers().get(watches[1]).unwrap().every, 7);
    let taken = sim.observers_mut().remove(watches[0]).unwrap();
    assert_eq!(taken.every, 3);
    assert!(same(sim.observers().ids(), &watches[1..]));
    assert_eq!([watches[0], watches[1]].map(|id| sim.observers().contains(id)), [false, true]);
    let (elsewhere, ..) = scene();
    assert!(sim.observers().contains(other) && !elsewhere.observers().contains(other));
}

#[test]
fn resets_and_writes() {
    let (mut sim, object, _) = scene();
    let (watch, diary) = TestObserver::new(1000, |_, _| {});
    sim.observers_mut().add(watch);
    sim.update(2);
    sim.reset(Some(&[EnvId(1)])).unwrap();
    let velocities = row([0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    sim.rigid_object_mut(object).write_velocity(&velocities, Some(&[EnvId(1)])).unwrap();
    sim.rigid_object_mut(object).write_velocity(&velocities, Some(&[EnvId(0)])).unwrap();
    let snapshot = sim.snapshot(None).unwrap();
    assert_eq!(read_log(&diary), [(2, SimEvent::Reset { env_ids: vec![EnvId(1)] })]);
    sim.update(1);
    let written = SimEvent::Written { env_ids: vec![EnvId(0), EnvId(1)] };
    assert_eq!(read_log(&diary)[1..], [(2, written.clone())], "reported once, before the step");
    sim.update(1);
    assert_eq!(read_log(&diary).len(), 2, "and not again");
    sim.restore(&snapshot, None).unwrap();
    sim.update(1);
    assert_eq!(read_log(&diary)[2..], [(2, written)]);
    sim.add_sensor("another", ImuCfg::on("box")).unwrap();
    add_ball(&mut sim, "ball", [0.0; 3]);
    assert_eq!(read_log(&diary)[3..], [(3, SimEvent::Compiled)], "a sensor changes no model");
}

#[test]
fn acts_of_others() {
    let (mut sim, ..) = scene();
    let (doer, doers) = TestObserver::new(5, |sim, moment| {
        if *moment == SimEvent::Stepped {
            sim.reset(None).unwrap();
            sim.update(3);
        }
    });
    let (other_observer, hearers) = TestObserver::new(1, |_, _| {});
    let doer = sim.observers_mut().add(doer);
    let hearer = sim.observers_mut().add(other_observer);
    sim.update(5);
    assert_eq!(read_log(&doers), [(5, SimEvent::Stepped)]);
    let reset = (0, SimEvent::Reset { env_ids: vec![EnvId(0), EnvId(1)] });
    let mut all = every(1, 4);
    all.push(reset);
    all.extend(every(1, 3));
    // The fifth step itself is reported after the steps that the other observer took during its call.
    all.push((3, SimEvent::Stepped));
    assert_eq!(read_log(&hearers), all);
    assert_eq!(sim.observers().get(hearer).unwrap().every, 1);
    sim.observers_mut().get_mut(hearer).unwrap().every = 2;
    assert_eq!(sim.observers_mut().remove(hearer).unwrap().every, 2);
    assert!(matches!(sim.observers().get(hearer), Err(Error::ObserverUnavailable)));
    assert!(matches!(sim.observers_mut().remove(hearer), Err(Error::ObserverUnavailable)));
    assert_eq!(sim.observers_mut().remove(doer).unwrap().every, 5);
    sim.update(10);
    assert_eq!(read_log(&hearers), all, "no observer is left");
}
