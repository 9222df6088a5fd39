//! What contact sensors remember, across resets; and the times of every bounce of a ball.

use crate::sensors::worlds::{G, cfg, cube};
use kinetoscope::ndarray::{Array2, Axis, array};
use kinetoscope::prelude::*;

/// What was measured since the reset of an environment, newest first, and zeros after that: environments by themselves.
#[test]
fn a_reset_forgets_the_history_of_its_environment_only() {
    const T: usize = 4;
    let mut sim = SimulationManager::new(cfg(3)).unwrap();
    sim.add_rigid_object(cube("box", 2.0, 0.2, [0.0, 0.0, 0.0995])).unwrap();
    let sampling = SamplingCfg { history_length: T, ..SamplingCfg::every(0.01) };
    let watch = ContactSensorCfg { sampling, filters: vec!["ground".into()], ..ContactSensorCfg::of("box") };
    let id = sim.add_sensor("contact", watch).unwrap();
    // What is there to be remembered, newest first: vertical forces, and stamps.
    let mut told: [Vec<(f64, f64)>; 3] = Default::default();
    let check = |sim: &SimulationManager, told: &[Vec<(f64, f64)>; 3]| {
        let sensor = sim.sensor(id).unwrap();
        let (net, pairs) = (sensor.net_forces_w_history(), sensor.force_matrix_w_history());
        for (env, told) in told.iter().enumerate() {
            assert_eq!(sensor.history_filled(env), told.len().min(T));
            for age in 0..T {
                let (force, stamp) = told.get(age).copied().unwrap_or_default();
                assert_eq!(net[(env, age, 0, 2)], force, "environment {env}, age {age}");
                assert_eq!(pairs[(env, age, 0, 0, 2)], force, "environment {env}, age {age}");
                assert_eq!(sensor.stamp_history()[(env, age)], stamp, "environment {env}, age {age}");
            }
        }
    };
    for step in 1..=40 {
        sim.update(1);
        let sensor = sim.sensor(id).unwrap();
        for (env, told) in told.iter_mut().enumerate() {
            if sensor.sample_counts()[env] as usize > told.len() {
                told.insert(0, (sensor.net_forces_w()[(env, 0, 2)], sensor.stamps()[env]));
            }
        }
        check(&sim, &told);
        // One in the middle of a period, then two others.
        let reset: &[EnvId] = match step {
            13 => &[EnvId(1)],
            26 => &[EnvId(2), EnvId(0)],
            _ => &[],
        };
        if !reset.is_empty() {
            sim.reset(Some(reset)).unwrap();
            reset.iter().for_each(|env| told[env.0].clear());
            check(&sim, &told);
        }
    }
    assert_eq!(told.each_ref().map(Vec::len), [7, 13, 7], "27 steps since a reset are 13 periods, 14 are 7");
    assert!(told[1].iter().all(|(force, _)| *force > G), "there was something to remember");
}

