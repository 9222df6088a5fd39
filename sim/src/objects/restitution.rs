//! Restitution by MuJoCo's contacts, which have no restitution parameter.
//!
//! A contact of MuJoCo is a spring and a damper that can only push. With `solref = (-k, -b)` and a constant impedance,
//! the distance x of two surfaces that meet with a load between them obeys `x'' = -b x' - k x` while the force is above
//! zero (MuJoCo's documentation, "Constraint model": `a1 = d aref + (1 - d) a0` with `aref = -b/d x' - k/d x`; k and b
//! are per unit of mass). The surfaces separate with the fraction
//!
//! ```text
//! e = exp(-β/ω atan2(2 β ω, β² - ω²)),   β = b/2, ω = sqrt(k - β²)
//! ```
//!
//! of their impact velocity: 1 without damping, exp(-2) = 0.135 at critical damping. It depends on the damping ratio `ζ
//! = β/sqrt k` only; the stiffness is chosen for the time step. Source: Schwager, Pöschel, "Coefficient of restitution
//! and linear-dashpot model revisited", Granular Matter 9, 2007, equation 21.

use std::f64::consts::PI;

/// Smallest restitution of a contact below critical damping: a little above exp(-2).
pub(crate) const MIN_RESTITUTION: f64 = 0.14;

/// Duration of a contact without damping, in steps. Longer contacts are more exact, and softer: a body with impact
/// velocity v penetrates by `v STEPS h / π`.
const CONTACT_STEPS: f64 = 10.0;

/// Impedance d of such a contact, the same at every depth, since the formula needs a constant. It is the largest that
/// MuJoCo accepts (`mjMAXIMP`). With pyramidal cones a contact yields by `mu² (1 + mu²) / 2` times `(1 - d) / d` (the
/// rows of its edges), so a smaller d would make the bounce depend on the friction.
pub(crate) const IMPEDANCE: [f64; 5] = [0.9999, 0.9999, 0.001, 0.5, 2.0];

/// Weight of these contact parameters (`solmix`) against those of other surfaces, which have 1.
pub(crate) const SOLMIX: f64 = 1e6;

/// Coefficient of restitution of a contact with the damping ratio `ratio`, 0 to below 1.
fn restitution(ratio: f64) -> f64 {
    let omega = (1.0 - ratio * ratio).sqrt();
    (-ratio / omega * (2.0 * ratio * omega).atan2(ratio * ratio - omega * omega)).exp()
}

/// MuJoCo's `solref` for surfaces with this restitution, [`MIN_RESTITUTION`] to 1, at time steps of `timestep` \[s\].
pub(crate) fn solref(restitution_wanted: f64, timestep: f64) -> [f64; 2] {
    // The restitution falls from 1 to exp(-2): bisection finds the damping ratio to the last bit.
    let (mut low, mut high) = (0.0, 1.0 - 1e-12);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if restitution(middle) > restitution_wanted { low = middle } else { high = middle }
    }
    let ratio = if restitution_wanted >= 1.0 { 0.0 } else { (low + high) / 2.0 };
    let frequency = PI / (CONTACT_STEPS * timestep);
    // MuJoCo treats 0 like a positive number, which has another meaning.
    let damping = (2.0 * ratio * frequency).max(1e-9);
    [-frequency * frequency, -damping]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrates a contact in steps of a ten-thousandth of its duration. Returns the separation velocity for unit
    /// impact velocity.
    fn bounce(stiffness: f64, damping: f64) -> f64 {
        let h = PI / stiffness.sqrt() * 1e-4;
        let (mut x, mut v) = (0.0_f64, -1.0_f64);
        loop {
            let force = -stiffness * x - damping * v;
            if force <= 0.0 {
                return v;
            }
            // Midpoint rule: the error is quadratic in the step.
            let (xm, vm) = (x + v * h / 2.0, v + force * h / 2.0);
            x += vm * h;
            v += (-stiffness * xm - damping * vm) * h;
        }
    }

    #[test]
    fn damping() {
        for wanted in [0.14, 0.2, 0.35, 0.5, 0.75, 0.9, 0.99] {
            let [stiffness, damping] = solref(wanted, 0.002).map(|x| -x);
            let found = bounce(stiffness, damping);
            assert!((found - wanted).abs() < 1e-5, "{wanted}: {found}");
            assert!((stiffness.sqrt() * 0.002 * CONTACT_STEPS / PI - 1.0).abs() < 1e-12);
        }
        assert_eq!(solref(1.0, 0.01)[1], -1e-9);
        assert!((restitution(1.0 - 1e-9) - (-2.0_f64).exp()).abs() < 1e-4);
        // Control: twice the damping gives another restitution.
        let [stiffness, damping] = solref(0.5, 0.002).map(|x| -x);
        assert!((bounce(stiffness, 2.0 * damping) - 0.5).abs() > 0.1);
    }
}
