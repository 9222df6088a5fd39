//! Forces and torques of joints, against closed forms. For a load at rest and a rotating load see the law
//! `physics::contacts::joint_wrench`.

use super::worlds::{G, add_robot, joint, link, sim, sr5};
use kinetoscope::ndarray::{Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_wxyz, from_xyz_rpy};
use kinetoscope::sensors::{Imu, JointWrenchCfg};
use kinetoscope_testkit::tolerance::{Tolerance, assert_close};
use nalgebra::{UnitQuaternion, Vector3};

const EXACT: Tolerance =
    Tolerance::absolute(1e-7, "rounding of accelerations, velocities / 5 ms, times a few kilograms");
const SUMS: Tolerance = Tolerance::absolute(
    1e-6,
    "hundreds of newtons, summed in another order; MuJoCo keeps principal axes as quaternions of 16 digits",
);

/// A moving arm by Newton and Euler: the joint wrench accelerates all links beyond the joint. Their accelerations come
/// from an IMU at the center of mass of each link.
#[test]
fn newton_euler() {
    let mut sim = sim(1);
    let arm = sim.add_robot(sr5("arm")).unwrap();
    let description = sim.robot(arm).description().clone();
    let imus = [3, 4, 5, 6].map(|k| {
        let name = format!("link{k}");
        let inertial = description.link(description.link_id(&name).unwrap()).inertial.clone().unwrap();
        let imu = ImuCfg { offset: inertial.link_from_com, ..ImuCfg::on(&name) };
        (sim.add_sensor(format!("imu of {name}"), imu).unwrap(), inertial)
    });
    let frame = sim.add_sensor("origin", ImuCfg::on("link3")).unwrap();
    let id = sim.add_sensor("wrench", JointWrenchCfg { links: vec!["link3".into()], ..Default::default() }).unwrap();
    sim.robot_mut(arm).set_qpos_target(&array![[1.0, 0.4, -0.5, 0.8, 0.6, -0.7]], None, None).unwrap();
    let vector = |view: kinetoscope::ndarray::ArrayView2<'_, f64>| Vector3::from_fn(|k, _| view[(0, k)]);
    let rotation = |imu: &Imu| from_wxyz(std::array::from_fn(|k| imu.quat_w()[(0, k)]));
    let mut fastest = 0.0_f64;
    for _ in 0..60 {
        sim.update(1);
        let origin = sim.sensor(frame).unwrap();
        let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
        for (imu, inertial) in &imus {
            let imu = sim.sensor(*imu).unwrap();
            let (turn, spin) = (rotation(imu), vector(imu.ang_vel_b()));
            let needed = turn * (inertial.mass * vector(imu.lin_acc_b()));
            let about_com = inertial.inertia * vector(imu.ang_acc_b()) + spin.cross(&(inertial.inertia * spin));
            force += needed;
            torque += (vector(imu.pos_w()) - vector(origin.pos_w())).cross(&needed) + turn * about_com;
            fastest = fastest.max(spin.norm());
        }
        let into_link = rotation(origin).inverse();
        let sensor = sim.sensor(id).unwrap();
        assert_close("force", sensor.forces(), (into_link * force).as_slice(), SUMS);
        assert_close("torque", sensor.torques(), (into_link * torque).as_slice(), SUMS);
    }
    assert!(fastest > 1.0, "it moved: {fastest} rad/s");
}

/// A load that hangs beside a vertical axis, measured in a tilted mount frame below the joint. The force is the weight.
/// The torque is the weight times the lever arm from the mount to the center of mass. Both are in the axes of the
/// mount. The base does not rotate and is held with the weight of everything.
#[test]
fn mount_frame() {
    let (of_arm, of_mount, of_load) = (1.0, 0.5, 3.0);
    let mut content = link("base", 1.0, 0.1, [0.0; 3], "") + &link("arm", of_arm, 0.01, [0.0, 0.0, -0.1], "");
    content += &joint("turn", "continuous", ["base", "arm"], [0.0, 0.0, 2.0], "0 0 1");
    content += &(link("mount", of_mount, 0.01, [0.0; 3], "") + &link("load", of_load, 0.01, [0.0, 0.1, 0.0], ""));
    content += r#"<joint name="a" type="fixed"><parent link="arm"/><child link="mount"/>
        <origin xyz="0.1 0.2 -0.3" rpy="0.4 -0.2 0.7"/></joint>"#;
    content += &joint("b", "fixed", ["arm", "load"], [0.3, 0.0, -0.5], "0 0 1");
    let mut sim = sim(2);
    let crane = add_robot(&mut sim, "crane", &content, |_| ());
    let links = vec!["arm".into(), "crane/base".into()];
    let frames = vec!["mount".into(), "arm".into()];
    let id = sim.add_sensor("wrench", JointWrenchCfg { links, frames, ..Default::default() }).unwrap();
    // Rotated about the vertical, the load keeps its rest position relative to the arm.
    sim.robot_mut(crane).write_qpos(&array![[0.0], [1.2]], None, None).unwrap();
    let mount = from_xyz_rpy([0.1, 0.2, -0.3], [0.4, -0.2, 0.7]);
    let up = |mass: f64| Vector3::new(0.0, 0.0, mass * G);
    let loads = [(of_arm, [0.0, 0.0, -0.1]), (of_mount, [0.1, 0.2, -0.3]), (of_load, [0.3, 0.1, -0.5])];
    let about = |p: Vector3<f64>| {
        loads.iter().map(|(mass, com)| (Vector3::from(*com) - p).cross(&up(*mass))).sum::<Vector3<_>>()
    };
    let (at_joint, at_mount) = (about(Vector3::zeros()), about(mount.translation.vector));
    assert!((at_mount - at_joint).norm() > 1.0, "the control: the mount is not where the joint is");
    let weight = up(of_arm + of_mount + of_load);
    let into = mount.rotation.inverse();
    for _ in 0..3 {
        let sensor = sim.sensor(id).unwrap();
        assert_eq!(sensor.link_names(), ["crane/arm", "crane/base", "crane/mount", "crane/arm"]);
        for env in 0..2 {
            let [forces, torques] = [sensor.forces(), sensor.torques()].map(|all| all.index_axis_move(Axis(0), env));
            assert_close("force at the mount", forces.row(2), (into * weight).as_slice(), EXACT);
            assert_close("torque at the mount", torques.row(2), (into * at_mount).as_slice(), EXACT);
            assert_close("force at the joint", forces.row(0), weight.as_slice(), EXACT);
            assert_close("torque at the joint", torques.row(0), at_joint.as_slice(), EXACT);
            assert_eq!((forces.row(0), torques.row(0)), (forces.row(3), torques.row(3)), "its own frame");
            let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, 1.2 * env as f64);
            assert_close("force at the base", forces.row(1), (weight + up(1.0)).as_slice(), EXACT);
            assert_close("torque at the base", torques.row(1), (turn * at_joint).as_slice(), EXACT);
        }
        sim.update(20);
    }
}
