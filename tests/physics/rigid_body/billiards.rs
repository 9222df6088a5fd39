//! Off-center collision of two balls of equal mass, without friction and without loss. The line of centers is at α with
//! sin α = b/2r from the velocity of the first ball, where b is the impact parameter. The second ball leaves along this
//! line with v cos α, the first across it with v sin α, at a right angle. Momentum is conserved in all cases.
//!
//! Tolerance: momentum up to the solver's residual, 1e-8 of the impulse m v cos α on each of the two balls. The bounce
//! is a spring for about ten steps, in which the balls move 1 mm at 0.1 mm a step and the line of centers turns by as
//! much over 2r: 0.5 %, once on approach and once on separation: 1 %.

use crate::lab::*;
use kinetoscope_testkit::worlds::ball;

const RADIUS: f64 = 0.1;

/// Velocities after the hit; only the second ball has the drag `drag` \[N s/m\].
fn collide(impact: f64, restitution: f64, drag: f64) -> [Vector3<f64>; 2] {
    let mut lab = Lab::new(SimulationManagerCfg { friction: [0.0; 3], ..with_dt(1e-4, weightless()) });
    let mut ball = |uid: &str, at: [f64; 3], linear_damping: f64| {
        let ball = ball(uid, RADIUS, 0.17, at);
        lab.object(RigidObjectCfg { restitution: Some(restitution), linear_damping, ..ball })
    };
    let (cue, other) = (ball("cue", [-0.4, impact, 0.0], 0.0), ball("other", [0.0; 3], drag));
    lab.write_velocity(cue, [1.0, 0.0, 0.0], [0.0; 3]);
    lab.run(0.8);
    [cue, other].map(|id| lab.body(id).velocity)
}

#[test]
fn holds() {
    law(module_path!(), "v₂ = v cos α along the line of centers, v₁ = v sin α across", |m| {
        let impact = RADIUS;
        let alpha = (impact / (2.0 * RADIUS)).asin();
        let [cue, other] = collide(impact, 1.0, 0.0);
        let [dull_cue, dull_other] = collide(impact, 0.3, 0.0);
        let [full_cue, full_other] = collide(0.0, 1.0, 0.0);
        let turn = |v: &Vector3<f64>| v.y.atan2(v.x);
        let solver = (2e-8 * alpha.cos(), "the solver's 1e-8 of the impulse, on each ball");
        let bounce = (0.01, "the line of centers rotates during the contact");
        m.row("speed of the struck ball", "m/s", alpha.cos(), other.norm(), bounce);
        m.row("direction of the struck ball", "rad", -alpha, turn(&other), bounce);
        m.row("speed of the cue ball", "m/s", alpha.sin(), cue.norm(), bounce);
        m.row("angle between them", "rad", std::f64::consts::FRAC_PI_2, turn(&cue) - turn(&other), bounce);
        m.row("momentum along the way, of m v", "", 1.0, cue.x + other.x, solver);
        m.row("momentum across the way, of m v", "", 0.0, cue.y + other.y, solver);
        m.row("energy, of m v²/2", "", 1.0, cue.norm_squared() + other.norm_squared(), bounce);
        m.row("speed of the cue ball, full hit", "m/s", 0.0, full_cue.norm(), bounce);
        let [held_cue, held_other] = collide(impact, 1.0, 0.1);
        let [along, across] = [held_cue.x + held_other.x, held_cue.y + held_other.y];
        m.control("momentum along the way, of m v", "with a drag on the second", along);
        m.control("momentum across the way, of m v", "with a drag on the second", across);
        for quantity in ["momentum along the way, of m v", "momentum across the way, of m v"] {
            m.versions_differ_in(quantity, "what each line's solver leaves, below its 1e-8");
        }
        m.control("speed of the struck ball", "with a restitution of 0.3", dull_other.norm());
        m.control("angle between them", "with a restitution of 0.3", turn(&dull_cue) - turn(&dull_other));
        m.control(
            "energy, of m v²/2",
            "with a restitution of 0.3",
            dull_cue.norm_squared() + dull_other.norm_squared(),
        );
        m.control("direction of the struck ball", "hit in the middle", turn(&full_other));
        m.control("speed of the cue ball", "hit in the middle", full_cue.norm());
        let alone = collide(3.0 * RADIUS, 1.0, 0.0)[0];
        m.control("speed of the cue ball, full hit", "past the other", alone.norm());
    });
}
