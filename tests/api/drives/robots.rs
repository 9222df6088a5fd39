//! Whole robots: the tutorial's gains and cycle on arms and hands, and mimic joints.
//!
//! **At rest** every drive below its limit is at q* - tau_g / kp. The reference is the torque that
//! `kinetoscope_robot::dynamics` computes from the URDF at the measured positions (without drives and MuJoCo). A driver
//! carries its own load and, times their ratio, those of its followers. Tolerance 0.2 mrad, two-sided: exp(-40) of the
//! motion is left after 4 s (kd / kp = 0.1 s); the rest is for the couplings, whose compliance of 1e-4 shares the load
//! slightly differently. Without the sag the arm would be off by up to 4 mrad.
//!
//! **The tutorial's gains** (arm 1e4 / 1e3, hand 1e3 / 1e2) at dt 0.01 on links down to 10 g with effort limits that
//! saturate: no warnings, no NaN, the limit held exactly, settled within 0.5 s: |q* - q| < 20 mrad from then on. The
//! limits allow much less: 28 N m on 0.02 kg m² need 2 sqrt(0.5 / 1400) = 0.04 s, 150 N m on the whole arm (6 kg m²) 2
//! sqrt(0.5 / 25) = 0.28 s, then kd / kp = 0.1 s is the time constant of the overdamped drive: ln(0.5 / 0.02) x 0.1 s =
//! 0.32 s. A fine-step reference of the same arm (dt 1e-5) settles in 0.33 s. At every step each drive's effort is the
//! law at the new state, clamp(kp (q* - q') - kd v'), within 1e-6 of its limit (the solver stops at a relative
//! improvement of 1e-8). Control: the same robot with MuJoCo's own actuators diverges.
//!
//! **Mimic joints** follow within 0.02 rad, during the fastest step of the bundled hand and under gravity. A coupling
//! is a constraint of impedance d = 0.9999 with the time constant of one step: its lag is (1 - d) / d of the
//! displacement by its load, 1e-4 x 28 mrad for a finger link under its own weight. The measured lag is far below the
//! bound. Control: MuJoCo's default impedance 0.9 and time constant 20 ms have a larger lag.

use crate::drives::worlds::*;
use kinetoscope::ndarray::Array3;
use kinetoscope::prelude::*;
use kinetoscope::robot::description::LinkId;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope::sim::{DriveModel, WrenchFrame};
use kinetoscope_testkit::test_resources;
use kinetoscope_testkit::worlds::{cfg, urdf_robot};
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;

const STEP: f64 = 0.5;
const SETTLED: f64 = 0.02;