/// A ball that bounces. The judge is Newton: in which steps the ground pushed, by what the velocity changed more than gravity
/// changes it. The times of every phase in the air and on the ground are exact to the step, and every beginning is told once.
#[test]
fn every_bounce_is_timed_to_the_step() {
    for (period, stride) in [(1_u32, 1_u32), (5, 1), (5, 3)] {
        let mut sim = SimulationManager::new(cfg(2)).unwrap();
        let (dt, radius) = (sim.cfg().physics_dt, 0.1);
        let shape = ObjectShape::Sphere { radius };
        let ball = RigidObjectCfg { shape, restitution: Some(0.8), ..cube("ball", 1.0, 0.1, [0.0, 0.0, 0.6]) };
        let ball = sim.add_rigid_object(ball).unwrap();
        let watch = ContactSensorCfg {
            track_air_time: true,
            sampling: SamplingCfg::every(f64::from(period) * dt),
            ..ContactSensorCfg::of("ball")
        };
        let id = sim.add_sensor("contact", watch).unwrap();
        // Environment 1 falls from higher up, so that its bounces are others.
        let up = array![[0.0, 0.0, 0.9, 1.0, 0.0, 0.0, 0.0]];
        sim.rigid_object_mut(ball).write_pose(&up, Some(&[EnvId(1)])).unwrap();
        // The same world without a sensor, step by step.
        let mut judge = SimulationManager::new(cfg(2)).unwrap();
        let other = RigidObjectCfg {
            shape: ObjectShape::Sphere { radius },
            restitution: Some(0.8),
            ..cube("ball", 1.0, 0.1, [0.0, 0.0, 0.6])
        };
        let other = judge.add_rigid_object(other).unwrap();
        judge.rigid_object_mut(other).write_pose(&up, Some(&[EnvId(1)])).unwrap();
        let mut speed: Array2<f64> = Array2::zeros((2, 6));
        // Of each environment: does it touch, since how many steps, and the lengths of finished phases [air, contact].
        let mut phases = [(false, 0_u32, [0_u32; 2]); 2];
        let mut begun = [[0_u32; 2]; 2];
        let (mut told, mut step) = ([[0_u32; 2]; 2], 0_u32);
        while step < 600 {
            sim.update(stride);
            for _ in 0..stride {
                step += 1;
                judge.update(1);
                let now = judge.rigid_object(other).get_velocity();
                for (env, (touches, since, last)) in phases.iter_mut().enumerate() {
                    // One newton on one kilogram.
                    let pushed = (now[(env, 2)] - speed[(env, 2)]) / dt + G > 1.0;
                    if pushed != *touches {
                        last[usize::from(*touches)] = *since;
                        begun[env][usize::from(pushed)] += 1;
                        (*touches, *since) = (pushed, 0);
                    }
                    *since += 1;
                }
                speed = now;
            }
            let sensor = sim.sensor(id).unwrap();
            assert_eq!(sim.rigid_object(ball).get_velocity(), speed, "the same motion");
            let flags = [sensor.first_air().unwrap(), sensor.first_contact().unwrap()];
            // What the last measurement knew: only where it is of this step are the numbers the judge's.
            if !step.is_multiple_of(period) {
                continue;
            }
            for (env, (touches, since, last)) in phases.iter().enumerate() {
                let steps = |n: u32| f64::from(n) * dt;
                let at = |array: kinetoscope::ndarray::ArrayView2<'_, f64>| array[(env, 0)];
                let [air, contact] = if *touches { [0, *since] } else { [*since, 0] };
                assert_eq!(at(sensor.current_air_time().unwrap()), steps(air), "step {step}");
                assert_eq!(at(sensor.current_contact_time().unwrap()), steps(contact), "step {step}");
                assert_eq!(at(sensor.last_air_time().unwrap()), steps(last[0]), "step {step}");
                assert_eq!(at(sensor.last_contact_time().unwrap()), steps(last[1]), "step {step}");
                for (kind, flag) in flags.iter().enumerate() {
                    told[env][kind] += u32::from(flag[(env, 0)]);
                }
            }
        }
        println!("period {period}, stride {stride}: began {begun:?}, told {told:?}");
        for env in 0..2 {
            assert!(begun[env][1] > 3, "it bounces: {begun:?}");
            // Each beginning once; several within one period are told together, and with strides some are told between.
            if (period, stride) == (1, 1) {
                assert_eq!(told[env], begun[env]);
            } else if stride == 1 {
                assert!(told[env][1] > 3 && told[env][1] <= begun[env][1], "{told:?} of {begun:?}");
            }
        }
        assert_ne!(begun[0], [0; 2]);
        assert_ne!(
            sim.sensor(id).unwrap().last_air_time().unwrap().index_axis(Axis(0), 0),
            sim.sensor(id).unwrap().last_air_time().unwrap().index_axis(Axis(0), 1),
            "the control: environments bounce differently"
        );
    }
}
