//! Pairs that never collide, each with the control that they do.

use super::object;
use kinetoscope::prelude::*;

/// A ball above a block on the ground.
fn stack() -> (SimulationManager, [ObjectId; 2]) {
    let cfg = SimulationManagerCfg { num_envs: 2, physics_dt: 2e-3, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let block = sim.add_rigid_object(object("block", ObjectShape::cube(0.4), [0.0, 0.0, 0.2])).unwrap();
    let ball = sim.add_rigid_object(object("ball", ObjectShape::Sphere { radius: 0.1 }, [0.0, 0.0, 0.52])).unwrap();
    (sim, [block, ball])
}

fn heights(sim: &mut SimulationManager, ids: [ObjectId; 2]) -> [f64; 2] {
    sim.update(500);
    ids.map(|id| sim.rigid_object(id).get_pose()[(1, 2)])
}

fn contacts(sim: &SimulationManager) -> usize {
    sim.batch().read(1, |env| env.data().contact().len())
}

#[test]
fn objects_pass_through_each_other() {
    let (mut sim, ids) = stack();
    let [block, ball] = heights(&mut sim, ids);
    assert!((block - 0.2).abs() < 1e-3 && (ball - 0.5).abs() < 1e-3, "the control: {block} {ball}");
    let (mut sim, ids) = stack();
    sim.exclude_collision("ball", "block").unwrap();
    let model = sim.batch().model().clone();
    sim.exclude_collision("block", "ball").unwrap();
    assert!(sim.batch().model().is(&model), "known already: nothing is compiled");
    let [block, ball] = heights(&mut sim, ids);
    assert!((block - 0.2).abs() < 1e-3 && (ball - 0.1).abs() < 1e-3, "inside of it, on the ground: {block} {ball}");
}

/// At any time: what is excluded later falls then.
#[test]
fn the_world_lets_them_through() {
    let (mut sim, ids) = stack();
    heights(&mut sim, ids);
    assert!(contacts(&sim) > 0);
    sim.exclude_collision("block", "world").unwrap();
    let [block, ball] = heights(&mut sim, ids);
    assert!(block < -4.0, "{block}");
    assert!((ball - 0.1).abs() < 1e-3, "the ball is not meant: {ball}");
}

/// A robot by its name is all of its links; its own links among each other need their pair.
#[test]
fn links_pass_through_objects() {
    let urdf = || UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    let build = |apart: Option<&str>| {
        let cfg = SimulationManagerCfg { num_envs: 2, ground: None, gravity: [0.0; 3].into(), ..Default::default() };
        let mut sim = SimulationManager::new(cfg).unwrap();
        let arm = sim.add_robot(RobotCfg { uid: "arm".into(), urdf: urdf(), ..Default::default() }).unwrap();
        let tip = sim.robot(arm).link_names().last().unwrap().to_string();
        let row = sim.robot(arm).link_pose(&tip).unwrap();
        let at = [row[(1, 0)], row[(1, 1)], row[(1, 2)]];
        sim.add_rigid_object(object("fog", ObjectShape::cube(0.1), at)).unwrap();
        if let Some(name) = apart {
            sim.exclude_collision(name, "fog").unwrap();
        }
        (contacts(&sim), tip)
    };
    let (found, tip) = build(None);
    assert!(found > 0, "the control");
    assert_eq!(build(Some("arm")).0, 0);
    // One body of two that reach into it, or all of what reaches into it: never more contacts than before.
    assert!(build(Some(&format!("arm/{tip}"))).0 < found);
}

#[test]
fn names_that_mean_nothing() {
    let (mut sim, ids) = stack();
    for (one, other) in [("bal", "block"), ("block", "bal"), ("ground", "bal")] {
        let error = sim.exclude_collision(one, other).unwrap_err();
        assert!(matches!(&error, Error::UnknownName { what: "body called", .. }), "{error}");
    }
    for name in ["ball", "world"] {
        let error = sim.exclude_collision(name, name).unwrap_err();
        assert!(matches!(error, Error::Config { field: "exclude_collision", .. }), "{error}");
    }
    let error = sim.exclude_collision("bal", "block").unwrap_err().to_string();
    assert!(error.contains("\"ball\""), "{error}");
    let [_, ball] = heights(&mut sim, ids);
    assert!((ball - 0.5).abs() < 1e-3, "nothing was changed");
}
