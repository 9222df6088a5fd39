//! A tumbling projectile: its center of mass, which is not its frame's origin, moves along the parabola v t - g t²/2
//! independent of the rotation.
//!
//! Tolerance: MuJoCo integrates the frame, and the center of mass follows from the orientation. RK4 of 2.2.2 integrates
//! free rotation with order 2 (law `order_of_free_rotation`), which gives an error of 2e-4 m at 1 ms. The position is
//! therefore extrapolated to h -> 0 from steps of 1 ms and half of that: (4 x(h/2) - x(h))/3. The next term is ω h =
//! 0.018 of the error: 4e-6 m. With order 4 (4.x) the error is (ω h)⁴ ω t/120, 3e-8 rad, times the offset of at most
//! 0.1 m: 1e-8 m.

use crate::lab::*;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use nalgebra::{Translation3, UnitQuaternion, Vector3};

/// Initial orientation, which must not matter: velocities are written in world axes.
fn start() -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(0.5, -0.8, 1.2)
}

/// Center of mass 2 s after the throw, in steps of `dt` \[m\].
fn com_after_flight(dt: f64, gravity: bool, com: [f64; 3]) -> Vector3<f64> {
    let mut lab = Lab::new(rk4(with_dt(dt, if gravity { earth() } else { weightless() })));
    let link = Link { rpy: [0.3, 0.2, 0.1], ..Link::new("body", 2.0, [0.02, 0.05, 0.06]).at(com) };
    let robot = lab.free(&urdf(&[link], &[]), [0.0; 3]);
    let pose = Pose::from_parts(Translation3::identity(), start());
    lab.sim.robot_mut(robot).write_root_pose(&pose_row(&pose), None).unwrap();
    let throw = [1.0, 2.0, 8.0, 10.0, 12.0, -9.0];
    lab.sim.robot_mut(robot).write_root_com_velocity(&row(&throw), None).unwrap();
    lab.run(2.0);
    let com = lab.sim.robot(robot).root_com_position();
    Vector3::new(com[(0, 0)], com[(0, 1)], com[(0, 2)])
}

/// As [`com_after_flight`], extrapolated to steps of 0.
fn extrapolated_com(gravity: bool, com: [f64; 3]) -> Vector3<f64> {
    let [whole, half] = [1e-3, 5e-4].map(|dt| com_after_flight(dt, gravity, com));
    (4.0 * half - whole) / 3.0
}

#[test]
fn holds() {
    law(module_path!(), "r_com = r0 + v t - g t²/2, whatever the spin", |m| {
        let com = [0.06, -0.05, 0.06];
        let place = extrapolated_com(true, com);
        let expected: Vector3<f64> =
            start() * Vector3::from(com) + 2.0 * Vector3::new(1.0, 2.0, 8.0) - Vector3::new(0.0, 0.0, G * 2.0);
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let tolerance = match BUILD_VERSION {
                SupportedVersion::V2 => (4e-6, "ω h of what order 2 leaves at 1 ms"),
                SupportedVersion::V4 => (1e-8, "orientation of order 4, (ω h)⁴ ω t/120, times the offset"),
            };
            m.row(&format!("center of mass, {axis}"), "m", expected[k], place[k], tolerance);
        }
        m.control("center of mass, z", "without gravity", extrapolated_com(false, com).z);
        let central = extrapolated_com(true, [0.0; 3]);
        m.control("center of mass, x", "without the offset", central.x);
        m.control("center of mass, y", "without the offset", central.y);
        m.versions_differ(
            "RK4 turns free bodies with order 2 in 2.2.2 and with order 4 in 4.x (law order_of_free_rotation)",
        );
    });
}
