//! Mass, centre of mass, moments and friction of each environment at run time, by how objects move.

use super::{empty, object, weightless};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;

const SECOND: &[EnvId] = &[EnvId(1)];

/// F t / m in each environment; with the mass go the moments, T t / I.
#[test]
fn force_over_mass_is_acceleration() {
    let mut sim = weightless(3);
    let cfg = RigidObjectCfg { mass: Some(2.0), ..Default::default() };
    let cube = sim.add_rigid_object(cfg).unwrap();
    assert_eq!(sim.rigid_object(cube).get_mass(), array![2.0, 2.0, 2.0]);
    sim.rigid_object_mut(cube).set_mass(&array![0.5, 8.0], Some(&[EnvId(2), EnvId(0)])).unwrap();
    let masses = [8.0, 2.0, 0.5];
    assert_eq!(sim.rigid_object(cube).get_mass().to_vec(), masses);
    let (force, torque) = (array![[4.0, 0.0, 0.0]], array![[0.0, 0.0, 0.01]]);
    sim.rigid_object_mut(cube).set_external_wrench(&force, &torque, WrenchFrame::World, None).unwrap();
    assert_eq!(sim.rigid_object(cube).get_external_wrench().row(1).to_vec(), [4.0, 0.0, 0.0, 0.0, 0.0, 0.01]);
    sim.update(500);
    let v = sim.rigid_object(cube).get_velocity();
    for (env, mass) in masses.into_iter().enumerate() {
        assert!((v[(env, 0)] - 4.0 * 0.5 / mass).abs() < 1e-9, "{v}");
        // A cube: m a²/6.
        let moment = mass * 0.01 / 6.0;
        assert!((v[(env, 5)] / (0.01 * 0.5 / moment) - 1.0).abs() < 1e-9, "{v}");
        assert!((sim.rigid_object(cube).get_inertia()[(env, 2)] / moment - 1.0).abs() < 1e-12);
    }
    // It is the environment's: a reset ends the force, and leaves the mass.
    sim.reset(None).unwrap();
    assert_eq!(sim.rigid_object(cube).get_mass().to_vec(), masses);
    sim.update(10);
    assert!(sim.rigid_object(cube).get_velocity().iter().all(|v| *v == 0.0));
    assert_eq!(sim.property_bytes(EnvId(1)).unwrap(), 0, "the one that was not touched shares everything");
    // What is configured is what it was.
    assert_eq!(sim.rigid_object(cube).mass(), 2.0);
    sim.reset_properties(None).unwrap();
    assert_eq!(sim.rigid_object(cube).get_mass().to_vec(), [2.0; 3]);
}

