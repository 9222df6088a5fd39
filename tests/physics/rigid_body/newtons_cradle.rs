//! Newton's cradle: a ball hits a row of four balls with small gaps. Each ball passes on its whole velocity, and only
//! the last one moves away. m v = m Σ v, m v² = m Σ v² for two equal masses has no other solution.
//!
//! Tolerance: a bounce of restitution e passes on (1 + e)/2 of the velocity and keeps (1 - e)/2. The ten steps of a
//! contact leave e within `restitution_error` of 1 (`bounce.rs`). The last ball has four times off/2; the others keep off/2 of their
//! received velocity, which exceeds by at most three bounces' off/2.

use crate::bounce::restitution_error;
use crate::lab::*;
use kinetoscope::sim::RigidObjectId;
use kinetoscope_testkit::worlds::ball;

const RADIUS: f64 = 0.1;

/// Velocities of the five balls along the row, 2 s after the first was pushed, with a drag of `linear_damping` \[N
/// s/m\].
fn final_velocities(restitution: Option<f64>, linear_damping: f64) -> Vec<f64> {
    let mut lab = Lab::new(with_dt(2e-4, weightless()));
    let balls: Vec<RigidObjectId> = (0..5)
        .map(|k| {
            let at = f64::from(k) * (2.0 * RADIUS + 0.01) - if k == 0 { 0.2 } else { 0.0 };
            let ball = ball(&format!("ball {k}"), RADIUS, 0.3, [at, 0.0, 0.0]);
            lab.object(RigidObjectCfg { restitution, linear_damping, ..ball })
        })
        .collect();
    lab.write_velocity(balls[0], [1.0, 0.0, 0.0], [0.0; 3]);
    lab.run(2.0);
    balls.into_iter().map(|id| lab.body(id).velocity.x).collect()
}

#[test]
fn holds() {
    law(module_path!(), "the last goes with v, the others rest; Σ v = v", |m| {
        let (elastic, soft) = (final_velocities(Some(1.0), 0.0), final_velocities(None, 0.0));
        let kept = restitution_error(1.0) / 2.0 * (1.0 + restitution_error(1.0) / 2.0).powi(3);
        m.row("velocity of the last", "m/s", 1.0, elastic[4], (2.0 * restitution_error(1.0), "four bounces"));
        for (k, &velocity) in elastic.iter().enumerate().take(4) {
            m.row(&format!("velocity of ball {k}"), "m/s", 0.0, velocity, (kept, "the steps of a contact"));
        }
        m.row("sum of the velocities", "m/s", 1.0, elastic.iter().sum(), (1e-10, "rounding"));
        let dull = final_velocities(Some(0.5), 0.0);
        for (k, &velocity) in dull.iter().enumerate().take(4).skip(1) {
            m.control(&format!("velocity of ball {k}"), "with a restitution of 0.5", velocity);
        }
        m.control("sum of the velocities", "with a drag", final_velocities(Some(1.0), 0.01).iter().sum());
        m.control("velocity of the last", "with MuJoCo's own contacts", soft[4]);
        m.control("velocity of ball 0", "with MuJoCo's own contacts", soft[0]);
    });
}
