//! Two free bodies connected by a spring: their distance oscillates as q₀ cos ω t with ω² = k (1/m₁ + 1/m₂), and the
//! center of mass stays at rest. A slide with an explicit drive of stiffness k is the spring.
//!
//! Tolerance: RK4 of a linear oscillator is off by (ω h)⁴ ω t/120 of the amplitude: 3e-9 after 2 s at 11.5 rad/s.

use crate::lab::*;

const MASSES: [f64; 2] = [1.0, 3.0];
const STIFFNESS: f64 = 100.0;
const STRETCH: f64 = 0.2;

/// Stretch of the spring and position of the first body after 2 s.
fn stretch_and_position(stiffness: f64) -> [f64; 2] {
    let mut lab = Lab::new(rk4(weightless()));
    let cube = |name, mass| Link::brick(name, mass, [0.1; 3]).without_collision();
    let slide = Joint::slide("spring", ["left", "right"], [1.0, 0.0, 0.0]).at([0.5, 0.0, 0.0]);
    let text = urdf(&[cube("left", MASSES[0]), cube("right", MASSES[1])], &[slide]);
    let drive = explicit(stiffness, 0.0);
    let robot = lab.robot(&text, RobotCfg { drive, fix_base: false, ..RobotCfg::default() });
    lab.write_joints(robot, &[STRETCH], &[0.0]);
    lab.run(2.0);
    [lab.q(robot)[0], lab.root(robot).position.x]
}

#[test]
fn holds() {
    law(module_path!(), "q = q₀ cos(√(k (1/m₁ + 1/m₂)) t), m₁ x₁ + m₂ x₂ = const", |m| {
        let omega = (STIFFNESS * (1.0 / MASSES[0] + 1.0 / MASSES[1])).sqrt();
        let stretch = STRETCH * (omega * 2.0).cos();
        let moved = (STRETCH - stretch) * MASSES[1] / (MASSES[0] + MASSES[1]);
        let ([found, place], [stiffer, place_of_stiffer]) =
            (stretch_and_position(STIFFNESS), stretch_and_position(1.01 * STIFFNESS));
        let order = (1e-8, "RK4: (ω h)⁴ ω t/120 of the amplitude");
        m.row("stretch after 2 s", "m", stretch, found, order);
        m.row("place of the first body after 2 s", "m", moved, place, order);
        m.control("stretch after 2 s", "with a spring 1 % stiffer", stiffer);
        m.control("place of the first body after 2 s", "with a spring 1 % stiffer", place_of_stiffer);
    });
}
