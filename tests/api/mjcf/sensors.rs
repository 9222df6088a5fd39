//! Sensors of parts: MuJoCo's own, joints and actuators, wrenches and frames, compared with MuJoCo and closed forms.

use super::*;
use kinetoscope::mujoco::{ObjectKind, Overflow};
use kinetoscope::ndarray::{Array2, ArrayView3, Axis, array};
use kinetoscope::scene::pose::{from_row, from_xyz_rpy};
use kinetoscope::sensors::camera::CameraConvention;
use kinetoscope::sensors::{
    ActuatorStateCfg, FrameTransformerCfg, JointStateCfg, JointWrenchCfg, MujocoSensor, MujocoSensorCfg, TargetFrameCfg,
};
use kinetoscope::sim::MjcfId;
use kinetoscope_testkit::bits::bits;
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::tolerance::{Tolerance, assert_close};
use kinetoscope_testkit::worlds::{count_diagnostics, pose_of_row, sr5};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// A machine with all of MuJoCo's sensors.
fn sensing(num_envs: usize) -> (SimulationManager, MjcfId, SensorId<MujocoSensor>) {
    let (mut sim, part) = with(num_envs, MACHINE);
    let id = sim.add_sensor("all", MujocoSensorCfg::default()).unwrap();
    (sim, part, id)
}

fn roomy(sim: &SimulationManager, ctrl: &[f64]) -> Data {
    let buffers = sim.batch().read(0, |env| env.data().model().buffers());
    let buffers = buffers.enlarged(Overflow::Contacts).enlarged(Overflow::Constraints);
    let mut data = Data::new(&sim.batch().model().with_buffers(buffers)).unwrap();
    data.ctrl_mut().copy_from_slice(ctrl);
    data
}

/// `mj_step` leaves all sensors at the state before the step; here positions and velocities are of the state after it.
/// Stepped in parallel, every value has the same bits: solved values equal those of this `mj_step`, the others those of
/// the next.
#[test]
fn bit_for_bit() {
    const STEPS: usize = 200;
    let controls = array![[0.4, -0.3, 0.8], [0.1, 0.2, 0.3]];
    let (mut sim, part, id) = sensing(2);
    sim.mjcf_part_mut(part).set_ctrl(&controls, None, None).unwrap();
    assert_eq!(sim.sensor(id).unwrap().names().len(), 19);
    let mut plain: Vec<Data> = controls.rows().into_iter().map(|row| roomy(&sim, row.as_slice().unwrap())).collect();
    plain.iter_mut().for_each(|data| data.step().unwrap());
    let (mut checked, mut differs) = ([0, 0], 0);
    for step in 0..STEPS {
        sim.update(1);
        let sensor = sim.sensor(id).unwrap();
        for (env, data) in plain.iter_mut().enumerate() {
            assert!((sensor.stamps()[env] - sensor.force_stamps()[env] - 0.002).abs() < 1e-12);
            let then = data.sensordata().to_vec();
            data.step().unwrap();
            let now = data.sensordata();
            for (one, name) in sensor.sensors().iter().zip(sensor.names()) {
                let range = one.first..one.first + one.width;
                let (expected, other) = if one.force_stage { (&then[..], now) } else { (now, &then[..]) };
                let values: Vec<f64> = sensor.columns_of(name).unwrap().map(|c| sensor.values()[(env, c)]).collect();
                let expected = &expected[range.clone()];
                assert_eq!(bits(&values), bits(expected), "{name} after {step}: {values:?} {expected:?}");
                checked[usize::from(one.force_stage)] += 1;
                differs += usize::from(bits(&values) != bits(&other[range]));
            }
        }
    }
    assert!(checked[0] > 10 * STEPS && checked[1] > 10 * STEPS, "{checked:?}");
    // The values of the other time differ, so the comparison can fail.
    assert!(differs > 20 * STEPS, "{differs} of {checked:?}");
}

