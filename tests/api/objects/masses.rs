//! Centre of mass, moments, damping and margins of the configuration, by how objects move.

use super::{empty, object, weightless};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::{TARGET, Target};

const DT: f64 = 1e-3;

/// With the centre of mass at rest and a spin w about z the origin goes round it: after half a turn it is 2 d farther.
fn half_a_turn(sim: &mut SimulationManager, cube: ObjectId, d: f64) -> [f64; 2] {
    let w = 2.0;
    sim.rigid_object_mut(cube).write_velocity(&array![[0.0, -w * d, 0.0, 0.0, 0.0, w]], None).unwrap();
    sim.update((std::f64::consts::PI / w / DT).round() as u32);
    let pose = sim.rigid_object(cube).get_pose();
    let last = sim.num_envs() - 1;
    [pose[(last, 0)], pose[(last, 1)]]
}

#[test]
fn the_centre_of_mass_is_what_turns_nothing() {
    let mut sim = weightless(1);
    let d = 0.04;
    let cfg = RigidObjectCfg { center_of_mass: Some([d, 0.0, 0.0]), mass: Some(2.0), ..Default::default() };
    let cube = sim.add_rigid_object(cfg).unwrap();
    assert_eq!(sim.rigid_object(cube).get_center_of_mass(), array![[d, 0.0, 0.0]]);
    // A force in it for a second: F t / m, and no spin.
    let (force, none) = (array![[0.0, 3.0, 0.0]], array![[0.0; 3]]);
    sim.rigid_object_mut(cube).set_external_wrench(&force, &none, WrenchFrame::World, None).unwrap();
    sim.update(1000);
    let v = sim.rigid_object(cube).get_velocity();
    assert!((v[(0, 1)] - 1.5).abs() < 1e-9 && v.row(0).iter().skip(3).all(|w| w.abs() < 1e-9), "{v}");
    sim.reset(None).unwrap();
    let [x, y] = half_a_turn(&mut sim, cube, d);
    // Steps turn the velocity of the origin after its place: a circle of 0.04 m is off by at most 2 d w h = 1.6e-4 m.
    assert!((x - 2.0 * d).abs() < 4e-4 && y.abs() < 4e-4, "{x} {y}");
    // Control: a cube with its own centre goes straight on.
    let mut sim = weightless(1);
    let cube = sim.add_rigid_object(RigidObjectCfg::default()).unwrap();
    let [x, y] = half_a_turn(&mut sim, cube, d);
    assert!(x.abs() < 1e-9 && y < -0.1, "{x} {y}");
}

/// t T / I about each axis, of the moments of the configuration.
#[test]
fn moments_are_those_of_the_configuration() {
    let moments = [0.02, 0.03, 0.04];
    for (axis, moment) in moments.into_iter().enumerate() {
        let mut sim = weightless(1);
        let cfg = RigidObjectCfg { inertia: Some(moments), mass: Some(1.0), ..Default::default() };
        let cube = sim.add_rigid_object(cfg).unwrap();
        let mut torque = array![[0.0; 3]];
        torque[(0, axis)] = 0.1;
        sim.rigid_object_mut(cube).set_external_wrench(&array![[0.0; 3]], &torque, WrenchFrame::Link, None).unwrap();
        sim.update(500);
        let w = sim.rigid_object(cube).get_velocity();
        assert!((w[(0, 3 + axis)] - 0.05 / moment).abs() < 1e-9, "{w}");
        assert_eq!(sim.rigid_object(cube).get_inertia(), array![[0.02, 0.03, 0.04]]);
        // Control: the cube's own would be 1/600.
        assert!((w[(0, 3 + axis)] - 0.05 * 600.0).abs() > 1.0);
    }
}

