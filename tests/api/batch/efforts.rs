//! Efforts are those that the solver found in the step, whatever comes into contact at its end.

use super::support::{ball, cfg, free_robot};
use kinetoscope::prelude::*;

/// Efforts of a loaded hinge in every step, beside `balls` that fall one after the other.
fn efforts(balls: usize) -> Vec<f64> {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(1, 1)).unwrap();
    let lever = r#"<robot name="lever"><link name="post"/>
  <joint name="hinge" type="revolute"><parent link="post"/><child link="lever"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="50" velocity="10"/></joint>
  <link name="lever"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link></robot>"#;
    let mut cfg = free_robot(dir.path(), "lever", lever, 2.0);
    (cfg.fix_base, cfg.init_pose) = (true, Pose::translation(0.0, 0.0, 2.0));
    let id = sim.add_robot(cfg).unwrap();
    for i in 0..balls {
        let mut cfg = free_robot(dir.path(), &format!("ball{i}"), &ball(), 0.0);
        cfg.init_pose = Pose::translation(3.0 + i as f64, 0.0, 0.1 + 0.05 * i as f64);
        sim.add_robot(cfg).unwrap();
    }
    sim.robot_mut(id).set_qpos(&kinetoscope::ndarray::array![[0.4]], None, None).unwrap();
    (0..80)
        .map(|_| {
            sim.update(1);
            sim.robot(id).get_qf()[(0, 0)]
        })
        .collect()
}

#[test]
fn contacts_that_come_do_not_change_efforts_that_are_read() {
    let (alone, beside) = (efforts(0), efforts(6));
    // Hanging by its stiffness, the lever asks for m g l cos(q).
    let held = alone.last().unwrap().abs();
    assert!((held - 2.0 * 9.81 * 0.5 * 0.4_f64.cos()).abs() < 0.1, "{held}");
    for (step, (a, b)) in alone.iter().zip(&beside).enumerate() {
        assert!((a - b).abs() < 1e-6 * a.abs().max(1.0), "step {step}: {a} alone, {b} beside the balls");
    }
}
