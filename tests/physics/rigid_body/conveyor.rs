//! SimBenchmark's rolling test: a box slides on the ground, pulled by F, and balls roll on its back. With f₁ = μ₁ (M + n m) g
//! under the box and f₂ between it and each ball: M a = F - f₁ - n f₂, m b = f₂, 2/5 m r² α = f₂ r, a = b + r α = 7/2 f₂/m.
//! So f₂ = (F - f₁)/(7/2 M/m + n), b = f₂/m and a = 7/2 b, as long as f₂ < μ₂ m g. With less friction the balls slip: b = μ₂ g
//! and M a = F - f₁ - n μ₂ m g. (MuJoCo takes the larger friction of two that touch: the box has none, the ground and the
//! balls have μ₁ and μ₂.)
//!
//! (SimBenchmark has 25 balls and an oblique pull. Source: leggedrobotics, SimBenchmark, "Rolling test".)
//!
//! Tolerance: what slides has friction μ N at every step, and N is weight but for the momentum upwards that soft contacts give
//! and take (law `sliding_block`): with the mean accelerations c upwards, forces along are off by μ₁ (M c + m Σ c) under the
//! box and by μ₂ m c under a ball that slips. Where balls roll, the arm of their friction is shorter by half of the depth, as
//! in `rolling_sphere`.

use super::soft_contact::depth;
use crate::lab::*;
use crate::law::law;
use kinetoscope::prelude::*;
use nalgebra::Vector3;

const BOX: f64 = 10.0;
const BALL: f64 = 1.0;
const RADIUS: f64 = 0.5;
const FRICTION: [f64; 2] = [0.4, 0.8];
/// Too little for the balls to roll: they would need 0.066.
const SLIPPERY: f64 = 0.03;
const PULL: f64 = 80.0;
const BALLS: usize = 4;
/// When the means begin and end, after the pull has begun \[s\]: what hops as it begins to slide has settled.
const FROM: f64 = 0.8;
const UNTIL: f64 = 1.6;
/// The solver ends where a step gains less than this \[m/s²\].
const SOLVER: f64 = 1e-6;

/// Mean accelerations between [`FROM`] and [`UNTIL`].
struct Pulled {
    /// Of the box along the pull, and upwards.
    board: [f64; 2],
    /// Means over the balls.
    ball: [f64; 2],
}

fn pulled(friction_of_balls: f64, mass: f64) -> Pulled {
    let mut lab = Lab::new(slope(0.0, FRICTION[0]));
    let board = lab.object(RigidObjectCfg {
        uid: "board".into(),
        friction: Some([0.0; 3]),
        shape: ObjectShape::Box { size: [16.0, 16.0, 0.5] },
        mass: Some(mass),
        init_pose: Pose::translation(0.0, 0.0, 0.25),
        ..RigidObjectCfg::default()
    });
    let balls: Vec<ObjectId> = (0..BALLS)
        .map(|k| {
            let side = |bit: usize| if k >> bit & 1 == 1 { 2.0 } else { -2.0 };
            lab.object(RigidObjectCfg {
                uid: format!("ball {k}"),
                shape: ObjectShape::Sphere { radius: RADIUS },
                mass: Some(BALL),
                friction: Some([friction_of_balls, 0.0, 0.0]),
                init_pose: Pose::translation(side(0), side(1), 0.5 + RADIUS),
                ..RigidObjectCfg::default()
            })
        })
        .collect();
    let along = Vector3::new(0.5, 0.75_f64.sqrt(), 0.0);
    lab.run(0.5);
    let velocity = |lab: &Lab, id: ObjectId| {
        let velocity = lab.body(id).velocity;
        [velocity.dot(&along), velocity.z]
    };
    let all = |lab: &Lab| {
        let balls = balls.iter().map(|&ball| velocity(lab, ball));
        let sum = balls.fold([0.0; 2], |sum, v| [sum[0] + v[0], sum[1] + v[1]]);
        [velocity(lab, board), sum.map(|v| v / BALLS as f64)]
    };
    lab.push(board, PULL * along, Vector3::zeros());
    lab.run(FROM);
    let before = all(&lab);
    lab.run(UNTIL - FROM);
    let after = all(&lab);
    let gained = |k: usize| [0, 1].map(|axis: usize| (after[k][axis] - before[k][axis]) / (UNTIL - FROM));
    Pulled { board: gained(0), ball: gained(1) }
}

#[test]
fn holds() {
    law(module_path!(), "b = (F - μ₁ (M + n m) g)/(7/2 M + n m), a = 7/2 b", |m| {
        let n = BALLS as f64;
        let drag = FRICTION[0] * (BOX + n * BALL) * G;
        let rolls = (PULL - drag) / (3.5 * BOX / BALL + n) / BALL;
        let why = "momentum of hops, arm of the balls";
        let arm = depth(G) / (2.0 * RADIUS);
        // What hops take from the pull, on all that it accelerates.
        let under = |p: &Pulled| FRICTION[0] * (BOX * p.board[1] + n * BALL * p.ball[1]).abs();
        let off = |p: &Pulled| under(p) / (3.5 * BOX + n * BALL) + arm * rolls + SOLVER;
        let rolling = pulled(FRICTION[1], BOX);
        let [on_board, on_ball] = [(3.5 * off(&rolling), why), (off(&rolling), why)];
        m.row("acceleration of the box", "m/s²", 3.5 * rolls, rolling.board[0], on_board);
        m.row("acceleration of a ball", "m/s²", rolls, rolling.ball[0], on_ball);
        let none = pulled(0.0, BOX);
        m.control("acceleration of the box", "without friction of the balls", none.board[0]);
        m.control("acceleration of a ball", "without friction of the balls", none.ball[0]);
        let slipping = pulled(SLIPPERY, BOX);
        let slips = (PULL - drag - n * SLIPPERY * BALL * G) / BOX;
        let on_top = SLIPPERY * slipping.ball[1].abs() + SOLVER;
        let on_board = ((under(&slipping) + n * BALL * on_top) / BOX + SOLVER, "momentum of hops");
        m.row("acceleration of the box, balls slip", "m/s²", slips, slipping.board[0], on_board);
        let ball_slips = SLIPPERY * G;
        m.row("acceleration of a ball that slips", "m/s²", ball_slips, slipping.ball[0], (on_top, "momentum of hops"));
        m.control("acceleration of the box, balls slip", "with balls that roll", rolling.board[0]);
        m.control("acceleration of a ball that slips", "with balls that roll", rolling.ball[0]);
    });
}
