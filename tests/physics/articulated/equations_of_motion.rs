//! The equation of motion of whole robots, M q̈ + c(q, q̇) + g(q) = τ: efforts are applied, a step is taken, and the
//! accelerations found must need exactly these efforts by the recursive Newton-Euler algorithm on the URDF files
//! ([`newton_euler`](super::newton_euler)). The joints pass through states with all of the terms in them.
//!
//! Tolerance: velocities of 1 rad/s have 1e-16 of rounding, divided by h = 1 ms, times inertias below 10 kg m²: 1e-12, and
//! MuJoCo's factorisation a hundred times that; 1e-9 N m.

use super::subjects::{EARTH, KINDS, Subject, apart};
use crate::law::{law, worse};
use nalgebra::Vector3;

#[test]
fn holds() {
    law(module_path!(), "M q̈ + c(q, q̇) + g(q) = τ", |m| {
        for (kind, name) in KINDS {
            let mut subject = Subject::new(kind, EARTH);
            let mut weightless = Subject::new(kind, Vector3::zeros());
            let (mut worst, mut unloaded) = (0.0_f64, 0.0_f64);
            for k in 0..10 {
                let (q, v, tau) = (subject.spread(0.5, k), subject.spread(1.5, k + 50), subject.spread(8.0, k + 90));
                let a = subject.accelerations(&q, &v, &tau);
                worst = worse(worst, apart(&subject.efforts(&q, &v, &a, EARTH), &tau));
                let floating = weightless.accelerations(&q, &v, &tau);
                unloaded = worse(unloaded, apart(&subject.efforts(&q, &v, &floating, EARTH), &tau));
            }
            let quantity = format!("largest error of an effort, {name}");
            m.row(&quantity, "N m", 0.0, worst, (1e-9, "rounding of v/h times the inertias"));
            m.control(&quantity, "in a world without gravity", unloaded);
        }
    });
}
