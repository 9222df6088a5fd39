//! Sensors find the links of an MJCF robot by name, and cameras draw its geoms.

use super::empty;
use kinetoscope::ndarray::{Array2, Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::sensors::ray::pattern::Grid;

/// A leg that stands on a ball foot, with its body on a slide, and sensors of its own.
const LEG: &str = r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="body" pos="0 0 0.6"><freejoint/>
    <geom name="hull" type="box" size="0.2 0.15 0.05" mass="4" rgba="1 0 0 1"/><site name="imu" pos="0.05 0 0.02"/>
    <body name="leg" pos="0 0 -0.05"><joint name="knee" type="slide" axis="0 0 1" range="-0.2 0.2" damping="2"/>
      <geom name="shin" type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" mass="0.5" contype="0" conaffinity="0"/>
      <body name="foot" pos="0 0 -0.35"><geom name="foot" type="box" size="0.2 0.2 0.05" mass="0.5"/></body></body></body>
  </worldbody><actuator><general name="k" joint="knee" biastype="affine" gainprm="4000" biasprm="0 -4000 -200"/></actuator>
  <sensor><actuatorfrc name="gone" actuator="k"/><jointpos name="height" joint="knee"/>
    <accelerometer name="acc" site="imu"/></sensor></mujoco>"#;

fn standing(with_part: bool) -> (SimulationManager, RobotId) {
    let cfg = SimulationManagerCfg { num_envs: 2, ..SimulationManagerCfg::legged() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    if with_part {
        let part = r#"<mujoco><worldbody><body pos="3 0 1"><joint name="j"/><geom size="0.1"/></body></worldbody>
            <sensor><clock name="clock"/><jointvel name="v" joint="j"/></sensor></mujoco>"#;
        sim.add_mjcf(MjcfCfg::text("part", part)).unwrap();
    }
    let cfg = RobotCfg { uid: "leg".into(), mjcf: Some(MjcfFile::text(LEG)), fix_base: false, ..Default::default() };
    let id = sim.add_robot(cfg).unwrap();
    (sim, id)
}

#[test]
fn contacts_accelerations_and_heights_are_measured() {
    for with_part in [false, true] {
        let (mut sim, id) = standing(with_part);
        let contact = sim
            .add_sensor(
                "contact",
                ContactSensorCfg { bodies: vec!["leg/foot".into(), "leg/body".into()], ..Default::default() },
            )
            .unwrap();
        let imu = sim.add_sensor("imu", ImuCfg::on("leg/imu")).unwrap();
        let grid = Grid { size: [0.2, 0.2], resolution: 0.1, ..Default::default() };
        let targets = HitTargets::Named(vec!["leg/foot".into()]);
        let scanner =
            RayCasterCfg { parent: Some("leg/body".into()), pattern: grid.into(), targets, ..Default::default() };
        let scanner = sim.add_sensor("scanner", scanner).unwrap();
        let own = sim.add_sensor("own", MujocoSensorCfg::default()).unwrap();
        sim.update(400);
        assert!(sim.diverged().is_empty());
        // The foot carries 5 kg, the body touches nothing.
        let sensor = sim.sensor(contact).unwrap();
        let forces = sensor.net_forces_w().to_owned();
        let [foot, body] = ["leg/foot", "leg/body"].map(|name| sensor.find_bodies(name).unwrap()[0]);
        for env in 0..2 {
            let foot = forces.index_axis(Axis(0), env).index_axis(Axis(0), foot).to_owned();
            let body = forces.index_axis(Axis(0), env).index_axis(Axis(0), body).to_owned();
            assert!((foot[2] - 5.0 * 9.81).abs() < 0.1 && body.iter().all(|f| *f == 0.0), "{foot} {body}");
        }
        // An accelerometer at rest measures g upwards.
        let acc = sim.sensor(imu).unwrap().lin_acc_b().to_owned();
        assert!((acc[(0, 2)] - 9.81).abs() < 0.05 && acc[(0, 0)].abs() < 0.05, "{acc}");
        let own = sim.sensor(own).unwrap();
        assert!((own.value("leg/acc").unwrap()[(0, 2)] - 9.81).abs() < 0.05);
        assert_eq!(own.value("leg/height").unwrap(), sim.robot(id).get_qpos());
        assert!(own.value("leg/gone").is_err());
        if with_part {
            assert!((own.value("part/clock").unwrap()[(0, 0)] - sim.time()[0]).abs() < 0.01);
        }
        // Rays from the body meet the foot below it, 0.05 m high and wide as the pattern.
        let scanner = sim.sensor(scanner).unwrap();
        let foot = sim.robot(id).link_pose("foot").unwrap()[(0, 2)];
        let hits = scanner.hits().to_owned();
        let heights: Vec<f64> = hits.axis_iter(Axis(1)).map(|hit| hit[(0, 2)]).collect();
        assert!(heights.len() == 9 && heights.iter().all(|z| (z - foot - 0.05).abs() < 1e-6), "{heights:?} {foot}");
    }
}

#[test]
fn cameras_draw_it_and_hang_on_its_links() {
    let (mut sim, _) = standing(false);
    let camera = CameraCfg {
        channels: Channels { color: true, depth: true, mask: true, ..Channels::default() },
        extrinsics: Extrinsics {
            placement: Placement::LookAt { eye: [2.0, 0.0, 0.6], target: [0.0, 0.0, 0.6], up: [0.0, 0.0, 1.0] },
            ..Default::default()
        },
        ..Default::default()
    };
    let on_link =
        CameraCfg { extrinsics: Extrinsics { parent: Some("leg/imu".into()), ..Default::default() }, ..camera.clone() };
    let (free, on_link) = (sim.add_sensor("free", camera).unwrap(), sim.add_sensor("mounted", on_link).unwrap());
    sim.update(1);
    let id = sim.mask_ids().iter().find(|id| id.link.as_deref() == Some("body")).unwrap().clone();
    assert_eq!((id.object.as_str(), id.class.as_str()), ("leg", "robot"));
    let seen = sim.sensor(free).unwrap();
    let (color, depth, mask) = (seen.color().unwrap(), seen.depth().unwrap(), seen.mask().unwrap());
    // In the middle is the front of the red box, 1.8 m away.
    assert_eq!(mask[(0, 240, 320)], id.id);
    assert!((depth[(0, 240, 320)] - 1.8).abs() < 1e-3, "{}", depth[(0, 240, 320)]);
    let red = [0, 1, 2].map(|k| u32::from(color[(0, 240, 320, k)]));
    assert!(red[0] > 3 * red[1] && red[0] > 3 * red[2], "{red:?}");
    let shin = sim.mask_ids().iter().find(|id| id.link.as_deref() == Some("leg")).unwrap().id;
    assert!(mask.iter().any(|m| *m == shin), "the leg is seen");
    let at = sim.sensor(on_link).unwrap().pose_w(CameraConvention::World);
    let site: Array2<f64> = sim.robot(sim.robot_id("leg").unwrap()).link_pose("imu").unwrap();
    assert!((0..3).all(|k| (at[(0, k)] - site[(0, k)]).abs() < 1e-9));
    assert!((site[(0, 0)] - 0.05).abs() < 1e-6 && array![site[(0, 2)] - 0.62].iter().all(|d| d.abs() < 1e-3));
}

/// The control of it all: an unknown link is an error that lists those there are.
#[test]
fn unknown_links_are_refused() {
    let mut sim = empty(1);
    sim.add_robot(RobotCfg { uid: "leg".into(), mjcf: Some(MjcfFile::text(LEG)), ..Default::default() }).unwrap();
    let error = sim.add_sensor("contact", ContactSensorCfg::of("leg/foots")).unwrap_err().to_string();
    assert!(error.contains("leg/foot"), "{error}");
}
