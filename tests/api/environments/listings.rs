//! Entities of a simulation by name and by handle, for programs that did not build the simulation, such as viewers and
//! recorders.

use kinetoscope::prelude::*;
use kinetoscope::sensors::Imu;
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sensors::ray::RayCaster;
use kinetoscope_testkit::worlds::{ball, cube, row, sr5};
use std::any::Any;

struct World {
    sim: SimulationManager,
    robots: [RobotId; 2],
    camera: SensorId<Camera>,
}

fn world() -> World {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    let robots = [("left", 0.8), ("right", -0.8)]
        .map(|(uid, x)| RobotCfg { init_pose: Pose::translation(x, 0.0, 0.0), ..sr5(uid) })
        .map(|robot| sim.add_robot(robot).unwrap());
    sim.add_rigid_object(ball("ball", 0.1, 0.5, [0.0, 0.0, 5.5])).unwrap();
    sim.add_rigid_object(cube("cube", 0.2, 2.0, [0.0, 0.0, 7.0])).unwrap();
    sim.add_sensor("imu", ImuCfg::on("ball")).unwrap();
    let mut cfg = CameraCfg { width: 8, height: 6, ..CameraCfg::default() };
    cfg.update_period = 0.05;
    let camera = sim.add_sensor("eye", cfg).unwrap();
    World { sim, robots, camera }
}

#[test]
fn in_order() {
    let World { sim, robots, camera } = world();
    assert_eq!(sim.entities().articulated_uids(), ["left", "right"]);
    assert_eq!(sim.entities().robot_ids(), [("left", robots[0]), ("right", robots[1])]);
    assert_eq!(sim.entities().articulated_id("right").unwrap(), robots[1]);
    let error = sim.entities().articulated_id("rigth").unwrap_err().to_string();
    assert!(error.contains("right"), "{error}");
    assert_eq!(sim.entities().rigid_object_uids(), ["ball", "cube"]);
    assert!(sim.entities().mjcf_uids().is_empty());
    assert_eq!(sim.entities().sensor_uids(), ["imu", "eye"]);
    assert_eq!(sim.entities().sensor_ids::<Camera>(), [("eye".to_string(), camera)]);
    assert!(sim.entities().sensor_ids::<RayCaster>().is_empty());
    let imu: &dyn Any = sim.entities().sensor_by_uid("imu").unwrap();
    assert!(imu.is::<Imu>() && !imu.is::<Camera>());
    let error = sim.entities().sensor_by_uid("ey").err().unwrap().to_string();
    assert!(error.contains("eye"), "{error}");
    assert!((0..6).all(|joint| sim.robot(robots[0]).is_driven(JointIndex(joint)).unwrap()));
}

/// A camera with an image every fifth step, and an IMU with a measurement every step, checked after each of a dozen
/// steps.
#[test]
fn due_sensors() {
    let World { mut sim, .. } = world();
    for step in 1..=12_u64 {
        sim.update(1);
        assert_eq!(sim.entities().sensor_due_in("eye").unwrap(), 5 - step % 5, "step {step}");
        assert_eq!(sim.entities().sensor_due_in("imu").unwrap(), 1, "step {step}");
    }
}

/// Motion of a falling and rotating body, compared with the object's own state; the first moving link of a robot
/// carries its whole mass.
#[test]
fn body_motion() {
    let World { mut sim, robots, .. } = world();
    let cube = sim.entities().rigid_object_id("cube").unwrap();
    sim.rigid_object_mut(cube).write_velocity(&row([0.3, -0.2, 0.1, 0.0, 0.0, 1.5]), None).unwrap();
    sim.update(10);
    let names = sim.entities().body_names();
    let place = |name: &str| names.iter().position(|body| body == name).unwrap();
    let (pose, velocity) = (sim.rigid_object(cube).pose(), sim.rigid_object(cube).velocity());
    let motion = sim.scene().body_motion(EnvId(1), place("cube")).unwrap();
    for k in 0..3 {
        assert!((motion.pose.translation.vector[k] - pose[(1, k)]).abs() < 1e-12);
        assert!((motion.linear[k] - velocity[(1, k)]).abs() < 1e-12);
        assert!((motion.angular[k] - velocity[(1, 3 + k)]).abs() < 1e-12);
    }
    // Ten steps of 10 ms in free fall: 0.1 - 9.81 * 0.1.
    assert!((motion.linear[2] + 0.881).abs() < 1e-9, "{}", motion.linear[2]);
    assert!((motion.carried_mass - 2.0).abs() < 1e-12 && !motion.is_fixed);
    let base = sim.scene().body_motion(EnvId(0), place("left/base_link")).unwrap();
    assert!(base.is_fixed);
    // All mass hangs on the first link, because the file gives the base none. Six numbers are added in another order.
    let link = sim.scene().body_motion(EnvId(0), place("left/link1")).unwrap();
    let last = sim.scene().body_motion(EnvId(0), place("left/link6")).unwrap();
    let total = sim.robot(robots[0]).total_mass();
    assert!(!link.is_fixed && (link.carried_mass - total).abs() < 1e-13, "{link:?} of {total}");
    assert!((last.carried_mass - 0.634).abs() < 1e-13, "{last:?}: link6 in the file");
    assert!(sim.scene().body_motion(EnvId(2), 0).is_err() && sim.scene().body_motion(EnvId(0), names.len()).is_err());
}

/// No force moves a kinematic object or a mocap body. MuJoCo 4 does not count mocap bodies as welded to the world, as
/// 2.2.2 does, which made them movable.
#[test]
fn mocap_bodies() {
    let mut sim = SimulationManager::new(SimulationManagerCfg::default()).unwrap();
    let held = RigidObjectCfg { body_type: BodyType::Kinematic, ..cube("held", 0.2, 2.0, [0.0, 0.0, 1.0]) };
    sim.add_rigid_object(held).unwrap();
    sim.add_rigid_object(cube("free", 0.2, 2.0, [1.0, 0.0, 1.0])).unwrap();
    let text = r#"<mujoco><worldbody>
        <body name="hand" mocap="true" pos="0 2 0.5"><geom size="0.05"/>
          <body name="finger" pos="0.1 0 0"><geom size="0.02"/></body></body>
        <body name="swing" pos="0 3 1"><joint axis="0 1 0"/><geom size="0.05" mass="1"/></body>
        <body name="post" pos="0 4 1"><geom size="0.05" mass="1"/></body>
      </worldbody></mujoco>"#;
    sim.add_mjcf(MjcfPartCfg::text("part", text)).unwrap();
    let names = sim.entities().body_names();
    let held: Vec<&str> = (0..names.len())
        .filter(|&body| sim.scene().body_motion(EnvId(0), body).unwrap().is_fixed)
        .map(|body| names[body].as_str())
        .collect();
    assert_eq!(held, ["held", "part/hand", "part/finger", "part/post"]);
    // Their masses have no effect, so they are no property.
    assert_eq!(sim.properties().of(EnvId(0)).unwrap().names(Property::Mass), ["free", "part/swing"]);
}
