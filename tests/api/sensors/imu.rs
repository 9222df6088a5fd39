//! Accelerations against closed forms and against the change of the velocities.

use crate::sensors::worlds::{G, assert_near, cfg, cube, joint, link, robot, row};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use nalgebra::{UnitQuaternion, Vector3};

/// Rounding of velocities divided by the step of 5 ms.
const EXACT: f64 = 1e-9;

fn quat(values: &Array2<f64>, env: usize) -> UnitQuaternion<f64> {
    kinetoscope::scene::pose::from_wxyz(std::array::from_fn(|k| values[(env, k)]))
}

/// Nothing in free fall, gravity upwards at rest: the first with the engine's solver between, the second without.
#[test]
fn free_fall_reads_nothing_and_rest_reads_gravity() {
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    sim.add_rigid_object(cube("falls", 1.0, 0.1, [0.0, 0.0, 50.0])).unwrap();
    let tilt = UnitQuaternion::from_euler_angles(0.3, -0.8, 2.0);
    let stands = RigidObjectCfg {
        body_type: BodyType::Static,
        init_pose: Pose::from_parts([3.0, 0.0, 1.0].into(), tilt),
        ..cube("stands", 1.0, 0.1, [0.0; 3])
    };
    sim.add_rigid_object(stands).unwrap();
    let falls = sim.add_sensor("a", ImuCfg::on("falls")).unwrap();
    let stands = sim.add_sensor("b", ImuCfg::on("stands")).unwrap();
    let bare = ImuCfg { gravity_bias: Some(Vector3::zeros()), ..ImuCfg::on("falls") };
    let bare = sim.add_sensor("c", bare).unwrap();
    for _ in 0..20 {
        assert_near(sim.sensor(falls).unwrap().lin_acc_b().to_owned(), &[0.0; 3], EXACT);
        assert_near(sim.sensor(bare).unwrap().lin_acc_b().to_owned(), &[0.0, 0.0, -G], EXACT);
        let up = tilt.inverse() * Vector3::new(0.0, 0.0, G);
        assert_near(sim.sensor(stands).unwrap().lin_acc_b().to_owned(), up.as_slice(), EXACT);
        sim.update(1);
    }
}

/// A table that a constant torque spins up, with a tip behind a fixed joint: at every instant the acceleration at radius r is
/// `alpha r` along the way and `omega² r` inwards.
#[test]
fn a_turntable_pulls_inwards_with_omega_squared_r() {
    let files = tempfile::tempdir().unwrap();
    let mut content = link("base", 1.0, 0.1, [0.0; 3], "") + &link("table", 2.0, 0.05, [0.0; 3], "");
    content += &joint("turn", "continuous", "table", [0.0, 0.0, 1.0], "0 0 1");
    content += &link("tip", 0.1, 1e-4, [0.0; 3], "");
    content += &joint("tip_fixed", "fixed", "tip", [0.4, 0.0, 0.2], "0 0 1")
        .replace("<parent link=\"base\"/>", "<parent link=\"table\"/>");
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    let table = sim.add_robot(robot(files.path(), "table", &content, true)).unwrap();
    let dt = sim.cfg().physics_dt;
    // At the tip; and 0.1 m further out, with its x axis along the way.
    let tip = sim.add_sensor("tip", ImuCfg::on("tip")).unwrap();
    let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    let offset = Pose::from_parts([0.1, 0.0, 0.0].into(), turned);
    let out = sim.add_sensor("out", ImuCfg { offset, ..ImuCfg::on("table/tip") }).unwrap();
    sim.robot_mut(table).set_qf(&array![[0.3], [-0.2]], None, None).unwrap();
    let mut before = sim.robot(table).get_qvel();
    for _ in 0..400 {
        sim.update(1);
        let after = sim.robot(table).get_qvel();
        for env in 0..2 {
            // What the sensor saw is the beginning of the step.
            let (omega, alpha) = (before[(env, 0)], (after[(env, 0)] - before[(env, 0)]) / dt);
            let at = |imu: &Imu| imu.lin_acc_b().row(env).to_vec();
            assert_near(at(sim.sensor(tip).unwrap()), &[-omega * omega * 0.4, alpha * 0.4, G], 1e2 * EXACT);
            assert_near(at(sim.sensor(out).unwrap()), &[alpha * 0.5, omega * omega * 0.5, G], 1e2 * EXACT);
            let imu = sim.sensor(out).unwrap();
            assert_near(imu.ang_vel_b().row(env).to_vec(), &[0.0, 0.0, omega], EXACT);
            assert_near(imu.lin_vel_b().row(env).to_vec(), &[omega * 0.5, 0.0, 0.0], EXACT);
            assert_near(imu.ang_acc_b().row(env).to_vec(), &[0.0, 0.0, alpha], EXACT);
        }
        before = after;
    }
    assert!(before[(0, 0)] > 5.0, "it turned: {before}");
}

