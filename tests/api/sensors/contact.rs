//! Contact forces, points and times in a running simulation, against Newton's laws and closed forms.

use super::worlds::{G, ball, cfg, cube, fixed, pose_of_row, row, sim};
use kinetoscope::ndarray::{Array2, Array3, ArrayView2, Axis, array, s};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope::sim::{Integrator, RigidObjectId};
use kinetoscope_testkit::tolerance::{Tolerance, assert_close, assert_number};
use kinetoscope_testkit::worlds;
use nalgebra::Vector3;

const EXACT: Tolerance =
    Tolerance::absolute(1e-9, "rounding of tens of newtons, from velocities divided by the step of 5 ms");
/// Relative error of forces at rest. Contact dynamics decay with a time constant of 20 ms: e^-250 is left after five
/// seconds. The rest is the solver's tolerance of 1e-8.
const REST: Tolerance = Tolerance::absolute(1e-8, "the solver's, for forces of 1 N at rest");
/// Relative error of forces during a decaying motion, whose acceleration is below a thousandth of gravity.
const STILL: Tolerance = Tolerance::absolute(1e-3, "less than a thousandth of gravity is left, for forces of 1 N");
const SUM: Tolerance =
    Tolerance::absolute(1e-11, "rounding of 60 N in some hundred sums, and of velocities of 1e-2 m/s / 5 ms: 1e-12");
const STAMP: Tolerance = Tolerance::absolute(1e-12, "rounding of ten sums of the step");
/// Distance of contact points, which are in the middle of the overlap, from the face \[m\]. At rest MuJoCo's contact
/// has `d k r = (1 - d) g` with an impedance d of at least 0.9 and k = 0.9 / (0.95 * 0.02)² = 2490 /s²: r is 0.44 mm at
/// most, half of it 0.22 mm.
const OVERLAP: Tolerance = Tolerance::absolute(2.2e-4, "half of the overlap of a contact at rest");

fn strings(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_string()).collect()
}

fn velocity(sim: &SimulationManager, object: RigidObjectId) -> Vector3<f64> {
    row(&sim.rigid_object(object).velocity(), 0, 0)
}

/// In every step of a fall, a bounce and the rest after it, the contact force equals the change of momentum without
/// gravity, `m (dv / dt - g)`. At rest it is the weight.
#[test]
fn newtons_second_law() {
    let mut sim = sim(1);
    let (mass, dt) = (2.5, sim.cfg().physics_dt);
    let box_ = sim.add_rigid_object(cube("box", 0.2, mass, [0.0, 0.0, 0.3])).unwrap();
    let id = sim.add_sensor("contact", ContactSensorCfg::for_bodies("box")).unwrap();
    let mut before = velocity(&sim, box_);
    let (mut touched, mut flying) = (0, 0);
    for _ in 0..600 {
        sim.update(1);
        let after = velocity(&sim, box_);
        let expected = mass * ((after - before) / dt - Vector3::new(0.0, 0.0, -G));
        assert_close(
            "force of the contacts",
            sim.sensor(id).unwrap().total_forces_w(),
            expected.as_slice(),
            EXACT * 1e3,
        );
        touched += u32::from(expected.z > 1.0);
        flying += u32::from(expected.z.abs() < 1e-6);
        before = after;
    }
    assert!(touched > 300 && flying > 10, "{touched} steps with contact, {flying} without");
    // The remaining motion after two seconds is far below a thousandth of gravity.
    assert_close("weight at rest", sim.sensor(id).unwrap().net_forces_w(), [0.0, 0.0, mass * G], STILL * (mass * G));
}

fn pairs(bodies: &str, filters: &[&str]) -> ContactSensorCfg {
    let filters = strings(filters);
    ContactSensorCfg {
        filters,
        track_friction_forces: true,
        track_contact_points: true,
        ..ContactSensorCfg::for_bodies(bodies)
    }
}

