//! Poses and Jacobians compared with MuJoCo: in the simulation, with difference quotients of poses, and with MuJoCo's
//! own URDF reader.
//!
//! Both sides multiply the same dozen transforms in a different order: positions of a meter differ by some units of
//! 2e-16. The required bound is 1e-12.

use super::*;
use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::{Data, ObjectKind};
use kinetoscope::ndarray::{Array3, s};
use kinetoscope::robot::kinematics::TipFrame;
use kinetoscope_testkit::tolerance::{Tolerance, assert_close, assert_number};
use kinetoscope_testkit::urdf::joint;
use nalgebra::Vector3;

const BOUND: Tolerance =
    Tolerance::absolute(1e-12, "a dozen transforms of size 1, some units of 2e-16, in another order");

/// Driver of a joint, multiplier and offset (itself, 1 and 0 for a joint without a driver).
type Driver = (JointIndex, f64, f64);

fn tilted() -> Pose {
    Pose::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.4, -1.1, 0.3))
}

fn tool() -> Pose {
    Pose::new(Vector3::new(0.07, -0.02, 0.11), Vector3::new(0.3, 0.2, -0.4))
}

/// `mj_jac` at a point of a body, with a column for each joint; columns of followers are added to those of their
/// drivers.
fn mj_jac(data: &Data, body: usize, at: [f64; 3], joints: &[String], drivers: &[Driver]) -> Array2<f64> {
    let (model, nv) = (data.model(), data.model().nv());
    let (mut linear, mut angular) = (vec![0.0; 3 * nv], vec![0.0; 3 * nv]);
    data.jacobian(body, at, &mut linear, &mut angular).unwrap();
    let mut jacobian = Array2::zeros((6, joints.len()));
    for (name, &(driver, ratio, _)) in joints.iter().zip(drivers) {
        let dof = model.jnt_dofadr()[model.id(ObjectKind::Joint, name).unwrap()] as usize;
        for axis in 0..3 {
            jacobian[(axis, driver.0)] += ratio * linear[axis * nv + dof];
            jacobian[(3 + axis, driver.0)] += ratio * angular[axis * nv + dof];
        }
    }
    jacobian
}

/// [`mj_jac`] at the origin of a frame on a body in every environment.
fn reference_jacobian(sim: &SimulationManager, id: RobotId, body: &str, point: &Array2<f64>) -> Array3<f64> {
    let (robot, model) = (sim.robot(id), sim.batch().model());
    let body = model.id(ObjectKind::Body, &format!("{}/{body}", robot.uid())).unwrap();
    let joints: Vec<String> = robot.joint_names().iter().map(|name| format!("{}/{name}", robot.uid())).collect();
    let mut jacobian = Array3::zeros((sim.num_envs(), 6, robot.dof()));
    for env in 0..sim.num_envs() {
        let at = [0, 1, 2].map(|k| point[(env, k)]);
        let one = sim.batch().read(env, |env| mj_jac(env.data(), body, at, &joints, &robot.mimic_drivers()));
        jacobian.index_axis_mut(Axis(0), env).assign(&one);
    }
    jacobian
}

/// Columns as central differences of poses over 2 h = 2e-4. Their error is h² / 6 times third derivatives, which are
/// about 1 for arms of a meter, so 2e-9, and 1e-16 / h of rounding.
fn differences(sim: &SimulationManager, id: RobotId, tip: TipFrame<'_>, qpos: &Array2<f64>) -> Array3<f64> {
    const H: f64 = 1e-4;
    let mut slopes = Array3::zeros((sim.num_envs(), 6, qpos.ncols()));
    for joint in 0..qpos.ncols() {
        let [after, before] = [H, -H].map(|by| {
            let mut qpos = qpos.clone();
            qpos.column_mut(joint).iter_mut().for_each(|q| *q += by);
            sim.robot(id).compute_fk(&qpos, tip, None).unwrap()
        });
        for env in 0..sim.num_envs() {
            let (a, b) = (pose_of_row(&after, env), pose_of_row(&before, env));
            let linear = (a.translation.vector - b.translation.vector) / (2.0 * H);
            let angular = (a.rotation * b.rotation.inverse()).scaled_axis() / (2.0 * H);
            for axis in 0..3 {
                slopes[(env, axis, joint)] = linear[axis];
                slopes[(env, 3 + axis, joint)] = angular[axis];
            }
        }
    }
    slopes
}