/// A write refreshes all sensors at once, including force sensors.
#[test]
fn after_a_write() {
    let (mut sim, part, id) = sensing(2);
    let at_start = sim.sensor(id).unwrap().values().to_owned();
    let mut plain = roomy(&sim, &[0.0; 3]);
    plain.forward().unwrap();
    assert_eq!(bits(at_start.row(0)), bits(plain.sensordata()), "before any step");
    sim.update(40);
    let (mut qpos, qvel) = (sim.mjcf_part(part).qpos(), sim.mjcf_part(part).qvel());
    qpos[(1, 0)] += 0.3;
    let before = sim.sensor(id).unwrap().value("angle").unwrap()[(1, 0)];
    sim.mjcf_part_mut(part).write_qpos(&qpos, None).unwrap();
    let sensor = sim.sensor(id).unwrap();
    for env in 0..2 {
        assert_eq!(sensor.stamps()[env], sensor.force_stamps()[env]);
        plain.qpos_mut().copy_from_slice(&qpos.row(env).to_vec());
        plain.qvel_mut().copy_from_slice(&qvel.row(env).to_vec());
        sim.batch().read(env, |env| {
            plain.act_mut().copy_from_slice(env.data().act());
            plain.qacc_warmstart_mut().copy_from_slice(env.data().qacc_warmstart());
            plain.set_time(env.data().time());
        });
        plain.forward().unwrap();
        // Quaternions are normalized once more: the last bits of positions, times the stiffest contact (1e6 N/m).
        for (value, expected) in sensor.values().row(env).iter().zip(plain.sensordata()) {
            assert!((value - expected).abs() <= 1e-9 * expected.abs().max(1.0), "{value} is not {expected}");
        }
    }
    assert!((sensor.value("angle").unwrap()[(1, 0)] - before - 0.3).abs() < 1e-9);
    sim.reset(Some(&[EnvId(1)])).unwrap();
    assert_eq!(sim.sensor(id).unwrap().values().row(1), at_start.row(1));
}

/// Names, dimensions and units are those of the types.
#[test]
fn names_and_units() {
    let (mut sim, _) = with(1, MACHINE);
    let patterns = ["acc", "touch", "angle", "speed", "turn", "length", "sensor13", "clock"];
    let named = |names: &[&str]| MujocoSensorCfg {
        sensors: Some(names.iter().map(|&name| name.into()).collect()),
        ..Default::default()
    };
    let id = sim.add_sensor("some", named(&patterns)).unwrap();
    let sensor = sim.sensor(id).unwrap();
    assert_eq!(sensor.names()[6], "m/sensor13", "one without a name");
    assert_eq!((sensor.dims(), sensor.values().dim()), (vec![3, 1, 1, 1, 4, 1, 4, 1], (1, 16)));
    let units = [Some("m/s²"), Some("N"), Some("rad"), Some("m/s"), Some("1"), None, Some("1"), Some("s")];
    assert_eq!(sensor.units(), units);
    let kinds: Vec<&str> = sensor.sensors().iter().map(|s| s.kind.as_ref()).collect();
    assert_eq!(kinds[..4], ["accelerometer", "touch", "jointpos", "jointvel"]);
    assert_error(sim.add_sensor("wrong", named(&["accc"])), "", &["\"acc\""]);
}

/// A joint of every type, and actuators without and with an activation.
const MOVERS: &str = include_str!("../../data/mjcf/movers.xml");