/// MuJoCo's Euler takes damping at the end of the step: v' = v / (1 + h c / m), and a cube's turns so with b / I. Drawn, set,
/// and set while it moves; nominally what is configured.
#[test]
fn damping_of_each_environment_slows_by_its_law() {
    let mut sim = weightless(4);
    let cfg = RigidObjectCfg { mass: Some(2.0), linear_damping: 0.5, angular_damping: 0.001, ..Default::default() };
    let cube = sim.add_rigid_object(cfg).unwrap();
    let fixed = RigidObjectCfg { uid: "fixed".into(), body_type: BodyType::Static, ..Default::default() };
    let fixed = RigidObjectCfg { init_pose: Pose::translation(9.0, 0.0, 0.0), ..fixed };
    let fixed = sim.add_rigid_object(fixed).unwrap();
    assert_eq!(sim.rigid_object(fixed).get_damping(), Array2::<f64>::zeros((4, 2)));
    let drawn = Randomization::new().with(Property::LinearDamping, "object", Draw::Scale([2.0, 4.0])).with(
        Property::AngularDamping,
        "object",
        Draw::Add([0.01, 0.02]),
    );
    sim.randomize(&drawn, Some(&[EnvId(3)])).unwrap();
    sim.rigid_object_mut(cube).set_damping(&array![[3.0, 0.0]], Some(SECOND)).unwrap();
    let damping = sim.rigid_object(cube).get_damping();
    assert_eq!(
        [damping.row(0).to_vec(), damping.row(1).to_vec(), damping.row(2).to_vec()],
        [vec![0.5, 0.001], vec![3.0, 0.0], vec![0.5, 0.001]]
    );
    assert!((1.0..2.0).contains(&damping[(3, 0)]) && (0.011..0.021).contains(&damping[(3, 1)]), "{damping}");
    assert_eq!(sim.property_bytes(EnvId(2)).unwrap(), 0);
    assert!(sim.properties(EnvId(3)).unwrap().get(Property::LinearDamping, "object").unwrap() == [damping[(3, 0)]]);

    let mut expected = array![[1.0, -2.0, 3.0, 0.0, 0.0, 4.0]].broadcast((4, 6)).unwrap().to_owned();
    sim.rigid_object_mut(cube).write_velocity(&expected, None).unwrap();
    let (m, moment, h) = (2.0, 2.0 * 0.01 / 6.0, sim.cfg().physics_dt);
    let mut go_on = |sim: &mut SimulationManager, damping: &Array2<f64>| {
        sim.update(300);
        let found = sim.rigid_object(cube).get_velocity();
        for ((env, k), v) in expected.indexed_iter_mut() {
            let rate = if k < 3 { damping[(env, 0)] / m } else { damping[(env, 1)] / moment };
            *v *= (1.0 + h * rate).powi(-300);
            assert!((found[(env, k)] - *v).abs() < 1e-9, "{env} {k}: {found} instead of {v}");
        }
    };
    go_on(&mut sim, &damping);
    // It is the environment's: adding something leaves it, and it changes from one step to the next.
    sim.add_rigid_object(object("late", ObjectShape::cube(0.1), [0.0, 9.0, 0.0])).unwrap();
    assert_eq!(sim.rigid_object(cube).get_damping(), damping);
    sim.rigid_object_mut(cube).set_damping(&array![[0.0, 0.004]], Some(&[EnvId(0)])).unwrap();
    let later = sim.rigid_object(cube).get_damping();
    assert_eq!((later[(0, 0)], later[(0, 1)], later.row(3)), (0.0, 0.004, damping.row(3)));
    go_on(&mut sim, &later);
    sim.reset(None).unwrap();
    assert_eq!(sim.rigid_object(cube).get_damping(), later);
    sim.reset_properties(None).unwrap();
    assert_eq!(sim.rigid_object(cube).get_damping().row(3), array![0.5, 0.001]);
    let refused = sim.rigid_object_mut(fixed).set_damping(&array![[0.0, 0.0]], None);
    assert!(matches!(refused, Err(Error::NotDynamic { argument: "set_damping", .. })), "{refused:?}");
    let error = sim.rigid_object_mut(cube).set_damping(&array![[-1.0, 0.0]], None).unwrap_err().to_string();
    assert!(error.contains("linear_damping") && error.contains(">= 0"), "{error}");
}

/// A force on a block on the ground moves it beyond mu m g, and not below it.
#[test]
fn friction_is_a_threshold() {
    let cfg = SimulationManagerCfg {
        num_envs: 4,
        friction: [0.0, 0.0, 0.0],
        physics_dt: 2e-3,
        ..SimulationManagerCfg::manipulation()
    };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let block = object("block", ObjectShape::Box { size: [0.4, 0.4, 0.1] }, [0.0, 0.0, 0.05]);
    let cfg = RigidObjectCfg { mass: Some(2.0), friction: Some([0.5, 0.005, 0.0001]), ..block };
    let id = sim.add_rigid_object(cfg).unwrap();
    let rows = array![[0.3, 0.005, 0.0001], [0.6, 0.01, 0.0002]];
    sim.rigid_object_mut(id).set_friction(&rows, Some(&[EnvId(2), EnvId(3)])).unwrap();
    let read = sim.rigid_object(id).get_friction();
    assert_eq!(read, array![[0.5, 0.005, 0.0001], [0.5, 0.005, 0.0001], [0.3, 0.005, 0.0001], [0.6, 0.01, 0.0002]]);
    // 10 % below and above the threshold of 0.5, then 8.83 N: above that of 0.3, below that of 0.6.
    let weight = 2.0 * 9.81;
    let pull = [0.45, 0.55, 0.45, 0.45].map(|part| part * weight);
    // At the height of the ground, so that nothing tips: the torque of a force 5 cm above it is taken back.
    let force = Array2::from_shape_fn((4, 3), |(e, k)| if k == 0 { pull[e] } else { 0.0 });
    let torque = Array2::from_shape_fn((4, 3), |(e, k)| if k == 1 { -0.05 * pull[e] } else { 0.0 });
    sim.update(200);
    let start = sim.rigid_object(id).get_pose();
    sim.rigid_object_mut(id).set_external_wrench(&force, &torque, WrenchFrame::World, None).unwrap();
    sim.update(500);
    let moved = sim.rigid_object(id).get_pose() - start;
    // MuJoCo's friction creeps; what slides goes a t²/2 = (F/m - mu g) t²/2.
    for (env, expected) in [(1, 0.05 * 9.81 / 2.0), (2, 0.15 * 9.81 / 2.0)] {
        assert!((moved[(env, 0)] / expected - 1.0).abs() < 0.05, "{env}: {} {expected}", moved[(env, 0)]);
    }
    assert!(moved[(0, 0)].abs() < 0.01 && moved[(3, 0)].abs() < 0.01, "{moved}");
}

