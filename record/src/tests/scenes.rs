//! What recordings tell viewers of how environments look, read by the package `mcap` and held against MuJoCo's geoms.

use super::readers::{python, said};
use super::*;
use scene::{PoseF32, Shape};
use sim::{BodyType, Look, Property};
use serde_json::Value;

const STEPS: u32 = 30;

/// Everything that MuJoCo's geoms can be, on bodies that move.
const TOYS: &str = r#"<mujoco><worldbody><geom name="post" type="capsule" size="0.05 0.2" pos="-1 0.4 0.3" euler="20 0 40"/>
    <body name="mobile" pos="-1 0 1" euler="0 30 0"><joint name="swing" type="ball"/>
      <geom type="box" size="0.1 0.2 0.05" pos="0.3 0 0" euler="10 20 30" rgba="0.1 0.2 0.3 1"/>
      <body name="tip" pos="0.5 0 0" euler="0 0 90"><joint name="slide" type="slide" axis="0 0 1"/>
        <geom type="sphere" size="0.07" pos="0 0.1 0"/><geom type="ellipsoid" size="0.05 0.1 0.15" pos="0.2 0 0" euler="0 45 0"/>
        <geom type="cylinder" size="0.04 0.12" pos="0 0 0.2" euler="70 0 0"/>
        <geom type="box" size="0.01 0.01 0.01" group="3"/></body></body></worldbody></mujoco>"#;

fn number(text: &Value) -> f64 {
    f64::from_bits(text.as_str().unwrap().parse().unwrap())
}

fn points(entity: &Value) -> Vec<[f64; 3]> {
    let rows = entity["points"].as_array().unwrap().iter();
    rows.map(|row| std::array::from_fn(|k| number(&row[k]))).collect()
}

/// What a shape is told as, and points of it in its own frame: vertices, or the middles of the sides of the box around it.
fn outline(shape: &Shape) -> (&'static str, Vec<[f32; 3]>, usize) {
    let sides = |half: [f32; 3]| {
        let side = |sign: f32| (0..3).map(move |k| std::array::from_fn(|i| if i == k { sign * half[k] } else { 0.0 }));
        side(1.0).chain(side(-1.0)).collect()
    };
    match shape {
        Shape::Box(shape) => ("cube", sides(shape.half), 0),
        Shape::Sphere(shape) => ("ball", sides([shape.radius; 3]), 0),
        Shape::Ellipsoid(shape) => ("ball", sides(shape.radii), 0),
        Shape::Cylinder(shape) => ("cylinder", sides([shape.radius, shape.radius, shape.half_length]), 0),
        Shape::Mesh(shape) => ("triangles", shape.mesh.positions().to_vec(), 3 * shape.mesh.triangles().len()),
        other => {
            let mesh = other.tessellate(32);
            ("triangles", mesh.positions, 3 * mesh.triangles.len())
        }
    }
}

/// The largest distance of points of entities from where MuJoCo has them in an environment \[m\].
fn farthest(world: &mut World, env: usize, entities: &Value) -> f64 {
    let scene = world.sim.scene_of(EnvId(env)).unwrap();
    let mut look = Look::default();
    world.sim.look(EnvId(env), &mut look).unwrap();
    let mut farthest: f64 = 0.0;
    let seen = scene.instances().iter().zip(&look.instances).enumerate();
    let mut count = 0;
    for (index, (instance, pose)) in seen.filter(|(_, (one, _))| one.visible && one.group < 3) {
        let entity = &entities[format!("{}#{index}", instance.name)];
        let (kind, expected, corners) = outline(&instance.shape);
        assert_eq!(
            (entity["kind"].as_str(), entity["corners"].as_u64()),
            (Some(kind), Some(corners as u64)),
            "{entity}"
        );
        assert_eq!(
            (entity["name"].as_str(), entity["mask_id"].as_i64()),
            (Some(&*instance.name), Some(instance.mask_id.into()))
        );
        let found = points(entity);
        assert_eq!(found.len(), expected.len());
        let apart = |(found, own): (&[f64; 3], &[f32; 3])| {
            let there = PoseF32::apply(pose, *own);
            (0..3).map(|k| (found[k] - f64::from(there[k])).powi(2)).sum::<f64>().sqrt()
        };
        farthest = found.iter().zip(&expected).map(apart).fold(farthest, f64::max);
        count += 1;
    }
    assert_eq!(entities.as_object().unwrap().len(), count, "an entity for each geom that is seen, and no other");
    farthest
}

