//! Terms of velocity tasks, against MuJoCo's positions and velocities of a walking quadruped, and against states with
//! known values.

use kinetoscope::ndarray::{Array2, array, s};
use kinetoscope::prelude::*;
use kinetoscope::scene::terrain::Slope;
use kinetoscope::sensors::ContactSensor;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{HitTargets, RayAlignment};
use kinetoscope::tasks::{Env, EnvBuilder, TaskCfg, TermRegistry};
use kinetoscope_testkit::tolerance::{Tolerance, assert_close};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

const ENVS: usize = 3;
const STEPS: usize = 120;
/// Command of all environments: x, y \[m/s\] and turning rate \[rad/s\].
const COMMAND: [f64; 3] = [0.4, -0.2, 0.3];
const AIR_TIME: f64 = 0.05;
const FORCE: f64 = 1.0;

/// A task in a step of the physics, whose only action is `joint_positions`.
const TASK: &str = r#"
[actions.joints]
type = "joint_positions"
scale = { ".*KFE" = 0.3, ".*HAA" = 0.1 }

[commands.velocity]
type = "uniform_command"
columns = { x = [0.4, 0.4], y = [-0.2, -0.2], turn = [0.3, 0.3] }

[commands.none]
type = "uniform_command"
columns = { x = [0.0, 0.0], y = [0.0, 0.0] }
"#;

