//! Mass, center of mass, moments, damping, friction and margins, from the configuration and per environment, measured
//! by the motion of objects.

use super::*;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::sim::{RigidObjectId, WrenchFrame};
use kinetoscope_testkit::error_tables::assert_error;

/// F t / m in each environment; moments scale with the mass, T t / I, for a cube m a²/6.
#[test]
fn mass() {
    let mut sim = weightless(3);
    let id = sim.add_rigid_object(cube("object", 0.1, 2.0, [0.0; 3])).unwrap();
    assert_eq!(sim.rigid_object(id).mass(), array![2.0, 2.0, 2.0]);
    sim.rigid_object_mut(id).set_mass(&array![0.5, 8.0], Some(&[EnvId(2), EnvId(0)])).unwrap();
    let masses = [8.0, 2.0, 0.5];
    assert_eq!(sim.rigid_object(id).mass().to_vec(), masses);
    set_wrench(&mut sim, id, [4.0, 0.0, 0.0], [0.0, 0.0, 0.01]);
    assert_eq!(sim.rigid_object(id).external_wrench().row(1).to_vec(), [4.0, 0.0, 0.0, 0.0, 0.0, 0.01]);
    sim.update(500);
    let v = sim.rigid_object(id).velocity();
    for (env, mass) in masses.into_iter().enumerate() {
        assert!((v[(env, 0)] - 4.0 * 0.5 / mass).abs() < 1e-9, "{v}");
        let moment = mass * 0.01 / 6.0;
        assert!((v[(env, 5)] / (0.01 * 0.5 / moment) - 1.0).abs() < 1e-9, "{v}");
        assert!((sim.rigid_object(id).inertia()[(env, 2)] / moment - 1.0).abs() < 1e-12);
    }
    // The mass belongs to the environment: a reset removes the force, and keeps the mass.
    sim.reset(None).unwrap();
    assert_eq!(sim.rigid_object(id).mass().to_vec(), masses);
    sim.update(10);
    assert!(sim.rigid_object(id).velocity().iter().all(|v| *v == 0.0));
    // The configuration is unchanged.
    assert_eq!(sim.rigid_object(id).nominal_mass(), 2.0);
    sim.properties_mut().reset(None).unwrap();
    assert_eq!(sim.rigid_object(id).mass().to_vec(), [2.0; 3]);
}

/// With the center of mass at rest and a spin w about z the origin circles it: after half a turn the origin has moved
/// by 2 d.
#[test]
fn center_of_mass() {
    let (d, w) = (0.04, 2.0);
    let half_a_turn = |sim: &mut SimulationManager, id: RigidObjectId| {
        sim.rigid_object_mut(id).write_velocity(&row([0.0, -w * d, 0.0, 0.0, 0.0, w]), None).unwrap();
        sim.update((std::f64::consts::PI / w / 1e-3).round() as u32);
        let pose = sim.rigid_object(id).pose();
        [pose[(0, 0)], pose[(0, 1)]]
    };
    let mut sim = weightless(1);
    let cfg = RigidObjectCfg { center_of_mass: Some([d, 0.0, 0.0]), ..cube("object", 0.1, 2.0, [0.0; 3]) };
    let id = sim.add_rigid_object(cfg).unwrap();
    assert_eq!(sim.rigid_object(id).center_of_mass(), array![[d, 0.0, 0.0]]);
    // A force at the center of mass for a second: F t / m, and no spin.
    set_wrench(&mut sim, id, [0.0, 3.0, 0.0], [0.0; 3]);
    sim.update(1000);
    let v = sim.rigid_object(id).velocity();
    assert!((v[(0, 1)] - 1.5).abs() < 1e-9 && v.row(0).iter().skip(3).all(|w| w.abs() < 1e-9), "{v}");
    sim.reset(None).unwrap();
    let [x, y] = half_a_turn(&mut sim, id);
    // A step rotates the velocity of the origin after its position: a circle of 0.04 m is off by at most 2 d w h =
    // 1.6e-4 m.
    assert!((x - 2.0 * d).abs() < 4e-4 && y.abs() < 4e-4, "{x} {y}");
    // Control: a cube with its nominal center moves straight on.
    let mut sim = weightless(2);
    let id = sim.add_rigid_object(RigidObjectCfg::default()).unwrap();
    let [x, y] = half_a_turn(&mut sim, id);
    assert!(x.abs() < 1e-9 && y < -0.1, "{x} {y}");

    // Per environment: on both supported MuJoCo versions a nominally centered cube may have its center of mass
    // elsewhere. The origin is then accelerated toward it by w² d; the cube rotates by 2e-3 rad within the step.
    sim.reset(None).unwrap();
    sim.rigid_object_mut(id).set_center_of_mass(&array![[0.03, 0.0, 0.0]], Some(SECOND)).unwrap();
    assert_eq!(sim.rigid_object(id).center_of_mass(), array![[0.0, 0.0, 0.0], [0.03, 0.0, 0.0]]);
    sim.rigid_object_mut(id).write_velocity(&row([0.0, 0.0, 0.0, 0.0, 0.0, w]), None).unwrap();
    let before = sim.rigid_object(id).velocity();
    sim.update(1);
    let gained = (sim.rigid_object(id).velocity() - before) / 1e-3;
    assert!((gained[(1, 0)] - w * w * 0.03).abs() < 1e-3 && gained[(1, 1)].abs() < 1e-3, "{gained}");
    assert!(gained.row(0).iter().all(|a| a.abs() < 1e-9), "{gained}");
}

