//! A torque-free body conserves its energy ½ ωᵀ I ω and its angular momentum R I ω in world axes.
//!
//! Tolerance: RK4's error of energy is (ω h)⁴/120 per radian: with ω = 7 rad/s, h = 1 ms and 70 rad that is 1e-9. The
//! direction of the angular momentum has the order of the orientation, which is 2 in 2.2.2: (ω h)²/12 per radian of
//! rotation. Only the nutation contributes, not the rotation about the angular momentum itself: a tenth of 3e-4. Euler,
//! of order 1, misses by ω h/2 per radian, percents.

use crate::lab::*;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use nalgebra::{Matrix3, Vector3};

const MOMENTS: [f64; 3] = [0.01, 0.02, 0.025];

/// Largest relative changes of energy and of angular momentum in 10 s, and the changes of energy over time.
fn relative_changes(cfg: SimulationManagerCfg) -> (f64, f64, Vec<[f64; 2]>) {
    let mut lab = Lab::new(cfg);
    let robot = lab.free(&urdf(&[Link::new("body", 1.0, MOMENTS)], &[]), [0.0; 3]);
    lab.write_root_velocity(robot, [0.0; 3], [4.0, 1.0, 5.5]);
    let inertia = Matrix3::from_diagonal(&MOMENTS.into());
    let state = |sim: &SimulationManager| {
        let body = root(sim, robot);
        let r = body.rotation.to_rotation_matrix();
        let momentum: Vector3<f64> = r * (inertia * (r.inverse() * body.angular_velocity));
        (0.5 * momentum.dot(&body.angular_velocity), momentum)
    };
    let (energy, momentum) = state(&lab.sim);
    let (mut worst_energy, mut worst_momentum, mut curve) = (0.0_f64, 0.0_f64, Vec::new());
    lab.run_with(10_000, |t, sim| {
        let (e, l) = state(sim);
        worst_energy = max_or_nan(worst_energy, (e / energy - 1.0).abs());
        worst_momentum = max_or_nan(worst_momentum, (l - momentum).norm() / momentum.norm());
        if ((t * 1e3).round() as u32).is_multiple_of(100) {
            curve.push([t, (e / energy - 1.0).abs().max(1e-12)]);
        }
    });
    (worst_energy, worst_momentum, curve)
}

#[test]
fn holds() {
    law(module_path!(), "½ ωᵀ I ω = const, R I ω = const", |m| {
        let (energy, momentum, curve) = relative_changes(rk4(weightless()));
        let (by_euler, momentum_by_euler, euler_curve) = relative_changes(weightless());
        m.row("change of the energy in 10 s, RK4", "", 0.0, energy, (2e-9, "RK4: (ω h)⁴/120 per radian"));
        let order = match BUILD_VERSION {
            SupportedVersion::V2 => (3e-5, "orientation of order 2: (ω h)²/12 per radian of nutation"),
            SupportedVersion::V4 => (2e-9, "RK4: (ω h)⁴/120 per radian"),
        };
        m.row("change of the angular momentum in 10 s, RK4", "", 0.0, momentum, order);
        m.control("change of the energy in 10 s, RK4", "with Euler, of order 1", by_euler);
        m.control("change of the angular momentum in 10 s, RK4", "with Euler, of order 1", momentum_by_euler);
        let curves = [("RK4", curve), ("Euler", euler_curve)];
        m.plot("Torque-free top, h = 1 ms", ["time [s]", "relative change of the energy"], true, &curves);
        m.versions_differ_in(
            "change of the angular momentum in 10 s, RK4",
            "RK4 turns free bodies with order 2 in 2.2.2 and with order 4 in 4.x (law order_of_free_rotation)",
        );
    });
}