/// The bundled quadruped above the ground, with contact sensors on its feet and on everything else.
fn quadrupeds() -> SimulationManager {
    let cfg = SimulationManagerCfg { num_envs: ENVS, seed: 3, ..SimulationManagerCfg::legged() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    sim.add_robot(assets::quadruped().unwrap()).unwrap();
    let feet = ContactSensorCfg { track_air_time: true, ..ContactSensorCfg::for_bodies("quadruped/.*FOOT") };
    sim.add_sensor("feet", feet).unwrap();
    sim.add_sensor("others", ContactSensorCfg::for_bodies("quadruped/.*(THIGH|SHANK|base)")).unwrap();
    sim
}

fn env(sim: SimulationManager, text: &str) -> Env {
    let cfg = TaskCfg::from_toml(text).unwrap();
    EnvBuilder::from_cfg(sim, &cfg, &TermRegistry::default()).unwrap().build().unwrap()
}

/// State of one quadruped from MuJoCo's arrays, and what the terms depend on besides.
struct State {
    position: Vector3<f64>,
    turned: UnitQuaternion<f64>,
    linear: Vector3<f64>,
    angular: Vector3<f64>,
    joints: Vec<f64>,
    speeds: Vec<f64>,
    /// Changes of `speeds` in the last step, per second.
    accelerations: Vec<f64>,
    starts: Vec<f64>,
    /// Durations of the air phases that ended in this step \[s\].
    landings: Vec<f64>,
    /// Norms of the contact forces on the bodies that should not touch the ground \[N\].
    forces: Vec<f64>,
}

/// A term, and its value by hand.
struct Case {
    /// Type and keys of the term, without weight.
    text: &'static str,
    value: fn(&State) -> Vec<f64>,
}

fn squares(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    vec![values.into_iter().map(|x| x * x).sum()]
}

/// The velocity along the axes of the root.
fn own(state: &State) -> Vector3<f64> {
    state.turned.inverse() * state.linear
}

/// Observations: their columns. Formulas are those of Isaac Lab's functions with the same names.
const OBSERVATIONS: &[Case] = &[
    Case { text: "type = 'joint_pos'", value: |s| s.joints.clone() },
    Case {
        text: "type = 'joint_pos_rel'",
        value: |s| s.joints.iter().zip(&s.starts).map(|(at, start)| at - start).collect(),
    },
    Case { text: "type = 'joint_vel', joints = ['LF_KFE', 'RH_HAA']", value: |s| vec![s.speeds[2], s.speeds[9]] },
    Case { text: "type = 'base_pos_z'", value: |s| vec![s.position.z] },
    Case { text: "type = 'base_lin_vel'", value: |s| own(s).as_slice().to_vec() },
    Case { text: "type = 'base_ang_vel'", value: |s| s.angular.as_slice().to_vec() },
    Case { text: "type = 'projected_gravity'", value: |s| (s.turned.inverse() * -Vector3::z()).as_slice().to_vec() },
];

/// Rewards with a weight of 1.
const REWARDS: &[Case] = &[
    Case {
        text: "type = 'track_lin_vel', command = 'velocity', std = 0.5",
        value: |s| {
            let error = (own(s).x - COMMAND[0]).powi(2) + (own(s).y - COMMAND[1]).powi(2);
            vec![(-error / 0.25).exp()]
        },
    },
    Case {
        text: "type = 'track_ang_vel', command = 'velocity', std = 0.7",
        value: |s| vec![(-(s.angular.z - COMMAND[2]).powi(2) / 0.49).exp()],
    },
    Case { text: "type = 'lin_vel_z_l2'", value: |s| squares([own(s).z]) },
    Case { text: "type = 'ang_vel_xy_l2'", value: |s| squares([s.angular.x, s.angular.y]) },
    Case { text: "type = 'joint_acc_l2'", value: |s| squares(s.accelerations.iter().copied()) },
    Case {
        text: "type = 'joint_deviation_l1', joints = ['.*HFE', '.*KFE']",
        value: |s| {
            let off = s.joints.iter().zip(&s.starts).map(|(at, start)| (at - start).abs());
            vec![off.enumerate().filter(|(k, _)| k % 3 != 0).map(|(_, off)| off).sum()]
        },
    },
    Case {
        text: "type = 'feet_air_time', sensor = 'feet', command = 'velocity', threshold = 0.05",
        value: |s| vec![s.landings.iter().map(|air| air - AIR_TIME).sum()],
    },
    Case { text: "type = 'feet_air_time', sensor = 'feet', command = 'none', threshold = 0.05", value: |_| vec![0.0] },
    Case {
        text: "type = 'undesired_contacts', sensor = 'others', force = 1",
        value: |s| vec![s.forces.iter().filter(|force| **force > FORCE).count() as f64],
    },
];

/// Times and contacts of the feet, from the forces after every step.
#[derive(Clone, Default)]
struct Foot {
    in_contact: bool,
    air: f64,
}

#[test]
fn values() {
    let table = |kind: &str, cases: &[Case], weight: &str| -> String {
        let row = |(k, case): (usize, &Case)| format!("term{k} = {{ {weight}{} }}\n", case.text);
        cases.iter().enumerate().map(row).fold(format!("\n[{kind}]\n"), |text, row| text + &row)
    };
    let observations = table("observations.policy", OBSERVATIONS, "");
    let text = [TASK, &observations, &table("rewards", REWARDS, "weight = 1, ")].concat();
    let mut env = env(quadrupeds(), &text);
    let robot = env.sim().entities().robot_id("quadruped").unwrap();
    let feet = env.sim().entities().sensor_ids::<ContactSensor>()[0].1;
    let others = env.sim().entities().sensor_ids::<ContactSensor>()[1].1;
    let (starts, dt) = (env.sim().robot(robot).default_qpos().row(0).to_vec(), env.step_dt());
    let dof = starts.len();
    env.reset(None, Some(1)).unwrap();
    // The last quadruped falls on its side.
    let (half, n) = (0.5f64.sqrt(), ENVS);
    env.sim_mut()
        .robot_mut(robot)
        .write_root_pose(&array![[0.0, 0.0, 0.6, half, half, 0.0, 0.0]], Some(&[EnvId(n - 1)]))
        .unwrap();
    let mut times = vec![vec![Foot::default(); 4]; n];
    let mut speeds = vec![vec![0.0; dof]; n];
    let (mut landings, mut contacts) = (0, 0);
    for step in 0..STEPS {
        // Legs move up and down, differently in each environment.
        let wave = |env: usize, k: usize| (0.2 * step as f64 + k as f64 + env as f64).sin();
        let actions = Array2::from_shape_fn((n, dof), |(env, k)| wave(env, k));
        let result = env.step(&actions).unwrap();
        for (e, (feet_times, speeds)) in times.iter_mut().zip(&mut speeds).enumerate() {
            let (qpos, qvel) =
                env.sim().with_mujoco(EnvId(e), |_, data| (data.qpos().to_vec(), data.qvel().to_vec())).unwrap();
            let force = |sensor: &ContactSensor, body: usize| {
                sensor.net_forces_w().slice(s![e, body, ..]).iter().map(|f| f * f).sum::<f64>().sqrt()
            };
            let mut landed = Vec::new();
            for (body, foot) in feet_times.iter_mut().enumerate() {
                let touches = force(env.sim().sensor(feet).unwrap(), body) > 1.0;
                if touches && !foot.in_contact {
                    landed.push(foot.air);
                }
                foot.air = if touches { 0.0 } else { foot.air + dt };
                foot.in_contact = touches;
            }
            let sensor = env.sim().sensor(others).unwrap();
            let state = State {
                position: Vector3::from_column_slice(&qpos[..3]),
                turned: UnitQuaternion::from_quaternion(Quaternion::new(qpos[3], qpos[4], qpos[5], qpos[6])),
                linear: Vector3::from_column_slice(&qvel[..3]),
                angular: Vector3::from_column_slice(&qvel[3..6]),
                joints: qpos[7..].to_vec(),
                accelerations: qvel[6..].iter().zip(speeds.iter()).map(|(new, old)| (new - old) / dt).collect(),
                speeds: qvel[6..].to_vec(),
                starts: starts.clone(),
                landings: landed,
                forces: (0..sensor.body_names().len()).map(|body| force(sensor, body)).collect(),
            };
            landings += state.landings.len();
            contacts += state.forces.iter().filter(|force| **force > FORCE).count();
            let observed: Vec<f64> = OBSERVATIONS.iter().flat_map(|case| (case.value)(&state)).collect();
            let observed = (result.final_observations.row(e).to_vec(), observed);
            let rewards: Vec<f64> = REWARDS.iter().flat_map(|case| (case.value)(&state)).collect();
            let rewards = (result.info.reward_terms.row(e).to_vec(), rewards);
            // Differences of velocities over a step of 5 ms lose three digits. MuJoCo normalizes quaternions.
            let close = Tolerance::mixed(1e-9, "rounding of 1e-15, times 1/dt² = 4e4, times squares up to 1e4");
            for (what, (found, expected)) in [("observations", observed), ("rewards", rewards)] {
                assert_close(&format!("step {step}, environment {e}, {what}"), found, expected, close);
            }
            *speeds = state.speeds;
        }
    }
    assert!(landings > 3 && contacts > 10, "{landings} landings, {contacts} contacts");
}

/// Targets are the initial positions plus the scaled actions, within the limits. The observed efforts are those of the
/// drives.
#[test]
fn joint_targets() {
    let text = format!("{TASK}\n[observations.policy.efforts]\ntype = 'joint_effort'\n");
    let mut env = env(quadrupeds(), &text);
    let robot = env.sim().entities().robot_id("quadruped").unwrap();
    assert!(env.action_space().low()[0] == f64::NEG_INFINITY && env.action_space().high()[0] == f64::INFINITY);
    env.reset(None, Some(1)).unwrap();
    let actions = Array2::from_shape_fn((ENVS, 12), |(env, k)| 0.1 * (k as f64 - 5.0) + env as f64);
    let step = env.step(&actions).unwrap();
    let robot = env.sim().robot(robot);
    let (starts, limits) = (robot.default_qpos(), robot.qpos_limits());
    let scale = |joint: &str| [("KFE", 0.3), ("HAA", 0.1)].into_iter().find(|(end, _)| joint.ends_with(end));
    let expected = Array2::from_shape_fn((ENVS, 12), |(env, k)| {
        let scale = scale(&robot.joint_names()[k]).map_or(1.0, |(_, scale)| scale);
        (starts[(env, k)] + scale * actions[(env, k)]).clamp(limits[(env, k, 0)], limits[(env, k, 1)])
    });
    assert_eq!(robot.qpos_target(), expected);
    assert_eq!(step.final_observations, robot.qf());
    assert!(robot.qf().iter().any(|effort| effort.abs() > 1.0), "{}", robot.qf());
}

/// On a slope, heights are those of the plane z = 0.2 x below the rays.
#[test]
fn height_scan() {
    let cfg = SimulationManagerCfg { num_envs: 2, ground: None, ..SimulationManagerCfg::legged() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    sim.add_terrain(TerrainCfg::generated("slope", Slope::default()).unwrap()).unwrap();
    let robot = sim.add_robot(assets::quadruped().unwrap()).unwrap();
    let scanner = RayCasterCfg {
        parent: Some("quadruped/base".into()),
        offset: Pose::translation(0.0, 0.0, 20.0),
        alignment: RayAlignment::Yaw,
        pattern: Grid { resolution: 0.5, size: [1.0, 0.5], ..Default::default() }.into(),
        targets: HitTargets::Named(vec!["slope".into()]),
        ..Default::default()
    };
    sim.add_sensor("scanner", scanner).unwrap();
    let term = "[observations.policy.heights]\ntype = 'height_scan'\nsensor = 'scanner'\noffset = 0.3\n";
    let mut env = env(sim, &[TASK, term].concat());
    let seen = env.reset(None, Some(1)).unwrap();
    let z = env.sim().robot(robot).root_pose()[(0, 2)];
    // Three rays along x, for each of two along y.
    let expected = [-0.5, 0.0, 0.5, -0.5, 0.0, 0.5].map(|x| z - 0.2 * x - 0.3);
    let close =
        Tolerance::absolute(1e-5, "single precision of 6e-8, times 20 m above the robot, times a few operations");
    for row in seen.rows() {
        assert_close("heights", row, expected, close);
    }
}

/// Pushes add to the velocity; properties are random multiples and sums of the nominal ones, the same for every number of
/// environments, and do not accumulate.
#[test]
fn pushes_and_properties() {
    const EVENTS: &str = r#"
        [observations.policy]
        height = { type = "base_pos_z" }
        [events]
        mass = { type = "randomize_mass", mode = "reset", bodies = ["quadruped/base"], op = { add = [-1, 2] } }
        legs = { type = "randomize_mass", bodies = ["quadruped/.*THIGH"], op = { scale = [0.5, 1.5] } }
        friction = { type = "randomize_friction", bodies = ["quadruped/.*SHANK", "ground"], op = { set = [0.3, 0.9] } }
        push = { type = "push_by_setting_velocity", mode = { interval = [2, 2] }, linear = [[0.5, 0.5], [0, 0.25], [0, 0]] }
    "#;
    let run = |num_envs: usize| {
        let cfg = SimulationManagerCfg { num_envs, seed: 3, ..SimulationManagerCfg::legged() };
        let mut sim = SimulationManager::new(cfg).unwrap();
        let robot = sim.add_robot(assets::quadruped().unwrap()).unwrap();
        let mut env = env(sim, &[TASK, EVENTS].concat());
        let read = |env: &Env, of: usize| {
            let properties = env.sim().properties().of(EnvId(of)).unwrap();
            let mut values = vec![properties.get(Property::Mass, "quadruped/base").unwrap()[0]];
            let thighs = ["LF", "RF", "LH", "RH"].map(|leg| format!("quadruped/{leg}_THIGH"));
            let ratio = |body: &String| {
                properties.get(Property::Mass, body).unwrap()[0] / properties.nominal(Property::Mass, body).unwrap()[0]
            };
            values.extend(thighs.iter().map(ratio));
            values.push(properties.get(Property::Friction, "ground").unwrap()[0]);
            values.push(properties.get(Property::Friction, "quadruped/LF_SHANK").unwrap()[0]);
            values
        };
        let nominal =
            env.sim().properties().of(EnvId(0)).unwrap().nominal(Property::Mass, "quadruped/base").unwrap()[0];
        let mut all = Vec::new();
        for _ in 0..3 {
            env.reset(None, None).unwrap();
            all.push((0..num_envs).map(|of| read(&env, of)).collect::<Vec<_>>());
        }
        for values in all.iter().flatten() {
            assert!((nominal - 1.0..=nominal + 2.0).contains(&values[0]), "{values:?}");
            assert!(values[1..5].iter().all(|ratio| (0.5..=1.5).contains(ratio)), "{values:?}");
            assert!(values[5..].iter().all(|friction| (0.3..=0.9).contains(friction)), "{values:?}");
        }
        // New masses at every reset, and other numbers for each body; startup events act once.
        assert!(all[0][0][0] != all[1][0][0] && all[0][0][1] == all[1][0][1] && all[0][0][1] != all[0][0][2]);
        // In the air, only pushes change the horizontal velocity of the center of mass of the whole robot.
        let raised = array![[0.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0]];
        env.sim_mut().robot_mut(robot).write_root_pose(&raised, None).unwrap();
        let mut before = env.sim().robot(robot).root_velocity();
        for step in 1..=6 {
            env.step(&Array2::zeros((num_envs, 12))).unwrap();
            let after = env.sim().robot(robot).root_velocity();
            for (after, before) in after.rows().into_iter().zip(before.rows()) {
                let (dx, dy) = (after[0] - before[0], after[1] - before[1]);
                // Drives at rest move the root by less than a thousandth of the push.
                let expected = if step % 2 == 0 { 0.5 } else { 0.0 };
                assert!((dx - expected).abs() < 5e-4, "step {step}: {dx}");
                assert!((-5e-4..0.25 + 5e-4).contains(&dy) && (step % 2 == 0 || dy.abs() < 5e-4), "step {step}: {dy}");
            }
            before = after;
        }
        all
    };
    let (three, two) = (run(3), run(2));
    for (three, two) in three.iter().zip(&two) {
        assert_eq!(three[..2], two[..]);
    }
    assert!(three[0][0] != three[0][1]);
}
