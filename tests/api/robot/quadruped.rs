//! The bundled quadruped: the numbers that scripts for ANYmal C rely on, and that it stands.

use kinetoscope::prelude::*;

pub(crate) fn cfg(urdf: std::path::PathBuf, stiffness: f64, damping: f64) -> RobotCfg {
    RobotCfg {
        urdf: UrdfCfg::single(urdf),
        fix_base: false,
        init_pose: Pose::translation(0.0, 0.0, 0.6),
        init_qpos: [(".*HAA", 0.0), (".*F_HFE", 0.4), (".*H_HFE", -0.4), (".*F_KFE", -0.8), (".*H_KFE", 0.8)]
            .map(|(joints, angle)| (joints.to_string(), angle))
            .to_vec(),
        drive: DriveCfg { stiffness: stiffness.into(), damping: damping.into(), ..Default::default() },
        ..Default::default()
    }
}

pub(crate) fn bundled() -> std::path::PathBuf {
    assets::path("quadruped/quadruped.urdf").unwrap()
}

/// ANYbotics' own robot, where it is there.
pub(crate) fn vendor() -> std::path::PathBuf {
    testkit::needs::robot("anymal_c_simple_description/urdf/anymal.urdf")
}

#[test]
fn it_has_the_joints_limits_and_mass_of_the_tutorials_robot() {
    let mut sim = SimulationManager::new(SimulationManagerCfg::legged()).unwrap();
    let id = sim.add_robot(cfg(bundled(), 80.0, 5.0)).unwrap();
    assert_eq!(sim.diagnostics(), [], "nothing was repaired");
    let robot = sim.robot(id);
    assert!((robot.total_mass() - 52.13485).abs() < 1e-9, "{}", robot.total_mass());
    let names: Vec<String> = ["LF", "RF", "LH", "RH"]
        .iter()
        .flat_map(|leg| ["HAA", "HFE", "KFE"].iter().map(move |joint| format!("{leg}_{joint}")))
        .collect();
    assert_eq!(robot.joint_names(), names);
    assert!(robot.qf_limits().iter().all(|&limit| limit == 80.0));
    assert!(robot.qvel_limits().iter().all(|&limit| limit == 7.5));
    let limits = robot.qpos_limits();
    for (joint, [low, high]) in [(0, [-0.72, 0.49]), (3, [-0.49, 0.72]), (6, [-0.72, 0.49]), (9, [-0.49, 0.72])] {
        assert_eq!([limits[(0, joint, 0)], limits[(0, joint, 1)]], [low, high]);
    }
    // The tutorial's pose: the lowest point of each foot is 0.549 m below the base.
    for leg in ["LF", "RF", "LH", "RH"] {
        let foot = robot.link_pose(&format!("{leg}_FOOT")).unwrap();
        let row: [f64; 7] = std::array::from_fn(|k| foot[(0, k)]);
        let ball = kinetoscope::scene::pose::from_row(&row) * nalgebra::Point3::new(0.0, 0.0, 0.0225);
        assert!((0.6 - (ball.z - 0.03) - 0.549).abs() < 1e-3, "{leg}: {ball}");
    }
}

/// Where a leg is does not depend on whose file it is: the same angles put every foot of ours and of the vendor's robot
/// at the same place.
#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn its_feet_are_where_those_of_the_vendors_robot_are() {
    let vendor = vendor();
    let mut sim = SimulationManager::new(SimulationManagerCfg::legged()).unwrap();
    let ours = sim.add_robot(cfg(bundled(), 80.0, 5.0)).unwrap();
    let theirs = sim.add_robot(RobotCfg { uid: "vendor".into(), ..cfg(vendor, 80.0, 5.0) }).unwrap();
    for k in 0..20 {
        let angle = |joint: usize| 0.4 * (1.3 * k as f64 + 0.7 * joint as f64).sin();
        for id in [ours, theirs] {
            let angles: Vec<f64> = sim
                .robot(id)
                .joint_names()
                .iter()
                .map(|name| angle(sim.robot(ours).joint_id(name).unwrap().0))
                .collect();
            let row = kinetoscope::ndarray::Array2::from_shape_vec((1, 12), angles).unwrap();
            sim.robot_mut(id).write_qpos(&row, None, None).unwrap();
        }
        for leg in ["LF", "RF", "LH", "RH"] {
            let place = |id| sim.robot(id).link_pose(&format!("{leg}_FOOT")).unwrap();
            let (a, b) = (place(ours), place(theirs));
            for axis in 0..3 {
                // Their angles of mounting are written with 12 digits.
                assert!((a[(0, axis)] - b[(0, axis)]).abs() < 1e-9, "{leg}: {a} {b}");
            }
        }
    }
}
