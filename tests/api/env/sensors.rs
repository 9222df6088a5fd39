//! Observations that sensors of the simulation make.

use super::tasks::{cart_task, cfg, world};
use kinetoscope::env::{EnvCfg, ObservationTerm};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;

/// Gravity of the default world \[m/s²\].
const G: f64 = 9.81;

/// A cart of 1 kg that is pushed by F feels F along its rail and gravity upwards, in the step of the push already: with an
/// accelerometer nothing is integrated. Accelerations of one body are solved to rounding of the largest number in them.
#[test]
fn an_accelerometer_is_seen_as_newton_says_and_begins_anew_with_the_episode() {
    let (mut sim, robot) = world(cfg(3, 2), false);
    let imu = sim.add_sensor("imu", ImuCfg::on("cart/cart")).unwrap();
    let feels =
        ObservationTerm::new("feels", ["x", "y", "z"], move |now| Ok(now.sim().sensor(imu)?.lin_acc_b().to_owned()));
    let cfg = EnvCfg { decimation: 3, episode_steps: Some(5) };
    let mut env = cart_task(sim, robot, cfg).observation(feels.scaled(0.5)).build().unwrap();
    let exact = |seen: &Array2<f64>, forces: [f64; 3], what: &str| {
        for (e, force) in forces.into_iter().enumerate() {
            for (k, expected) in [0.5 * force, 0.0, 0.5 * G].into_iter().enumerate() {
                assert!((seen[(e, 1 + k)] - expected).abs() < 1e-12, "{what}, environment {e}: {}", seen.row(e));
            }
        }
    };
    assert_eq!(env.observation_space().names(), ["place/x", "feels/x", "feels/y", "feels/z"]);
    exact(&env.reset(None, None).unwrap(), [0.0; 3], "before the first step");
    for k in 1..=12 {
        let forces = [4.0, -0.25 * f64::from(k), 0.0];
        let step = env.step(&array![[forces[0]], [forces[1]], [forces[2]]]).unwrap();
        exact(&step.final_observations, forces, &format!("step {k}"));
        // Where the episode is over, the next one begins at rest.
        let next = if k % 5 == 0 { [0.0; 3] } else { forces };
        exact(&step.observations, next, &format!("after step {k}"));
    }
}
