//! Sizes and colors per environment: camera images, rays and contacts.
//!
//! The main reference is a scene built with the sizes and colors that were set in a single environment of another
//! scene: images and motions must have the same bits.

use super::worlds::{ALL, get, set};
use kinetoscope::mujoco::{BUILD_VERSION, ObjectKind, SupportedVersion};
use kinetoscope::ndarray::{Array3, Array4, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_wxyz;
use kinetoscope::scene::shape::Shape;
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{HitTargets, RayCaster, RayCasterCameraCfg};
use kinetoscope::sim::{Error, OffscreenScene, RandomizationError};
use kinetoscope_testkit::error_tables::assert_errors;
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::{sr5, text_robot};

/// Position of the camera, above all objects and looking straight down \[m\].
const EYE: [f64; 3] = [0.1, -0.05, 2.0];

fn cfg() -> SimulationManagerCfg {
    kinetoscope_testkit::worlds::cfg(3, 2)
}

/// An object whose mass and moments do not depend on its size.
fn object(uid: &str, shape: ObjectShape, at: [f64; 3]) -> RigidObjectCfg {
    RigidObjectCfg {
        inertia: Some([0.01, 0.012, 0.014]),
        mass: Some(1.0),
        ..kinetoscope_testkit::worlds::object(uid, shape, at)
    }
}

/// Sizes and colors of the scene's objects.
#[derive(Clone, Copy)]
struct Appearance {
    cube: [f64; 3],
    ball: f64,
    post: [f64; 2],
    pill: [f64; 2],
    color: [f64; 4],
}

const NOMINAL: Appearance =
    Appearance { cube: [0.2, 0.2, 0.2], ball: 0.1, post: [0.1, 0.3], pill: [0.08, 0.2], color: [0.6, 0.6, 0.6, 1.0] };
const CHANGED: Appearance = Appearance {
    cube: [0.3, 0.14, 0.26],
    ball: 0.17,
    post: [0.06, 0.5],
    pill: [0.11, 0.1],
    color: [0.9, 0.2, 0.1, 1.0],
};

/// Objects of every kind with sizes, above the ground and far enough apart for both appearances; and a mesh without
/// sizes.
fn world(look: Appearance) -> SimulationManager {
    let mut sim = SimulationManager::new(cfg()).unwrap();
    let cube = object("cube", ObjectShape::Box { size: look.cube }, [0.0, 0.0, 0.3]);
    let post = ObjectShape::Cylinder { radius: look.post[0], length: look.post[1] };
    let pill = ObjectShape::Capsule { radius: look.pill[0], length: look.pill[1] };
    for object in [
        RigidObjectCfg { rgba: look.color, ..cube },
        object("ball", ObjectShape::Sphere { radius: look.ball }, [0.5, 0.0, 0.4]),
        kinetoscope_testkit::worlds::fixed(object("post", post, [0.0, 0.5, 0.0])),
        object("pill", pill, [-0.5, 0.0, 0.5]),
        object("cone", ObjectShape::Cone { radius: 0.1, height: 0.2 }, [0.5, 0.5, 0.2]),
    ] {
        sim.add_rigid_object(object).unwrap();
    }
    sim
}

/// Applies an appearance to one environment.
fn set_appearance(sim: &mut SimulationManager, env: usize, look: Appearance) {
    let values: [(usize, Property, &str, &[f64]); 5] = [
        (env, Property::Size, "cube", &look.cube.map(|length| length / 2.0)),
        // Numbers that a ball does not use are ignored.
        (env, Property::Size, "ball", &[look.ball, 7.0, -1.0]),
        (env, Property::Size, "post", &[look.post[0], look.post[1] / 2.0, 0.0]),
        (env, Property::Size, "pill", &[look.pill[0], look.pill[1] / 2.0, 0.0]),
        (env, Property::Color, "cube", &look.color),
    ];
    set(sim, &values);
}

fn above() -> CameraCfg {
    CameraCfg {
        width: 121,
        height: 101,
        intrinsics: Intrinsics::Pixels { fx: 100.0, fy: 100.0, cx: 60.5, cy: 50.5 },
        near: 0.01,
        far: 10.0,
        extrinsics: Extrinsics {
            placement: Placement::Pose { pos: EYE, rotation: from_wxyz([0.0, 0.0, 1.0, 0.0]) },
            ..Default::default()
        },
        channels: Channels::from_names(&["color", "depth", "mask", "normal"]).unwrap(),
        ..Default::default()
    }
}

type Images = (Array4<u8>, Array3<f32>, Array3<i32>, Array4<f32>);

fn images(sim: &SimulationManager, id: SensorId<Camera>) -> Images {
    let camera = sim.sensor(id).unwrap();
    let (color, depth) = (camera.color().unwrap(), camera.depth().unwrap());
    (color.to_owned(), depth.to_owned(), camera.mask().unwrap().to_owned(), camera.normal().unwrap().to_owned())
}

/// True if environment `a` of `one` and environment `b` of `other` have the same bits in every channel.
fn same(one: &Images, a: usize, other: &Images, b: usize) -> bool {
    one.0.index_axis(Axis(0), a) == other.0.index_axis(Axis(0), b)
        && one.1.index_axis(Axis(0), a) == other.1.index_axis(Axis(0), b)
        && one.2.index_axis(Axis(0), a) == other.2.index_axis(Axis(0), b)
        && one.3.index_axis(Axis(0), a) == other.3.index_axis(Axis(0), b)
}

#[test]
fn as_built() {
    let (mut sim, mut built) = (world(NOMINAL), world(CHANGED));
    let mut plain = world(NOMINAL);
    // One camera is created before the change, one after.
    let before = sim.add_sensor("before", above()).unwrap();
    let nominal = images(&sim, before);
    set_appearance(&mut sim, 1, CHANGED);
    let after = sim.add_sensor("after", above()).unwrap();
    let reference = built.add_sensor("camera", above()).unwrap();
    let control = plain.add_sensor("camera", above()).unwrap();
    for steps in [0, 20, 300] {
        for sim in [&mut sim, &mut built, &mut plain] {
            sim.update(steps);
        }
        let (expected, others) = (images(&built, reference), images(&plain, control));
        for camera in [before, after] {
            let seen = images(&sim, camera);
            assert!(same(&seen, 1, &expected, 1), "after {steps} steps it looks as if built so");
            assert!(same(&seen, 0, &others, 0) && same(&seen, 2, &others, 2), "the others look as ever");
            assert!(!same(&seen, 1, &others, 1), "control: it does not look as ever");
        }
        for uid in ["cube", "ball", "post", "pill"] {
            let pose = |sim: &SimulationManager| sim.rigid_object(sim.entities().rigid_object_id(uid).unwrap()).pose();
            let (mine, built, plain) = (pose(&sim), pose(&built), pose(&plain));
            assert_eq!((mine.row(1), mine.row(0)), (built.row(1), plain.row(0)), "{uid} after {steps} steps");
        }
    }
    // Back to nominal; a reset of the state before that leaves the properties unchanged.
    sim.reset(None).unwrap();
    assert!(!same(&images(&sim, before), 1, &nominal, 1));
    sim.properties_mut().reset(ALL).unwrap();
    assert!((0..3).all(|env| same(&images(&sim, before), env, &nominal, env)));
}

/// MuJoCo's contacts are soft: on at most four corners a body of any mass sinks in by up to about (1 - d) g / (d k) =
/// 0.1 g / (0.9 · 2770 /s²) = 0.4 mm with its default reference (k = 1 / (0.95 · 0.02 s)²).
#[test]
fn resting_heights() {
    let mut sim = world(NOMINAL);
    let heights = [0.05, 0.11, 0.16];
    for (env, half) in heights.into_iter().enumerate() {
        let sizes: [(&str, &[f64]); 2] = [("cube", &[0.1, 0.12, half]), ("ball", &[half, 0.0, 0.0])];
        set(&mut sim, &sizes.map(|(name, size)| (env, Property::Size, name, size)));
    }
    sim.update(300);
    for uid in ["cube", "ball"] {
        let pose = sim.rigid_object(sim.entities().rigid_object_id(uid).unwrap()).pose();
        for (env, half) in heights.into_iter().enumerate() {
            let z = pose[(env, 2)];
            assert!((z - half).abs() < 5e-4, "{uid} of environment {env} lies at {z}, not {half}");
        }
    }
}

/// A ray at (x, y) from the optical axis, per meter of depth, meets a ball of radius r below at distance d in the depth
/// (d - sqrt(d² - (1 + x² + y²)(d² - r²))) / (1 + x² + y²). Images are in single precision.
#[test]
fn depth_of_ball() {
    let mut sim = SimulationManager::new(SimulationManagerCfg { gravity: [0.0; 3].into(), ..cfg() }).unwrap();
    let ball = ObjectShape::Sphere { radius: 0.1 };
    sim.add_rigid_object(object("ball", ball, [EYE[0], EYE[1], 0.7])).unwrap();
    let rays = RayCasterCameraCfg { width: 121, height: 101, intrinsics: above().intrinsics, ..Default::default() };
    let rays = RayCasterCameraCfg { extrinsics: above().extrinsics, ..rays };
    let (raster, rays) = (sim.add_sensor("raster", above()).unwrap(), sim.add_sensor("rays", rays).unwrap());
    let radii = [0.1, 0.23, 0.05];
    for env in [1, 2] {
        let radius = radii[env];
        set(&mut sim, &[(env, Property::Size, "ball", &[radius, 0.0, 0.0])]);
    }
    let id = sim.rigid_object(sim.entities().rigid_object_id("ball").unwrap()).mask_id();
    let (raster, rays) = (sim.sensor(raster).unwrap(), sim.sensor(rays).unwrap());
    let (depth, mask) = (raster.depth().unwrap(), raster.mask().unwrap());
    for (env, radius) in radii.into_iter().enumerate() {
        let (mut compared, d) = (0, EYE[2] - 0.7);
        for ((v, u), id_here) in mask.index_axis(Axis(0), env).indexed_iter() {
            let (x, y) = ((u as f64 - 60.0) / 100.0, (v as f64 - 50.0) / 100.0);
            let a = 1.0 + x * x + y * y;
            let inside = d * d - a * (d * d - radius * radius);
            // Pixels near the outline are skipped: rounding decides whether they hit.
            if inside < 0.02 * d * d * (a - 1.0).max(1e-9) {
                continue;
            }
            let expected = (d - inside.sqrt()) / a;
            // Near the outline the depth changes by d δ / sqrt(inside) with an error δ of the slope.
            let tolerance = 2e-6 * (1.0 + d / inside.sqrt());
            for found in [depth[(env, v, u)], rays.depth()[(env, v, u)]] {
                let found = f64::from(found);
                assert!((found - expected).abs() < tolerance, "environment {env}, {u} {v}: {found}, not {expected}");
            }
            assert_eq!((*id_here, rays.mask()[(env, v, u)]), (id, id));
            compared += 1;
        }
        let area = std::f64::consts::PI * (100.0 * radius / (d * d - radius * radius).sqrt()).powi(2);
        assert!(f64::from(compared) > 0.9 * area, "environment {env}: {compared} pixels of {area}");
    }
}

/// MuJoCo's rays in the environment's own model, compared with the sensor's rays. MuJoCo's rays pass through geoms with
/// an opacity of 0.
#[test]
fn mujoco_rays() {
    let mut sim = world(NOMINAL);
    let rays = RayCasterCfg {
        pattern: Grid { resolution: 0.05, size: [1.6, 1.6], ..Grid::default() }.into(),
        // Off edges, where rounding decides.
        offset: Pose::translation(0.0137, 0.0071, 2.0),
        ..Default::default()
    };
    let id = sim.add_sensor("rays", rays).unwrap();
    set_appearance(&mut sim, 1, CHANGED);
    set(&mut sim, &[(2, Property::Color, "cube", &[1.0, 0.0, 0.0, 0.0])]);
    sim.update(30);
    let rays = sim.sensor(id).unwrap();
    let (starts, directions) = (rays.ray_starts(), rays.ray_directions());
    let distances = rays.distances();
    let mut apart = [0; 3];
    for env in 0..3 {
        sim.batch().read(env, |here| {
            for ray in 0..rays.num_rays() {
                let row = |a: &Array3<f64>| std::array::from_fn(|k| a[(env, ray, k)]);
                let theirs = here.data().ray(row(&starts), row(&directions), 0b111).unwrap();
                let theirs = theirs.map_or(f64::INFINITY, |hit| hit.distance);
                let ours = distances[(env, ray)];
                assert!((ours - theirs).abs() < 1e-6, "environment {env}, ray {ray}: {ours}, not {theirs}");
                apart[env] += usize::from((ours - distances[(0, ray)]).abs() > 1e-3);
            }
        });
    }
    assert!(apart[1] > 30 && apart[2] > 3, "control: {apart:?} rays of the others hit something else");
}

/// A link with collision boxes and a mesh, and visual shapes in place of them.
fn arm(scale: f64) -> String {
    let size = |full: f64| format!("{} {} {}", full * scale, 0.5 * full * scale, 0.25 * full * scale);
    format!(
        r#"<robot name="arm"><link name="base"/>
        <joint name="j" type="revolute"><parent link="base"/><child link="fore"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
          <limit lower="-1" upper="1" effort="50" velocity="5"/></joint>
        <link name="fore"><inertial><mass value="1"/><inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial>
          <visual><geometry><box size="{}"/></geometry><material name="m"><color rgba="0.1 0.5 0.9 1"/></material></visual>
          <visual><origin xyz="0.6 0 0"/><geometry><sphere radius="{}"/></geometry></visual>
          <collision><geometry><box size="{}"/></geometry></collision></link></robot>"#,
        size(0.4),
        0.1 * scale,
        size(0.4)
    )
}

#[test]
fn robot_links() {
    let build = |scale: f64| {
        let mut sim = SimulationManager::new(cfg()).unwrap();
        sim.add_robot(text_robot(&TempFiles::default(), "arm", &arm(scale))).unwrap();
        let camera = sim.add_sensor("camera", above()).unwrap();
        (sim, camera)
    };
    let ((mut sim, camera), (built, judge)) = (build(1.0), build(1.5));
    let nominal = images(&sim, camera);
    let larger = Randomization::new().with(Property::Size, "arm/fore", RandomizationOp::Scale([1.5, 1.5]));
    sim.properties_mut().randomize(&larger, Some(&[EnvId(2)])).unwrap();
    let (seen, expected) = (images(&sim, camera), images(&built, judge));
    assert!(same(&seen, 2, &expected, 2) && same(&seen, 0, &nominal, 0) && !same(&seen, 2, &nominal, 2));
    // The collision shape is scaled as well, and masses do not change.
    sim.batch().read(2, |env| {
        let model = env.data().model();
        let geom = model.id(ObjectKind::Geom, "arm/fore/collision0").unwrap();
        for (k, half) in [0.3, 0.15, 0.075].into_iter().enumerate() {
            assert!((model.geom_size()[3 * geom + k] - half).abs() < 1e-15);
        }
    });
    assert_eq!(get(&sim, 2, Property::Mass, "arm/fore"), get(&sim, 0, Property::Mass, "arm/fore"));
    let red = [0.9_f64, 0.05, 0.05, 1.0];
    set(&mut sim, &[(2, Property::Color, "arm/fore", &red)]);
    assert_eq!(get(&sim, 2, Property::Color, "arm/fore"), red);
    // Red instead of blue, on average over all pixels but the ground; highlights are white.
    let image = images(&sim, camera);
    let sum = |channel: usize| {
        let arm = image.2.index_axis(Axis(0), 2);
        let pixels = arm.indexed_iter().filter(|(_, id)| **id != arm[(0, 0)]);
        pixels.map(|((v, u), _)| u64::from(image.0[(2, v, u, channel)])).sum::<u64>()
    };
    assert!(sum(0) > 20_000 && sum(0) > 2 * sum(2), "{} {}", sum(0), sum(2));
    assert_eq!(images(&sim, camera).1, seen.1, "a color changes no depth");
}

/// Meshes have no sizes but have colors; ground and terrain have no size.
#[test]
fn names() {
    let mut sim = world(NOMINAL);
    sim.add_robot(RobotCfg { init_pose: Pose::translation(3.0, 0.0, 0.0), ..sr5("sr5") }).unwrap();
    let properties = sim.properties().of(EnvId(0)).unwrap();
    // The links of the arm include boxes, cylinders and balls.
    let mut sized = properties.names(Property::Size);
    sized.retain(|name| !name.starts_with("sr5/"));
    assert_eq!(sized, ["cube", "ball", "post", "pill"]);
    let colored = properties.names(Property::Color);
    assert!(["cube", "cone", "sr5/link3"].iter().all(|name| colored.contains(name)), "{colored:?}");
    assert!(!colored.contains(&"ground"));
    assert_eq!(properties.get(Property::Size, "pill").unwrap(), [0.08, 0.1, 0.0]);
    assert_eq!(properties.nominal(Property::Color, "cube").unwrap(), [0.6_f32, 0.6, 0.6, 1.0].map(f64::from));
    // The color of a mesh.
    let camera = sim.add_sensor("camera", above()).unwrap();
    let before = images(&sim, camera);
    let cone = sim.rigid_object(sim.entities().rigid_object_id("cone").unwrap()).mask_id();
    let seen = |p: &Images, env: usize| p.2.index_axis(Axis(0), env).iter().filter(|id| **id == cone).count();
    // Randomized colors keep the opacity of 1, although a factor of 1.5 would exceed it.
    let black = Randomization::new().with(Property::Color, "cone", RandomizationOp::Set([0.0, 0.0]));
    sim.properties_mut()
        .randomize(&black.with(Property::Color, "cube", RandomizationOp::Scale([1.5, 1.5])), Some(&[EnvId(0)]))
        .unwrap();
    assert_eq!(get(&sim, 0, Property::Color, "cone"), [0.0, 0.0, 0.0, 1.0]);
    let brighter = f64::from(0.6_f32) * 1.5;
    assert_eq!(get(&sim, 0, Property::Color, "cube"), [brighter, brighter, brighter, 1.0]);
    assert_eq!(seen(&images(&sim, camera), 0), seen(&before, 0));
    set(&mut sim, &[(0, Property::Color, "cone", &[0.0; 4])]);
    let hidden = images(&sim, camera);
    assert!(seen(&before, 0) > 30 && seen(&hidden, 1) == seen(&before, 1));
    assert_eq!(seen(&hidden, 0), 0, "with an opacity of 0 it is not there");
}

#[test]
fn draws() {
    let sizes = Randomization::new().with(Property::Size, "cube|ball", RandomizationOp::Scale([0.5, 1.5]));
    let draw = sizes.with(Property::Color, "cube", RandomizationOp::Set([0.2, 0.8]));
    let mut sim = world(NOMINAL);
    let camera = sim.add_sensor("camera", above()).unwrap();
    sim.properties_mut().randomize(&draw, Some(&[EnvId(0), EnvId(2)])).unwrap();
    let sizes = |sim: &SimulationManager, env| get(sim, env, Property::Size, "cube");
    let (first, third) = (sizes(&sim, 0), sizes(&sim, 2));
    assert!(first[0] == first[1] && first[0] != third[0] && (0.05..=0.15).contains(&first[0]), "{first:?}");
    let mut other = world(NOMINAL);
    other.properties_mut().randomize(&draw, ALL).unwrap();
    assert_eq!((sizes(&other, 0), sizes(&other, 2)), (first.clone(), third));
    // The environment's own arrays, one by one.
    let base = sim.batch().model().clone();
    let own: Vec<(&str, usize)> = sim.batch().read(0, |env| env.data().model().own_arrays().collect());
    let geoms = base.ngeom();
    let mut expected = vec![("geom_size", 24 * geoms), ("geom_rbound", 8 * geoms), ("geom_rgba", 16 * geoms)];
    if BUILD_VERSION == SupportedVersion::V4 {
        expected.push(("geom_aabb", 48 * geoms));
    }
    for array in &expected {
        assert!(own.contains(array), "{array:?} of {own:?}");
    }
    // 4.x also updates the bounding boxes of bodies and the reach of joints.
    let rest: Vec<&str> = own.iter().filter(|array| !expected.contains(array)).map(|(name, _)| *name).collect();
    let follows = |name: &&str| BUILD_VERSION == SupportedVersion::V4 && ["bvh_aabb", "dof_length"].contains(name);
    assert!(rest.iter().all(follows), "{rest:?}");
    assert_eq!(sim.properties().bytes(EnvId(1)).unwrap(), 0);
    assert!(sim.batch().read(1, |env| env.data().model().unshared_arrays(&base).is_empty()));
    // Adding an entity keeps the appearance, also in images.
    let before = images(&sim, camera);
    sim.add_rigid_object(object("late", ObjectShape::cube(0.1), [9.0, 9.0, 0.05])).unwrap();
    assert_eq!(sizes(&sim, 0), first);
    let after = images(&sim, camera);
    assert!((0..3).all(|env| same(&before, env, &after, env)) && !same(&before, 0, &before, 1));
}

/// Scene snapshots for viewers show the same.
#[test]
fn offscreen_scenes() {
    let mut sim = world(NOMINAL);
    set_appearance(&mut sim, 1, CHANGED);
    let half = |still: &OffscreenScene| {
        let boxes = still.visible().scene().instances().iter().filter_map(|instance| match &instance.shape {
            Shape::Box(shape) => Some((shape.half, instance.material.rgba)),
            _ => None,
        });
        boxes.collect::<Vec<_>>()
    };
    let (grey, red) = ([0.6, 0.6, 0.6, 1.0_f32], [0.9, 0.2, 0.1, 1.0_f32]);
    let (small, large) = (([0.1_f32; 3], grey), ([0.15_f32, 0.07, 0.13], red));
    let of_env = |sim: &mut SimulationManager, env| half(&OffscreenScene::of_env(sim, EnvId(env)).unwrap());
    assert_eq!((of_env(&mut sim, 0), of_env(&mut sim, 1)), (vec![small], vec![large]));
    let overview = OffscreenScene::overview(&mut sim, None, &[]).unwrap();
    assert_eq!(half(&overview), [small, large, small]);
}

#[test]
fn mistakes() {
    let mut sim = world(NOMINAL);
    let cube = ["environment 1", "\"cube\"", "1e-6"];
    let rows: [(Property, &str, &[f64], &[&str]); 11] = [
        (Property::Size, "cube", &[0.0, 0.1, 0.1], &cube),
        (Property::Size, "cube", &[0.1, -0.1, 0.1], &cube),
        (Property::Size, "cube", &[0.1, 0.1, f64::NAN], &cube),
        (Property::Size, "cube", &[0.1, 2e6, 0.1], &cube),
        // A capsule needs a length.
        (Property::Size, "pill", &[0.1, 0.0, 0.0], &["\"pill\""]),
        (Property::Color, "cube", &[1.1, 0.0, 0.0, 1.0], &["opacity"]),
        (Property::Color, "cube", &[0.0, -0.1, 0.0, 1.0], &["opacity"]),
        (Property::Color, "cube", &[0.0, 0.0, f64::NAN, 1.0], &["opacity"]),
        (Property::Size, "cone", &[0.1; 3], &["its shape is a mesh"]),
        (Property::Size, "cube", &[0.1; 2], &["3 numbers"]),
        (Property::Color, "ground", &[0.1; 4], &["body or terrain"]),
    ];
    assert_errors(rows.map(|(property, name, value, parts)| {
        let done = sim.properties_mut().randomize_with(Some(&[EnvId(1)]), |_, _, p| p.set(property, name, value));
        (format!("{name} {value:?}"), done, "", parts)
    }));
    assert!((0..3).all(|env| sim.properties().bytes(EnvId(env)).unwrap() == 0), "nothing has changed");
}

/// A pattern that matches only invisible entities is an error: randomized colors keep opacities, and rays pass through
/// invisible shapes. Rays hit such a shape in the environments that make it visible.
#[test]
fn invisible_patterns() {
    let mut sim = world(NOMINAL);
    let ghost = object("ghost", ObjectShape::cube(0.3), [-0.6, 0.6, 0.8]);
    sim.add_rigid_object(RigidObjectCfg { rgba: [1.0, 1.0, 1.0, 0.0], ..ghost }).unwrap();
    let draw = |pattern: &str| Randomization::new().with(Property::Color, pattern, RandomizationOp::Set([0.2, 0.8]));
    let error = sim.properties_mut().randomize(&draw("ghost"), ALL).unwrap_err();
    assert!(matches!(&error, Error::Randomization(RandomizationError::Pattern { property: "color", .. })), "{error}");
    assert!(error.to_string().contains("\"ghost\"") && error.to_string().contains("\"post\""), "{error}");
    let rays = |name: &str| RayCasterCfg {
        pattern: Grid { resolution: 0.1, size: [0.2, 0.2], ..Grid::default() }.into(),
        offset: Pose::translation(-0.587, 0.613, 2.0),
        targets: HitTargets::Named(vec![name.into()]),
        ..Default::default()
    };
    let said = sim.add_sensor("nothing", rays("ghost")).unwrap_err().to_string();
    assert!(said.contains("ghost") && said.contains("post"), "{said}");
    // Controls: together with a visible entity the pattern is valid, and the ghost stays invisible.
    sim.properties_mut().randomize(&draw("ghost|cube"), ALL).unwrap();
    let both = sim.add_sensor("both", rays("ghost|cube")).unwrap();
    assert_eq!(get(&sim, 1, Property::Color, "ghost")[3], 0.0);
    let set_visible = |sim: &mut SimulationManager| set(sim, &[(1, Property::Color, "ghost", &[0.5, 0.5, 0.5, 1.0])]);
    set_visible(&mut sim);
    let ghost = sim.add_sensor("ghost_rays", rays("ghost")).unwrap();
    let hit = |sim: &SimulationManager, id: SensorId<RayCaster>| {
        let distances = sim.sensor(id).unwrap().distances().to_owned();
        [0, 1, 2].map(|env| distances.row(env).iter().filter(|d| d.is_finite()).count())
    };
    assert_eq!(hit(&sim, ghost), [0, 9, 0]);
    // The same for the earlier pattern of two entities, independent of its creation time.
    assert_eq!(hit(&sim, both), [0, 9, 0]);
    let late = sim.add_sensor("late", rays("ghost|cube")).unwrap();
    assert_eq!(hit(&sim, late), [0, 9, 0]);
    // The same after sensors are rebuilt, even while the ghost is invisible.
    sim.add_rigid_object(object("first", ObjectShape::cube(0.1), [8.0, 8.0, 0.05])).unwrap();
    assert!([ghost, both, late].into_iter().all(|id| hit(&sim, id) == [0, 9, 0]));
    sim.properties_mut().reset(ALL).unwrap();
    sim.add_rigid_object(object("second", ObjectShape::cube(0.1), [9.0, 9.0, 0.05])).unwrap();
    assert!([ghost, both, late].into_iter().all(|id| hit(&sim, id) == [0, 0, 0]));
    set_visible(&mut sim);
    assert!([ghost, both, late].into_iter().all(|id| hit(&sim, id) == [0, 9, 0]));
    // Control: a new sensor is refused while the ghost is invisible.
    sim.properties_mut().reset(ALL).unwrap();
    assert!(sim.add_sensor("refused", rays("ghost")).is_err());
}
