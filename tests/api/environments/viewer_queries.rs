//! Queries of viewers, compared with MuJoCo's arrays and closed forms; checks of the configuration.

use super::worlds::{all_bits, arm, cfg, cube};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::scene::PoseF32;
use kinetoscope::sim::{EnvVisualState, Error};
use kinetoscope_testkit::worlds::pose_of_row;
use nalgebra::Vector3;

const G: f64 = 9.81;

/// A cube at rest presses with its weight; a falling cube has no contact. The query changes nothing.
#[test]
fn contacts() {
    let mut sim = SimulationManager::new(cfg(2, 1)).unwrap();
    let mass = 2.0;
    let id = sim.add_rigid_object(cube("cube", mass, [0.0, 0.0, 0.05])).unwrap();
    sim.update(300);
    sim.rigid_object_mut(id).write_pose(&array![[0.0, 0.0, 3.0, 1.0, 0.0, 0.0, 0.0]], Some(&[EnvId(1)])).unwrap();
    let before = all_bits(&sim);
    let contacts = sim.scene_mut().contacts(None).unwrap();
    assert_eq!(all_bits(&sim), before);
    assert_eq!((contacts.len(), contacts[0].len(), contacts[1].len()), (2, 4, 0));
    let weight: f64 = contacts[0].iter().map(|contact| contact.normal_force).sum();
    // The cube is at rest: its acceleration is below 1e-4 m/s² after 3 s.
    assert!((weight - mass * G).abs() < 1e-4 * mass * G, "{weight}");
    for contact in &contacts[0] {
        // The ground is the world; the force on the cube points up.
        let sign = if contact.bodies == [None, Some(0)] { 1.0 } else { -1.0 };
        assert!(contact.bodies == [None, Some(0)] || contact.bodies == [Some(0), None], "{contact:?}");
        assert!((sign * contact.normal[2] - 1.0).abs() < 1e-9 && sign * contact.force[2] > 0.0, "{contact:?}");
        assert!((contact.force[2].abs() - contact.normal_force).abs() < 1e-9, "{contact:?}");
        assert!(contact.point[0].abs() < 0.0501 && contact.point[2].abs() < 1e-3 && contact.distance.abs() < 1e-3);
    }
    let one = sim.scene_mut().contacts(Some(&[EnvId(0)])).unwrap();
    assert_eq!(format!("{one:?}"), format!("{:?}", &contacts[..1]));
    assert!(matches!(sim.scene_mut().contacts(Some(&[EnvId(2)])), Err(Error::UnknownIndex { index: 2, .. })));
}

/// Every field of the snapshot agrees with MuJoCo's arrays and with the getters of robots and objects.
#[test]
fn env_snapshot() {
    let mut sim = SimulationManager::new(cfg(2, 1)).unwrap();
    let robot = sim.add_robot(arm()).unwrap();
    let id = sim.add_rigid_object(cube("cube", 0.5, [1.0, 0.0, 2.0])).unwrap();
    sim.robot_mut(robot).set_qpos_target(&array![[0.2, 0.4, -0.6, 0.1, 0.3, 0.0]], None, Some(&[EnvId(1)])).unwrap();
    sim.update(20);
    let mut look = EnvVisualState::default();
    sim.scene_mut().read_visual_state(EnvId(1), &mut look).unwrap();
    assert_eq!((look.time, look.diverged.clone()), (sim.time()[1], None));
    let names = sim.entities().body_names();
    assert_eq!(look.bodies.len(), names.len());
    for (name, body) in names.iter().zip(&look.bodies) {
        let pose = match name.strip_prefix("arm/") {
            Some(link) => sim.robot(robot).link_pose(link).unwrap(),
            None => sim.rigid_object(id).pose(),
        };
        let row = kinetoscope::scene::pose::to_row(body);
        assert!((0..7).all(|k| (row[k] - pose[(1, k)]).abs() < 1e-12), "{name}: {row:?} {pose}");
    }
    sim.batch().read(1, |env| {
        let (data, model) = (env.data(), env.data().model());
        assert_eq!(look.joints.len(), 6, "the free joint of the cube has no axis");
        for (joint, axis) in look.joints.iter().enumerate() {
            let row = |of: &[f64]| std::array::from_fn(|k| of[3 * joint + k]);
            assert_eq!((axis.anchor, axis.axis, axis.is_slide), (row(data.xanchor()), row(data.xaxis()), false));
        }
        let total: f64 = look.mass_points.iter().map(|(_, mass)| mass).sum();
        assert!((total - model.body_mass().iter().sum::<f64>()).abs() < 1e-12);
        let moment: f64 = look.mass_points.iter().map(|(at, mass)| at[2] * mass).sum();
        assert!((moment / total - data.subtree_com()[2]).abs() < 1e-12);
    });
    let instance = sim
        .scene_mut()
        .visual_scene()
        .scene()
        .instances()
        .iter()
        .position(|instance| &*instance.name == "cube")
        .unwrap();
    let expected = PoseF32::from(&pose_of_row(&sim.rigid_object(id).pose(), 1));
    assert_eq!(look.instances[instance].translation, expected.translation);
    assert!(matches!(
        sim.scene_mut().read_visual_state(EnvId(2), &mut look),
        Err(Error::UnknownIndex { index: 2, .. })
    ));
}

