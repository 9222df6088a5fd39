//! Rewards and observations, compared with Newton's law.

use super::bundled::{cart_env, cart_task, cfg, world};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::sim::Error;
use kinetoscope::tasks::{ActionTerm, EnvBuilder, EnvCfg, EnvError, ObservationTerm, Space};
use kinetoscope_testkit::tolerance::{Tolerance, assert_close, assert_number};
use std::sync::atomic::AtomicBool;

const DT: f64 = 0.01;
const FORCE: f64 = 4.0;

/// The position \[m\] of a cart of 1 kg after k steps under a constant force. MuJoCo's Euler is semi-implicit: v_k = k
/// h F / m, and x_k = x_(k-1) + h v_k, so x_k = h² F / m (1 + 2 + ... + k).
fn place(k: u64) -> f64 {
    DT * DT * FORCE * (k * (k + 1) / 2) as f64
}

const ROUNDING: Tolerance =
    Tolerance::absolute(1e-12, "sums of 60 numbers below 1: less than 60 x 60 / 2 x 2^-53 of the largest");

#[test]
fn pushed_cart() {
    let mut env = cart_env(3, Some(60));
    env.reset(None, None).unwrap();
    let forces = array![[FORCE], [0.0], [-FORCE]];
    let mut sums = [0.0; 3];
    for k in 1..=60 {
        let step = env.step(&forces).unwrap();
        for (e, sign) in [1.0, 0.0, -1.0].into_iter().enumerate() {
            let seen = [step.final_observations[(e, 0)], step.rewards[e]];
            assert_close(&format!("step {k}"), seen, [sign * place(k), -sign * place(k)], ROUNDING);
            assert_eq!(step.rewards[e], step.info.reward_terms[(e, 0)]);
            sums[e] -= sign * place(k);
        }
        if k == 60 {
            assert_eq!(step.info.ended.len(), 3);
            for ended in &step.info.ended {
                assert_number("sum of the rewards", ended.total_reward(), sums[ended.env.0], ROUNDING * 60.0);
                assert_eq!((ended.steps, ended.reward_sums.len()), (60, 1));
            }
        }
    }
    // Control: a force that is 1 % larger gives another position.
    let other = env.step(&array![[1.01 * FORCE], [0.0], [0.0]]).unwrap();
    assert!((other.final_observations[(0, 0)] - place(1)).abs() > 1e3 * ROUNDING.absolute);
}

#[test]
fn decimation() {
    let run = |every: bool| {
        let (sim, robot) = world(cfg(1, 1), false);
        let space = Space::uniform(["force"], [-10.0, 10.0]).unwrap();
        // Pushes until the cart is 5 mm away. The state is read before each physics step, or only before the first.
        let push = ActionTerm::new("push", space, move |sim, forces| {
            let far = sim.robot(robot).qpos()[(0, 0)] > 0.005;
            let force = if far { Array2::zeros((1, 1)) } else { forces.to_owned() };
            Ok(sim.robot_mut(robot).set_qf_target(&force, None, None)?)
        });
        let push = if every { push.every_physics_step() } else { push };
        let velocity = ObservationTerm::new("v", ["v"], move |now| Ok(now.sim().robot(robot).qvel()));
        let mut env = EnvBuilder::new(sim, EnvCfg { decimation: 10, ..EnvCfg::default() })
            .action(push)
            .observation(velocity)
            .build()
            .unwrap();
        env.reset(None, None).unwrap();
        let seen = env.step(&array![[FORCE]]).unwrap().observations[(0, 0)];
        (seen, env.sim().time()[0])
    };
    // x_k = 0.0004 k (k + 1) / 2 is above 0.005 from k = 5 on (0.006): five physics steps with the force, or all ten.
    let ((each, time), (once, _)) = (run(true), run(false));
    let expected = [5.0 * DT * FORCE, 10.0 * DT * FORCE, 0.1];
    assert_close("each step, the first alone, time", [each, once, time], expected, ROUNDING);
}

/// A step that a flag ends leaves no episode; with a flag that is not set, it is a step, in bits.
#[test]
fn interrupted_steps() {
    let (set, unset) = (AtomicBool::new(true), AtomicBool::new(false));
    let actions = array![[FORCE], [0.0], [-FORCE]];
    let mut env = cart_env(3, None);
    env.reset(None, None).unwrap();
    let stopped = env.step_until(&set, &actions);
    assert!(matches!(stopped, Err(EnvError::Sim(Error::Interrupted))), "{stopped:?}");
    assert!(matches!(env.step(&actions), Err(EnvError::ResetFirst { env: 0 })));
    let mut other = cart_env(3, None);
    other.reset(None, None).unwrap();
    env.reset(None, None).unwrap();
    let (one, two) = (env.step_until(&unset, &actions).unwrap(), other.step(&actions).unwrap());
    assert_eq!((one.observations, one.rewards), (two.observations, two.rewards));
}

#[test]
fn clamped_actions() {
    let (sim, robot) = world(cfg(1, 1), false);
    let mut env = cart_task(sim, robot, EnvCfg::default()).build().unwrap();
    let mut run = |force: f64| {
        env.reset(None, None).unwrap();
        let seen = (0..10).map(|_| env.step(&array![[force]]).unwrap().observations[(0, 0)].to_bits()).collect();
        let now = env.context();
        (seen, now.actions()[(0, 0)])
    };
    for sign in [1.0, -1.0] {
        let (bound, beyond): ((Vec<u64>, f64), _) = (run(sign * 10.0), run(sign * 1e9));
        assert_eq!(bound, beyond);
        assert_eq!(bound.1, sign * 10.0);
        assert_ne!(run(sign * 9.0).0, bound.0, "control");
    }
}
