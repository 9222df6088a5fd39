//! The mass matrix, column by column: at rest and weightless, the efforts M e_j accelerate joint j by 1 and no other
//! joint. The reference computes M e_j as its efforts for q̈ = e_j.
//!
//! Tolerance: rounding of the factorization, 1e-16 times the condition of M, up to 1e5 with fingers of 50 g on an arm
//! of 4 kg: 1e-9.

use super::test_robots::{KINDS, Kind, TestRobot, max_difference};
use crate::law::{law, max_or_nan};
use nalgebra::Vector3;

/// The largest error of an acceleration, with efforts computed at joint positions that are off by `shift`.
fn error(kind: Kind, shift: f64) -> f64 {
    let mut subject = TestRobot::new(kind, Vector3::zeros());
    let still = vec![0.0; subject.dof()];
    let mut worst = 0.0_f64;
    for k in 0..3 {
        let q = subject.sample_values(0.5, k);
        let other: Vec<f64> = q.iter().map(|q| q + shift).collect();
        for j in 0..subject.dof() {
            let mut unit = still.clone();
            unit[j] = 1.0;
            let column = subject.efforts(&other, &still, &unit, Vector3::zeros());
            worst = max_or_nan(worst, max_difference(&subject.accelerations(&q, &still, &column), &unit));
        }
    }
    worst
}

#[test]
fn holds() {
    law(module_path!(), "M(q) e_j applied at rest gives q̈ = e_j", |m| {
        for (kind, name) in KINDS {
            let quantity = format!("largest error of an acceleration, {name}");
            m.row(&quantity, "rad/s²", 0.0, error(kind, 0.0), (1e-9, "rounding times the condition of M"));
            m.control(&quantity, "with M of positions 0.1 off", error(kind, 0.1));
        }
    });
}
