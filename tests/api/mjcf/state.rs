//! Joints and actuators of MJCF files, as sensors see them: against closed forms, and beside those of robots.

use crate::mjcf::empty;
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;

/// A joint of every type, and actuators without and with an activation.
const MOVERS: &str = r#"<mujoco><worldbody>
    <body name="drop" pos="2 0 1"><freejoint name="float"/><geom size="0.1"/></body>
    <body name="a" pos="0 0 1"><joint name="turn" axis="0 1 0"/><geom size="0.1" pos="0.3 0 0"/>
      <body name="b" pos="0.5 0 0"><joint name="ball" type="ball"/><geom size="0.05"/>
        <body name="c" pos="0.2 0 0"><joint name="push" type="slide" axis="1 0 0"/><geom size="0.05"/></body></body></body>
  </worldbody>
  <actuator><motor name="motor" joint="turn" gear="2"/><position name="servo" joint="push" kp="10"/>
    <general name="lag" joint="turn" dyntype="filter" dynprm="0.1" gainprm="4"/></actuator></mujoco>"#;

/// Rounding of a handful of operations on numbers of about 10.
const ROUNDING: f64 = 1e-13;

/// A motor exerts its control times its gear, a servo 10 N/m times its error at the beginning of the step, and a filter of
/// 0.1 s comes near its control by one fiftieth in each step of 2 ms.
#[test]
fn what_joints_and_actuators_say_follows_closed_forms() {
    let mut sim = empty(2);
    let part = sim.add_mjcf(MjcfCfg::text("m", MOVERS)).unwrap();
    let joints = sim.add_sensor("joints", JointStateCfg::default()).unwrap();
    let actuators = sim.add_sensor("actuators", ActuatorStateCfg::default()).unwrap();
    // The ball and the free joint have no single number.
    assert_eq!(sim.sensor(joints).unwrap().joint_names(), ["m/turn", "m/push"]);
    assert_eq!(sim.sensor(actuators).unwrap().actuator_names(), ["m/motor", "m/servo", "m/lag"]);
    sim.mjcf_part_mut(part).set_ctrl(&array![[0.3, 0.5, 0.2], [-0.1, 0.4, 0.0]], None, None).unwrap();
    let columns = sim.mjcf_part(part).qpos_columns(&["turn", "push"]).unwrap();
    for step in 1..=100_i32 {
        let before = sim.sensor(joints).unwrap().positions().to_owned();
        sim.update(1);
        let (joint, actuator) = (sim.sensor(joints).unwrap(), sim.sensor(actuators).unwrap());
        let qpos = sim.mjcf_part(part).get_qpos();
        for (env, [motor, servo, lag]) in [[0.3, 0.5, 0.2], [-0.1, 0.4, 0.0]].into_iter().enumerate() {
            let near = |what: &str, value: f64, expected: f64| {
                assert!((value - expected).abs() < ROUNDING, "{what} at step {step}: {value}, not {expected}");
            };
            let act = |steps: i32| lag * (1.0 - 0.98_f64.powi(steps));
            let push = 10.0 * (servo - before[(env, 1)]);
            near("effort of turn", joint.efforts()[(env, 0)], 2.0 * motor + 4.0 * act(step - 1));
            near("effort of push", joint.efforts()[(env, 1)], push);
            for (k, (force, activation)) in
                [(motor, 0.0), (push, 0.0), (4.0 * act(step - 1), act(step))].iter().enumerate()
            {
                near("control", actuator.controls()[(env, k)], [motor, servo, lag][k]);
                near("force", actuator.forces()[(env, k)], *force);
                near("activation", actuator.activations()[(env, k)], *activation);
            }
            for (k, column) in columns.iter().enumerate() {
                assert_eq!(joint.positions()[(env, k)], qpos[(env, column.start)]);
            }
        }
        let speed = (joint.positions()[(0, 0)] - before[(0, 0)]) / 0.002;
        // Euler: the position went by the new velocity.
        assert!((joint.velocities()[(0, 0)] - speed).abs() < 1e-10, "{speed}");
    }
    assert!(sim.sensor(joints).unwrap().positions()[(0, 1)].abs() > 1e-3, "the control: things move");
}

/// Robots come first, whatever was added first; their drives are actuators too.
#[test]
fn joints_of_robots_and_of_files_stand_on_one_axis() {
    let mut sim = empty(1);
    sim.add_mjcf(MjcfCfg::text("m", MOVERS)).unwrap();
    let every = sim.add_sensor("every", JointStateCfg::default()).unwrap();
    let motors = ActuatorStateCfg { actuators: Some(vec!["servo".into(), "JOINT[12]".into()]), ..Default::default() };
    let error = sim.add_sensor("motors", motors.clone()).unwrap_err().to_string();
    assert!(error.contains("JOINT[12]") && error.contains("\"motor\""), "{error}");
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    let arm = sim.add_robot(RobotCfg { uid: "arm".into(), urdf, ..Default::default() }).unwrap();
    let motors = sim.add_sensor("motors", motors).unwrap();
    let names = sim.sensor(every).unwrap().joint_names().to_vec();
    assert_eq!(
        (names.len(), &names[0][..], &names[6..]),
        (8, "arm/JOINT1", &["m/turn", "m/push"].map(String::from)[..])
    );
    sim.robot_mut(arm).set_qpos(&array![[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]], None, None).unwrap();
    sim.update(5);
    let (sensor, qf) = (sim.sensor(motors).unwrap(), sim.robot(arm).get_qf());
    assert_eq!(sensor.actuator_names(), ["m/servo", "arm/JOINT1", "arm/JOINT2"]);
    assert_eq!(sensor.controls(), array![[0.0, 0.1, 0.2]]);
    assert_eq!(sensor.forces().row(0).to_vec()[1..], qf.row(0).to_vec()[..2]);
    assert!(qf[(0, 1)].abs() > 1.0, "the control: it carries something");
    let nobody = empty(1).add_sensor("none", ActuatorStateCfg::default()).unwrap_err().to_string();
    assert!(nobody.contains("measure nothing"), "{nobody}");
}
