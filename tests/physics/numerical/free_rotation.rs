//! RK4 of a free body's orientation as in each supported MuJoCo version, written without MuJoCo: the source of the
//! tolerance of an order.
//!
//! In the body's axes I ω' = -ω x I ω, and the orientation is q₀ exp(θ), with θ = 0 at the start of a step. 2.2.2 uses
//! θ' = ω in all stages. 4.x uses the Runge-Kutta-Munthe-Kaas method,
//!
//! ```text
//! θ' = ω + θ x ω/2 + (1 - |θ|/2 cot |θ|/2)/|θ|² θ x (θ x ω)
//! ```
//!
//! which makes it of order 4. Source: Munthe-Kaas, BIT 38, 1998.

use nalgebra::{UnitQuaternion, Vector3};

/// The quaternion after `seconds` in steps of `h`, from the angular velocity `spin` in the body's axes; by the
/// Munthe-Kaas method if `corrected`.
pub(super) fn orientation(moments: [f64; 3], spin: [f64; 3], seconds: f64, h: f64, corrected: bool) -> Vec<f64> {
    let inertia = Vector3::from(moments);
    let spin_up = |w: Vector3<f64>| -w.cross(&inertia.component_mul(&w)).component_div(&inertia);
    let turning = |angle: Vector3<f64>, w: Vector3<f64>| {
        if !corrected {
            return w;
        }
        let size = angle.norm();
        // The limit is 1/12, the next term |θ|²/720.
        let second = if size < 1e-6 { 1.0 / 12.0 } else { (1.0 - 0.5 * size / (0.5 * size).tan()) / (size * size) };
        w + 0.5 * angle.cross(&w) + second * angle.cross(&angle.cross(&w))
    };
    let (mut q, mut w) = (UnitQuaternion::identity(), Vector3::from(spin));
    for _ in 0..(seconds / h).round() as u32 {
        let (mut angles, mut spins) = (Vector3::zeros(), Vector3::zeros());
        let (mut angle, mut now) = (Vector3::zeros(), w);
        for (share, part) in [(1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0)] {
            let (of_angle, of_spin) = (turning(angle, now), spin_up(now));
            angles += h / 6.0 * share * of_angle;
            spins += h / 6.0 * share * of_spin;
            (angle, now) = (h * part * of_angle, w + h * part * of_spin);
        }
        q *= UnitQuaternion::from_scaled_axis(angles);
        w += spins;
    }
    q.coords.as_slice().to_vec()
}
