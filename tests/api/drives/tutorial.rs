//! The tutorial's gains (arm 1e4 / 1e3, hand 1e3 / 1e2) at dt 0.01 on links down to 10 g with effort limits that
//! saturate: no warnings, no NaN, the limit held exactly, settled within 0.5 s.
//!
//! Settled: |q* - q| < 20 mrad from then on. What the limits allow is far below 0.5 s: 28 N m on 0.02 kg m² need
//! 2 sqrt(0.5 / 1400) = 0.04 s, 150 N m on the whole arm (6 kg m²) 2 sqrt(0.5 / 25) = 0.28 s, then kd / kp = 0.1 s is the
//! time constant of the overdamped drive: ln(0.5 / 0.02) x 0.1 s = 0.32 s. A fine-step reference of the same arm
//! (dt 1e-5) settles in 0.33 s.
//!
//! At every step each drive's effort is the law at the new state, clamp(kp (q* - q') - kd v'), within 1e-6 of its limit
//! (the solver stops at a relative improvement of 1e-8).
//!
//! Control: the same robot with MuJoCo's own actuators diverges.

use crate::drives::worlds::*;
use kinetoscope::prelude::*;

const STEP: f64 = 0.5;
const SETTLED: f64 = 0.02;

#[test]
fn arm_and_hand_settle_within_their_limits() {
    let mut world = world(&arm_and_hand(), tutorial_gains(), earth());
    let limits = world.limits();
    let n = limits.len();
    let aim = vec![STEP; n];
    world.aim(&aim);
    let (mut settled, mut saturated, mut law) = (vec![0.0; n], vec![0; n], 0.0_f64);
    for k in 1..=200 {
        world.step(1);
        let (q, v, tau) = (world.q(), world.v(), world.effort());
        for i in 0..n {
            assert!(tau[i].abs() <= limits[i], "joint {i}, step {k}: {} over {}", tau[i], limits[i]);
            let (kp, kd) = if i < 6 { (1e4, 1e3) } else { (1e3, 1e2) };
            let asked = (kp * (aim[i] - q[i]) - kd * v[i]).clamp(-limits[i], limits[i]);
            law = law.max((asked - tau[i]).abs() / limits[i]);
            saturated[i] += usize::from(tau[i].abs() == limits[i]);
            if (aim[i] - q[i]).abs() > SETTLED {
                settled[i] = 0.01 * f64::from(k);
            }
        }
    }
    world.assert_well();
    let latest = |range: std::ops::Range<usize>| settled[range].iter().fold(0.0_f64, |m, t| m.max(*t));
    println!(
        "settled: arm {:.2} s, hand {:.2} s; steps at the limit: arm {:?}, hand {:?}; law within {law:.1e} of the limit",
        latest(0..6),
        latest(6..n),
        &saturated[..6],
        &saturated[6..]
    );
    assert!(latest(0..n) <= 0.5, "{settled:?}");
    assert!(saturated[1] > 10, "a limit binds: {saturated:?}");
    assert!(law < 1e-6, "{law}");
    assert!(world.v().iter().all(|v| v.abs() < 1e-3), "at rest after 2 s");
    // Left is gravity's share, and no more: q* - q = tau_g / kp.
    let load = world.load_by_gravity(&EARTH);
    for i in 0..n {
        let kp = if i < 6 { 1e4 } else { 1e3 };
        assert_close(aim[i] - world.q()[i], load[i] / kp, 1e-6, "sag");
    }
}

#[test]
fn mujocos_own_actuators_diverge_with_these_gains() {
    let drive = DriveCfg { model: DriveModel::Actuator, ..tutorial_gains() };
    let mut world = world(&arm_and_hand(), drive, earth());
    world.aim(&vec![STEP; world.limits().len()]);
    world.step(200);
    assert_eq!(world.sim.diverged().len(), 1);
}

/// Limits a little above gravity's load, so that every one of them binds: held exactly, and settled all the same.
#[test]
fn limits_that_all_bind_are_held() {
    let mut joints = arm_and_hand();
    for (joint, limit) in
        joints.iter_mut().zip([4.0, 140.0, 60.0, 0.6, 5.0, 0.08].into_iter().chain([0.03, 0.012, 0.003].repeat(4)))
    {
        joint.limit = joint.limit.split("effort").next().unwrap().to_string();
        *joint = joint.clone().effort(limit);
    }
    let mut world = world(&joints, tutorial_gains(), earth());
    let (limits, n) = (world.limits(), world.limits().len());
    world.aim(&vec![STEP; n]);
    let mut saturated = vec![0; n];
    for _ in 0..500 {
        world.step(1);
        for (i, tau) in world.effort().into_iter().enumerate() {
            assert!(tau.abs() <= limits[i], "joint {i}: {tau}");
            saturated[i] += usize::from(tau.abs() == limits[i]);
        }
    }
    world.assert_well();
    println!("steps at the limit of 500: {saturated:?}");
    assert!(saturated.iter().all(|&s| s > 0), "{saturated:?}");
    assert!(world.q().iter().all(|q| (q - STEP).abs() < SETTLED), "{:?}", world.q());
}

/// From any pose: targets all over the joints' ranges, a new one every 0.3 s, none of them reached.
#[test]
fn targets_that_jump_about_do_no_harm() {
    let mut world = world(&arm_and_hand(), tutorial_gains(), earth());
    let (limits, n) = (world.limits(), world.limits().len());
    let mut state = 1_u64;
    for _ in 0..12 {
        let aim: Vec<f64> = (0..n)
            .map(|i| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let share = (state >> 11) as f64 / (1_u64 << 53) as f64;
                if i < 6 { -3.0 + 6.0 * share } else { -0.3 + 1.9 * share }
            })
            .collect();
        world.aim(&aim);
        for _ in 0..30 {
            world.step(1);
            assert!(world.effort().iter().zip(&limits).all(|(tau, limit)| tau.abs() <= *limit));
        }
    }
    world.assert_well();
}
