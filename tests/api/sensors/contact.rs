//! Contact forces against Newton's laws, in a running simulation.

use crate::sensors::worlds::{G, assert_near, cfg, cube, joint, link, robot, row};
use kinetoscope::ndarray::{Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::Cone;
use nalgebra::Vector3;

/// Rounding of forces of tens of newtons, from velocities divided by the step of 5 ms.
const EXACT: f64 = 1e-9;

/// In every step of a fall, a bounce and the rest after it: the force of the contacts is what the change of velocity needs,
/// `m (dv / dt - g)`, and at rest it is the weight.
#[test]
fn forces_are_those_that_change_the_velocity() {
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let (mass, dt) = (2.5, sim.cfg().physics_dt);
    let box_ = sim.add_rigid_object(cube("box", mass, 0.2, [0.0, 0.0, 0.3])).unwrap();
    let id = sim.add_sensor("contact", ContactSensorCfg::of("box")).unwrap();
    let mut before = row(&sim.rigid_object(box_).get_velocity(), 0, 0);
    let (mut touched, mut flying) = (0, 0);
    for _ in 0..600 {
        sim.update(1);
        let velocity = row(&sim.rigid_object(box_).get_velocity(), 0, 0);
        let expected = mass * ((velocity - before) / dt - Vector3::new(0.0, 0.0, -G));
        let sensor = sim.sensor(id).unwrap();
        assert_near(sensor.total_forces_w().iter().copied(), expected.as_slice(), EXACT * 1e3);
        touched += u32::from(expected.z > 1.0);
        flying += u32::from(expected.z.abs() < 1e-6);
        before = velocity;
    }
    assert!(touched > 300 && flying > 10, "{touched} steps with contact, {flying} without");
    let net = sim.sensor(id).unwrap().net_forces_w().to_owned();
    // What is left of the motion after two seconds is far below a thousandth of gravity.
    assert_near(net, &[0.0, 0.0, mass * G], 1e-3 * mass * G);
}

/// A slope of 20 degrees, as a tilted gravity: the normal force is m g cos, friction m g sin. Net forces are normal ones
/// only: with friction in them they would have an x component.
#[test]
fn on_a_slope_normal_force_and_friction_are_told_apart() {
    let (sin, cos) = 20.0_f64.to_radians().sin_cos();
    let gravity = G * Vector3::new(sin, 0.0, -cos);
    let settings = SimulationManagerCfg { gravity, cone: Cone::Elliptic, impratio: 10.0, ..cfg(1) };
    let mut sim = SimulationManager::new(settings).unwrap();
    let mass = 1.5;
    sim.add_rigid_object(cube("box", mass, 0.2, [0.0, 0.0, 0.1])).unwrap();
    let watch =
        ContactSensorCfg { track_contact_points: true, filters: vec!["ground".into()], ..ContactSensorCfg::of("box") };
    let id = sim.add_sensor("contact", watch).unwrap();
    sim.update(1000);
    let sensor = sim.sensor(id).unwrap();
    let weight = mass * G;
    // At rest up to a creep that changes by less than a thousandth of gravity.
    let near = 1e-3 * weight;
    assert_near(sensor.net_forces_w().to_owned(), &[0.0, 0.0, weight * cos], near);
    assert_near(sensor.friction_forces_w().to_owned(), &[-weight * sin, 0.0, 0.0], near);
    assert_near(sensor.total_forces_w().to_owned(), &[-weight * sin, 0.0, weight * cos], near);
    assert_eq!(sensor.net_forces_w()[(0, 0, 0)], 0.0, "the normal of the ground is z, to the last bit");
    assert_eq!(sensor.force_matrix_w().iter().collect::<Vec<_>>(), sensor.net_forces_w().iter().collect::<Vec<_>>());
    let points = sensor.contact_points_w().unwrap();
    assert!(points[(0, 0, 2)].abs() < 0.01 && sensor.contact_counts().unwrap()[(0, 0)] >= 3.0, "{points}");
}

/// Three boxes on top of each other, every pair at once: what one exerts on another is minus what the other exerts on it.
#[test]
fn pairs_of_bodies_act_and_react() {
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    let masses = [3.0, 2.0, 1.0];
    for (k, mass) in masses.into_iter().enumerate() {
        sim.add_rigid_object(cube(&format!("box{k}"), mass, 0.2, [0.0, 0.0, 0.1 + 0.2 * k as f64])).unwrap();
    }
    let filters = vec!["box0".into(), "box1".into(), "box2".into(), "ground".into(), "box.".into()];
    let id = sim.add_sensor("contact", ContactSensorCfg { filters, ..ContactSensorCfg::of("box.") }).unwrap();
    sim.update(1000);
    let sensor = sim.sensor(id).unwrap();
    let matrix = sensor.force_matrix_w();
    for env in 0..2 {
        for a in 0..3 {
            for b in 0..3 {
                for k in 0..3 {
                    // The same sums of the same contacts, in the same order.
                    assert_eq!(matrix[(env, a, b, k)], -matrix[(env, b, a, k)]);
                }
            }
            let above: f64 = masses[a..].iter().sum();
            let below = if a == 0 { 3 } else { a - 1 };
            assert_near([matrix[(env, a, below, 2)]], &[above * G], 1e-3 * above * G);
            assert_near([sensor.net_forces_w()[(env, a, 2)]], &[masses[a] * G], 1e-3 * above * G);
            let others: f64 = (0..3).map(|b| matrix[(env, a, b, 2)]).sum();
            assert_near([matrix[(env, a, 4, 2)]], &[others], EXACT * 1e2);
        }
        assert_eq!((matrix[(env, 1, 3, 2)], matrix[(env, 0, 2, 2)]), (0.0, 0.0), "these do not touch");
    }
}

/// A foot behind a fixed joint is a body of its own: it carries the robot, and the body that it is fused to nothing.
#[test]
fn fused_feet_report_their_own_contacts() {
    let files = tempfile::tempdir().unwrap();
    let ball = r#"<collision><geometry><sphere radius="0.05"/></geometry></collision>"#;
    let mut content = link("base", 4.0, 0.1, [0.0; 3], "");
    for (k, at) in [[0.2, 0.0, -0.3], [-0.1, 0.17, -0.3], [-0.1, -0.17, -0.3]].into_iter().enumerate() {
        content += &link(&format!("FOOT{k}"), 0.1, 1e-4, [0.0; 3], ball);
        content += &joint(&format!("fixed{k}"), "fixed", &format!("FOOT{k}"), at, "0 0 1");
    }
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let start =
        RobotCfg { init_pose: Pose::translation(0.0, 0.0, 0.35), ..robot(files.path(), "dog", &content, false) };
    let dog = sim.add_robot(start).unwrap();
    let watch = ContactSensorCfg { bodies: vec![".*FOOT.".into(), "dog/base".into()], ..Default::default() };
    let id = sim.add_sensor("feet", ContactSensorCfg { track_pose: true, ..watch }).unwrap();
    sim.update(1000);
    let sensor = sim.sensor(id).unwrap();
    assert_eq!(sensor.body_names(), ["dog/FOOT0", "dog/FOOT1", "dog/FOOT2", "dog/base"]);
    let net = sensor.net_forces_w();
    let weight = 4.3 * G;
    assert_near([(0..3).map(|foot| net[(0, foot, 2)]).sum::<f64>()], &[weight], 1e-3 * weight);
    assert!((0..3).all(|foot| net[(0, foot, 2)] > 0.2 * weight), "{net}");
    assert_eq!(net.index_axis(Axis(1), 3).iter().copied().collect::<Vec<_>>(), [0.0; 3]);
    let pose = sim.robot(dog).link_pose("FOOT1").unwrap();
    assert_eq!(sensor.pos_w().unwrap().index_axis(Axis(1), 1), pose.slice(kinetoscope::ndarray::s![.., ..3]));
}

/// A ball that falls from `z` is at `z - g dt² k (k + 1) / 2` after k steps (semi-implicit Euler), and touches in the first
/// step that begins below its radius: air times are exact to one step, at any period and for any number of steps at once.
#[test]
fn air_times_are_exact_to_one_step() {
    let (radius, height) = (0.1, 0.5);
    for (period, stride) in [(1_u32, 1_u32), (10, 1), (10, 7)] {
        let mut sim = SimulationManager::new(cfg(2)).unwrap();
        let dt = sim.cfg().physics_dt;
        let ball =
            RigidObjectCfg { shape: ObjectShape::Sphere { radius }, ..cube("ball", 1.0, 0.1, [0.0, 0.0, height]) };
        let ball = sim.add_rigid_object(ball).unwrap();
        let sampling = SamplingCfg::every(f64::from(period) * dt);
        let watch = ContactSensorCfg { track_air_time: true, sampling, ..ContactSensorCfg::of("ball") };
        let id = sim.add_sensor("contact", watch).unwrap();
        // Environment 1 stays far up.
        let up = array![[0.0, 0.0, 50.0, 1.0, 0.0, 0.0, 0.0]];
        sim.rigid_object_mut(ball).write_pose(&up, Some(&[EnvId(1)])).unwrap();
        let fall = |k: u32| height - G * dt * dt * f64::from(k) * f64::from(k + 1) / 2.0;
        let first = (0..).find(|&k| fall(k) < radius).unwrap();
        let mut told = Vec::new();
        let mut step = 0;
        while step < first + 30 {
            sim.update(stride);
            step += stride;
            let sensor = sim.sensor(id).unwrap();
            if sensor.first_contact().unwrap()[(0, 0)] {
                told.push(step);
                assert_eq!(sensor.last_air_time().unwrap()[(0, 0)], f64::from(first) * dt, "period {period}");
                let since = f64::from(step / period * period - first);
                assert_near(sensor.current_contact_time().unwrap().row(0).to_vec(), &[since * dt], 1e-12);
            }
            assert!(!sensor.first_contact().unwrap()[(1, 0)]);
            assert_eq!(sensor.current_contact_time().unwrap()[(1, 0)], 0.0, "environments are apart");
            assert_eq!(sensor.net_forces_w()[(1, 0, 2)], 0.0);
        }
        // The step that begins at `first` is told by the next measurement.
        let due = (first + 1).div_ceil(period) * period;
        let expected: Vec<u32> =
            (1..).map(|n| n * stride).take_while(|s| *s < due + period).filter(|s| *s >= due).collect();
        assert_eq!(told[..expected.len()], expected, "period {period}, stride {stride}, contact begins at {first}");
    }
}

/// Right after a write, forces are those of the state that was written, and so are their stamps.
#[test]
fn forces_after_a_write_belong_to_what_was_written() {
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    let box_ = sim.add_rigid_object(cube("box", 1.0, 0.2, [0.0, 0.0, 5.0])).unwrap();
    let id = sim.add_sensor("contact", ContactSensorCfg::of("box")).unwrap();
    sim.update(10);
    let stamps = |sim: &SimulationManager| {
        let sensor = sim.sensor(id).unwrap();
        (sensor.stamps().to_vec(), sensor.force_stamps().to_vec())
    };
    assert_near(stamps(&sim).1, &[0.045, 0.045], 1e-12);
    let down = array![[0.0, 0.0, 0.0995, 1.0, 0.0, 0.0, 0.0]];
    sim.rigid_object_mut(box_).write_pose(&down, Some(&[EnvId(1)])).unwrap();
    let written = sim.sensor(id).unwrap().net_forces_w().to_owned();
    assert!(written[(1, 0, 2)] > 1.0 && written[(0, 0, 2)] == 0.0, "{written}");
    assert_near(stamps(&sim).1, &[0.045, 0.05], 1e-12);
    // The next step solves the same state.
    sim.update(1);
    assert_eq!(sim.sensor(id).unwrap().net_forces_w()[(1, 0, 2)], written[(1, 0, 2)]);
    assert_near(stamps(&sim).1, &[0.05, 0.05], 1e-12);
    sim.reset(Some(&[EnvId(1)])).unwrap();
    assert_eq!(sim.sensor(id).unwrap().net_forces_w()[(1, 0, 2)], 0.0, "up again");
    assert_near(stamps(&sim).1, &[0.05, 0.0], 1e-12);
}

/// RK4 solves its steps in the middle of them; what sensors get is solved for their beginning, as with Euler.
#[test]
fn forces_of_rk4_are_those_of_the_beginning_of_the_step() {
    let first = |integrator| {
        let mut sim = SimulationManager::new(SimulationManagerCfg { integrator, ..cfg(1) }).unwrap();
        sim.add_rigid_object(cube("box", 2.0, 0.2, [0.0, 0.0, 0.0995])).unwrap();
        let id = sim.add_sensor("contact", ContactSensorCfg::of("box")).unwrap();
        sim.update(1);
        let sensor = sim.sensor(id).unwrap();
        (sensor.total_forces_w()[(0, 0, 2)], sensor.force_stamps()[0])
    };
    let (force, stamp) = first(Integrator::Rk4);
    assert!(force > 2.0 * G && stamp.abs() < 1e-15, "{force} N at {stamp} s");
    assert_eq!((force, stamp), first(Integrator::Euler));
}

/// An environment that is put aside measures nothing more until it is reset, and the others do not notice.
#[test]
fn a_diverged_environment_keeps_its_last_measurement() {
    let forces = |blow_up: bool| {
        let mut sim = SimulationManager::new(cfg(2)).unwrap();
        let box_ = sim.add_rigid_object(cube("box", 1.0, 0.2, [0.0, 0.0, 0.0995])).unwrap();
        let id = sim.add_sensor("contact", ContactSensorCfg::of("box")).unwrap();
        let imu = sim.add_sensor("imu", ImuCfg::on("box")).unwrap();
        sim.update(10);
        let before = sim.sensor(id).unwrap().net_forces_w()[(1, 0, 2)];
        if blow_up {
            let huge = array![[1e9, 0.0, 1e9, 1e9, 1e9, 1e9]];
            sim.rigid_object_mut(box_).write_velocity(&huge, Some(&[EnvId(1)])).unwrap();
        }
        let mut told = Vec::new();
        for _ in 0..40 {
            sim.update(1);
            told.push(sim.sensor(id).unwrap().net_forces_w()[(0, 0, 2)].to_bits());
            told.push(sim.sensor(imu).unwrap().lin_acc_b()[(0, 2)].to_bits());
        }
        assert_eq!(sim.diverged().len(), usize::from(blow_up));
        if blow_up {
            let values = |sim: &SimulationManager| {
                let (contact, imu) = (sim.sensor(id).unwrap(), sim.sensor(imu).unwrap());
                let numbers = contact.net_forces_w().index_axis_move(Axis(0), 1).iter().copied().collect::<Vec<f64>>();
                let imu = [imu.quat_w(), imu.lin_acc_b(), imu.lin_vel_b()];
                numbers
                    .into_iter()
                    .chain(imu.iter().flat_map(|a| a.row(1).to_vec()))
                    .map(f64::to_bits)
                    .collect::<Vec<_>>()
            };
            let last = values(&sim);
            assert!(last.iter().all(|bits| f64::from_bits(*bits).is_finite()));
            // Nor does a write to an environment that is put aside change what is read of it.
            sim.rigid_object_mut(box_).write_velocity(&array![[0.0; 6]], Some(&[EnvId(1)])).unwrap();
            assert_eq!(values(&sim), last, "the last measurement stays");
            let late = sim.add_sensor("late", ImuCfg::on("box")).unwrap();
            assert!(sim.sensor(late).unwrap().quat_w().iter().all(|q| q.is_finite()), "a sensor that comes later");
            let sensor = sim.sensor(id).unwrap();
            assert!(sensor.sample_counts()[1] < 50 && sensor.sample_counts()[0] == 50);
            sim.reset(Some(&[EnvId(1)])).unwrap();
            sim.update(10);
            assert_eq!(sim.sensor(id).unwrap().net_forces_w()[(1, 0, 2)], before, "alive again");
        }
        told
    };
    assert_eq!(forces(true), forces(false));
}
