//! Balls roll on a board that is pulled by F. With the friction f₁ = μ₁ (M + n m) g against the board and f₂ between
//! the board and each ball, M a = F - f₁ - n f₂, m b = f₂, 2/5 m r² α = f₂ r, a = b + r α = 7/2 f₂/m. So f₂ = (F -
//! f₁)/(7/2 M/m + n), b = f₂/m and a = 7/2 b, as long as f₂ < μ₂ m g. With less friction the balls slip: b = μ₂ g and M
//! a = F - f₁ - n μ₂ m g.
//!
//! The board is on a rail with the dry friction f₁, so that it neither hops nor tips. (The board of SimBenchmark slides
//! on the ground and does both: law `conveyor_on_the_ground`.)
//!
//! Exact, up to the solver's tolerance: M a + n m b = F - f₁ for any motion of the balls, because the rail's friction
//! is at its limit at every step. Also exact: b - μ₂ c = μ₂ g for slipping balls with the mean upward acceleration c,
//! because slipping balls hop (law `sliding_block`). Not exact: a and b of rolling balls. The lever arm of their
//! friction is shorter by half of the depth δ, ρ = r - δ/2, so that a = b (1 + 5/2 ρ²/r²), and M a grows by less. To
//! first order b is off by 5/2 M δ/r of itself over 7/2 M + n m, and a by n m/M times the error of b. δ is the depth
//! under a load of m g on 1/m + 1/M, the largest inverse inertia that MuJoCo uses.

use super::sliding_block::SOLVER;
use super::soft_contact::depth;
use crate::lab::*;
use kinetoscope::sim::RigidObjectId;
use kinetoscope_testkit::worlds::ball;

const BOARD: f64 = 10.0;
const BALL: f64 = 1.0;
const RADIUS: f64 = 0.5;
/// Friction of the rail against the board, and of the balls.
const FRICTION: [f64; 2] = [0.4, 0.8];
/// Friction too low for rolling, which needs 0.066.
const SLIPPERY: f64 = 0.03;
const PULL: f64 = 80.0;
const BALLS: usize = 4;
/// Start and end of the averaging, after the start of the pull \[s\].
const FROM: f64 = 0.8;
const UNTIL: f64 = 1.6;

/// Mean accelerations between [`FROM`] and [`UNTIL`] \[m/s²\].
struct MeanAccelerations {
    /// Of the board, along the pull.
    board: f64,
    /// Mean over the balls, along the pull and upward.
    ball: [f64; 2],
}

fn drag() -> f64 {
    FRICTION[0] * (BOARD + BALLS as f64 * BALL) * G
}

fn pulled(friction_of_balls: f64) -> MeanAccelerations {
    let along = Vector3::new(0.5, 0.75_f64.sqrt(), 0.0);
    let mut lab = Lab::new(SimulationManagerCfg { ground: None, ..slope(0.0, 0.0) });
    let rail = Joint::slide("rail", ["base", "board"], along.into()).at([0.0, 0.0, 0.25]).dynamics(0.0, drag());
    let board = lab.mechanism(&urdf(&[base(), Link::brick("board", BOARD, [16.0, 16.0, 0.5])], &[rail]));
    let balls: Vec<RigidObjectId> = (0..BALLS)
        .map(|k| {
            let side = |bit: usize| if k >> bit & 1 == 1 { 2.0 } else { -2.0 };
            let ball = ball(&format!("ball {k}"), RADIUS, BALL, [side(0), side(1), 0.5 + RADIUS]);
            lab.object(RigidObjectCfg { friction: Some([friction_of_balls, 0.0, 0.0]), ..ball })
        })
        .collect();
    lab.run(0.5);
    let all = |lab: &Lab| {
        let balls = balls.iter().map(|&ball| lab.body(ball).velocity);
        let mean = balls.sum::<Vector3<f64>>() / BALLS as f64;
        [lab.v(board)[0], mean.dot(&along), mean.z]
    };
    lab.set_link_wrench(board, "board", PULL * along, Vector3::zeros());
    lab.run(FROM);
    let before = all(&lab);
    lab.run(UNTIL - FROM);
    let after = all(&lab);
    let [board, ball, up] = [0, 1, 2].map(|k: usize| (after[k] - before[k]) / (UNTIL - FROM));
    MeanAccelerations { board, ball: [ball, up] }
}

#[test]
fn holds() {
    law(
        module_path!(),
        "b = (F - f₁)/(7/2 M + n m), a = 7/2 b; slipping: b - μ₂ c = μ₂ g; M a + n m b = F - f₁",
        |m| {
            let n = BALLS as f64;
            let solver = (SOLVER, "tolerance of the solver");
            let rolls = (PULL - drag()) / (3.5 * BOARD / BALL + n) / BALL;
            let sinks = depth((1.0 + BALL / BOARD) * G);
            let off = rolls * 2.5 * BOARD * sinks / RADIUS / (3.5 * BOARD + n * BALL) + SOLVER;
            let why = "the arm is half of the depth shorter";
            let (rolling, none, slipping) = (pulled(FRICTION[1]), pulled(0.0), pulled(SLIPPERY));
            let [of_board, of_ball] = ["acceleration of the board", "acceleration of a ball"];
            m.row(of_board, "m/s²", 3.5 * rolls, rolling.board, (n * BALL / BOARD * off + SOLVER, why));
            m.row(of_ball, "m/s²", rolls, rolling.ball[0], (off, why));
            m.control(of_board, "without friction of the balls", none.board);
            m.control(of_ball, "without friction of the balls", none.ball[0]);

            let force = |p: &MeanAccelerations| p.board + n * BALL / BOARD * p.ball[0];
            let pull = (PULL - drag()) / BOARD;
            for (quantity, found) in [("a + n m b/M", &rolling), ("a + n m b/M, balls slip", &slipping)] {
                m.row(quantity, "m/s²", pull, force(found), solver);
                // Equivalent to balls with 10 % less mass.
                let other = found.board + 0.9 * n * BALL / BOARD * found.ball[0];
                m.control(quantity, "without a tenth of the balls", other);
            }

            let with_hops = |p: &MeanAccelerations| p.ball[0] - SLIPPERY * p.ball[1];
            let quantity = "b - μ₂ c of balls that slip";
            m.row(quantity, "m/s²", SLIPPERY * G, with_hops(&slipping), solver);
            m.control(quantity, "with balls that roll", with_hops(&rolling));
        },
    );
}
