//! Forces on links and gravity compensation, against Newton's laws.
//!
//! MuJoCo's Euler step is v' = v + h F / m. Tolerance 1e-9: rounding of 1e-16 per step over at most 200 steps, and of
//! the solve of two bodies whose inertias differ by a factor of 100.

use super::ENVS;
use kinetoscope::ndarray::{Array2, Array3, array};
use kinetoscope::prelude::*;
use kinetoscope::robot::description::LinkId;
use kinetoscope::sim::WrenchFrame;
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::tolerance::{Tolerance, assert_close};
use kinetoscope_testkit::urdf::{TempFiles, joint, link, robot};
use kinetoscope_testkit::worlds::{add_ball, empty_cfg, no_drive, pose_of_row, text_robot};
use nalgebra::Vector3;

const EXACT: Tolerance =
    Tolerance::absolute(1e-9, "rounding of 200 steps, and of the solve of inertias that differ by a factor of 100");
const H: f64 = 0.01;
const G: f64 = 9.81;

fn sim_of(urdf: &str, gravity: f64, fix_base: bool) -> (SimulationManager, RobotId) {
    let (files, gravity) = (TempFiles::default(), [0.0, 0.0, -gravity].into());
    let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg { gravity, ..empty_cfg(ENVS) });
    let robot = RobotCfg { fix_base, drive: no_drive(), ..text_robot(&files, "robot", &robot("r", urdf)) };
    let id = sim.add_robot(robot).unwrap();
    (sim, id)
}

/// A free ball of 2 kg, and a second ball of 2 kg in its center that rotates about z on a passive hinge. A massless
/// grip is fixed to the first ball, rotated by a quarter turn about z. Returns their links, too.
fn balls(gravity: f64) -> (SimulationManager, RobotId, [LinkId; 3]) {
    let ball = |name| link(name, 2.0, 0.02, [0.0; 3], "");
    let spin = joint("spin", "continuous", ["outer", "inner"], [0.0; 3], "0 0 1", "");
    let mount = "<joint name=\"mount\" type=\"fixed\"><parent link=\"outer\"/><child link=\"grip\"/>\
                 <origin xyz=\"0.3 0 0\" rpy=\"0 0 1.5707963267948966\"/></joint>";
    let urdf = format!("{}{}<link name=\"grip\"/>{spin}{mount}", ball("outer"), ball("inner"));
    let (sim, id) = sim_of(&urdf, gravity, false);
    let links = ["outer", "inner", "grip"].map(|name| sim.robot(id).link_id(name).unwrap());
    (sim, id, links)
}

fn zero() -> Array3<f64> {
    Array3::zeros((1, 1, 3))
}

/// Total mass 4 kg: a = F / 4 until the force changes. A torque rotates the inner ball alone: alpha = tau / I.
#[test]
fn force_until_it_changes() {
    let (mut sim, id, [outer, inner, _]) = balls(0.0);
    let (push, twist) = (array![[[6.0, -2.0, 1.0]], [[0.0, 0.0, 8.0]]], array![[[0.0, 0.0, 0.5]]]);
    let chosen = Some(&[EnvId(2), EnvId(0)][..]);
    let set = |sim: &mut SimulationManager, forces: &Array3<f64>, torques: &Array3<f64>, link, envs| {
        sim.robot_mut(id).set_external_wrench(forces, torques, WrenchFrame::World, Some(&[link]), envs).unwrap();
    };
    set(&mut sim, &push, &zero(), outer, chosen);
    set(&mut sim, &zero(), &twist, inner, chosen);
    let read = sim.robot(id).external_wrenches();
    assert_eq!((read.dim(), read[(2, outer.0, 1)], read[(0, inner.0, 5)]), ((ENVS, 3, 6), -2.0, 0.5));
    assert_eq!(read.iter().filter(|x| **x != 0.0).count(), 6);
    let t = 20.0 * H;
    // A wrench of another link does not end this wrench. A new wrench of the same link replaces it, and zeros remove
    // it.
    for (steps, share, ends) in [(20, 1.0, None), (10, 1.5, Some(inner)), (10, 1.5, Some(outer))] {
        if let Some(link) = ends {
            set(&mut sim, &zero(), &zero(), link, None);
        }
        sim.update(steps);
        let (v, spin, x) = (sim.robot(id).root_velocity(), sim.robot(id).qvel(), share * t / 4.0);
        assert_close("environment 2", v.row(2), [6.0 * x, -2.0 * x, x, 0.0, 0.0, 0.0], EXACT);
        assert_close("environment 0", v.row(0), [0.0, 0.0, 8.0 * x, 0.0, 0.0, 0.0], EXACT);
        let turned = t * 0.5 / 0.02;
        assert_close("spin", spin.column(0), [turned, 0.0, turned], EXACT);
        assert_eq!(v.row(1).to_vec(), [0.0; 6], "environment 1 was not chosen");
    }
    assert_eq!(sim.robot(id).external_wrenches(), Array3::<f64>::zeros((ENVS, 3, 6)));
}

