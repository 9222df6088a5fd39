//! MuJoCo's soft contacts at rest, in closed form: how deep what lies there sinks in.
//!
//! A row of the solver with impedance d, force f and inverse inertia A obeys `a + R f = -B v - K d r` with
//! `R = A (1 - d)/d` and `K = 1/(dmax² tc² dr²)`, r being the depth. At rest a = v = 0:
//!
//! ```text
//! r = (1 - d)/d² A f dmax² tc² dr²,   d = d(r)
//! ```
//!
//! Source: MuJoCo, "Computation: Solver parameters" (solref, solimp), with its defaults.

/// Time constant of `solref` \[s\]; its damping ratio is 1.
pub(crate) const TIME: f64 = 0.02;
/// Impedances at the surface and deep below, and the depth at which the second is reached \[m\].
const IMPEDANCE: [f64; 2] = [0.9, 0.95];
const WIDTH: f64 = 1e-3;
/// The largest of the impedances: MuJoCo scales damping and stiffness by it.
pub(crate) const LARGEST: f64 = IMPEDANCE[1];

/// `solimp` at `depth` \[m\]: two parabolas that meet in the middle.
pub(crate) fn impedance(depth: f64) -> f64 {
    let x = (depth / WIDTH).clamp(0.0, 1.0);
    let y = if x < 0.5 { 2.0 * x * x } else { 1.0 - 2.0 * (1.0 - x) * (1.0 - x) };
    IMPEDANCE[0] + y * (IMPEDANCE[1] - IMPEDANCE[0])
}

/// Depth \[m\] at rest under a contact force that would accelerate by `load` = A f \[m/s²\].
pub(crate) fn depth(load: f64) -> f64 {
    let of = |r: f64| {
        let d = impedance(r);
        (1.0 - d) / (d * d) * load * (LARGEST * TIME).powi(2)
    };
    // The right side falls with the depth: the root is between 0 and its value there.
    let [mut low, mut high] = [0.0, of(0.0)];
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if of(middle) > middle { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}
