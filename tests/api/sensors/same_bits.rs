//! Sensors change nothing, and nothing changes sensors: the same bits with and without them, for any number of threads and
//! environments, and for any stride.

use crate::sensors::worlds::{cfg, cube};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::mj;

/// An arm with drives that bind and two boxes that tumble on the ground, the environments all different.
fn world(settings: SimulationManagerCfg, with_arm: bool) -> (SimulationManager, Option<RobotId>, [ObjectId; 2]) {
    let n = settings.num_envs;
    let mut sim = SimulationManager::new(settings).unwrap();
    let arm = with_arm.then(|| {
        let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
        sim.add_robot(RobotCfg { uid: "arm".into(), urdf, ..Default::default() }).unwrap()
    });
    let boxes = [0.15, 0.4].map(|z| {
        let box_ = cube(&format!("box{z}"), 1.0, 0.2, [0.8, 0.1 * z, z]);
        sim.add_rigid_object(box_).unwrap()
    });
    // More contacts than buffers have room for at first: steps are done again while they are captured.
    for k in 0..5 {
        sim.add_rigid_object(cube(&format!("pile{k}"), 1.0, 0.2, [-1.0 - 0.5 * f64::from(k), 0.0, 0.11])).unwrap();
    }
    scatter(&mut sim, boxes[1], n);
    (sim, arm, boxes)
}

fn scatter(sim: &mut SimulationManager, object: ObjectId, n: usize) {
    let spin = Array2::from_shape_fn((n, 6), |(env, k)| (1.3 * env as f64 + 0.7 * k as f64).sin());
    sim.rigid_object_mut(object).write_velocity(&spin, None).unwrap();
}

struct Ids {
    contact: SensorId<ContactSensor>,
    imu: SensorId<Imu>,
    wrench: Option<SensorId<JointWrench>>,
}

fn add_sensors(sim: &mut SimulationManager, with_arm: bool, period: f64) -> Ids {
    let noise = |channel: &str| [(channel.to_string(), NoiseCfg { bias_walk: 0.1, ..NoiseCfg::white(0.1) })].into();
    let late = SamplingCfg { latency_steps: 3, dropout: 0.1, history_length: 3, ..SamplingCfg::every(period) };
    let sampling = SamplingCfg { noise: noise("net_forces_w"), ..late.clone() };
    let contact = ContactSensorCfg { filters: vec!["ground".into()], sampling, ..ContactSensorCfg::of("box.*") };
    let imu = ImuCfg { sampling: SamplingCfg { noise: noise("lin_acc_b"), ..late.clone() }, ..ImuCfg::on("box0.4") };
    let wrench = JointWrenchCfg { links: vec!["link[36]".into()], sampling: late, ..Default::default() };
    Ids {
        contact: sim.add_sensor("contact", contact).unwrap(),
        imu: sim.add_sensor("imu", imu).unwrap(),
        wrench: with_arm.then(|| sim.add_sensor("wrench", wrench).unwrap()),
    }
}

/// Steps with targets, writes and resets in between; bits of all states on the way.
fn states(settings: SimulationManagerCfg, with_arm: bool, with_sensors: bool) -> Vec<u64> {
    let n = settings.num_envs;
    let (mut sim, arm, boxes) = world(settings, with_arm);
    if with_sensors {
        add_sensors(&mut sim, with_arm, 0.0);
    }
    let mut bits = Vec::new();
    for k in 0..40 {
        if let Some(arm) = arm {
            let target = 0.5 * f64::from(k % 5) - 1.0;
            sim.robot_mut(arm).set_qpos(&array![[target, 1.0, -target, 0.3, target, 0.0]], None, None).unwrap();
        }
        match k {
            10 => sim.reset(Some(&[EnvId(1)])).unwrap(),
            20 => scatter(&mut sim, boxes[1], n),
            30 => {
                let pose = array![[0.8, 0.0, 0.09, 2.0, 0.1, 0.0, 0.0]];
                sim.rigid_object_mut(boxes[0]).write_pose(&pose, Some(&[EnvId(0)])).unwrap();
            }
            _ => {}
        }
        sim.update(7);
        for object in boxes {
            bits.extend(sim.rigid_object(object).get_pose().iter().map(|x| x.to_bits()));
            bits.extend(sim.rigid_object(object).get_velocity().iter().map(|x| x.to_bits()));
        }
        if let Some(arm) = arm {
            bits.extend(sim.robot(arm).get_qpos().iter().chain(&sim.robot(arm).get_qf()).map(|x| x.to_bits()));
        }
    }
    assert!(sim.buffer_growths() > 0 || mj::TARGET == mj::Target::V4, "the arena of 4.x is large enough");
    bits
}

#[test]
fn sensors_do_not_change_a_bit_of_the_motion() {
    let settings = || SimulationManagerCfg { substeps: 2, ..cfg(3) };
    assert_eq!(states(settings(), true, true), states(settings(), true, false));
    // RK4 solves its steps in the middle of them; sensors get what is solved for their beginning.
    let rk4 = || SimulationManagerCfg { integrator: Integrator::Rk4, ..cfg(3) };
    assert_eq!(states(rk4(), false, true), states(rk4(), false, false));
}

/// Bits of all that sensors say.
fn readings(settings: SimulationManagerCfg, stride: u32) -> Vec<Vec<u64>> {
    let n = settings.num_envs;
    let (mut sim, _, _) = world(settings, true);
    let ids = add_sensors(&mut sim, true, 0.02);
    let mut bits = vec![Vec::new(); n];
    for k in 0..120 / stride {
        if k * stride == 60 {
            sim.reset(Some(&[EnvId(1)])).unwrap();
        }
        sim.update(stride);
        if !((k + 1) * stride).is_multiple_of(12) {
            continue;
        }
        let (contact, imu) = (sim.sensor(ids.contact).unwrap(), sim.sensor(ids.imu).unwrap());
        let wrench = sim.sensor(ids.wrench.unwrap()).unwrap();
        for (env, bits) in bits.iter_mut().enumerate() {
            let first = kinetoscope::ndarray::Axis(0);
            let mut take = |values: kinetoscope::ndarray::ArrayViewD<'_, f64>| {
                bits.extend(values.index_axis(first, env).iter().map(|x| x.to_bits()));
            };
            take(contact.net_forces_w_history().into_dyn());
            take(contact.total_forces_w().into_dyn());
            take(contact.stamp_history().into_dyn());
            take(imu.lin_acc_b().into_dyn());
            take(imu.ang_vel_b().into_dyn());
            take(wrench.forces().into_dyn());
            take(wrench.torques().into_dyn());
        }
    }
    bits
}

#[test]
fn threads_environments_and_strides_do_not_change_a_bit_of_what_sensors_say() {
    let with = |num_envs, threads| SimulationManagerCfg { threads: Some(threads), seed: 5, ..cfg(num_envs) };
    let reference = readings(with(5, 1), 1);
    assert_eq!(readings(with(5, 4), 1), reference);
    assert_eq!(readings(with(5, 4), 12), reference);
    assert_eq!(readings(with(2, 1), 1), reference[..2]);
    assert_ne!(reference[0], reference[1], "the control: environments are different");
    let other_seed = SimulationManagerCfg { seed: 6, ..with(5, 1) };
    assert_ne!(readings(other_seed, 1), reference, "the control: noise comes from the seed");
}
