//! Near singular positions: if neighboring targets have neighboring solutions, the solver finds them.

use super::*;
use kinetoscope::ndarray::ArrayView2;
use kinetoscope::robot::kinematics::{IkCfg, TipFrame};
use kinetoscope::scene::pose::to_row;
use kinetoscope::sim::Robot;
use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};
use std::f64::consts::{FRAC_PI_2, PI};

/// Distances of JOINT5 from the singularity \[rad\].
const NEAR: [f64; 7] = [0.0, 1e-6, -1e-6, 1e-4, -1e-4, 1e-2, -1e-2];
/// Distance of targets \[m\], \[rad\].
const AWAY: (f64, f64) = (1e-3, 2e-3);

/// Solver configurations with one start, and with the default number of starts.
fn solvers() -> [IkCfg; 2] {
    [IkCfg { num_seeds: 1, ..IkCfg::default() }, IkCfg::default()]
}

/// The solution for a target from these positions.
fn solve(robot: &Robot<'_>, tip: TipFrame<'_>, cfg: &IkCfg, target: &Pose, from: &[f64]) -> kinetoscope::sim::IkResult {
    robot.compute_ik(target, tip, cfg, Some(row(from).view()), None).unwrap()
}

/// The pose of the tip at these positions.
fn frame(robot: &Robot<'_>, tip: TipFrame<'_>, q: &[f64]) -> Pose {
    pose_of_row(&robot.compute_fk(&row(q), tip, None).unwrap(), 0)
}

fn largest(a: ArrayView2<'_, f64>, b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn jacobian(robot: &Robot<'_>, tip: TipFrame<'_>, q: &[f64]) -> Matrix6<f64> {
    let jacobian = robot.jacobian(tip, Some(row(q).view()), None).unwrap();
    Matrix6::from_fn(|i, k| jacobian[(0, i, k)])
}

/// A shoulder, an elbow and three axes through one point. With the fifth joint at zero, the fourth and sixth axes are
/// collinear, and the tool cannot rotate about the axis perpendicular to that line and the fifth axis.
fn spherical_wrist() -> (SimulationManager, RobotId) {
    let (links, mut joints) = (["foot", "a", "b", "c", "d", "e", "f"], Vec::new());
    for (k, (z, axis)) in [0.3, 0.0, 0.4, 0.2, 0.2, 0.0].into_iter().zip(["z", "y", "y", "z", "y", "z"]).enumerate() {
        let axis = if axis == "z" { "0 0 1" } else { "0 1 0" };
        let between = [links[k], links[k + 1]];
        joints.push(kinetoscope_testkit::urdf::joint(
            &format!("j{}", k + 1),
            "continuous",
            between,
            [0.0, 0.0, z],
            axis,
            "",
        ));
    }
    built(1, &links, &joints)
}

/// The tilt of the tool's axis against the forearm is a vector of length j5 whose direction rotates with j4. A rotation
/// of the tool by delta at the angle phi to the axis of j5 adds (delta cos phi, delta sin phi) to (j5, 0). j4 turns by
/// the angle between both vectors or, with the opposite sign of j5, by the rest of half a turn. The solver finds the
/// nearer of both, unless they are similar (both within 0.27 of a right angle, which is 1.57): then either. The other
/// joints turn by at most delta, j6 as j4. A final rotation error e is an angle of asin(e / length of the new tilt) at
/// j4; tilts of 2e-3 and 1e-2 change this by less than 1e-3.
#[test]
fn spherical_wrist_turn() {
    let (sim, id) = spherical_wrist();
    let robot = sim.robot(id);
    let tip = TipFrame::of_part("arm").with_tcp(Pose::translation(0.0, 0.0, 0.1));
    let delta = AWAY.1;
    for near in NEAR {
        let q = [0.3, 0.4, 1.1, 0.5, near, -0.4];
        let start = frame(&robot, tip, &q);
        let center = start * nalgebra::Point3::new(0.0, 0.0, -0.1);
        let at_zero = jacobian(&robot, tip, &[q[0], q[1], q[2], q[3], 0.0, q[5]]);
        let [along, between] = [3, 4].map(|k| at_zero.fixed_view::<3, 1>(3, k).into_owned());
        for step in 0..24 {
            let phi = f64::from(step) * PI / 12.0;
            let (tilt, side) = (near + delta * phi.cos(), delta * phi.sin());
            // If the new tilt is zero, any j4 is valid.
            let length = tilt.hypot(side);
            if length < 1e-4 {
                continue;
            }
            let nearer = if tilt == 0.0 { FRAC_PI_2 } else { (side / tilt).atan().abs() };
            let most = if nearer > 1.3 { PI - nearer } else { nearer } + delta;
            let axis = phi.cos() * between - phi.sin() * between.cross(&along);
            let turn = UnitQuaternion::from_scaled_axis(delta * axis);
            let about = Pose::from_parts(
                (center.coords + turn * (start.translation.vector - center.coords)).into(),
                turn * start.rotation,
            );
            for cfg in solvers() {
                let found = solve(&robot, tip, &cfg, &about, &q);
                let what = format!("j5 at {near}, phi {phi:.2}, {} seeds: {found:?}", cfg.num_seeds);
                assert!(found.success[0] && found.seed[0] == 0, "{what}");
                let slack = (found.rotation_error[0] / length).min(1.0).asin() + 1e-3;
                assert!(largest(found.qpos.view(), &q) <= most + slack, "at most {most}: {what}");
                // The start is not a solution.
                assert!(found.iterations[0] > 0, "{what}");
            }
        }
    }
}