/// A box of 1.5 kg on an inclined plank. The plank pushes with m g cos along its normal and m g sin up the slope, at
/// the center of the contact face. Control: a level plank, which has no friction force.
#[test]
fn leaning_plank() {
    for degrees in [20.0_f64, 0.0] {
        let mut sim = sim(2);
        let lean = from_xyz_rpy([0.0, 0.0, 1.0], [0.0, -degrees.to_radians(), 0.0]);
        let plank = fixed(worlds::object("plank", ObjectShape::Box { size: [2.0, 1.0, 0.1] }, [0.0; 3]));
        sim.add_rigid_object(RigidObjectCfg { init_pose: lean, ..plank }).unwrap();
        let on_top = lean * Pose::translation(0.3, -0.1, 0.05 + 0.1);
        let box_ = RigidObjectCfg { init_pose: on_top, ..cube("box", 0.2, 1.5, [0.0; 3]) };
        let box_ = sim.add_rigid_object(box_).unwrap();
        let id = sim.add_sensor("contact", pairs("box", &["plank", "ground"])).unwrap();
        sim.update(1000);
        let sensor = sim.sensor(id).unwrap();
        let counts = sensor.contact_count_matrix().unwrap();
        assert_eq!((counts[(0, 0, 1)], counts[(0, 0, 0)]), (0.0, counts[(1, 0, 0)]));
        let matrices = [sensor.force_matrix_w(), sensor.friction_matrix_w().unwrap()];
        let [normal_force, friction, point] =
            [matrices[0], matrices[1], sensor.contact_point_matrix_w().unwrap()].map(|matrix| {
                assert!(matrix.index_axis(Axis(2), 1).iter().all(|x| *x == 0.0), "the ground is a meter below");
                let plank = matrix.index_axis(Axis(2), 0);
                assert_eq!(plank.index_axis(Axis(0), 0), plank.index_axis(Axis(0), 1), "the same in both environments");
                Vector3::from_fn(|k, _| plank[(0, 0, k)])
            });
        let weight = 1.5 * G;
        if degrees == 0.0 {
            assert_close("normal force", &normal_force, [0.0, 0.0, weight], REST * weight);
            assert_number("friction", friction.norm(), 0.0, REST * weight);
            continue;
        }
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (normal, up_the_slope) = (Vector3::new(-sin, 0.0, cos), Vector3::new(cos, 0.0, sin));
        assert_close("normal force", &normal_force, (weight * cos * normal).as_slice(), REST * weight);
        assert_close("friction", &friction, (weight * sin * up_the_slope).as_slice(), REST * weight);
        assert_eq!(counts[(0, 0, 0)], 4.0, "the corners of the face");
        let pose = pose_of_row(&sim.rigid_object(box_).pose(), 0);
        let face = pose * nalgebra::Point3::new(0.0, 0.0, -0.1);
        assert_close("contact point", &point, face.coords.as_slice(), OVERLAP);
        assert!((point - pose.translation.vector).norm() > 0.09, "the control: not the middle of the box");
    }
}

fn vector(array: &Array3<f64>, a: usize, b: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| array[(a, b, k)])
}