/// Poses of geoms and their vertices are in single precision, some metres from the origin: 2.4e-7 m each below 4 m, in three axes, and
/// in every one three products of as many.
const NEAR: f64 = 3e-6;

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn entities_are_where_mujoco_has_its_geoms() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut world = World::new(2, 2);
    world.sim.add_mjcf(MjcfCfg::text("toys", TOYS)).unwrap();
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    (0..STEPS).for_each(|step| world.step(step));
    let color = |sim: &mut SimulationManager, rgba: [f64; 4]| {
        sim.randomize_with(Some(&[EnvId(1)]), |_, _, p| p.set(Property::Color, "cube", &rgba)).unwrap();
    };
    // It looks otherwise from now on, and the other environment does not.
    color(&mut world.sim, [0.25, 0.5, 0.75, 1.0]);
    world.step(STEPS);
    // Something that stands, and something of which nobody records where it is.
    let object = |uid: &str, body_type, x| RigidObjectCfg {
        uid: uid.into(),
        shape: ObjectShape::cube(0.2),
        body_type,
        init_pose: Pose::translation(x, -1.0, 0.5),
        ..Default::default()
    };
    world.sim.add_rigid_object(object("table", BodyType::Static, 1.0)).unwrap();
    world.step(STEPS + 1);
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert_eq!(recorded.left_out, [""; 0], "{recorded}");
    let found = said(&python, "read_scenes.py", &path);
    // At the beginning, when the colour was set, when the table came; in the other environment without the second.
    assert_eq!(found["counts"], serde_json::json!({ "/env_0/scene": 2, "/env_1/scene": 3 }));
    let updates = found["updates"].as_array().unwrap();
    let steps: Vec<f64> = updates.iter().map(|update| update["time"].as_f64().unwrap() / 1e7).collect();
    assert_eq!(steps, [0.0, f64::from(STEPS), f64::from(STEPS + 1)]);
    let last = &updates[2]["entities"];
    let far = farthest(&mut world, 1, last);
    assert!(far < NEAR, "{far}");
    // The controls: what the other environment does, and a geom of a group that cameras do not draw.
    assert!(farthest(&mut world, 0, last) > 100.0 * NEAR);
    let frames: Vec<&str> =
        last.as_object().unwrap().values().map(|entity| entity["frame"].as_str().unwrap()).collect();
    for frame in ["env_1", "env_1/cube", "env_1/toys/mobile", "env_1/toys/tip", "env_1/arm/link6"] {
        assert!(frames.contains(&frame), "{frame} in {frames:?}");
    }
    let colors = |update: &Value| {
        let cube = update["entities"].as_object().unwrap().values().find(|entity| entity["name"] == "cube").unwrap();
        cube["color"].as_array().unwrap().iter().map(number).collect::<Vec<_>>()
    };
    assert_eq!(colors(&updates[1]), [0.25, 0.5, 0.75, 1.0]);
    assert_ne!(colors(&updates[0]), colors(&updates[1]));
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn what_has_no_recorded_pose_is_told_and_not_drawn() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut world = World::new(2, 1);
    let topics = [Topic::ObjectPose("cube".into())];
    let recorder = world.sim.record(RecorderCfg::new(&path).with_topics(topics.clone())).unwrap();
    (0..3).for_each(|step| world.step(step));
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert_eq!(recorded.left_out, ["of the scene for viewers: arm (poses that are not recorded)"]);
    let found = said(&python, "read_scenes.py", &path);
    let update = &found["updates"][0]["entities"];
    let names: Vec<&str> =
        update.as_object().unwrap().values().map(|entity| entity["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"cube") && names.contains(&"ground"), "{names:?}");
    // What is welded to the world stands where it is.
    assert!(names.iter().all(|name| !name.starts_with("arm/") || *name == "arm/base_link"), "{names:?}");
    // The control: without the scene nothing is told.
    let path = folder.path().join("without.mcap");
    let recorder =
        world.sim.record(RecorderCfg { scene: false, ..RecorderCfg::new(&path) }.with_topics(topics)).unwrap();
    assert_eq!(world.sim.finish_recording(recorder).unwrap().left_out, [""; 0]);
    assert!(super::messages(&path).iter().all(|message| !message.topic.ends_with("/scene")));
}
