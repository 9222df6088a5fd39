//! A contact with restitution as steps see it, written without MuJoCo: where its tolerances come from.
//!
//! `RigidObjectCfg::restitution` is a spring k and a damper b between the surfaces: while they overlap by x < 0 and push,
//! `x'' = -b x' - k x`, with `k = ω²`, ω = π/(10 h) and `b = 2 ζ ω`. The integrator takes the acceleration before the step,
//! then the velocity, then the place (semi-implicit Euler). Ten steps are few: where in a step the surfaces meet changes
//! what comes out. [`apex`] is what comes out of a fall from a height, by the recursion of these steps; [`off`] and
//! [`apex_off`] are the worst over all such places.

use std::f64::consts::PI;

/// Steps of an undamped contact, as `RigidObjectCfg::restitution` says.
const STEPS: f64 = 10.0;

/// Places in a step where the surfaces are made to meet.
const PLACES: usize = 200;

/// What MuJoCo leaves of a constraint: its largest impedance d is 0.9999, so 1e-4 of the velocity before and after; the rows
/// of a pyramidal cone with a friction of 1 yield once as much.
const IMPEDANCE: f64 = 4e-4;

/// Damping ratio ζ whose spring and damper, never pulling, give the restitution e: exp(-ζ/w atan2(2 ζ w, ζ² - w²)) = e with
/// w² = 1 - ζ² (Schwager, Pöschel, Granular Matter 9, 2007, equation 21).
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

/// Steps of length 1 from the distance `x` and the velocity `v`, until `done` says so of distance and velocity. `g` pulls the
/// surfaces together; the contact sets the acceleration as a whole, and only where that pushes.
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

/// The furthest that a bounce of restitution `e`, without gravity, may come out from it.
pub(crate) fn off(e: f64) -> f64 {
    let worst = (0..PLACES).map(|place| {
        let sunk = (place as f64 + 0.5) / PLACES as f64;
        let [_, v] = steps(e, 0.0, -sunk, -1.0, |x, v| x >= 0.0 && v > 0.0);
        (v - e).abs()
    });
    worst.fold(0.0, f64::max) + IMPEDANCE
}

/// The height \[m\] that is reached after a fall from `height` \[m\], in steps of `h` \[s\] under `g` \[m/s²\].
pub(crate) fn apex(e: f64, height: f64, h: f64, g: f64) -> f64 {
    // In steps: velocities are in metres per step.
    let g = g * h * h;
    let [x, v] = steps(e, g, height, 0.0, |x, v| x < 0.0 && v < 0.0);
    let [x, v] = steps(e, g, x, v, |x, v| x >= 0.0 && v > 0.0);
    let [top, _] = steps(e, g, x, v, |_, v| v <= 0.0);
    top
}

/// What [`apex`] may be off by, for the impedance that MuJoCo gives a contact.
pub(crate) fn apex_rest(e: f64, height: f64) -> f64 {
    2.0 * e * e * IMPEDANCE * height
}

/// The furthest that the height \[m\] after a fall may come out from e² `height`, wherever in a step the surfaces meet.
pub(crate) fn apex_off(e: f64, height: f64, h: f64, g: f64) -> f64 {
    let way = (2.0 * g * height).sqrt() * h;
    let worst = (0..PLACES).map(|place| {
        let height = height + way * place as f64 / PLACES as f64;
        (apex(e, height, h, g) - e * e * height).abs()
    });
    worst.fold(0.0, f64::max) + apex_rest(e, height)
}

#[test]
fn restitution() {
    // Without damping the steps keep v² + ω² x² - ω² h x v; the surfaces sink in by a part p of a step and leave by q of
    // one, which is 1/4 ω² h² = 2.5 % of v² between the two at most: 1.2 % of v.
    assert!(off(1.0) < 0.0124 + IMPEDANCE);
    // What the documentation of the restitution promises.
    for (e, promised) in [(1.0, 0.003), (0.8, 0.03), (0.5, 0.06), (0.3, 0.08), (0.14, 0.08)] {
        let found = off(e);
        assert!((0.5 * promised..promised).contains(&found), "{e}: {found}");
    }
}