/// t T / I about each axis, for moments from the configuration and of one environment; the cube's own are 1/600.
#[test]
fn moments() {
    let moments = [0.02, 0.03, 0.04];
    for (axis, moment) in moments.into_iter().enumerate() {
        let mut sim = weightless(3);
        let plain = cube("plain", 0.1, 1.0, [0.0; 3]);
        let configured = RigidObjectCfg { inertia: Some(moments), ..cube("configured", 0.1, 1.0, [5.0; 3]) };
        let [plain, configured] = [plain, configured].map(|cfg| sim.add_rigid_object(cfg).unwrap());
        sim.rigid_object_mut(plain).set_inertia(&row(moments), Some(SECOND)).unwrap();
        assert_eq!(sim.rigid_object(configured).inertia().row(0).to_vec(), moments);
        let mut torque = [0.0; 3];
        torque[axis] = 0.1;
        for id in [plain, configured] {
            let torque = row(torque);
            sim.rigid_object_mut(id).set_external_wrench(&row([0.0; 3]), &torque, WrenchFrame::Link, None).unwrap();
        }
        sim.update(500);
        let [own, set] = [plain, configured].map(|id| sim.rigid_object(id).velocity().column(3 + axis).to_vec());
        let slow = 0.05 / moment;
        for (found, expected) in [(own[0], 0.05 * 600.0), (own[1], slow), (set[0], slow), (set[1], slow)] {
            assert!((found - expected).abs() < 1e-9, "{own:?} {set:?}");
        }
        assert!(own[0] - own[1] > 1.0, "the control");
    }
}

