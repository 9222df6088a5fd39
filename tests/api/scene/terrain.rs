//! Terrain, a ray caster on it and a camera of rays: from a file and from Rust, the same bits.

use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::scene::terrain::{PyramidStairs, RoughTerrain, Slope, TerrainGenerator};
use kinetoscope::sensors::ray::pattern::Grid;

const FILE: &str = r#"
[simulation]
num_envs = 2
seed = 3
ground = false

[entities.hills]
type = "terrain"
heights.rough = { size = [6, 6], cell = 0.1, range = [-0.1, 0.1], step = 0.01, seed = 7 }
thickness = 0.5
init_pose = { pos = [0, 0, 0.2] }
friction = [0.8, 0.005, 0.0001]

[entities.ball]
type = "rigid_object"
shape.sphere.radius = 0.1
init_pose = { pos = [0.1, 0.2, 0.8] }

[entities.scanner]
type = "ray_caster"
parent = "ball"
alignment = "yaw"
pattern.grid = { resolution = 0.1, size = [1.6, 1.0] }
targets.named = ["hills"]

[entities.eye]
type = "ray_caster_camera"
width = 64
height = 48
intrinsics.fovy.radians = 0.9
extrinsics.placement.look_at = { eye = [2, 0, 1.5], target = [0, 0, 0] }
max_distance = 20
depth_miss = "far"
targets.everything.exclude_parent = false

[entities.eye.sampling]
update_period = 0.02
latency_steps = 1
noise.distances.std = 0.002
"#;

fn read(text: &str) -> SceneCfg {
    SceneCfg::from_toml(text, "dir/scene.toml", &EntityTypes::default()).unwrap()
}

fn declared() -> SceneCfg {
    let rough = RoughTerrain { size: [6.0; 2], cell: 0.1, range: [-0.1, 0.1], step: 0.01, seed: 7 };
    let hills = TerrainCfg {
        uid: "whatever".into(),
        heights: rough.heights().unwrap(),
        size: rough.size,
        thickness: 0.5,
        init_pose: Pose::translation(0.0, 0.0, 0.2),
        friction: Some([0.8, 0.005, 0.0001]),
        ..Default::default()
    };
    let ball = RigidObjectCfg {
        shape: ObjectShape::Sphere { radius: 0.1 },
        init_pose: Pose::translation(0.1, 0.2, 0.8),
        ..Default::default()
    };
    let scanner = RayCasterCfg {
        parent: Some("ball".into()),
        alignment: RayAlignment::Yaw,
        pattern: Grid { resolution: 0.1, size: [1.6, 1.0], ..Default::default() }.into(),
        targets: HitTargets::Named(vec!["hills".into()]),
        ..Default::default()
    };
    let noise = [("distances".to_string(), NoiseCfg::white(0.002))].into();
    let eye = RayCasterCameraCfg {
        width: 64,
        height: 48,
        intrinsics: Intrinsics::Fovy { radians: 0.9 },
        extrinsics: Extrinsics {
            placement: Placement::LookAt { eye: [2.0, 0.0, 1.5], target: [0.0; 3], up: [0.0, 0.0, 1.0] },
            ..Default::default()
        },
        max_distance: 20.0,
        depth_miss: DepthMiss::Far,
        targets: HitTargets::Everything { exclude_parent: false },
        sampling: SamplingCfg { latency_steps: 1, noise, ..SamplingCfg::every(0.02) },
        ..Default::default()
    };
    let simulation = SimulationManagerCfg { num_envs: 2, seed: 3, ground: None, ..Default::default() };
    SceneCfg::new(simulation).with("hills", hills).with("ball", ball).with("scanner", scanner).with("eye", eye)
}

/// Everything that the scene says after 1 s: equal bits or not at all.
fn says(cfg: SceneCfg) -> Vec<Vec<u64>> {
    let mut scene = InteractiveScene::new(cfg).unwrap();
    let ball = scene.rigid_object_id("ball").unwrap();
    // Environments that differ, so that a mix-up would be seen.
    let pose = array![[-0.4, 0.3, 0.7, 1.0, 0.0, 0.0, 0.0]];
    scene.sim_mut().rigid_object_mut(ball).write_pose(&pose, Some(&[EnvId(1)])).unwrap();
    scene.update(100);
    let hills = scene.terrain("hills").unwrap();
    assert_eq!(hills.uid(), "hills");
    let scanner = scene.sensor::<RayCaster>("scanner").unwrap();
    assert!(scanner.hit_ids().iter().all(|id| *id == hills.mask_id()), "all of the field is below the ball");
    let eye = scene.sensor::<RayCasterCamera>("eye").unwrap();
    assert!(eye.mask().iter().filter(|id| **id == hills.mask_id()).count() > 1000);
    // Every second step a picture; that of step 100 arrives with the next.
    assert_eq!(eye.frame_counts().to_vec(), [49, 49]);
    let bits = |numbers: &mut dyn Iterator<Item = f64>| numbers.map(f64::to_bits).collect::<Vec<u64>>();
    vec![
        bits(&mut scene.rigid_object("ball").unwrap().get_pose().iter().copied()),
        bits(&mut scanner.distances().iter().copied()),
        bits(&mut eye.depth().iter().map(|&depth| depth.into())),
        bits(&mut eye.normal().iter().map(|&normal| normal.into())),
        bits(&mut eye.mask().iter().map(|&id| id.into())),
    ]
}

