//! Bounces: against the closed form, against the recursion of MuJoCo's steps, and between two that both bounce.

use super::{object, weightless};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sim::Cone;

fn ball(uid: &str, x: f64, mass: f64, restitution: Option<f64>) -> RigidObjectCfg {
    let cfg = object(uid, ObjectShape::Sphere { radius: 0.1 }, [x, 0.0, 0.0]);
    RigidObjectCfg { mass: Some(mass), restitution, ..cfg }
}

/// Velocities of the two balls after the one on the left came with 1 m/s.
fn collide(masses: [f64; 2], restitutions: [Option<f64>; 2]) -> [f64; 2] {
    meet(weightless(1), [0, 1].map(|k| ball(["left", "right"][k], 0.0, masses[k], restitutions[k])), 0.3)
}

/// As [`collide`]; the surfaces meet `phase` of a step after one.
fn meet(mut sim: SimulationManager, [left, right]: [RigidObjectCfg; 2], phase: f64) -> [f64; 2] {
    let at = |cfg, x| RigidObjectCfg { init_pose: Pose::translation(x, 0.0, 0.0), ..cfg };
    let left = sim.add_rigid_object(at(left, -0.15 - 1e-3 * phase)).unwrap();
    let right = sim.add_rigid_object(at(right, 0.1)).unwrap();
    sim.rigid_object_mut(left).write_velocity(&array![[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]], None).unwrap();
    sim.update(300);
    [left, right].map(|id| sim.rigid_object(id).get_velocity()[(0, 0)])
}

/// What ten steps in a contact leave of the closed form, over all places in a step where the surfaces may meet: worked out
/// with the recursion below for 400 of them, as [`RigidObjectCfg::restitution`] says it; straight lines between.
const BAND: [[f64; 3]; 6] = [
    [0.14, -0.08, 0.04],
    [0.3, -0.08, 0.04],
    [0.6, -0.042, 0.038],
    [0.8, -0.02, 0.03],
    [0.9, -0.01, 0.022],
    [1.0, -0.003, 0.003],
];

fn is_near(found: f64, wanted: f64) -> bool {
    let next = BAND.iter().position(|row| wanted <= row[0]).unwrap().max(1);
    let ([from, low, high], [to, lower, higher]) = (BAND[next - 1], BAND[next]);
    let part = (wanted - from) / (to - from);
    (low + part * (lower - low)..=high + part * (higher - high)).contains(&(found - wanted))
}

/// Relative velocity after and before is the restitution, whatever the masses; momentum stays.
#[test]
fn two_balls_part_with_their_restitution() {
    for masses in [[1.0, 1.0], [0.2, 5.0]] {
        for wanted in [0.14, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0] {
            // Eleven places in a step where they may meet.
            for k in 0..11 {
                let phase = (f64::from(k) + 0.03) / 11.0;
                let [left, right] = [0, 1].map(|k| ball(["left", "right"][k], 0.0, masses[k], Some(wanted)));
                let [a, b] = meet(weightless(1), [left, right], phase);
                assert!(is_near(b - a, wanted), "{masses:?} {wanted} {phase}: {}", b - a);
                assert!((masses[0] * a + masses[1] * b - masses[0]).abs() < 1e-9);
            }
        }
    }
    // The control: what is good at 0.5 is not at 0.8.
    assert!(is_near(0.45, 0.5) && !is_near(0.75, 0.8) && !is_near(0.99, 1.0));
}

/// MuJoCo's pyramids lean on the friction coefficient: the bounce does not.
#[test]
fn friction_does_not_change_the_bounce() {
    let parted = |cone, mu: f64, wanted| {
        let cfg =
            SimulationManagerCfg { ground: None, physics_dt: 1e-3, gravity: [0.0; 3].into(), ..Default::default() };
        let sim = SimulationManager::new(SimulationManagerCfg { cone, ..cfg }).unwrap();
        let rubs = |uid| RigidObjectCfg { friction: Some([mu, 0.005, 0.0001]), ..ball(uid, 0.0, 1.0, Some(wanted)) };
        let [a, b] = meet(sim, [rubs("left"), rubs("right")], 0.3);
        b - a
    };
    for wanted in [0.2, 0.5, 0.8, 1.0] {
        let expected = parted(Cone::Elliptic, 1.0, wanted);
        for mu in [0.3, 1.0, 2.0] {
            let found = parted(Cone::Pyramidal, mu, wanted);
            // mu² (1 + mu²) / 2 of at most 10, times 1e-4: a thousandth of the force.
            assert!((found - expected).abs() < 2e-3, "{wanted} {mu}: {found} {expected}");
        }
    }
}