/// MuJoCo's Euler evaluates damping at the end of the step: v' = v / (1 + h c / m), and with b / I for each rotation
/// about a principal axis. Damping is configured, randomized, set, and set during the motion; each environment rotates
/// about another axis of a box.
#[test]
fn damping() {
    let mut sim = weightless(4);
    let sides = [0.1, 0.2, 0.3];
    let cfg = RigidObjectCfg { mass: Some(2.0), linear_damping: 0.5, angular_damping: 0.001, ..Default::default() };
    let id = sim.add_rigid_object(RigidObjectCfg { shape: ObjectShape::Box { size: sides }, ..cfg }).unwrap();
    let stands = sim.add_rigid_object(fixed(object("fixed", ObjectShape::cube(0.1), [9.0, 0.0, 0.0]))).unwrap();
    assert_eq!(sim.rigid_object(stands).damping(), Array2::<f64>::zeros((4, 2)));
    let drawn = Randomization::new().with(Property::LinearDamping, "object", RandomizationOp::Scale([2.0, 4.0])).with(
        Property::AngularDamping,
        "object",
        RandomizationOp::Add([0.01, 0.02]),
    );
    sim.properties_mut().randomize(&drawn, Some(&[EnvId(3)])).unwrap();
    sim.rigid_object_mut(id).set_damping(&array![[3.0, 0.0]], Some(SECOND)).unwrap();
    let damping = sim.rigid_object(id).damping();
    assert_eq!([0, 1, 2].map(|env| damping.row(env).to_vec()), [[0.5, 0.001], [3.0, 0.0], [0.5, 0.001]]);
    assert!((1.0..2.0).contains(&damping[(3, 0)]) && (0.011..0.021).contains(&damping[(3, 1)]), "{damping}");
    assert_eq!(sim.properties().bytes(EnvId(2)).unwrap(), 0);
    assert!(
        sim.properties().of(EnvId(3)).unwrap().get(Property::LinearDamping, "object").unwrap() == [damping[(3, 0)]]
    );

    let spin = |env: usize, k: usize| if k == 3 + (env + 2) % 3 { 4.0 } else { 0.0 };
    let mut expected = Array2::from_shape_fn((4, 6), |(env, k)| if k < 3 { [1.0, -2.0, 3.0][k] } else { spin(env, k) });
    sim.rigid_object_mut(id).write_velocity(&expected, None).unwrap();
    let moments =
        [0, 1, 2].map(|axis| (0..3).filter(|k| *k != axis).map(|k| 2.0 * sides[k] * sides[k] / 12.0).sum::<f64>());
    let mut go_on = |sim: &mut SimulationManager, damping: &Array2<f64>| {
        sim.update(300);
        let found = sim.rigid_object(id).velocity();
        for ((env, k), v) in expected.indexed_iter_mut() {
            let rate: f64 = if k < 3 { damping[(env, 0)] / 2.0 } else { damping[(env, 1)] / moments[k - 3] };
            *v *= (1.0 + 1e-3 * rate).powi(-300);
            assert!((found[(env, k)] - *v).abs() < 1e-9, "{env} {k}: {found} instead of {v}");
            // Close to the continuous law.
            assert!(((1.0 + 1e-3 * rate).powi(-300) - (-0.3 * rate).exp()).abs() < 1e-3);
        }
    };
    go_on(&mut sim, &damping);
    // An addition keeps the damping, and a change acts from the next step on.
    sim.add_rigid_object(object("late", ObjectShape::cube(0.1), [0.0, 9.0, 0.0])).unwrap();
    assert_eq!(sim.rigid_object(id).damping(), damping);
    sim.rigid_object_mut(id).set_damping(&array![[0.0, 0.004]], Some(&[EnvId(0)])).unwrap();
    let later = sim.rigid_object(id).damping();
    assert_eq!((later[(0, 0)], later[(0, 1)], later.row(3)), (0.0, 0.004, damping.row(3)));
    go_on(&mut sim, &later);
    sim.reset(None).unwrap();
    assert_eq!(sim.rigid_object(id).damping(), later);
    sim.properties_mut().reset(None).unwrap();
    assert_eq!(sim.rigid_object(id).damping().row(3), array![0.5, 0.001]);
    let zero = array![[0.0, 0.0]];
    assert_error(sim.rigid_object_mut(stands).set_damping(&zero, None), "NotDynamic { argument: \"set_damping\"", &[]);
    let negative = sim.rigid_object_mut(id).set_damping(&array![[-1.0, 0.0]], None);
    assert_error(negative, "", &["linear_damping", ">= 0"]);
}

