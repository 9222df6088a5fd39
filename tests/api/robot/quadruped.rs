//! The bundled quadruped: the numbers that scripts for ANYmal C rely on, and standing still on four feet.

use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::test_resources;
use kinetoscope_testkit::worlds::{gains, pose_of_row, sim, urdf_robot};

const LEGS: [&str; 4] = ["LF", "RF", "LH", "RH"];

fn quadruped(uid: &str, urdf: std::path::PathBuf) -> RobotCfg {
    let init_qpos = [(".*HAA", 0.0), (".*F_HFE", 0.4), (".*H_HFE", -0.4), (".*F_KFE", -0.8), (".*H_KFE", 0.8)];
    RobotCfg {
        fix_base: false,
        init_pose: Pose::translation(0.0, 0.0, 0.6),
        init_qpos: init_qpos.map(|(joints, angle)| (joints.to_string(), angle)).to_vec(),
        drive: gains(80.0, 5.0),
        ..urdf_robot(uid, urdf)
    }
}

fn bundled() -> RobotCfg {
    quadruped("robot", assets::path("quadruped/quadruped.urdf").unwrap())
}

/// ANYbotics' own robot.
fn vendor() -> RobotCfg {
    quadruped("vendor", test_resources::robot("anymal_c_simple_description/urdf/anymal.urdf"))
}

#[test]
fn numbers_of_the_tutorial() {
    let mut sim = sim(SimulationManagerCfg::legged());
    let id = sim.add_robot(bundled()).unwrap();
    assert_eq!(sim.diagnostics(), [], "nothing was repaired");
    let robot = sim.robot(id);
    assert!((robot.total_mass() - 52.13485).abs() < 1e-9, "{}", robot.total_mass());
    let names = LEGS.iter().flat_map(|leg| ["HAA", "HFE", "KFE"].iter().map(move |joint| format!("{leg}_{joint}")));
    assert_eq!(robot.joint_names(), names.collect::<Vec<_>>());
    assert!(robot.qf_limits().iter().all(|&limit| limit == 80.0));
    assert!(robot.qvel_limits().iter().all(|&limit| limit == 7.5));
    let limits = robot.qpos_limits();
    for (joint, expected) in [(0, [-0.72, 0.49]), (3, [-0.49, 0.72]), (6, [-0.72, 0.49]), (9, [-0.49, 0.72])] {
        assert_eq!([limits[(0, joint, 0)], limits[(0, joint, 1)]], expected);
    }
    // The tutorial's pose: the lowest point of each foot is 0.549 m below the base.
    for leg in LEGS {
        let foot = pose_of_row(&robot.link_pose(&format!("{leg}_FOOT")).unwrap(), 0);
        let ball = foot * nalgebra::Point3::new(0.0, 0.0, 0.0225);
        assert!((0.6 - (ball.z - 0.03) - 0.549).abs() < 1e-3, "{leg}: {ball}");
    }
}

/// Equal joint angles give equal foot positions for the bundled robot and the vendor's robot.
#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn feet_of_anymal() {
    let mut sim = sim(SimulationManagerCfg::legged());
    let ids = [bundled(), vendor()].map(|robot| sim.add_robot(robot).unwrap());
    for k in 0..20 {
        for id in ids {
            let column = |name: &String| sim.robot(ids[0]).joint_id(name).unwrap().0;
            let columns: Vec<usize> = sim.robot(id).joint_names().iter().map(column).collect();
            let angle = |(_, joint)| 0.4 * (1.3 * f64::from(k) + 0.7 * columns[joint] as f64).sin();
            sim.robot_mut(id).write_qpos(&Array2::from_shape_fn((1, 12), angle), None, None).unwrap();
        }
        for leg in LEGS {
            let [a, b] = ids.map(|id| pose_of_row(&sim.robot(id).link_pose(&format!("{leg}_FOOT")).unwrap(), 0));
            // The vendor's file contains mounting angles of 12 digits.
            assert!((a.translation.vector - b.translation.vector).amax() < 1e-9, "{leg}: {a} {b}");
        }
    }
}