fn largest(a: &Array3<f64>, b: &Array3<f64>) -> f64 {
    assert_eq!(a.dim(), b.dim());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A URDF file read by MuJoCo, with all links as bodies; its root link is the world. It is independent of our URDF
/// reader and scene writer.
struct Reader(Data);

impl Reader {
    fn of(urdf: &Path) -> Self {
        let text = std::fs::read_to_string(urdf).unwrap();
        let element = text.find("<robot").unwrap();
        let inside = element + text[element..].find('>').unwrap() + 1;
        // Massless links are refused otherwise; masses do not affect the kinematics.
        let settings = r#"<mujoco><compiler fusestatic="false" boundmass="1e-3" boundinertia="1e-6" balanceinertia="true"/></mujoco>"#;
        let text = format!("{}{settings}{}", &text[..inside], &text[inside..]);
        Self(Data::new(&mj::compile(&text, &[]).unwrap().into_model()).unwrap())
    }

    fn put(&mut self, names: &[String], qpos: &[f64]) {
        for (name, &value) in names.iter().zip(qpos) {
            let model = self.0.model();
            let address = model.jnt_qposadr()[model.id(ObjectKind::Joint, name).unwrap()] as usize;
            self.0.qpos_mut()[address] = value;
        }
        self.0.forward().unwrap();
    }

    /// Body of a link; the world for the root link, which has no body.
    fn body(&self, link: &str, root: &str) -> usize {
        let body = self.0.model().id(ObjectKind::Body, link);
        if link == root { body.unwrap_or(0) } else { body.unwrap() }
    }

    fn pose(&self, body: usize) -> Pose {
        let (p, q) = (&self.0.xpos()[3 * body..], &self.0.xquat()[4 * body..]);
        pose_of_row(&row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]]), 0)
    }
}

/// The driver of every joint from the file: position = multiplier * position(joint) + offset, resolved through chains
/// of followers.
fn followed(urdf: &Path, names: &[String]) -> Vec<Driver> {
    let text = std::fs::read_to_string(urdf).unwrap();
    let document = roxmltree::Document::parse(&text).unwrap();
    let mimic = |name: &str| {
        let joints = document.root_element().children().filter(|node| node.has_tag_name("joint"));
        let mut mimics = joints.filter(|node| node.attribute("name") == Some(name));
        let mimic = mimics.next()?.children().find(|node| node.has_tag_name("mimic"))?;
        let number = |of: &str, else_: f64| mimic.attribute(of).map_or(else_, |text| text.parse().unwrap());
        Some((mimic.attribute("joint").unwrap(), number("multiplier", 1.0), number("offset", 0.0)))
    };
    let of = |name: &String| {
        let (mut at, mut ratio, mut offset) = (name.as_str(), 1.0, 0.0);
        while let Some((driver, multiplier, constant)) = mimic(at) {
            (at, ratio, offset) = (driver, ratio * multiplier, ratio * constant + offset);
        }
        (JointIndex(names.iter().position(|name| name == at).unwrap()), ratio, offset)
    };
    names.iter().map(of).collect()
}

