//! Wrench of a joint on its load. A hanging load is held with m g, and an off-axis load with the torque r x m g. A load
//! that rotates with ω at the radius r is pulled inward with m ω² r. If its axis is not principal, the bearing rotates
//! the angular momentum: ω x (I ω), which about z is ω² (-I_yz, I_xz, 0). A drive acts about the axis.
//!
//! Tolerance: rounding of accelerations over a step of 1 ms, times 3 kg: 1e-9.

use crate::lab::*;
use kinetoscope::sensors::JointWrenchCfg;
use nalgebra::Matrix3;

const MASS: f64 = 3.0;
const RADIUS: f64 = 0.25;
const SPIN: f64 = 8.0;
/// I_xz and I_yz \[kg m²\].
const SKEW: [f64; 2] = [0.01, -0.006];

/// Force and torque on the load, in its axes, after 0.2 s.
fn load_wrench(skew: [f64; 2], spin: f64, mass: f64, effort: f64) -> [f64; 6] {
    let mut lab = Lab::new(earth());
    let inertia = Matrix3::new(0.05, 0.0, skew[0], 0.0, 0.06, skew[1], skew[0], skew[1], 0.04);
    let load = Link { inertia, ..Link::new("load", mass, [0.0; 3]).at([RADIUS, 0.0, 0.0]) };
    let text = urdf(&[base(), load], &[Joint::hinge("turn", ["base", "load"], [0.0, 0.0, 1.0]).at([0.1, 0.2, 1.0])]);
    let robot = lab.mechanism(&text);
    let links = vec!["load".into()];
    let id = lab.sim.add_sensor("wrench", JointWrenchCfg { links, ..JointWrenchCfg::default() }).unwrap();
    lab.write_joints(robot, &[0.0], &[spin]);
    lab.set_joint_efforts(robot, &[effort]);
    lab.run(0.2);
    let wrench = lab.sim.sensor(id).unwrap();
    let (force, torque) = (wrench.forces(), wrench.torques());
    std::array::from_fn(|k| if k < 3 { force[(0, 0, k)] } else { torque[(0, 0, k - 3)] })
}

#[test]
fn holds() {
    law(module_path!(), "F = m (a - g); T = r x F + I α + ω x (I ω)", |m| {
        let names = ["force x", "force y", "force z", "torque x", "torque y", "torque z"];
        let moment = 0.04 + MASS * RADIUS * RADIUS;
        let effort = 0.5;
        for (name, spin, effort) in [("at rest", 0.0, 0.0), ("turning", SPIN, 0.0), ("speeding up", SPIN, effort)] {
            let alpha = effort / moment;
            // The reading belongs to the beginning of the last step.
            let omega = spin + alpha * (0.2 - 1e-3);
            let square = omega * omega;
            let expected = [
                -MASS * square * RADIUS,
                MASS * alpha * RADIUS,
                MASS * G,
                SKEW[0] * alpha - SKEW[1] * square,
                SKEW[1] * alpha + SKEW[0] * square - RADIUS * MASS * G,
                effort,
            ];
            let found = load_wrench(SKEW, spin, MASS, effort);
            // Controls: for each row, one cause is changed at a time.
            let slower = ("that turns by 0.5 rad/s less", load_wrench(SKEW, spin - 0.5, MASS, effort));
            let pushed = ("that is driven with 0.1 N m more", load_wrench(SKEW, spin, MASS, effort + 0.1));
            let heavier = ("that is 10 % heavier", load_wrench(SKEW, spin, 1.1 * MASS, effort));
            let straight = ("whose axis is principal", load_wrench([0.0; 2], spin, MASS, effort));
            let (about_x, about_y) = if spin == 0.0 { (&slower, &heavier) } else { (&straight, &straight) };
            let others = [&slower, &pushed, &heavier, about_x, about_y, &pushed];
            for (k, axis) in names.into_iter().enumerate() {
                let quantity = format!("{axis}, {name}");
                let unit = if k < 3 { "N" } else { "N m" };
                m.row(&quantity, unit, expected[k], found[k], (1e-9, "rounding of a velocity over 1 ms"));
                let (without, other) = others[k];
                m.control(&quantity, &format!("of a load {without}"), other[k]);
            }
        }
    });
}
