//! Histories hold what was read before, newest first, for every channel that has one.

use kinetoscope::ndarray::{Array2, ArrayD, ArrayViewD, Axis, arr1};
use kinetoscope::prelude::*;

const LENGTH: usize = 3;

/// What was read at each step, against a history of shape (N, T, ...) that is as long as [`LENGTH`].
fn assert_newest_first(name: &str, read: &[ArrayD<f64>], history: &ArrayViewD<'_, f64>) {
    assert_eq!(history.shape()[1], LENGTH, "{name}");
    for (age, expected) in read.iter().rev().take(LENGTH).enumerate() {
        assert_eq!(history.index_axis(Axis(1), age), expected.view(), "{name}, {age} steps ago");
    }
    // Three readings that are all the same would not tell their order.
    assert!(read[read.len() - 1] != read[read.len() - 2], "{name} does not change");
}

#[test]
fn contacts_remember_total_and_friction_forces() {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    let cube = RigidObjectCfg { uid: "cube".into(), shape: ObjectShape::cube(0.2), ..Default::default() };
    let cube = sim.add_rigid_object(cube).unwrap();
    let mut pose = Array2::zeros((2, 7));
    for env in 0..2 {
        // Onto an edge, so that it tumbles: forces of all directions.
        let half = 0.2 + 0.3 * env as f64;
        pose.row_mut(env).assign(&arr1(&[0.0, 0.0, 0.16, f64::cos(half), f64::sin(half), 0.0, 0.0]));
    }
    sim.rigid_object_mut(cube).write_pose(&pose, None).unwrap();
    let sampling = SamplingCfg { history_length: LENGTH, ..SamplingCfg::default() };
    let id = sim.add_sensor("contact", ContactSensorCfg { sampling, ..ContactSensorCfg::of("cube") }).unwrap();
    let (mut total, mut friction) = (Vec::new(), Vec::new());
    for _ in 0..20 {
        sim.update(1);
        let sensor = sim.sensor(id).unwrap();
        total.push(sensor.total_forces_w().to_owned().into_dyn());
        friction.push(sensor.friction_forces_w().to_owned().into_dyn());
        let [sum, net] = [sensor.total_forces_w(), sensor.net_forces_w()];
        let off = (&sum - &net - sensor.friction_forces_w()).iter().fold(0.0_f64, |far, d| far.max(d.abs()));
        // Sums of a few forces of less than 1e3 N.
        assert!(off < 1e-11, "{off}");
    }
    let sensor = sim.sensor(id).unwrap();
    assert_newest_first("total", &total, &sensor.total_forces_w_history().into_dyn());
    assert_newest_first("friction", &friction, &sensor.friction_forces_w_history().into_dyn());
}

#[test]
fn actuators_remember_controls_and_forces() {
    let (mut sim, robot) = super::arm(2);
    let cfg = ActuatorStateCfg {
        sampling: SamplingCfg { history_length: LENGTH, ..SamplingCfg::default() },
        ..ActuatorStateCfg::default()
    };
    let id = sim.add_sensor("actuators", cfg).unwrap();
    let (mut controls, mut forces) = (Vec::new(), Vec::new());
    for step in 0..8 {
        let target = Array2::from_elem((2, 6), 0.02 * f64::from(step));
        sim.robot_mut(robot).set_qpos(&target, None, None).unwrap();
        sim.update(1);
        let sensor = sim.sensor(id).unwrap();
        controls.push(sensor.controls().to_owned().into_dyn());
        forces.push(sensor.forces().to_owned().into_dyn());
    }
    let sensor = sim.sensor(id).unwrap();
    assert_newest_first("controls", &controls, &sensor.control_history().into_dyn());
    assert_newest_first("forces", &forces, &sensor.force_history().into_dyn());
}

#[test]
fn a_frame_transformer_tells_where_its_source_is() {
    let (mut sim, robot) = super::arm(2);
    let cfg = FrameTransformerCfg::from("link3", vec![TargetFrameCfg::of("ee_link")]);
    let id = sim.add_sensor("frames", cfg).unwrap();
    sim.update(40);
    let place = sim.robot(robot).link_names().iter().position(|name| *name == "link3").unwrap();
    let links = sim.robot(robot).get_link_poses();
    let link = links.index_axis(Axis(1), place);
    let sensor = sim.sensor(id).unwrap();
    for env in 0..2 {
        for k in 0..4 {
            // w and -w are the same orientation; both come from MuJoCo's body quaternion.
            let (ours, theirs) = (sensor.source_quat_w()[(env, k)], link[(env, 3 + k)]);
            assert!((ours - theirs).abs() < 1e-12, "{ours} {theirs}");
        }
        for k in 0..3 {
            assert!((sensor.source_pos_w()[(env, k)] - link[(env, k)]).abs() < 1e-12);
        }
    }
    assert!(sensor.source_quat_w()[(0, 0)] < 0.9999, "it has turned");
}
