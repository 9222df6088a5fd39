//! Sensors of numbers allocate nothing after they were built.

use ndarray::{Array2, Array3};
use scene::SceneState;
use scene::state::{Contact, Contacts};
use sensors::{
    ContactSensorCfg, EngineSensor, FrameTransformerCfg, ImuCfg, JointWrenchCfg, MujocoSensorCfg, Requires,
    SamplingCfg, Schedule, Sensor, SensorCfg, SensorContext, SensorSlot, TargetFrameCfg,
};

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
    // Lazy ones, which are read every seven steps: what they keep is allocated at the first reset.
    for sensor in sensors {
        let mut slot = SensorSlot::new(sensor, Requires::present_in(&state), Some(schedule), 2);
        slot.reset(&[0, 1], &state);
        let mut steps = |slot: &mut SensorSlot| {
            for step in 1..=50 {
                state.step.fill(step);
                slot.update(&state);
                slot.refresh(&[1], &state);
                assert!(step % 7 > 0 || slot.sensor().is_ok());
            }
            state.step.fill(0);
            slot.reset(&[0, 1], &state);
        };
        // The list of contacts grows once.
        steps(&mut slot);
        assert_eq!(allocation_counter::measure(|| steps(&mut slot)).count_total, 0, "{slot:?}");
    }
}