/// Checks a robot at random positions. Every link pose agrees with the simulation and, for a URDF file, with MuJoCo's
/// own reader, which converts roll, pitch and yaw to quaternions by another formula. The Jacobian of a tool on `link`,
/// which is part of `body`, agrees with MuJoCo's and with differences of poses.
fn check(name: &str, sim: &mut SimulationManager, id: RobotId, [link, body]: [&str; 2], urdf: Option<&Path>) {
    let qpos = random_qpos(sim, id, sim.num_envs(), 9);
    let links = sim.robot(id).compute_link_fk(&qpos, None).unwrap();
    let tip = TipFrame::of_link(link).with_tcp(tool());
    let jacobian = sim.robot(id).jacobian(tip, Some(qpos.view()), None).unwrap();
    // Nothing was written: the links are at other poses. This is the control of everything below.
    let last = *sim.robot(id).link_names().last().unwrap();
    let before = sim.robot(id).link_pose(last).unwrap();
    let (far, turned) = max_pose_difference(&before, &links.index_axis(Axis(1), links.len_of(Axis(1)) - 1).to_owned());
    assert!(far + turned > 0.01, "{name}: {last} moved by {far} m, {turned} rad");

    sim.robot_mut(id).write_qpos(&qpos, None, None).unwrap();
    let robot = sim.robot(id);
    let names = robot.link_names();
    for (k, link) in names.iter().enumerate() {
        let fk = robot.compute_fk(&qpos, TipFrame::of_link(link), None).unwrap();
        for ours in [fk, links.index_axis(Axis(1), k).to_owned()] {
            let (far, turned) = max_pose_difference(&ours, &robot.link_pose(link).unwrap());
            assert_close(&format!("{name}, {link}"), [far, turned], [0.0; 2], BOUND);
        }
    }
    assert_eq!(robot.jacobian(tip, None, None).unwrap(), jacobian, "{name}: where the joints are");
    let mujoco = largest(&jacobian, &reference_jacobian(sim, id, body, &robot.compute_fk(&qpos, tip, None).unwrap()));
    let slopes = largest(&jacobian, &differences(sim, id, tip, &qpos));
    // Control: at another point the Jacobian differs.
    let elsewhere = largest(&jacobian, &reference_jacobian(sim, id, body, &robot.link_pose(link).unwrap()));
    assert_number(name, mujoco, 0.0, BOUND);
    assert!(slopes < 1e-7 && elsewhere > 1e-3, "{name}: {slopes} {elsewhere}");

    let Some(urdf) = urdf else { return };
    let (mut reader, joints, roots) = (Reader::of(urdf), robot.joint_names(), robot.root_pose());
    let drivers = followed(urdf, joints);
    let body = reader.body(link, names[0]);
    let (start, mut moved, mut elsewhere) = (reader.pose(body), 0.0_f64, 0.0_f64);
    for env in 0..sim.num_envs() {
        let base = pose_of_row(&roots, env);
        let there = drivers.iter().map(|&(driver, ratio, offset)| ratio * qpos[(env, driver.0)] + offset);
        reader.put(joints, &there.collect::<Vec<f64>>());
        for (k, link) in names.iter().enumerate() {
            let theirs = base * reader.pose(reader.body(link, names[0]));
            let (far, turned) = pose_error(&pose(links.index_axis(Axis(0), env).row(k)), &theirs);
            assert_close(&format!("{name}, {link}, MuJoCo's reader"), [far, turned], [0.0; 2], BOUND);
        }
        let frame = reader.pose(body);
        moved = moved.max(pose_error(&frame, &start).0);
        for (at, is_there) in [(tool(), true), (Pose::identity(), false)] {
            let theirs = mj_jac(&reader.0, body, (frame * at).translation.vector.into(), joints, &drivers);
            for (joint, first) in (0..joints.len()).flat_map(|joint| [(joint, 0), (joint, 3)]) {
                let theirs = base.rotation * Vector3::from_fn(|k, _| theirs[(first + k, joint)]);
                let off = (Vector3::from_fn(|k, _| jacobian[(env, first + k, joint)]) - theirs).norm();
                if is_there {
                    assert_number(&format!("{name}, {joint}, MuJoCo's reader"), off, 0.0, BOUND);
                }
                elsewhere = elsewhere.max(off);
            }
        }
    }
    // Controls: the tip moves, and at another point the Jacobian differs.
    assert!(moved > 0.05 && elsewhere > 1e-3, "{name}: {moved} {elsewhere}");
}

