//! Mimic joints follow within 0.02 rad: during the fastest step of the bundled hand, and under gravity.
//!
//! A coupling is a constraint of impedance d = 0.9999 with the time constant of one step: it lags by (1 - d) / d of what
//! its load would do, 1e-4 x 28 mrad for a finger link under its own weight. 0.02 rad is the bound; found is far
//! less. Control: MuJoCo's default impedance 0.9 and time constant 20 ms lag by more.

use crate::drives::worlds::*;
use kinetoscope::ndarray::Array3;
use kinetoscope::prelude::*;
use nalgebra::Vector3;

/// Force on a follower's link \[N\].
const LOAD: f64 = 5.0;

fn hand(gravity: Vector3<f64>) -> World {
    let urdf = UrdfCfg::single(assets::path("revo1_left/revo1_left.urdf").unwrap());
    load(RobotCfg { urdf, drive: gains(1e3, 1e2), ..Default::default() }, manager(gravity))
}

fn lag(world: &World) -> f64 {
    let q = world.q();
    let drivers = world.view().mimic_drivers();
    drivers.iter().enumerate().map(|(i, (d, m, o))| (q[i] - (m * q[d.0] + o)).abs()).fold(0.0, f64::max)
}

#[test]
fn followers_stay_with_their_drivers() {
    for gravity in [Vector3::zeros(), EARTH, Vector3::new(9.81, 0.0, 0.0), Vector3::new(0.0, -9.81, 0.0)] {
        let mut world = hand(gravity);
        let n = world.q().len();
        let (mut moving, mut resting, mut fastest) = (0.0_f64, 0.0_f64, 0.0_f64);
        for aim in [9.0, -9.0, 9.0] {
            world.aim(&vec![aim; n]);
            for k in 0..150 {
                world.step(1);
                moving = moving.max(lag(&world));
                fastest = world.v().iter().fold(fastest, |m, v| m.max(v.abs()));
                if k == 149 {
                    resting = resting.max(lag(&world));
                }
            }
        }
        world.assert_well();
        println!(
            "gravity {:?}: followers lag by {:.2} mrad in motion (up to {fastest:.1} rad/s), {:.3} mrad at rest",
            gravity.as_slice(),
            1e3 * moving,
            1e3 * resting
        );
        assert!(moving < 0.02 && resting < 0.001, "{moving} {resting}");
        assert!(fastest > 3.0, "a fast step");
    }
}

/// A force on each link that a follower moves, along each of its axes: 5 N on links of 20 g and less.
#[test]
fn followers_stay_with_their_drivers_under_load() {
    let mut world = hand(EARTH);
    let followers: Vec<LinkId> = {
        let view = world.view();
        let moved = view.description().drivable_joints().enumerate();
        moved.filter(|(i, _)| view.is_mimic(JointIndex(*i)).unwrap()).map(|(_, (_, joint))| joint.child).collect()
    };
    assert!(followers.len() >= 4, "{followers:?}");
    // The control: without the load, on the way to rest and at rest.
    let mut unloaded = 0.0_f64;
    for _ in 0..100 {
        world.step(1);
        unloaded = unloaded.max(lag(&world));
    }
    let mut worst = 0.0_f64;
    for axis in 0..3 {
        for newtons in [LOAD, -LOAD] {
            let at = |(_, _, k): (usize, usize, usize)| if k == axis { newtons } else { 0.0 };
            let forces = Array3::from_shape_fn((1, followers.len(), 3), at);
            let torques = Array3::zeros((1, followers.len(), 3));
            let mut robot = world.sim.robot_mut(world.robot);
            robot.set_external_wrench(&forces, &torques, WrenchFrame::Link, Some(&followers), None).unwrap();
            for _ in 0..100 {
                world.step(1);
                worst = worst.max(lag(&world));
            }
        }
    }
    world.assert_well();
    println!("followers lag by {:.3} mrad under {LOAD} N, by {:.3} mrad without", 1e3 * worst, 1e3 * unloaded);
    assert!(worst < 0.02, "{worst}");
    assert!(worst > 5.0 * unloaded, "the control: the load is felt, {worst} {unloaded}");
}

#[test]
fn mujocos_default_coupling_lags() {
    let run = |coupling: &str| {
        let mut data = plain(&format!(
            "<mujoco><option timestep=\"0.01\"/><worldbody><body><joint name=\"d\" axis=\"1 0 0\" armature=\"1\"/>\
             <inertial pos=\"0 .02 0\" mass=\".014\" diaginertia=\"2e-6 1e-6 2e-6\"/><body pos=\"0 .04 0\">\
             <joint name=\"f\" axis=\"1 0 0\"/><inertial pos=\"0 .02 0\" mass=\".0105\" diaginertia=\"1e-6 1e-6 1e-6\"/>\
             </body></body></worldbody><equality><joint joint1=\"f\" joint2=\"d\" polycoef=\"0 1.05 0 0 0\" {coupling}/>\
             </equality></mujoco>"
        ));
        for _ in 0..50 {
            data.step().unwrap();
        }
        (data.qpos()[1] - 1.05 * data.qpos()[0]).abs()
    };
    let (default, ours) = (run(""), run("solref=\"0.02 1\" solimp=\"0.9999 0.9999 0.001 0.5 2\""));
    println!("a hanging link: {:.2} mrad with MuJoCo's defaults, {:.4} mrad with ours", 1e3 * default, 1e3 * ours);
    assert!(default > 50.0 * ours && default > 1e-3, "{default} {ours}");
}
