//! Robots from MJCF in scenes: gravity compensation, self-collision and sensors.

use super::*;
use kinetoscope::ndarray::{Axis, array};
use kinetoscope::sensors::MujocoSensorCfg;
use kinetoscope::sensors::ray::HitTargets;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope_testkit::worlds::gains;

/// Gravity compensation of all links holds an arm without drives.
#[test]
fn gravity_compensation() {
    let (mut sim, id) = with(2, passive(robot("odd", &ODD.replace(r#"stiffness="1.5""#, ""))));
    let (start, second) = (sim.robot(id).qpos(), Some(&[EnvId(1)][..]));
    sim.robot_mut(id).set_gravity_compensation(true, None, second).unwrap();
    sim.update(100);
    let off = sim.robot(id).qpos() - &start;
    assert!(largest(off.row(1)) < 1e-9 && largest(off.row(0)) > 0.05, "{off}");
}

/// Two closing fingers pass through each other unless self-collision is on; a contact pair of the file is only active
/// then. The centers stay a diameter of 0.04 m apart: each finger has moved (0.12 - 0.04) / 2.
#[test]
fn self_collision() {
    let text = r#"<mujoco><compiler angle="radian"/><worldbody><body name="palm"><geom name="palm" size="0.02" mass="1"/>
        <body name="left" pos="0 0.06 0"><joint name="left" type="slide" axis="0 -1 0"/><geom name="l" size="0.02" mass="0.1"
          contype="4" conaffinity="8"/></body>
        <body name="right" pos="0 -0.06 0"><joint name="right" type="slide" axis="0 1 0"/><geom name="r" size="0.02" mass="0.1"/>
        </body></body></worldbody><contact><pair geom1="l" geom2="r" margin="0.001"/><exclude body1="palm" body2="left"/>
          <exclude body1="palm" body2="right"/></contact></mujoco>"#;
    for (self_collision, expected, within) in [(false, 0.06, 1e-3), (true, 0.04, 2e-3)] {
        let drive = DriveCfg { max_effort: Some(5.0.into()), ..gains(50.0, 10.0) };
        let (mut sim, id) = with(1, RobotCfg { self_collision, drive, ..robot("hand", text) });
        sim.robot_mut(id).set_qpos_target(&array![[0.06, 0.06]], None, None).unwrap();
        sim.update(1000);
        assert!(sim.diverged().is_empty());
        let found = sim.robot(id).qpos();
        assert!(found.iter().all(|q| (q - expected).abs() < within), "{self_collision}: {found}");
    }
}

/// A leg on a foot, with its body on a slide, and its own sensors.
const LEG: &str = include_str!("../../data/mjcf/leg.xml");

/// Sensors find the links of a robot by name.
#[test]
fn sensors() {
    for with_part in [false, true] {
        let mut sim =
            kinetoscope_testkit::worlds::sim(SimulationManagerCfg { num_envs: 2, ..SimulationManagerCfg::legged() });
        if with_part {
            let part = r#"<mujoco><worldbody><body pos="3 0 1"><joint name="j"/><geom size="0.1"/></body></worldbody>
                <sensor><clock name="clock"/><jointvel name="v" joint="j"/></sensor></mujoco>"#;
            sim.add_mjcf(MjcfPartCfg::text("part", part)).unwrap();
        }
        let id = sim.add_robot(RobotCfg { fix_base: false, ..robot("leg", LEG) }).unwrap();
        let bodies = vec!["leg/foot".into(), "leg/body".into()];
        let contact = sim.add_sensor("contact", ContactSensorCfg { bodies, ..Default::default() }).unwrap();
        let imu = sim.add_sensor("imu", ImuCfg::on("leg/imu")).unwrap();
        let grid = Grid { size: [0.2, 0.2], resolution: 0.1, ..Default::default() };
        let targets = HitTargets::Named(vec!["leg/foot".into()]);
        let scanner =
            RayCasterCfg { parent: Some("leg/body".into()), pattern: grid.into(), targets, ..Default::default() };
        let scanner = sim.add_sensor("scanner", scanner).unwrap();
        let own = sim.add_sensor("own", MujocoSensorCfg::default()).unwrap();
        let entry = sim.scene().mask_ids().iter().find(|id| id.link.as_deref() == Some("body")).unwrap();
        assert_eq!((entry.object.as_str(), entry.class.as_str()), ("leg", "robot"));
        sim.update(400);
        assert!(sim.diverged().is_empty());
        // The foot carries 5 kg, the body has no contact.
        let sensor = sim.sensor(contact).unwrap();
        let [foot, body] = ["leg/foot", "leg/body"].map(|name| sensor.find_bodies(name).unwrap()[0]);
        for forces in sensor.net_forces_w().axis_iter(Axis(0)) {
            assert!((forces[(foot, 2)] - 5.0 * 9.81).abs() < 0.1 && largest(forces.row(body)) == 0.0, "{forces}");
        }
        // An accelerometer at rest measures g upward.
        let acc = sim.sensor(imu).unwrap().lin_acc_b().to_owned();
        assert!((acc[(0, 2)] - 9.81).abs() < 0.05 && acc[(0, 0)].abs() < 0.05, "{acc}");
        let own = sim.sensor(own).unwrap();
        assert!((own.value("leg/acc").unwrap()[(0, 2)] - 9.81).abs() < 0.05);
        assert_eq!(own.value("leg/height").unwrap(), sim.robot(id).qpos());
        assert!(own.value("leg/gone").is_err());
        if with_part {
            assert!((own.value("part/clock").unwrap()[(0, 0)] - sim.time()[0]).abs() < 0.01);
        }
        // Rays from the body hit the foot below it, 0.05 m high and as wide as the pattern.
        let foot = sim.robot(id).link_pose("foot").unwrap()[(0, 2)];
        let hits = sim.sensor(scanner).unwrap().hits().to_owned();
        let heights: Vec<f64> = hits.axis_iter(Axis(1)).map(|hit| hit[(0, 2)]).collect();
        assert!(heights.len() == 9 && heights.iter().all(|z| (z - foot - 0.05).abs() < 1e-6), "{heights:?} {foot}");
    }
}