/// Three stacked boxes under inclined gravity, with every pair measured. Actions and reactions are bit-identical, at
/// the same points. Normal force and friction together accelerate everything above, `m (dv / dt - g)`.
#[test]
fn action_and_reaction() {
    let (sin, cos) = 10.0_f64.to_radians().sin_cos();
    let gravity = G * Vector3::new(sin, 0.0, -cos);
    let mut sim = worlds::sim(SimulationManagerCfg { gravity, ..cfg(1) });
    let (masses, dt) = ([3.0, 2.0, 1.0], sim.cfg().physics_dt);
    let boxes = [0, 1, 2].map(|k| {
        let at = [0.0, 0.0, 0.1 + 0.2 * k as f64];
        sim.add_rigid_object(cube(&format!("box{k}"), 0.2, masses[k], at)).unwrap()
    });
    let id = sim.add_sensor("contact", pairs("box.", &["box0", "box1", "box2", "ground", "box."])).unwrap();
    sim.update(999);
    let before = boxes.map(|id| velocity(&sim, id));
    sim.update(1);
    let after = boxes.map(|id| velocity(&sim, id));
    let needed: Vec<Vector3<f64>> = (0..3).map(|k| masses[k] * ((after[k] - before[k]) / dt - gravity)).collect();
    let sensor = sim.sensor(id).unwrap();
    let matrices = [sensor.force_matrix_w(), sensor.friction_matrix_w().unwrap()];
    let [force, friction, points] = [matrices[0], matrices[1], sensor.contact_point_matrix_w().unwrap()]
        .map(|matrix| matrix.index_axis_move(Axis(0), 0).to_owned());
    let counts = sensor.contact_count_matrix().unwrap().index_axis_move(Axis(0), 0).to_owned();
    for a in 0..3 {
        for b in 0..3 {
            // The same sums of the same contacts, in the same order.
            assert_eq!(vector(&force, a, b), -vector(&force, b, a));
            assert_eq!(vector(&friction, a, b), -vector(&friction, b, a));
            assert_eq!((vector(&points, a, b), counts[(a, b)]), (vector(&points, b, a), counts[(b, a)]));
        }
        let below = if a == 0 { 3 } else { a - 1 };
        let above = needed[a..].iter().sum::<Vector3<f64>>();
        let both = vector(&force, a, below) + vector(&friction, a, below);
        assert_close("force on what is above", &both, above.as_slice(), SUM);
        assert_close("total force", sensor.total_forces_w().slice(s![0, a, ..]), needed[a].as_slice(), SUM);
        let others = (0..3).map(|b| vector(&force, a, b)).sum::<Vector3<f64>>();
        assert_close("sum of the boxes", &vector(&force, a, 4), others.as_slice(), EXACT * 1e2);
        // Up the slope, which is -x. The stack still rocks a little. The bound contains the acceleration of the boxes
        // and the tilt of their faces, which rotates normal forces; it is a twentieth of the weight component at most.
        let weight: f64 = masses[a..].iter().sum::<f64>() * G;
        let rocking = (above + weight / G * gravity).x.abs() + force[(a, below, 0)].abs();
        assert!(rocking < 0.05 * weight * sin, "{rocking} of {weight}");
        let limit = Tolerance::absolute(rocking + 1e-11, "what the stack still rocks");
        assert_number("friction", friction[(a, below, 0)], -weight * sin, limit);
        let at = vector(&points, a, below) - row(&sim.rigid_object(boxes[a]).pose(), 0, 0);
        // The load on a contact is up to (1/3 + 1/2) * 3 = 2.5 times that of one box alone.
        assert!((at.z + 0.1).abs() < 2.5 * OVERLAP.absolute && at.x.abs() < 0.1 && at.y.abs() < 0.1, "{at}");
        let net = sensor.friction_forces_w();
        let all = vector(&friction, a, 3) + vector(&friction, a, 4);
        let limit = Tolerance::absolute(1e-9, "rounding of forces of tens of newtons");
        assert_close("sum of the pairs", net.slice(s![0, a, ..]), all.as_slice(), limit);
        assert!((net[(0, a, 0)] - friction[(a, below, 0)]).abs() > 1.0 || a == 2, "the control: a pair is not the sum");
    }
    for (a, b) in [(0, 2), (1, 3)] {
        let none = Vector3::zeros();
        assert_eq!((counts[(a, b)], vector(&force, a, b), vector(&points, a, b)), (0.0, none, none), "no contact");
    }
}

