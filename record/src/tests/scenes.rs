//! Scene messages for viewers, read by the package `mcap` and compared with MuJoCo's geoms.

use super::*;
use kinetoscope_scene::PoseF32;
use kinetoscope_scene::shape::Shape;
use kinetoscope_sim::{EnvVisualState, Property};
use kinetoscope_testkit::worlds::{fixed, object};

const STEPS: u32 = 30;

/// All types of MuJoCo's geoms, on moving bodies.
const TOYS: &str = r#"<mujoco><worldbody><geom name="post" type="capsule" size="0.05 0.2" pos="-1 0.4 0.3" euler="20 0 40"/>
    <body name="mobile" pos="-1 0 1" euler="0 30 0"><joint name="swing" type="ball"/>
      <geom type="box" size="0.1 0.2 0.05" pos="0.3 0 0" euler="10 20 30" rgba="0.1 0.2 0.3 1"/>
      <body name="tip" pos="0.5 0 0" euler="0 0 90"><joint name="slide" type="slide" axis="0 0 1"/>
        <geom type="sphere" size="0.07" pos="0 0.1 0"/><geom type="ellipsoid" size="0.05 0.1 0.15" pos="0.2 0 0" euler="0 45 0"/>
        <geom type="cylinder" size="0.04 0.12" pos="0 0 0.2" euler="70 0 0"/>
        <geom type="box" size="0.01 0.01 0.01" group="3"/></body></body></worldbody></mujoco>"#;

/// Kind of a shape in a recording, points in its own frame, and its number of corners. The points are vertices, or the
/// centers of the sides of the bounding box.
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

/// Largest distance between points of entities and their positions in MuJoCo, in an environment \[m\].
fn farthest(world: &mut World, env: usize, entities: &Value) -> f64 {
    let scene = world.sim.scene_mut().env_scene(EnvId(env)).unwrap();
    let mut look = EnvVisualState::default();
    world.sim.scene_mut().read_visual_state(EnvId(env), &mut look).unwrap();
    let (mut farthest, mut count): (f64, usize) = (0.0, 0);
    let seen = scene.instances().iter().zip(&look.instances).enumerate();
    for (index, (instance, pose)) in seen.filter(|(_, (one, _))| one.visible && one.group < 3) {
        let entity = &entities[format!("{}#{index}", instance.name)];
        let (kind, expected, corners) = outline(&instance.shape);
        let found = ["kind", "corners", "name", "mask_id"].map(|field| &entity[field]);
        let wanted = [json!(kind), json!(corners), json!(*instance.name), json!(instance.mask_id)];
        assert_eq!(found, wanted.each_ref(), "{entity}");
        let points: Vec<Vec<f64>> = list(&entity["points"]).iter().map(numbers).collect();
        assert_eq!(points.len(), expected.len());
        for (found, own) in points.iter().zip(&expected) {
            let there = PoseF32::apply(pose, *own);
            let apart = (0..3).map(|k| (found[k] - f64::from(there[k])).powi(2)).sum::<f64>().sqrt();
            farthest = farthest.max(apart);
        }
        count += 1;
    }
    assert_eq!(entities.as_object().unwrap().len(), count, "an entity for each visible geom, and no other");
    farthest
}

/// Entities of an update.
fn entities(update: &Value) -> impl Iterator<Item = &Value> {
    update["entities"].as_object().unwrap().values()
}

/// Poses and vertices of geoms are in single precision, some meters from the origin. Each has an error of 2.4e-7 m
/// below 4 m, in three axes, and each axis has three products.
const NEAR: f64 = 3e-6;

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn entity_poses() {
    let (_folder, path) = scratch("run.mcap");
    let mut world = World::new(2, 2);
    world.sim.add_mjcf(MjcfPartCfg::text("toys", TOYS)).unwrap();
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    (0..STEPS).for_each(|step| world.step(step));
    // Changes a color in one environment.
    let rgba = [0.25, 0.5, 0.75, 1.0];
    world
        .sim
        .properties_mut()
        .randomize_with(Some(&[EnvId(1)]), |_, _, p| p.set(Property::Color, "cube", &rgba))
        .unwrap();
    world.step(STEPS);
    // A fixed object, whose pose is not recorded.
    world.sim.add_rigid_object(fixed(object("table", ObjectShape::cube(0.2), [1.0, -1.0, 0.5]))).unwrap();
    world.step(STEPS + 1);
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert_eq!(recorded.left_out, [""; 0], "{recorded}");
    let found = script_output("read_scenes.py", &path);
    // At the beginning, at the change of the color, and at the addition of the table. The other environment has no
    // second update.
    assert_eq!(found["counts"], json!({ "/env_0/scene": 2, "/env_1/scene": 3 }));
    let updates = list(&found["updates"]);
    let steps: Vec<f64> = updates.iter().map(|update| update["time"].as_f64().unwrap() / 1e7).collect();
    assert_eq!(steps, [0.0, f64::from(STEPS), f64::from(STEPS + 1)]);
    let far = farthest(&mut world, 1, &updates[2]["entities"]);
    assert!(far < NEAR, "{far}");
    // Controls: the poses of environment 0, and a geom of a group that is not drawn.
    assert!(farthest(&mut world, 0, &updates[2]["entities"]) > 100.0 * NEAR);
    let frames: Vec<&str> = entities(&updates[2]).map(|entity| entity["frame"].as_str().unwrap()).collect();
    for frame in ["env_1", "env_1/cube", "env_1/toys/mobile", "env_1/toys/tip", "env_1/arm/link6"] {
        assert!(frames.contains(&frame), "{frame} in {frames:?}");
    }
    let color = |update| numbers(&entities(update).find(|entity| entity["name"] == "cube").unwrap()["color"]);
    assert_eq!(color(&updates[1]), rgba);
    assert_ne!(color(&updates[0]), color(&updates[1]));
}

/// Entities without a recorded pose are reported and not drawn.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn missing_poses() {
    let (folder, path) = scratch("run.mcap");
    let mut world = World::new(2, 1);
    let cfg = |path: &Path| RecorderCfg::new(path).with_topics([Topic::ObjectPose("cube".into())]);
    let recorded = record_steps(&mut world, cfg(&path), 3);
    assert_eq!(recorded.left_out, ["of the scene for viewers: arm (poses that are not recorded)"]);
    let found = script_output("read_scenes.py", &path);
    let names: Vec<&str> = entities(&found["updates"][0]).map(|entity| entity["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"cube") && names.contains(&"ground"), "{names:?}");
    // The link that is welded to the world has a fixed pose.
    assert!(names.iter().all(|name| !name.starts_with("arm/") || *name == "arm/base_link"), "{names:?}");
    // Control: a recording without the scene.
    let path = folder.path().join("without.mcap");
    assert_eq!(record_steps(&mut world, RecorderCfg { scene: false, ..cfg(&path) }, 0).left_out, [""; 0]);
    assert!(messages(&path).iter().all(|message| !message.topic.ends_with("/scene")));
}
