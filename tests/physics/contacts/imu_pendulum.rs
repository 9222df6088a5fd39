//! An IMU in the bob of a pendulum measures only the force of the rod: g cos θ + ω² L along the rod and zero across it.
//! With L ω² = 2 g (cos θ - cos θ₀) the first is g (3 cos θ - 2 cos θ₀): g (3 - 2 cos θ₀) at the bottom, g cos θ₀ at
//! the ends. Half way up the rod, the IMU measures half of g sin θ across it.
//!
//! Tolerance: MuJoCo's Euler conserves H - h/2 ω ∂V/∂θ, which is H at the bottom and at the ends. The reading is off by
//! (ω₀ h)², 1e-7, and by the distance of a step from an extremum, as much: 1e-6 g.

use crate::lab::*;

const LENGTH: f64 = 1.0;
const START: f64 = 1.0;

/// Largest and smallest reading along the rod and largest across it, for a swing from `angle`. The IMU is at the
/// fraction `part` of the rod's length.
fn imu_readings(angle: f64, part: f64) -> [f64; 3] {
    let mut lab = Lab::new(with_dt(1e-4, earth()));
    let joint = Joint::hinge("pivot", ["base", "bob"], [0.0, 1.0, 0.0]);
    let robot = lab.mechanism(&urdf(&[base(), Link::point("bob", 1.0, [0.0, 0.0, -LENGTH])], &[joint]));
    let offset = Pose::translation(0.0, 0.0, -part * LENGTH);
    let id = lab.sim.add_sensor("imu", ImuCfg { offset, ..ImuCfg::on("bob") }).unwrap();
    lab.write_joints(robot, &[angle], &[0.0]);
    let mut felt = [0.0_f64, f64::INFINITY, 0.0];
    // From here, half a swing takes 1.07 s.
    lab.run_with(11_500, |_, sim| {
        let a = sim.sensor(id).unwrap().lin_acc_b();
        felt = [felt[0].max(a[(0, 2)]), felt[1].min(a[(0, 2)]), felt[2].max(a[(0, 0)].abs())];
    });
    felt
}

#[test]
fn holds() {
    law(module_path!(), "along: g (3 cos θ - 2 cos θ₀); across: 0", |m| {
        let (bob, middle, lower) =
            (imu_readings(START, 1.0), imu_readings(START, 0.5), imu_readings(0.99 * START, 1.0));
        let order = (1e-6 * G, "(ω₀ h)², and a step at the extremum");
        m.row("along the rod at the bottom", "m/s²", G * (3.0 - 2.0 * START.cos()), bob[0], order);
        m.row("along the rod at the ends", "m/s²", G * START.cos(), bob[1], order);
        m.row("across the rod", "m/s²", 0.0, bob[2], order);
        m.row("across the rod in the middle", "m/s²", 0.5 * G * START.sin(), middle[2], order);
        m.control("along the rod at the bottom", "from 1 % lower", lower[0]);
        m.control("along the rod at the ends", "from 1 % lower", lower[1]);
        m.control("across the rod", "in the middle of the rod", middle[2]);
        m.control("across the rod in the middle", "in the bob", bob[2]);
    });
}