/// The force of a motor is its control times its gear. That of a servo is 10 N/m times its error at the beginning of
/// the step. A filter of 0.1 s approaches its control by one fiftieth in each step of 2 ms.
#[test]
fn joints_and_actuators() {
    const CONTROLS: [[f64; 3]; 2] = [[0.3, 0.5, 0.2], [-0.1, 0.4, 0.0]];
    let (mut sim, part) = with(2, MOVERS);
    let joints = sim.add_sensor("joints", JointStateCfg::default()).unwrap();
    let actuators = sim.add_sensor("actuators", ActuatorStateCfg::default()).unwrap();
    // The ball joint and the free joint have no scalar position.
    assert_eq!(sim.sensor(joints).unwrap().joint_names(), ["m/turn", "m/push"]);
    assert_eq!(sim.sensor(actuators).unwrap().actuator_names(), ["m/motor", "m/servo", "m/lag"]);
    sim.mjcf_part_mut(part).set_ctrl(&Array2::from(CONTROLS.to_vec()), None, None).unwrap();
    let columns = sim.mjcf_part(part).qpos_columns(&["turn", "push"]).unwrap();
    for step in 1..=100_i32 {
        let before = sim.sensor(joints).unwrap().positions().to_owned();
        sim.update(1);
        let (joint, actuator) = (sim.sensor(joints).unwrap(), sim.sensor(actuators).unwrap());
        let qpos = sim.mjcf_part(part).qpos();
        for (env, [motor, servo, lag]) in CONTROLS.into_iter().enumerate() {
            let act = |steps: i32| lag * (1.0 - 0.98_f64.powi(steps));
            let push = 10.0 * (servo - before[(env, 1)]);
            let lagging = 4.0 * act(step - 1);
            let of = |values: kinetoscope::ndarray::ArrayView2<'_, f64>| values.row(env).to_vec();
            for (what, found, expected) in [
                ("efforts", of(joint.efforts()), &[2.0 * motor + lagging, push][..]),
                ("controls", of(actuator.controls()), &[motor, servo, lag]),
                ("forces", of(actuator.forces()), &[motor, push, lagging]),
                ("activations", of(actuator.activations()), &[0.0, 0.0, act(step)]),
            ] {
                let rounding = Tolerance::absolute(1e-13, "rounding of a handful of operations on numbers of about 10");
                assert_close(&format!("{what} at step {step}"), &found, expected, rounding);
            }
            assert_eq!(of(joint.positions()), [0, 1].map(|k| qpos[(env, columns[k].start)]));
        }
        let speed = (joint.positions()[(0, 0)] - before[(0, 0)]) / 0.002;
        // Euler: the position changes by the new velocity.
        assert!((joint.velocities()[(0, 0)] - speed).abs() < 1e-10, "{speed}");
    }
    assert!(sim.sensor(joints).unwrap().positions()[(0, 1)].abs() > 1e-3, "the control: it moves");
}

/// Joints and actuators of robots come first, independent of the order of addition; their drives are actuators too.
#[test]
fn joints_of_robots() {
    let (mut sim, _) = with(1, MOVERS);
    let every = sim.add_sensor("every", JointStateCfg::default()).unwrap();
    let motors = ActuatorStateCfg { actuators: Some(vec!["servo".into(), "JOINT[12]".into()]), ..Default::default() };
    assert_error(sim.add_sensor("motors", motors.clone()), "", &["JOINT[12]", "\"motor\""]);
    let arm = sim.add_robot(sr5("arm")).unwrap();
    let motors = sim.add_sensor("motors", motors).unwrap();
    let names = sim.sensor(every).unwrap().joint_names().to_vec();
    assert_eq!((names.len(), &names[0][..], &names[6][..], &names[7][..]), (8, "arm/JOINT1", "m/turn", "m/push"));
    sim.robot_mut(arm).set_qpos_target(&array![[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]], None, None).unwrap();
    sim.update(5);
    let (sensor, qf) = (sim.sensor(motors).unwrap(), sim.robot(arm).qf());
    assert_eq!(sensor.actuator_names(), ["m/servo", "arm/JOINT1", "arm/JOINT2"]);
    assert_eq!(sensor.controls(), array![[0.0, 0.1, 0.2]]);
    assert_eq!(sensor.forces().row(0).to_vec()[1..], qf.row(0).to_vec()[..2]);
    assert!(qf[(0, 1)].abs() > 1.0, "the control: it carries a load");
    assert_error(empty(1).add_sensor("none", ActuatorStateCfg::default()), "", &["has nothing to measure"]);
}

/// Masses with their centers in the frame of the arm: the arm's own, and that of the tool, which is welded to the arm
/// and has its mass at its origin.
const LOADS: [(f64, [f64; 3]); 2] = [(1.5, [0.2, 0.0, -0.1]), (2.0, [0.35, 0.1, -0.4])];
const PALM: [f64; 3] = [0.05, -0.02, 0.1];

