//! What a target leaves free goes to the posture asked for.

use crate::kinematics::robots::*;
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use nalgebra::DMatrix;

const READY: [f64; 7] = [0.0, -0.8, 0.0, -2.3, 0.0, 1.6, 0.8];

fn distance(qpos: &Array2<f64>) -> f64 {
    qpos.iter().zip(READY).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// The motion of the joints that leaves the frame where it is: the singular vector of the Jacobian's missing singular
/// value; and the smallest one that it has.
fn self_motion(sim: &SimulationManager, id: RobotId, qpos: &Array2<f64>) -> (Vec<f64>, f64) {
    let jacobian = sim.robot(id).jacobian("arm", Some(qpos.view()), None).unwrap();
    let square = DMatrix::from_fn(7, 7, |row, column| if row < 6 { jacobian[(0, row, column)] } else { 0.0 });
    let svd = square.svd(false, true);
    let mut values: Vec<f64> = svd.singular_values.iter().copied().collect();
    values.sort_by(f64::total_cmp);
    (svd.v_t.unwrap().row(svd.singular_values.imin()).iter().copied().collect(), values[1])
}

/// An arm of seven axes keeps its pose and comes as near to the posture as it can: on the curve of positions that reach
/// the target the distance has no slope any more, unless a limit is in the way, or a singular position, where that
/// curve has a bend that steps of finite length do not follow.
#[test]
fn seven_axes_come_nearer_to_a_posture() {
    let (mut sim, id) = simulation(1, seven_axes());
    let plain = IkCfg::default();
    let with = IkCfg { posture: Some(Posture::at(READY)), max_iterations: 1000, ..Default::default() };
    let limits = sim.robot(id).qpos_limits();
    let (mut nearer, mut still, mut stuck) = (0, 0, 0);
    for row in random_qpos(&sim, id, 100, 41).rows() {
        let there = row.to_owned().insert_axis(Axis(0));
        sim.robot_mut(id).write_qpos(&there, None, None).unwrap();
        let target = sim.robot(id).link_pose("link8").unwrap();
        sim.reset(None).unwrap();
        let [a, b] = [&plain, &with].map(|cfg| sim.robot(id).compute_ik(&target, "arm", cfg, None, None).unwrap());
        assert!(a.success[0] && b.success[0], "{a:?} {b:?}");
        sim.robot_mut(id).write_qpos(&b.qpos, None, None).unwrap();
        let (far, turned) = apart(&sim.robot(id).link_pose("link8").unwrap(), &target);
        assert!(far <= 1e-4 && turned <= 1e-3, "the posture costs the target: {far} {turned}");
        assert!(distance(&b.qpos) <= distance(&a.qpos) + 1e-3, "{} {}", distance(&b.qpos), distance(&a.qpos));
        nearer += usize::from(distance(&b.qpos) < distance(&a.qpos) - 0.05);

        let room = |k: usize, q: f64| (q - limits[(0, k, 0)]).min(limits[(0, k, 1)] - q);
        let at_limit = b.qpos.iter().enumerate().any(|(k, &q)| room(k, q) < 1e-3);
        let [before, slope] = [&a.qpos, &b.qpos].map(|qpos| {
            let (along, _) = self_motion(&sim, id, qpos);
            (0..7).map(|k| along[k] * (READY[k] - qpos[(0, k)])).sum::<f64>()
        });
        if at_limit || self_motion(&sim, id, &b.qpos).1 < 5e-3 {
            stuck += 1;
        } else {
            assert!(slope.abs() < 1e-3, "it could go on: {slope} (without a posture {before})");
            still += usize::from(before.abs() > 1e-2);
        }
    }
    println!("{nearer} of 100 are nearer by more than 0.05 rad; {stuck} end at a limit or a singular position");
    assert!(nearer >= 50 && still >= 30 && stuck <= 40, "{nearer} {still} {stuck}");
}

/// A small gain goes a small part of the way; six axes have nothing to give.
#[test]
fn gains_and_arms_without_freedom() {
    let (sim, id) = simulation(1, seven_axes());
    let target = sim.robot(id).compute_fk(&random_qpos(&sim, id, 1, 41), "arm", None).unwrap();
    let solve = |posture: Option<Posture>| {
        let found =
            sim.robot(id).compute_ik(&target, "arm", &IkCfg { posture, ..Default::default() }, None, None).unwrap();
        assert!(found.success[0], "{found:?}");
        distance(&found.qpos)
    };
    let of_gain = |gain| Some(Posture { gain, ..Posture::at(READY) });
    let (none, small, whole) = (solve(None), solve(of_gain(1e-3)), solve(of_gain(1.0)));
    assert!(none - 1e-3 > small && small > whole + 0.1, "{none} {small} {whole}");

    let (sim, id) = simulation(1, six_axes());
    let there = random_qpos(&sim, id, 1, 3);
    let target = sim.robot(id).compute_fk(&there, "arm", None).unwrap();
    let posture = Some(Posture::at([0.0; 6]));
    let [a, b] = [IkCfg::default(), IkCfg { posture, ..Default::default() }]
        .map(|cfg| sim.robot(id).compute_ik(&target, "arm", &cfg, None, None).unwrap());
    for (a, b) in a.qpos.iter().zip(&b.qpos) {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
}
