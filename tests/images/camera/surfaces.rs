//! Materials and lights of a configuration in the rendered scene, on both supported MuJoCo versions.

use kinetoscope::prelude::*;
use kinetoscope::scene::decode_srgb;
use kinetoscope::scene::{LightKind, Material};
use kinetoscope::sim::{EntityTypes, Error, LightKindCfg, SurfaceCfg};
use kinetoscope_testkit::worlds::{cfg, object, sim, sr5};
use std::sync::Arc;

const PART: &str = r#"<mujoco><asset><material name="brass" specular="0.9" emission="0.25"/></asset><worldbody>
    <geom name="plate" type="box" size="1 1 0.01"/>
    <body name="bell" pos="0 0 1"><freejoint/><geom size="0.1" material="brass"/></body></worldbody></mujoco>"#;

/// A surface with the given fields and defaults for the others.
macro_rules! surface {
    ($($field:ident: $value:expr),+) => {
        SurfaceCfg { $($field: Some($value),)+ ..Default::default() }
    };
}

fn on_ground(surface: SurfaceCfg) -> SimulationManagerCfg {
    SimulationManagerCfg { ground: Some(GroundCfg { surface, ..Default::default() }), ..cfg(2, 2) }
}

fn part(surfaces: Vec<(String, SurfaceCfg)>) -> MjcfPartCfg {
    MjcfPartCfg { surfaces, ..MjcfPartCfg::text("part", PART) }
}

fn named(name: &str, surface: SurfaceCfg) -> (String, SurfaceCfg) {
    (name.into(), surface)
}

fn materials(sim: &mut SimulationManager, name: &str) -> Vec<Material> {
    let visible = sim.scene_mut().visual_scene();
    let found: Vec<_> = visible.scene().instances().iter().filter(|instance| &*instance.name == name).collect();
    found.into_iter().map(|instance| instance.material.clone()).collect()
}

fn scene() -> SceneCfg {
    let surfaces = vec![named("link[12]", SurfaceCfg::metal(0.25)), named("base_link", SurfaceCfg::glass())];
    let bell = vec![named("bell", surface!(metallic: 0.5)), named("world", surface!(emission: 2.0))];
    let water = surface!(refractive_index: 1.33, transmission: 0.75);
    SceneCfg::new(on_ground(surface!(reflectance: 0.5)))
        .with("robot", RobotCfg { surfaces, ..sr5("robot") })
        .with("part", part(bell))
        .with("drop", RigidObjectCfg { surface: water, ..Default::default() })
        .with("hills", TerrainCfg { surface: surface!(shininess: 0.125), ..Default::default() })
}

fn check(sim: &mut SimulationManager) {
    let links: Vec<String> =
        sim.entities().body_names().iter().filter(|name| name.starts_with("robot/")).cloned().collect();
    let mut kinds = [0; 3];
    for link in &links {
        for m in materials(sim, link) {
            let (polished, glass) = (link.ends_with("/link1") || link.ends_with("/link2"), link.contains("base"));
            assert_eq!((m.metallic, m.roughness == Some(0.25)), (f32::from(u8::from(polished)), polished), "{link}");
            assert_eq!(m.transmission, f32::from(u8::from(glass)), "{link}");
            kinds[if polished { 0 } else { 1 + usize::from(glass) }] += 1;
        }
    }
    assert!(kinds[0] >= 2 && kinds[1] >= 1 && kinds[2] >= 1, "{links:?}");
    let mut material = |name: &str| materials(sim, name).remove(0);
    let (bell, plate, water) = (material("part/bell"), material("part"), material("drop"));
    // The file's values are kept, and the configuration adds to them.
    assert_eq!((bell.specular, bell.emission, bell.metallic), (0.9, 0.25, 0.5));
    assert_eq!((plate.emission, plate.metallic, plate.specular), (2.0, 0.0, 0.5));
    assert_eq!((water.refractive_index, water.transmission), (1.33, 0.75));
    assert_eq!((material("hills").shininess, material("ground").reflectance), (0.125, 0.5));
}

#[test]
fn surfaces_of_everything() {
    let types = EntityTypes::default();
    let text = scene().to_toml(&types).unwrap();
    for cfg in [scene(), SceneCfg::from_toml(&text, "scene.toml", &types).unwrap()] {
        let mut scene = InteractiveScene::new(cfg).unwrap();
        let sim = scene.sim_mut();
        check(sim);
        // Another object forces a new compilation of the scene.
        sim.add_rigid_object(RigidObjectCfg { uid: "more".into(), ..Default::default() }).unwrap();
        check(sim);
        assert_eq!(materials(sim, "more")[0].transmission, 0.0, "of no other object");
    }
}

