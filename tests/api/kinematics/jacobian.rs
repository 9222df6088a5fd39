//! Jacobians are MuJoCo's `mj_jac`, and the slopes of poses.

use crate::kinematics::robots::*;
use kinetoscope::ndarray::{Array2, Array3, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::ObjectKind;
use nalgebra::Vector3;

/// `mj_jac` at the origin of a frame on a link, in every environment: the columns of all joints, those of followers
/// added to the joint they follow.
fn judge(sim: &SimulationManager, id: RobotId, body: &str, point: &Array2<f64>) -> Array3<f64> {
    let robot = sim.robot(id);
    let (model, nv) = (sim.batch().model(), sim.batch().model().nv());
    let body = model.id(ObjectKind::Body, &format!("{}/{body}", robot.uid())).unwrap();
    let mut jacobian = Array3::zeros((sim.num_envs(), 6, robot.dof()));
    let (mut linear, mut angular) = (vec![0.0; 3 * nv], vec![0.0; 3 * nv]);
    for env in 0..sim.num_envs() {
        let at = [point[(env, 0)], point[(env, 1)], point[(env, 2)]];
        sim.batch().read(env, |env| env.data().jacobian(body, at, &mut linear, &mut angular)).unwrap();
        for (joint, (driver, ratio, _)) in robot.mimic_drivers().into_iter().enumerate() {
            let name = format!("{}/{}", robot.uid(), robot.joint_names()[joint]);
            let dof = model.jnt_dofadr()[model.id(ObjectKind::Joint, &name).unwrap()] as usize;
            for axis in 0..3 {
                jacobian[(env, axis, driver.0)] += ratio * linear[axis * nv + dof];
                jacobian[(env, 3 + axis, driver.0)] += ratio * angular[axis * nv + dof];
            }
        }
    }
    jacobian
}

fn largest(a: &Array3<f64>, b: &Array3<f64>) -> f64 {
    assert_eq!(a.dim(), b.dim());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Columns as central differences of poses over 2 h = 2e-4: they are wrong by h² / 6 times third derivatives, which for
/// arms of a metre are of about 1, so by 2e-9, and by 1e-16 / h of rounding.
fn differences(sim: &SimulationManager, id: RobotId, tip: Tip<'_>, qpos: &Array2<f64>) -> Array3<f64> {
    const H: f64 = 1e-4;
    let robot = sim.robot(id);
    let mut slopes = Array3::zeros((sim.num_envs(), 6, qpos.ncols()));
    for joint in 0..qpos.ncols() {
        let moved = |by: f64| {
            let mut qpos = qpos.clone();
            qpos.column_mut(joint).iter_mut().for_each(|q| *q += by);
            robot.compute_fk(&qpos, tip, None).unwrap()
        };
        let (after, before) = (moved(H), moved(-H));
        for env in 0..sim.num_envs() {
            let (a, b) = (pose(after.row(env)), pose(before.row(env)));
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

/// Both judges, for a frame on a link that is part of a body.
fn check(name: &str, sim: &mut SimulationManager, id: RobotId, link: &str, body: &str) {
    let qpos = random_qpos(sim, id, sim.num_envs(), 9);
    let tcp = Pose::new(Vector3::new(0.07, -0.02, 0.11), Vector3::new(0.3, 0.2, -0.4));
    let tip = Tip::of_link(link).with_tcp(tcp);
    let ours = sim.robot(id).jacobian(tip, Some(qpos.view()), None).unwrap();
    sim.robot_mut(id).write_qpos(&qpos, None, None).unwrap();
    assert_eq!(sim.robot(id).jacobian(tip, None, None).unwrap(), ours, "where the joints are");
    let origin = sim.robot(id).compute_fk(&qpos, tip, None).unwrap();
    let mujoco = largest(&ours, &judge(sim, id, body, &origin));
    let slopes = largest(&ours, &differences(sim, id, tip, &qpos));
    // The control: at another point it is another Jacobian.
    let elsewhere = largest(&ours, &judge(sim, id, body, &sim.robot(id).link_pose(link).unwrap()));
    println!("{name}: within {mujoco:.1e} of mj_jac, {slopes:.1e} of differences; {elsewhere:.1e} without the tool");
    assert!(mujoco < 1e-12 && slopes < 1e-7 && elsewhere > 1e-3, "{name}: {mujoco} {slopes} {elsewhere}");
}

#[test]
fn jacobians_are_mujocos() {
    let tilted = Pose::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.4, -1.1, 0.3));
    for (name, cfg, link, body) in [
        ("SR5", sr5(), "ee_link", "link6"),
        ("seven axes", seven_axes(), "link8", "link7"),
        ("six axes", six_axes(), "tool0", "wrist_3_link"),
        ("SR5 and hand", arm_and_hand(), "left_index_dist", "left_index_dist"),
    ] {
        let (mut sim, id) = simulation(4, RobotCfg { init_pose: tilted, ..cfg });
        check(name, &mut sim, id, link, body);
    }
}

#[test]
fn jacobians_of_a_robot_whose_root_moves() {
    let urdf = UrdfCfg::single(assets::path("quadruped/quadruped.urdf").unwrap());
    let (mut sim, id) = simulation(2, RobotCfg { urdf, fix_base: false, ..Default::default() });
    let roots = array![[1.0, 2.0, 3.0, 0.5, 0.5, -0.5, 0.5], [-4.0, 0.5, 1.0, 0.6, 0.0, 0.8, 0.0]];
    sim.robot_mut(id).write_root_pose(&roots, None).unwrap();
    check("quadruped", &mut sim, id, "LF_FOOT", "LF_SHANK");
}

/// A slide, a follower that slides against it at half its speed, and a follower that turns.
#[test]
fn slides_and_followers() {
    let links = ["root", "a", "b", "c"];
    let limit = "<limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/>";
    let mimic = |ratio: f64| format!("{limit}<mimic joint=\"drive\" multiplier=\"{ratio}\" offset=\"0.2\"/>");
    let joints = [
        joint("drive", "prismatic", ["root", "a"], "0 0 0.5", "1 1 0", limit),
        joint("back", "prismatic", ["a", "b"], "0.1 0 0", "0 1 1", &mimic(-0.5)),
        joint("turn", "revolute", ["b", "c"], "0 0.2 0", "1 0 1", &mimic(0.7)),
    ];
    let dir = written(&links, &joints);
    let (mut sim, id) =
        simulation(3, RobotCfg { urdf: UrdfCfg::single(dir.path().join("r.urdf")), ..Default::default() });
    check("slides", &mut sim, id, "c", "c");
    let jacobian = sim.robot(id).jacobian("c", None, None).unwrap();
    assert!(jacobian.iter().enumerate().all(|(k, x)| k % 3 == 0 || *x == 0.0), "followers have no columns: {jacobian}");
}