/// A bent posture. The axes of JOINT4 and JOINT6 are parallel if `near` is zero, and the axis of JOINT5 is parallel to
/// those of JOINT2 and JOINT3.
fn bent(near: f64) -> [f64; 6] {
    [0.3, 0.3, -1.5, 0.0, near, 0.4]
}

/// A neighbor at joint positions `from + s * way`, with the largest `s` up to 0.3 for which the frame stays within the
/// distance [`AWAY`].
fn neighbor(robot: &Robot<'_>, tip: TipFrame<'_>, from: &[f64], way: &Vector6<f64>) -> (Vec<f64>, Pose) {
    let fk = |s: f64| {
        let q: Vec<f64> = from.iter().zip(way).map(|(q, w)| q + s * w).collect();
        let at = frame(robot, tip, &q);
        (q, at)
    };
    let (_, start) = fk(0.0);
    let is_near = |s: f64| {
        let (far, turned) = pose_error(&fk(s).1, &start);
        far <= AWAY.0 && turned <= AWAY.1
    };
    let (mut low, mut high) = (0.0, 0.3);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if is_near(middle) { low = middle } else { high = middle }
    }
    fk(low)
}

/// The singular direction is a fold. Along the joint direction n that moves the frame least, the position of the frame
/// in the lost direction is a parabola. A target near it has two solutions, about equally far from the vertex, or none.
/// Targets here are made from a solution; descent leads to that solution, or to the other one, which is at most twice
/// as far from the start. One start is enough for all of them.
#[test]
fn nearby_solutions() {
    let (sim, id) = simulation(1, sr5());
    let robot = sim.robot(id);
    let tip = TipFrame::of_part("arm").at("ee_link");
    let svd = jacobian(&robot, tip, &bent(0.0)).svd(false, true);
    // In meters and radians per radian: exactly one direction is lost.
    assert!(svd.singular_values[5] < 1e-9 && svd.singular_values[4] > 0.05, "{:?}", svd.singular_values);
    let least = svd.v_t.unwrap().row(5).transpose();
    let mut farthest = 0.0_f64;
    for near in NEAR {
        let q = bent(near);
        for k in 0..40_u64 {
            let random = |j: usize| 2.0 * KeyedRng::keyed(5, k, &j.to_string()).uniform() - 1.0;
            let way = match k {
                0 => least,
                1 => -least,
                _ => (Vector6::from_fn(|j, _| random(j)) * 0.01 + least * random(7)).normalize(),
            };
            let (there, target) = neighbor(&robot, tip, &q, &way);
            let away = largest(row(&there).view(), &q);
            farthest = farthest.max(away);
            for cfg in solvers() {
                let found = solve(&robot, tip, &cfg, &target, &q);
                let what = format!("JOINT5 at {near:e}, way {k}, a solution at {away}: {found:?}");
                assert!(found.success[0] && found.seed[0] == 0, "{what}");
                assert!(largest(found.qpos.view(), &q) <= 2.0 * away + 1e-4, "{what}");
            }
        }
    }
    // JOINT4 and JOINT6 turn far for a small motion of the frame: the axes are 0.136 m apart, 0.136 t² / 2 is 1 mm at
    // t = 0.12.
    assert!((0.08..0.15).contains(&farthest), "{farthest}");
}