/// An environment with its own color keeps the shared surface.
#[test]
fn own_color() {
    let mut sim = sim(cfg(2, 2));
    let metal = object("object", ObjectShape::cube(0.1), [0.0; 3]);
    sim.add_rigid_object(RigidObjectCfg { surface: SurfaceCfg::metal(0.5), ..metal }).unwrap();
    sim.properties_mut()
        .randomize_with(Some(&[EnvId(1)]), |_, _, p| p.set(Property::Color, "object", &[1.0, 0.0, 0.0, 1.0]))
        .unwrap();
    let own = sim.scene_mut().env_scene(EnvId(1)).unwrap();
    let ball = own.instances().iter().find(|instance| &*instance.name == "object").unwrap();
    assert_eq!((ball.material.rgba, ball.material.metallic), ([1.0, 0.0, 0.0, 1.0], 1.0));
}

#[test]
fn refused_surfaces() {
    let mut sim = sim(cfg(1, 1));
    let fields = [
        ("surface.emission", surface!(emission: -1.0)),
        ("surface.specular", surface!(specular: 1.5)),
        ("surface.shininess", surface!(shininess: f64::NAN)),
        ("surface.reflectance", surface!(reflectance: -0.1)),
        ("surface.metallic", surface!(metallic: 2.0)),
        ("surface.roughness", surface!(roughness: f64::INFINITY)),
        ("surface.transmission", surface!(transmission: 1.1)),
        ("surface.refractive_index", surface!(refractive_index: 0.9)),
    ];
    for (expected, surface) in fields {
        let surfaces = || vec![named(".*", surface)];
        let urdf = sr5("robot").urdf;
        let errors = [
            sim.add_rigid_object(RigidObjectCfg { surface, ..Default::default() }).unwrap_err(),
            sim.add_terrain(TerrainCfg { surface, ..Default::default() }).unwrap_err(),
            sim.add_robot(RobotCfg { surfaces: surfaces(), ..sr5("robot") }).unwrap_err(),
            sim.add_articulation(ArticulationCfg { urdf, surfaces: surfaces(), ..Default::default() }).unwrap_err(),
            sim.add_mjcf(part(surfaces())).unwrap_err(),
            SimulationManager::new(on_ground(surface)).unwrap_err(),
        ];
        for error in errors {
            assert!(matches!(error, Error::Config { field, .. } if field == expected), "{expected}: {error}");
        }
    }
    let error = sim.add_mjcf(part(vec![named("bel", SurfaceCfg::glass())])).unwrap_err().to_string();
    assert!(error.contains("MJCF part \"part\", surfaces") && error.contains("bell"), "{error}");
    let surfaces = vec![named("lefthand", SurfaceCfg::glass())];
    let error = sim.add_robot(RobotCfg { surfaces, ..sr5("robot") }).unwrap_err().to_string();
    assert!(error.contains("robot \"robot\", surfaces") && error.contains("lefthand"), "{error}");
}

#[test]
fn lights() {
    let light = LightCfg {
        position: [1.0, 2.0, 3.0].into(),
        direction: [0.0, 3.0, -4.0].into(),
        color: [1.0, 0.5, 0.0],
        attenuation: [0.5, 0.25, 0.125],
        radius: 0.0625,
        ..Default::default()
    };
    let lights = vec![
        LightCfg { radius: 0.00465, ..Default::default() },
        LightCfg { kind: LightKindCfg::Point, ..light.clone() },
        LightCfg { kind: LightKindCfg::Spot { cutoff_deg: 30.0, exponent: 5.0 }, cast_shadow: false, ..light },
    ];
    let cfg = SceneCfg::new(SimulationManagerCfg { lights, ..Default::default() });
    let types = EntityTypes::default();
    let again = SceneCfg::from_toml(&cfg.to_toml(&types).unwrap(), "scene.toml", &types).unwrap();
    assert_eq!(again.simulation, cfg.simulation);
    let mut scene = InteractiveScene::new(cfg).unwrap();
    let mut look = kinetoscope::sim::EnvVisualState::default();
    scene.sim_mut().scene_mut().read_visual_state(EnvId(0), &mut look).unwrap();
    let [sun, bulb, spot] = look.lights[..] else { panic!("{:?}", look.lights) };
    assert_eq!((sun.kind, sun.radius, sun.cast_shadow), (LightKind::Directional, 0.00465, true));
    assert_eq!((bulb.kind, bulb.radius, bulb.cast_shadow), (LightKind::Point, 0.0625, true));
    let kind = LightKind::Spot { cutoff_deg: 30.0, exponent: 5.0 };
    assert_eq!((spot.kind, spot.radius, spot.cast_shadow), (kind, 0.0625, false));
    for light in [bulb, spot] {
        assert_eq!((light.position, light.attenuation), ([1.0, 2.0, 3.0], [0.5, 0.25, 0.125]));
        assert!((0..3).all(|k| (light.direction[k] - [0.0, 0.6, -0.8][k]).abs() < 1e-6), "{:?}", light.direction);
        assert_eq!(light.diffuse, [1.0, 0.5, 0.0].map(decode_srgb));
    }
}