/// A ball that rotates at w about z: after k steps the ball, and a force in its axes, is rotated by w h k.
#[test]
fn force_in_axes_of_a_link() {
    let (mut sim, id, [outer, _, grip]) = balls(0.0);
    let (w, push) = (3.0, array![[[5.0, 0.0, 0.0]]]);
    let mut robot = sim.robot_mut(id);
    robot.write_root_velocity(&array![[0.0, 0.0, 0.0, 0.0, 0.0, w]], None).unwrap();
    for (env, frame, link) in
        [(0, WrenchFrame::Link, outer), (1, WrenchFrame::Link, grip), (2, WrenchFrame::World, grip)]
    {
        robot.set_external_wrench(&push, &zero(), frame, Some(&[link]), Some(&[EnvId(env)])).unwrap();
    }
    let mut expected = [[0.0_f64; 2]; ENVS];
    for k in 0..200 {
        sim.update(1);
        let (angle, v) = (w * H * f64::from(k), sim.robot(id).root_velocity());
        // The grip is a quarter turn ahead; the world does not rotate.
        let angles = [angle, angle + std::f64::consts::FRAC_PI_2, 0.0];
        for (env, ([x, y], angle)) in expected.iter_mut().zip(angles).enumerate() {
            *x += H * 5.0 / 4.0 * angle.cos();
            *y += H * 5.0 / 4.0 * angle.sin();
            // The force causes no torque: it acts at the center of mass, regardless of the position of the grip.
            assert_close(&format!("environment {env}, step {k}"), v.row(env), [*x, *y, 0.0, 0.0, 0.0, w], EXACT);
        }
    }
    let in_world = pose_of_row(&sim.robot(id).link_pose("grip").unwrap(), 1).rotation * Vector3::new(5.0, 0.0, 0.0);
    let read = sim.robot(id).external_wrenches();
    assert_close("what is read is in world axes", [0, 1, 2].map(|k| read[(1, grip.0, k)]), &in_world, EXACT);
}

