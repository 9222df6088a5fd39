//! What only files of MuJoCo 4.x have; 2.2.2 refuses such a file.

use super::{empty, passive, robot};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::{TARGET, Target};

/// A pendulum; `%` are attributes of its body and of its joint, and what stands behind the bodies.
fn pendulum(body: &str, joint: &str, after: &str) -> String {
    format!(
        r#"<mujoco><compiler angle="radian"/><worldbody><body name="base"><geom size="0.01" mass="1"/>
        <body name="arm" {body}><joint name="j" axis="0 1 0" {joint}/><geom size="0.02" pos="0.3 0 0" mass="1"/></body>
        </body></worldbody>{after}</mujoco>"#
    )
}

/// Adds a robot; `None` where this MuJoCo does not know what is in its file.
fn added(cfg: RobotCfg) -> Option<(SimulationManager, RobotId)> {
    let mut sim = empty(1);
    match sim.add_robot(cfg) {
        Ok(id) => {
            assert_eq!(TARGET, Target::V4);
            Some((sim, id))
        }
        Err(error) => {
            assert!(TARGET == Target::V2 && matches!(error, Error::RobotFile { .. }), "{error}");
            assert!(error.to_string().contains("XML"), "{error}");
            None
        }
    }
}

/// A body that MuJoCo lifts by half is lifted by the other half, and no further.
#[test]
fn gravity_that_the_file_compensates_is_not_compensated_twice() {
    let Some((mut sim, id)) = added(passive("r", &pendulum(r#"gravcomp="0.5""#, "", ""))) else { return };
    let start = sim.robot(id).get_qpos();
    sim.robot_mut(id).set_gravity_compensation(true, None, None).unwrap();
    sim.update(500);
    let off = (sim.robot(id).get_qpos() - &start)[(0, 0)];
    assert!(off.abs() < 1e-9, "{off}");
    sim.robot_mut(id).set_gravity_compensation(false, None, None).unwrap();
    sim.update(50);
    // Half of g at 0.3 m: 16.35 rad/s² times (0.1 s)² / 2, while it is near the horizon.
    let fallen = (sim.robot(id).get_qpos() - &start)[(0, 0)];
    assert!((fallen - 0.0817).abs() < 4e-3, "{fallen}");
}

/// The file's limit of actuators' forces is that of the drive, and the configuration may raise it.
#[test]
fn the_limit_of_actuator_forces_is_the_drives() {
    let servo = r#"<actuator><position joint="j" kp="100"/></actuator>"#;
    let text = pendulum("", r#"actuatorfrcrange="-5 5""#, servo);
    for model in [DriveModel::Implicit, DriveModel::Actuator] {
        let drive = DriveCfg { model, ..Default::default() };
        let Some((sim, id)) = added(RobotCfg { drive, ..robot("r", &text) }) else { return };
        assert_eq!(sim.robot(id).qf_limits()[(0, 0)], 5.0);
        let drive = DriveCfg { model, max_effort: Some(20.0.into()), ..Default::default() };
        let Some((mut sim, id)) = added(RobotCfg { drive, ..robot("r", &text) }) else { return };
        assert_eq!((sim.robot(id).qf_limits()[(0, 0)], sim.batch().model().joint_actuator_force(0)), (20.0, None));
        sim.robot_mut(id).set_qpos(&Array2::from_elem((1, 1), 1.0), None, None).unwrap();
        sim.update(1);
        let effort = sim.robot(id).get_qf()[(0, 0)];
        assert!((effort.abs() - 20.0).abs() < 1e-6, "{model:?}: {effort}");
    }
}

#[test]
fn sensors_of_actuator_forces_are_left_out_by_name() {
    let after = r#"<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
        <sensor><jointactuatorfrc name="felt" joint="j"/><tendonactuatorfrc name="pulled" tendon="t"/>
        <jointpos name="angle" joint="j"/></sensor>"#;
    let Some((sim, _)) = added(robot("r", &pendulum("", "", after))) else { return };
    assert_eq!(sim.batch().model().nsensor(), 1);
    for name in ["felt", "pulled"] {
        let is_named = |d: &&Diagnostic| d.message.contains(&format!("sensor {name:?}"));
        assert_eq!(sim.diagnostics().iter().filter(is_named).count(), 1, "{name}: {:?}", sim.diagnostics());
    }
}
