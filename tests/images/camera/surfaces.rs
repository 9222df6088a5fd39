//! Surfaces and lamps of a configuration are those of the scene that is drawn, on both lines of MuJoCo.

use kinetoscope::prelude::*;
use kinetoscope::scene::material::decode_srgb;
use kinetoscope::scene::{LightKind, Material};

const PART: &str = r#"<mujoco><asset><material name="brass" specular="0.9" emission="0.25"/></asset><worldbody>
    <geom name="plate" type="box" size="1 1 0.01"/>
    <body name="bell" pos="0 0 1"><freejoint/><geom size="0.1" material="brass"/></body></worldbody></mujoco>"#;

fn material(sim: &mut SimulationManager, name: &str) -> Material {
    let visible = sim.visible();
    let found: Vec<_> = visible.scene().instances().iter().filter(|instance| &*instance.name == name).collect();
    assert!(!found.is_empty(), "{name}");
    found[0].material.clone()
}

fn scene() -> SceneCfg {
    let ground =
        GroundCfg { surface: SurfaceCfg { reflectance: Some(0.5), ..Default::default() }, ..Default::default() };
    let simulation = SimulationManagerCfg { num_envs: 2, ground: Some(ground), ..Default::default() };
    let robot = RobotCfg {
        urdf: UrdfCfg::single(kinetoscope::assets::path("sr5/SR5.urdf").unwrap()),
        surfaces: vec![("link[12]".into(), SurfaceCfg::metal(0.25)), ("base_link".into(), SurfaceCfg::glass())],
        ..Default::default()
    };
    let part = MjcfCfg {
        surfaces: vec![
            ("bell".into(), SurfaceCfg { metallic: Some(0.5), ..Default::default() }),
            ("world".into(), SurfaceCfg { emission: Some(2.0), ..Default::default() }),
        ],
        ..MjcfCfg::text("part", PART)
    };
    let water = SurfaceCfg { refractive_index: Some(1.33), transmission: Some(0.75), ..Default::default() };
    SceneCfg::new(simulation)
        .with("robot", robot)
        .with("part", part)
        .with("drop", RigidObjectCfg { surface: water, ..Default::default() })
        .with(
            "hills",
            TerrainCfg { surface: SurfaceCfg { shininess: Some(0.125), ..Default::default() }, ..Default::default() },
        )
}

fn check(sim: &mut SimulationManager) {
    let links: Vec<String> = sim.body_names().iter().filter(|name| name.starts_with("robot/")).cloned().collect();
    let (mut metal, mut glass, mut others) = (0, 0, 0);
    for link in &links {
        let visible = sim.visible();
        for instance in visible.scene().instances().iter().filter(|instance| *instance.name == **link) {
            let m = &instance.material;
            let polished = link.ends_with("/link1") || link.ends_with("/link2");
            assert_eq!((m.metallic, m.roughness == Some(0.25)), (f32::from(u8::from(polished)), polished), "{link}");
            assert_eq!(m.transmission, f32::from(u8::from(link.contains("base"))), "{link}");
            metal += usize::from(polished);
            glass += usize::from(link.contains("base"));
            others += usize::from(!polished && !link.contains("base"));
        }
    }
    assert!(metal >= 2 && glass >= 1 && others >= 1, "{links:?}");
    let bell = material(sim, "part/bell");
    // What the file says, and what the configuration says besides.
    assert_eq!((bell.specular, bell.emission, bell.metallic), (0.9, 0.25, 0.5));
    let plate = material(sim, "part");
    assert_eq!((plate.emission, plate.metallic, plate.specular), (2.0, 0.0, 0.5));
    let water = material(sim, "drop");
    assert_eq!((water.refractive_index, water.transmission), (1.33, 0.75));
    assert_eq!(material(sim, "hills").shininess, 0.125);
    assert_eq!(material(sim, "ground").reflectance, 0.5);
}

