//! Error messages of `set_qpos_target`, `write_qpos`, `reset` and look-ups by name; memory layouts of arrays. The
//! module `every_writer` covers all writers and kinds of errors.

use super::support::{LIMIT, bits, chain, robot, sim};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::RobotMut;

fn three_joints(num_envs: usize) -> (SimulationManager, RobotId) {
    let (dir, mut sim) = (tempfile::tempdir().unwrap(), sim(num_envs));
    let control_parts = vec![("wrist".into(), vec!["j[23]".into()])];
    let cfg = RobotCfg { control_parts, ..robot(dir.path(), "r", &chain(4, "revolute", LIMIT)) };
    let id = sim.add_robot(cfg).unwrap();
    (sim, id)
}

type Row<'a> = (Array2<f64>, Option<&'a [usize]>, Option<&'a [usize]>, &'a [&'a str]);

#[test]
fn messages() {
    let (mut sim, id) = three_joints(4);
    sim.update(3);
    let zeros = Array2::<f64>::zeros;
    let rows: &[Row<'_>] = &[
        (zeros((4, 2)), None, None, &["[4, 2]", "[4, 3]", "environments, joints"]),
        (zeros((3, 3)), None, None, &["[3, 3]", "[4, 3]", "one row for all"]),
        (zeros((4, 0)), None, None, &["[4, 0]"]),
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
        let (joints, envs) = (joints.as_deref(), envs.as_deref());
        for name in ["set_qpos_target", "write_qpos"] {
            let mut robot = sim.robot_mut(id);
            let write = if name == "set_qpos_target" { RobotMut::set_qpos_target } else { RobotMut::write_qpos };
            let message = write(&mut robot, values, joints, envs).unwrap_err().to_string();
            assert!(expected.iter().all(|part| message.contains(part)), "row {i}, {name}: {expected:?} in {message:?}");
            assert!(message.contains(name) || message.contains("does not exist"), "{message:?}");
            assert_eq!(bits(&sim), before, "row {i}, {name}");
        }
    }
    // A reset with an unknown environment resets no environment.
    for bad in [4, usize::MAX] {
        let message = sim.reset(Some(&[EnvId(0), EnvId(bad)])).unwrap_err().to_string();
        assert!(message.contains(&format!("environment {bad} does not exist")), "{message}");
        assert_eq!(bits(&sim), before);
    }
    sim.reset(Some(&[])).unwrap();
    assert_eq!(bits(&sim), before);
    sim.reset(Some(&[EnvId(1), EnvId(1)])).unwrap();
    assert_eq!(sim.time()[1], 0.0);
    assert_ne!(sim.time()[0], 0.0);
    let robot = sim.robot(id);
    for (message, expected) in [
        (robot.joint_id("J1").unwrap_err().to_string(), ["joint \"J1\"", "\"j1\""]),
        (robot.joint_ids("arm").unwrap_err().to_string(), ["control part \"arm\"", "\"wrist\""]),
        (robot.link_pose("link2").unwrap_err().to_string(), ["link \"link2\"", "\"l2\""]),
        (sim.entities().robot_id("R").unwrap_err().to_string(), ["robot \"R\"", "\"r\""]),
        (self::sim(1).entities().robot_id("r").unwrap_err().to_string(), ["robot \"r\"", "no names are defined"]),
    ] {
        assert!(expected.iter().all(|part| message.contains(part)), "{expected:?} in {message:?}");
    }
}

#[test]
fn layouts() {
    let (mut sim, id) = three_joints(3);
    let rows = Array2::from_shape_fn((3, 3), |(e, j)| 0.1 * e as f64 + 0.02 * j as f64);
    let columns = rows.t().as_standard_layout().into_owned().reversed_axes();
    sim.robot_mut(id).write_qpos(&columns, None, None).unwrap();
    assert_eq!(sim.robot(id).qpos(), rows);
    // Columns and rows in any order, each once.
    let (joints, envs) = ([JointIndex(2), JointIndex(0)], [EnvId(2), EnvId(0)]);
    sim.robot_mut(id).write_qpos(&array![[0.7, 0.6], [0.5, 0.4]], Some(&joints), Some(&envs)).unwrap();
    let q = sim.robot(id).qpos();
    assert_eq!([q[(2, 2)], q[(2, 0)], q[(0, 2)], q[(0, 0)]], [0.7, 0.6, 0.5, 0.4]);
    assert_eq!([q[(2, 1)], q[(1, 0)]], [rows[(2, 1)], rows[(1, 0)]]);
    // Positions outside of the limits are clamped.
    sim.robot_mut(id).write_qpos(&array![[5.0, -5.0, f64::MAX]], None, None).unwrap();
    assert_eq!(sim.robot(id).qpos().row(1), array![1.0, -1.0, 1.0]);
    sim.robot_mut(id).set_qpos_target(&array![[f64::MIN, 5.0, 0.0]], None, None).unwrap();
    assert_eq!(sim.robot(id).qpos_target().row(2), array![-1.0, 1.0, 0.0]);
}