/// A dome light illuminates all sides of every object in place of the default light, and is not a light of MuJoCo.
#[test]
fn dome() {
    let ambient = |lights: Vec<LightCfg>| {
        let mut sim = SimulationManager::new(SimulationManagerCfg { lights, ..cfg(1, 1) }).unwrap();
        let scene = Arc::clone(sim.scene_mut().visual_scene().scene());
        (scene.ambient, scene.lights.len())
    };
    let (first, second) = (LightCfg::dome(0.5, [1.0, 0.75, 0.0]), LightCfg::dome(2.0, [0.25; 3]));
    let expected = |c: [f32; 3]| [0, 1, 2].map(|k| 0.5 * decode_srgb([1.0, 0.75, 0.0][k]) + 2.0 * decode_srgb(c[k]));
    let (found, light_count) = ambient(vec![first.clone(), LightCfg::default(), second]);
    assert_eq!((found.sky, found.ground, light_count), (expected([0.25; 3]), expected([0.25; 3]), 1));
    let (own, _) = ambient(vec![LightCfg::default()]);
    assert!(own.sky[2] > own.sky[0] && own.ground != own.sky, "the control: {own:?}");
    // The same in a scene file.
    let text = "[simulation]\nlights = [{ kind = { dome = { intensity = 0.5 } }, color = [1, 0.75, 0] }]";
    let read = SceneCfg::from_toml(text, "scene.toml", &EntityTypes::default()).unwrap();
    assert_eq!(read.simulation.lights, [first]);
}

#[test]
fn refused_lights() {
    let spot =
        |cutoff_deg, exponent| LightCfg { kind: LightKindCfg::Spot { cutoff_deg, exponent }, ..Default::default() };
    let bad = [
        ("lights.kind.spot.cutoff_deg", spot(0.0, 1.0)),
        ("lights.kind.spot.cutoff_deg", spot(90.5, 1.0)),
        ("lights.kind.spot.cutoff_deg", spot(f64::NAN, 1.0)),
        ("lights.kind.spot.exponent", spot(45.0, -1.0)),
        ("lights.kind.spot.exponent", spot(45.0, 129.0)),
        ("lights.kind.spot.exponent", spot(45.0, 2.5)),
        ("lights.kind.dome.intensity", LightCfg::dome(-1.0, [1.0; 3])),
        ("lights.kind.dome.intensity", LightCfg::dome(f64::NAN, [1.0; 3])),
        ("lights.position", LightCfg { position: [0.0, f64::NAN, 0.0].into(), ..Default::default() }),
        ("lights.attenuation", LightCfg { attenuation: [0.0; 3], ..Default::default() }),
        ("lights.attenuation", LightCfg { attenuation: [1.0, -1.0, 0.0], ..Default::default() }),
        ("lights.radius", LightCfg { radius: -0.1, ..Default::default() }),
        ("lights.radius", LightCfg { radius: f64::INFINITY, ..Default::default() }),
    ];
    for (expected, light) in bad {
        let error = SimulationManager::new(SimulationManagerCfg { lights: vec![light], ..cfg(1, 1) }).unwrap_err();
        assert!(matches!(error, Error::Config { field, .. } if field == expected), "{expected}: {error}");
    }
    let text = "[simulation]\nlights = [{ kind = \"pont\" }]";
    let error = SceneCfg::from_toml(text, "scene.toml", &EntityTypes::default()).unwrap_err().to_string();
    assert!(error.contains("scene.toml:2") && error.contains("point"), "{error}");
}
