//! Library terms, evaluated in known states.

use super::bundled::{cfg, idle};
use kinetoscope::ndarray::{Array2, ArrayView1, Axis, array, s};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_row;
use kinetoscope::tasks::terms::{self, RootRanges};
use kinetoscope::tasks::{
    CommandTerm, EndReason, Env, EnvBuilder, EnvCfg, EventTerm, ObservationTerm, TerminationTerm,
};
use kinetoscope_testkit::tolerance::{Tolerance, assert_close};
use kinetoscope_testkit::worlds::{mjcf_robot, passive};
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// A floating box of 2 kg, with a lever on a hinge from -1 to 2 rad.
const FLOATER: &str = r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="trunk" pos="0 0 1"><freejoint name="float"/>
    <geom type="box" size="0.2 0.1 0.05" mass="2"/>
    <body name="lever" pos="0 0 0.3"><joint name="hinge" axis="0 1 0" range="-1 2"/><geom size="0.03" mass="0.1"/></body></body>
  </worldbody></mujoco>"#;

fn floater(num_envs: usize, ground: bool) -> (SimulationManager, RobotId) {
    let plain = cfg(num_envs, 1);
    let ground = if ground { SimulationManagerCfg::default().ground } else { None };
    let mut sim = SimulationManager::new(SimulationManagerCfg { ground, ..plain }).unwrap();
    // Soft limits from -0.1 to 1.1: the middle of the range ± 0.4 of its half.
    let robot = RobotCfg { fix_base: false, soft_limit_factor: 0.4, ..passive(mjcf_robot("floater", FLOATER)) };
    let robot = sim.add_robot(robot).unwrap();
    (sim, robot)
}

fn task(sim: SimulationManager, robot: RobotId) -> EnvBuilder {
    let height =
        ObservationTerm::new("z", ["z"], move |now| Ok(now.sim().robot(robot).root_pose().slice_move(s![.., 2..3])));
    EnvBuilder::new(sim, EnvCfg::default()).action(idle()).observation(height).reward(terms::is_alive("alive", 1.0))
}

/// Builds a task and begins its episodes.
fn begin(task: EnvBuilder) -> Env {
    let mut env = task.build().unwrap();
    env.reset(None, Some(1)).unwrap();
    env
}

/// Takes one step without action; returns the termination term that ended each environment, if any.
fn ends(env: &mut Env) -> Vec<Option<String>> {
    let n = env.num_envs();
    let step = env.step(&Array2::zeros((n, 1))).unwrap();
    let mut ends = vec![None; n];
    for ended in step.info.ended {
        if let EndReason::Term(name) = ended.reason {
            ends[ended.env.0] = Some(name);
        }
    }
    ends
}

/// True for each environment whose episode ends if its root starts at the row of `poses`.
fn ended_at(term: impl FnOnce(&SimulationManager, RobotId) -> TerminationTerm, poses: &Array2<f64>) -> Vec<bool> {
    let (sim, robot) = floater(poses.nrows(), false);
    let term = term(&sim, robot);
    let mut env = begin(task(sim, robot).termination(term));
    env.sim_mut().robot_mut(robot).write_root_pose(poses, None).unwrap();
    ends(&mut env).iter().map(Option::is_some).collect()
}

#[test]
fn low_and_lying_roots() {
    // In a step of at most 0.01 s the roots fall by at most g h² = 1 mm.
    let poses = array![
        [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.502, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.499, 1.0, 0.0, 0.0, 0.0],
    ];
    assert_eq!(ended_at(|_, robot| terms::root_height_below_minimum("low", robot, 0.5), &poses), [false, false, true]);
    // Rotated about x by 0.5, about y by 0.7 and about z by 3 rad: only the first two tilt, the second beyond 0.6.
    let turned = |axis: usize, angle: f64| {
        let mut row = vec![0.0, 0.0, 1.0, (0.5 * angle).cos(), 0.0, 0.0, 0.0];
        row[4 + axis] = (0.5 * angle).sin();
        row
    };
    let rows = [turned(0, 0.5), turned(1, 0.7), turned(2, 3.0), turned(0, 2.5)].concat();
    let poses = Array2::from_shape_vec((4, 7), rows).unwrap();
    let term = |_: &SimulationManager, robot| terms::bad_orientation("lies", robot, 0.6);
    assert_eq!(ended_at(term, &poses), [false, true, false, true]);
}

#[test]
fn time_and_joint_limits() {
    let (sim, robot) = floater(3, false);
    let limits = terms::joint_out_of_limits(&sim, "limits", robot, &["hinge"]).unwrap();
    assert!(terms::joint_out_of_limits(&sim, "limits", robot, &["none"]).is_err());
    let mut env = begin(task(sim, robot).termination(limits).termination(terms::time_out("late", 4)));
    let places = array![[1.0], [1.2], [-0.2]];
    env.sim_mut().robot_mut(robot).write_qpos(&places, None, None).unwrap();
    assert_eq!(ends(&mut env), [None, Some("limits".into()), Some("limits".into())]);
    for _ in 0..2 {
        assert_eq!(ends(&mut env), [None, None, None]);
    }
    // The other environments restarted one step later.
    let step = env.step(&Array2::zeros((3, 1))).unwrap();
    assert_eq!((step.truncated.to_vec(), step.terminated.to_vec()), (vec![true, false, false], vec![false; 3]));
}

