//! Articulations from MJCF files.

use super::*;
use kinetoscope::ndarray::array;

/// [`DOOR`] as MJCF, with an actuator that says how it could be driven; its limits are said in radians.
const LEAF: &str = r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="frame">
    <body name="leaf"><joint name="hinge" axis="0 0 1" range="0 1.6"/>
      <inertial pos="0.4 0 1" mass="20" diaginertia="7 8 1.1"/><site name="knob" pos="0.8 0 1"/></body></body></worldbody>
  <actuator><position joint="hinge" kp="300" forcerange="-50 50"/></actuator></mujoco>"#;

fn leaf() -> ArticulationCfg {
    ArticulationCfg { uid: "door".into(), mjcf: Some(MjcfFile::text(LEAF)), ..Default::default() }
}

/// The judge is the same door from a URDF, whose motions are held against closed forms; the same numbers, up to rounding.
#[test]
fn a_door_of_an_mjcf_file_swings_as_that_of_a_urdf() {
    let (_files, of_urdf) = of_text("door", DOOR);
    let swung = |cfg: ArticulationCfg| {
        let mut sim = sim(2);
        let id = sim.add_articulation(cfg).unwrap();
        sim.articulation_mut(id).set_qf(&array![[2.0], [-1.0]], None, None).unwrap();
        sim.articulation_mut(id).write_qvel(&array![[0.3], [0.9]], None, None).unwrap();
        sim.update(400);
        (sim.articulation(id).get_qpos(), sim.articulation(id).get_stiffness())
    };
    let ((mine, gains), (other, _)) = (swung(leaf()), swung(of_urdf));
    assert_eq!(gains, array![[0.0], [0.0]], "its actuator drives nothing");
    assert!((&mine - &other).iter().all(|d| d.abs() < 1e-12), "{mine} {other}");
    // I = 1.1 + 20 · 0.4² = 4.3 about the hinge: 0.3 t + 1/2 (2 / 4.3) t² at t = 0.4 s, with Euler's half step more.
    let expected = 0.3 * 0.4 + 0.5 * 2.0 / 4.3 * 0.4 * (0.4 + DT);
    assert!((mine[(0, 0)] - expected).abs() < 1e-9, "{} is not {expected}", mine[(0, 0)]);
    // Controls: with a drive the actuator's numbers hold, and it stays.
    let mut sim = sim(1);
    let id = sim.add_articulation(ArticulationCfg { drive: Some(DriveCfg::default()), ..leaf() }).unwrap();
    assert_eq!(sim.articulation(id).get_stiffness(), array![[300.0]]);
    assert_eq!(sim.articulation(id).link_names(), ["frame", "leaf", "knob"]);
    sim.update(400);
    assert!(sim.articulation(id).get_qpos()[(0, 0)].abs() < 1e-9);
}

#[test]
fn friction_and_start_of_the_file_hold_unless_others_are_said() {
    let text = LEAF.replace(r#"range="0 1.6""#, r#"range="0 1.6" ref="0.5" frictionloss="3" armature="0.7""#);
    let cfg = || ArticulationCfg { mjcf: Some(MjcfFile::text(&text)), ..leaf() };
    let read = |cfg: ArticulationCfg| {
        let mut sim = sim(1);
        let id = sim.add_articulation(cfg).unwrap();
        let door = sim.articulation(id);
        [door.get_qpos(), door.get_friction(), door.get_armature()].map(|a| a[(0, 0)])
    };
    assert_eq!(read(cfg()), [0.5, 3.0, 0.7]);
    let init_qpos = vec![("hinge".to_string(), 1.0)];
    let other = ArticulationCfg { init_qpos, friction: Some(1.0.into()), armature: Some(0.1.into()), ..cfg() };
    assert_eq!(read(other), [1.0, 1.0, 0.1]);
}

#[test]
fn what_is_wrong_says_that_it_is_an_articulation() {
    let mut sim = sim(1);
    let two = ArticulationCfg { urdf: UrdfCfg::single(cabinet_urdf()), ..leaf() };
    assert!(matches!(sim.add_articulation(two), Err(Error::Config { field: "mjcf", .. })));
    let bare = ArticulationCfg { mjcf: Some(MjcfFile::text("<mujoco/>")), ..leaf() };
    let said = sim.add_articulation(bare).unwrap_err().to_string();
    assert!(said.starts_with("articulation \"door\": "), "{said}");
    let missing = ArticulationCfg { mjcf: Some(MjcfFile::new("nowhere/door.xml")), ..leaf() };
    assert!(sim.add_articulation(missing).unwrap_err().to_string().contains("nowhere/door.xml"));
}

/// Scene files name the file, relative to themselves, and keep it when they are written again.
#[test]
fn a_scene_file_names_one() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("door.xml"), LEAF).unwrap();
    let path = dir.path().join("scene.toml");
    std::fs::write(&path, "[entities.door]\ntype = \"articulation\"\nmjcf = \"door.xml\"\n").unwrap();
    let text = SceneCfg::from_file(&path).unwrap().to_toml(&EntityTypes::default()).unwrap();
    let again = dir.path().join("again.toml");
    std::fs::write(&again, text).unwrap();
    for path in [path, again] {
        let scene = InteractiveScene::from_file(&path).unwrap();
        assert_eq!(scene.articulation("door").unwrap().joint_names(), ["hinge"]);
    }
}
