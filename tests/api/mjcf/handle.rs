//! The handle of a part: names, reads and writes per environment, mocap bodies.

use super::*;
use kinetoscope::mujoco::ObjectKind;
use kinetoscope::ndarray::{Array2, Axis, array};
use kinetoscope::sensors::{FrameTransformerCfg, TargetFrameCfg};
use kinetoscope::sim::{ActuatorIndex, Error};
use kinetoscope_testkit::error_tables::assert_error;

#[test]
fn reads_and_writes() {
    let (mut sim, part) = with(3, MACHINE);
    let read = sim.mjcf_part(part);
    assert_eq!(read.joint_names()[..4], ["shoulder", "wrist", "rail", "free"]);
    assert_eq!(read.actuator_names(), ["servo", "pull", "push"]);
    let model = alone(MACHINE);
    assert_eq!((read.uid(), read.cfg()), ("m", &MjcfPartCfg::text("m", MACHINE)));
    assert_eq!((read.model().nq(), read.model().body_mass()), (model.nq(), model.body_mass()));
    let sites = (0..model.nsite()).map(|site| model.name(ObjectKind::Site, site).unwrap());
    assert_eq!(read.site_names().to_vec(), sites.collect::<Vec<_>>());
    assert_eq!(read.qpos_columns(&["free", "shoulder"]).unwrap(), [6..13, 0..1]);
    assert_eq!(read.qvel_columns(&["free", "wrist"]).unwrap(), [5..11, 1..4]);
    assert_eq!(read.actuator_ids(&["pu.*"]).unwrap(), [ActuatorIndex(1), ActuatorIndex(2)]);
    assert_error(read.actuator_ids(&["srevo"]), "", &["MJCF part \"m\"", "\"servo\""]);
    assert_error(read.body_pose("hnad"), "", &["\"hand\""]);

    let start = read.qpos();
    assert!((start[(0, 0)] - 10_f64.to_radians()).abs() < 1e-15, "degrees of the file are radians here");
    let mut row = start.select(Axis(0), &[1]);
    (row[(0, 0)], row[(0, 9)]) = (0.5, 2.0);
    sim.mjcf_part_mut(part).write_qpos(&row, Some(&[EnvId(1)])).unwrap();
    let now = sim.mjcf_part(part).qpos();
    assert_eq!((now.row(0), now[(1, 0)]), (start.row(0), 0.5));
    assert_eq!(now[(1, 9)], 1.0, "quaternions are normalized");

    sim.mjcf_part_mut(part).set_ctrl(&array![[0.7]], Some(&[ActuatorIndex(0)]), Some(&[EnvId(2)])).unwrap();
    assert_eq!(sim.mjcf_part(part).ctrl(), array![[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.7, 0.0, 0.0]]);
    sim.update(1);
    let force = sim.mjcf_part(part).actuator_force();
    // A position servo: kp (ctrl - angle), evaluated before the step.
    for (env, ctrl) in [(0, 0.0), (2, 0.7)] {
        assert!((force[(env, 0)] - 3.0 * (ctrl - start[(0, 0)])).abs() < 1e-12, "{force}");
    }
    sim.reset(None).unwrap();
    assert_eq!(sim.mjcf_part(part).ctrl(), Array2::<f64>::zeros((3, 3)));
    assert_eq!(sim.mjcf_part(part).qpos(), start);
    // Mistakes that are not covered by `every_writer`: quaternions among positions, columns for actuators. Regression:
    // of two columns for one actuator the last one was used without an error.
    let nq = start.ncols();
    let mut write = sim.mjcf_part_mut(part);
    assert_error(write.write_qpos(&Array2::zeros((3, nq - 1)), None), "", &["write_qpos", &nq.to_string()]);
    assert_error(write.write_qpos(&Array2::zeros((1, nq)), None), "", &["quaternion"]);
    assert_error(write.set_ctrl(&array![[0.0]], Some(&[ActuatorIndex(3)]), None), "", &["actuator 3"]);
    let twice = [ActuatorIndex(1), ActuatorIndex(0), ActuatorIndex(1)];
    let two_columns = write.set_ctrl(&array![[0.1, 0.2, 0.3]], Some(&twice), None);
    assert!(matches!(two_columns, Err(Error::RepeatedColumn { first: 0, second: 2, .. })), "{two_columns:?}");
    assert_error(two_columns, "", &["set_ctrl has two columns for actuator \"pull\""]);
    assert!(write.read().ctrl().iter().all(|c| *c == 0.0), "nothing was set");
    assert_eq!(write.read().qpos(), start);
}

/// A mocap body takes its written pose in its environment, and welded bodies follow.
#[test]
fn mocap_bodies() {
    let text = MACHINE.replace("</equality>", "<weld body1=\"target\" body2=\"ball\"/></equality>");
    let (mut sim, part) = with(2, text);
    let frames = FrameTransformerCfg::new("m/target", vec![TargetFrameCfg::for_bodies("m/ball")]);
    let id = sim.add_sensor("frames", frames).unwrap();
    let place = array![[0.6, 0.4, 0.5, 2.0, 0.0, 0.0, 0.0]];
    sim.mjcf_part_mut(part).write_mocap_pose("target", &place, Some(&[EnvId(1)])).unwrap();
    let at = |sim: &SimulationManager, body: &str, env| {
        let pose = sim.mjcf_part(part).body_pose(body).unwrap();
        [0, 1, 2, 3].map(|k| pose[(env, k)])
    };
    assert_eq!([at(&sim, "target", 0), at(&sim, "target", 1)], [[1.0; 4], [0.6, 0.4, 0.5, 1.0]]);
    assert_eq!(sim.sensor(id).unwrap().source_pos_w()[(1, 0)], 0.6, "seen at once");
    sim.update(1000);
    assert_eq!(at(&sim, "target", 1), [0.6, 0.4, 0.5, 1.0], "it stays");
    let read = sim.mjcf_part(part);
    let all = read.body_poses();
    assert_eq!(all.dim(), (2, read.body_names().len(), 7));
    for (body, name) in read.body_names().iter().enumerate() {
        assert_eq!(all.index_axis(Axis(1), body), read.body_pose(name).unwrap(), "{name}");
    }
    // The ball started at (0.5, 0.3, 0.3), with the target at (1, 1, 1): (-0.5, -0.7, -0.7) relative to the target.
    // Welds are soft: they sag slightly, and the tendon of the ball's neighbors does not touch it.
    for (env, x, y) in [(1, 0.1, -0.3), (0, 0.5, 0.3)] {
        let ball = at(&sim, "ball", env);
        assert!((ball[0] - x).abs() < 1e-3 && (ball[1] - y).abs() < 1e-3, "{env}: {ball:?}");
    }
    // Adding an entity does not move it.
    sim.add_rigid_object(kinetoscope_testkit::worlds::object("cube", ObjectShape::cube(0.1), [5.0, 0.0, 1.0])).unwrap();
    assert_eq!(at(&sim, "target", 1), [0.6, 0.4, 0.5, 1.0]);
    assert_error(sim.mjcf_part_mut(part).write_mocap_pose("ball", &place, None), "", &["\"target\"", "mocap"]);
    sim.reset(None).unwrap();
    assert_eq!(at(&sim, "target", 1), [1.0; 4]);
}
