//! Drives that a file's actuators say, and what the configuration changes of them.

use super::{empty, robot};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;

/// Five joints: a servo with a gear, a motor, a servo of velocity, two on a tendon, and one that nothing acts on; the last
/// two actuators are of one joint.
const MACHINE: &str = r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="base"><geom size="0.1" mass="1"/>
    <body name="a"><joint name="servo" axis="0 0 1" armature="0.1"/><geom size="0.05" mass="1"/></body>
    <body name="b"><joint name="motor" axis="0 0 1" damping="0.2"/><geom size="0.05" mass="1"/></body>
    <body name="c"><joint name="wheel" axis="0 0 1"/><geom size="0.05" mass="1"/></body>
    <body name="d"><joint name="finger1" axis="0 0 1"/><geom size="0.05" mass="1"/></body>
    <body name="e"><joint name="finger2" axis="0 0 1"/><geom size="0.05" mass="1"/></body>
    <body name="f"><joint name="idle" axis="0 0 1" frictionloss="0.3"/><geom size="0.05" mass="1"/></body>
  </body></worldbody>
  <tendon><fixed name="both"><joint joint="finger1" coef="0.5"/><joint joint="finger2" coef="-2"/></fixed></tendon>
  <actuator>
    <position name="p" joint="servo" kp="30" gear="2" forcerange="-4 4"/>
    <motor name="m" joint="motor" gear="-3" ctrlrange="-1 2"/>
    <velocity name="v" joint="wheel" kv="0.7"/>
    <position name="t" tendon="both" kp="100" forcerange="-10 10"/>
    <motor name="m2" joint="motor" gear="1" ctrlrange="-5 5"/>
  </actuator></mujoco>"#;

const JOINTS: [&str; 6] = ["servo", "motor", "wheel", "finger1", "finger2", "idle"];

#[test]
fn gains_and_limits_are_those_of_the_file_unless_the_configuration_names_others() {
    let mut sim = empty(1);
    let id = sim.add_robot(robot("m", MACHINE)).unwrap();
    let robot_ = sim.robot(id);
    assert_eq!(robot_.joint_names(), JOINTS);
    let infinite = f64::INFINITY;
    // Gear and coefficients count twice in gains and once in efforts; 1e4 and 1e3 where the file says only that there is an
    // effort.
    assert_eq!(robot_.get_stiffness(), array![[120.0, 1e4, 0.0, 25.0, 400.0, 0.0]]);
    assert_eq!(robot_.get_damping(), array![[0.0, 1e3, 0.7, 0.0, 0.0, 0.0]]);
    assert_eq!(robot_.qf_limits(), array![[8.0, 11.0, infinite, 5.0, 20.0, infinite]]);
    assert_eq!(robot_.get_armature()[(0, 0)], 0.1);
    assert_eq!(robot_.get_friction()[(0, 5)], 0.3);
    let types = robot_.get_drive_types();
    assert_eq!((types[(0, 4)], types[(0, 5)]), (DriveType::Force, DriveType::None));
    let said: Vec<String> = sim.diagnostics().iter().map(ToString::to_string).collect();
    assert!(said.iter().any(|d| d.contains("the place of the actuators \"p\", \"m\", \"v\", \"m2\"")), "{said:?}");
    assert!(said.iter().any(|d| d.contains("actuator \"t\" acts on the tendon \"both\"")), "{said:?}");

    // Named joints have what is said of them, and an idle one that is named is driven.
    let drive = DriveCfg {
        stiffness: [("servo|idle", 50.0)].into(),
        max_effort: Some([("motor", 7.0)].into()),
        armature: [("wheel", 0.4)].into(),
        ..Default::default()
    };
    let mut sim = empty(1);
    let id = sim.add_robot(RobotCfg { drive, ..robot("m", MACHINE) }).unwrap();
    let robot_ = sim.robot(id);
    assert_eq!(robot_.get_stiffness(), array![[50.0, 1e4, 0.0, 25.0, 400.0, 50.0]]);
    assert_eq!(robot_.get_damping(), array![[0.0, 1e3, 0.7, 0.0, 0.0, 1e3]]);
    assert_eq!(robot_.qf_limits()[(0, 1)], 7.0);
    assert_eq!((robot_.get_armature()[(0, 0)], robot_.get_armature()[(0, 2)]), (0.1, 0.4));

    // One number for all is for all.
    let mut sim = empty(1);
    let drive = DriveCfg { stiffness: 9.0.into(), damping: 2.0.into(), ..Default::default() };
    let id = sim.add_robot(RobotCfg { drive, ..robot("m", MACHINE) }).unwrap();
    assert!(sim.robot(id).get_stiffness().iter().all(|k| *k == 9.0));

    // Without any actuator all joints are driven, as in a URDF.
    let bare = format!("{}</mujoco>", &MACHINE[..MACHINE.find("<tendon>").unwrap()]);
    let mut sim = empty(1);
    let id = sim.add_robot(robot("m", &bare)).unwrap();
    assert!(sim.robot(id).get_stiffness().iter().all(|k| *k == 1e4));
}

