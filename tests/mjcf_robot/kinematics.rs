//! Forward and inverse kinematics, judged by MuJoCo.

use super::{ODD, empty, passive, random_qpos, robot};
use kinetoscope::ndarray::{Array2, Axis, s};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_row;
use kinetoscope::sim::mj::{Data, ObjectKind};

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
    let mut farthest = 0.0f64;
    for qpos in rows.axis_chunks_iter(Axis(0), 2) {
        let computed = sim.robot(id).compute_link_fk(qpos, None).unwrap();
        assert_eq!(computed.dim(), (2, links.len(), 7));
        sim.robot_mut(id).write_qpos(qpos, None, None).unwrap();
        let read = sim.robot(id).get_link_poses();
        for env in 0..2 {
            for (link, name) in links.iter().enumerate() {
                let theirs = sim.batch().read(env, |env| place(env.data(), &format!("odd/{name}")));
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

/// Columns of the Jacobian are differences of poses that MuJoCo gives: 1e-6 apart, so right to 1e-6 of lengths below 1 m.
#[test]
fn jacobians_are_differences_of_poses() {
    let mut sim = empty(1);
    let id = sim.add_robot(passive("odd", ODD)).unwrap();
    let qpos = random_qpos(&sim, id, 1);
    let jacobian = sim.robot(id).jacobian("tip", Some(qpos.view()), None).unwrap();
    let at = |sim: &mut SimulationManager, qpos: &Array2<f64>| {
        sim.robot_mut(id).write_qpos(qpos, None, None).unwrap();
        sim.batch().read(0, |env| place(env.data(), "odd/tip"))
    };
    for joint in 0..7 {
        let step = 1e-6;
        let mut ends = [qpos.clone(), qpos.clone()];
        ends[0][(0, joint)] -= step;
        ends[1][(0, joint)] += step;
        let [low, high] = ends.map(|qpos| at(&mut sim, &qpos));
        for k in 0..3 {
            let slope = (high[k] - low[k]) / (2.0 * step);
            assert!((jacobian[(0, k, joint)] - slope).abs() < 1e-6, "joint {joint}: {slope}");
        }
    }
    assert!(jacobian.iter().any(|x| x.abs() > 0.3));
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
