//! Atwood's machine: two masses on a rope over a pulley, a = g (m₁ - m₂)/(m₁ + m₂). The rope is a mimic joint with the
//! ratio -1.
//!
//! Tolerance: the compliance of the coupling, 1e-4, affects positions only. Once the rope is taut, after some steps,
//! its stretch carries the load, and the velocities are those of a rigid rope. Rounding of 500 sums of up to 5 m/s:
//! 1e-12.

use crate::lab::*;

/// Velocities of both masses after half a second.
fn velocities(masses: [f64; 2], coupled: bool) -> [f64; 2] {
    let links = [base(), Link::new("left", masses[0], [0.01; 3]), Link::new("right", masses[1], [0.01; 3])];
    let down = [0.0, 0.0, -1.0];
    let right = Joint::slide("right_joint", ["base", "right"], down);
    let right = if coupled { right.mimic("left_joint", -1.0) } else { right };
    let mut lab = Lab::new(earth());
    let robot = lab.mechanism(&urdf(&links, &[Joint::slide("left_joint", ["base", "left"], down), right]));
    lab.run(0.5);
    let v = lab.v(robot);
    [v[0], v[1]]
}

#[test]
fn holds() {
    law(module_path!(), "a = g (m₁ - m₂)/(m₁ + m₂)", |m| {
        let masses = [3.0, 2.0];
        let speed = 0.5 * G * (masses[0] - masses[1]) / (masses[0] + masses[1]);
        let (together, apart) = (velocities(masses, true), velocities(masses, false));
        for (k, (name, sign)) in [("heavy side", 1.0), ("light side", -1.0)].into_iter().enumerate() {
            let quantity = format!("velocity after 0.5 s, {name}");
            m.row(&quantity, "m/s", sign * speed, together[k], (1e-12, "rounding of 500 steps"));
            m.control(&quantity, "without the rope", apart[k]);
        }
    });
}
