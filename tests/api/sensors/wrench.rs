//! What joints carry, against closed forms.

use crate::sensors::worlds::{G, assert_near, cfg, joint, link, robot};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use nalgebra::{UnitQuaternion, Vector3};

/// Rounding of accelerations from velocities divided by the step of 5 ms, times a few kilograms.
const EXACT: f64 = 1e-7;

/// A load that hangs pulls its joint down: the joint pulls it up with its weight, and needs no torque.
#[test]
fn a_hanging_load_reads_its_weight_upwards() {
    let files = tempfile::tempdir().unwrap();
    let mut content = link("base", 1.0, 0.1, [0.0; 3], "") + &link("load", 3.0, 0.01, [0.0, 0.0, -0.4], "");
    content += &joint("pivot", "continuous", "load", [0.0, 0.0, 2.0], "0 1 0");
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    sim.add_robot(robot(files.path(), "crane", &content, true)).unwrap();
    let links = vec!["load".into(), "crane/base".into()];
    let id = sim.add_sensor("wrench", JointWrenchCfg { links, ..Default::default() }).unwrap();
    for _ in 0..3 {
        let sensor = sim.sensor(id).unwrap();
        assert_eq!(sensor.link_names(), ["crane/load", "crane/base"]);
        // The base is held with the weight of both, the load 2 m above it exactly.
        let per_env = [0.0, 0.0, 3.0 * G, 0.0, 0.0, 4.0 * G];
        assert_near(sensor.forces().to_owned(), &[per_env, per_env].concat(), EXACT);
        assert_near(sensor.torques().to_owned(), &[0.0; 12], EXACT);
        sim.update(20);
    }
}

/// A lever that its drive holds out sideways: the joint carries the weight, and the drive's effort about its axis is part of
/// what it exerts.
#[test]
fn a_lever_is_held_by_the_torque_of_its_drive() {
    let files = tempfile::tempdir().unwrap();
    let (mass, com) = (2.0, Vector3::new(0.3, 0.1, 0.0));
    let mut content = link("base", 1.0, 0.1, [0.0; 3], "") + &link("lever", mass, 0.01, com.into(), "");
    content += &joint("pivot", "continuous", "lever", [0.0, 0.0, 2.0], "0 1 0");
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let drive = DriveCfg::default();
    let lever = sim.add_robot(RobotCfg { drive, ..robot(files.path(), "lever", &content, true) }).unwrap();
    let links = vec!["lever".into()];
    let id = sim.add_sensor("wrench", JointWrenchCfg { links, ..Default::default() }).unwrap();
    sim.update(2000);
    let q = sim.robot(lever).get_qpos()[(0, 0)];
    let weight = UnitQuaternion::from_euler_angles(0.0, q, 0.0).inverse() * Vector3::new(0.0, 0.0, -mass * G);
    let sensor = sim.sensor(id).unwrap();
    // After ten seconds of a damped drive nothing moves any more.
    assert_near(sensor.forces().to_owned(), (-weight).as_slice(), 1e-6);
    assert_near(sensor.torques().to_owned(), (-com.cross(&weight)).as_slice(), 1e-6);
    assert_near([sensor.torques()[(0, 0, 1)]], &[sim.robot(lever).get_qf()[(0, 0)]], 1e-6);
    assert!(sensor.torques()[(0, 0, 1)] < -5.0, "the control: it is not nothing");
}