/// Some targets have no solution nearby, on the side to which the arm does not bend. One start reports failure; more
/// starts find a solution, which may be another posture of the arm. A solution from one start is within twice the 0.12
/// rad of the fold, and more starts give the same.
#[test]
fn far_solutions() {
    let (sim, id) = simulation(1, sr5());
    let robot = sim.robot(id);
    let tip = TipFrame::of_part("arm").at("ee_link");
    let (mut nearby, mut far_away) = (0, 0);
    for near in NEAR {
        let q = bent(near);
        let start = frame(&robot, tip, &q);
        for k in 0..12 {
            let axis = |k: usize| Vector3::ith(k % 3, if k.is_multiple_of(2) { 1.0 } else { -1.0 });
            let turn = UnitQuaternion::from_scaled_axis(AWAY.1 * axis(k));
            let at = start.translation.vector + AWAY.0 * axis(k / 2 + k);
            let target = Pose::from_parts(at.into(), turn * start.rotation);
            let [one, many] = solvers().map(|cfg| solve(&robot, tip, &cfg, &target, &q));
            assert!(many.success[0], "{near:e}, {k}: {many:?}");
            if one.success[0] {
                nearby += 1;
                assert!(largest(one.qpos.view(), &q) < 0.25 && many.qpos == one.qpos, "{near:e}, {k}: {one:?}");
            } else {
                // A target slightly out of reach may be within the tolerances.
                far_away += usize::from(largest(many.qpos.view(), &q) > 0.5);
            }
        }
    }
    assert!(nearby > 20 && far_away > 0, "{nearby} {far_away}");
}

/// Solves poses between two ends one after the other, each from the previous solution; returns the longest step of a
/// joint.
fn longest_step(robot: &Robot<'_>, tip: TipFrame<'_>, ends: [&[f64]; 2]) -> f64 {
    let [from, to] = ends.map(|q| frame(robot, tip, q));
    let (mut q, mut longest) = (ends[0].to_vec(), 0.0_f64);
    for step in 1..=100 {
        let target = from.lerp_slerp(&to, f64::from(step) / 100.0);
        let found = solve(robot, tip, &IkCfg::default(), &target, &q);
        assert!(found.success[0] && found.seed[0] == 0, "step {step}: {found:?}");
        longest = longest.max(largest(found.qpos.view(), &q));
        q = found.qpos.row(0).to_vec();
    }
    longest
}

/// JOINT5 passes through zero, with the other joints equal at both ends. The bundled arm follows with 6 mrad in each of
/// 100 steps, and with less than three times that. A spherical wrist that does not hit the singular position exactly
/// has to turn by half a turn on the way: no step exceeds the necessary one, a right angle or the rest of half a turn.
#[test]
fn lines() {
    let (sim, id) = simulation(1, sr5());
    let tip = TipFrame::of_part("arm").at("ee_link");
    for [from, to] in [[-0.3, 0.3], [0.3, -0.3]] {
        let longest = longest_step(&sim.robot(id), tip, [&bent(from), &bent(to)]);
        assert!((0.006..0.018).contains(&longest), "{longest}");
    }
    let (sim, id) = spherical_wrist();
    let tip = TipFrame::of_part("arm").with_tcp(Pose::translation(0.0, 0.0, 0.1));
    for j4 in [0.5, 0.55] {
        let ends = [&[0.3, 0.4, 1.1, 0.5, -0.3, -0.4][..], &[0.3, 0.4, 1.1, j4, 0.3, -0.4]];
        let longest = longest_step(&sim.robot(id), tip, ends);
        assert!(longest < PI - 1.3 + 0.01, "{longest}");
    }
}

/// At half a turn, both directions of rotation are equally long: of the base, and of each axis of the wrist, with the
/// other joints unchanged. Each of these targets has a solution: that half a turn.
#[test]
fn half_a_turn() {
    let (mut sim, id) = simulation(1, sr5());
    let tip = TipFrame::of_part("arm").at("ee_link");
    let q = [0.3, 0.3, -1.5, 0.2, 0.6, 0.4];
    let start = frame(&sim.robot(id), tip, &q);
    for joint in [0, 3, 4, 5] {
        let mut there = q;
        there[joint] -= PI;
        let target = frame(&sim.robot(id), tip, &there);
        assert!((start.rotation.angle_to(&target.rotation) - PI).abs() < 1e-6);
        let found = solve(&sim.robot(id), tip, &IkCfg::default(), &target, &q);
        assert!(found.success[0], "joint {joint}: {found:?}");
        let off = max_pose_difference(&mujoco_link_poses(&mut sim, id, &found.qpos, "ee_link"), &row(&to_row(&target)));
        assert!(reaches(off), "joint {joint}: {off:?}");
        assert!(largest(found.qpos.view(), &q) > 1.0, "the control: it went somewhere");
    }
}
