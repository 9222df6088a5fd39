//! Accelerations against closed forms and against the change of the velocities. For a turntable and a pendulum with a
//! sensor on a fused link see the laws of `physics::contacts`.

use super::worlds::{G, cube, fixed, pose_of_row, row, sim};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sensors::Imu;
use kinetoscope_testkit::tolerance::{Tolerance, assert_close};
use nalgebra::{UnitQuaternion, Vector3};

const EXACT: Tolerance = Tolerance::absolute(1e-9, "rounding of velocities divided by the step of 5 ms");

/// Zero in free fall, gravity upward at rest.
#[test]
fn free_fall_and_rest() {
    let mut sim = sim(1);
    sim.add_rigid_object(cube("falls", 0.1, 1.0, [0.0, 0.0, 50.0])).unwrap();
    let tilt = UnitQuaternion::from_euler_angles(0.3, -0.8, 2.0);
    let init_pose = Pose::from_parts([3.0, 0.0, 1.0].into(), tilt);
    sim.add_rigid_object(RigidObjectCfg { init_pose, ..fixed(cube("stands", 0.1, 1.0, [0.0; 3])) }).unwrap();
    let bare = ImuCfg { gravity_bias: Some(Vector3::zeros()), ..ImuCfg::on("falls") };
    let ids = [ImuCfg::on("falls"), bare, ImuCfg::on("stands")]
        .map(|cfg| sim.add_sensor(format!("imu {}", sim.entities().sensor_ids::<Imu>().len()), cfg).unwrap());
    let up = tilt.inverse() * Vector3::new(0.0, 0.0, G);
    for _ in 0..20 {
        for (id, expected) in ids.iter().zip([[0.0; 3], [0.0, 0.0, -G], up.into()]) {
            assert_close("linear acceleration", sim.sensor(*id).unwrap().lin_acc_b(), expected, EXACT);
        }
        sim.update(1);
    }
}

/// A freely tumbling box, measured at a corner: the acceleration is `alpha x r + omega x (omega x r)`. Alpha comes from
/// the change of the angular velocity in the axes of the body, which MuJoCo integrates.
#[test]
fn tumbling_corner() {
    let mut sim = sim(1);
    let shape = ObjectShape::Box { size: [0.2, 0.4, 0.8] };
    let object = sim.add_rigid_object(RigidObjectCfg { shape, ..cube("box", 0.1, 2.0, [0.0, 0.0, 90.0]) }).unwrap();
    let corner = Vector3::new(0.1, -0.2, 0.4);
    let offset = Pose::from_parts(corner.into(), UnitQuaternion::from_euler_angles(0.4, 0.5, -1.0));
    let id = sim.add_sensor("imu", ImuCfg { offset, ..ImuCfg::on("box") }).unwrap();
    sim.rigid_object_mut(object).write_velocity(&array![[0.3, -0.1, 0.2, 3.0, 5.0, -4.0]], None).unwrap();
    let dt = sim.cfg().physics_dt;
    let rotation = |sim: &SimulationManager| pose_of_row(&sim.rigid_object(object).pose(), 0).rotation;
    let spin = |sim: &SimulationManager| row(&sim.rigid_object(object).velocity(), 0, 3);
    for _ in 0..100 {
        let world_from_body = rotation(&sim);
        let omega = world_from_body.inverse() * spin(&sim);
        sim.update(1);
        let alpha = (rotation(&sim).inverse() * spin(&sim) - omega) / dt;
        let expected = alpha.cross(&corner) + omega.cross(&omega.cross(&corner));
        let imu = sim.sensor(id).unwrap();
        let in_imu = |v: Vector3<f64>| offset.rotation.inverse() * v;
        assert_close("linear acceleration", imu.lin_acc_b(), in_imu(expected).as_slice(), EXACT * 1e3);
        assert_close("angular velocity", imu.ang_vel_b(), in_imu(omega).as_slice(), EXACT * 1e2);
        assert_close("angular acceleration", imu.ang_acc_b(), in_imu(alpha).as_slice(), EXACT * 1e3);
        let found = kinetoscope::scene::pose::from_wxyz(std::array::from_fn(|k| imu.quat_w()[(0, k)]));
        assert!(found.angle_to(&(world_from_body * offset.rotation)) < 1e-7);
    }
}

/// With a period of many steps, and over a reset, the reading is the acceleration of one step.
#[test]
fn period_and_reset() {
    let mut sim = sim(1);
    let object = sim.add_rigid_object(cube("box", 0.1, 1.0, [0.0, 0.0, 50.0])).unwrap();
    let slow = ImuCfg { sampling: SamplingCfg::every(0.1), ..ImuCfg::on("box") };
    let id = sim.add_sensor("imu", slow).unwrap();
    let falls = |sim: &SimulationManager| {
        assert_close("acceleration in free fall", sim.sensor(id).unwrap().lin_acc_b(), [0.0; 3], EXACT)
    };
    for _ in 0..3 {
        sim.update(33);
        falls(&sim);
        sim.reset(None).unwrap();
        falls(&sim);
        assert_eq!(sim.sensor(id).unwrap().quat_w().row(0).to_vec(), [1.0, 0.0, 0.0, 0.0]);
        sim.rigid_object_mut(object).write_velocity(&array![[9.0, 0.0, 0.0, 0.0, 0.0, 0.0]], None).unwrap();
        falls(&sim);
        assert_close("velocity", sim.sensor(id).unwrap().lin_vel_b(), [9.0, 0.0, 0.0], EXACT);
    }
}
