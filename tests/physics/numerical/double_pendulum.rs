//! The double pendulum of [`convergence`](super::convergence) in steps of each integrator, written without MuJoCo: where the
//! tolerances of orders come from.
//!
//! Two rods of 1 kg and 1 m at the angles a and b from the vertical, c = cos(a - b), s = sin(a - b):
//!
//! ```text
//! 4/3 a'' + c/2 b'' = -s/2 b'² - 3/2 g sin a,      c/2 a'' + 1/3 b'' = s/2 a'² - g/2 sin b
//! ```
//!
//! Semi-implicit Euler takes h of these accelerations, then h of the new velocities. `implicit` solves (M - h D) v' = f for the
//! accelerations, D being the derivative of the right side by the velocities: [0, -s b'; s a', 0].

use super::convergence::{self, START, TIME};
use crate::lab::G;
use nalgebra::{Matrix2, Vector2, Vector4};

/// How a step is made.
#[derive(Clone, Copy, Debug)]
pub(super) enum Steps {
    Euler,
    Implicit,
    RungeKutta,
}

/// Accelerations; with `h` \[s\] above 0 those of `implicit`.
fn accelerations(q: Vector2<f64>, v: Vector2<f64>, h: f64) -> Vector2<f64> {
    let (s, c) = (q.x - q.y).sin_cos();
    let mass = Matrix2::new(4.0 / 3.0, 0.5 * c, 0.5 * c, 1.0 / 3.0);
    let by_velocity = Matrix2::new(0.0, -s * v.y, s * v.x, 0.0);
    let force = Vector2::new(-0.5 * s * v.y * v.y - 1.5 * G * q.x.sin(), 0.5 * s * v.x * v.x - 0.5 * G * q.y.sin());
    (mass - h * by_velocity).try_inverse().unwrap() * force
}

/// Angles of the joints after [`TIME`], in steps of `h`.
pub(super) fn angles(steps: Steps, h: f64) -> Vec<f64> {
    let velocity = |x: Vector4<f64>| Vector2::new(x.z, x.w);
    let rate = |x: Vector4<f64>| {
        let a = accelerations(x.xy(), velocity(x), 0.0);
        Vector4::new(x.z, x.w, a.x, a.y)
    };
    // From the angles of the joints to those of the rods.
    let ([q, r], [v, w]) = START;
    let mut x = Vector4::new(q, q + r, v, v + w);
    for _ in 0..(TIME / h).round() as u32 {
        match steps {
            Steps::RungeKutta => {
                let a = rate(x);
                let b = rate(x + 0.5 * h * a);
                let c = rate(x + 0.5 * h * b);
                let d = rate(x + h * c);
                x += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
            }
            Steps::Euler | Steps::Implicit => {
                let by_velocity = if matches!(steps, Steps::Implicit) { h } else { 0.0 };
                let v = velocity(x) + h * accelerations(x.xy(), velocity(x), by_velocity);
                let q = x.xy() + h * v;
                x = Vector4::new(q.x, q.y, v.x, v.y);
            }
        }
    }
    vec![x.x, x.y - x.x]
}

/// Errors at these steps, by the equations above.
pub(super) fn errors(steps: &[f64], integrator: Steps) -> Vec<[f64; 2]> {
    convergence::errors(steps, &angles(Steps::RungeKutta, convergence::FINE), |h| angles(integrator, h))
}

/// The largest error of the angles \[rad\] by rounding, at steps of `h` or more: half a digit of angles of up to 3 rad in each step, of
/// both answers.
pub(super) fn rounding(h: f64) -> f64 {
    (TIME / h + TIME / convergence::FINE) * 3.0 * f64::EPSILON / 2.0
}
