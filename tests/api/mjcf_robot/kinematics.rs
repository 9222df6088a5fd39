//! Forward and inverse kinematics, compared with MuJoCo and the file alone, independent of the written scene.

use super::*;
use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::ObjectKind;
use kinetoscope::ndarray::{Axis, s};
use kinetoscope::robot::kinematics::{IkCfg, TipFrame};
use kinetoscope::scene::pose::{from_row, from_xyz_rpy, to_row};
use kinetoscope_testkit::worlds::{pose_error, pose_of_row};

/// MuJoCo's pose of a body or a site.
fn mujoco_pose(data: &Data, name: &str) -> [f64; 7] {
    let model = data.model();
    match model.id(ObjectKind::Body, name) {
        Some(body) => {
            let (p, q) = (&data.xpos()[3 * body..], &data.xquat()[4 * body..]);
            [p[0], p[1], p[2], q[0], q[1], q[2], q[3]]
        }
        None => {
            let site = model.id(ObjectKind::Site, name).unwrap();
            let p = &data.site_xpos()[3 * site..];
            let matrix = nalgebra::Matrix3::from_row_slice(&data.site_xmat()[9 * site..9 * site + 9]);
            let q = nalgebra::UnitQuaternion::from_matrix(&matrix);
            [p[0], p[1], p[2], q.w, q.i, q.j, q.k]
        }
    }
}

/// The file alone, with its joints at the given positions.
fn file_at(joints: &[String], qpos: &[f64]) -> Data {
    let mut data = Data::new(&mj::compile(ODD, &[]).unwrap().into_model()).unwrap();
    for (joint, &value) in joints.iter().zip(qpos) {
        let joint = data.model().id(ObjectKind::Joint, joint).unwrap();
        let address = data.model().jnt_qposadr()[joint] as usize;
        data.qpos_mut()[address] = value;
    }
    data.forward().unwrap();
    data
}

/// Computed and read poses equal MuJoCo's poses of bodies and sites; a rotated and translated file world moves all of
/// them.
#[test]
fn links() {
    let init_pose = from_xyz_rpy([0.4, 0.2, -0.1], [0.3, -0.2, 1.0]);
    let (mut sim, id) = with(2, RobotCfg { init_pose, ..passive(robot("odd", ODD)) });
    let links: Vec<String> = sim.robot(id).link_names().into_iter().map(String::from).collect();
    let joints = sim.robot(id).joint_names().to_vec();
    let mut farthest = 0.0f64;
    for qpos in random_qpos(&sim, id, 40).axis_chunks_iter(Axis(0), 2) {
        let computed = sim.robot(id).compute_link_fk(qpos, None).unwrap();
        assert_eq!(computed.dim(), (2, links.len(), 7));
        sim.robot_mut(id).write_qpos(qpos, None, None).unwrap();
        let read = sim.robot(id).link_poses();
        for env in 0..2 {
            let reference = file_at(&joints, &qpos.row(env).to_vec());
            for (link, name) in links.iter().enumerate() {
                let theirs = init_pose * from_row(&mujoco_pose(&reference, name));
                for ours in [&computed, &read] {
                    let (far, turned) =
                        pose_error(&pose_of_row(&ours.slice(s![env, link..=link, ..]).to_owned(), 0), &theirs);
                    assert!(far < 1e-9 && turned < 1e-9, "{name}: {far} m, {turned} rad");
                }
                farthest = farthest.max((theirs.translation.x - computed[(0, 0, 0)]).abs());
                let named = sim.robot(id).link_pose(name).unwrap();
                assert_eq!(named.row(env), read.slice(s![env, link, ..]));
            }
        }
    }
    assert!(farthest > 0.2, "{farthest}");
    // The root has its pose from the file.
    let [root, now] = [sim.robot(id).default_root_pose(), sim.robot(id).root_pose()];
    assert!(pose_error(&pose_of_row(&root, 0), &pose_of_row(&now, 0)).0 < 1e-12);
}

/// Jacobians equal `mj_jac` of the file alone at the tip.
#[test]
fn jacobians() {
    let (sim, id) = with(1, passive(robot("odd", ODD)));
    let joints = sim.robot(id).joint_names().to_vec();
    for row in random_qpos(&sim, id, 10).axis_iter(Axis(0)) {
        let jacobian = sim.robot(id).jacobian("tip", Some(row.insert_axis(Axis(0))), None).unwrap();
        let judge = file_at(&joints, &row.to_vec());
        let (model, nv) = (judge.model(), judge.model().nv());
        let (mut linear, mut angular) = (vec![0.0; 3 * nv], vec![0.0; 3 * nv]);
        let (tip, hand) = (mujoco_pose(&judge, "tip"), model.id(ObjectKind::Body, "hand").unwrap());
        judge.jacobian(hand, [tip[0], tip[1], tip[2]], &mut linear, &mut angular).unwrap();
        for (joint, name) in joints.iter().enumerate() {
            let dof = model.jnt_dofadr()[model.id(ObjectKind::Joint, name).unwrap()] as usize;
            for k in 0..3 {
                for (ours, theirs) in [(jacobian[(0, k, joint)], &linear), (jacobian[(0, 3 + k, joint)], &angular)] {
                    let theirs = theirs[k * nv + dof];
                    assert!((ours - theirs).abs() < 1e-12, "{name}: {ours}, not {theirs}");
                }
            }
        }
        assert!(largest(&jacobian) > 0.3);
    }
}

/// Random reachable poses of the tip are solved from the start, and MuJoCo confirms the solutions.
#[test]
fn reachable_poses() {
    const TARGETS: usize = 300;
    let control_parts = vec![("arm".to_string(), vec![".*".to_string()])];
    let (mut sim, id) = with(1, RobotCfg { control_parts, ..robot("odd", ODD) });
    let rows = random_qpos(&sim, id, TARGETS);
    let start = sim.robot(id).default_qpos();
    let at = |sim: &mut SimulationManager, qpos: &Array2<f64>| {
        sim.robot_mut(id).write_qpos(qpos, None, None).unwrap();
        sim.batch().read(0, |env| from_row(&mujoco_pose(env.data(), "odd/tip")))
    };
    let mut solved = 0;
    for k in 0..TARGETS {
        let target = at(&mut sim, &rows.select(Axis(0), &[k]));
        let far_away = pose_error(&at(&mut sim, &start), &target).0;
        // The only site on the hand is the tip of the part.
        let wanted = row(to_row(&target));
        let found = sim.robot(id).compute_ik(&wanted, TipFrame::of_part("arm"), &IkCfg::default(), None, None).unwrap();
        let (far, turned) = pose_error(&at(&mut sim, &found.qpos), &target);
        assert_eq!(far <= 1e-4 && turned <= 1e-3, found.success[0], "{far} m, {turned} rad");
        solved += usize::from(found.success[0]);
        assert!(k + 1 < TARGETS || far_away > 0.01, "the control: the start is not a solution of the last one");
    }
    println!("{solved} of {TARGETS} poses found");
    assert!(solved >= TARGETS * 99 / 100, "{solved} of {TARGETS}");
}
