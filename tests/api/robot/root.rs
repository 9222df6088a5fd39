//! The root link of a robot without a fixed base, and velocities of joints.

use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;

const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;

fn sim(gravity: f64) -> SimulationManager {
    let cfg = SimulationManagerCfg {
        num_envs: 3,
        ground: None,
        gravity: [0.0, 0.0, gravity].into(),
        ..SimulationManagerCfg::default()
    };
    SimulationManager::new(cfg).unwrap()
}

/// A ball of 2 kg with a passive hinge through its middle that turns a second ball: nothing that one does moves the other.
fn two_balls(sim: &mut SimulationManager, fix_base: bool) -> RobotId {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("balls.urdf");
    let link = |name| {
        format!(
            "<link name=\"{name}\"><inertial><mass value=\"2\"/>\
             <inertia ixx=\"0.02\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.02\"/></inertial></link>"
        )
    };
    let joint = "<joint name=\"spin\" type=\"continuous\"><parent link=\"outer\"/><child link=\"inner\"/>\
                 <axis xyz=\"0 0 1\"/></joint>";
    std::fs::write(&path, format!("<robot name=\"r\">{}{}{joint}</robot>", link("outer"), link("inner"))).unwrap();
    let cfg = RobotCfg {
        urdf: UrdfCfg::single(path),
        drive: DriveCfg { drive_type: DriveType::None, ..Default::default() },
        fix_base,
        init_pose: Pose::translation(0.0, 0.0, 5.0),
        ..Default::default()
    };
    sim.add_robot(cfg).unwrap()
}

fn close(found: &Array2<f64>, expected: &[f64], tolerance: f64) {
    for row in found.rows() {
        for (x, y) in row.iter().zip(expected) {
            assert!((x - y).abs() < tolerance, "{row} is not {expected:?}");
        }
    }
}

/// Free fall of a semi-implicit Euler: v = -g h n, z = z0 - g h² n (n + 1) / 2. Rounding of 50 sums stays far below 1e-12.
#[test]
fn a_floating_base_falls() {
    let mut sim = sim(-9.81);
    let robot = two_balls(&mut sim, false);
    assert_eq!(sim.robot(robot).get_root_pose(), sim.robot(robot).get_default_root_pose());
    sim.update(50);
    close(&sim.robot(robot).get_root_pose(), &[0.0, 0.0, 5.0 - 9.81e-4 * 50.0 * 51.0 / 2.0, 1.0, 0.0, 0.0, 0.0], 1e-12);
    close(&sim.robot(robot).get_root_velocity(), &[0.0, 0.0, -9.81 * 0.5, 0.0, 0.0, 0.0], 1e-12);
    let base = sim.robot(robot).link_pose("outer").unwrap();
    assert_eq!(base, sim.robot(robot).get_root_pose());
}

/// A velocity in world axes stays in world axes when the root link is put elsewhere and turned; a ball goes on as it is.
#[test]
fn poses_and_velocities_are_written_in_world_axes() {
    let mut sim = sim(0.0);
    let robot = two_balls(&mut sim, false);
    let mut written = sim.robot_mut(robot);
    written.write_root_velocity(&array![[0.5, 0.0, -1.0, 0.0, 0.0, 2.0]], None).unwrap();
    // A quarter turn about x, not normalised.
    written.write_root_pose(&array![[1.0, 2.0, 3.0, 2.0, 2.0, 0.0, 0.0]], Some(&[EnvId(2), EnvId(0)])).unwrap();
    let (pose, velocity) = (sim.robot(robot).get_root_pose(), sim.robot(robot).get_root_velocity());
    close(&velocity, &[0.5, 0.0, -1.0, 0.0, 0.0, 2.0], 1e-15);
    let rows: Vec<Vec<f64>> = pose.rows().into_iter().map(|row| row.to_vec()).collect();
    assert_eq!(rows[1], [0.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0], "environment 1 was not chosen");
    for env in [0, 2] {
        for (x, y) in rows[env].iter().zip([1.0, 2.0, 3.0, HALF, HALF, 0.0, 0.0]) {
            assert!((x - y).abs() < 1e-15, "{:?}", rows[env]);
        }
    }
    sim.update(100);
    // One second later: 2 rad about the world's z. Semi-implicit steps of a ball are exact up to rounding.
    close(&sim.robot(robot).get_root_velocity(), &[0.5, 0.0, -1.0, 0.0, 0.0, 2.0], 1e-9);
    let pose = sim.robot(robot).get_root_pose();
    let turned = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, 2.0)
        * nalgebra::UnitQuaternion::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0);
    let row: [f64; 7] = std::array::from_fn(|k| pose[(0, k)]);
    let found = kinetoscope::scene::pose::from_row(&row);
    assert!(found.rotation.angle_to(&turned) < 1e-9);
    assert!((found.translation.vector - nalgebra::Vector3::new(1.5, 2.0, 2.0)).norm() < 1e-9);
}

/// Without torques a written velocity of a joint stays, and is where the joint goes.
#[test]
fn velocities_of_joints_are_written() {
    let mut sim = sim(0.0);
    let robot = two_balls(&mut sim, false);
    sim.robot_mut(robot).write_qvel(&array![[3.0]], None, Some(&[EnvId(1)])).unwrap();
    assert_eq!(sim.robot(robot).get_qvel().column(0).to_vec(), [0.0, 3.0, 0.0]);
    sim.update(50);
    // The inner ball turns against nothing: 3 rad/s for half a second.
    assert!((sim.robot(robot).get_qpos()[(1, 0)] - 1.5).abs() < 1e-12);
    assert_eq!(sim.robot(robot).get_qpos()[(0, 0)], 0.0);
    sim.reset(None).unwrap();
    assert_eq!(sim.robot(robot).get_qvel().column(0).to_vec(), [0.0; 3]);
}

#[test]
fn mistakes_are_errors_and_nothing_is_written() {
    let mut sim = sim(-9.81);
    let robot = two_balls(&mut sim, false);
    let before = sim.robot(robot).get_root_pose();
    let mut written = sim.robot_mut(robot);
    let pose = |numbers: [f64; 7]| Array2::from_shape_vec((1, 7), numbers.to_vec()).unwrap();
    for (bad, part) in [
        (pose([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]), "quaternion"),
        (pose([0.0, f64::NAN, 1.0, 1.0, 0.0, 0.0, 0.0]), "finite"),
        (Array2::zeros((2, 7)), "[2, 7]"),
        (Array2::zeros((1, 6)), "[1, 6]"),
    ] {
        let message = written.write_root_pose(&bad, None).unwrap_err().to_string();
        assert!(message.contains("write_root_pose") && message.contains(part), "{message}");
    }
    let message = written.write_root_velocity(&Array2::zeros((1, 6)), Some(&[EnvId(3)])).unwrap_err().to_string();
    assert!(message.contains("environment 3"), "{message}");
    assert!(written.write_qvel(&array![[f64::INFINITY]], None, None).unwrap_err().to_string().contains("\"spin\""));
    assert_eq!(sim.robot(robot).get_root_pose(), before);

    let mut fixed = self::sim(-9.81);
    let robot = two_balls(&mut fixed, true);
    fixed.update(10);
    assert_eq!(fixed.robot(robot).get_root_pose(), fixed.robot(robot).get_default_root_pose());
    assert_eq!(fixed.robot(robot).get_root_velocity(), Array2::<f64>::zeros((3, 6)));
    let message = fixed
        .robot_mut(robot)
        .write_root_pose(&pose([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]), None)
        .unwrap_err()
        .to_string();
    assert!(message.contains("\"robot\"") && message.contains("fix_base"), "{message}");
}
