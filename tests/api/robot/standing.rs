//! A quadruped with the legged preset stands still on four feet.

use super::quadruped::{bundled, cfg, vendor};
use kinetoscope::prelude::*;

/// What happened in 60 s.
struct Stood {
    /// Largest less smallest height of the base in the last 30 s \[m\].
    drift: f64,
    /// Mean over the last second of the sum of the vertical forces on the feet, over the weight.
    carried: f64,
    /// Feet that carried something in all of the last second.
    feet: usize,
    /// Largest force on anything that is no foot, in the last 30 s \[N\].
    elsewhere: f64,
}

fn stand(robot: RobotCfg, simulation: SimulationManagerCfg) -> Stood {
    let (uid, dt) = (robot.uid.clone(), simulation.physics_dt);
    let mut sim = SimulationManager::new(simulation).unwrap();
    let robot = sim.add_robot(robot).unwrap();
    let all = sim.add_sensor("all", ContactSensorCfg::of(format!("{uid}/.*"))).unwrap();
    let steps = |seconds: f64| (seconds / dt).round() as u32;
    sim.update(steps(30.0));
    let foot: Vec<bool> = sim.sensor(all).unwrap().body_names().iter().map(|name| name.ends_with("_FOOT")).collect();
    assert_eq!(foot.iter().filter(|foot| **foot).count(), 4);
    let (mut low, mut high, mut elsewhere, mut carried) = (f64::MAX, f64::MIN, 0.0f64, 0.0);
    let mut least = vec![f64::MAX; foot.len()];
    for step in 0..steps(30.0) {
        sim.update(1);
        let height = sim.robot(robot).get_root_pose()[(0, 2)];
        (low, high) = (low.min(height), high.max(height));
        let forces = sim.sensor(all).unwrap().net_forces_w();
        for (body, foot) in foot.iter().enumerate() {
            let force = nalgebra::Vector3::from_fn(|k, _| forces[(0, body, k)]);
            if !foot {
                elsewhere = elsewhere.max(force.norm());
            } else if step >= steps(29.0) {
                carried += force.z / f64::from(steps(1.0));
                least[body] = least[body].min(force.z);
            }
        }
    }
    let feet = (0..foot.len()).filter(|&b| foot[b] && least[b] > 1.0).count();
    Stood { drift: high - low, carried: carried / (9.81 * sim.robot(robot).total_mass()), feet, elsewhere }
}

fn check(name: &str, stood: &Stood) {
    let Stood { drift, carried, feet, elsewhere } = *stood;
    println!("{name}: drift {:.2} mm, carries {carried:.6} of its weight on {feet} feet, {elsewhere} N", 1e3 * drift);
    assert!(drift < 5e-3, "{name}: the base drifts by {drift} m");
    assert!((carried - 1.0).abs() < 0.01, "{name}: the feet carry {carried} of the weight");
    assert!(feet == 4 && elsewhere == 0.0, "{name}: {feet} feet, {elsewhere} N elsewhere");
}

#[test]
fn it_stands_for_a_minute_also_with_a_load_on_its_back() {
    for payload in [0.0, 10.0] {
        let robot = RobotCfg { payload: vec![("base".into(), payload)], ..cfg(bundled(), 80.0, 5.0) };
        check(&format!("{payload} kg"), &stand(robot, SimulationManagerCfg::legged()));
    }
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn the_vendors_robot_stands_for_a_minute() {
    let urdf = vendor();
    check("vendor", &stand(cfg(urdf, 80.0, 5.0), SimulationManagerCfg::legged()));
}

/// The control: with MuJoCo's default contacts its feet creep apart.
#[test]
fn without_the_preset_it_does_not_stand_still() {
    let simulation = SimulationManagerCfg { physics_dt: 0.005, ..Default::default() };
    let stood = stand(cfg(bundled(), 80.0, 5.0), simulation);
    assert!(stood.drift > 5e-3 || stood.elsewhere > 0.0, "drift {} m", stood.drift);
}

#[test]
fn payloads_are_checked() {
    let mut sim = SimulationManager::new(SimulationManagerCfg::legged()).unwrap();
    for (payload, parts) in [
        (("base", -1.0), ["payload", ">= 0"]),
        (("base", f64::NAN), ["payload", "NaN"]),
        (("bsae", 1.0), ["payload", "\"base\""]),
    ] {
        let payload = vec![(payload.0.to_string(), payload.1)];
        let error = sim.add_robot(RobotCfg { payload, ..cfg(bundled(), 80.0, 5.0) }).unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
    let payload = vec![("base".to_string(), 3.0), (".*_FOOT".to_string(), 0.5)];
    let id = sim.add_robot(RobotCfg { payload, ..cfg(bundled(), 80.0, 5.0) }).unwrap();
    assert!((sim.robot(id).total_mass() - 52.13485 - 3.0 - 4.0 * 0.5).abs() < 1e-9);
}