/// Measurements of 60 s of standing on the ground.
struct StandingResult {
    /// Range of the height of the base in the last 30 s \[m\].
    drift: f64,
    /// Ratio of the sum of the vertical forces on the feet to the weight, mean over the last second.
    weight_ratio: f64,
    /// Number of feet that carried more than 1 N throughout the last second.
    loaded_feet: usize,
    /// Largest contact force on other bodies than the feet in the last 30 s \[N\].
    max_other_force: f64,
}

fn stand(robot: RobotCfg, cfg: SimulationManagerCfg) -> StandingResult {
    let (uid, dt, mut sim) = (robot.uid.clone(), cfg.physics_dt, sim(cfg));
    let robot = sim.add_robot(robot).unwrap();
    let all = sim.add_sensor("all", ContactSensorCfg::for_bodies(format!("{uid}/.*"))).unwrap();
    let steps = |seconds: f64| (seconds / dt).round() as u32;
    sim.update(steps(30.0));
    let foot: Vec<bool> = sim.sensor(all).unwrap().body_names().iter().map(|name| name.ends_with("_FOOT")).collect();
    assert_eq!(foot.iter().filter(|foot| **foot).count(), 4);
    let (mut low, mut high, mut max_other_force, mut carried) = (f64::MAX, f64::MIN, 0.0f64, 0.0);
    let mut least = vec![f64::MAX; foot.len()];
    for step in 0..steps(30.0) {
        sim.update(1);
        let height = sim.robot(robot).root_pose()[(0, 2)];
        (low, high) = (low.min(height), high.max(height));
        let forces = sim.sensor(all).unwrap().net_forces_w();
        for (body, foot) in foot.iter().enumerate() {
            let force = nalgebra::Vector3::from_fn(|k, _| forces[(0, body, k)]);
            if !foot {
                max_other_force = max_other_force.max(force.norm());
            } else if step >= steps(29.0) {
                carried += force.z / f64::from(steps(1.0));
                least[body] = least[body].min(force.z);
            }
        }
    }
    let loaded_feet = (0..foot.len()).filter(|&b| foot[b] && least[b] > 1.0).count();
    StandingResult {
        drift: high - low,
        weight_ratio: carried / (9.81 * sim.robot(robot).total_mass()),
        loaded_feet,
        max_other_force,
    }
}

fn check(name: &str, robot: RobotCfg) {
    let StandingResult { drift, weight_ratio, loaded_feet, max_other_force } =
        stand(robot, SimulationManagerCfg::legged());
    assert!(drift < 5e-3, "{name}: the base drifts by {drift} m");
    assert!((weight_ratio - 1.0).abs() < 0.01, "{name}: the feet carry {weight_ratio} of the weight");
    assert!(loaded_feet == 4 && max_other_force == 0.0, "{name}: {loaded_feet} feet, {max_other_force} N elsewhere");
}

#[test]
fn standing() {
    for payload in [0.0, 10.0] {
        check(&format!("{payload} kg"), RobotCfg { payload: vec![("base".into(), payload)], ..bundled() });
    }
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn standing_of_anymal() {
    check("vendor", vendor());
}

/// Control: with MuJoCo's default contacts the feet creep apart.
#[test]
fn standing_without_the_preset() {
    let stood = stand(bundled(), SimulationManagerCfg { physics_dt: 0.005, ..Default::default() });
    assert!(stood.drift > 5e-3 || stood.max_other_force > 0.0, "drift {} m", stood.drift);
}

#[test]
fn payloads() {
    let mut sim = sim(SimulationManagerCfg::legged());
    let mut add = |payload: &[(&str, f64)]| {
        let payload = payload.iter().map(|(link, mass)| (link.to_string(), *mass)).collect();
        sim.add_robot(RobotCfg { payload, ..bundled() }).map(|id| sim.robot(id).total_mass())
    };
    assert_error(add(&[("base", -1.0)]), "", &["payload", ">= 0"]);
    assert_error(add(&[("base", f64::NAN)]), "", &["payload", "NaN"]);
    assert_error(add(&[("bsae", 1.0)]), "", &["payload", "\"base\""]);
    let mass = add(&[("base", 3.0), (".*_FOOT", 0.5)]).unwrap();
    assert!((mass - 52.13485 - 3.0 - 4.0 * 0.5).abs() < 1e-9);
}