/// A load that a torque spins up about the vertical: in its own axes, the joint pulls it inwards with `m omega² r`, pushes it
/// on with `m alpha r`, and carries it.
#[test]
fn a_rotating_load_is_pulled_inwards() {
    let files = tempfile::tempdir().unwrap();
    let (mass, r, moment) = (1.5, 0.6, 0.02);
    let mut content = link("base", 1.0, 0.1, [0.0; 3], "") + &link("load", mass, moment, [r, 0.0, 0.0], "");
    content += &joint("turn", "continuous", "load", [0.1, 0.2, 1.0], "0 0 1");
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let arm = sim.add_robot(robot(files.path(), "arm", &content, true)).unwrap();
    let links = vec!["load".into()];
    let id = sim.add_sensor("wrench", JointWrenchCfg { links, ..Default::default() }).unwrap();
    sim.robot_mut(arm).set_qf(&array![[2.0]], None, None).unwrap();
    let dt = sim.cfg().physics_dt;
    let mut before = 0.0;
    for _ in 0..300 {
        sim.update(1);
        let after = sim.robot(arm).get_qvel()[(0, 0)];
        let (omega, alpha) = (before, (after - before) / dt);
        let sensor = sim.sensor(id).unwrap();
        let force = [-mass * omega * omega * r, mass * alpha * r, mass * G];
        assert_near(sensor.forces().to_owned(), &force, EXACT);
        let torque = [0.0, -r * mass * G, (moment + mass * r * r) * alpha];
        assert_near(sensor.torques().to_owned(), &torque, EXACT);
        assert_near([sensor.torques()[(0, 0, 2)]], &[2.0], EXACT);
        before = after;
    }
    assert!(before > 4.0, "it turned: {before}");
}

/// A moving arm by Newton and Euler: what the joint of a link exerts is what all links beyond it need to be accelerated, by
/// the readings of an IMU in the centre of mass of each.
#[test]
fn a_joint_exerts_what_all_links_beyond_it_need() {
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    let arm = sim.add_robot(RobotCfg { uid: "arm".into(), urdf, ..Default::default() }).unwrap();
    let links: Vec<String> = (3..=6).map(|k| format!("link{k}")).collect();
    let description = sim.robot(arm).description().clone();
    let inertial = |name: &str| description.link(description.link_id(name).unwrap()).inertial.clone().unwrap();
    let imus: Vec<_> = links
        .iter()
        .map(|name| {
            let imu = ImuCfg { offset: inertial(name).link_from_com, ..ImuCfg::on(name) };
            (sim.add_sensor(format!("imu of {name}"), imu).unwrap(), inertial(name))
        })
        .collect();
    let frame = sim.add_sensor("origin", ImuCfg::on("link3")).unwrap();
    let wanted = JointWrenchCfg { links: vec!["link3".into()], ..Default::default() };
    let id = sim.add_sensor("wrench", wanted).unwrap();
    sim.robot_mut(arm).set_qpos(&array![[1.0, 0.4, -0.5, 0.8, 0.6, -0.7]], None, None).unwrap();
    let vector = |view: kinetoscope::ndarray::ArrayView2<'_, f64>| Vector3::from_fn(|k, _| view[(0, k)]);
    let rotation = |imu: &Imu| kinetoscope::scene::pose::from_wxyz(std::array::from_fn(|k| imu.quat_w()[(0, k)]));
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
        // Hundreds of newtons, summed in another order; MuJoCo keeps principal axes as quaternions of 16 digits.
        assert_near(sensor.forces().to_owned(), (into_link * force).as_slice(), 1e-6);
        assert_near(sensor.torques().to_owned(), (into_link * torque).as_slice(), 1e-6);
    }
    assert!(fastest > 1.0, "it moved: {fastest} rad/s");
}

