//! Shapes without a randomizable size: the errors of meshes, planes and height fields name the reason and an
//! alternative.

use super::worlds::{cfg, cube};
use kinetoscope::mujoco::ObjectKind;
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sim::{Error, RandomizationError};
use kinetoscope_testkit::worlds::object;

/// Two bodies with one mesh, a small plane, a ball far away from it, and a body with a box and a mesh.
const PART: &str = r#"<mujoco><asset><mesh name="spike" vertex="0 0 0  0.2 0 0  0 0.2 0  0 0 0.2"/></asset><worldbody>
    <geom name="shelf" type="plane" size="0.5 0.5 0.1" pos="0 0 1"/>
    <body name="one" pos="-1 0 2"><freejoint/><geom type="mesh" mesh="spike"/></body>
    <body name="two" pos="-2 0 2"><freejoint/><geom type="mesh" mesh="spike"/></body>
    <body name="both" pos="-3 0 2"><freejoint/><geom type="box" size="0.1 0.1 0.1"/><geom type="mesh" mesh="spike"/></body>
    <body name="ball" pos="7 0 1.2"><freejoint/><geom size="0.1"/></body>
  </worldbody></mujoco>"#;

fn world() -> SimulationManager {
    let mut sim = SimulationManager::new(cfg(2, 1)).unwrap();
    sim.add_rigid_object(cube("cube", 1.0, [0.0, 3.0, 0.05])).unwrap();
    let cone = ObjectShape::Cone { radius: 0.1, height: 0.2 };
    sim.add_rigid_object(object("cone", cone, [1.0, 3.0, 0.2])).unwrap();
    let heights = array![[0.0, 0.1], [0.05, 0.0]];
    let init_pose = Pose::translation(-9.0, 0.0, 0.0);
    let hills = TerrainCfg { uid: "hills".into(), heights, size: [2.0; 2], init_pose, ..Default::default() };
    sim.add_terrain(hills).unwrap();
    sim.add_mjcf(MjcfPartCfg::text("part", PART)).unwrap();
    sim
}

fn size_of(sim: &SimulationManager, env: usize, name: &str) -> [f64; 3] {
    let properties = sim.properties().of(EnvId(env)).unwrap();
    properties.get(Property::Size, name).unwrap().try_into().unwrap()
}

#[test]
fn without_size() {
    let mut sim = world();
    let cases = [
        ("cone", ["its shape is a mesh", "one object (or body) per scale"]),
        ("part/one", ["its shape is a mesh", "of a mesh once for all environments"]),
        ("hills", ["its shape is a height field", "side by side"]),
        ("ground", ["its shape is a plane", "a box of the required size"]),
        ("part/shelf", ["its shape is a plane", "whose collision ignores the size"]),
    ];
    for (name, parts) in cases {
        let properties = sim.properties().of(EnvId(1)).unwrap();
        let randomization = Randomization::new().with(Property::Size, name, RandomizationOp::Scale([0.9, 1.1]));
        let errors = [
            properties.get(Property::Size, name).unwrap_err(),
            properties.nominal(Property::Size, name).unwrap_err(),
            sim.properties_mut().randomize(&randomization, None).unwrap_err(),
            sim.properties_mut()
                .randomize_with(None, |_, _, all| all.set(Property::Size, name, &[0.1; 3]))
                .unwrap_err(),
        ];
        for error in errors {
            let Error::Randomization(RandomizationError::NoSizeProperty { name: of, .. }) = &error else {
                panic!("{error:?}")
            };
            assert!(of == name && parts.iter().all(|part| error.to_string().contains(part)), "{error}");
        }
    }
    // An unknown name is a different error.
    let typo = Randomization::new().with(Property::Size, "cubes", RandomizationOp::Scale([0.9, 1.1]));
    let error = sim.properties_mut().randomize(&typo, None).unwrap_err();
    assert!(matches!(error, Error::Randomization(RandomizationError::Pattern { .. })), "{error:?}");
    assert!(sim.properties().of(EnvId(0)).unwrap().get(Property::Size, "cubes").is_err());
}

/// A pattern that matches entities of both kinds randomizes those with sizes, and within a body the shapes with sizes.
#[test]
fn mixed_patterns() {
    let mut sim = world();
    let drawn = Randomization::new().with(Property::Size, "c.*|part/both", RandomizationOp::Scale([1.2, 1.2]));
    sim.properties_mut().randomize(&drawn, Some(&[EnvId(1)])).unwrap();
    // Half lengths of 0.05 and 0.1 m, times the factor.
    for (name, half) in [("cube", 0.05), ("part/both", 0.1)] {
        assert_eq!(size_of(&sim, 0, name), [half; 3], "{name}");
        assert_eq!(size_of(&sim, 1, name), [1.2 * half; 3], "{name}");
    }
}

/// The reasons are true. A ball that falls next to a plane of half a meter comes to rest at the plane's height:
/// MuJoCo's contacts yield by less than a millimeter under 40 N. Two bodies with one mesh share its vertices.
#[test]
fn planes_and_meshes() {
    let mut sim = world();
    sim.update(300);
    sim.batch().read(0, |env| {
        let (data, model) = (env.data(), env.data().model());
        let body = |name: &str| model.id(ObjectKind::Body, name).unwrap();
        let height = data.xpos()[3 * body("part/ball") + 2];
        assert!((height - 1.1).abs() < 1e-3, "{height}");
        let mesh_of = |name: &str| {
            let of = body(name) as i32;
            model.geom_dataid()[(0..model.ngeom()).find(|&geom| model.geom_bodyid()[geom] == of).unwrap()]
        };
        assert_eq!(mesh_of("part/one"), mesh_of("part/two"));
        assert_ne!(mesh_of("part/one"), mesh_of("cone"), "the control");
    });
}
