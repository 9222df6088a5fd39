//! SimBenchmark's rolling test: a box slides on the ground, pulled by F, and balls roll on its back. With f₁ = μ₁ (M + n m) g
//! under the box and f₂ between it and each ball: M a = F - f₁ - n f₂, m b = f₂, 2/5 m r² α = f₂ r, a = b + r α = 7/2 f₂/m.
//! So f₂ = (F - f₁)/(7/2 M/m + n), b = f₂/m and a = 7/2 b, as long as f₂ < μ₂ m g. With less friction the balls slip: b = μ₂ g
//! and M a = F - f₁ - n μ₂ m g. (MuJoCo takes the larger friction of two that touch: the box has none, the ground and the
//! balls have μ₁ and μ₂.)
//!
//! (SimBenchmark has 25 balls and an oblique pull. Source: leggedrobotics, SimBenchmark, "Rolling test".)
//!
//! Tolerance: the friction of a sliding box is known to 1 % (law `sliding_block`, calibrated) and is two thirds of the pull, twice what
//! is left to accelerate; 3 %.

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

/// Accelerations of the box and mean of those of the balls along the pull, over 0.8 s from rest.
fn pulled(friction_of_balls: f64, mass: f64) -> [f64; 2] {
    let mut lab = Lab::new(slope(0.0, FRICTION[0]));
    let board = lab.object(RigidObjectCfg {
        uid: "board".into(),
        friction: Some([0.0; 3]),
        shape: ObjectShape::Box { size: [8.0, 8.0, 0.5] },
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
    lab.push(board, PULL * along, Vector3::zeros());
    lab.run(0.8);
    let speed = |id: ObjectId| lab.body(id).velocity.dot(&along) / 0.8;
    [speed(board), balls.iter().map(|&ball| speed(ball)).sum::<f64>() / BALLS as f64]
}

#[test]
fn holds() {
    law(module_path!(), "b = (F - μ₁ (M + n m) g)/(7/2 M + n m), a = 7/2 b", |m| {
        let n = BALLS as f64;
        let drag = FRICTION[0] * (BOX + n * BALL) * G;
        let rolls = (PULL - drag) / (3.5 * BOX / BALL + n) / BALL;
        let [board, ball] = pulled(FRICTION[1], BOX);
        m.row("acceleration of the box", "m/s²", 3.5 * rolls, board, (0.03 * 3.5 * rolls, "friction of a sliding box"));
        m.row("acceleration of a ball", "m/s²", rolls, ball, (0.03 * rolls, "friction of a sliding box"));
        let none = pulled(0.0, BOX);
        m.control("acceleration of the box", "without friction of the balls", none[0]);
        m.control("acceleration of a ball", "without friction of the balls", none[1]);
        let [board, ball] = pulled(SLIPPERY, BOX);
        let slips = (PULL - drag - n * SLIPPERY * BALL * G) / BOX;
        m.row("acceleration of the box, balls slip", "m/s²", slips, board, (0.03 * slips, "friction of a sliding box"));
        let ball_slips = SLIPPERY * G;
        m.row("acceleration of a ball that slips", "m/s²", ball_slips, ball, (0.03 * ball_slips, "hops as it slides"));
        let rough = pulled(FRICTION[1], BOX);
        m.control("acceleration of the box, balls slip", "with balls that roll", rough[0]);
        m.control("acceleration of a ball that slips", "with balls that roll", rough[1]);
    });
}