/// A load that hangs beside a vertical axis, measured by a mount that is tilted, below the axis: the force is the weight,
/// the torque the weight times the arm from the mount to the centre of mass, both in the axes of the mount.
#[test]
fn a_mount_measures_a_hanging_load_in_its_own_frame() {
    let files = tempfile::tempdir().unwrap();
    let (of_arm, of_mount, of_load) = (1.0, 0.5, 3.0);
    let mut content = link("base", 1.0, 0.1, [0.0; 3], "") + &link("arm", of_arm, 0.01, [0.0, 0.0, -0.1], "");
    content += &joint("turn", "continuous", "arm", [0.0, 0.0, 2.0], "0 0 1");
    content += &(link("mount", of_mount, 0.01, [0.0; 3], "") + &link("load", of_load, 0.01, [0.0, 0.1, 0.0], ""));
    let fixed = |name: &str, xyz: &str, rpy: &str| {
        format!(
            r#"<joint name="fix_{name}" type="fixed"><parent link="arm"/><child link="{name}"/>
            <origin xyz="{xyz}" rpy="{rpy}"/></joint>"#
        )
    };
    content += &(fixed("mount", "0.1 0.2 -0.3", "0.4 -0.2 0.7") + &fixed("load", "0.3 0 -0.5", "0 0 0"));
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    let crane = sim.add_robot(robot(files.path(), "crane", &content, true)).unwrap();
    let (links, frames) = (vec!["arm".into()], vec!["mount".into(), "arm".into()]);
    let id = sim.add_sensor("wrench", JointWrenchCfg { links, frames, ..Default::default() }).unwrap();
    // Turned about the vertical, it hangs as it did.
    sim.robot_mut(crane).write_qpos(&array![[0.0], [1.2]], None, None).unwrap();
    let mount = kinetoscope::scene::pose::from_xyz_rpy([0.1, 0.2, -0.3], [0.4, -0.2, 0.7]);
    let up = |mass: f64| Vector3::new(0.0, 0.0, mass * G);
    let loads = [(of_arm, [0.0, 0.0, -0.1]), (of_mount, [0.1, 0.2, -0.3]), (of_load, [0.3, 0.1, -0.5])];
    let about = |p: Vector3<f64>| {
        loads.iter().fold(Vector3::zeros(), |sum, (mass, com)| sum + (Vector3::from(*com) - p).cross(&up(*mass)))
    };
    let weight = up(of_arm + of_mount + of_load);
    let into = mount.rotation.inverse();
    for _ in 0..3 {
        let sensor = sim.sensor(id).unwrap();
        assert_eq!(sensor.link_names(), ["crane/arm", "crane/mount", "crane/arm"]);
        let (forces, torques) = (sensor.forces(), sensor.torques());
        for env in 0..2 {
            let row = |a: &kinetoscope::ndarray::ArrayView3<'_, f64>, b| [0, 1, 2].map(|k| a[(env, b, k)]);
            assert_near(row(&forces, 1), (into * weight).as_slice(), EXACT);
            assert_near(row(&torques, 1), (into * about(mount.translation.vector)).as_slice(), EXACT);
            assert_near(row(&forces, 0), weight.as_slice(), EXACT);
            assert_near(row(&torques, 0), about(Vector3::zeros()).as_slice(), EXACT);
            assert_eq!((row(&forces, 0), row(&torques, 0)), (row(&forces, 2), row(&torques, 2)), "its own frame");
        }
        let apart = about(mount.translation.vector) - about(Vector3::zeros());
        assert!(apart.norm() > 1.0, "the control: the mount is not where the joint is");
        sim.update(20);
    }
}

#[test]
fn fused_links_have_no_joint_to_measure() {
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    sim.add_robot(RobotCfg { urdf, ..Default::default() }).unwrap();
    let links = vec!["ee_link".into()];
    let text = sim.add_sensor("w", JointWrenchCfg { links, ..Default::default() }).unwrap_err().to_string();
    assert!(text.contains("\"robot/ee_link\" is fused to \"robot/link6\""), "{text}");
    // Nothing at all was taken as it stood.
    let text = sim.add_sensor("w", JointWrenchCfg::default()).unwrap_err().to_string();
    assert!(text.contains("would measure nothing: links and frames") && text.contains("\"robot/link1\""), "{text}");
    let links = vec!["link7".into()];
    let text = sim.add_sensor("w", JointWrenchCfg { links, ..Default::default() }).unwrap_err().to_string();
    assert!(text.contains("no link \"link7\"") && text.contains("link6"), "{text}");
}
