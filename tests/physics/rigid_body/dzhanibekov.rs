//! Dzhanibekov effect: rotation about the middle axis flips repeatedly. Euler's equations have the solution ω₂ = c sn(λ
//! t, k), with the time 2 K(k)/λ between two changes of its sign. With T twice the energy, L the angular momentum and
//! I₁ < I₂ < I₃, for L² > I₂ T:
//!
//! ```text
//! λ² = (I₃ - I₂)(L² - T I₁)/(I₁ I₂ I₃),   k² = (I₂ - I₁)(T I₃ - L²)/((I₃ - I₂)(L² - T I₁))
//! ```
//!
//! (Landau, Lifshitz, Mechanics, § 37), with 1 and 3 swapped otherwise. K(k) is π/2 over the arithmetic-geometric mean
//! of 1 and √(1 - k²).
//!
//! Tolerance: the motion is slow near the unstable axis, where an error of ω₁ or ω₃ shifts the next flip by its
//! relative size over λ. RK4's error is (ω h)⁴ of the angle, 1e-9; the linearly interpolated crossing is accurate to h²
//! ω'' h/ω' ~ 1e-8.

use crate::lab::*;
use std::f64::consts::FRAC_PI_2;

const MOMENTS: [f64; 3] = [0.01, 0.02, 0.028];

pub(crate) fn complete_elliptic(k: f64) -> f64 {
    let (mut a, mut b) = (1.0, (1.0 - k * k).sqrt());
    for _ in 0..40 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    FRAC_PI_2 / a
}

/// Time between flips in closed form \[s\].
fn flip_time(w: [f64; 3]) -> f64 {
    let [mut i1, i2, mut i3] = MOMENTS;
    let twice_energy: f64 = (0..3).map(|k| MOMENTS[k] * w[k] * w[k]).sum();
    let momentum: f64 = (0..3).map(|k| (MOMENTS[k] * w[k]).powi(2)).sum();
    if momentum < i2 * twice_energy {
        (i1, i3) = (i3, i1);
    }
    let rate = (i3 - i2) * (momentum - twice_energy * i1) / (i1 * i2 * i3);
    let k2 = (i2 - i1) * (twice_energy * i3 - momentum) / ((i3 - i2) * (momentum - twice_energy * i1));
    2.0 * complete_elliptic(k2.sqrt()) / rate.sqrt()
}

/// Times of the sign changes of the angular velocity about the middle axis within 12 s \[s\].
fn flips(w: [f64; 3]) -> Vec<f64> {
    let mut lab = Lab::new(rk4(weightless()));
    let robot = lab.free(&urdf(&[Link::new("body", 1.0, MOMENTS)], &[]), [0.0; 3]);
    lab.write_root_velocity(robot, [0.0; 3], w);
    let (mut before, mut times) = ([0.0, w[1]], Vec::new());
    lab.run_with(12_000, |t, sim: &SimulationManager| {
        let now = [t, sim.robot(robot).root_ang_vel_b()[(0, 1)]];
        if now[1] * before[1] < 0.0 {
            times.push(before[0] + (t - before[0]) * before[1] / (before[1] - now[1]));
        }
        before = now;
    });
    times
}

#[test]
fn holds() {
    law(module_path!(), "time between flips = 2 K(k)/λ", |m| {
        for (name, w) in [("L² > I₂ T", [0.01, 5.0, 0.05]), ("L² < I₂ T", [0.08, 5.0, 0.02])] {
            let times = flips(w);
            assert!(times.len() >= 3, "{times:?}");
            let between = (times[2] - times[0]) / 2.0;
            m.row(
                &format!("time between flips, {name}"),
                "s",
                flip_time(w),
                between,
                (1e-8, "a crossing off a straight line"),
            );
            let off = flips([w[0] * 1.1, w[1], w[2] * 1.1]);
            m.control(&format!("time between flips, {name}"), "pushed 10 % harder", (off[2] - off[0]) / 2.0);
        }
    });
}
