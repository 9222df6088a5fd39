//! Sensors of numbers allocate nothing after they were built.

use ndarray::{Array2, Array3};
use scene::SceneState;
use scene::state::{Contact, Contacts};
use sensors::{
    ContactSensorCfg, EngineSensor, FrameTransformerCfg, ImuCfg, JointWrenchCfg, MujocoSensorCfg, Requires,
    SamplingCfg, Schedule, Sensor, SensorCfg, SensorContext, SensorError, SensorSlot, TargetFrameCfg,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

fn state() -> SceneState {
    let contact = Contact {
        bodies: [None, Some(1)],
        point: [0.1, 0.2, 0.3],
        normal: [0.0, 0.0, 1.0],
        distance: 0.0,
        force: [1.0, 2.0, 3.0],
        normal_force: 3.0,
    };
    let rows = |width| Some(Array3::from_shape_fn((2, 3, width), |(e, b, k)| (1 + e + b + k) as f64));
    SceneState {
        contacts: Some(Contacts { first: vec![0, 3, 6], list: vec![contact; 6] }),
        body_poses: rows(7),
        force_poses: rows(7),
        force_velocities: rows(6),
        body_accelerations: rows(6),
        joint_wrenches: rows(6),
        sensordata: Some(Array2::from_elem((2, 3), 0.5)),
        ..SceneState::new(2)
    }
}

#[test]
fn no_sensor_allocates_when_it_measures() {
    let bodies = ["a", "b", "c"].map(String::from);
    let engine_sensors = [EngineSensor { name: "a/own".into(), width: 3, ..EngineSensor::default() }].into();
    let context =
        SensorContext { num_envs: 2, dt: 0.01, bodies: bodies.into(), engine_sensors, ..SensorContext::default() };
    let sampling = SamplingCfg { history_length: 3, latency_steps: 4, ..SamplingCfg::every(0.02) };
    let contact = ContactSensorCfg {
        filters: vec!["ground".into(), ".*".into()],
        track_pose: true,
        track_air_time: true,
        track_contact_points: true,
        track_friction_forces: true,
        sampling: sampling.clone(),
        ..ContactSensorCfg::of(".*")
    };
    let imu = ImuCfg { sampling: sampling.clone(), ..ImuCfg::on("b") };
    let frames = FrameTransformerCfg {
        sampling: sampling.clone(),
        ..FrameTransformerCfg::from("a", vec![TargetFrameCfg::of(".*")])
    };
    let wrench = JointWrenchCfg {
        links: vec!["[ab]".into()],
        frames: vec!["c".into()],
        sampling: sampling.clone(),
        debug_vis: true,
    };
    let own = MujocoSensorCfg { sensors: Some(vec!["own".into()]), sampling };
    let schedule = Schedule::new(0.02, context.dt, false).expect("good");
    let mut sensors: Vec<Box<dyn Sensor>> = vec![
        Box::new(contact.build(&context).expect("good")),
        Box::new(imu.build(&context).expect("good")),
        Box::new(frames.build(&context).expect("good")),
        Box::new(own.build(&context).expect("good")),
        // For this one, the third body is fused to the second.
        Box::new(wrench.build(&SensorContext { carriers: [0, 1, 1].into(), ..context }).expect("good")),
    ];
    let mut state = state();
    for sensor in &mut sensors {
        let count = allocation_counter::measure(|| {
            sensor.reset(&[0, 1], &state).expect("fits");
            for step in 1..=50 {
                state.step.fill(step);
                sensor.due_in(&state.step);
                sensor.update(&state).expect("fits");
                sensor.refresh(&[1], &state).expect("fits");
            }
        });
        assert_eq!(count.count_total, 0, "{sensor:?}");
        state.step.fill(0);
    }
    // Lazy ones, which are read every seven steps and written to every eleven: what they keep is allocated at the first reset.
    let mut states = [[3, 3], [0, 5], [6, 1]].map(|counts| with_contacts(&state, counts));
    for sensor in sensors {
        let measured = Arc::new(AtomicUsize::new(0));
        let sensor = Box::new(Counted { sensor, measured: Arc::clone(&measured) });
        let mut slot = SensorSlot::new(sensor, Requires::present_in(&state), Some(schedule), 2);
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
            // Every second step is due, and one that was due lies between any two of these.
            assert_eq!((asked, measured.load(Ordering::Relaxed) - before), (11, 11), "{slot:?}");
            states[0].step.fill(0);
            slot.reset(&[0, 1], &states[0]);
        };
        // The list of contacts grows in the first round.
        steps(&mut slot);
        assert_eq!(allocation_counter::measure(|| steps(&mut slot)).count_total, 0, "{slot:?}");
    }
}

/// The same with other numbers of contacts.
fn with_contacts(state: &SceneState, counts: [usize; 2]) -> SceneState {
    let contact = state.contacts.as_ref().expect("there are some").list[0];
    let [a, b] = counts;
    let contacts = Contacts { first: vec![0, a, a + b], list: vec![contact; a + b] };
    SceneState { contacts: Some(contacts), ..state.clone() }
}

/// A sensor, and how often it measured because it was due.
#[derive(Debug)]
struct Counted {
    sensor: Box<dyn Sensor>,
    measured: Arc<AtomicUsize>,
}

impl Sensor for Counted {
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