/// A crane that is at rest in one environment and rotates freely about the vertical in the other. Its joint carries all
/// bodies beyond it and keeps them on their circle: `F = sum m (omega x (omega x c) - g)`, and about the palm `T = sum
/// (c - p) x m (omega x (omega x c) - g)`, both in the axes of the palm.
#[test]
fn wrench_at_a_site() {
    let turn = from_xyz_rpy([0.0; 3], [0.4, -0.2, 0.7]).rotation;
    let joined = |v: &[f64]| v.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    // Equal moments about all axes, so that rotation needs no additional torque.
    let inertial = |mass: f64, at: &[f64]| {
        format!(r#"<inertial pos="{}" mass="{mass}" diaginertia="0.01 0.01 0.01"/>"#, joined(at))
    };
    let crane = format!(
        r#"<mujoco><worldbody><body name="arm" pos="0 0 2"><joint name="turn" axis="0 0 1"/>{}
        <body name="tool" pos="{}">{}<site name="palm" pos="{}" quat="{}"/></body></body></worldbody></mujoco>"#,
        inertial(LOADS[0].0, &LOADS[0].1),
        joined(&LOADS[1].1),
        inertial(LOADS[1].0, &[0.0; 3]),
        joined(&PALM),
        joined(&[turn.w, turn.i, turn.j, turn.k]),
    );
    let mut sim = empty(2);
    // The part is rotated about the vertical, which changes nothing in the axes of its bodies.
    let init_pose = from_xyz_rpy([0.3, -0.2, 0.1], [0.0, 0.0, 0.5]);
    let part = sim.add_mjcf(MjcfPartCfg { init_pose, ..MjcfPartCfg::text("m", crane) }).unwrap();
    let cfg = JointWrenchCfg { links: vec!["m/arm".into()], frames: vec!["m/palm".into()], ..Default::default() };
    let id = sim.add_sensor("wrench", cfg).unwrap();
    let omegas = [0.0, 3.0];
    sim.mjcf_part_mut(part).write_qvel(&array![[omegas[0]], [omegas[1]]], None).unwrap();
    let palm = Vector3::from(LOADS[1].1) + Vector3::from(PALM);
    let up = Vector3::new(0.0, 0.0, 9.81);
    let wrench_about = |p: Vector3<f64>, omega: f64| {
        LOADS.iter().fold((Vector3::zeros(), Vector3::zeros()), |(force, torque), (mass, com)| {
            let com = Vector3::from(*com);
            let needed = *mass * (up - omega * omega * Vector3::new(com.x, com.y, 0.0));
            (force + needed, torque + (com - p).cross(&needed))
        })
    };
    // Sums of a few numbers of at most 100, with 16 digits, through chains of frames of unit length: 1e-13.
    let same = |found: ArrayView3<'_, f64>, env: usize, b: usize, expected: Vector3<f64>| {
        let found = Vector3::from_fn(|k, _| found[(env, b, k)]);
        assert!((found - expected).norm() < 1e-11, "environment {env}, {b}: {found} is not {expected}");
    };
    for _ in 0..4 {
        let sensor = sim.sensor(id).unwrap();
        assert_eq!(sensor.link_names(), ["m/arm", "m/palm"]);
        for (env, omega) in omegas.into_iter().enumerate() {
            for (b, about, axes) in [(0, Vector3::zeros(), UnitQuaternion::identity()), (1, palm, turn.inverse())] {
                let (force, torque) = wrench_about(about, omega);
                same(sensor.forces(), env, b, axes * force);
                same(sensor.torques(), env, b, axes * torque);
            }
        }
        sim.update(30);
    }
    // Controls: the palm has another position and orientation, and the rotation has an effect.
    let (still, turning) = (wrench_about(palm, 0.0), wrench_about(palm, 3.0));
    assert!((still.1 - wrench_about(Vector3::zeros(), 0.0).1).norm() > 1.0 && (turning.0 - still.0).norm() > 1.0);
    assert!((turn.inverse() * still.0 - still.0).norm() > 1.0);
}

