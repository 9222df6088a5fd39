//! Fixed and floating bases, and robots whose first body is jointed to the world.

use super::*;
use kinetoscope::ndarray::array;
use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope::sim::Error;
use kinetoscope_testkit::error_tables::assert_error;
use std::f64::consts::FRAC_PI_2;

/// A cart with a wheel; `%` is replaced by the joint of the cart.
const CART: &str = r#"<mujoco><worldbody><body name="cart" pos="0.5 0 1" euler="0 0 90">%
    <geom type="box" size="0.2 0.1 0.05" mass="2"/>
    <body name="wheel" pos="0.2 0 0"><joint name="axle" axis="0 1 0"/><geom size="0.05" mass="0.3"/></body></body>
  </worldbody></mujoco>"#;

fn cart(held: &str, fix_base: bool) -> RobotCfg {
    RobotCfg { fix_base, ..passive(robot("cart", &CART.replace('%', held))) }
}

/// Distance fallen after n steps of h with MuJoCo's Euler: g h² n (n + 1) / 2 \[m\].
const FALLEN: f64 = 9.81 * 0.002 * 0.002 * 100.0 * 101.0 / 2.0;

/// The configuration decides if the base is floating, independent of the file.
#[test]
fn fixed_or_free() {
    let start = array![[0.5, 0.0, 1.0, 0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()]];
    let at_start = |pose: Array2<f64>| assert!(largest(&(pose - &start)) < 1e-15);
    for (of_file, fix_base) in
        ["", r#"<freejoint name="float"/>"#].into_iter().flat_map(|file| [(file, true), (file, false)])
    {
        let (mut sim, id) = with(1, cart(of_file, fix_base));
        assert_eq!(sim.batch().model().nv(), if fix_base { 1 } else { 7 });
        assert_eq!((sim.robot(id).dof(), sim.robot(id).joint_names()), (1, &["axle".to_string()][..]));
        at_start(sim.robot(id).root_pose());
        at_start(sim.robot(id).default_root_pose());
        sim.update(100);
        let fallen = if fix_base { 0.0 } else { FALLEN };
        let z = sim.robot(id).root_pose()[(0, 2)];
        assert!((z - 1.0 + fallen).abs() < 1e-10, "{of_file} {fix_base}: {z}");
        if fix_base {
            assert!(matches!(sim.robot_mut(id).write_root_pose(&start, None), Err(Error::FixedBody(_))));
        } else {
            sim.robot_mut(id).write_root_pose(&start, None).unwrap();
            at_start(sim.robot(id).root_pose());
            sim.reset(None).unwrap();
            at_start(sim.robot(id).root_pose());
        }
    }
    // `init_pose` moves the world of the file: (0.5, 0, 1) rotated by 90 degrees about z, the cart by another 90.
    let init_pose = kinetoscope::scene::pose::from_xyz_rpy([1.0, 2.0, 3.0], [0.0, 0.0, FRAC_PI_2]);
    let (sim, id) = with(1, RobotCfg { init_pose, ..cart(r#"<freejoint name="float"/>"#, false) });
    let seen = sim.robot(id).root_pose();
    assert!(largest(&(&seen - &array![[1.0, 2.5, 4.0, 0.0, 0.0, 0.0, 1.0]])) < 1e-15, "{seen}");
    assert!((sim.robot(id).default_root_state()[(0, 1)] - 2.5).abs() < 1e-15);
}

/// The damping of a free joint, as set by an inherited default, acts as in MuJoCo. Without damping the body falls by
/// 0.79 m.
#[test]
fn damped_free_joint() {
    let held = r#"<joint name="float" type="free" damping="3"/>"#;
    let (mut sim, id) = with(1, cart(held, false));
    let mut data = Data::new(&alone(&CART.replace('%', held))).unwrap();
    sim.update(200);
    (0..200).for_each(|_| data.step().unwrap());
    let z = sim.robot(id).root_pose()[(0, 2)];
    assert!((z - data.qpos()[2]).abs() < 1e-10 && z > 1.0 - 0.75 && z < 1.0 - 0.5, "{z} {}", data.qpos()[2]);
}

/// A pendulum on a rail: the root link is the file's world.
#[test]
fn joined_to_the_world() {
    let text = r#"<mujoco><worldbody><body name="cart" pos="0 0 2">
        <joint name="rail" type="slide" axis="1 0 0" range="-1 1" limited="true"/><geom size="0.1" mass="1"/>
        <body name="rod"><joint name="hinge" axis="0 1 0"/><geom size="0.05" pos="0 0 -0.5" mass="0.4"/>
        <site name="bob" pos="0 0 -0.5"/></body></body></worldbody></mujoco>"#;
    let init_pose = Pose::translation(0.0, 1.0, 0.0);
    let (mut sim, id) = with(1, RobotCfg { init_pose, ..passive(robot("p", text)) });
    let of = sim.robot(id);
    assert_eq!(of.link_names(), ["world", "cart", "rod", "bob"]);
    assert_eq!(of.joint_names(), ["rail", "hinge"]);
    assert_eq!(of.root_pose(), array![[0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0]]);
    assert_eq!(of.link_pose("world").unwrap(), of.root_pose());
    sim.robot_mut(id).write_qpos(&array![[0.3, FRAC_PI_2]], None, None).unwrap();
    let bob = sim.robot(id).link_pose("bob").unwrap();
    assert!((0..3).all(|k| (bob[(0, k)] - [0.3 - 0.5, 1.0, 2.0][k]).abs() < 1e-12), "{bob}");
    let free = empty(1).add_robot(RobotCfg { fix_base: false, ..passive(robot("p", text)) });
    assert_error(free, "", &["joint \"rail\" connects the root body \"cart\" to the world", "fix_base: true"]);
}

/// A massless body fixed in the file gets the minimal mass of a floating base, as a URDF's does, with one diagnostic. A
/// fixed base needs no mass.
#[test]
fn massless_base() {
    let text = r#"<mujoco><worldbody><body name="frame"><body name="arm"><joint name="j" axis="0 0 1"/>
        <geom size="0.1" mass="1"/></body></body></worldbody></mujoco>"#;
    for (fix_base, expected) in [(false, 1), (true, 0)] {
        let (mut sim, id) = with(1, RobotCfg { fix_base, ..robot("r", text) });
        let massless = sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::MasslessLink).count();
        assert_eq!(massless, expected);
        if !fix_base {
            assert_eq!(sim.robot(id).total_mass(), 1.0);
            let start = sim.robot(id).root_pose()[(0, 2)];
            sim.update(100);
            // All bodies fall alike.
            let fallen = start - sim.robot(id).root_pose()[(0, 2)];
            assert!((fallen - FALLEN).abs() < 1e-6, "{fallen} {FALLEN}");
        }
    }
}
