//! A terrain, a ray caster on it and a ray-cast camera: from a file and from Rust, with equal results.

use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::scene::terrain::{PyramidStairs, RoughTerrain, Slope, TerrainGenerator};
use kinetoscope::sensors::NoiseCfg;
use kinetoscope::sensors::camera::DepthMiss;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{HitTargets, RayAlignment, RayCaster, RayCasterCamera, RayCasterCameraCfg};
use kinetoscope::sim::EntityTypes;
use kinetoscope_testkit::worlds::{look_at, object};

pub(crate) const FILE: &str = r#"
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
    let ball = object("ball", ObjectShape::Sphere { radius: 0.1 }, [0.1, 0.2, 0.8]);
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
        extrinsics: look_at([2.0, 0.0, 1.5], [0.0; 3]),
        max_distance: 20.0,
        depth_miss: DepthMiss::Far,
        targets: HitTargets::Everything { exclude_parent: false },
        sampling: SamplingCfg { latency_steps: 1, noise, ..SamplingCfg::every(0.02) },
        ..Default::default()
    };
    let simulation = SimulationManagerCfg { num_envs: 2, seed: 3, ground: None, ..Default::default() };
    SceneCfg::new(simulation).with("hills", hills).with("ball", ball).with("scanner", scanner).with("eye", eye)
}

/// The file and the declaration in Rust are written as the same text, and reading the text preserves the scene.
#[test]
fn same_text() {
    let types = EntityTypes::default();
    let text = declared().to_toml(&types).unwrap();
    assert_eq!(read(FILE).to_toml(&types).unwrap(), text);
    assert_eq!(read(&text).to_toml(&types).unwrap(), text);
    let other = read(&FILE.replace("seed = 7", "seed = 8")).to_toml(&types).unwrap();
    assert_ne!(other, text, "control: another terrain is another scene");
    // The whole field of view is below the ball.
    let mut scene = InteractiveScene::new(declared()).unwrap();
    scene.update(1);
    let (hills, scanner) = (scene.terrain("hills").unwrap(), scene.sensor::<RayCaster>("scanner").unwrap());
    assert!(hills.uid() == "hills" && scanner.hit_ids().iter().all(|id| *id == hills.mask_id()));
    assert!(scene.sensor::<RayCasterCamera>("eye").is_ok());
}

fn terrain(text: &str) -> TerrainCfg {
    let scene = read(&format!("[entities.t]\ntype = \"terrain\"\n{text}"));
    let [(_, EntityCfg::Terrain(terrain))] = scene.entities.as_slice() else { panic!("{scene:?}") };
    (**terrain).clone()
}

#[test]
fn heights() {
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
    // Invalid generator parameters are also rejected in Rust.
    let error = TerrainCfg::generated("t", RoughTerrain { cell: 0.0, ..Default::default() }).unwrap_err();
    assert!(error.to_string().contains("cell is 0"), "{error}");
    let scene = InteractiveScene::new(read("[entities.t]\ntype = \"terrain\"")).unwrap();
    let message = scene.robot("t").unwrap_err().to_string();
    assert!(message.contains("terrain"), "{message}");
    assert!(scene.terrain_id("t").is_ok() && scene.terrain("u").is_err());
}