/// Sites have MuJoCo's poses for frame sensors, cameras and the handle of the part.
#[test]
fn sites() {
    const SITES: [&str; 6] = ["hook", "elbow", "plate.site", "palm", "axle", "inside"];
    let mut sim = empty(2);
    let init_pose = from_xyz_rpy([0.3, -0.2, 0.1], [0.1, 0.2, -0.4]);
    let part = sim.add_mjcf(MjcfPartCfg { init_pose, ..MjcfPartCfg::text("m", MACHINE) }).unwrap();
    assert!(count_diagnostics(&sim, &["the site \"plate\" has the same name as a body"]) > 0);
    let targets = SITES.iter().map(|site| TargetFrameCfg::for_bodies(format!("m/{site}"))).collect();
    let frames = sim.add_sensor("frames", FrameTransformerCfg::new("m/elbow", targets)).unwrap();
    let extrinsics = Extrinsics { parent: Some("m/palm".into()), ..Default::default() };
    let camera = CameraCfg { width: 8, height: 8, extrinsics, ..Default::default() };
    let camera = sim.add_sensor("camera", camera).unwrap();
    let imu = sim.add_sensor("imu", ImuCfg::on("palm")).unwrap();
    sim.update(120);
    let model = sim.batch().model().clone();
    for env in 0..2 {
        let transformer = sim.sensor(frames).unwrap();
        for (m, site) in SITES.iter().enumerate() {
            let id = model.id(ObjectKind::Site, &format!("m/{}", site.trim_end_matches(".site"))).unwrap();
            let (position, rotation) = sim.batch().read(env, |env| {
                let (p, m) = (&env.data().site_xpos()[3 * id..], &env.data().site_xmat()[9 * id..9 * id + 9]);
                ([p[0], p[1], p[2]], Matrix3::<f64>::from_row_slice(m))
            });
            // A few operations on numbers of about 1: 1e-14.
            let is_there = |what: &str, pose: Pose, rotation: Matrix3<f64>| {
                let off = (pose.rotation.to_rotation_matrix().into_inner() - rotation).norm();
                let far = (pose.translation.vector - Vector3::from(position)).norm();
                assert!(far < 1e-12 && off < 1e-12, "{what} of {site}: {far} m, {off}");
            };
            let at = |values: ArrayView3<'_, f64>| values.index_axis(Axis(0), env).row(m).to_vec();
            let (p, q) = (at(transformer.target_pos_w()), at(transformer.target_quat_w()));
            is_there("frame", from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]]), rotation);
            if *site == "palm" {
                // A camera without its own placement looks along the site's z axis.
                let at = sim.sensor(camera).unwrap().pose_w(CameraConvention::World);
                assert!((0..3).all(|k| (at[(env, k)] - position[k]).abs() < 1e-12), "the camera is at the site");
                let at = sim.sensor(camera).unwrap().pose_w(CameraConvention::Ros).to_owned();
                is_there("camera", pose_of_row(&at, env), rotation);
                is_there("handle", pose_of_row(&sim.mjcf_part(part).site_pose("palm").unwrap(), env), rotation);
            }
        }
        assert_ne!(transformer.target_pos_w()[(env, 1, 0)], transformer.target_pos_w()[(env, 3, 0)]);
    }
    // Another site has another pose, so the comparison above can fail.
    let hook = pose_of_row(&sim.mjcf_part(part).site_pose("hook").unwrap(), 0);
    assert!(hook.rotation.angle_to(&UnitQuaternion::identity()) > 0.1);
    let expected = init_pose.transform_point(&nalgebra::Point3::new(0.1, -0.2, 0.9));
    assert!((hook.translation.vector - expected.coords).norm() < 1e-12);
    assert!(sim.sensor(imu).unwrap().ang_vel_b().iter().any(|w| w.abs() > 1e-3), "it is read");
}

/// The error for a site or a body without joints names the body that carries it.
#[test]
fn welded_frames() {
    let (mut sim, _) = with(1, MACHINE);
    let wrench = |link: &str| JointWrenchCfg { links: vec![link.into()], ..Default::default() };
    for (link, carrier) in [("m/elbow", "m/arm"), ("m/plate", "m/arm"), ("m/plate.site", "m/arm"), ("m/palm", "m/hand")]
    {
        assert_error(sim.add_sensor("w", wrench(link)), "", &[link, carrier]);
    }
    sim.add_sensor("w", wrench("m/arm")).unwrap();
    let unknown = FrameTransformerCfg::new("m/elbwo", vec![]);
    assert_error(sim.add_sensor("f", unknown), "", &["known names: \"m/elbow\""]);
}
