//! Explicit steps of a contact with restitution, written without MuJoCo: the source of the tolerances of bounces.
//!
//! `RigidObjectCfg::restitution` is a spring k and a damper b between the surfaces. While they overlap by x < 0 and
//! push, `x'' = -b x' - k x`, with `k = ω²`, ω = π/(10 h) and `b = 2 ζ ω`. The integrator is semi-implicit Euler:
//! acceleration before the step, then velocity, then position. Ten steps are few, so the result depends on the fraction
//! of a step at which the surfaces meet. [`apex`] gives the height after a fall by the recursion of these steps;
//! [`restitution_error`] and [`apex_error`] give the largest errors over all such fractions.

use std::f64::consts::PI;

/// Steps of an undamped contact, as documented at `RigidObjectCfg::restitution`.
const STEPS: f64 = 10.0;

/// Number of tested fractions of a step at which the surfaces meet.
const PHASES: usize = 200;

/// MuJoCo's constraint error: its largest impedance d is 0.9999, which loses 1e-4 of the velocity before and after. The
/// rows of a pyramidal cone with a friction of 1 yield the same again.
const IMPEDANCE: f64 = 4e-4;

/// Damping ratio ζ of the spring and damper, without pulling forces, for the restitution e: exp(-ζ/w atan2(2 ζ w, ζ² -
/// w²)) = e with w² = 1 - ζ² (Schwager, Pöschel, Granular Matter 9, 2007, equation 21).
fn damping_ratio(e: f64) -> f64 {
    if e >= 1.0 {
        return 0.0;
    }
    let (mut low, mut high) = (0.0_f64, 1.0 - 1e-12);
    for _ in 0..60 {
        let z = (low + high) / 2.0;
        let w = (1.0 - z * z).sqrt();
        if (-z / w * (2.0 * z * w).atan2(z * z - w * w)).exp() > e { low = z } else { high = z }
    }
    (low + high) / 2.0
}

/// Steps of length 1 from the distance `x` and the velocity `v` until `done(x, v)`. `g` pulls the surfaces together; a
/// contact that pushes replaces the acceleration.
fn steps(e: f64, g: f64, mut x: f64, mut v: f64, done: impl Fn(f64, f64) -> bool) -> [f64; 2] {
    let omega = PI / STEPS;
    let (k, b) = (omega * omega, 2.0 * damping_ratio(e) * omega);
    while !done(x, v) {
        let free = -g;
        v += if x < 0.0 { free.max(-k * x - b * v) } else { free };
        x += v;
    }
    [x, v]
}

/// Largest error of the restitution `e` in a bounce without gravity.
pub(crate) fn restitution_error(e: f64) -> f64 {
    let worst = (0..PHASES).map(|place| {
        let sunk = (place as f64 + 0.5) / PHASES as f64;
        let [_, v] = steps(e, 0.0, -sunk, -1.0, |x, v| x >= 0.0 && v > 0.0);
        (v - e).abs()
    });
    worst.fold(0.0, f64::max) + IMPEDANCE
}

/// The height \[m\] reached after a fall from `height` \[m\], in steps of `h` \[s\] under `g` \[m/s²\].
pub(crate) fn apex(e: f64, height: f64, h: f64, g: f64) -> f64 {
    // In units of steps: velocities are in meters per step.
    let g = g * h * h;
    let [x, v] = steps(e, g, height, 0.0, |x, v| x < 0.0 && v < 0.0);
    let [x, v] = steps(e, g, x, v, |x, v| x >= 0.0 && v > 0.0);
    let [top, _] = steps(e, g, x, v, |_, v| v <= 0.0);
    top
}

/// The error of [`apex`] due to MuJoCo's contact impedance \[m\].
pub(crate) fn apex_impedance_error(e: f64, height: f64) -> f64 {
    2.0 * e * e * IMPEDANCE * height
}

/// Largest error of the height \[m\] after a fall against e² `height`, over all fractions of a step.
pub(crate) fn apex_error(e: f64, height: f64, h: f64, g: f64) -> f64 {
    let way = (2.0 * g * height).sqrt() * h;
    let worst = (0..PHASES).map(|place| {
        let height = height + way * place as f64 / PHASES as f64;
        (apex(e, height, h, g) - e * e * height).abs()
    });
    worst.fold(0.0, f64::max) + apex_impedance_error(e, height)
}

#[test]
fn restitution() {
    // Undamped steps conserve v² + ω² x² - ω² h x v. The surfaces enter at a fraction p of a step and leave at q, which
    // changes v² by at most 1/4 ω² h² = 2.5 %, that is 1.2 % of v.
    assert!(restitution_error(1.0) < 0.0124 + IMPEDANCE);
    // The values in the documentation of the restitution.
    for (e, promised) in [(1.0, 0.003), (0.8, 0.03), (0.5, 0.06), (0.3, 0.08), (0.14, 0.08)] {
        let found = restitution_error(e);
        assert!((0.5 * promised..promised).contains(&found), "{e}: {found}");
    }
}