/// The drive that stands for an actuator is its law. Ours is evaluated at the end of the step of h = 1e-4 s, which adds a damping
/// of `h kp = 2e-3` to the 0.8 N m s/rad of joint and drive: a quarter of a percent, of which 2e-3 rad are left of 0.5.
#[test]
fn the_drive_of_a_servo_moves_as_the_actuator() {
    use kinetoscope::sim::mj;
    let text = r#"<mujoco><option timestep="0.0001" gravity="0 0 0"/><default><geom contype="0" conaffinity="0"/></default><worldbody><body name="base"><geom size="0.1" mass="1"/>
        <body><joint name="j" axis="0 0 1" damping="0.4"/><geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0" mass="1"/></body>
        </body></worldbody>
        <actuator><general joint="j" gear="2" gaintype="fixed" biastype="affine" gainprm="5" biasprm="0 -5 -0.1"/></actuator>
        </mujoco>"#;
    let cfg = SimulationManagerCfg {
        physics_dt: 1e-4,
        gravity: [0.0; 3].into(),
        ground: None,
        lights: vec![],
        ..Default::default()
    };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let id = sim.add_robot(robot("r", text)).unwrap();
    assert_eq!((sim.robot(id).get_stiffness()[(0, 0)], sim.robot(id).get_damping()[(0, 0)]), (20.0, 0.4));
    sim.robot_mut(id).set_qpos(&array![[0.5]], None, None).unwrap();
    let mut data = mj::Data::new(&mj::compile(text, &[]).unwrap().into_model()).unwrap();
    // The length of the actuator is twice the angle.
    data.ctrl_mut()[0] = 1.0;
    let mut farthest = 0.0f64;
    for _ in 0..50 {
        sim.update(50);
        for _ in 0..50 {
            data.step().unwrap();
        }
        let (ours, theirs) = (sim.robot(id).get_qpos()[(0, 0)], data.qpos()[0]);
        assert!((ours - theirs).abs() < 2e-3, "{ours} {theirs}");
        farthest = farthest.max(theirs);
    }
    assert!(farthest > 0.5, "it overshoots: {farthest}");
}

/// The softness of dry friction is the drives' where they hold it; a file that sets its own is told so, one that does not is not.
#[test]
fn softness_of_friction_that_a_drive_does_not_keep_is_said() {
    for (softness, times) in [("", 0), (r#"solreffriction="0.05 1""#, 1), (r#"solimpfriction="0.8 0.9 0.001""#, 1)] {
        let text = MACHINE.replace(r#"frictionloss="0.3""#, &format!(r#"frictionloss="0.3" {softness}"#));
        let mut sim = empty(1);
        sim.add_robot(robot("m", &text)).unwrap();
        let is_said = |d: &&Diagnostic| d.message.contains("solreffriction") && d.message.contains("\"idle\"");
        assert_eq!(sim.diagnostics().iter().filter(is_said).count(), times, "{softness}: {:?}", sim.diagnostics());
    }
}
