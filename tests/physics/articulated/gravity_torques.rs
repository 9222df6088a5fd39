//! Gravity compensation: the efforts g(q) computed by the reference for q̇ = q̈ = 0 hold a robot in place. After one
//! step it has no velocity. After a tenth of a second its velocity is only that of amplified rounding: a robot balanced
//! by its efforts falls over as e^(λt), with λ of about 10 per second.
//!
//! Tolerance: 1e-12 m/s² of rounding in a step, times e^1 and the time: 1e-10.

use super::test_robots::{EARTH, KINDS, Kind, TestRobot, max_difference};
use crate::law::{law, max_or_nan};

/// The largest velocity after one step and after a tenth of a second, held by the share `part` of the efforts.
fn largest_velocities(kind: Kind, part: f64) -> [f64; 2] {
    let mut worst = [0.0_f64; 2];
    for k in 0..5 {
        let mut subject = TestRobot::new(kind, EARTH);
        let still = vec![0.0; subject.dof()];
        let q = subject.sample_values(0.5, k);
        let hold: Vec<f64> = subject.efforts(&q, &still, &still, EARTH).iter().map(|tau| part * tau).collect();
        let first = subject.accelerations(&q, &still, &hold);
        worst[0] = max_or_nan(worst[0], max_difference(&first, &still) * 1e-3);
        subject.lab.run(0.1);
        worst[1] = max_or_nan(worst[1], max_difference(&subject.lab.v(subject.robot), &still));
    }
    worst
}

#[test]
fn holds() {
    law(module_path!(), "τ = g(q) holds still", |m| {
        for (kind, name) in KINDS {
            let (held, less) = (largest_velocities(kind, 1.0), largest_velocities(kind, 0.99));
            for (k, when) in ["a step", "0.1 s"].into_iter().enumerate() {
                let quantity = format!("largest velocity after {when}, {name}");
                m.row(&quantity, "rad/s", 0.0, held[k], (1e-10, "rounding, and what it grows to"));
                m.control(&quantity, "with 1 % less effort", less[k]);
            }
        }
    });
}