#[test]
fn surfaces_of_everything_are_drawn_as_they_were_asked_for() {
    let types = EntityTypes::default();
    let text = scene().to_toml(&types).unwrap();
    for cfg in [scene(), SceneCfg::from_toml(&text, "scene.toml", &types).unwrap()] {
        let mut scene = InteractiveScene::new(cfg).unwrap();
        let sim = scene.sim_mut();
        check(sim);
        // Something more compiles everything again.
        sim.add_rigid_object(RigidObjectCfg { uid: "more".into(), ..Default::default() }).unwrap();
        check(sim);
        assert_eq!(material(sim, "more").transmission, 0.0, "only what was asked for");
    }
}

/// An environment with a colour of its own has the surface of all.
#[test]
fn a_colour_of_ones_own_keeps_the_surface() {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    sim.add_rigid_object(RigidObjectCfg { surface: SurfaceCfg::metal(0.5), ..Default::default() }).unwrap();
    sim.randomize_with(Some(&[EnvId(1)]), |_, _, p| p.set(Property::Color, "object", &[1.0, 0.0, 0.0, 1.0])).unwrap();
    let own = sim.scene_of(EnvId(1)).unwrap();
    let ball = own.instances().iter().find(|instance| &*instance.name == "object").unwrap();
    assert_eq!((ball.material.rgba, ball.material.metallic), ([1.0, 0.0, 0.0, 1.0], 1.0));
}

#[test]
fn what_surfaces_cannot_be_is_refused() {
    let mut sim = SimulationManager::new(SimulationManagerCfg::default()).unwrap();
    let fields = [
        ("surface.emission", SurfaceCfg { emission: Some(-1.0), ..Default::default() }),
        ("surface.specular", SurfaceCfg { specular: Some(1.5), ..Default::default() }),
        ("surface.shininess", SurfaceCfg { shininess: Some(f64::NAN), ..Default::default() }),
        ("surface.reflectance", SurfaceCfg { reflectance: Some(-0.1), ..Default::default() }),
        ("surface.metallic", SurfaceCfg { metallic: Some(2.0), ..Default::default() }),
        ("surface.roughness", SurfaceCfg { roughness: Some(f64::INFINITY), ..Default::default() }),
        ("surface.transmission", SurfaceCfg { transmission: Some(1.1), ..Default::default() }),
        ("surface.refractive_index", SurfaceCfg { refractive_index: Some(0.9), ..Default::default() }),
    ];
    for (expected, surface) in fields {
        let urdf = UrdfCfg::single(kinetoscope::assets::path("sr5/SR5.urdf").unwrap());
        let surfaces = vec![(".*".to_string(), surface)];
        let errors = [
            sim.add_rigid_object(RigidObjectCfg { surface, ..Default::default() }).unwrap_err(),
            sim.add_terrain(TerrainCfg { surface, ..Default::default() }).unwrap_err(),
            sim.add_robot(RobotCfg { urdf: urdf.clone(), surfaces: surfaces.clone(), ..Default::default() })
                .unwrap_err(),
            sim.add_articulation(ArticulationCfg { urdf, surfaces: surfaces.clone(), ..Default::default() })
                .unwrap_err(),
            sim.add_mjcf(MjcfCfg { surfaces, ..MjcfCfg::text("part", PART) }).unwrap_err(),
            SimulationManager::new(SimulationManagerCfg {
                ground: Some(GroundCfg { surface, ..Default::default() }),
                ..Default::default()
            })
            .unwrap_err(),
        ];
        for error in errors {
            assert!(matches!(error, Error::Config { field, .. } if field == expected), "{expected}: {error}");
        }
    }
    let surfaces = vec![("bel".to_string(), SurfaceCfg::glass())];
    let error = sim.add_mjcf(MjcfCfg { surfaces, ..MjcfCfg::text("part", PART) }).unwrap_err().to_string();
    assert!(error.contains("part \"part\", surfaces") && error.contains("bell"), "{error}");
    let urdf = UrdfCfg::single(kinetoscope::assets::path("sr5/SR5.urdf").unwrap());
    let surfaces = vec![("lefthand".to_string(), SurfaceCfg::glass())];
    let error = sim.add_robot(RobotCfg { urdf, surfaces, ..Default::default() }).unwrap_err().to_string();
    assert!(error.contains("robot \"robot\", surfaces") && error.contains("lefthand"), "{error}");
}

