//! Galilean invariance: two colliding balls separate in the same way if both have an additional velocity of 7, -3 and 5
//! m/s.
//!
//! Tolerance: positions of some meters instead of centimeters: 1e-15 of rounding in the depth times a contact stiffness
//! of 1e5/s² over ten steps: 1e-10.

use crate::lab::*;
use kinetoscope_testkit::worlds::object;

/// Velocities after half a second, minus the common initial velocity.
fn final_velocities(along: [f64; 3], faster: f64) -> [Vector3<f64>; 2] {
    let mut lab = Lab::new(weightless());
    let mut ball = |uid: &str, at: [f64; 3]| {
        let ball = object(uid, ObjectShape::Sphere { radius: 0.1 }, at);
        lab.object(RigidObjectCfg { restitution: Some(0.7), ..ball })
    };
    let (left, right) = (ball("left", [-0.3, 0.03, 0.0]), ball("right", [0.0; 3]));
    lab.write_velocity(left, [along[0] + 1.0 + faster, along[1], along[2]], [0.0; 3]);
    lab.write_velocity(right, along, [0.0; 3]);
    lab.run(0.5);
    [left, right].map(|id| lab.body(id).velocity - Vector3::from(along))
}

#[test]
fn holds() {
    law(module_path!(), "v' - u = v'(u = 0)", |m| {
        let along = [7.0, -3.0, 5.0];
        let (here, there, faster) =
            (final_velocities([0.0; 3], 0.0), final_velocities(along, 0.0), final_velocities(along, 0.001));
        for (k, name) in ["left", "right"].into_iter().enumerate() {
            for (axis, letter) in ["x", "y"].into_iter().enumerate() {
                let quantity = format!("velocity of the {name} ball, {letter}");
                let rounding = (1e-10, "rounding of places, times the stiffness of the contact");
                m.row(&quantity, "m/s", here[k][axis], there[k][axis], rounding);
                m.control(&quantity, "met 1 mm/s faster", faster[k][axis]);
            }
        }
    });
}
