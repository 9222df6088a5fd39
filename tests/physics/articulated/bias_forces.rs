//! Coriolis and centrifugal forces: without gravity, the efforts c(q, q̇) computed by the reference for q̈ = 0 keep all
//! velocities constant.
//!
//! Tolerance: as for the mass matrix, rounding of v/h and the condition of M; 1e-9.

use super::test_robots::{KINDS, Kind, TestRobot, max_difference};
use crate::law::{law, max_or_nan};
use nalgebra::Vector3;

/// The largest acceleration with the share `part` of the efforts applied.
fn largest_acceleration(kind: Kind, part: f64) -> f64 {
    let mut subject = TestRobot::new(kind, Vector3::zeros());
    let still = vec![0.0; subject.dof()];
    (0..10)
        .map(|k| {
            let (q, v) = (subject.sample_values(0.5, k), subject.sample_values(2.0, k + 50));
            let bias: Vec<f64> =
                subject.efforts(&q, &v, &still, Vector3::zeros()).iter().map(|tau| part * tau).collect();
            max_difference(&subject.accelerations(&q, &v, &bias), &still)
        })
        .fold(0.0, max_or_nan)
}

#[test]
fn holds() {
    law(module_path!(), "τ = c(q, q̇) gives q̈ = 0", |m| {
        for (kind, name) in KINDS {
            let quantity = format!("largest acceleration, {name}");
            m.row(
                &quantity,
                "rad/s²",
                0.0,
                largest_acceleration(kind, 1.0),
                (1e-9, "rounding times the condition of M"),
            );
            m.control(&quantity, "without these efforts", largest_acceleration(kind, 0.0));
        }
    });
}
