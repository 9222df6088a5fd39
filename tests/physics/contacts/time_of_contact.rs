//! A ball that bounces with restitution e: it falls for √(2 H/g), then each flight lasts e^k 2 √(2 H/g). Each contact
//! lasts as long as its spring requires: without damping half a period, which is ten steps
//! (`RigidObjectCfg::restitution`).
//!
//! Tolerance: one step at each end; for the flights, the restitution error of a contact of ten steps (`bounce.rs`), k
//! times. Gravity prolongs a contact by 2 g/(v ω²), a hundredth of a step.

use crate::bounce::restitution_error;
use crate::lab::*;
use kinetoscope_testkit::worlds::ball;

/// Step \[s\].
const H: f64 = 2e-4;
const HEIGHT: f64 = 0.5;
const RADIUS: f64 = 0.1;

/// Durations of the flights, the fall first, and of the contacts \[s\].
#[derive(Clone, Debug, Default)]
struct Times {
    air: Vec<f64>,
    contact: Vec<f64>,
}

fn bounced(h: f64, restitution: f64, height: f64, seconds: f64) -> Times {
    let mut lab = Lab::new(SimulationManagerCfg { ground: Some(GroundCfg::default()), ..with_dt(h, earth()) });
    let ball = ball("ball", RADIUS, 0.7, [0.0, 0.0, RADIUS + height]);
    lab.object(RigidObjectCfg { restitution: Some(restitution), ..ball });
    let watched =
        ContactSensorCfg { track_air_time: true, force_threshold: 0.0, ..ContactSensorCfg::for_bodies("ball") };
    let id = lab.sim.add_sensor("contact", watched).unwrap();
    let mut times = Times::default();
    lab.run_with((seconds / h).round() as u32, |_, sim| {
        let sensor = sim.sensor(id).unwrap();
        if sensor.first_contact().unwrap()[(0, 0)] {
            times.air.push(sensor.last_air_time().unwrap()[(0, 0)]);
        }
        if sensor.first_air().unwrap()[(0, 0)] {
            times.contact.push(sensor.last_contact_time().unwrap()[(0, 0)]);
        }
    });
    times
}

#[test]
fn holds() {
    law(module_path!(), "t = √(2 H/g), then e^k 2 √(2 H/g); contact: 10 h", |m| {
        let fall = (2.0 * HEIGHT / G).sqrt();
        let (elastic, dull) = (bounced(H, 1.0, HEIGHT, 1.7), bounced(H, 0.8, HEIGHT, 1.7));
        let higher = bounced(H, 1.0, 1.02 * HEIGHT, 0.5);
        m.row("fall", "s", fall, elastic.air[0], (2.0 * H, "a step on both ends"));
        m.control("fall", "from 2 % higher", higher.air[0]);
        let coarse = bounced(2.0 * H, 1.0, HEIGHT, 0.8);
        m.row("contact, e = 1", "s", 10.0 * H, elastic.contact[0], (2.0 * H, "a step on both ends"));
        m.control("contact, e = 1", "in steps of twice the length", coarse.contact[0]);
        let within = (restitution_error(1.0) * 2.0 * fall + 2.0 * H, "the steps of a contact; a step on both ends");
        m.row("flight 1, e = 1", "s", 2.0 * fall, elastic.air[1], within);
        m.control("flight 1, e = 1", "with e = 0.8", dull.air[1]);
        for k in 1..=2 {
            let quantity = format!("flight {k}, e = 0.8");
            let expected = 0.8_f64.powi(k) * 2.0 * fall;
            let promised = f64::from(k) * restitution_error(0.8) / 0.8 * expected + 2.0 * H;
            let within = (promised, "the steps of each contact; a step on both ends");
            m.row(&quantity, "s", expected, dull.air[k as usize], within);
            m.control(&quantity, "with e = 1", elastic.air[k as usize]);
        }
    });
}