#[test]
fn fixed_roots() {
    let asset = |name: &str| assets::path(name).unwrap();
    for (name, urdf, of) in [
        ("SR5", asset("sr5/SR5.urdf"), ["ee_link", "link6"]),
        ("hand", asset("revo1_left/revo1_left.urdf"), ["left_index_dist"; 2]),
        ("seven axes", file("seven_axes.urdf"), ["link8", "link7"]),
        ("six axes", file("six_axes.urdf"), ["tool0", "wrist_3_link"]),
    ] {
        let (mut sim, id) = simulation(20, RobotCfg { init_pose: tilted(), ..arm(&urdf) });
        if name == "hand" {
            let drivers = followed(&urdf, sim.robot(id).joint_names());
            let follow = drivers.iter().enumerate().filter(|(k, (driver, ..))| driver.0 != *k);
            assert_eq!(follow.filter(|(_, (_, ratio, offset))| (*ratio, *offset) == (1.05, 0.0)).count(), 5);
        }
        check(name, &mut sim, id, of, Some(&urdf));
    }
    let (mut sim, id) = simulation(5, RobotCfg { init_pose: tilted(), ..arm_and_hand() });
    check("SR5 and hand", &mut sim, id, ["left_index_dist"; 2], None);
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendors_robot() {
    let (mut sim, id) =
        simulation(3, arm(kinetoscope_testkit::test_resources::robot("rokae_description/urdf/SR5.urdf")));
    check("the vendor's SR5", &mut sim, id, ["xMateSR5_link6"; 2], None);
}

/// Moved roots, different in each environment.
#[test]
fn moving_roots() {
    const ROOTS: [[f64; 7]; 4] = [
        [1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0],
        [-4.0, 0.5, 1.0, 0.6, 0.0, 0.8, 0.0],
        [0.0, 0.0, 9.0, 1.0, 1.0, 1.0, 1.0],
        [1.0, 2.0, 3.0, 0.5, 0.5, -0.5, 0.5],
    ];
    let urdf = assets::path("quadruped/quadruped.urdf").unwrap();
    let (mut sim, id) = simulation(20, RobotCfg { fix_base: false, ..arm(&urdf) });
    let roots = Array2::from_shape_fn((20, 7), |(env, k)| ROOTS[env % 4][k]);
    sim.robot_mut(id).write_root_pose(&roots, None).unwrap();
    check("quadruped", &mut sim, id, ["LF_FOOT", "LF_SHANK"], Some(&urdf));
}

/// A link behind a planar joint: after the joint has slid and rotated, child links are placed from its current pose.
#[test]
fn planar_joint() {
    let joints = [
        joint("slip", "planar", ["root", "plate"], [0.1, 0.0, 0.2], "1 0 0.2", ""),
        joint("turn", "continuous", ["plate", "arm"], [0.0, 0.3, 0.1], "0 1 1", ""),
    ];
    let (mut sim, id) = built(2, &["root", "plate", "arm"], &joints);
    let start = sim.robot(id).link_pose("plate").unwrap();
    sim.update(30);
    let (fell, _) = max_pose_difference(&start, &sim.robot(id).link_pose("plate").unwrap());
    assert!(fell > 0.1, "{fell}");
    check("planar", &mut sim, id, ["arm"; 2], None);
}

/// A slide, a follower that slides against it at half its speed, and a follower that rotates.
#[test]
fn slides_and_followers() {
    let limit = wide([-1.0, 1.0]);
    let mimic = |ratio: f64| format!("{limit}<mimic joint=\"drive\" multiplier=\"{ratio}\" offset=\"0.2\"/>");
    let joints = [
        joint("drive", "prismatic", ["root", "a"], [0.0, 0.0, 0.5], "1 1 0", &limit),
        joint("back", "prismatic", ["a", "b"], [0.1, 0.0, 0.0], "0 1 1", &mimic(-0.5)),
        joint("turn", "revolute", ["b", "c"], [0.0, 0.2, 0.0], "1 0 1", &mimic(0.7)),
    ];
    let (mut sim, id) = built(3, &["root", "a", "b", "c"], &joints);
    check("slides", &mut sim, id, ["c"; 2], None);
    let jacobian = sim.robot(id).jacobian("c", None, None).unwrap();
    assert!(jacobian.iter().enumerate().all(|(k, x)| k % 3 == 0 || *x == 0.0), "followers have no columns: {jacobian}");
}

/// Rows, columns and names: a part, a link, a tool; one row for all; joints outside of the part keep their positions.
#[test]
fn tips() {
    let (mut sim, id) = simulation(3, arm_and_hand());
    let qpos = random_qpos(&sim, id, 3, 5);
    let judge = mujoco_link_poses(&mut sim, id, &qpos, "ee_link");
    let robot = sim.robot(id);
    let (hand, arm) = (robot.joint_ids("hand").unwrap(), robot.joint_ids("arm").unwrap());
    let of_part = |ids: &[JointIndex]| qpos.select(Axis(1), &ids.iter().map(|id| id.0).collect::<Vec<_>>());
    let near = |what: &str, ours: &Array2<f64>, judge: &Array2<f64>| {
        let (far, turned) = max_pose_difference(ours, judge);
        assert_close(what, [far, turned], [0.0; 2], BOUND);
    };
    // The arm ends at the link on its flange; a name may denote a part or a link.
    for tip in [TipFrame::of_part("arm"), TipFrame::of_part("arm").at("ee_link"), "arm".into()] {
        near(&format!("{tip:?}"), &robot.compute_fk(&of_part(&arm), tip, None).unwrap(), &judge);
    }
    near("a link by its name", &robot.compute_fk(&qpos, "ee_link", None).unwrap(), &judge);

    // A finger with the joints of the hand as columns: the arm keeps its positions, and the columns of followers are
    // ignored.
    let finger = TipFrame::of_part("hand").at("left_index_dist");
    let mut columns = of_part(&hand);
    let found = robot.compute_fk(&columns, finger, None).unwrap();
    near("finger", &found, &robot.link_pose("left_index_dist").unwrap());
    for (k, &joint) in hand.iter().enumerate().filter(|(_, joint)| robot.is_mimic(**joint).unwrap()) {
        assert!(robot.mimic_drivers()[joint.0].0 != joint);
        columns.column_mut(k).fill(0.1);
    }
    assert_eq!(robot.compute_fk(&columns, finger, None).unwrap(), found);

    // A tool, one row for two environments.
    let tcp = Pose::new(Vector3::new(0.1, 0.0, 0.2), Vector3::new(0.0, 0.7, 0.0));
    let row = of_part(&arm).slice(s![1..2, ..]).to_owned();
    let tool = robot.compute_fk(&row, TipFrame::of_part("arm").with_tcp(tcp), Some(&[EnvId(2), EnvId(0)])).unwrap();
    assert_eq!(tool.dim(), (2, 7));
    for row in tool.rows() {
        let (far, turned) = pose_error(&pose(row), &(pose_of_row(&judge, 1) * tcp));
        assert_close("tool", [far, turned], [0.0; 2], BOUND);
    }
}
