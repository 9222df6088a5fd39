//! `set_qpos`, `write_qpos`, `reset`, `link_pose` and their kin.

use super::support::{INERTIAL, bits, cfg, robot};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;

fn three_joints(sim: &mut SimulationManager) -> RobotId {
    let dir = tempfile::tempdir().unwrap();
    let mut urdf = String::from("<robot name=\"r\"><link name=\"l0\"/>");
    for i in 1..4 {
        urdf += &format!(
            "<link name=\"l{i}\">{INERTIAL}</link><joint name=\"j{i}\" type=\"revolute\"><parent link=\"l{}\"/>\
             <child link=\"l{i}\"/><axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" effort=\"9\" velocity=\"1\"/></joint>",
            i - 1
        );
    }
    let cfg = robot(dir.path(), "r", &(urdf + "</robot>"));
    sim.add_robot(RobotCfg { control_parts: vec![("wrist".into(), vec!["j[23]".into()])], ..cfg }).unwrap()
}

type Row<'a> = (Array2<f64>, Option<&'a [usize]>, Option<&'a [usize]>, &'a [&'a str]);

#[test]
fn arrays_that_do_not_fit_are_refused_and_nothing_is_written() {
    let mut sim = SimulationManager::new(cfg(4)).unwrap();
    let id = three_joints(&mut sim);
    sim.update(3);
    let zeros = Array2::<f64>::zeros;
    let rows: &[Row<'_>] = &[
        (zeros((4, 2)), None, None, &["[4, 2]", "[4, 3]", "environments, joints"]),
        (zeros((3, 3)), None, None, &["[3, 3]", "[4, 3]", "one row for all"]),
        (zeros((0, 3)), None, None, &["[0, 3]"]),
        (zeros((4, 0)), None, None, &["[4, 0]"]),
        (zeros((0, 0)), None, None, &["[0, 0]"]),
        (zeros((4, 3)), Some(&[0]), None, &["[4, 3]", "[4, 1]"]),
        (zeros((4, 1)), Some(&[]), None, &["[4, 1]", "[4, 0]"]),
        (zeros((4, 3)), None, Some(&[0, 1]), &["[4, 3]", "[2, 3]"]),
        (zeros((4, 1)), Some(&[3]), None, &["joint 3 does not exist", "there are 3 (0 to 2)"]),
        (zeros((4, 1)), Some(&[usize::MAX]), None, &["joint 18446744073709551615"]),
        (zeros((1, 3)), None, Some(&[4]), &["environment 4 does not exist", "there are 4 (0 to 3)"]),
        (zeros((2, 3)), None, Some(&[0, usize::MAX]), &["environment 18446744073709551615"]),
        (array![[0.5, f64::NAN, 0.5]], None, None, &["[0, 1]", "\"j2\"", "NaN", "finite"]),
        (array![[0.5, 0.5, f64::INFINITY]], None, None, &["[0, 2]", "\"j3\"", "inf"]),
        (array![[0.5], [f64::NEG_INFINITY]], Some(&[2]), Some(&[0, 3]), &["[1, 0]", "\"j3\"", "-inf"]),
    ];
    let before = bits(&sim);
    for (i, (values, joints, envs, expected)) in rows.iter().enumerate() {
        let joints: Option<Vec<_>> = joints.map(|j| j.iter().map(|&i| JointIndex(i)).collect());
        let envs: Option<Vec<_>> = envs.map(|e| e.iter().map(|&i| EnvId(i)).collect());
        for name in ["set_qpos", "write_qpos"] {
            let mut robot = sim.robot_mut(id);
            let result = match name {
                "set_qpos" => robot.set_qpos(values, joints.as_deref(), envs.as_deref()),
                _ => robot.write_qpos(values, joints.as_deref(), envs.as_deref()),
            };
            let message = result.unwrap_err().to_string();
            for part in *expected {
                assert!(message.contains(part), "row {i}, {name}: {part:?} is not in {message:?}");
            }
            assert!(message.contains(name) || message.contains("does not exist"), "{message:?}");
            assert_eq!(bits(&sim), before, "row {i}, {name}");
        }
    }
}

#[test]
fn arrays_of_any_layout_mean_the_same() {
    let mut sim = SimulationManager::new(cfg(3)).unwrap();
    let id = three_joints(&mut sim);
    let rows = Array2::from_shape_fn((3, 3), |(e, j)| 0.1 * e as f64 + 0.02 * j as f64);
    let columns = rows.t().as_standard_layout().into_owned().reversed_axes();
    sim.robot_mut(id).write_qpos(&columns, None, None).unwrap();
    assert_eq!(sim.robot(id).get_qpos(), rows);
    // Columns and rows in any order, each once.
    sim.robot_mut(id)
        .write_qpos(&array![[0.7, 0.6], [0.5, 0.4]], Some(&[JointIndex(2), JointIndex(0)]), Some(&[EnvId(2), EnvId(0)]))
        .unwrap();
    let q = sim.robot(id).get_qpos();
    assert_eq!([q[(2, 2)], q[(2, 0)], q[(0, 2)], q[(0, 0)]], [0.7, 0.6, 0.5, 0.4]);
    assert_eq!([q[(2, 1)], q[(1, 0)]], [rows[(2, 1)], rows[(1, 0)]]);
    // Outside of the limits: clamped.
    sim.robot_mut(id).write_qpos(&array![[5.0, -5.0, f64::MAX]], None, None).unwrap();
    assert_eq!(sim.robot(id).get_qpos().row(1), array![1.0, -1.0, 1.0]);
    sim.robot_mut(id).set_qpos(&array![[f64::MIN, 5.0, 0.0]], None, None).unwrap();
    assert_eq!(sim.robot(id).get_target_qpos().row(2), array![-1.0, 1.0, 0.0]);
    // Nobody is nobody.
    sim.robot_mut(id).set_qpos(&Array2::zeros((0, 3)), None, Some(&[])).unwrap();
    sim.robot_mut(id).set_qpos(&Array2::zeros((3, 0)), Some(&[]), None).unwrap();
    assert_eq!(sim.robot(id).get_target_qpos().row(2), array![-1.0, 1.0, 0.0]);
}

#[test]
fn reset_of_an_environment_that_does_not_exist_resets_none() {
    let mut sim = SimulationManager::new(cfg(3)).unwrap();
    three_joints(&mut sim);
    sim.update(5);
    let before = bits(&sim);
    for bad in [3, usize::MAX] {
        let message = sim.reset(Some(&[EnvId(0), EnvId(bad)])).unwrap_err().to_string();
        assert!(message.contains(&format!("environment {bad} does not exist")), "{message}");
        assert_eq!(bits(&sim), before);
    }
    sim.reset(Some(&[])).unwrap();
    assert_eq!(bits(&sim), before);
    sim.reset(Some(&[EnvId(1), EnvId(1)])).unwrap();
    assert_eq!(sim.time()[1], 0.0);
    assert_ne!(sim.time()[0], 0.0);
}

#[test]
fn names_that_do_not_exist_list_the_candidates() {
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let id = three_joints(&mut sim);
    let robot = sim.robot(id);
    let messages = [
        (robot.joint_id("J1").unwrap_err().to_string(), ["joint \"J1\"", "\"j1\""]),
        (robot.get_joint_ids("arm").unwrap_err().to_string(), ["control part \"arm\"", "\"wrist\""]),
        (robot.link_pose("link2").unwrap_err().to_string(), ["link \"link2\"", "\"l2\""]),
        (sim.robot_id("R").unwrap_err().to_string(), ["robot \"R\"", "\"r\""]),
    ];
    for (message, expected) in messages {
        for part in expected {
            assert!(message.contains(part), "{part:?} is not in {message:?}");
        }
    }
    let empty = SimulationManager::new(cfg(1)).unwrap();
    assert!(empty.robot_id("r").unwrap_err().to_string().contains("there are none"));
}