fn cycle([arm, hand]: [PathBuf; 2], arm_joints: &str, hand_joints: &str) {
    let transform = from_xyz_rpy([0.0, 0.0, 0.02], [FRAC_PI_2, 0.0, 0.0]);
    let components = vec![ComponentCfg::new("arm", arm), ComponentCfg { transform, ..ComponentCfg::new("hand", hand) }];
    let urdf = UrdfCfg { components, ..Default::default() };
    let control_parts = vec![("arm".into(), vec![arm_joints.into()]), ("hand".into(), vec![hand_joints.into()])];
    let robot = RobotCfg { urdf, control_parts, drive: tutorial_gains("arm", "hand"), ..Default::default() };
    let mut world = load(robot, cfg(1, 1));
    let view = world.view();
    let (arm, hand) = (view.joint_ids("arm").unwrap(), view.joint_ids("hand").unwrap());
    let (dof, limits) = (view.dof(), view.qpos_limits());
    let of_hand = |end: usize| hand.iter().map(|j| limits[(0, j.0, end)]).collect::<Vec<_>>();
    let phases = [
        (&arm, vec![0.0, 0.5, -1.5, 0.3, -0.5, 0.0]),
        (&arm, vec![0.0, 0.5, -1.5, -0.3, -0.5, 0.0]),
        (&hand, of_hand(0)),
        (&hand, of_hand(1)),
    ];
    // Drives belong to the joints that are not followers.
    let followers: Vec<bool> = (0..dof).map(|i| view.is_mimic(JointIndex(i)).unwrap()).collect();
    assert!((0..dof).all(|i| view.is_driven(JointIndex(i)).unwrap() != followers[i]));
    assert!(followers.contains(&true) && followers.contains(&false));
    for error in [view.is_mimic(JointIndex(dof)), view.is_driven(JointIndex(dof))].map(Result::unwrap_err) {
        assert_eq!(error.to_string(), format!("joint {dof} does not exist; there are {dof} (0 to {})", dof - 1));
    }
    let (effort_limits, gains) = (world.limits(), world.env().drives.gains.clone());
    let drivers = || (0..dof).filter(|&i| !followers[i]).zip(gains.iter());
    let (mut sag, mut law) = (0.0_f64, 0.0_f64);
    for (joints, aim) in phases {
        world.robot().set_qpos_target(&row(&aim), Some(joints), None).unwrap();
        for _ in 0..400 {
            world.step(1);
            let (q, v, tau, target) = (world.q(), world.v(), world.effort(), world.target());
            for (i, gains) in drivers() {
                let limit = effort_limits[i];
                assert!(tau[i].abs() <= limit, "joint {i}: {}", tau[i]);
                let asked = (gains.kp * (target[i] - q[i]) - gains.kd * v[i]).clamp(-limit, limit);
                law = law.max((asked - tau[i]).abs() / limit);
            }
        }
        world.assert_healthy();
        let (q, tau, target, load) = (world.q(), world.effort(), world.target(), world.load_by_gravity(&EARTH));
        for (i, gains) in drivers() {
            assert!(tau[i].abs() < effort_limits[i], "joint {i} rests below its limit");
            let hangs = load[i] / gains.kp;
            sag = sag.max(hangs.abs());
            let off = target[i] - hangs - q[i];
            assert!(off.abs() < 0.2e-3, "joint {i}: {:.4} mrad off", 1e3 * off);
        }
    }
    assert!(sag > 1e-3 && law < 1e-6, "sag {sag}, effort beside the law {law}");
}