#[test]
fn illegal_contact() {
    let (mut sim, robot) = floater(2, true);
    let sensor = sim.add_sensor("touch", ContactSensorCfg::for_bodies("floater/trunk")).unwrap();
    let touched = terms::illegal_contact("touched", sensor, 5.0);
    let mut env = begin(task(sim, robot).termination(touched));
    // One robot rests on the ground at a depth of a tenth of a millimeter, which carries its 2.1 kg; the other is a
    // meter above it.
    let poses = array![[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0499, 1.0, 0.0, 0.0, 0.0]];
    env.sim_mut().robot_mut(robot).write_root_pose(&poses, None).unwrap();
    let mut all = [false; 2];
    for _ in 0..20 {
        for (k, end) in ends(&mut env).iter().enumerate() {
            all[k] |= end.is_some();
        }
    }
    assert_eq!(all, [false, true]);
}

/// Poses and velocities of roots, positions and velocities of joints, at the start of an episode with this event.
fn initial_state(event: EventTerm, robot: RobotId, sim: SimulationManager) -> [Array2<f64>; 4] {
    let mut env = task(sim, robot).event(event).build().unwrap();
    env.reset(None, Some(5)).unwrap();
    let robot = env.sim().robot(robot);
    [robot.root_pose(), robot.root_velocity(), robot.qpos(), robot.qvel()]
}

#[test]
fn root_ranges() {
    const N: usize = 400;
    let ranges = RootRanges {
        position: [[-0.5, 0.5], [1.0, 2.0], [0.1, 0.1]],
        rpy: [[0.0; 2], [0.0; 2], [-FRAC_PI_2, FRAC_PI_2]],
        linear: [[-1.0, 1.0], [0.0; 2], [0.0; 2]],
        angular: [[0.0; 2], [0.0; 2], [2.0, 3.0]],
    };
    let (sim, robot) = floater(N, false);
    let [poses, speeds, ..] = initial_state(terms::reset_root_uniform("start", robot, ranges).unwrap(), robot, sim);
    let yaw = poses.rows().into_iter().map(|row| 2.0 * row[6].atan2(row[3])).collect::<Vec<f64>>();
    let column = |table: &Array2<f64>, k: usize| table.column(k).to_vec();
    for (name, values, [low, high]) in [
        ("x", column(&poses, 0), [-0.5, 0.5]),
        ("y", column(&poses, 1), [1.0, 2.0]),
        ("yaw", yaw, [-FRAC_PI_2, FRAC_PI_2]),
        ("vx", column(&speeds, 0), [-1.0, 1.0]),
        ("wz", column(&speeds, 5), [2.0, 3.0]),
    ] {
        let round = 1e-12;
        assert!(values.iter().all(|x| low - round <= *x && *x <= high + round), "{name}: {values:?}");
        // The mean of N numbers is within five standard deviations of a uniform distribution, width / sqrt(12 N).
        let mean = values.iter().sum::<f64>() / N as f64;
        let deviation = (high - low) / (12.0 * N as f64).sqrt();
        assert!((mean - 0.5 * (low + high)).abs() < 5.0 * deviation, "{name}: {mean}");
        // The probability of no sample in an outer tenth is 0.9^N, below 1e-18.
        let width = high - low;
        assert!(values.iter().any(|x| *x < low + 0.1 * width), "{name}");
        assert!(values.iter().any(|x| *x > high - 0.1 * width), "{name}");
    }
    assert!(column(&poses, 2).iter().all(|z| (z - 1.1).abs() < 1e-12));
    assert!(speeds.column(1).iter().chain(speeds.column(4)).all(|v| *v == 0.0));

    // The ranges are in the root's own axes: for a robot on its side, yaw keeps the z axis of the robot, not that of
    // the environment.
    let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..cfg(N, 1) }).unwrap();
    let lying = Pose::rotation([FRAC_PI_2, 0.0, 0.0].into());
    let robot = RobotCfg { fix_base: false, init_pose: lying, ..passive(mjcf_robot("floater", FLOATER)) };
    let robot = sim.add_robot(robot).unwrap();
    let [poses, ..] = initial_state(terms::reset_root_uniform("start", robot, ranges).unwrap(), robot, sim);
    let turned = |row: ArrayView1<'_, f64>| from_row(&std::array::from_fn(|k| row[k])).rotation;
    let axes: Vec<_> = poses.rows().into_iter().map(|row| turned(row) * Vector3::z()).collect();
    assert!(axes.iter().all(|z| (z + Vector3::y()).norm() < 1e-12), "{axes:?}");
    let ahead: Vec<f64> = poses.rows().into_iter().map(|row| (turned(row) * Vector3::x()).x).collect();
    assert!(ahead.iter().any(|x| *x < 0.5), "they have turned: {ahead:?}");
}

