//! Determinism: the same bits for any number of threads and environments, and for one update or many. The motion is the
//! same for dense and sparse Jacobians, and contacts do not change the efforts of other joints.

use super::support::{add_ball, add_walker, all_bits, cfg, most_contacts, row, sim};
use kinetoscope::mujoco::{Data, compile};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope_testkit::urdf::{TempFiles, joint, limit, link, robot};
use kinetoscope_testkit::worlds::{arm_and_hand, text_robot};

/// The arm reaches into the ground, the walker falls on it and kicks; each environment has its own targets.
fn scene(num_envs: usize, threads: usize) -> SimulationManager {
    let mut sim = sim(cfg(num_envs, threads));
    let arm = sim.add_robot(arm_and_hand("sr5")).unwrap();
    let legs = add_walker(&mut sim, "walker", 0.5);
    for (robot, reach) in [(arm, 1.6), (legs, -0.8)] {
        let dof = sim.robot(robot).dof();
        // The target depends on the index of the environment, not on the number of environments.
        let target = |(env, joint)| {
            if joint == 1 { reach + 0.01 * env as f64 } else { 0.3 + 0.003 * env as f64 }
        };
        sim.robot_mut(robot).set_qpos_target(&Array2::from_shape_fn((num_envs, dof), target), None, None).unwrap();
    }
    sim
}

fn run(num_envs: usize, threads: usize, steps: u32) -> Vec<Vec<u64>> {
    let mut sim = scene(num_envs, threads);
    sim.update(steps);
    assert!(most_contacts(sim.batch()) > 0, "nothing touches: the test tests too little");
    assert!(sim.diverged().is_empty(), "{:?}", sim.diverged());
    all_bits(&sim)
}

#[test]
fn threads() {
    let alone = run(33, 1, 200);
    assert!(alone.iter().skip(1).all(|env| *env != alone[0]), "environments have targets of their own");
    for threads in [2, 3, 8] {
        assert_eq!(run(33, threads, 200), alone, "{threads} threads");
    }
}

#[test]
fn environments() {
    let many = run(64, 2, 150);
    for n in [1, 7, 16, 33] {
        assert_eq!(run(n, 2, 150), many[..n], "{n} environments");
    }
}

/// More steps than one block of steps given to the workers.
#[test]
fn updates() {
    let mut one_by_one = scene(3, 2);
    (0..1003).for_each(|_| one_by_one.update(1));
    let at_once = run(3, 1, 1003);
    assert_eq!(all_bits(&one_by_one), at_once);
    one_by_one.update(0);
    assert_eq!(all_bits(&one_by_one), at_once, "no step changes nothing");
}

#[test]
fn managers_in_threads() {
    let alone = run(3, 1, 100);
    std::thread::scope(|scope| {
        let all: Vec<_> = (0..4).map(|i| scope.spawn(move || run(3, 1 + i % 2, 100))).collect();
        all.into_iter().for_each(|one| assert_eq!(one.join().unwrap(), alone));
    });
}

/// Efforts are those solved in the step, even if new contacts arise at its end. The efforts of a loaded hinge are
/// compared in every step while balls fall next to it.
#[test]
fn efforts_beside_contacts() {
    let [alone, beside] = [0, 6].map(|balls| {
        let mut sim = sim(cfg(1, 1));
        let hinge = joint("hinge", "revolute", ["post", "lever"], [0.0; 3], "0 1 0", &limit([-2.0, 2.0], 50.0, 10.0));
        let lever = link("lever", 2.0, 0.05, [0.5, 0.0, 0.0], "");
        let urdf = robot("lever", &format!("<link name=\"post\"/>{hinge}{lever}"));
        let init_pose = Pose::translation(0.0, 0.0, 2.0);
        let files = TempFiles::default();
        let lever = RobotCfg { init_pose, ..text_robot(&files, "lever", &urdf) };
        let id = sim.add_robot(lever).unwrap();
        for i in 0..balls {
            add_ball(&mut sim, &format!("ball{i}"), [3.0 + f64::from(i), 0.0, 0.1 + 0.05 * f64::from(i)]);
        }
        sim.robot_mut(id).set_qpos_target(&row([0.4]), None, None).unwrap();
        let step = |_| {
            sim.update(1);
            sim.robot(id).qf()[(0, 0)]
        };
        (0..80).map(step).collect::<Vec<f64>>()
    });
    // The lever hangs on its stiffness, so its effort is m g l cos(q).
    let held = alone.last().unwrap().abs();
    assert!((held - 2.0 * 9.81 * 0.5 * 0.4_f64.cos()).abs() < 0.1, "{held}");
    for (step, (a, b)) in alone.iter().zip(&beside).enumerate() {
        assert!((a - b).abs() < 1e-6 * a.abs().max(1.0), "step {step}: {a} alone, {b} beside the balls");
    }
}

/// Final state of twelve free bars (72 degrees of freedom) that fall onto a plane and onto each other, 60 steps of 2 ms
/// from the first contact.
fn fall(jacobian: &str, friction: f64) -> Vec<f64> {
    let bar = |i: u32| {
        let (x, y, z) = (0.04 * f64::from(i % 3), 0.03 * f64::from(i % 2), 0.06 + 0.11 * f64::from(i / 3));
        format!(
            r#"<body pos="{x} {y} {z}" euler="0 0 {}"><freejoint/><geom type="box" size="0.1 0.02 0.02" mass="0.1" friction="{friction} 0.005 0.0001"/></body>"#,
            40 * i
        )
    };
    let bars: String = (0..12).map(bar).collect();
    let xml = format!(
        r#"<mujoco><option timestep="0.002" jacobian="{jacobian}" solver="Newton"/><size njmax="2000" nconmax="400"/>
        <worldbody><geom type="plane" size="2 2 1"/>{bars}</worldbody></mujoco>"#
    );
    let mut data = Data::new(&compile(&xml, &[]).unwrap().into_model()).unwrap();
    let mut touched = 0;
    for _ in 0..400 {
        data.step().unwrap();
        touched += u32::from(!data.contact().is_empty());
        if touched == 60 {
            break;
        }
    }
    assert_eq!(touched, 60, "the bars meet");
    assert_eq!(data.take_warnings(), Default::default());
    data.qpos().to_vec()
}

/// Dense and sparse constraint Jacobians lead to the same motion: MuJoCo 4.0.0's Newton solver is known to factor a
/// wrong Hessian in some sparse cases. Both solve the same problem to the solver's tolerance of 1e-8; over 60 steps
/// contact may amplify that a hundredfold: 1e-6 m. Control: 1 % less friction changes the motion by more than that.
#[test]
fn sparse_jacobians() {
    let dense = fall("dense", 1.0);
    let distance = |other: Vec<f64>| dense.iter().zip(other).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    let (apart, control) = (distance(fall("sparse", 1.0)), distance(fall("dense", 0.99)));
    assert!(apart < 1e-6 && control > 1e-6, "{apart:e} {control:e}");
}