/// On both lines of MuJoCo a cube that is nominally centred may have its centre of mass elsewhere: the origin is then
/// accelerated to it by w² d, in its environment.
#[test]
fn the_centre_of_mass_moves_in_one_environment() {
    let mut sim = weightless(2);
    let cube = sim.add_rigid_object(RigidObjectCfg::default()).unwrap();
    sim.rigid_object_mut(cube).set_center_of_mass(&array![[0.03, 0.0, 0.0]], Some(SECOND)).unwrap();
    assert_eq!(sim.rigid_object(cube).get_center_of_mass(), array![[0.0, 0.0, 0.0], [0.03, 0.0, 0.0]]);
    sim.rigid_object_mut(cube).write_velocity(&array![[0.0, 0.0, 0.0, 0.0, 0.0, 2.0]], None).unwrap();
    let before = sim.rigid_object(cube).get_velocity();
    sim.update(1);
    let gained = (sim.rigid_object(cube).get_velocity() - before) / 1e-3;
    // w² d along x; the spin turns by 2e-3 rad within the step.
    assert!((gained[(1, 0)] - 4.0 * 0.03).abs() < 1e-3 && gained[(1, 1)].abs() < 1e-3, "{gained}");
    assert!(gained.row(0).iter().all(|a| a.abs() < 1e-9), "{gained}");
}

#[test]
fn moments_of_one_environment_turn_it_slower() {
    let mut sim = weightless(2);
    let cube = sim.add_rigid_object(RigidObjectCfg { mass: Some(1.0), ..Default::default() }).unwrap();
    sim.rigid_object_mut(cube).set_inertia(&array![[0.02, 0.03, 0.04]], Some(SECOND)).unwrap();
    let torque = array![[0.0, 0.01, 0.0]];
    sim.rigid_object_mut(cube).set_external_wrench(&array![[0.0; 3]], &torque, WrenchFrame::World, None).unwrap();
    sim.update(100);
    let w = sim.rigid_object(cube).get_velocity();
    assert!((w[(1, 4)] - 0.001 / 0.03).abs() < 1e-9 && (w[(0, 4)] - 0.001 * 600.0).abs() < 1e-9, "{w}");
}

/// Masses of what is added later are not mixed up with those that were set.
#[test]
fn what_was_set_is_carried_over() {
    let mut sim = empty(2);
    let cube = sim.add_rigid_object(RigidObjectCfg { mass: Some(1.0), ..Default::default() }).unwrap();
    sim.rigid_object_mut(cube).set_mass(&array![3.0], Some(SECOND)).unwrap();
    let other = sim.add_rigid_object(object("other", ObjectShape::cube(0.1), [1.0; 3])).unwrap();
    assert_eq!(sim.rigid_object(cube).get_mass().to_vec(), [1.0, 3.0]);
    assert_eq!(sim.rigid_object(other).get_mass().to_vec(), [sim.rigid_object(other).mass(); 2]);
}

/// A static object has friction, and the mass of its configuration to read.
#[test]
fn what_stands_fixed_has_friction_and_no_mass_of_its_own() {
    let mut sim = empty(2);
    let shelf = RigidObjectCfg { body_type: BodyType::Static, mass: Some(7.0), ..Default::default() };
    let shelf = sim.add_rigid_object(shelf).unwrap();
    assert_eq!(sim.rigid_object(shelf).get_mass().to_vec(), [7.0; 2]);
    sim.rigid_object_mut(shelf).set_friction(&array![[0.2, 0.0, 0.0]], Some(SECOND)).unwrap();
    assert_eq!(sim.rigid_object(shelf).get_friction(), array![[1.0, 0.005, 0.0001], [0.2, 0.0, 0.0]]);
    let error = sim.rigid_object_mut(shelf).set_mass(&array![1.0], None).unwrap_err();
    assert!(matches!(&error, Error::NotDynamic { argument: "set_mass", object } if object == "object"), "{error}");
}
