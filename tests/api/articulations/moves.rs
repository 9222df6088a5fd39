//! How joints move that nothing drives. The cabinet's drawer has the mass m = 2 kg, the damping b = 8 N s/m and the dry
//! friction f = 2 N of its file, so that m v' = F - b v - f sign v has closed forms. Euler's steps of 1 ms are off by about
//! h b / 2m = 0.2 % of a distance, and MuJoCo's dry friction gives way a little before it slips: 1 % of tolerance.

use super::*;
use kinetoscope::ndarray::array;

const MASS: f64 = 2.0;
const DAMPING: f64 = 8.0;
const FRICTION: f64 = 2.0;

fn near(found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < 0.01, "{found} is not {expected}");
}

/// How far it slides from a speed until it stands.
fn slides(speed: f64, friction: f64) -> f64 {
    heavy_slides(MASS, speed, friction)
}

/// The same of another inertia.
fn heavy_slides(mass: f64, speed: f64, friction: f64) -> f64 {
    let rest = friction / DAMPING;
    let time = mass / DAMPING * (1.0 + speed / rest).ln();
    mass / DAMPING * speed - rest * time
}

#[test]
fn a_drawer_slides_until_friction_and_damping_stop_it() {
    let mut sim = sim(2);
    let id = sim.add_articulation(cabinet()).unwrap();
    sim.articulation_mut(id).write_qvel(&array![[0.5], [0.3]], None, None).unwrap();
    sim.update(1000);
    let (open, speed) = (sim.articulation(id).get_qpos(), sim.articulation(id).get_qvel());
    near(open[(0, 0)], slides(0.5, FRICTION));
    near(open[(1, 0)], slides(0.3, FRICTION));
    assert!(speed.iter().all(|v| v.abs() < 1e-6), "{speed}");
    assert_eq!(sim.articulation(id).get_qf(), array![[0.0], [0.0]], "no drive gives anything");
    // Control: with another friction it would be elsewhere.
    assert!((open[(0, 0)] / slides(0.5, 1.5 * FRICTION) - 1.0).abs() > 0.1);
}

#[test]
fn with_a_robots_drive_it_would_not_slide() {
    let mut sim = sim(1);
    let id = sim.add_articulation(ArticulationCfg { drive: Some(DriveCfg::default()), ..cabinet() }).unwrap();
    sim.articulation_mut(id).write_qvel(&array![[0.5]], None, None).unwrap();
    sim.update(1000);
    assert!(sim.articulation(id).get_qpos()[(0, 0)].abs() < 1e-3, "held at its target");
}

#[test]
fn friction_and_rotor_inertia_of_its_own_leave_it_passive() {
    let (friction, rotor) = (3.0, 2.0);
    // Without a drive, and with one of which they take the place.
    let other = DriveCfg {
        drive_type: DriveType::None,
        friction: Some(50.0.into()),
        armature: 70.0.into(),
        ..Default::default()
    };
    for drive in [None, Some(other)] {
        let mut sim = sim(1);
        let own = ArticulationCfg {
            friction: Some(friction.into()),
            armature: Some([("drawer_.*", rotor)].into()),
            drive,
            ..cabinet()
        };
        let id = sim.add_articulation(own).unwrap();
        assert_eq!(sim.articulation(id).get_friction(), array![[friction]]);
        near(sim.articulation(id).get_armature()[(0, 0)], rotor);
        sim.articulation_mut(id).write_qvel(&array![[0.5]], None, None).unwrap();
        sim.update(1000);
        near(sim.articulation(id).get_qpos()[(0, 0)], heavy_slides(MASS + rotor, 0.5, friction));
        assert_eq!(sim.articulation(id).get_qf(), array![[0.0]], "no drive gives anything");
    }
    // Control: the file's friction and no rotor take it elsewhere.
    assert!((slides(0.5, FRICTION) / heavy_slides(MASS + rotor, 0.5, friction) - 1.0).abs() > 0.1);
}

