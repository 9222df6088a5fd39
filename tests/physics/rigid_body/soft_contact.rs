//! MuJoCo's soft contacts at rest: the penetration depth in closed form.
//!
//! A constraint row with impedance d, force f and inverse inertia A obeys `a + R f = -B v - K d r` with `R = A (1 -
//! d)/d` and `K = 1/(dmax² tc² dr²)`, where r is the depth. At rest a = v = 0:
//!
//! ```text
//! r = (1 - d)/d² A f dmax² tc² dr²,   d = d(r)
//! ```
//!
//! Source: MuJoCo, "Computation: Solver parameters" (solref, solimp), with its defaults.

/// Time constant of `solref` \[s\]; its damping ratio is 1.
pub(crate) const TIME_CONSTANT: f64 = 0.02;
/// Impedances at the surface and at full depth, and the depth of full impedance \[m\].
const IMPEDANCE: [f64; 2] = [0.9, 0.95];
const WIDTH: f64 = 1e-3;
/// The largest impedance: MuJoCo scales damping and stiffness by it.
pub(crate) const MAX_IMPEDANCE: f64 = IMPEDANCE[1];

/// `solimp` at `depth` \[m\]: two parabolas that join in the middle.
pub(crate) fn impedance(depth: f64) -> f64 {
    let x = (depth / WIDTH).clamp(0.0, 1.0);
    let y = if x < 0.5 { 2.0 * x * x } else { 1.0 - 2.0 * (1.0 - x) * (1.0 - x) };
    IMPEDANCE[0] + y * (IMPEDANCE[1] - IMPEDANCE[0])
}

/// Depth \[m\] at rest under a contact force of the acceleration `load` = A f \[m/s²\].
pub(crate) fn depth(load: f64) -> f64 {
    let of = |r: f64| {
        let d = impedance(r);
        (1.0 - d) / (d * d) * load * (MAX_IMPEDANCE * TIME_CONSTANT).powi(2)
    };
    // The right side decreases with the depth, so the root is between 0 and its value there.
    let [mut low, mut high] = [0.0, of(0.0)];
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if of(middle) > middle { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}