/// A force on a block on the ground moves it above mu m g, and not below. A static object also has friction, and its
/// configured mass can be read.
#[test]
fn friction() {
    let cfg = SimulationManagerCfg {
        num_envs: 4,
        friction: [0.0; 3],
        physics_dt: 2e-3,
        ..SimulationManagerCfg::manipulation()
    };
    let mut sim = sim(cfg);
    let block = object("block", ObjectShape::Box { size: [0.4, 0.4, 0.1] }, [0.0, 0.0, 0.05]);
    let cfg = RigidObjectCfg { mass: Some(2.0), friction: Some([0.5, 0.005, 0.0001]), ..block };
    let id = sim.add_rigid_object(cfg).unwrap();
    let rows = array![[0.3, 0.005, 0.0001], [0.6, 0.01, 0.0002]];
    sim.rigid_object_mut(id).set_friction(&rows, Some(&[EnvId(2), EnvId(3)])).unwrap();
    let read = sim.rigid_object(id).friction();
    assert_eq!(read, array![[0.5, 0.005, 0.0001], [0.5, 0.005, 0.0001], [0.3, 0.005, 0.0001], [0.6, 0.01, 0.0002]]);
    // MuJoCo uses all three coefficients.
    let of_geoms = sim.batch().read(3, |env| env.data().model().geom_friction().to_vec());
    assert!(of_geoms.chunks(3).any(|of| of == [0.6, 0.01, 0.0002]), "{of_geoms:?}");
    // 10 % below and above the threshold of 0.5, then 8.83 N: above that of 0.3, below that of 0.6.
    let pull = [0.45, 0.55, 0.45, 0.45].map(|part| part * 2.0 * 9.81);
    // The force acts at the height of the ground, so that the block does not tip: its torque 5 cm above the ground is
    // compensated.
    let force = Array2::from_shape_fn((4, 3), |(e, k)| if k == 0 { pull[e] } else { 0.0 });
    let torque = Array2::from_shape_fn((4, 3), |(e, k)| if k == 1 { -0.05 * pull[e] } else { 0.0 });
    sim.update(200);
    let start = sim.rigid_object(id).pose();
    sim.rigid_object_mut(id).set_external_wrench(&force, &torque, WrenchFrame::World, None).unwrap();
    sim.update(500);
    let moved = sim.rigid_object(id).pose() - start;
    // MuJoCo's friction creeps; a sliding block moves by a t²/2 = (F/m - mu g) t²/2.
    for (env, expected) in [(1, 0.05 * 9.81 / 2.0), (2, 0.15 * 9.81 / 2.0)] {
        assert!((moved[(env, 0)] / expected - 1.0).abs() < 0.05, "{env}: {} {expected}", moved[(env, 0)]);
    }
    assert!(moved[(0, 0)].abs() < 0.01 && moved[(3, 0)].abs() < 0.01, "{moved}");

    let mut sim = empty(2);
    let shelf = sim.add_rigid_object(fixed(cube("shelf", 0.1, 7.0, [0.0; 3]))).unwrap();
    assert_eq!(sim.rigid_object(shelf).mass().to_vec(), [7.0; 2]);
    sim.rigid_object_mut(shelf).set_friction(&array![[0.2, 0.0, 0.0]], Some(SECOND)).unwrap();
    assert_eq!(sim.rigid_object(shelf).friction(), array![[1.0, 0.005, 0.0001], [0.2, 0.0, 0.0]]);
    let refused = sim.rigid_object_mut(shelf).set_mass(&array![1.0], None);
    assert_error(refused, "NotDynamic { argument: \"set_mass\", object: \"shelf\"", &[]);
}

/// On the ground a margin is a gap; between two margins, 2.2.2 uses the larger, 4.x the sum.
#[test]
fn margins() {
    let mut sim = sim(SimulationManagerCfg { physics_dt: 2e-3, ..Default::default() });
    let [low, high] = [("low", 0.12, 0.01), ("high", 0.36, 0.02)].map(|(uid, z, contact_margin)| {
        let cfg = object(uid, ObjectShape::cube(0.2), [0.0, 0.0, z]);
        sim.add_rigid_object(RigidObjectCfg { contact_margin, ..cfg }).unwrap()
    });
    sim.update(1500);
    let z = [low, high].map(|id| sim.rigid_object(id).pose()[(0, 2)]);
    let between = if BUILD_VERSION == SupportedVersion::V2 { 0.02 } else { 0.03 };
    assert!((z[0] - 0.11).abs() < 1e-3 && (z[1] - z[0] - 0.2 - between).abs() < 1e-3, "{z:?}");
}