#[test]
fn a_push_opens_it_where_it_exceeds_the_friction() {
    let mut sim = sim(2);
    let id = sim.add_articulation(cabinet()).unwrap();
    sim.articulation_mut(id).set_qf(&array![[6.0], [1.5]], None, None).unwrap();
    sim.update(500);
    let open = sim.articulation(id).get_qpos();
    // v' = (F - f)/m - b/m v from rest.
    let (speed, time) = ((6.0 - FRICTION) / DAMPING, MASS / DAMPING);
    near(open[(0, 0)], speed * (0.5 - time * (1.0 - (-0.5 / time).exp())));
    // Dry friction is a soft constraint: below it there is a creep of less than a millimetre per second.
    assert!(open[(1, 0)].abs() < 1e-3, "{open}");
    sim.update(1500);
    let open = sim.articulation(id).get_qpos();
    assert!((open[(0, 0)] - 0.3).abs() < 2e-3, "open to its stop: {open}");
}

#[test]
fn targets_do_nothing_without_a_drive_and_states_are_what_is_written() {
    let mut sim = sim(2);
    let id = sim.add_articulation(ArticulationCfg { init_qpos: vec![("drawer_.*".into(), 0.1)], ..cabinet() }).unwrap();
    sim.articulation_mut(id).set_qpos(&array![[0.25], [0.25]], None, None).unwrap();
    sim.update(100);
    assert_eq!(sim.articulation(id).get_qpos(), array![[0.1], [0.1]], "nothing has moved");
    sim.articulation_mut(id).write_qpos(&array![[0.2]], None, Some(&[EnvId(1)])).unwrap();
    assert_eq!(sim.articulation(id).get_qpos(), array![[0.1], [0.2]]);
    let drawer = sim.articulation(id).link_pose("drawer").unwrap();
    assert!((drawer[(0, 0)] - 0.3).abs() < 1e-15 && (drawer[(1, 0)] - 0.4).abs() < 1e-15, "{drawer}");
    sim.reset(None).unwrap();
    assert_eq!(sim.articulation(id).get_qpos(), array![[0.1], [0.1]]);
}

#[test]
fn a_door_closes_by_a_spring() {
    let (_files, door) = of_text("door", DOOR);
    let drive = DriveCfg { stiffness: 5.0.into(), damping: 8.0.into(), ..Default::default() };
    let mut sim = sim(2);
    let id = sim.add_articulation(ArticulationCfg { drive: Some(drive), ..door }).unwrap();
    sim.articulation_mut(id).write_qpos(&array![[1.0], [1.0]], None, None).unwrap();
    sim.articulation_mut(id).set_qpos(&array![[0.0], [0.0]], None, None).unwrap();
    // Somebody leans against the second one with 2.5 N m: 0.5 rad.
    sim.articulation_mut(id).set_qf(&array![[0.0], [2.5]], None, None).unwrap();
    sim.update(20_000);
    let angle = sim.articulation(id).get_qpos();
    assert!(angle[(0, 0)].abs() < 1e-3 && (angle[(1, 0)] - 0.5).abs() < 1e-3, "{angle}");
}

#[test]
fn dry_friction_differs_between_environments() {
    let mut sim = sim(2);
    let id = sim.add_articulation(cabinet()).unwrap();
    let sticky = Randomization::new().with(Property::DryFriction, "cabinet/drawer_slide", Draw::Set([6.0, 6.0]));
    sim.randomize(&sticky, Some(&[EnvId(1)])).unwrap();
    sim.articulation_mut(id).write_qvel(&array![[0.5], [0.5]], None, None).unwrap();
    sim.update(1000);
    let open = sim.articulation(id).get_qpos();
    near(open[(0, 0)], slides(0.5, FRICTION));
    near(open[(1, 0)], slides(0.5, 6.0));
}