/// Right after a write, forces and their stamps are those of the written state.
#[test]
fn forces_after_a_write() {
    let mut sim = sim(2);
    let box_ = sim.add_rigid_object(cube("box", 0.2, 1.0, [0.0, 0.0, 5.0])).unwrap();
    let id = sim.add_sensor("contact", ContactSensorCfg::for_bodies("box")).unwrap();
    let stamps = |sim: &SimulationManager| sim.sensor(id).unwrap().force_stamps().to_owned();
    sim.update(10);
    assert_close("stamps of the steps", stamps(&sim), [0.045, 0.045], STAMP);
    let down = array![[0.0, 0.0, 0.0995, 1.0, 0.0, 0.0, 0.0]];
    sim.rigid_object_mut(box_).write_pose(&down, Some(&[EnvId(1)])).unwrap();
    let written = sim.sensor(id).unwrap().net_forces_w().to_owned();
    assert!(written[(1, 0, 2)] > 1.0 && written[(0, 0, 2)] == 0.0, "{written}");
    assert_close("stamps after the write", stamps(&sim), [0.045, 0.05], STAMP);
    // The next step solves the same state.
    sim.update(1);
    assert_eq!(sim.sensor(id).unwrap().net_forces_w()[(1, 0, 2)], written[(1, 0, 2)]);
    assert_close("stamps after the step", stamps(&sim), [0.05, 0.05], STAMP);
    sim.reset(Some(&[EnvId(1)])).unwrap();
    assert_eq!(sim.sensor(id).unwrap().net_forces_w()[(1, 0, 2)], 0.0, "up again");
    assert_close("stamps after the reset", stamps(&sim), [0.05, 0.0], STAMP);
}

/// RK4 solves within its steps; sensors get forces solved for the beginning of the step, as with Euler.
#[test]
fn forces_of_rk4() {
    let first = |integrator| {
        let mut sim = worlds::sim(SimulationManagerCfg { integrator, ..cfg(1) });
        sim.add_rigid_object(cube("box", 0.2, 2.0, [0.0, 0.0, 0.0995])).unwrap();
        let id = sim.add_sensor("contact", ContactSensorCfg::for_bodies("box")).unwrap();
        sim.update(1);
        let sensor = sim.sensor(id).unwrap();
        (sensor.total_forces_w()[(0, 0, 2)], sensor.force_stamps()[0])
    };
    let (force, stamp) = first(Integrator::Rk4);
    assert!(force > 2.0 * G && stamp.abs() < 1e-15, "{force} N at {stamp} s");
    assert_eq!((force, stamp), first(Integrator::Euler));
}

/// A diverged environment keeps its last measurement until it is reset, without an effect on the other environments.
#[test]
fn diverged_environment() {
    let forces = |diverge: bool| {
        let mut sim = sim(2);
        let box_ = sim.add_rigid_object(cube("box", 0.2, 1.0, [0.0, 0.0, 0.0995])).unwrap();
        let id = sim.add_sensor("contact", ContactSensorCfg::for_bodies("box")).unwrap();
        let imu = sim.add_sensor("imu", ImuCfg::on("box")).unwrap();
        sim.update(10);
        let before = sim.sensor(id).unwrap().net_forces_w()[(1, 0, 2)];
        if diverge {
            let huge = array![[1e9, 0.0, 1e9, 1e9, 1e9, 1e9]];
            sim.rigid_object_mut(box_).write_velocity(&huge, Some(&[EnvId(1)])).unwrap();
        }
        let mut readings = Vec::new();
        for _ in 0..40 {
            sim.update(1);
            readings.push(sim.sensor(id).unwrap().net_forces_w()[(0, 0, 2)].to_bits());
            readings.push(sim.sensor(imu).unwrap().lin_acc_b()[(0, 2)].to_bits());
        }
        assert_eq!(sim.diverged().len(), usize::from(diverge));
        if diverge {
            let values = |sim: &SimulationManager| {
                let (contact, imu) = (sim.sensor(id).unwrap(), sim.sensor(imu).unwrap());
                let mut values: Vec<f64> = contact.net_forces_w().index_axis(Axis(0), 1).iter().copied().collect();
                for readings in [imu.quat_w(), imu.lin_acc_b(), imu.lin_vel_b()] {
                    values.extend(readings.row(1));
                }
                values
            };
            let last = values(&sim);
            assert!(last.iter().all(|value| value.is_finite()));
            // A write to a diverged environment does not change its readings either.
            sim.rigid_object_mut(box_).write_velocity(&array![[0.0; 6]], Some(&[EnvId(1)])).unwrap();
            kinetoscope_testkit::bits::assert_same_bits("the last measurement", &values(&sim), &last);
            let late = sim.add_sensor("late", ImuCfg::on("box")).unwrap();
            assert!(sim.sensor(late).unwrap().quat_w().iter().all(|q| q.is_finite()), "a sensor that comes later");
            let sensor = sim.sensor(id).unwrap();
            assert!(sensor.sample_counts()[1] < 50 && sensor.sample_counts()[0] == 50);
            sim.reset(Some(&[EnvId(1)])).unwrap();
            sim.update(10);
            assert_eq!(sim.sensor(id).unwrap().net_forces_w()[(1, 0, 2)], before, "alive again");
        }
        readings
    };
    assert_eq!(forces(true), forces(false));
}

