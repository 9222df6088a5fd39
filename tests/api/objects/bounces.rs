//! Bounces compared with the closed form; collision exclusions.

use super::*;
use kinetoscope::sim::{FrictionCone, RigidObjectId};
use kinetoscope_testkit::error_tables::assert_error;

fn bouncing_ball(uid: &str, mass: f64, restitution: Option<f64>) -> RigidObjectCfg {
    RigidObjectCfg { restitution, ..ball(uid, 0.1, mass, [0.0; 3]) }
}

/// Velocities of two balls after a collision of the left one with 1 m/s; the surfaces meet at the fraction `phase` of a
/// step.
fn collide(mut sim: SimulationManager, [left, right]: [RigidObjectCfg; 2], phase: f64) -> [f64; 2] {
    let at = |cfg, x| RigidObjectCfg { init_pose: Pose::translation(x, 0.0, 0.0), ..cfg };
    let left = sim.add_rigid_object(at(left, -0.15 - 1e-3 * phase)).unwrap();
    let right = sim.add_rigid_object(at(right, 0.1)).unwrap();
    sim.rigid_object_mut(left).write_velocity(&row([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), None).unwrap();
    sim.update(300);
    [left, right].map(|id| sim.rigid_object(id).velocity()[(0, 0)])
}

/// Error band of the restitution due to a contact of ten steps: restitution, lower and upper error. The band covers all
/// fractions of a step at which the surfaces may meet, computed for 400 of them with the recursion of
/// `tests/physics/bounce.rs`, as documented at [`RigidObjectCfg::restitution`]; linear in between.
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

/// The ratio of relative velocities is the restitution for any masses; momentum is conserved. Eleven fractions of a
/// step at which the balls may meet.
#[test]
fn two_balls() {
    for masses in [[1.0, 1.0], [0.2, 5.0]] {
        for wanted in [0.14, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0] {
            for phase in (0..11).map(|k| (f64::from(k) + 0.03) / 11.0) {
                let balls =
                    [("left", masses[0]), ("right", masses[1])].map(|(uid, m)| bouncing_ball(uid, m, Some(wanted)));
                let [a, b] = collide(weightless(1), balls, phase);
                assert!(is_near(b - a, wanted), "{masses:?} {wanted} {phase}: {}", b - a);
                assert!((masses[0] * a + masses[1] * b - masses[0]).abs() < 1e-9);
            }
        }
    }
    // Control: an error accepted at 0.5 is not accepted at 0.8.
    assert!(is_near(0.45, 0.5) && !is_near(0.75, 0.8) && !is_near(0.99, 1.0));
}

/// MuJoCo's friction pyramids depend on the friction coefficient; the bounce does not. mu² (1 + mu²) / 2 of at most 10,
/// times 1e-4: a thousandth of the force.
#[test]
fn friction() {
    let relative_velocity = |cone, mu: f64, wanted| {
        let sim = sim(SimulationManagerCfg { cone, physics_dt: 1e-3, ..weightless_cfg(1) });
        let rubs =
            |uid| RigidObjectCfg { friction: Some([mu, 0.005, 0.0001]), ..bouncing_ball(uid, 1.0, Some(wanted)) };
        let [a, b] = collide(sim, [rubs("left"), rubs("right")], 0.3);
        b - a
    };
    for wanted in [0.2, 0.5, 0.8, 1.0] {
        let expected = relative_velocity(FrictionCone::Elliptic, 1.0, wanted);
        for mu in [0.3, 1.0, 2.0] {
            let found = relative_velocity(FrictionCone::Pyramidal, mu, wanted);
            assert!((found - expected).abs() < 2e-3, "{wanted} {mu}: {found} {expected}");
        }
    }
}

/// The smaller of two restitutions counts; an object with a restitution applies it to an object without one.
#[test]
fn combinations() {
    let parted = |[left, right]: [Option<f64>; 2]| {
        let [a, b] =
            collide(weightless(1), [bouncing_ball("left", 1.0, left), bouncing_ball("right", 2.0, right)], 0.3);
        b - a
    };
    let (low, high) = (Some(0.3), Some(0.9));
    assert_eq!(parted([low, high]), parted([low, low]));
    assert_eq!(parted([high, low]), parted([low, low]));
    assert!((parted([None, high]) - parted([high, high])).abs() < 1e-5);
    assert!(parted([high, high]) > 0.8 && parted([low, low]) < 0.4);
    // Control: without any restitution, MuJoCo's own contacts.
    assert!(parted([None, None]) < 0.2, "{}", parted([None, None]));
}

/// A ball above a block on the ground.
fn stack() -> (SimulationManager, [RigidObjectId; 2]) {
    let mut sim = sim(SimulationManagerCfg { num_envs: 2, physics_dt: 2e-3, ..Default::default() });
    let block = sim.add_rigid_object(object("block", ObjectShape::cube(0.4), [0.0, 0.0, 0.2])).unwrap();
    let ball = sim.add_rigid_object(object("ball", ObjectShape::Sphere { radius: 0.1 }, [0.0, 0.0, 0.52])).unwrap();
    (sim, [block, ball])
}

fn contacts(sim: &SimulationManager) -> usize {
    sim.batch().read(1, |env| env.data().contact().len())
}

/// Excluded objects pass through each other, or through the world, from the call on.
#[test]
fn excluded_objects() {
    let stand = |sim: &mut SimulationManager, ids: [RigidObjectId; 2], expected: [f64; 2]| {
        sim.update(500);
        let z = ids.map(|id| sim.rigid_object(id).pose()[(1, 2)]);
        let lies = |k: usize| (z[k] - expected[k]).abs() < 1e-3 || expected[k] == f64::NEG_INFINITY && z[k] < -4.0;
        assert!(lies(0) && lies(1), "{z:?}");
    };
    let (mut sim, ids) = stack();
    for (one, other) in [("bal", "block"), ("block", "bal"), ("ground", "bal")] {
        assert_error(sim.exclude_collision(one, other), "UnknownName { what: \"body\"", &["\"ball\""]);
    }
    for name in ["ball", "world"] {
        assert_error(sim.exclude_collision(name, name), "Config { field: \"exclude_collision\"", &[]);
    }
    stand(&mut sim, ids, [0.2, 0.5]);
    assert!(contacts(&sim) > 0, "the control");
    sim.exclude_collision("block", "world").unwrap();
    stand(&mut sim, ids, [f64::NEG_INFINITY, 0.1]);
    let (mut sim, ids) = stack();
    sim.exclude_collision("ball", "block").unwrap();
    let model = sim.batch().model().clone();
    sim.exclude_collision("block", "ball").unwrap();
    assert!(sim.batch().model().ptr_eq(&model), "cached: nothing is compiled");
    stand(&mut sim, ids, [0.2, 0.1]);
}

/// The name of a robot stands for all of its links; pairs of its own links must be given explicitly.
#[test]
fn excluded_links() {
    let build = |name: Option<&str>| {
        let mut sim = sim(weightless_cfg(2));
        let arm = sim.add_robot(kinetoscope_testkit::worlds::sr5("arm")).unwrap();
        let tip = sim.robot(arm).link_names().last().unwrap().to_string();
        let place = sim.robot(arm).link_pose(&tip).unwrap();
        sim.add_rigid_object(object("fog", ObjectShape::cube(0.1), [0, 1, 2].map(|k| place[(1, k)]))).unwrap();
        if let Some(name) = name {
            sim.exclude_collision(name, "fog").unwrap();
        }
        (contacts(&sim), tip)
    };
    let (found, tip) = build(None);
    assert!(found > 0, "the control");
    assert_eq!(build(Some("arm")).0, 0);
    // Excluding one link of several in contact leaves fewer contacts than before.
    assert!(build(Some(&format!("arm/{tip}"))).0 < found);
}