/// A box that tumbles freely, seen from a corner: the acceleration there is `g + alpha x r + omega x (omega x r)`, with alpha
/// from the change of the angular velocity in the axes of the body, which is what MuJoCo integrates.
#[test]
fn a_tumbling_corner_feels_the_rotation() {
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let shape = ObjectShape::Box { size: [0.2, 0.4, 0.8] };
    let object = sim.add_rigid_object(RigidObjectCfg { shape, ..cube("box", 2.0, 0.1, [0.0, 0.0, 90.0]) }).unwrap();
    let corner = Vector3::new(0.1, -0.2, 0.4);
    let offset = Pose::from_parts(corner.into(), UnitQuaternion::from_euler_angles(0.4, 0.5, -1.0));
    let id = sim.add_sensor("imu", ImuCfg { offset, ..ImuCfg::on("box") }).unwrap();
    let velocity = array![[0.3, -0.1, 0.2, 3.0, 5.0, -4.0]];
    sim.rigid_object_mut(object).write_velocity(&velocity, None).unwrap();
    let dt = sim.cfg().physics_dt;
    let rotation = |sim: &SimulationManager| {
        let pose = sim.rigid_object(object).get_pose();
        kinetoscope::scene::pose::from_wxyz(std::array::from_fn(|k| pose[(0, 3 + k)]))
    };
    for _ in 0..100 {
        let (world_from_body, v) = (rotation(&sim), sim.rigid_object(object).get_velocity());
        sim.update(1);
        let omega = world_from_body.inverse() * row(&v, 0, 3);
        let next = rotation(&sim).inverse() * row(&sim.rigid_object(object).get_velocity(), 0, 3);
        let alpha = (next - omega) / dt;
        // In free fall the reading is the rotation's part alone.
        let expected = alpha.cross(&corner) + omega.cross(&omega.cross(&corner));
        let imu = sim.sensor(id).unwrap();
        let in_imu = |v: Vector3<f64>| offset.rotation.inverse() * v;
        assert_near(imu.lin_acc_b().to_owned(), in_imu(expected).as_slice(), 1e3 * EXACT);
        assert_near(imu.ang_vel_b().to_owned(), in_imu(omega).as_slice(), 1e2 * EXACT);
        assert_near(imu.ang_acc_b().to_owned(), in_imu(alpha).as_slice(), 1e3 * EXACT);
        assert!(quat(&imu.quat_w().to_owned(), 0).angle_to(&(world_from_body * offset.rotation)) < 1e-7);
    }
}

/// With a period of many steps and over a reset, what is read is still the acceleration of one instant.
#[test]
fn neither_period_nor_reset_shows_in_an_acceleration() {
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let object = sim.add_rigid_object(cube("box", 1.0, 0.1, [0.0, 0.0, 50.0])).unwrap();
    let slow = ImuCfg { sampling: SamplingCfg::every(0.1), ..ImuCfg::on("box") };
    let id = sim.add_sensor("imu", slow).unwrap();
    for _ in 0..3 {
        sim.update(33);
        assert_near(sim.sensor(id).unwrap().lin_acc_b().to_owned(), &[0.0; 3], EXACT);
        sim.reset(None).unwrap();
        assert_near(sim.sensor(id).unwrap().lin_acc_b().to_owned(), &[0.0; 3], EXACT);
        assert_eq!(sim.sensor(id).unwrap().quat_w().row(0).to_vec(), [1.0, 0.0, 0.0, 0.0]);
        sim.rigid_object_mut(object).write_velocity(&array![[9.0, 0.0, 0.0, 0.0, 0.0, 0.0]], None).unwrap();
        assert_near(sim.sensor(id).unwrap().lin_acc_b().to_owned(), &[0.0; 3], EXACT);
        assert_near(sim.sensor(id).unwrap().lin_vel_b().to_owned(), &[9.0, 0.0, 0.0], EXACT);
    }
}