#[test]
fn cycle_of_the_bundled_robots() {
    let files = ["sr5/SR5.urdf", "revo1_left/revo1_left.urdf"];
    cycle(files.map(|name| assets::path(name).unwrap()), "JOINT[1-6]", "LEFT_.*");
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn cycle_of_the_vendors_robots() {
    let files = ["rokae_description/urdf/SR5.urdf", "inspire_hand/DFQ_left_hand.urdf"];
    cycle(files.map(test_resources::robot), "joint[1-6]", "L_.*");
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn anymal_on_the_ground() {
    let file = test_resources::robot("anymal_c_simple_description/urdf/anymal.urdf");
    for (name, drive) in [("defaults", DriveCfg::default()), ("soft", gains(80.0, 2.0)), ("limp", no_drive())] {
        let init_qpos = [(".*F_HFE", 0.4), (".*H_HFE", -0.4), (".*F_KFE", -0.8), (".*H_KFE", 0.8)];
        let init_qpos = init_qpos.map(|(joints, angle)| (joints.to_string(), angle)).to_vec();
        let init_pose = Pose::translation(0.0, 0.0, 0.62);
        let robot = RobotCfg { drive, fix_base: false, init_pose, init_qpos, ..urdf_robot("robot", &file) };
        let mut world = load(robot, cfg(1, 1));
        world.step(100);
        world.assert_healthy();
        let height = world.view().link_pose("base").unwrap()[(0, 2)];
        assert!(height > 0.05 && height < 0.63, "{name}: {height}");
        assert_eq!(height > 0.45, name != "limp", "{name}: {height}");
    }
}

#[test]
fn settling() {
    let mut world = world(&arm_and_hand(), tutorial_gains("a.*", "h.*"), earth());
    let limits = world.limits();
    let n = limits.len();
    world.set_position_targets(&vec![STEP; n]);
    let of = |i: usize| if i < 6 { (1e4, 1e3) } else { (1e3, 1e2) };
    let (mut settled, mut saturated, mut law) = (vec![0.0; n], vec![0; n], 0.0_f64);
    for k in 1..=200 {
        world.step(1);
        let (q, v, tau) = (world.q(), world.v(), world.effort());
        for i in 0..n {
            assert!(tau[i].abs() <= limits[i], "joint {i}, step {k}: {} over {}", tau[i], limits[i]);
            let (kp, kd) = of(i);
            let asked = (kp * (STEP - q[i]) - kd * v[i]).clamp(-limits[i], limits[i]);
            law = law.max((asked - tau[i]).abs() / limits[i]);
            saturated[i] += usize::from(tau[i].abs() == limits[i]);
            if (STEP - q[i]).abs() > SETTLED {
                settled[i] = 0.01 * f64::from(k);
            }
        }
    }
    world.assert_healthy();
    assert!(settled.iter().all(|t| *t <= 0.5), "{settled:?}");
    assert!(saturated[1] > 10, "a limit binds: {saturated:?}");
    assert!(law < 1e-6, "{law}");
    assert!(world.v().iter().all(|v| v.abs() < 1e-3), "at rest after 2 s");
    for (i, load) in world.load_by_gravity(&EARTH).into_iter().enumerate() {
        let limit = Tolerance::mixed(1e-6, "of the step exp(-20) is left after 2 s");
        assert_number("left is gravity's share", STEP - world.q()[i], load / of(i).0, limit);
    }
    // Control.
    let drive = DriveCfg { model: DriveModel::Actuator, ..tutorial_gains("a.*", "h.*") };
    let mut world = self::world(&arm_and_hand(), drive, earth());
    world.set_position_targets(&vec![STEP; n]);
    world.step(200);
    assert_eq!(world.sim.diverged().len(), 1);
}

/// Limits slightly above gravity's load, so that every limit binds: they are held exactly, and the robot still settles.
#[test]
fn binding_limits() {
    let mut joints = arm_and_hand();
    let fingers = [0.03, 0.012, 0.003].repeat(4);
    for (joint, limit) in joints.iter_mut().zip([4.0, 140.0, 60.0, 0.6, 5.0, 0.08].into_iter().chain(fingers)) {
        joint.limit = joint.limit.split("effort").next().unwrap().to_string();
        *joint = joint.clone().effort(limit);
    }
    let mut world = world(&joints, tutorial_gains("a.*", "h.*"), earth());
    let limits = world.limits();
    world.set_position_targets(&vec![STEP; limits.len()]);
    let mut saturated = vec![0; limits.len()];
    for _ in 0..500 {
        world.step(1);
        for (i, tau) in world.effort().into_iter().enumerate() {
            assert!(tau.abs() <= limits[i], "joint {i}: {tau}");
            saturated[i] += usize::from(tau.abs() == limits[i]);
        }
    }
    world.assert_healthy();
    assert!(saturated.iter().all(|&s| s > 0), "{saturated:?}");
    assert!(world.q().iter().all(|q| (q - STEP).abs() < SETTLED), "{:?}", world.q());
}

/// From any pose: targets all over the joints' ranges, a new one every 0.3 s, none of them reached.
#[test]
fn jumping_targets() {
    let mut world = world(&arm_and_hand(), tutorial_gains("a.*", "h.*"), earth());
    let (limits, mut state) = (world.limits(), 1_u64);
    for _ in 0..12 {
        let aim = (0..limits.len()).map(|i| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let share = (state >> 11) as f64 / (1_u64 << 53) as f64;
            if i < 6 { -3.0 + 6.0 * share } else { -0.3 + 1.9 * share }
        });
        world.set_position_targets(&aim.collect::<Vec<f64>>());
        for _ in 0..30 {
            world.step(1);
            assert!(world.effort().iter().zip(&limits).all(|(tau, limit)| tau.abs() <= *limit));
        }
    }
    world.assert_healthy();
}

fn hand(gravity: Vector3<f64>) -> World {
    let robot = urdf_robot("robot", assets::path("revo1_left/revo1_left.urdf").unwrap());
    load(RobotCfg { drive: gains(1e3, 1e2), ..robot }, with_gravity(gravity))
}

fn lag(world: &World) -> f64 {
    let (q, drivers) = (world.q(), world.view().mimic_drivers());
    drivers.iter().enumerate().map(|(i, (d, m, o))| (q[i] - (m * q[d.0] + o)).abs()).fold(0.0, f64::max)
}

#[test]
fn mimic_lag() {
    for gravity in [Vector3::zeros(), EARTH, Vector3::new(9.81, 0.0, 0.0), Vector3::new(0.0, -9.81, 0.0)] {
        let mut world = hand(gravity);
        let (mut moving, mut resting, mut fastest) = (0.0_f64, 0.0_f64, 0.0_f64);
        for aim in [9.0, -9.0, 9.0] {
            world.set_position_targets(&vec![aim; world.q().len()]);
            for _ in 0..150 {
                world.step(1);
                moving = moving.max(lag(&world));
                fastest = world.v().iter().fold(fastest, |m, v| m.max(v.abs()));
            }
            resting = resting.max(lag(&world));
        }
        world.assert_healthy();
        assert!(moving < 0.02 && resting < 0.001, "gravity {gravity:?}: {moving} rad in motion, {resting} at rest");
        assert!(fastest > 3.0, "a fast step");
    }
    // Control: a hanging link, with MuJoCo's defaults and with ours.
    let [default, ours] = ["", "solref=\"0.02 1\" solimp=\"0.9999 0.9999 0.001 0.5 2\""].map(|coupling| {
        let mut data = plain(&format!(
            "<mujoco><option timestep=\"0.01\"/><worldbody><body><joint name=\"d\" axis=\"1 0 0\" armature=\"1\"/>\
             <inertial pos=\"0 .02 0\" mass=\".014\" diaginertia=\"2e-6 1e-6 2e-6\"/><body pos=\"0 .04 0\">\
             <joint name=\"f\" axis=\"1 0 0\"/><inertial pos=\"0 .02 0\" mass=\".0105\" diaginertia=\"1e-6 1e-6 1e-6\"/>\
             </body></body></worldbody><equality><joint joint1=\"f\" joint2=\"d\" polycoef=\"0 1.05 0 0 0\" {coupling}/>\
             </equality></mujoco>"
        ));
        (0..50).for_each(|_| data.step().unwrap());
        (data.qpos()[1] - 1.05 * data.qpos()[0]).abs()
    });
    assert!(default > 50.0 * ours && default > 1e-3, "{default} {ours}");
}

/// A force on each link moved by a follower, along each of its axes: 5 N on links of 20 g and less.
#[test]
fn mimic_lag_under_load() {
    let mut world = hand(EARTH);
    let followers: Vec<LinkId> = {
        let view = world.view();
        let moved = view.description().drivable_joints().enumerate();
        moved.filter(|(i, _)| view.is_mimic(JointIndex(*i)).unwrap()).map(|(_, (_, joint))| joint.child).collect()
    };
    assert!(followers.len() >= 4, "{followers:?}");
    let worst = |world: &mut World| {
        (0..100).fold(0.0_f64, |worst, _| {
            world.step(1);
            worst.max(lag(world))
        })
    };
    // Control: without the load, during the motion and at rest.
    let (unloaded, mut loaded) = (worst(&mut world), 0.0_f64);
    for (axis, newtons) in [(0, 5.0), (0, -5.0), (1, 5.0), (1, -5.0), (2, 5.0), (2, -5.0)] {
        let forces = Array3::from_shape_fn((1, followers.len(), 3), |(_, _, k)| if k == axis { newtons } else { 0.0 });
        let torques = Array3::zeros((1, followers.len(), 3));
        let mut robot = world.robot();
        robot.set_external_wrench(&forces, &torques, WrenchFrame::Link, Some(&followers), None).unwrap();
        loaded = loaded.max(worst(&mut world));
    }
    world.assert_healthy();
    assert!(loaded < 0.02 && loaded > 5.0 * unloaded, "{loaded} loaded, {unloaded} unloaded");
}
