//! Motion of undriven joints. The cabinet's drawer has the mass m = 2 kg, the damping b = 8 N s/m and the dry friction
//! f = 2 N of its file, so that m v' = F - b v - f sign v has closed forms. Euler's steps of 1 ms are off by about h b
//! / 2m = 0.2 % of a distance, and MuJoCo's dry friction yields slightly before it slips: 1 % of tolerance.

use super::*;
use kinetoscope::ndarray::array;
use kinetoscope_testkit::tolerance::{Tolerance, assert_number};
use kinetoscope_testkit::worlds::no_drive;

const MASS: f64 = 2.0;
const DAMPING: f64 = 8.0;
const FRICTION: f64 = 2.0;
const SOFT: Tolerance = Tolerance::relative(
    0.01,
    "Euler's h b / 2m = 0.2 % of a distance, and dry friction that gives way before it slips",
);

/// Stopping distance of a mass with an initial speed.
fn stopping_distance(mass: f64, speed: f64, friction: f64) -> f64 {
    let rest = friction / DAMPING;
    mass / DAMPING * speed - rest * mass / DAMPING * (1.0 + speed / rest).ln()
}

/// The drawer with the values of its file; with its own friction and rotor inertia, without a drive and with a drive
/// whose values they override; and with a robot's drive, which holds it at its target.
#[test]
fn sliding_drawer() {
    let (mut sim, id) = with(2, cabinet());
    sim.articulation_mut(id).write_qvel(&array![[0.5], [0.3]], None, None).unwrap();
    sim.update(1000);
    let (open, speed) = (sim.articulation(id).qpos(), sim.articulation(id).qvel());
    assert_number("way", open[(0, 0)], stopping_distance(MASS, 0.5, FRICTION), SOFT);
    assert_number("way", open[(1, 0)], stopping_distance(MASS, 0.3, FRICTION), SOFT);
    assert!(speed.iter().all(|v| v.abs() < 1e-6), "{speed}");
    assert_eq!(sim.articulation(id).qf(), array![[0.0], [0.0]], "no drive gives anything");
    // Controls: other values give clearly different positions.
    let (friction, rotor) = (3.0, 2.0);
    assert!((open[(0, 0)] / stopping_distance(MASS, 0.5, 1.5 * FRICTION) - 1.0).abs() > 0.1);
    assert!((open[(0, 0)] / stopping_distance(MASS + rotor, 0.5, friction) - 1.0).abs() > 0.1);

    let other = DriveCfg { friction: Some(50.0.into()), armature: 70.0.into(), ..no_drive() };
    for drive in [None, Some(other)] {
        let armature = Some([("drawer_.*", rotor)].into());
        let (mut sim, id) = with(1, ArticulationCfg { friction: Some(friction.into()), armature, drive, ..cabinet() });
        assert_eq!(sim.articulation(id).friction(), array![[friction]]);
        assert_number("rotor inertia", sim.articulation(id).armature()[(0, 0)], rotor, SOFT);
        sim.articulation_mut(id).write_qvel(&array![[0.5]], None, None).unwrap();
        sim.update(1000);
        assert_number("way", sim.articulation(id).qpos()[(0, 0)], stopping_distance(MASS + rotor, 0.5, friction), SOFT);
        assert_eq!(sim.articulation(id).qf(), array![[0.0]], "no drive gives anything");
    }
    let (mut sim, id) = with(1, ArticulationCfg { drive: Some(DriveCfg::default()), ..cabinet() });
    sim.articulation_mut(id).write_qvel(&array![[0.5]], None, None).unwrap();
    sim.update(1000);
    assert!(sim.articulation(id).qpos()[(0, 0)].abs() < 1e-3, "held at its target");
}

/// A force opens the drawer if it exceeds the friction, including a friction randomized per environment.
#[test]
fn pushed_drawer() {
    let (mut sim, id) = with(2, cabinet());
    sim.articulation_mut(id).set_qf_target(&array![[6.0], [1.5]], None, None).unwrap();
    sim.update(500);
    let open = sim.articulation(id).qpos();
    // v' = (F - f)/m - b/m v from rest.
    let (speed, time) = ((6.0 - FRICTION) / DAMPING, MASS / DAMPING);
    assert_number("way", open[(0, 0)], speed * (0.5 - time * (1.0 - (-0.5 / time).exp())), SOFT);
    // Dry friction is a soft constraint: below it the joint creeps by less than a millimeter per second.
    assert!(open[(1, 0)].abs() < 1e-3, "{open}");
    sim.update(1500);
    let open = sim.articulation(id).qpos();
    assert!((open[(0, 0)] - 0.3).abs() < 2e-3, "open to its stop: {open}");

    let (mut sim, id) = with(2, cabinet());
    let sticky =
        Randomization::new().with(Property::DryFriction, "cabinet/drawer_slide", RandomizationOp::Set([6.0, 6.0]));
    sim.properties_mut().randomize(&sticky, Some(&[EnvId(1)])).unwrap();
    sim.articulation_mut(id).write_qvel(&array![[0.5], [0.5]], None, None).unwrap();
    sim.update(1000);
    let open = sim.articulation(id).qpos();
    assert_number("way", open[(0, 0)], stopping_distance(MASS, 0.5, FRICTION), SOFT);
    assert_number("way", open[(1, 0)], stopping_distance(MASS, 0.5, 6.0), SOFT);
}

/// Without a drive targets have no effect, and states are as written.
#[test]
fn targets_and_states() {
    let (mut sim, id) = with(2, ArticulationCfg { init_qpos: vec![("drawer_.*".into(), 0.1)], ..cabinet() });
    sim.articulation_mut(id).set_qpos_target(&array![[0.25], [0.25]], None, None).unwrap();
    sim.update(100);
    assert_eq!(sim.articulation(id).qpos(), array![[0.1], [0.1]], "nothing has moved");
    sim.articulation_mut(id).write_qpos(&array![[0.2]], None, Some(&[EnvId(1)])).unwrap();
    assert_eq!(sim.articulation(id).qpos(), array![[0.1], [0.2]]);
    let drawer = sim.articulation(id).link_pose("drawer").unwrap();
    assert!((drawer[(0, 0)] - 0.3).abs() < 1e-15 && (drawer[(1, 0)] - 0.4).abs() < 1e-15, "{drawer}");
    sim.reset(None).unwrap();
    assert_eq!(sim.articulation(id).qpos(), array![[0.1], [0.1]]);
}

/// A spring closes a door, up to 0.5 rad against a torque of 2.5 N m.
#[test]
fn sprung_door() {
    let files = TempFiles::default();
    let (mut sim, id) =
        with(2, ArticulationCfg { drive: Some(kinetoscope_testkit::worlds::gains(5.0, 8.0)), ..door(&files) });
    sim.articulation_mut(id).write_qpos(&array![[1.0], [1.0]], None, None).unwrap();
    sim.articulation_mut(id).set_qpos_target(&array![[0.0], [0.0]], None, None).unwrap();
    sim.articulation_mut(id).set_qf_target(&array![[0.0], [2.5]], None, None).unwrap();
    sim.update(20_000);
    let angle = sim.articulation(id).qpos();
    assert!(angle[(0, 0)].abs() < 1e-3 && (angle[(1, 0)] - 0.5).abs() < 1e-3, "{angle}");
}
