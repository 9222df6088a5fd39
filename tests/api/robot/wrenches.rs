//! Forces on links and gravity compensation, against Newton's laws.
//!
//! MuJoCo's Euler step is v' = v + h F / m. Tolerance 1e-9: rounding of 1e-16 a step, over at most 200 steps, and of the
//! solve of two bodies that differ by a factor of 100 in their inertia.

use kinetoscope::ndarray::{Array2, Array3, array};
use kinetoscope::prelude::*;
use nalgebra::Vector3;

const EXACT: f64 = 1e-9;
const H: f64 = 0.01;
const G: f64 = 9.81;
const ENVS: usize = 3;

fn inertial(mass: f64, at: &str, moment: f64) -> String {
    format!(
        "<inertial><origin xyz=\"{at}\"/><mass value=\"{mass}\"/><inertia ixx=\"{moment}\" ixy=\"0\" ixz=\"0\" \
         iyy=\"{moment}\" iyz=\"0\" izz=\"{moment}\"/></inertial>"
    )
}

fn sim_of(urdf: &str, gravity: f64, fix_base: bool, drive: DriveCfg) -> (SimulationManager, RobotId) {
    let files = tempfile::tempdir().unwrap();
    let path = files.path().join("robot.urdf");
    std::fs::write(&path, format!("<robot name=\"r\">{urdf}</robot>")).unwrap();
    let gravity = [0.0, 0.0, -gravity].into();
    let cfg = SimulationManagerCfg { num_envs: ENVS, ground: None, gravity, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let robot = RobotCfg { urdf: UrdfCfg::single(path), fix_base, drive, ..Default::default() };
    let id = sim.add_robot(robot).unwrap();
    (sim, id)
}

fn passive() -> DriveCfg {
    DriveCfg { drive_type: DriveType::None, ..Default::default() }
}

/// A free ball of 2 kg, a second one of 2 kg in its middle that turns about z by a passive hinge, and a grip of no mass
/// that is fixed to the first, turned by a quarter about z.
fn balls(gravity: f64) -> (SimulationManager, RobotId) {
    let ball = inertial(2.0, "0 0 0", 0.02);
    let urdf = format!(
        "<link name=\"outer\">{ball}</link><link name=\"inner\">{ball}</link><link name=\"grip\"/>\
         <joint name=\"spin\" type=\"continuous\"><parent link=\"outer\"/><child link=\"inner\"/><axis xyz=\"0 0 1\"/></joint>\
         <joint name=\"mount\" type=\"fixed\"><parent link=\"outer\"/><child link=\"grip\"/>\
         <origin xyz=\"0.3 0 0\" rpy=\"0 0 1.5707963267948966\"/></joint>"
    );
    sim_of(&urdf, gravity, false, passive())
}

fn links(sim: &SimulationManager, id: RobotId, names: &[&str]) -> Vec<LinkId> {
    sim.robot(id).find_links(names).unwrap()
}

#[track_caller]
fn assert_near(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let off = found.iter().zip(expected).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
    assert!(off <= EXACT, "{what}: {found:?}, expected {expected:?}: off by {off:.1e}");
}

/// 4 kg in all: a = F / 4 until the force changes; a torque turns the inner ball alone, alpha = tau / I.
#[test]
fn a_force_accelerates_until_it_is_changed() {
    let (mut sim, id) = balls(0.0);
    let [outer, inner] = links(&sim, id, &["outer", "inner"])[..] else { unreachable!() };
    let zero = Array3::zeros((1, 1, 3));
    let push = array![[[6.0, -2.0, 1.0]], [[0.0, 0.0, 8.0]]];
    let chosen = [EnvId(2), EnvId(0)];
    sim.robot_mut(id).set_external_wrench(&push, &zero, WrenchFrame::World, Some(&[outer]), Some(&chosen)).unwrap();
    let twist = array![[[0.0, 0.0, 0.5]]];
    sim.robot_mut(id).set_external_wrench(&zero, &twist, WrenchFrame::World, Some(&[inner]), Some(&chosen)).unwrap();
    let told = sim.robot(id).get_external_wrenches();
    assert_eq!((told.dim(), told[(2, outer.0, 1)], told[(0, inner.0, 5)]), ((ENVS, 3, 6), -2.0, 0.5));
    assert_eq!(told.iter().filter(|x| **x != 0.0).count(), 6);
    sim.update(20);
    let t = 20.0 * H;
    let check = |sim: &SimulationManager, x: f64, turned: f64| {
        let (v, spin) = (sim.robot(id).get_root_velocity(), sim.robot(id).get_qvel());
        let pushed = [6.0 * x, -2.0 * x, x, 0.0, 0.0, 0.0];
        assert_near(&v.row(2).to_vec(), &pushed, "environment 2");
        assert_near(&v.row(0).to_vec(), &[0.0, 0.0, 8.0 * x, 0.0, 0.0, 0.0], "environment 0");
        assert_near(&spin.column(0).to_vec(), &[turned, 0.0, turned], "spin");
        assert_eq!(v.row(1).to_vec(), [0.0; 6], "environment 1 was not chosen");
    };
    check(&sim, t / 4.0, t * 0.5 / 0.02);
    // Another link's wrench does not end this one; a new one of the same link does, and zeros are none.
    sim.robot_mut(id).set_external_wrench(&zero, &zero, WrenchFrame::World, Some(&[inner]), None).unwrap();
    sim.update(10);
    check(&sim, 1.5 * t / 4.0, t * 0.5 / 0.02);
    sim.robot_mut(id).set_external_wrench(&zero, &zero, WrenchFrame::World, Some(&[outer]), None).unwrap();
    sim.update(10);
    check(&sim, 1.5 * t / 4.0, t * 0.5 / 0.02);
    assert_eq!(sim.robot(id).get_external_wrenches(), Array3::<f64>::zeros((ENVS, 3, 6)));
}

/// A ball that turns by w about z: after k steps it is turned by w h k, and so is a force in its axes.
#[test]
fn a_force_in_the_axes_of_a_link_turns_with_it() {
    let (mut sim, id) = balls(0.0);
    let [outer, grip] = links(&sim, id, &["outer", "grip"])[..] else { unreachable!() };
    let w = 3.0;
    let mut robot = sim.robot_mut(id);
    robot.write_root_velocity(&array![[0.0, 0.0, 0.0, 0.0, 0.0, w]], None).unwrap();
    let zero = Array3::zeros((1, 1, 3));
    let push = array![[[5.0, 0.0, 0.0]]];
    robot.set_external_wrench(&push, &zero, WrenchFrame::Link, Some(&[outer]), Some(&[EnvId(0)])).unwrap();
    robot.set_external_wrench(&push, &zero, WrenchFrame::Link, Some(&[grip]), Some(&[EnvId(1)])).unwrap();
    robot.set_external_wrench(&push, &zero, WrenchFrame::World, Some(&[grip]), Some(&[EnvId(2)])).unwrap();
    let mut expected = [[0.0_f64; 2]; ENVS];
    for k in 0..200 {
        sim.update(1);
        let angle = w * H * f64::from(k);
        // The grip is a quarter turn ahead; the world does not turn.
        for (v, angle) in expected.iter_mut().zip([angle, angle + std::f64::consts::FRAC_PI_2, 0.0]) {
            v[0] += H * 5.0 / 4.0 * angle.cos();
            v[1] += H * 5.0 / 4.0 * angle.sin();
        }
        let v = sim.robot(id).get_root_velocity();
        for (env, [x, y]) in expected.into_iter().enumerate() {
            // No torque comes of it: the force acts in the centre of mass, wherever the grip is.
            assert_near(&v.row(env).to_vec(), &[x, y, 0.0, 0.0, 0.0, w], &format!("environment {env}, step {k}"));
        }
    }
    let pose = sim.robot(id).link_pose("grip").unwrap();
    let row: [f64; 7] = std::array::from_fn(|k| pose[(1, k)]);
    let in_world = kinetoscope::scene::pose::from_row(&row).rotation * Vector3::new(5.0, 0.0, 0.0);
    let told = sim.robot(id).get_external_wrenches();
    let told: Vec<f64> = (0..3).map(|k| told[(1, grip.0, k)]).collect();
    assert_near(&told, in_world.as_slice(), "what is told is in world axes");
}

/// Two levers on one another under gravity, without drives: compensated, they stay where they are; with one of them
/// compensated, the free fall of the other is MuJoCo's without the first one's mass.
#[test]
fn compensated_links_have_no_weight() {
    let urdf = format!(
        "<link name=\"base\"/><link name=\"a\">{}</link><link name=\"b\">{}</link>\
         <joint name=\"ja\" type=\"continuous\"><parent link=\"base\"/><child link=\"a\"/><axis xyz=\"0 1 0\"/></joint>\
         <joint name=\"jb\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/><origin xyz=\"0.5 0 0\"/>\
         <axis xyz=\"0 1 0\"/></joint>",
        inertial(3.0, "0.25 0 0", 0.05),
        inertial(1.0, "0.2 0 0.1", 0.02)
    );
    let (mut sim, id) = sim_of(&urdf, G, true, passive());
    let [a, b] = links(&sim, id, &["a", "b"])[..] else { unreachable!() };
    let mut robot = sim.robot_mut(id);
    robot.write_qpos(&array![[0.3, -0.8]], None, None).unwrap();
    robot.set_gravity_compensation(true, None, Some(&[EnvId(0)])).unwrap();
    robot.set_gravity_compensation(true, Some(&[a]), Some(&[EnvId(1)])).unwrap();
    let on = sim.robot(id).get_gravity_compensation();
    assert_eq!(on, array![[true, true, true], [false, true, false], [false; 3]]);
    // Forces of gravity on the joints, by virtual work: -m g z of the centres of mass that have weight.
    let height = |q: [f64; 2], weight: [f64; 2]| {
        let [za, zb] = [-(0.25 * q[0].sin()), -(0.5 * q[0].sin())];
        let turn = q[0] + q[1];
        weight[0] * za + weight[1] * (zb - 0.2 * turn.sin() + 0.1 * turn.cos())
    };
    let load = |q: [f64; 2], weight: [f64; 2]| -> [f64; 2] {
        let e = 1e-6;
        [[e, 0.0], [0.0, e]].map(|d| {
            let at = |sign: f64| height([q[0] + sign * d[0], q[1] + sign * d[1]], weight);
            -G * (at(1.0) - at(-1.0)) / (2.0 * e)
        })
    };
    sim.update(1);
    let speeds = sim.robot(id).get_qvel();
    assert_near(&speeds.row(0).to_vec(), &[0.0; 2], "nothing has weight");
    for (env, weight) in [(1, [0.0, 1.0]), (2, [3.0, 1.0])] {
        // From rest M v' = h load, with MuJoCo's own M.
        let mass = sim.batch().read(2, |env| env.data().mass_matrix().unwrap());
        let v = speeds.row(env);
        let momentum = [mass[0] * v[0] + mass[1] * v[1], mass[2] * v[0] + mass[3] * v[1]];
        let expected = load([0.3, -0.8], weight).map(|tau| H * tau);
        for k in 0..2 {
            // M is that after the step, 1e-2 rad further; the difference quotient is good to 1e-9.
            assert!((momentum[k] - expected[k]).abs() < 0.01 * expected[k].abs(), "{momentum:?} {expected:?}");
        }
    }
    sim.update(100);
    let q = sim.robot(id).get_qpos();
    assert_near(&q.row(0).to_vec(), &[0.3, -0.8], "it stays for a second");
    assert!((q[(2, 0)] - 0.3).abs() > 0.5, "the control falls: {q}");
    // Off again: it falls as the control did, from the start.
    let fallen = q.row(2).to_vec();
    let mut robot = sim.robot_mut(id);
    robot.set_gravity_compensation(false, Some(&[a, b]), None).unwrap();
    sim.reset(None).unwrap();
    sim.robot_mut(id).write_qpos(&array![[0.3, -0.8]], None, None).unwrap();
    sim.update(101);
    assert_eq!(sim.robot(id).get_qpos().row(0).to_vec(), fallen);
}

/// Half of a falling robot without weight falls at half of g. A reset ends wrenches and keeps the compensation; a new model
/// keeps both.
#[test]
fn what_stays_when_the_world_changes() {
    let (mut sim, id) = balls(G);
    let [outer, inner] = links(&sim, id, &["outer", "inner"])[..] else { unreachable!() };
    let push = array![[[2.0, 0.0, 0.0]]];
    let zero = Array3::zeros((1, 1, 3));
    let mut robot = sim.robot_mut(id);
    robot.set_gravity_compensation(true, Some(&[inner]), None).unwrap();
    robot.set_external_wrench(&push, &zero, WrenchFrame::World, Some(&[outer]), None).unwrap();
    sim.update(10);
    let ball = RigidObjectCfg { uid: "ball".into(), init_pose: Pose::translation(9.0, 0.0, 0.0), ..Default::default() };
    sim.add_rigid_object(ball).unwrap();
    sim.update(10);
    let t = 20.0 * H;
    let v = sim.robot(id).get_root_velocity();
    assert_near(&v.row(1).to_vec(), &[t * 2.0 / 4.0, 0.0, -t * G / 2.0, 0.0, 0.0, 0.0], "through the change");
    sim.reset(None).unwrap();
    assert_eq!(sim.robot(id).get_external_wrenches(), Array3::<f64>::zeros((ENVS, 3, 6)));
    sim.update(10);
    let v = sim.robot(id).get_root_velocity();
    assert_near(&v.row(1).to_vec(), &[0.0, 0.0, -10.0 * H * G / 2.0, 0.0, 0.0, 0.0], "after the reset");
    // What is fixed to the outer ball is one body with it.
    let grip = links(&sim, id, &["grip"]);
    sim.robot_mut(id).set_gravity_compensation(true, Some(&grip), Some(&[EnvId(0)])).unwrap();
    assert_eq!(sim.robot(id).get_gravity_compensation().row(0).to_vec(), [true; 3]);
    assert_eq!(sim.robot(id).get_gravity_compensation().row(1).to_vec(), [false, true, false]);
}

#[test]
fn mistakes_are_errors_and_nothing_is_set() {
    let (mut sim, id) = balls(0.0);
    let three = |envs, links| Array3::<f64>::zeros((envs, links, 3));
    let nan = |k: usize| Array3::from_shape_fn((1, 3, 3), |(_, l, x)| if 3 * l + x == k { f64::NAN } else { 1.0 });
    let (outer, unknown, nowhere) = ([LinkId(0)], [LinkId(3)], [EnvId(ENVS)]);
    let (twice, again) = ([LinkId(2), LinkId(1), LinkId(2)], [EnvId(1), EnvId(1)]);
    type Case<'a> = (Array3<f64>, Array3<f64>, Option<&'a [LinkId]>, Option<&'a [EnvId]>, &'a [&'a str]);
    let cases: Vec<Case<'_>> = vec![
        (three(1, 2), three(1, 3), None, None, &["(forces)", "[1, 2, 3]", "[3, 3, 3]", "x y z"]),
        (three(1, 3), three(2, 3), None, None, &["(torques)", "[2, 3, 3]", "[3, 3, 3]"]),
        (Array3::zeros((1, 3, 2)), three(1, 3), None, None, &["(forces)", "[1, 3, 2]"]),
        (three(0, 3), three(1, 3), None, None, &["(forces)", "[0, 3, 3]"]),
        (nan(4), three(1, 3), None, None, &["(forces)[0, 4]", "y of link \"inner\"", "NaN"]),
        (three(1, 3), nan(8), None, None, &["(torques)[0, 8]", "z of link \"grip\""]),
        (three(1, 1), three(1, 1), Some(&unknown), None, &["link 3 does not exist", "there are 3"]),
        (three(1, 1), three(1, 1), Some(&outer), Some(&nowhere), &["environment 3 does not exist"]),
        (three(1, 3), three(1, 3), Some(&twice), None, &["set_external_wrench names link \"grip\" twice", "0 and 2"]),
        (three(2, 3), three(1, 3), None, Some(&again), &["set_external_wrench names environment 1 twice"]),
    ];
    for (forces, torques, links, envs, expected) in cases {
        let mut robot = sim.robot_mut(id);
        let message =
            robot.set_external_wrench(&forces, &torques, WrenchFrame::World, links, envs).unwrap_err().to_string();
        for part in expected {
            assert!(message.contains(part), "{part:?} is not in {message}");
        }
        assert_eq!(sim.robot(id).get_external_wrenches(), Array3::<f64>::zeros((ENVS, 3, 6)));
    }
    for (links, envs, part) in [
        (Some(&unknown[..]), None, "link 3"),
        (None, Some(&nowhere[..]), "environment 3"),
        (Some(&twice[..]), None, "set_gravity_compensation names link \"grip\" twice"),
        (None, Some(&again[..]), "set_gravity_compensation names environment 1 twice"),
    ] {
        let message = sim.robot_mut(id).set_gravity_compensation(true, links, envs).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
        assert_eq!(sim.robot(id).get_gravity_compensation(), Array2::from_elem((ENVS, 3), false));
    }
    // Nobody is nobody.
    sim.robot_mut(id).set_external_wrench(&three(0, 3), &three(0, 3), WrenchFrame::Link, None, Some(&[])).unwrap();
    sim.robot_mut(id).set_external_wrench(&three(3, 0), &three(1, 0), WrenchFrame::Link, Some(&[]), None).unwrap();
}
