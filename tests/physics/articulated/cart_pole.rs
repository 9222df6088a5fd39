//! A pole on a free cart. With J = I + m l² about the hinge and the total mass M + m, small angles obey `(J - m²
//! l²/(M + m)) θ'' = ∓ m g l θ`: a hanging pole swings as cos ω t, an upright one falls as cosh ω t, with `ω² = m g
//! l/(J - m² l²/(M + m))`. The cart moves by -m l θ/(M + m) in the opposite direction.
//!
//! Tolerance: third-order terms, ε² of the angle times the growth ω t/4: 1e-5 of the angle, with ε = 1e-3 hanging and
//! 1e-5 upright.

use crate::lab::*;
use std::f64::consts::PI;

const CART: f64 = 1.5;
const POLE: f64 = 0.4;
const ARM: f64 = 0.3;
const MOMENT: f64 = 0.012;

/// Angle of the pole from its start (hanging at 0, upright at π) and position of the cart after `seconds`.
fn angle_and_position(upright: bool, small: f64, seconds: f64, cart: f64) -> [f64; 2] {
    let links = [
        base(),
        Link::new("cart", cart, [0.1; 3]),
        Link::new("pole", POLE, [MOMENT, MOMENT, 1e-4]).at([0.0, 0.0, -ARM]),
    ];
    let slide = Joint::slide("rail", ["base", "cart"], [1.0, 0.0, 0.0]);
    let hinge = Joint::hinge("hinge", ["cart", "pole"], [0.0, 1.0, 0.0]).at([0.0, 0.0, 0.1]);
    let mut lab = Lab::new(rk4(earth()));
    let robot = lab.mechanism(&urdf(&links, &[slide, hinge]));
    let from = if upright { PI } else { 0.0 };
    lab.write_joints(robot, &[0.0, from + small], &[0.0, 0.0]);
    lab.run(seconds);
    let q = lab.q(robot);
    [q[1] - from, q[0]]
}

#[test]
fn holds() {
    law(module_path!(), "ω² = m g l/(I + m l² - m² l²/(M + m))", |m| {
        let all = CART + POLE;
        let omega = (POLE * G * ARM / (MOMENT + POLE * ARM * ARM - (POLE * ARM).powi(2) / all)).sqrt();
        let (small, tiny) = (1e-3, 1e-5);
        let third_order = |size: f64| (1e-5 * size, "terms of third order");
        let [swing, cart] = angle_and_position(false, small, 2.0, CART);
        let angle = small * (2.0 * omega).cos();
        m.row("angle after 2 s, hanging", "rad", angle, swing, third_order(small));
        // The hinge turns about y: below the hinge a positive angle points to -x, and the cart moves the other way.
        let reaction = POLE * ARM / all * (angle - small);
        m.row("place of the cart after 2 s", "m", reaction, cart, third_order(small));
        let grown = tiny * (0.8 * omega).cosh();
        m.row(
            "angle after 0.8 s, upright",
            "rad",
            grown,
            angle_and_position(true, tiny, 0.8, CART)[0],
            third_order(grown),
        );
        let nailed = angle_and_position(false, small, 2.0, 1e6 * CART);
        m.control("angle after 2 s, hanging", "with a cart that does not move", nailed[0]);
        m.control("place of the cart after 2 s", "with a cart that does not move", nailed[1]);
        m.control(
            "angle after 0.8 s, upright",
            "with a cart that does not move",
            angle_and_position(true, tiny, 0.8, 1e6 * CART)[0],
        );
    });
}