#[test]
fn a_file_and_rust_give_the_same_bits() {
    let (from_file, from_rust) = (says(read(FILE)), says(declared()));
    assert_eq!(from_file, from_rust);
    let other = says(read(&FILE.replace("seed = 7", "seed = 8")));
    let same = other.iter().zip(&from_file).take(4).filter(|(a, b)| a == b).count();
    assert_eq!(same, 0, "the control: another terrain is another scene");
}

#[test]
fn what_is_written_is_read_again_and_moves_the_same() {
    let types = EntityTypes::default();
    let text = declared().to_toml(&types).unwrap();
    assert_eq!(says(read(&text)), says(declared()));
    assert_eq!(read(&text).to_toml(&types).unwrap(), text);
}

fn terrain(text: &str) -> TerrainCfg {
    let scene = read(&format!("[entities.t]\ntype = \"terrain\"\n{text}"));
    let [(_, EntityCfg::Terrain(terrain))] = scene.entities.as_slice() else { panic!("{scene:?}") };
    (**terrain).clone()
}

#[test]
fn heights_have_several_forms() {
    let flat = TerrainCfg { uid: "t".into(), ..Default::default() };
    assert_eq!(terrain(""), flat);
    let rows = TerrainCfg { heights: array![[0.0, 1.0, 2.0], [0.1, -0.5, 0.25]], size: [2.0, 1.0], ..flat.clone() };
    assert_eq!(terrain("heights = [[0, 1, 2], [0.1, -0.5, 0.25]]\nsize = [2, 1]"), rows);
    let generators: [(&str, TerrainGenerator); 4] = [
        ("rough = { seed = 5 }", RoughTerrain { seed: 5, ..Default::default() }.into()),
        ("slope.gradient = [0.1, 0.2]", Slope { gradient: [0.1, 0.2], ..Default::default() }.into()),
        ("pyramid_stairs = {}", PyramidStairs::default().into()),
        ("pyramid_stairs = { step_height = -0.1 }", PyramidStairs { step_height: -0.1, ..Default::default() }.into()),
    ];
    for (text, generator) in generators {
        let expected = TerrainCfg::generated("t", generator.clone()).unwrap();
        assert_eq!(terrain(&format!("heights.{text}")), expected);
        assert_eq!((&expected.heights, expected.size), (&generator.heights().unwrap(), generator.size()));
    }
    // What is no name of a height is refused in Rust, too.
    let error = TerrainCfg::generated("t", RoughTerrain { cell: 0.0, ..Default::default() }).unwrap_err();
    assert!(error.to_string().contains("cell is 0"), "{error}");
}

#[test]
fn mistakes_are_named_with_their_line() {
    for (text, line, parts) in [
        ("[entities.t]\ntype = \"terrain\"\n\nthicknes = 1", 4, &["thicknes", "`thickness`"][..]),
        ("[entities.t]\ntype = \"terrain\"\nheights.rough = { size = [8, 8],\nsede = 7 }", 4, &["sede", "`seed`"]),
        (
            "[entities.t]\ntype = \"terrain\"\n[entities.t.heights.slope]\ngradiant = [0, 1]",
            4,
            &["gradiant", "`gradient`"],
        ),
        ("[entities.t]\ntype = \"terrain\"\nheights.stairs = {}", 3, &["stairs", "`pyramid_stairs`"]),
        ("[entities.t]\ntype = \"terrain\"\nheights = 3", 3, &["rows of heights", "generator"]),
        ("[entities.t]\ntype = \"terrain\"\nheights = [[0, 1], [0]]", 3, &["row 1 has 1 heights", "has 2"]),
        ("[entities.t]\ntype = \"terrain\"\nheights = { slope = {}, rough = {} }", 3, &["two"]),
        ("[entities.t]\ntype = \"terrain\"\nuid = \"t\"", 3, &["uid"]),
        // What only the whole table shows is named with the line of the entity.
        ("\n[entities.t]\ntype = \"terrain\"\nheights.rough.cell = 0", 2, &["rough terrain", "cell is 0"]),
        ("\n[entities.t]\ntype = \"terrain\"\nsize = [1, 1]\nheights.slope = {}", 2, &["leave out the `size`"]),
        ("[entities.e]\ntype = \"ray_caster_camera\"\nwidht = 3", 3, &["widht", "`width`"]),
        ("[entities.e]\ntype = \"ray_caster_camera\"\nupdate_period = 0.1", 3, &["update_period", "`sampling`"]),
    ] {
        let message = SceneCfg::from_toml(text, "dir/scene.toml", &EntityTypes::default()).unwrap_err().to_string();
        assert!(message.starts_with(&format!("dir/scene.toml:{line}: ")), "{text}\n{message}");
        for part in parts {
            assert!(message.contains(part), "{text}\n{message}: no {part}");
        }
    }
    // What building finds out.
    let text = "\n[entities.t]\ntype = \"terrain\"\nheights = [[0, 1]]";
    let message = InteractiveScene::new(read(text)).unwrap_err().to_string();
    assert!(message.starts_with("dir/scene.toml:2: entity \"t\"") && message.contains("at least 2 rows"), "{message}");
    let scene = InteractiveScene::new(read("[entities.t]\ntype = \"terrain\"")).unwrap();
    let message = scene.robot("t").unwrap_err().to_string();
    assert!(message.contains("terrain"), "{message}");
    assert!(scene.terrain_id("t").is_ok() && scene.terrain("u").is_err());
}
