//! Articulations from MJCF files.

use super::*;
use kinetoscope::ndarray::array;
use kinetoscope::sim::EntityTypes;
use kinetoscope_testkit::error_tables::assert_error;

/// [`door`] as MJCF, with limits in radians and an actuator that defines a drive.
const LEAF: &str = r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="frame">
    <body name="leaf"><joint name="hinge" axis="0 0 1" range="0 1.6"/>
      <inertial pos="0.4 0 1" mass="20" diaginertia="7 8 1.1"/><site name="knob" pos="0.8 0 1"/></body></body></worldbody>
  <actuator><position joint="hinge" kp="300" forcerange="-50 50"/></actuator></mujoco>"#;

fn leaf(text: &str) -> ArticulationCfg {
    ArticulationCfg { uid: "door".into(), mjcf: Some(MjcfFile::text(text)), ..Default::default() }
}

/// Compares the motion with that of the same door from a URDF, which other tests check against closed forms: equal up
/// to rounding.
#[test]
fn swinging_door() {
    let files = TempFiles::default();
    let [mine, other] = [leaf(LEAF), door(&files)].map(|cfg| {
        let (mut sim, id) = with(2, cfg);
        sim.articulation_mut(id).set_qf_target(&array![[2.0], [-1.0]], None, None).unwrap();
        sim.articulation_mut(id).write_qvel(&array![[0.3], [0.9]], None, None).unwrap();
        sim.update(400);
        assert_eq!(sim.articulation(id).stiffness(), array![[0.0], [0.0]], "its actuator drives nothing");
        sim.articulation(id).qpos()
    });
    assert!((&mine - &other).iter().all(|d| d.abs() < 1e-12), "{mine} {other}");
    // I = 1.1 + 20 · 0.4² = 4.3 about the hinge: 0.3 t + 1/2 (2 / 4.3) t² at t = 0.4 s, plus Euler's half step.
    let expected = 0.3 * 0.4 + 0.5 * 2.0 / 4.3 * 0.4 * (0.4 + DT);
    assert!((mine[(0, 0)] - expected).abs() < 1e-9, "{} is not {expected}", mine[(0, 0)]);
    // Controls: a drive uses the actuator's gains and holds the door.
    let (mut sim, id) = with(1, ArticulationCfg { drive: Some(DriveCfg::default()), ..leaf(LEAF) });
    assert_eq!(sim.articulation(id).stiffness(), array![[300.0]]);
    assert_eq!(sim.articulation(id).link_names(), ["frame", "leaf", "knob"]);
    sim.update(400);
    assert!(sim.articulation(id).qpos()[(0, 0)].abs() < 1e-9);
}

/// Values of the file apply unless the configuration overrides them.
#[test]
fn friction_and_start() {
    let text = LEAF.replace(r#"range="0 1.6""#, r#"range="0 1.6" ref="0.5" frictionloss="3" armature="0.7""#);
    let (init_qpos, friction) = (vec![("hinge".to_string(), 1.0)], Some(1.0.into()));
    let other = ArticulationCfg { init_qpos, friction, armature: Some(0.1.into()), ..leaf(&text) };
    for (cfg, expected) in [(leaf(&text), [0.5, 3.0, 0.7]), (other, [1.0, 1.0, 0.1])] {
        let (sim, id) = with(1, cfg);
        let door = sim.articulation(id);
        assert_eq!([door.qpos(), door.friction(), door.armature()].map(|a| a[(0, 0)]), expected);
    }
}

#[test]
fn mistakes() {
    let mut sim = sim(1);
    let two = ArticulationCfg { urdf: cabinet_urdf(), ..leaf(LEAF) };
    assert_error(sim.add_articulation(two), "Config { field: \"mjcf\"", &[]);
    let message = sim.add_articulation(leaf("<mujoco/>")).unwrap_err().to_string();
    assert!(message.starts_with("articulation \"door\": "), "{message}");
    let missing = ArticulationCfg { mjcf: Some(MjcfFile::new("nowhere/door.xml")), ..leaf(LEAF) };
    assert_error(sim.add_articulation(missing), "", &["nowhere/door.xml"]);
}

/// Scene files refer to the MJCF file by a path relative to themselves, and keep it when they are written again.
#[test]
fn scene_file() {
    let files = TempFiles::default();
    files.write("door.xml", LEAF);
    let path = files.write("scene.toml", "[entities.door]\ntype = \"articulation\"\nmjcf = \"door.xml\"\n");
    let text = SceneCfg::from_file(&path).unwrap().to_toml(&EntityTypes::default()).unwrap();
    for path in [path, files.write("again.toml", text)] {
        let scene = InteractiveScene::from_file(&path).unwrap();
        assert_eq!(scene.articulation("door").unwrap().joint_names(), ["hinge"]);
    }
}