/// Two levers in a chain under gravity, without drives. With compensation, they keep their pose. With compensation of
/// one lever, the other falls as in MuJoCo without the first lever's mass.
#[test]
fn gravity_compensation() {
    let start = [0.3, -0.8];
    let urdf = [
        "<link name=\"base\"/>".to_string(),
        link("a", 3.0, 0.05, [0.25, 0.0, 0.0], ""),
        link("b", 1.0, 0.02, [0.2, 0.0, 0.1], ""),
        joint("ja", "continuous", ["base", "a"], [0.0; 3], "0 1 0", ""),
        joint("jb", "continuous", ["a", "b"], [0.5, 0.0, 0.0], "0 1 0", ""),
    ];
    let (mut sim, id) = sim_of(&urdf.concat(), G, true);
    let [a, b] = ["a", "b"].map(|name| sim.robot(id).link_id(name).unwrap());
    let mut robot = sim.robot_mut(id);
    robot.write_qpos(&array![start], None, None).unwrap();
    robot.set_gravity_compensation(true, None, Some(&[EnvId(0)])).unwrap();
    robot.set_gravity_compensation(true, Some(&[a]), Some(&[EnvId(1)])).unwrap();
    let on = sim.robot(id).gravity_compensation();
    assert_eq!(on, array![[true, true, true], [false, true, false], [false; 3]]);
    // Generalized forces of gravity by virtual work: the derivative of -m g z of the centers of mass that have weight.
    let height = |q: [f64; 2], weight: [f64; 2]| {
        let ([za, zb], turn) = ([-(0.25 * q[0].sin()), -(0.5 * q[0].sin())], q[0] + q[1]);
        weight[0] * za + weight[1] * (zb - 0.2 * turn.sin() + 0.1 * turn.cos())
    };
    let load = |weight: [f64; 2]| -> [f64; 2] {
        let e = 1e-6;
        [[e, 0.0], [0.0, e]].map(|d| {
            let at = |sign: f64| height([start[0] + sign * d[0], start[1] + sign * d[1]], weight);
            -G * (at(1.0) - at(-1.0)) / (2.0 * e)
        })
    };
    sim.update(1);
    let speeds = sim.robot(id).qvel();
    assert_close("nothing has weight", speeds.row(0), [0.0; 2], EXACT);
    for (env, weight) in [(1, [0.0, 1.0]), (2, [3.0, 1.0])] {
        // From rest M v' = h load, with MuJoCo's M.
        let mass = sim.batch().read(2, |env| env.data().mass_matrix().unwrap());
        let v = speeds.row(env);
        let momentum = [mass[0] * v[0] + mass[1] * v[1], mass[2] * v[0] + mass[3] * v[1]];
        for (found, tau) in momentum.into_iter().zip(load(weight)) {
            // M is that after the step, 1e-2 rad further; the difference quotient is accurate to 1e-9.
            assert!((found - H * tau).abs() < 0.01 * (H * tau).abs(), "{momentum:?} {tau}");
        }
    }
    sim.update(100);
    let q = sim.robot(id).qpos();
    assert_close("it stays for a second", q.row(0), start, EXACT);
    assert!((q[(2, 0)] - 0.3).abs() > 0.5, "the control falls: {q}");
    // Without compensation again: it falls as in the control, from the start.
    sim.robot_mut(id).set_gravity_compensation(false, Some(&[a, b]), None).unwrap();
    sim.reset(None).unwrap();
    sim.robot_mut(id).write_qpos(&array![start], None, None).unwrap();
    sim.update(101);
    assert_eq!(sim.robot(id).qpos().row(0), q.row(2));
}

/// A falling robot with compensation for half of its mass falls at g / 2. A reset ends wrenches and keeps the
/// compensation; a new model keeps both.
#[test]
fn model_rebuilds_and_resets() {
    let (mut sim, id, [outer, inner, grip]) = balls(G);
    let push = array![[[2.0, 0.0, 0.0]]];
    let mut robot = sim.robot_mut(id);
    robot.set_gravity_compensation(true, Some(&[inner]), None).unwrap();
    robot.set_external_wrench(&push, &zero(), WrenchFrame::World, Some(&[outer]), None).unwrap();
    sim.update(10);
    add_ball(&mut sim, "ball", [9.0, 0.0, 0.0]);
    sim.update(10);
    let (t, v) = (20.0 * H, sim.robot(id).root_velocity());
    assert_close("through the change", v.row(1), [t * 2.0 / 4.0, 0.0, -t * G / 2.0, 0.0, 0.0, 0.0], EXACT);
    sim.reset(None).unwrap();
    assert_eq!(sim.robot(id).external_wrenches(), Array3::<f64>::zeros((ENVS, 3, 6)));
    sim.update(10);
    let v = sim.robot(id).root_velocity();
    assert_close("after the reset", v.row(1), [0.0, 0.0, -10.0 * H * G / 2.0, 0.0, 0.0, 0.0], EXACT);
    // Links that are fixed to the outer ball form one body with it.
    sim.robot_mut(id).set_gravity_compensation(true, Some(&[grip]), Some(&[EnvId(0)])).unwrap();
    let on = sim.robot(id).gravity_compensation();
    assert_eq!([on.row(0), on.row(1)], [array![true, true, true].view(), array![false, true, false].view()]);
}

