//! Fixed and free bases, and robots whose first body is joined to the world.

use super::{empty, passive, robot};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sim::{DiagnosticKind, mj};

/// A cart with a wheel; `%` is what holds the cart.
const CART: &str = r#"<mujoco><worldbody><body name="cart" pos="0.5 0 1" euler="0 0 90">%
    <geom type="box" size="0.2 0.1 0.05" mass="2"/>
    <body name="wheel" pos="0.2 0 0"><joint name="axle" axis="0 1 0"/><geom size="0.05" mass="0.3"/></body></body>
  </worldbody></mujoco>"#;

const FREE: &str = r#"<freejoint name="float"/>"#;

#[test]
fn the_configuration_says_whether_the_base_is_free() {
    let start = array![[0.5, 0.0, 1.0, 0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()]];
    for of_file in [FREE, ""] {
        for fix_base in [true, false] {
            let mut sim = empty(1);
            let cfg = RobotCfg { fix_base, ..passive("cart", &CART.replace('%', of_file)) };
            let id = sim.add_robot(cfg).unwrap();
            assert_eq!(sim.batch().model().nv(), if fix_base { 1 } else { 7 });
            assert_eq!((sim.robot(id).dof(), sim.robot(id).joint_names()), (1, &["axle".to_string()][..]));
            assert!((sim.robot(id).get_root_pose() - &start).iter().all(|d| d.abs() < 1e-15));
            assert!((sim.robot(id).get_default_root_pose() - &start).iter().all(|d| d.abs() < 1e-15));
            sim.update(100);
            // MuJoCo's Euler rule falls by g h² n (n + 1) / 2 in n steps of h.
            let fallen = if fix_base { 0.0 } else { 9.81 * 0.002 * 0.002 * 100.0 * 101.0 / 2.0 };
            let z = sim.robot(id).get_root_pose()[(0, 2)];
            assert!((z - 1.0 + fallen).abs() < 1e-10, "{of_file} {fix_base}: {z}");
            if !fix_base {
                sim.robot_mut(id).write_root_pose(&start, None).unwrap();
                assert!((sim.robot(id).get_root_pose() - &start).iter().all(|d| d.abs() < 1e-15));
                sim.reset(None).unwrap();
                assert!((sim.robot(id).get_root_pose() - &start).iter().all(|d| d.abs() < 1e-15));
            } else {
                assert!(matches!(sim.robot_mut(id).write_root_pose(&start, None), Err(Error::FixedBody(_))));
            }
        }
    }
}

#[test]
fn init_pose_moves_the_world_of_the_file() {
    let mut sim = empty(1);
    let pose = kinetoscope::scene::pose::from_xyz_rpy([1.0, 2.0, 3.0], [0.0, 0.0, std::f64::consts::FRAC_PI_2]);
    let cfg = RobotCfg { fix_base: false, init_pose: pose, ..passive("cart", &CART.replace('%', FREE)) };
    let id = sim.add_robot(cfg).unwrap();
    // (0.5, 0, 1) turned by 90 degrees about z, the cart by another 90.
    let expected = array![[1.0, 2.5, 4.0, 0.0, 0.0, 0.0, 1.0]];
    let seen = sim.robot(id).get_root_pose();
    assert!((&seen - &expected).iter().all(|d| d.abs() < 1e-15), "{seen}");
    assert!((sim.robot(id).get_default_root_state()[(0, 1)] - 2.5).abs() < 1e-15);
}

/// The free joint of a damped body, as an inherited default makes it: what MuJoCo damps is damped.
#[test]
fn damping_of_a_free_joint_stays() {
    let text = CART.replace('%', r#"<joint name="float" type="free" damping="3"/>"#);
    let mut sim = empty(1);
    let id = sim.add_robot(RobotCfg { fix_base: false, ..passive("cart", &text) }).unwrap();
    let alone = text.replace("<worldbody>", r#"<option timestep="0.002"/><worldbody>"#);
    let mut data = mj::Data::new(&mj::compile(&alone, &[]).unwrap().into_model()).unwrap();
    sim.update(200);
    for _ in 0..200 {
        data.step().unwrap();
    }
    let z = sim.robot(id).get_root_pose()[(0, 2)];
    assert!((z - data.qpos()[2]).abs() < 1e-10, "{z} {}", data.qpos()[2]);
    // Without it, 0.79 m.
    assert!(z > 1.0 - 0.75 && z < 1.0 - 0.5, "{z}");
}

/// A pendulum on a rail: the root link is the file's world.
#[test]
fn a_body_that_is_joined_to_the_world_hangs_on_a_link_called_world() {
    let text = r#"<mujoco><worldbody><body name="cart" pos="0 0 2">
        <joint name="rail" type="slide" axis="1 0 0" range="-1 1" limited="true"/><geom size="0.1" mass="1"/>
        <body name="rod"><joint name="hinge" axis="0 1 0"/><geom size="0.05" pos="0 0 -0.5" mass="0.4"/>
        <site name="bob" pos="0 0 -0.5"/></body></body></worldbody></mujoco>"#;
    let mut sim = empty(1);
    let pose = Pose::translation(0.0, 1.0, 0.0);
    let id = sim.add_robot(RobotCfg { init_pose: pose, ..passive("p", text) }).unwrap();
    let robot = sim.robot(id);
    assert_eq!(robot.link_names(), ["world", "cart", "rod", "bob"]);
    assert_eq!(robot.joint_names(), ["rail", "hinge"]);
    assert_eq!(robot.get_root_pose(), array![[0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0]]);
    assert_eq!(robot.link_pose("world").unwrap(), robot.get_root_pose());
    sim.robot_mut(id).write_qpos(&array![[0.3, std::f64::consts::FRAC_PI_2]], None, None).unwrap();
    let bob = sim.robot(id).link_pose("bob").unwrap();
    for (k, expected) in [0.3 - 0.5, 1.0, 2.0].into_iter().enumerate() {
        assert!((bob[(0, k)] - expected).abs() < 1e-12, "{bob}");
    }
    let error = empty(1).add_robot(RobotCfg { fix_base: false, ..passive("p", text) }).unwrap_err().to_string();
    assert!(
        error.contains("joint \"rail\" holds the root body \"cart\"") && error.contains("fix_base: true"),
        "{error}"
    );
}

/// A frame without mass that a file fixes gets what a free body needs, as a URDF's does, and that is said once.
#[test]
fn a_first_body_without_mass_can_be_free() {
    let text = r#"<mujoco><worldbody><body name="frame"><body name="arm"><joint name="j" axis="0 0 1"/>
        <geom size="0.1" mass="1"/></body></body></worldbody></mujoco>"#;
    let mut sim = empty(1);
    let id = sim.add_robot(RobotCfg { fix_base: false, ..robot("r", text) }).unwrap();
    let massless = sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::MasslessLink).count();
    assert_eq!((massless, sim.robot(id).total_mass()), (1, 1.0));
    let start = sim.robot(id).get_root_pose()[(0, 2)];
    sim.update(100);
    // Euler's rule falls by g h² n (n + 1) / 2; all parts fall alike.
    let (fallen, expected) = (start - sim.robot(id).get_root_pose()[(0, 2)], 9.81 * 4e-6 * 100.0 * 101.0 / 2.0);
    assert!((fallen - expected).abs() < 1e-6, "{fallen} {expected}");
    // Where it stands fixed nothing is needed.
    let mut sim = empty(1);
    sim.add_robot(robot("r", text)).unwrap();
    assert!(sim.diagnostics().iter().all(|d| d.kind != DiagnosticKind::MasslessLink));
}
