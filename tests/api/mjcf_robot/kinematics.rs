//! Forward and inverse kinematics, judged by MuJoCo with the file alone: not by the scene that is written from it.

use super::{ODD, empty, passive, random_qpos, robot};
use kinetoscope::ndarray::{Array2, Axis, s};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_row, to_row};
use kinetoscope::sim::mj::{self, Data, ObjectKind};

/// Distance \[m\] and angle \[rad\] between two poses.
fn apart(a: &[f64], b: &[f64]) -> (f64, f64) {
    let (a, b) = ([0, 1, 2, 3, 4, 5, 6].map(|k| a[k]), [0, 1, 2, 3, 4, 5, 6].map(|k| b[k]));
    let (a, b) = (from_row(&a), from_row(&b));
    ((a.translation.vector - b.translation.vector).norm(), a.rotation.angle_to(&b.rotation))
}

/// A body or a site of the robot, as MuJoCo has it.
fn place(data: &Data, name: &str) -> [f64; 7] {
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

/// The file alone, with its joints somewhere.
fn alone(joints: &[String], qpos: &[f64]) -> Data {
    let mut data = Data::new(&mj::compile(ODD, &[]).unwrap().into_model()).unwrap();
    for (joint, &value) in joints.iter().zip(qpos) {
        let joint = data.model().id(ObjectKind::Joint, joint).unwrap();
        let address = data.model().jnt_qposadr()[joint] as usize;
        data.qpos_mut()[address] = value;
    }
    data.forward().unwrap();
    data
}

/// What we compute of positions is where MuJoCo puts bodies and sites; what is read of the state too. A turned and moved
/// world of the file turns and moves all. Angles of a few roundings show as their square root in the cosine: `angle_to` uses
/// the arctangent, so 1e-9 is far above them.
#[test]
fn links_are_where_mujoco_has_bodies_and_sites() {
    let mut sim = empty(2);
    let pose = kinetoscope::scene::pose::from_xyz_rpy([0.4, 0.2, -0.1], [0.3, -0.2, 1.0]);
    let id = sim.add_robot(RobotCfg { init_pose: pose, ..passive("odd", ODD) }).unwrap();
    let rows = random_qpos(&sim, id, 40);
    let links: Vec<String> = sim.robot(id).link_names().into_iter().map(String::from).collect();
    let joints = sim.robot(id).joint_names().to_vec();
    let mut farthest = 0.0f64;
    for qpos in rows.axis_chunks_iter(Axis(0), 2) {
        let computed = sim.robot(id).compute_link_fk(qpos, None).unwrap();
        assert_eq!(computed.dim(), (2, links.len(), 7));
        sim.robot_mut(id).write_qpos(qpos, None, None).unwrap();
        let read = sim.robot(id).get_link_poses();
        let judges = [0, 1].map(|env| alone(&joints, &qpos.row(env).to_vec()));
        for (env, judge) in judges.iter().enumerate() {
            for (link, name) in links.iter().enumerate() {
                let theirs = to_row(&(pose * from_row(&place(judge, name))));
                for ours in [&computed, &read] {
                    let (far, turned) = apart(ours.slice(s![env, link, ..]).to_vec().as_slice(), &theirs);
                    assert!(far < 1e-9 && turned < 1e-9, "{name}: {far} m, {turned} rad");
                }
                farthest = farthest.max((theirs[0] - computed[(0, 0, 0)]).abs());
                let named = sim.robot(id).link_pose(name).unwrap();
                assert_eq!(named.row(env), read.slice(s![env, link, ..]));
            }
        }
    }
    assert!(farthest > 0.2, "{farthest}");
    // The root stands where the file has it in its world.
    let root = sim.robot(id).get_default_root_pose();
    assert!(apart(root.row(0).as_slice().unwrap(), sim.robot(id).get_root_pose().row(0).as_slice().unwrap()).0 < 1e-12);
}

/// Jacobians are `mj_jac` of the file alone at the tip, and differences of the poses that it has there: over 2 h = 2e-4 wrong
/// by h² / 6 times third derivatives of about 1, so by 2e-9, and by 1e-16 / h of rounding.
#[test]
fn jacobians_are_mujocos() {
    const H: f64 = 1e-4;
    let mut sim = empty(1);
    let id = sim.add_robot(passive("odd", ODD)).unwrap();
    let joints = sim.robot(id).joint_names().to_vec();
    for row in random_qpos(&sim, id, 10).axis_iter(Axis(0)) {
        let qpos = row.insert_axis(Axis(0)).to_owned();
        let jacobian = sim.robot(id).jacobian("tip", Some(qpos.view()), None).unwrap();
        let judge = alone(&joints, &row.to_vec());
        let (model, nv) = (judge.model(), judge.model().nv());
        let (mut linear, mut angular) = (vec![0.0; 3 * nv], vec![0.0; 3 * nv]);
        let tip = place(&judge, "tip");
        let hand = model.id(ObjectKind::Body, "hand").unwrap();
        judge.jacobian(hand, [tip[0], tip[1], tip[2]], &mut linear, &mut angular).unwrap();
        for (joint, name) in joints.iter().enumerate() {
            let dof = model.jnt_dofadr()[model.id(ObjectKind::Joint, name).unwrap()] as usize;
            let moved = |by: f64| {
                let mut qpos = row.to_vec();
                qpos[joint] += by;
                from_row(&place(&alone(&joints, &qpos), "tip"))
            };
            let (low, high) = (moved(-H), moved(H));
            let slope = (high.translation.vector - low.translation.vector) / (2.0 * H);
            let turn = (high.rotation * low.rotation.inverse()).scaled_axis() / (2.0 * H);
            for k in 0..3 {
                let ours = [jacobian[(0, k, joint)], jacobian[(0, 3 + k, joint)]];
                let theirs = [linear[k * nv + dof], angular[k * nv + dof]];
                for ((ours, theirs), slope) in ours.into_iter().zip(theirs).zip([slope[k], turn[k]]) {
                    assert!((ours - theirs).abs() < 1e-12, "{name}: {ours}, not {theirs}");
                    assert!((ours - slope).abs() < 1e-7, "{name}: {ours}, not {slope}");
                }
            }
        }
        assert!(jacobian.iter().any(|x| x.abs() > 0.3));
    }
}

/// Random reachable poses of the tip are found from the start, and MuJoCo says that they are.
#[test]
fn reachable_poses_are_found() {
    const TARGETS: usize = 300;
    let mut sim = empty(1);
    let arm = vec![("arm".to_string(), vec![".*".to_string()])];
    let id = sim.add_robot(RobotCfg { control_parts: arm, ..robot("odd", ODD) }).unwrap();
    let rows = random_qpos(&sim, id, TARGETS);
    let start = sim.robot(id).get_default_qpos();
    let at = |sim: &mut SimulationManager, qpos: &Array2<f64>| {
        sim.robot_mut(id).write_qpos(qpos, None, None).unwrap();
        sim.batch().read(0, |env| place(env.data(), "odd/tip"))
    };
    let mut solved = 0;
    for row in rows.axis_iter(Axis(0)) {
        let target = at(&mut sim, &row.insert_axis(Axis(0)).to_owned());
        at(&mut sim, &start);
        let wanted = Array2::from_shape_vec((1, 7), target.to_vec()).unwrap();
        // The only site that hangs on the hand is the end of the part.
        let found = sim.robot(id).compute_ik(&wanted, Tip::of_part("arm"), &IkCfg::default(), None, None).unwrap();
        let (far, turned) = apart(&at(&mut sim, &found.qpos), &target);
        let right = far <= 1e-4 && turned <= 1e-3;
        assert_eq!(right, found.success[0], "{far} m, {turned} rad");
        solved += usize::from(right);
    }
    println!("{solved} of {TARGETS} poses found");
    assert!(solved >= TARGETS * 99 / 100, "{solved} of {TARGETS}");
    // The control: the start is not a solution of the last one.
    let last = at(&mut sim, &rows.select(Axis(0), &[TARGETS - 1]));
    assert!(apart(&at(&mut sim, &start), &last).0 > 0.01);
}
