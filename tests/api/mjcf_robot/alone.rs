//! Names, masses, limits, forces and motion of a robot are those of MuJoCo with the file alone.

use super::{ODD, ODD_JOINTS, empty, passive, random_qpos, robot};
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::Random;
use kinetoscope::sim::mj::{self, Data, Model};

/// The file alone, with the options of the scene.
fn alone(text: &str) -> Model {
    let text = text.replace("<worldbody>", r#"<option timestep="0.002"/><worldbody>"#);
    mj::compile(&text, &[]).unwrap().into_model()
}

#[test]
fn names_masses_and_limits_are_those_of_the_file() {
    let mut sim = empty(1);
    let id = sim.add_robot(robot("odd", ODD)).unwrap();
    let (robot, model) = (sim.robot(id), alone(ODD));
    assert_eq!((robot.dof(), robot.joint_names()), (7, &ODD_JOINTS.map(String::from)[..]));
    let links = ["base", "shoulder", "fore", "carriage", "plate", "hand", "shoulder_site", "tip"];
    assert_eq!(robot.link_names(), links, "bodies, then named sites");
    let mass: f64 = model.body_mass().iter().sum();
    assert!((robot.total_mass() - mass).abs() < 1e-14 * mass && (mass - 7.2).abs() < 1e-12);
    let limits = robot.qpos_limits();
    for joint in 0..7 {
        for end in 0..2 {
            assert_eq!(limits[(0, joint, end)], model.jnt_range()[2 * joint + end], "{joint}");
        }
    }
    assert!((limits[(0, 0, 1)] - 150f64.to_radians()).abs() < 1e-15 && limits[(0, 3, 1)] == 0.15);
    // Where the file starts.
    let start = robot.get_default_qpos();
    assert_eq!(start.as_slice().unwrap(), model.qpos0());
    assert!((start[(0, 0)] - 20f64.to_radians()).abs() < 1e-15);
    assert_eq!(robot.get_armature().as_slice().unwrap(), model.dof_armature());
    assert_eq!(robot.get_joint_damping()[(0, 2)], 0.2);
    assert_eq!(robot.get_qpos(), start);
}

/// Gravity, centrifugal and Coriolis forces at random states: both are MuJoCo's, on numbers that were written and read
/// once; forces are of 10 N m, so 1e-12 is a few hundred roundings.
#[test]
fn bias_forces_and_the_mass_matrix_are_those_of_the_file_alone() {
    let mut sim = empty(1);
    let id = sim.add_robot(passive("odd", ODD)).unwrap();
    let rows = random_qpos(&sim, id, 50);
    let mut data = Data::new(&alone(ODD)).unwrap();
    let mut random = Random::keyed(3, 0, "velocities");
    let mut largest = 0.0f64;
    for qpos in rows.axis_iter(Axis(0)) {
        let qvel = Array2::from_shape_fn((1, 7), |_| 4.0 * random.uniform() - 2.0);
        let row = qpos.insert_axis(Axis(0)).to_owned();
        sim.robot_mut(id).write_qpos(&row, None, None).unwrap();
        sim.robot_mut(id).write_qvel(&qvel, None, None).unwrap();
        data.qpos_mut().copy_from_slice(row.as_slice().unwrap());
        data.qvel_mut().copy_from_slice(qvel.as_slice().unwrap());
        data.forward().unwrap();
        sim.batch().read(0, |env| {
            for (ours, theirs) in env.data().qfrc_bias().iter().zip(data.qfrc_bias()) {
                assert!((ours - theirs).abs() < 1e-12, "{ours} {theirs}");
                largest = largest.max(theirs.abs());
            }
            // But for what is integrated with the drives: h B of the elbow.
            let (mut ours, theirs) = (env.data().mass_matrix().unwrap(), data.mass_matrix().unwrap());
            ours[2 * 7 + 2] -= 0.002 * 0.2;
            for (ours, theirs) in ours.iter().zip(&theirs) {
                assert!((ours - theirs).abs() < 1e-12, "{ours} {theirs}");
            }
        });
    }
    assert!(largest > 10.0, "{largest}");
}

/// Falling and swinging without drives, inside of all limits. Damping moves into the solve, which is the same where nothing
/// else is solved: `(M + h B) a = f - B v` both here and in MuJoCo's implicit damping. 0.1 s are too short for chaos: 1e-9 is
/// far above what rounding grows to.
#[test]
fn a_passive_robot_falls_as_the_file_alone() {
    let mut sim = empty(1);
    let id = sim.add_robot(passive("odd", ODD)).unwrap();
    let mut data = Data::new(&alone(ODD)).unwrap();
    let speeds = [0.3, -0.2, 0.5, 0.05, 1.0, -0.4, 0.7];
    sim.robot_mut(id).write_qvel(&Array2::from_shape_vec((1, 7), speeds.to_vec()).unwrap(), None, None).unwrap();
    data.qvel_mut().copy_from_slice(&speeds);
    sim.update(50);
    for _ in 0..50 {
        data.step().unwrap();
    }
    let moved: f64 = data.qpos().iter().zip(data.model().qpos0()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved > 0.05, "{moved}");
    for (ours, theirs) in sim.robot(id).get_qpos().iter().zip(data.qpos()) {
        assert!((ours - theirs).abs() < 1e-9, "{ours} {theirs}");
    }
    // The control: without the spring it falls elsewhere.
    let mut other = empty(1);
    let without = other.add_robot(passive("odd", &ODD.replace(r#"stiffness="1.5""#, ""))).unwrap();
    let row = Array2::from_shape_vec((1, 7), speeds.to_vec()).unwrap();
    other.robot_mut(without).write_qvel(&row, None, None).unwrap();
    other.update(50);
    assert!((other.robot(without).get_qpos()[(0, 2)] - data.qpos()[2]).abs() > 1e-4);
}

/// Payloads come on top of what the file says.
#[test]
fn payloads_are_points_in_the_centre_of_mass() {
    let mut sim = empty(1);
    let cfg = RobotCfg { payload: vec![("fore".into(), 0.5), ("tip".into(), 0.25)], ..passive("odd", ODD) };
    let id = sim.add_robot(cfg).unwrap();
    let (model, loaded) = (alone(ODD), sim.batch().model().clone());
    let body = |name: &str| loaded.id(mj::ObjectKind::Body, &format!("odd/{name}")).unwrap();
    let of_file = |name: &str| model.id(mj::ObjectKind::Body, name).unwrap();
    for (name, payload) in [("fore", 0.5), ("hand", 0.25), ("base", 0.0)] {
        let (here, there) = (loaded.body_mass()[body(name)], model.body_mass()[of_file(name)]);
        assert!((here - there - payload).abs() < 1e-15, "{name}: {here} {there}");
    }
    assert!((sim.robot(id).total_mass() - 7.2 - 0.75).abs() < 1e-12);
    // The centre of mass of the fore-arm stays; that of the hand goes to (0.3 c + 0.25 s) / 0.55 with the site s.
    let com = |model: &Model, body: usize| [0, 1, 2].map(|k| model.body_ipos()[3 * body + k]);
    let (fore, hand) = (com(&loaded, body("fore")), com(&loaded, body("hand")));
    let of_fore = com(&model, of_file("fore"));
    assert!((0..3).all(|k| (fore[k] - of_fore[k]).abs() < 1e-12));
    let expected = [(0.3 * 0.05 + 0.25 * 0.1) / 0.55, 0.0, 0.25 * 0.01 / 0.55];
    assert!((0..3).all(|k| (hand[k] - expected[k]).abs() < 1e-12), "{hand:?} {expected:?}");
}
