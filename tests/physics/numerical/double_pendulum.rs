//! Explicit steps of the double pendulum of [`convergence`](super::convergence) for each integrator, written without
//! MuJoCo: the source of the tolerances of orders.
//!
//! Two rods of 1 kg and 1 m at the angles a and b from the vertical, c = cos(a - b), s = sin(a - b):
//!
//! ```text
//! 4/3 a'' + c/2 b'' = -s/2 b'² - 3/2 g sin a,      c/2 a'' + 1/3 b'' = s/2 a'² - g/2 sin b
//! ```
//!
//! Semi-implicit Euler adds h of these accelerations, then h of the new velocities. `implicit` solves (M - h D) v' = f
//! for the accelerations, where D is the derivative of the right side by the velocities: [0, -s b'; s a', 0].

use super::convergence::{self, START, TIME};
use crate::lab::G;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

/// Integrator of the steps.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Method {
    Euler,
    Implicit,
    RungeKutta,
}

/// Accelerations; for `h` \[s\] above 0 those of `implicit`.
fn accelerations(q: Vector2<f64>, v: Vector2<f64>, h: f64) -> Vector2<f64> {
    let (s, c) = (q.x - q.y).sin_cos();
    let mass = Matrix2::new(4.0 / 3.0, 0.5 * c, 0.5 * c, 1.0 / 3.0);
    let by_velocity = Matrix2::new(0.0, -s * v.y, s * v.x, 0.0);
    let force = Vector2::new(-0.5 * s * v.y * v.y - 1.5 * G * q.x.sin(), 0.5 * s * v.x * v.x - 0.5 * G * q.y.sin());
    (mass - h * by_velocity).try_inverse().unwrap() * force
}

/// State: the angles of the rods \[rad\], and their velocities \[rad/s\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct RodState(Vector4<f64>);

impl RodState {
    /// Converts the angles \[rad\] and velocities \[rad/s\] of the joints.
    pub(crate) fn from_joints([q, r]: [f64; 2], [v, w]: [f64; 2]) -> Self {
        Self(Vector4::new(q, q + r, v, v + w))
    }

    /// The angles and velocities of the joints.
    pub(crate) fn joints(self) -> ([f64; 2], [f64; 2]) {
        let x = self.0;
        ([x.x, x.y - x.x], [x.z, x.w - x.z])
    }

    /// The state after a step of `h` \[s\], which may be negative.
    pub(crate) fn step(self, steps: Method, h: f64) -> Self {
        let x = self.0;
        let velocity = |x: Vector4<f64>| Vector2::new(x.z, x.w);
        let rate = |x: Vector4<f64>| {
            let a = accelerations(x.xy(), velocity(x), 0.0);
            Vector4::new(x.z, x.w, a.x, a.y)
        };
        Self(match steps {
            Method::RungeKutta => {
                let a = rate(x);
                let b = rate(x + 0.5 * h * a);
                let c = rate(x + 0.5 * h * b);
                let d = rate(x + h * c);
                x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            }
            Method::Euler | Method::Implicit => {
                let by_velocity = if matches!(steps, Method::Implicit) { h } else { 0.0 };
                let v = velocity(x) + h * accelerations(x.xy(), velocity(x), by_velocity);
                let q = x.xy() + h * v;
                Vector4::new(q.x, q.y, v.x, v.y)
            }
        })
    }

    /// Kinetic plus potential energy \[J\], with zero potential at the height of the upper joint: 2/3 a'² + 1/6 b'² +
    /// c/2 a' b' - g (3/2 cos a + 1/2 cos b).
    pub(crate) fn energy(self) -> f64 {
        let [a, b, v, w] = self.0.into();
        let kinetic = 2.0 / 3.0 * v * v + w * w / 6.0 + 0.5 * (a - b).cos() * v * w;
        kinetic - G * (1.5 * a.cos() + 0.5 * b.cos())
    }

    /// Largest energy change by rounding of half a digit of each state variable \[J\].
    pub(crate) fn rounding_of_energy(self) -> f64 {
        let [a, b, v, w] = self.0.into();
        let (s, c) = (a - b).sin_cos();
        let by = [1.5 * G * a.sin() - 0.5 * s * v * w, 0.5 * G * b.sin() + 0.5 * s * v * w]
            .into_iter()
            .chain([4.0 / 3.0 * v + 0.5 * c * w, w / 3.0 + 0.5 * c * v]);
        by.zip([a, b, v, w]).map(|(slope, x)| (slope * x).abs() * f64::EPSILON / 2.0).sum()
    }

    /// Jacobian of a step with respect to the state.
    fn step_jacobian(self, steps: Method, h: f64) -> Matrix4<f64> {
        // A third of the digits: the optimal step of a central difference of numbers with full precision.
        let small = f64::EPSILON.cbrt();
        let column = |i: usize| {
            let by = Vector4::ith(i, small);
            let [up, down] = [self.0 + by, self.0 - by].map(|x| Self(x).step(steps, h).0);
            (up - down) / (2.0 * small)
        };
        Matrix4::from_columns(&[0, 1, 2, 3].map(column))
    }
}

/// State after steps of `sizes` \[s\] (negative: backward), and the bound of its rounding error. The bound adds half a
/// digit of each state variable in each step, propagated to the end: the larger angle \[rad\] and velocity \[rad/s\]
/// error of the joints.
pub(crate) fn integrate(start: RodState, steps: Method, sizes: &[f64]) -> (RodState, [f64; 2]) {
    let mut states = vec![start];
    for (k, &h) in sizes.iter().enumerate() {
        states.push(states[k].step(steps, h));
    }
    let mut grown = Matrix4::<f64>::identity();
    let mut rounding = Vector4::zeros();
    for (pair, &h) in states.windows(2).zip(sizes).rev() {
        rounding += grown.abs() * pair[1].0.abs() * (f64::EPSILON / 2.0);
        grown *= pair[0].step_jacobian(steps, h);
    }
    // The angle of the lower joint is the difference of the angles of two rods.
    let [a, b, v, w] = rounding.into();
    (states[sizes.len()], [a + b, v + w])
}

/// Angles of the joints after [`TIME`], in steps of `h`.
pub(super) fn angles(steps: Method, h: f64) -> Vec<f64> {
    let count = (TIME / h).round() as u32;
    (0..count).fold(RodState::from_joints(START.0, START.1), |rods, _| rods.step(steps, h)).joints().0.to_vec()
}

/// Errors at these steps, by the equations above.
pub(super) fn errors(steps: &[f64], integrator: Method) -> Vec<[f64; 2]> {
    convergence::errors(steps, &angles(Method::RungeKutta, convergence::FINE), |h| angles(integrator, h))
}

/// Bound of the angles' rounding error \[rad\] at steps of `h` or more: half a digit of angles of up to 3 rad in each
/// step, of both solutions.
pub(super) fn rounding(h: f64) -> f64 {
    (TIME / h + TIME / convergence::FINE) * 3.0 * f64::EPSILON / 2.0
}