/// A history holds the measurements since the reset of its environment, newest first, and zeros after them.
#[test]
fn history_and_reset() {
    const T: usize = 4;
    let mut sim = sim(3);
    sim.add_rigid_object(cube("box", 0.2, 2.0, [0.0, 0.0, 0.0995])).unwrap();
    let sampling = SamplingCfg { history_length: T, ..SamplingCfg::every(0.01) };
    let watch = ContactSensorCfg { sampling, filters: strings(&["ground"]), ..ContactSensorCfg::for_bodies("box") };
    let id = sim.add_sensor("contact", watch).unwrap();
    // Vertical forces and stamps since the reset, newest first.
    let mut expected: [Vec<(f64, f64)>; 3] = Default::default();
    let check = |sim: &SimulationManager, told: &[Vec<(f64, f64)>; 3]| {
        let sensor = sim.sensor(id).unwrap();
        let (net, pairs) = (sensor.net_forces_w_history(), sensor.force_matrix_w_history());
        for (env, told) in told.iter().enumerate() {
            assert_eq!(sensor.history_filled(env), told.len().min(T));
            for age in 0..T {
                let (force, stamp) = told.get(age).copied().unwrap_or_default();
                let found = [net[(env, age, 0, 2)], pairs[(env, age, 0, 0, 2)], sensor.stamp_history()[(env, age)]];
                assert_eq!(found, [force, force, stamp], "environment {env}, age {age}");
            }
        }
    };
    for step in 1..=40 {
        sim.update(1);
        let sensor = sim.sensor(id).unwrap();
        for (env, told) in expected.iter_mut().enumerate() {
            if sensor.sample_counts()[env] as usize > told.len() {
                told.insert(0, (sensor.net_forces_w()[(env, 0, 2)], sensor.stamps()[env]));
            }
        }
        check(&sim, &expected);
        // A reset in the middle of a period, then a reset of two other environments.
        let reset: &[EnvId] = match step {
            13 => &[EnvId(1)],
            26 => &[EnvId(2), EnvId(0)],
            _ => continue,
        };
        sim.reset(Some(reset)).unwrap();
        reset.iter().for_each(|env| expected[env.0].clear());
        check(&sim, &expected);
    }
    assert_eq!(expected.each_ref().map(Vec::len), [7, 13, 7], "27 steps since a reset are 13 periods, 14 are 7");
    assert!(expected[1].iter().all(|(force, _)| *force > G), "there was something to remember");
}

