//! A ball falls from h and rises to e² h, where e is its restitution; without loss it rises to h after every bounce.
//!
//! Tolerance: a contact lasts ten steps, so the result depends on the fraction of a step at which the ball arrives. The
//! tolerance is the worst over all such fractions, by the recursion of these steps (`bounce.rs`). A relative height
//! error x of one bounce is (1 + x)^10 - 1 after ten. The height after one fall is predicted by the recursion, up to
//! the error of MuJoCo's impedance.

use crate::bounce::{apex, apex_error, apex_impedance_error};
use crate::lab::*;
use kinetoscope_testkit::worlds::ball;

/// Step \[s\].
const H: f64 = 1e-4;
const HEIGHT: f64 = 0.5;
const RADIUS: f64 = 0.1;

/// Apex heights between bounces, and all sampled heights.
fn apexes(restitution: Option<f64>, bounces: usize) -> (Vec<f64>, Vec<[f64; 2]>) {
    let cfg = SimulationManagerCfg { ground: Some(GroundCfg::default()), ..with_dt(H, earth()) };
    let mut lab = Lab::new(cfg);
    let ball = ball("ball", RADIUS, 0.7, [0.0, 0.0, RADIUS + HEIGHT]);
    let ball = lab.object(RigidObjectCfg { restitution, ..ball });
    let (mut apexes, mut rising, mut curve) = (Vec::new(), false, Vec::new());
    let steps = 6_400 * (bounces as u32 + 1);
    lab.run_with(steps, |t, sim| {
        let ball = body(sim, ball);
        let height = ball.position.z - RADIUS;
        if rising && ball.velocity.z <= 0.0 {
            apexes.push(height);
        }
        rising = ball.velocity.z > 0.0;
        if ((t * 1e4).round() as u32).is_multiple_of(100) {
            curve.push([t, height]);
        }
    });
    (apexes, curve)
}

#[test]
fn holds() {
    law(module_path!(), "apex = e² h", |m| {
        let (mut curves, mut soft) = (Vec::new(), f64::NAN);
        for (e, name) in [(1.0, "e = 1"), (0.8, "e = 0.8"), (0.5, "e = 0.5")] {
            let (found, curve) = apexes(Some(e), 2);
            let tolerance = (apex_error(e, HEIGHT, H, G), "the steps of a contact, wherever it begins in one");
            m.row(&format!("apex, {name}"), "m", e * e * HEIGHT, found[0], tolerance);
            let rest = (apex_impedance_error(e, HEIGHT), "what the impedance leaves");
            m.row(&format!("apex, {name}, by its steps"), "m", apex(e, HEIGHT, H, G), found[0], rest);
            curves.push((name, curve));
        }
        let (ten, _) = apexes(Some(1.0), 10);
        let in_ten = HEIGHT * ((1.0 + apex_error(1.0, HEIGHT, H, G) / HEIGHT).powi(10) - 1.0);
        m.row("apex after ten bounces, e = 1", "m", HEIGHT, ten[9], (in_ten, "the steps of ten contacts"));
        for name in ["e = 1", "e = 0.8", "e = 0.5"] {
            if soft.is_nan() {
                soft = apexes(None, 2).0[0];
            }
            m.control(&format!("apex, {name}"), "with MuJoCo's own contacts", soft);
        }
        for (e, name) in [(1.0, "e = 1"), (0.8, "e = 0.8"), (0.5, "e = 0.5")] {
            let other = apexes(Some(e - 0.02), 1).0[0];
            m.control(&format!("apex, {name}, by its steps"), "with a restitution that is 0.02 less", other);
        }
        m.control("apex after ten bounces, e = 1", "with e = 0.8", apexes(Some(0.8), 10).0[9]);
        m.plot("A ball bounces", ["time [s]", "height [m]"], false, &curves);
    });
}
