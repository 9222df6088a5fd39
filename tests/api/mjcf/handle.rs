//! What a program reads and writes of a part.

use super::{empty, machine};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::ObjectKind;

#[test]
fn positions_velocities_and_controls_are_per_environment() {
    let mut sim = empty(3);
    let part = sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
    let read = sim.mjcf_part(part);
    assert_eq!(read.joint_names()[..4], ["shoulder", "wrist", "rail", "free"]);
    assert_eq!(read.actuator_names(), ["servo", "pull", "push"]);
    let model = super::alone(&machine());
    assert_eq!((read.uid(), read.cfg()), ("m", &MjcfCfg::text("m", machine())));
    assert_eq!((read.model().nq(), read.model().body_mass()), (model.nq(), model.body_mass()));
    let sites = (0..model.nsite()).map(|site| model.name(ObjectKind::Site, site).unwrap());
    assert_eq!(read.site_names().to_vec(), sites.collect::<Vec<_>>());
    assert_eq!(read.qpos_columns(&["free", "shoulder"]).unwrap(), [6..13, 0..1]);
    assert_eq!(read.qvel_columns(&["free", "wrist"]).unwrap(), [5..11, 1..4]);
    assert_eq!(read.actuator_ids(&["pu.*"]).unwrap(), [ActuatorIndex(1), ActuatorIndex(2)]);
    let error = read.actuator_ids(&["srevo"]).unwrap_err().to_string();
    assert!(error.contains("part \"m\"") && error.contains("\"servo\""), "{error}");
    let error = read.body_pose("hnad").unwrap_err().to_string();
    assert!(error.contains("\"hand\""), "{error}");

    let mut qpos = read.get_qpos();
    assert!((qpos[(0, 0)] - 10_f64.to_radians()).abs() < 1e-15, "degrees of the file are radians here");
    let start = qpos.clone();
    qpos[(1, 0)] = 0.5;
    qpos[(1, 9)] = 2.0;
    let rows = qpos.select(kinetoscope::ndarray::Axis(0), &[1]);
    sim.mjcf_part_mut(part).write_qpos(&rows, Some(&[EnvId(1)])).unwrap();
    let now = sim.mjcf_part(part).get_qpos();
    assert_eq!(now.row(0), start.row(0));
    assert_eq!(now[(1, 0)], 0.5);
    assert_eq!(now[(1, 9)], 1.0, "quaternions are normalised");

    let servo = [ActuatorIndex(0)];
    sim.mjcf_part_mut(part).set_ctrl(&array![[0.7]], Some(&servo), Some(&[EnvId(2)])).unwrap();
    assert_eq!(sim.mjcf_part(part).get_ctrl(), array![[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.7, 0.0, 0.0]]);
    sim.update(1);
    let force = sim.mjcf_part(part).get_actuator_force();
    // A position servo: kp (ctrl - angle), of the state before the step.
    let angle = start[(0, 0)];
    assert!((force[(0, 0)] - 3.0 * (0.0 - angle)).abs() < 1e-12, "{force}");
    assert!((force[(2, 0)] - 3.0 * (0.7 - angle)).abs() < 1e-12, "{force}");
    sim.reset(None).unwrap();
    assert_eq!(sim.mjcf_part(part).get_ctrl(), Array2::<f64>::zeros((3, 3)));
    assert_eq!(sim.mjcf_part(part).get_qpos(), start);
}

