//! Groups, welds and excluded collision pairs: from Rust, from files, and their equality.

use kinetoscope::ndarray::{Array3, Axis};
use kinetoscope::prelude::*;
use kinetoscope::sensors::ContactSensor;
use kinetoscope::sim::{EntityTypes, Error, RigidObjectGroupCfg, WeldCfg};
use kinetoscope_testkit::worlds::object;

/// A ball above a block on the ground, two cubes in the air, and a weld between the first cube and the world. The weld
/// is declared before the cubes.
pub(crate) const TEXT: &str = r#"
exclude_collisions = [
    ["{ENV}/ball", "block"],
]

[simulation]
num_envs = 2
physics_dt = 2e-3

[entities.nail]
type = "weld"
first = "{ENV_REGEX_NS}/cubes.red"
second = "world"

[entities.touch]
type = "contact_sensor"
bodies = ["ball"]
filters = ["block"]

[entities.block]
type = "rigid_object"
shape.box.size = [0.4, 0.4, 0.4]
init_pose.pos = [0, 0, 0.2]

[entities.ball]
type = "rigid_object"
shape.sphere.radius = 0.1
init_pose.pos = [0, 0, 0.52]

[entities.cubes]
type = "rigid_object_group"
objects = [
    { uid = "red", shape.box.size = [0.1, 0.1, 0.1], init_pose.pos = [2, 0, 1] },
    { uid = "blue", shape.box.size = [0.1, 0.1, 0.1], init_pose.pos = [3, 0, 1] },
]
"#;

fn declared() -> SceneCfg {
    let cube = |uid, x| object(uid, ObjectShape::cube(0.1), [x, 0.0, 1.0]);
    let touch = ContactSensorCfg { filters: vec!["block".into()], ..ContactSensorCfg::for_bodies("ball") };
    SceneCfg::new(SimulationManagerCfg { num_envs: 2, physics_dt: 2e-3, ..Default::default() })
        .with("nail", WeldCfg { first: "cubes.red".into(), second: "world".into(), ..Default::default() })
        .with("touch", touch)
        .with("block", object("block", ObjectShape::cube(0.4), [0.0, 0.0, 0.2]))
        .with("ball", object("ball", ObjectShape::Sphere { radius: 0.1 }, [0.0, 0.0, 0.52]))
        .with("cubes", RigidObjectGroupCfg { objects: vec![cube("red", 2.0), cube("blue", 3.0)], ..Default::default() })
        .exclude_collision("ball", "block")
}

fn read(text: &str) -> SceneCfg {
    SceneCfg::from_toml(text, "dir/scene.toml", &EntityTypes::default()).unwrap()
}

/// Runs one second with the weld attached in the second environment. Returns the heights of ball and block, the poses
/// of the cubes, and true if a contact of the ball with the block was measured.
fn run(cfg: SceneCfg) -> ([f64; 2], Array3<f64>, bool) {
    let mut scene = InteractiveScene::new(cfg).unwrap();
    assert_eq!(scene.keys().collect::<Vec<_>>(), ["nail", "touch", "block", "ball", "cubes"]);
    assert_eq!(scene.weld("nail").unwrap().is_attached().to_vec(), [false, false]);
    assert_eq!(scene.sim().weld(scene.weld_id("nail").unwrap()).cfg().uid, "nail");
    assert!(scene.weld_id("ball").unwrap_err().to_string().contains("is a rigid object, not a weld"));
    scene.weld_mut("nail").unwrap().attach(Some(&[EnvId(1)])).unwrap();
    scene.update_for(1.0).unwrap();
    let height = |name: &str| scene.rigid_object(name).unwrap().pose()[(1, 2)];
    let ball_on_block = scene.sensor::<ContactSensor>("touch").unwrap().force_matrix_w();
    let cubes = scene.rigid_object_group("cubes").unwrap().pose();
    ([height("ball"), height("block")], cubes, ball_on_block.iter().any(|f| *f != 0.0))
}

/// An excluded pair falls through to the ground, the welded cube hangs, and the others have landed. Controls: the scene
/// without the exclusion, and the first environment.
#[test]
fn effects() {
    let ([ball, block], cubes, felt) = run(read(TEXT));
    assert!((ball - 0.1).abs() < 1e-3 && (block - 0.2).abs() < 1e-3 && !felt, "{ball} {block} {felt}");
    // A weld to the world yields by 1e-4 of the acceleration of its load; a fall of a meter takes 0.45 s.
    assert!((cubes[(1, 0, 2)] - 1.0).abs() < 1e-4, "{cubes}");
    for (env, object) in [(0, 0), (0, 1), (1, 1)] {
        assert!((cubes[(env, object, 2)] - 0.05).abs() < 1e-3, "{cubes}");
    }
    let without = SceneCfg { exclusions: Vec::new(), ..read(TEXT) };
    let ([ball, _], _, felt) = run(without);
    assert!((ball - 0.5).abs() < 1e-3 && felt, "{ball} {felt}");
}

#[test]
fn same_bits() {
    let expected = run(declared());
    assert_eq!(run(read(TEXT)), expected);
    let types = EntityTypes::default();
    let written = declared().to_toml(&types).unwrap();
    assert_eq!(run(SceneCfg::from_toml(&written, "elsewhere/scene.toml", &types).unwrap()), expected, "{written}");
}

#[test]
fn look_up() {
    let mut scene = InteractiveScene::new(declared()).unwrap();
    let group = scene.rigid_object_group_id("{ENV}/cubes").unwrap();
    assert_eq!(scene.sim().rigid_object_group(group).names(), ["cubes.red", "cubes.blue"]);
    let mut poses = scene.rigid_object_group("cubes").unwrap().pose();
    poses.index_axis_mut(Axis(2), 0).fill(7.0);
    scene.rigid_object_group_mut("cubes").unwrap().write_pose(&poses, None).unwrap();
    assert_eq!(scene.rigid_object_group("cubes").unwrap().pose(), poses);
    for (error, expected) in [
        (scene.weld("cubes").unwrap_err(), "\"cubes\" is a group of rigid objects, not a weld"),
        (scene.rigid_object_group("nail").unwrap_err(), "\"nail\" is a weld, not a group of rigid objects"),
        (scene.rigid_object("cubes").unwrap_err(), "\"cubes\" is a group of rigid objects, not a rigid object"),
    ] {
        assert_eq!(error.to_string(), expected);
    }
    assert!(matches!(scene.weld_mut("nale"), Err(Error::UnknownName { candidates, .. }) if candidates[0] == "nail"));
}

/// Mesh paths of the objects of a group are relative to the file, as those of single objects.
#[test]
fn relative_paths() {
    let cfg = read(
        "[entities.g]\ntype = \"rigid_object_group\"\nobjects = [{ uid = \"cup\", shape.mesh.path = \"cup.stl\" }]",
    );
    let [(_, EntityCfg::Group(group))] = cfg.entities.as_slice() else { panic!("{cfg:?}") };
    let ObjectShape::Mesh { path, .. } = &group.objects[0].shape else { panic!("{group:?}") };
    assert_eq!(path, std::path::Path::new("dir/cup.stl"));
}