/// The less bouncy of two counts; one that has a restitution brings it to one that has none.
#[test]
fn the_combination_of_two_surfaces() {
    let parted = |restitutions| {
        let [a, b] = collide([1.0, 2.0], restitutions);
        b - a
    };
    let (low, high) = (Some(0.3), Some(0.9));
    assert_eq!(parted([low, high]), parted([low, low]));
    assert_eq!(parted([high, low]), parted([low, low]));
    assert!((parted([None, high]) - parted([high, high])).abs() < 1e-5);
    assert!(parted([high, high]) > 0.8 && parted([low, low]) < 0.4);
    // The control: without any, MuJoCo's own contacts.
    assert!(parted([None, None]) < 0.2, "{}", parted([None, None]));
}

/// What MuJoCo's steps make of the spring and damper, by hand: `x'' = max(0, ...)` on the free fall, with explicit forces.
/// `efc_force` of a contact through the centre of mass is that of a single row with A = 1/m.
fn recursion(mut z: f64, stiffness: f64, damping: f64, h: f64, steps: u32) -> (f64, f64) {
    let mut v = 0.0;
    for _ in 0..steps {
        let free = -9.81;
        // a = d (-B v - K x) + (1 - d) free with d = 0.9999, B = damping/d and K = stiffness/d² times the impedance d.
        let held = -damping * v - stiffness * z + 1e-4 * free;
        let a = if z < 0.0 { held.max(free) } else { free };
        v += h * a;
        z += h * v;
    }
    (z, v)
}

/// A ball dropped on the ground, step by step as the recursion says, flies off with its part of the velocity.
#[test]
fn a_dropped_ball_follows_the_law() {
    for wanted in [0.25, 0.5, 0.75, 0.95] {
        let h = 1e-3;
        let cfg = SimulationManagerCfg { physics_dt: h, ..SimulationManagerCfg::manipulation() };
        let mut sim = SimulationManager::new(cfg).unwrap();
        let start = Pose::translation(0.0, 0.0, 0.6004);
        let id =
            sim.add_rigid_object(RigidObjectCfg { init_pose: start, ..ball("ball", 0.0, 0.7, Some(wanted)) }).unwrap();
        // solref of the object, as its model has it.
        let [stiffness, damping] = sim.batch().read(0, |env| {
            let model = env.data().model();
            let geom = (0..model.ngeom()).find(|&g| model.geom_solref()[2 * g] < 0.0).unwrap();
            [-model.geom_solref()[2 * geom], -model.geom_solref()[2 * geom + 1]]
        });
        let [mut down, mut up] = [0.0_f64; 2];
        for step in 1..=600 {
            sim.update(1);
            let (z, v) = recursion(0.5004, stiffness, damping, h, step);
            let (pose, velocity) = (sim.rigid_object(id).get_pose(), sim.rigid_object(id).get_velocity());
            let apart = (pose[(0, 2)] - 0.1 - z).abs().max((velocity[(0, 2)] - v).abs());
            assert!(apart < 1e-4, "{wanted}, step {step}: {} {z}, {} {v}", pose[(0, 2)] - 0.1, velocity[(0, 2)]);
            // The first bounce alone.
            if step < 400 {
                (down, up) = (down.min(velocity[(0, 2)]), up.max(velocity[(0, 2)]));
            }
        }
        // Torricelli, and a contact of 10 ms.
        assert!((down + (2.0 * 9.81 * 0.5004_f64).sqrt()).abs() < 0.02, "{down}");
        assert!(is_near(up / -down, wanted), "{wanted}: {}", up / -down);
    }
}