#[test]
fn lamps_are_what_they_were_asked_for() {
    let lamp = LightCfg {
        position: [1.0, 2.0, 3.0].into(),
        direction: [0.0, 3.0, -4.0].into(),
        color: [1.0, 0.5, 0.0],
        attenuation: [0.5, 0.25, 0.125],
        radius: 0.0625,
        ..Default::default()
    };
    let lights = vec![
        LightCfg { radius: 0.00465, ..Default::default() },
        LightCfg { kind: LampKind::Point, ..lamp.clone() },
        LightCfg { kind: LampKind::Spot { cutoff_deg: 30.0, exponent: 5.0 }, cast_shadow: false, ..lamp },
    ];
    let cfg = SceneCfg::new(SimulationManagerCfg { lights, ..Default::default() });
    let types = EntityTypes::default();
    let text = cfg.to_toml(&types).unwrap();
    let again = SceneCfg::from_toml(&text, "scene.toml", &types).unwrap();
    assert_eq!(again.simulation, cfg.simulation);
    let mut scene = InteractiveScene::new(cfg).unwrap();
    let mut look = kinetoscope::sim::Look::default();
    scene.sim_mut().look(EnvId(0), &mut look).unwrap();
    let [sun, bulb, spot] = look.lights[..] else { panic!("{:?}", look.lights) };
    assert_eq!((sun.kind, sun.radius, sun.cast_shadow), (LightKind::Directional, 0.00465, true));
    assert_eq!((bulb.kind, bulb.radius, bulb.cast_shadow), (LightKind::Point, 0.0625, true));
    assert_eq!(spot.kind, LightKind::Spot { cutoff_deg: 30.0, exponent: 5.0 });
    assert_eq!((spot.radius, spot.cast_shadow), (0.0625, false));
    for lamp in [bulb, spot] {
        assert_eq!((lamp.position, lamp.attenuation), ([1.0, 2.0, 3.0], [0.5, 0.25, 0.125]));
        assert!((0..3).all(|k| (lamp.direction[k] - [0.0, 0.6, -0.8][k]).abs() < 1e-6), "{:?}", lamp.direction);
        assert_eq!(lamp.diffuse, [1.0, 0.5, 0.0].map(decode_srgb));
    }
}

#[test]
fn what_lamps_cannot_be_is_refused() {
    let spot = |cutoff_deg, exponent| LightCfg { kind: LampKind::Spot { cutoff_deg, exponent }, ..Default::default() };
    let bad = [
        ("lights.kind.spot.cutoff_deg", spot(0.0, 1.0)),
        ("lights.kind.spot.cutoff_deg", spot(90.5, 1.0)),
        ("lights.kind.spot.cutoff_deg", spot(f64::NAN, 1.0)),
        ("lights.kind.spot.exponent", spot(45.0, -1.0)),
        ("lights.kind.spot.exponent", spot(45.0, 129.0)),
        ("lights.kind.spot.exponent", spot(45.0, 2.5)),
        ("lights.position", LightCfg { position: [0.0, f64::NAN, 0.0].into(), ..Default::default() }),
        ("lights.attenuation", LightCfg { attenuation: [0.0; 3], ..Default::default() }),
        ("lights.attenuation", LightCfg { attenuation: [1.0, -1.0, 0.0], ..Default::default() }),
        ("lights.radius", LightCfg { radius: -0.1, ..Default::default() }),
        ("lights.radius", LightCfg { radius: f64::INFINITY, ..Default::default() }),
    ];
    for (expected, light) in bad {
        let error =
            SimulationManager::new(SimulationManagerCfg { lights: vec![light], ..Default::default() }).unwrap_err();
        assert!(matches!(error, Error::Config { field, .. } if field == expected), "{expected}: {error}");
    }
    let types = EntityTypes::default();
    let text = "[simulation]\nlights = [{ kind = \"pont\" }]";
    let error = SceneCfg::from_toml(text, "scene.toml", &types).unwrap_err().to_string();
    assert!(error.contains("scene.toml:2") && error.contains("point"), "{error}");
}
