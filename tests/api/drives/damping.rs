//! Viscous damping B of the file's joints together with drives.
//!
//! Both act at the end of the step: M (v' - v) = h (tau(q', v') - B v'), so
//!
//! ```text
//! v' = (M v + h (kp (q* - q) + kd v* + tau_ff)) / (M + h B + h kd + h² kp),   undriven: v' = v M / (M + h B)
//! ```
//!
//! Tolerance 1e-9 after 50 steps. Control: MuJoCo's own damping beside the same row scales the solver's acceleration by
//! M / (M + h B) after the solve: a light link moves more than ten times more slowly.

use crate::drives::worlds::*;
use kinetoscope::prelude::*;
use kinetoscope::sim::mj;
use nalgebra::{DMatrix, DVector};

const EXACT: f64 = 1e-9;
const H: f64 = 0.01;
/// A finger link of 10 g with 0.1 N m s / rad: h B / M = 100.
const M: f64 = 1e-5;
const B: f64 = 0.1;

fn passive(model: DriveModel) -> DriveCfg {
    DriveCfg { drive_type: DriveType::None, model, ..Default::default() }
}

#[test]
fn an_undriven_joint_decays_by_the_recurrence() {
    for model in [DriveModel::Implicit, DriveModel::Actuator] {
        for (m, b) in [(M, B), (0.2, 0.5)] {
            let world = world(&[Joint { damping: b, ..Joint::wheel("j", m) }], passive(model), weightless());
            let mut env = world.env();
            push(&mut env, &[0.0], &[3.0]);
            let (mut q, mut v) = (0.0, 3.0);
            for _ in 0..50 {
                step(&mut env);
                v *= m / (m + H * b);
                q += H * v;
                assert_close(env.data().qvel()[0], v, EXACT, "velocity");
                assert_close(env.data().qpos()[0], q, EXACT, "position");
            }
        }
    }
}

#[test]
fn a_light_damped_drive_follows_the_recurrence() {
    let (kp, kd, aim) = (10.0, 0.5, 0.5);
    let joint = Joint { damping: B, ..Joint::wheel("j", M) };
    let mut world = world(&[joint], gains(kp, kd), weightless());
    world.aim(&[aim]);
    let (mut q, mut v) = (0.0, 0.0);
    for _ in 0..50 {
        world.step(1);
        v = (M * v + H * kp * (aim - q)) / (M + H * B + H * kd + H * H * kp);
        q += H * v;
        assert_close(world.q()[0], q, EXACT, "position");
        assert_close(world.v()[0], v, EXACT, "velocity");
        assert_close(world.effort()[0], kp * (aim - q) - kd * v, EXACT, "effort");
    }

    // The control: the row as it is, the damping left to MuJoCo.
    let mut data = plain(&format!(
        "<mujoco><option timestep=\"{H}\" gravity=\"0 0 0\"/><worldbody><body><joint type=\"hinge\" axis=\"0 1 0\" \
         damping=\"{B}\" frictionloss=\"1\"/><inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"{M} {M} {M}\"/></body>\
         </worldbody></mujoco>"
    ));
    let stiffness = H * (kd + H * kp);
    data.step1().unwrap();
    assert_eq!(data.efc_type()[0] as u32, mj::mjCNSTR_FRICTION_DOF);
    data.efc_d_mut()[0] = stiffness;
    data.efc_r_mut()[0] = 1.0 / stiffness;
    data.efc_aref_mut()[0] = kp * aim / stiffness;
    data.efc_frictionloss_mut()[0] = 1e15;
    data.step2().unwrap();
    let first = H * kp * aim / (M + H * B + H * kd + H * H * kp);
    println!("first step: {first:.4} rad/s by the law, {:.4} rad/s with MuJoCo's own damping", data.qvel()[0]);
    assert!(data.qvel()[0] < 0.1 * first);
}

/// Damping and drives on a chain, in motion under gravity, one joint without a drive's gains, one at its limit.
#[test]
fn one_step_of_a_damped_chain_is_the_linear_system() {
    let a = Joint { damping: 2.0, ..Joint::lever("a", 3.0, 0.2, 0.02).effort(5.0) };
    let b = Joint { damping: 0.7, ..Joint::lever("b", 1.0, 0.1, 5e-3) }.after(&a, [0.4, 0.0, 0.0]);
    let c = Joint { damping: B, axis: [0.0, 0.6, 0.8], ..Joint::lever("c", 0.01, 0.02, 2e-6) };
    let c = c.after(&b, [0.2, 0.0, 0.0]);
    let (kp, kd) = ([1e4, 0.0, 1e3], [1e3, 0.0, 1e2]);
    let drive = DriveCfg {
        stiffness: [("a", kp[0]), ("b", kp[1]), ("c", kp[2])].into(),
        damping: [("a", kd[0]), ("b", kd[1]), ("c", kd[2])].into(),
        ..Default::default()
    };
    let world = world(&[a, b, c], drive, earth());
    let (q, v, aim) = ([0.3, -0.7, 0.4], [1.1, -0.6, 2.0], [0.5, 0.0, 0.41]);
    let mut env = world.env();
    push(&mut env, &q, &v);
    env.drives.position.copy_from_slice(&aim);
    step(&mut env);
    let (mass, bias) = world.dynamics(&q, &v, &EARTH);
    let damping = DVector::from_vec(vec![2.0, 0.7, B]);
    // The first is at its limit, the second has none of its gains.
    assert_eq!(env.drives.effort[0].abs(), 5.0);
    let sign = env.drives.effort[0].signum();
    let (kp, kd) = (DVector::from_vec(vec![0.0, 0.0, kp[2]]), DVector::from_vec(vec![0.0, 0.0, kd[2]]));
    let constant = DVector::from_vec(vec![sign * 5.0, 0.0, kp[2] * (aim[2] - q[2])]);
    let left = &mass + DMatrix::from_diagonal(&(H * damping + H * &kd + H * H * &kp));
    let right = &mass * DVector::from_column_slice(&v) + H * (constant - bias);
    let expected = left.lu().solve(&right).unwrap();
    for i in 0..3 {
        assert_close(env.data().qvel()[i], expected[i], EXACT, &format!("joint {i}"));
    }
}

/// A damped planar joint between base and arm is no drive, but it must not spoil one: the effort is the law at the new
/// state.
#[test]
fn damping_of_a_planar_joint_leaves_the_drives_exact() {
    let cart = Joint { damping: 50.0, axis: [0.0, 0.0, 1.0], mass: 2.0, ..Joint::new("cart", "planar") };
    let arm = Joint::lever("arm", 0.5, 0.2, 0.01).after(&cart, [0.1, 0.0, 0.0]);
    let (kp, kd, aim) = (200.0, 20.0, 0.5);
    let world = world(&[cart, arm], gains(kp, kd), weightless());
    let mut env = world.env();
    env.drives.position[0] = aim;
    let drive = env.drives.table().drives[0].clone();
    for _ in 0..20 {
        step(&mut env);
        let (q, v) = (env.data().qpos()[drive.qpos], env.data().qvel()[drive.dof]);
        assert_close(env.drives.effort[0], kp * (aim - q) - kd * v, EXACT, "effort at the new state");
    }
    assert!(env.data().qpos()[0].abs() > 1e-4, "the cart moves");
}