/// MuJoCo's Euler takes damping at the end of the step: v' = v / (1 + h c / m), and so for each turn about a principal axis.
#[test]
fn damping_slows_by_its_law() {
    let mut sim = weightless(1);
    let shape = ObjectShape::Box { size: [0.1, 0.2, 0.3] };
    let (c, b) = (1.5, 0.02);
    let cfg = RigidObjectCfg { mass: Some(3.0), linear_damping: c, angular_damping: b, ..object("o", shape, [0.0; 3]) };
    let id = sim.add_rigid_object(cfg).unwrap();
    let moments = [0.04 + 0.09, 0.01 + 0.09, 0.01 + 0.04].map(|s: f64| 3.0 * s / 12.0);
    for (axis, moment) in moments.into_iter().enumerate() {
        sim.reset(None).unwrap();
        let mut v = array![[1.0, -2.0, 3.0, 0.0, 0.0, 0.0]];
        v[(0, 3 + axis)] = 4.0;
        sim.rigid_object_mut(id).write_velocity(&v, None).unwrap();
        sim.update(1000);
        let found = sim.rigid_object(id).get_velocity();
        let (linear, angular) = ((1.0 + DT * c / 3.0).powi(-1000), (1.0 + DT * b / moment).powi(-1000));
        for k in 0..6 {
            let expected = v[(0, k)] * if k < 3 { linear } else { angular };
            assert!((found[(0, k)] - expected).abs() < 1e-9, "{k}: {found} {expected}");
        }
        // Close to the continuous law, and far from none.
        assert!((linear - (-c / 3.0_f64).exp()).abs() < 1e-3 && linear < 0.7);
    }
}

/// A falling body with drag goes at most at m g / c.
#[test]
fn what_falls_with_damping_has_an_end_velocity() {
    let mut sim = empty(1);
    let cfg = RigidObjectCfg { mass: Some(0.5), linear_damping: 2.0, ..Default::default() };
    let id = sim.add_rigid_object(cfg).unwrap();
    sim.update(5000);
    let v = sim.rigid_object(id).get_velocity()[(0, 2)];
    // e^(-20) of it is missing.
    assert!((v + 0.5 * 9.81 / 2.0).abs() < 1e-7, "{v}");
}

/// A ball that is heavy below stands up again; an even one does not.
#[test]
fn a_tumbler_stands_up() {
    let turned = |center_of_mass| {
        let cfg = SimulationManagerCfg { physics_dt: 2e-3, ..Default::default() };
        let mut sim = SimulationManager::new(cfg).unwrap();
        let ball = object("ball", ObjectShape::Sphere { radius: 0.1 }, [0.0, 0.0, 0.1]);
        let id = sim.add_rigid_object(RigidObjectCfg { center_of_mass, angular_damping: 0.02, ..ball }).unwrap();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        sim.rigid_object_mut(id).write_pose(&array![[0.0, 0.0, 0.1, half, half, 0.0, 0.0]], None).unwrap();
        sim.update(10_000);
        let q = sim.rigid_object(id).get_pose();
        // The angle from upright to its z axis.
        (1.0 - 2.0 * (q[(0, 4)].powi(2) + q[(0, 5)].powi(2))).acos()
    };
    assert!(turned(Some([0.0, 0.0, -0.06])) < 0.02, "{}", turned(Some([0.0, 0.0, -0.06])));
    assert!((turned(None) - std::f64::consts::FRAC_PI_2).abs() < 0.02, "{}", turned(None));
}

/// On the ground a margin is air; between two, 2.2.2 takes the larger, 4.x the sum.
#[test]
fn margins_keep_apart() {
    let cfg = SimulationManagerCfg { physics_dt: 2e-3, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let ball = |uid, z, contact_margin| RigidObjectCfg {
        contact_margin,
        ..object(uid, ObjectShape::cube(0.2), [0.0, 0.0, z])
    };
    let low = sim.add_rigid_object(ball("low", 0.12, 0.01)).unwrap();
    let high = sim.add_rigid_object(ball("high", 0.36, 0.02)).unwrap();
    sim.update(1500);
    let z = [low, high].map(|id| sim.rigid_object(id).get_pose()[(0, 2)]);
    let between = if TARGET == Target::V2 { 0.02 } else { 0.03 };
    assert!((z[0] - 0.11).abs() < 1e-3, "{z:?}");
    assert!((z[1] - z[0] - 0.2 - between).abs() < 1e-3, "{z:?}");
}
