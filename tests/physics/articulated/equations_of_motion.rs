//! The equation of motion of whole robots, M q̈ + c(q, q̇) + g(q) = τ. Efforts are applied and a step is taken. By the
//! recursive Newton-Euler algorithm on the URDF files ([`newton_euler`](super::newton_euler)), the resulting
//! accelerations must require exactly these efforts. The states of the joints involve all terms of the equation.
//!
//! Tolerance: rounding of the velocities, divided by h = 1 ms, and the residual of a Cholesky factorization of n rows,
//! (3 n + 1) ε |M| |q̈| (Higham, Accuracy and Stability of Numerical Algorithms, § 10.1), both multiplied by the
//! reference's mass matrix.

use super::test_robots::{EARTH, KINDS, TestRobot, max_difference};
use crate::law::{law, max_or_nan};
use nalgebra::Vector3;

/// The effort error from rounding of the velocities and of the solved accelerations \[N m\], the largest over the
/// joints.
fn rounding(subject: &TestRobot, [q, v, a]: [&[f64]; 3]) -> f64 {
    let none = vec![0.0; q.len()];
    let mut efforts = vec![0.0; q.len()];
    for k in 0..q.len() {
        let mut unit = none.clone();
        unit[k] = 1.0;
        let of_joint = (v[k].abs() + (v[k] + 1e-3 * a[k]).abs()) / 2e-3 + (3 * q.len() + 1) as f64 * a[k].abs();
        let column = subject.efforts(q, &none, &unit, Vector3::zeros());
        efforts.iter_mut().zip(column).for_each(|(effort, m)| *effort += f64::EPSILON * m.abs() * of_joint);
    }
    efforts.into_iter().fold(0.0, f64::max)
}

#[test]
fn holds() {
    law(module_path!(), "M q̈ + c(q, q̇) + g(q) = τ", |m| {
        for (kind, name) in KINDS {
            let mut subject = TestRobot::new(kind, EARTH);
            let mut weightless = TestRobot::new(kind, Vector3::zeros());
            let (mut worst, mut unloaded, mut off) = (0.0_f64, 0.0_f64, 0.0_f64);
            for k in 0..10 {
                let (q, v, tau) = (
                    subject.sample_values(0.5, k),
                    subject.sample_values(1.5, k + 50),
                    subject.sample_values(8.0, k + 90),
                );
                let a = subject.accelerations(&q, &v, &tau);
                worst = max_or_nan(worst, max_difference(&subject.efforts(&q, &v, &a, EARTH), &tau));
                off = off.max(rounding(&subject, [&q, &v, &a]));
                let floating = weightless.accelerations(&q, &v, &tau);
                unloaded = max_or_nan(unloaded, max_difference(&subject.efforts(&q, &v, &floating, EARTH), &tau));
            }
            let quantity = format!("largest error of an effort, {name}");
            m.row(&quantity, "N m", 0.0, worst, (off, "rounding of v/h and of the solution"));
            m.control(&quantity, "in a world without gravity", unloaded);
        }
        m.versions_differ("rounding: the lines add up in another order");
    });
}