#[test]
fn mistakes() {
    let (mut sim, id, _) = balls(0.0);
    let three = |envs, links| Array3::<f64>::zeros((envs, links, 3));
    let nan = |k: usize| Array3::from_shape_fn((1, 3, 3), |(_, l, x)| if 3 * l + x == k { f64::NAN } else { 1.0 });
    let (unknown, nowhere) = (Some(&[LinkId(3)][..]), Some(&[EnvId(ENVS)][..]));
    let (twice, again) = (Some(&[LinkId(2), LinkId(1), LinkId(2)][..]), Some(&[EnvId(1), EnvId(1)][..]));
    type Row<'a> = (Array3<f64>, Array3<f64>, Option<&'a [LinkId]>, Option<&'a [EnvId]>, &'a [&'a str]);
    let rows: [Row<'_>; 10] = [
        (three(1, 2), three(1, 3), None, None, &["(forces)", "[1, 2, 3]", "[3, 3, 3]", "x y z"]),
        (three(1, 3), three(2, 3), None, None, &["(torques)", "[2, 3, 3]", "[3, 3, 3]"]),
        (Array3::zeros((1, 3, 2)), three(1, 3), None, None, &["(forces)", "[1, 3, 2]"]),
        (three(0, 3), three(1, 3), None, None, &["(forces)", "[0, 3, 3]"]),
        (nan(4), three(1, 3), None, None, &["(forces)[0, 4]", "y of link \"inner\"", "NaN"]),
        (three(1, 3), nan(8), None, None, &["(torques)[0, 8]", "z of link \"grip\""]),
        (three(1, 1), three(1, 1), unknown, None, &["link 3 does not exist", "there are 3"]),
        (three(1, 1), three(1, 1), Some(&[LinkId(0)]), nowhere, &["environment 3 does not exist"]),
        (three(1, 3), three(1, 3), twice, None, &["set_external_wrench names link \"grip\" twice", "0 and 2"]),
        (three(2, 3), three(1, 3), None, again, &["set_external_wrench names environment 1 twice"]),
    ];
    for (forces, torques, links, envs, parts) in rows {
        let result = sim.robot_mut(id).set_external_wrench(&forces, &torques, WrenchFrame::World, links, envs);
        assert_error(result, "", parts);
        assert_eq!(sim.robot(id).external_wrenches(), Array3::<f64>::zeros((ENVS, 3, 6)));
    }
    for (links, envs, part) in [
        (unknown, None, "link 3"),
        (None, nowhere, "environment 3"),
        (twice, None, "set_gravity_compensation names link \"grip\" twice"),
        (None, again, "set_gravity_compensation names environment 1 twice"),
    ] {
        assert_error(sim.robot_mut(id).set_gravity_compensation(true, links, envs), "", &[part]);
        assert_eq!(sim.robot(id).gravity_compensation(), Array2::from_elem((ENVS, 3), false));
    }
    // Empty lists of environments or links are valid.
    let mut robot = sim.robot_mut(id);
    robot.set_external_wrench(&three(0, 3), &three(0, 3), WrenchFrame::Link, None, Some(&[])).unwrap();
    robot.set_external_wrench(&three(3, 0), &three(1, 0), WrenchFrame::Link, Some(&[]), None).unwrap();
}