/// Two balls bounce from different heights. A fall from `z` is at `z - g dt² k (k + 1) / 2` after k steps
/// (semi-implicit Euler), and touches in the first step that begins below the radius. After that the reference is
/// Newton's law: the ground pushed in the steps that changed the velocity more than gravity does. Times of all phases
/// in the air and on the ground are exact to the step, at any period and stride, and every beginning is reported once.
#[test]
fn bounces() {
    let heights = [0.6, 0.9];
    for (period, stride) in [(1_u32, 1_u32), (5, 1), (5, 3), (10, 1), (10, 7)] {
        let world = || {
            let mut sim = sim(2);
            let ball = RigidObjectCfg { restitution: Some(0.8), ..ball("ball", 0.1, 1.0, [0.0, 0.0, heights[0]]) };
            let ball = sim.add_rigid_object(ball).unwrap();
            let up = array![[0.0, 0.0, heights[1], 1.0, 0.0, 0.0, 0.0]];
            sim.rigid_object_mut(ball).write_pose(&up, Some(&[EnvId(1)])).unwrap();
            (sim, ball)
        };
        // Reference: the same world without a sensor, step by step.
        let ((mut sim, ball), (mut reference, other)) = (world(), world());
        let dt = sim.cfg().physics_dt;
        let sampling = SamplingCfg::every(f64::from(period) * dt);
        let watch = ContactSensorCfg { track_air_time: true, sampling, ..ContactSensorCfg::for_bodies("ball") };
        let id = sim.add_sensor("contact", watch).unwrap();
        let first = heights.map(|height| {
            let fall = |k: u32| height - G * dt * dt * f64::from(k) * f64::from(k + 1) / 2.0;
            (0..).find(|&k| fall(k) < 0.1).unwrap()
        });
        let mut speed: Array2<f64> = Array2::zeros((2, 6));
        // For each environment: contact flag, steps since its last change, and the lengths of finished phases \[air,
        // contact\].
        let mut phases = [(false, 0_u32, [0_u32; 2]); 2];
        let mut measured = phases;
        let (mut begun, mut reported) = ([[0_u32; 2]; 2], [[0_u32; 2]; 2]);
        let (mut reported_at, mut step) = ([const { Vec::new() }; 2], 0_u32);
        while step < 600 {
            sim.update(stride);
            for _ in 0..stride {
                step += 1;
                reference.update(1);
                let now = reference.rigid_object(other).velocity();
                for (env, (touches, since, last)) in phases.iter_mut().enumerate() {
                    // One newton on one kilogram.
                    let pushed = (now[(env, 2)] - speed[(env, 2)]) / dt + G > 1.0;
                    if pushed != *touches {
                        assert!(begun[env] != [0; 2] || *since == first[env], "{since} steps of fall, not {first:?}");
                        last[usize::from(*touches)] = *since;
                        begun[env][usize::from(pushed)] += 1;
                        (*touches, *since) = (pushed, 0);
                    }
                    *since += 1;
                }
                speed = now;
                if step.is_multiple_of(period) {
                    measured = phases;
                }
            }
            let sensor = sim.sensor(id).unwrap();
            assert_eq!(sim.rigid_object(ball).velocity(), speed, "the same motion");
            let flags = [sensor.first_air().unwrap(), sensor.first_contact().unwrap()];
            for env in 0..2 {
                let (touches, since, last) = measured[env];
                let [air, contact] = if touches { [0, since] } else { [since, 0] };
                let at = |times: Option<ArrayView2<'_, f64>>| times.unwrap()[(env, 0)];
                let found = [sensor.current_air_time(), sensor.current_contact_time()].map(at);
                assert_eq!(found, [air, contact].map(|n| f64::from(n) * dt), "step {step}");
                let found = [sensor.last_air_time(), sensor.last_contact_time()].map(at);
                assert_eq!(found, last.map(|n| f64::from(n) * dt), "step {step}");
                if flags[1][(env, 0)] {
                    reported_at[env].push(step);
                }
                if step.is_multiple_of(period) {
                    (0..2).for_each(|kind| reported[env][kind] += u32::from(flags[kind][(env, 0)]));
                }
            }
        }
        for env in 0..2 {
            assert!(begun[env][1] > 3, "it bounces: {begun:?}");
            // Each beginning is reported once. Several within one period are reported together; some are reported
            // between strides.
            if (period, stride) == (1, 1) {
                assert_eq!(reported[env], begun[env]);
            } else if (period, stride) == (5, 1) {
                assert!(reported[env][1] > 3 && reported[env][1] <= begun[env][1], "{reported:?} of {begun:?}");
            }
            // The step that begins at `first` is reported by the next measurement, until the one after it.
            let due = (first[env] + 1).div_ceil(period) * period;
            let expected: Vec<u32> =
                (1..).map(|n| n * stride).take_while(|s| *s < due + period).filter(|s| *s >= due).collect();
            assert_eq!(reported_at[env][..expected.len()], expected, "period {period}, stride {stride}");
        }
        let last = sim.sensor(id).unwrap().last_air_time().unwrap();
        assert_ne!(last[(0, 0)], last[(1, 0)], "the control: environments bounce differently");
    }
}