/// A force F at r from the middle of a cube: after a step v = h F / m and w = h r x F / I, I = m a²/6; the same in the
/// next step; no more after release.
#[test]
fn external_force() {
    let settings = SimulationManagerCfg { gravity: [0.0; 3].into(), ground: None, ..cfg(2, 1) };
    let mut sim = SimulationManager::new(settings).unwrap();
    let mass = 2.0;
    let id = sim.add_rigid_object(cube("cube", mass, [1.0, 2.0, 3.0])).unwrap();
    let (force, arm) = ([0.3, -0.2, 0.5], [0.05, 0.0, -0.02]);
    let point = [1.0 + arm[0], 2.0 + arm[1], 3.0 + arm[2]];
    sim.scene_mut().set_point_forces(EnvId(1), 0, &[(point, force)]).unwrap();
    let h = sim.cfg().physics_dt;
    let turn = Vector3::from(arm).cross(&Vector3::from(force)) / (mass * 0.01 / 6.0);
    let mut step = || {
        sim.update(1);
        sim.rigid_object(id).velocity()
    };
    let (first, second) = (step(), step());
    for k in 0..3 {
        assert!((first[(1, k)] - h * force[k] / mass).abs() < 1e-14 && (first[(1, 3 + k)] - h * turn[k]).abs() < 1e-12);
    }
    assert!((0..3).all(|k| (second[(1, k)] - 2.0 * first[(1, k)]).abs() < 1e-14), "{second}");
    assert!(second.row(0).iter().all(|v| *v == 0.0), "the other environment");
    sim.scene_mut().set_point_forces(EnvId(1), 0, &[]).unwrap();
    sim.update(1);
    let third = sim.rigid_object(id).velocity();
    assert!((0..3).all(|k| (third[(1, k)] - second[(1, k)]).abs() < 1e-14), "{third}");
    // A restored force acts as before, and an empty list ends it. Regression: a restored force could not be ended.
    sim.scene_mut().set_point_forces(EnvId(1), 0, &[(point, force)]).unwrap();
    let snapshot = sim.snapshot(None).unwrap();
    sim.restore(&snapshot, None).unwrap();
    sim.update(1);
    let fourth = sim.rigid_object(id).velocity();
    assert!((0..3).all(|k| (fourth[(1, k)] - third[(1, k)] - h * force[k] / mass).abs() < 1e-14), "{fourth}");
    sim.scene_mut().set_point_forces(EnvId(1), 0, &[]).unwrap();
    sim.update(1);
    let fifth = sim.rigid_object(id).velocity();
    assert!((0..3).all(|k| (fifth[(1, k)] - fourth[(1, k)]).abs() < 1e-14), "{fifth}");
    let refused = sim.scene_mut().set_point_forces(EnvId(0), 0, &[([0.0, f64::NAN, 0.0], force)]);
    assert!(matches!(refused, Err(Error::NotFinite { argument: "set_point_forces", column: 1, .. })), "{refused:?}");
    let body = sim.scene_mut().set_point_forces(EnvId(0), 1, &[(point, force)]);
    assert!(matches!(body, Err(Error::UnknownIndex { what: "body", index: 1, count: 1 })), "{body:?}");
    assert!(matches!(
        sim.scene_mut().set_point_forces(EnvId(2), 0, &[(point, force)]),
        Err(Error::UnknownIndex { index: 2, .. })
    ));
}

#[test]
fn counted_steps() {
    let mut sim = SimulationManager::new(SimulationManagerCfg { substeps: 2, ..cfg(2, 1) }).unwrap();
    assert_eq!(sim.observers().steps(), 0);
    sim.update(3);
    sim.reset(None).unwrap();
    sim.add_rigid_object(cube("cube", 1.0, [0.0, 0.0, 1.0])).unwrap();
    sim.update(4);
    assert_eq!(sim.observers().steps(), 7);
    let none = sim.snapshot(Some(&[])).unwrap();
    let both = sim.snapshot(None).unwrap();
    assert_eq!((none.is_empty(), none.len(), both.is_empty(), both.len()), (true, 0, false, 2));
}

/// Limits of fields; `tests/input/configuration.rs` has values far beyond them.
#[test]
fn bad_configurations() {
    let good = SimulationManagerCfg::default;
    good().validate().unwrap();
    SimulationManagerCfg::manipulation().validate().unwrap();
    SimulationManagerCfg::legged().validate().unwrap();
    SimulationManagerCfg { num_envs: 1 << 20, physics_dt: 1.0, substeps: 10_000, ..good() }.validate().unwrap();
    let ground = Some(GroundCfg { half_size: 1.0, color: [0.5, 1.5, 0.0], ..GroundCfg::default() });
    let lights = vec![LightCfg { color: [2.0, 0.0, 0.0], ..LightCfg::default() }];
    let rows = [
        ("num_envs", SimulationManagerCfg { num_envs: (1 << 20) + 1, ..good() }),
        ("physics_dt", SimulationManagerCfg { physics_dt: 1.1, ..good() }),
        ("gravity", SimulationManagerCfg { gravity: [0.0, 0.0, f64::INFINITY].into(), ..good() }),
        ("friction", SimulationManagerCfg { friction: [1.0, -0.1, 0.0], ..good() }),
        ("ground.color", SimulationManagerCfg { ground, ..good() }),
        ("lights.color", SimulationManagerCfg { lights, ..good() }),
    ];
    let variant = |field| format!("Config {{ field: {field:?}");
    kinetoscope_testkit::error_tables::assert_errors(
        rows.map(|(field, cfg)| (field, cfg.validate(), variant(field), [])),
    );
}