#[test]
fn joint_ranges() {
    const N: usize = 300;
    let (sim, robot) = floater(N, false);
    let event = terms::reset_joints_by_offset(&sim, "start", robot, &["hinge"], [-3.0, 0.5], [1.0, 1.5]).unwrap();
    let [_, _, places, speeds] = initial_state(event, robot, sim);
    // From -3 to 0.5 about the start at 0; positions below the limit of -1 are clamped to it: 2 of 3.5 of them.
    let at_limit = places.iter().filter(|x| **x == -1.0).count() as f64 / N as f64;
    // Five standard deviations of a share p of N, sqrt(p (1 - p) / N).
    let share: f64 = 2.0 / 3.5;
    assert!((at_limit - share).abs() < 5.0 * (share * (1.0 - share) / N as f64).sqrt(), "{at_limit}");
    assert!(places.iter().all(|x| (-1.0..=0.5).contains(x)));
    assert!(speeds.iter().all(|v| (1.0..=1.5).contains(v)));
}

#[test]
fn root_state() {
    let (sim, robot) = floater(2, false);
    let speed = || CommandTerm::new("speed", ["x", "y"], |_| [0.3, 0.0]);
    let mut env = task(sim, robot)
        .command(speed())
        .observation(terms::base_lin_vel("v", robot))
        .observation(terms::base_ang_vel("w", robot))
        .observation(terms::projected_gravity("down", robot))
        .reward(terms::flat_orientation("flat", 1.0, robot))
        .reward(terms::track_lin_vel("fast", 2.0, robot, "speed", 0.5))
        .build()
        .unwrap();
    env.reset(None, Some(1)).unwrap();
    // The second root lies on its side, by a quarter turn about x. Both move along the world's x and rotate about it.
    let half = 0.5f64.sqrt();
    let poses = array![[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, half, half, 0.0, 0.0]];
    env.sim_mut().robot_mut(robot).write_root_pose(&poses, None).unwrap();
    env.sim_mut().robot_mut(robot).write_root_velocity(&array![[0.3, 0.2, 0.0, 0.0, 0.0, 0.0]], None).unwrap();
    let step = env.step(&Array2::zeros((2, 1))).unwrap();
    let (seen, dt) = (&step.final_observations, env.step_dt());
    // z, v, w, down: for the second root, y is the world's z and z the world's minus y. Gravity adds g dt to falling
    // velocities.
    let fall = 9.81 * dt;
    let lever = Tolerance::absolute(
        0.02 * fall,
        "a twentieth of the mass on its own hinge moves them by less than a hundredth",
    );
    for (env, first, expected) in
        [(0, 1, [0.3, 0.2, -fall]), (1, 1, [0.3, -fall, -0.2]), (0, 7, [0.0, 0.0, -1.0]), (1, 7, [0.0, -1.0, 0.0])]
    {
        let found = [0, 1, 2].map(|k| seen[(env, first + k)]);
        assert_close(&format!("environment {env}, column {first}"), found, expected, lever);
    }
    // 1 for being there, then the two rewards; the error is 0.2 m/s of 0.5 for the first root, and its fall velocity
    // for the second.
    let rewards = &step.info.reward_terms;
    let expected = [0.2, fall].map(|off: f64| 2.0 * (-(off / 0.5).powi(2)).exp());
    assert_close("being there", rewards.column(1), [0.0, 1.0], lever);
    assert_close("speed", rewards.column(2), expected, lever);
    let (sim, robot) = floater(2, false);
    let wrong = terms::track_lin_vel("fast", 2.0, robot, "nothing", 0.5);
    let mut env = begin(task(sim, robot).command(speed()).reward(wrong));
    let error = env.step(&Array2::zeros((2, 1))).unwrap_err().to_string();
    assert!(error.contains("nothing") && error.contains("speed"), "{error}");
}

#[test]
fn effort_squares() {
    let (mut sim, _) = floater(1, false);
    let cart = sim.add_robot(mjcf_robot("cart", &super::bundled::cart(true))).unwrap();
    let squares = terms::joint_torques_l2(&sim, "effort", -0.5, cart, &["slide", "hinge"]).unwrap();
    let mut env = begin(task(sim, cart).reward(squares));
    env.sim_mut().robot_mut(cart).set_qpos_target(&array![[0.1, -0.2]], None, None).unwrap();
    let step = env.step(&Array2::zeros((1, 1))).unwrap();
    let efforts = env.sim().robot(cart).qf();
    let expected = -0.5 * efforts.index_axis(Axis(0), 0).iter().map(|x| x * x).sum::<f64>();
    assert!(expected < 0.0, "they drive: {efforts}");
    assert_eq!(step.info.reward_terms[(0, 1)], expected);
}
