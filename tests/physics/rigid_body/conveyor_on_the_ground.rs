//! SimBenchmark's rolling test in its original form: 25 balls of 1 kg on a box of 10 kg, which slides on the ground and
//! is pulled obliquely by F = 150 N for 4 s. The friction is μ₁ = 0.4 under the box and μ₂ = 0.8 between the box and
//! the balls. From rest, in the notation of `conveyor`:
//!
//! ```text
//! f₁ = μ₁ (M + n m) g,   b = (F - f₁)/(7/2 M + n m),   a = 7/2 b;   V = a t of the box, v = b t of a ball
//! ```
//!
//! SimBenchmark reports the mean square, over the time, of the velocity errors. (Published for MuJoCo 1.50: 0.0069
//! m²/s² with Euler. Source: leggedrobotics, SimBenchmark, "Rolling test".) This law uses the root mean squares of box
//! and balls.
//!
//! Nothing of this is exact in MuJoCo, because bodies that slide on soft contacts hop; the tolerance bounds the effect
//! of hops. A contact that slips with V is pushed as if it were μ₁ B V deeper, B = 2/(dmax tc) (law `sliding_block`).
//! In a step of h its velocity thus changes by at most s = h μ₁ B V. A box that lands with w sinks in by at most w h
//! before it is pushed, and leaves the contact after rising as far: from rest, k steps of s lead to the height k (k +
//! 1)/2 s h and the velocity k s. So w = k s decreases for k > 2 and can increase only for k < 2, and w <= 2 s. The
//! ground has carried the weight except for the upward momentum w (M + n m), and friction deviates by μ₁ times that.
//! The velocity of the box with rolling balls, of the inertia M + 2/7 n m, is off by
//!
//! ```text
//! e = 2 h μ₁² B V (M + n m)/(M + 2/7 n m)
//! ```
//!
//! The velocity of a ball is off by 2/7 e, and by the velocity that the box gains on the ball while the ball is in the
//! air, 2 w/g a.
//!
//! (A second-order effect: a box that lands on one corner is rotated by its friction, and its corners do not move along
//! the pull. An impulse that changes the corner's velocity by 2 w, 7 J/M, moves it by 3 μ₁ J/M across, ε = 6/7 μ₁ w/V
//! of its path, and friction is low by ε²/2 = 4e-4 of itself. For this reason `conveyor` uses a rail.)

use super::soft_contact::{MAX_IMPEDANCE, TIME_CONSTANT};
use crate::lab::*;
use kinetoscope::sim::RigidObjectId;
use kinetoscope_testkit::worlds::{ball, object};
use nalgebra::{Vector2, Vector3};

const BOX: f64 = 10.0;
const BALL: f64 = 1.0;
const RADIUS: f64 = 0.5;
const FRICTION: [f64; 2] = [0.4, 0.8];
const PULL: f64 = 150.0;
/// Number of balls in a row, and of rows.
const ROWS: usize = 5;
const SECONDS: f64 = 4.0;

/// Accelerations of box and balls in closed form.
fn expected() -> [f64; 2] {
    let n = (ROWS * ROWS) as f64;
    let rolls = (PULL - FRICTION[0] * (BOX + n * BALL) * G) / (3.5 * BOX + n * BALL);
    [3.5 * rolls, rolls]
}

/// Root mean squares of the velocity errors of box and balls \[m/s\].
fn rms_errors(friction_of_balls: f64) -> [f64; 2] {
    let mut lab = Lab::new(slope(0.0, FRICTION[0]));
    let board = object("board", ObjectShape::Box { size: [20.0, 20.0, 0.5] }, [0.0, 0.0, 0.25]);
    let board = lab.object(RigidObjectCfg { friction: Some([0.0; 3]), mass: Some(BOX), ..board });
    let place = |k: usize| 2.0 * (k as f64 - 0.5 * (ROWS - 1) as f64);
    let mut add = |k: usize| {
        let ball = ball(&format!("ball {k}"), RADIUS, BALL, [place(k / ROWS), place(k % ROWS), 0.5 + RADIUS]);
        lab.object(RigidObjectCfg { friction: Some([friction_of_balls, 0.0, 0.0]), ..ball })
    };
    let balls: Vec<RigidObjectId> = (0..ROWS * ROWS).map(&mut add).collect();
    lab.run(0.5);
    let along = Vector2::new(0.5, 0.75_f64.sqrt());
    lab.set_object_wrench(board, PULL * Vector3::new(along.x, along.y, 0.0), Vector3::zeros());
    let [a, b] = expected();
    let steps = (SECONDS / lab.dt()).round() as u32;
    let mut squares = [0.0; 2];
    lab.run_with(steps, |t, sim| {
        let apart = |id: RigidObjectId, rate: f64| (body(sim, id).velocity.xy() - rate * t * along).norm_squared();
        squares[0] += apart(board, a);
        squares[1] += balls.iter().map(|&ball| apart(ball, b)).sum::<f64>() / balls.len() as f64;
    });
    squares.map(|sum| (sum / f64::from(steps)).sqrt())
}

#[test]
fn holds() {
    law(module_path!(), "V = a t, v = b t; b = (F - μ₁ (M + n m) g)/(7/2 M + n m), a = 7/2 b", |m| {
        let ([board, ball], [alone, left]) = (rms_errors(FRICTION[1]), rms_errors(0.0));
        let [a, _] = expected();
        let others = (ROWS * ROWS) as f64 * BALL;
        // The root mean square of a t over the time.
        let fast = a * SECONDS / 3.0_f64.sqrt();
        let hops = 2.0 * 1e-3 * FRICTION[0] * 2.0 / (MAX_IMPEDANCE * TIME_CONSTANT) * fast;
        let on_board = FRICTION[0] * hops * (BOX + others) / (BOX + 2.0 / 7.0 * others);
        let on_ball = 2.0 / 7.0 * on_board + 2.0 * hops / G * a;
        let why = "momentum of hops, of two steps on a contact that slips";
        let quantity = "root mean square error of the box";
        m.row(quantity, "m/s", 0.0, board, (on_board, why));
        m.control(quantity, "without friction of the balls", alone);
        let quantity = "root mean square error of the balls";
        m.row(quantity, "m/s", 0.0, ball, (on_ball, why));
        m.control(quantity, "without friction of the balls", left);
        m.versions_differ(
            "hops are chaotic: each line's solver rounds in its own way; what they can do is in the tolerance",
        );
    });
}