/// A body moved by hand goes where it is put, in its environment; what is welded to it follows.
#[test]
fn bodies_moved_by_hand_are_put_somewhere() {
    let mut sim = empty(2);
    let text = machine().replace("</equality>", "<weld body1=\"target\" body2=\"ball\"/></equality>");
    let part = sim.add_mjcf(MjcfCfg::text("m", text)).unwrap();
    let id =
        sim.add_sensor("frames", FrameTransformerCfg::from("m/target", vec![TargetFrameCfg::of("m/ball")])).unwrap();
    let place = array![[0.6, 0.4, 0.5, 2.0, 0.0, 0.0, 0.0]];
    sim.mjcf_part_mut(part).write_mocap_pose("target", &place, Some(&[EnvId(1)])).unwrap();
    let at = |sim: &SimulationManager, body: &str, env| {
        let pose = sim.mjcf_part(part).body_pose(body).unwrap();
        [0, 1, 2, 3].map(|k| pose[(env, k)])
    };
    assert_eq!([at(&sim, "target", 0), at(&sim, "target", 1)], [[1.0, 1.0, 1.0, 1.0], [0.6, 0.4, 0.5, 1.0]]);
    assert_eq!(sim.sensor(id).unwrap().source_pos_w()[(1, 0)], 0.6, "seen at once");
    let before = at(&sim, "ball", 1);
    sim.update(1000);
    assert_eq!(at(&sim, "target", 1), [0.6, 0.4, 0.5, 1.0], "it stays");
    // The ball started at (0.5, 0.3, 0.3), relative to a target at (1, 1, 1): (-0.5, -0.7, -0.7) from it. Welds are soft: they
    // hang a little low, and the string of the ball's neighbours does not touch it.
    let ball = at(&sim, "ball", 1);
    assert!((ball[0] - 0.1).abs() < 1e-3 && (ball[1] + 0.3).abs() < 1e-3, "{before:?} {ball:?}");
    let others = at(&sim, "ball", 0);
    assert!((others[0] - 0.5).abs() < 1e-3 && (others[1] - 0.3).abs() < 1e-3, "{others:?}");
    // More in the scene does not move it.
    sim.add_rigid_object(RigidObjectCfg { init_pose: Pose::translation(5.0, 0.0, 1.0), ..Default::default() }).unwrap();
    assert_eq!(at(&sim, "target", 1), [0.6, 0.4, 0.5, 1.0]);
    let mut write = sim.mjcf_part_mut(part);
    let error = write.write_mocap_pose("ball", &place, None).unwrap_err().to_string();
    assert!(error.contains("\"target\"") && error.contains("mocap"), "{error}");
    let zero = Array2::zeros((1, 7));
    assert!(write.write_mocap_pose("target", &zero, None).unwrap_err().to_string().contains("quaternion"));
    sim.reset(None).unwrap();
    assert_eq!(at(&sim, "target", 1), [1.0; 4]);
}

#[test]
fn mistakes_are_errors_and_nothing_is_written() {
    let mut sim = empty(2);
    let part = sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
    let before = sim.mjcf_part(part).get_qpos();
    let (nq, nv) = (before.ncols(), sim.mjcf_part(part).get_qvel().ncols());
    let mut write = sim.mjcf_part_mut(part);
    let text = write.write_qpos(&Array2::zeros((2, nq - 1)), None).unwrap_err().to_string();
    assert!(text.contains("write_qpos") && text.contains(&nq.to_string()), "{text}");
    let text = write.write_qpos(&Array2::zeros((1, nq)), None).unwrap_err().to_string();
    assert!(text.contains("quaternion"), "{text}");
    let text = write.write_qvel(&Array2::from_elem((1, nv), f64::NAN), None).unwrap_err().to_string();
    assert!(text.contains("finite"), "{text}");
    assert!(write.write_qvel(&Array2::zeros((1, nv)), Some(&[EnvId(2)])).is_err());
    let text = write.set_ctrl(&array![[0.0]], Some(&[ActuatorIndex(3)]), None).unwrap_err().to_string();
    assert!(text.contains("actuator 3"), "{text}");
    // Of two columns for one actuator the last one held, and nothing was said.
    let twice = [ActuatorIndex(1), ActuatorIndex(0), ActuatorIndex(1)];
    let error = write.set_ctrl(&array![[0.1, 0.2, 0.3]], Some(&twice), None).unwrap_err();
    assert!(matches!(error, Error::RepeatedColumn { first: 0, second: 2, .. }), "{error}");
    assert!(error.to_string().contains("set_ctrl has two columns for actuator \"pull\""), "{error}");
    assert!(write.read().get_ctrl().iter().all(|c| *c == 0.0), "nothing was set");
    assert_eq!(sim.mjcf_part(part).get_qpos(), before);
}
