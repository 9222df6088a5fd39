//! Commands that are drawn again during episodes, and velocity commands.

use super::bundled::{cfg, idle, world};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::tasks::terms::{UniformVelocityCfg, generated_commands, uniform_command, uniform_velocity};
use kinetoscope::tasks::{CommandTerm, Env, EnvBuilder, EnvCfg, EnvError, TaskCfg, TermRegistry};
use kinetoscope_testkit::worlds::{mjcf_robot, passive};
use std::f64::consts::PI;

/// A task that observes a command with one column. Steps take 0.02 s.
fn commanded(num_envs: usize, threads: usize, seconds: [f64; 2]) -> Env {
    let (sim, _) = world(cfg(num_envs, threads), false);
    let goal = CommandTerm::new("goal", ["x"], |rng| [rng.uniform()]).resampled_every(seconds);
    EnvBuilder::new(sim, EnvCfg { decimation: 2, episode_steps: Some(50), ..EnvCfg::default() })
        .action(idle())
        .command(goal)
        .observation(generated_commands("goal", "goal", ["x"]))
        .build()
        .unwrap()
}

/// The observed command of each environment in each of `steps` steps, from the reset on.
fn values(env: &mut Env, steps: usize) -> Vec<Vec<f64>> {
    let n = env.num_envs();
    let mut all: Vec<Vec<f64>> = env.reset(None, Some(4)).unwrap().column(0).iter().map(|x| vec![*x]).collect();
    for _ in 0..steps {
        let seen = env.step(&Array2::zeros((n, 1))).unwrap().final_observations;
        all.iter_mut().zip(seen.column(0)).for_each(|(all, x)| all.push(*x));
    }
    all
}

/// Steps between two changes.
fn gaps(values: &[f64]) -> Vec<usize> {
    let changes: Vec<usize> = (1..values.len()).filter(|&k| values[k] != values[k - 1]).collect();
    changes.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

#[test]
fn resampling() {
    // 0.06 s are 3 steps, 0.05 s are rounded up to 3.
    for seconds in [[0.06, 0.06], [0.05, 0.05]] {
        let found = values(&mut commanded(2, 1, seconds), 49);
        assert!(found.iter().all(|of| gaps(of) == [3; 15]), "{:?}", gaps(&found[0]));
        assert_eq!(found[0][0], found[0][2]);
        assert_ne!(found[0][0], found[0][3]);
        assert_ne!(found[0], found[1]);
    }
    // Random times of up to 5 steps: with 16 environments and some 15 draws, the chance that one of five equally likely
    // numbers is missing is 5 * 0.8^200 < 1e-18.
    let found = values(&mut commanded(16, 1, [1e-3, 0.1]), 49);
    let mut seen = [0; 6];
    found.iter().flat_map(|of| gaps(of)).for_each(|gap| seen[gap] += 1);
    assert!(seen[0] == 0 && seen[1..].iter().all(|count| *count > 0), "{seen:?}");
    // The numbers of an environment do not depend on the batch.
    assert_eq!(values(&mut commanded(5, 3, [0.02, 0.2]), 120), values(&mut commanded(16, 1, [0.02, 0.2]), 120)[..5]);
    // Without a time, they stay for the episode of 50 steps.
    assert!(gaps(&values(&mut commanded(1, 1, [9.0, 9.0]), 49)[0]).is_empty());
}

/// A floating box without gravity, with a wheel that does not turn.
fn floater(num_envs: usize) -> (SimulationManager, RobotId) {
    let box_ = r#"<mujoco><worldbody><body name="trunk" pos="0 0 1"><freejoint name="float"/>
        <geom type="box" size="0.2 0.1 0.05" mass="2"/><body><joint name="hinge"/><geom size="0.03" mass="0.1"/></body>
        </body></worldbody></mujoco>"#;
    let mut sim =
        SimulationManager::new(SimulationManagerCfg { gravity: nalgebra::Vector3::zeros(), ..cfg(num_envs, 1) })
            .unwrap();
    let robot = RobotCfg { fix_base: false, ..passive(mjcf_robot("floater", box_)) };
    let robot = sim.add_robot(robot).unwrap();
    (sim, robot)
}

const COLUMNS: [&str; 3] = ["lin_vel_x", "lin_vel_y", "ang_vel_z"];

fn velocity_task(num_envs: usize, cfg: UniformVelocityCfg) -> (Env, RobotId) {
    let (sim, robot) = floater(num_envs);
    let env = EnvBuilder::new(sim, EnvCfg::default())
        .action(idle())
        .command(uniform_velocity("velocity", robot, cfg).unwrap())
        .observation(generated_commands("velocity", "velocity", COLUMNS))
        .build()
        .unwrap();
    (env, robot)
}

/// A heading command turns toward its heading: the stiffness times the error from -π to π, within the range.
#[test]
fn headings() {
    for (target, yaw, error) in
        [(0.5, 0.2, 0.3), (3.0, -3.0, 6.0 - 2.0 * PI), (-3.0, 3.0, 2.0 * PI - 6.0), (-1.0, 1.0, -2.0), (PI, 0.0, PI)]
    {
        let velocity = UniformVelocityCfg {
            heading: Some([target, target]),
            heading_stiffness: 0.5,
            ang_vel_z: [-0.8, 0.9],
            ..Default::default()
        };
        let (mut env, robot) = velocity_task(1, velocity);
        env.reset(None, Some(2)).unwrap();
        let first = env.observations().to_owned();
        let pose = array![[0.0, 0.0, 1.0, (yaw / 2.0_f64).cos(), 0.0, 0.0, (yaw / 2.0_f64).sin()]];
        env.sim_mut().robot_mut(robot).write_root_pose(&pose, None).unwrap();
        let seen = env.step(&Array2::zeros((1, 1))).unwrap().observations;
        let expected = (0.5 * error).clamp(-0.8, 0.9);
        assert!((seen[(0, 2)] - expected).abs() < 1e-9, "from {yaw} to {target}: {seen}, not {expected}");
        // Velocities stay, and at the reset the heading was 0.
        assert_eq!((seen[(0, 0)], seen[(0, 1)]), (first[(0, 0)], first[(0, 1)]));
        assert!((first[(0, 2)] - (0.5 * target).clamp(-0.8, 0.9)).abs() < 1e-9, "{first}");
    }
}

/// Shares of standing and heading environments, and the ranges. n environments with a share p: a standard deviation of
/// sqrt(p (1 - p) / n), and a bound of six of them.
#[test]
fn shares() {
    let n = 2000;
    let velocity = UniformVelocityCfg {
        lin_vel_x: [0.5, 1.0],
        lin_vel_y: [-0.2, -0.1],
        ang_vel_z: [0.3, 0.7],
        heading: Some([3.0, 3.0]),
        rel_heading_envs: 0.3,
        rel_standing_envs: 0.1,
        ..Default::default()
    };
    let (mut env, _) = velocity_task(n, velocity);
    let seen = env.reset(None, Some(9)).unwrap();
    let (mut standing, mut turning) = (0, 0);
    for row in seen.rows() {
        if row.iter().all(|x| *x == 0.0) {
            standing += 1;
            continue;
        }
        assert!(
            (0.5..=1.0).contains(&row[0]) && (-0.2..=-0.1).contains(&row[1]) && (0.3..=0.7).contains(&row[2]),
            "{row}"
        );
        // A heading error of 3 rad exceeds the largest turning rate.
        turning += usize::from(row[2] == 0.7);
    }
    let is_near = |count: usize, share: f64| {
        let apart = count as f64 / n as f64 - share;
        assert!(apart.abs() < 6.0 * (share * (1.0 - share) / n as f64).sqrt(), "{count} of {n}, not {share}");
    };
    is_near(standing, 0.1);
    is_near(turning, 0.9 * 0.3);
}

#[test]
fn refused() {
    let (sim, robot) = floater(1);
    let of = UniformVelocityCfg::default;
    for (cfg, word) in [
        (UniformVelocityCfg { lin_vel_x: [1.0, 0.0], ..of() }, "lin_vel_x"),
        (UniformVelocityCfg { heading: Some([0.0, f64::NAN]), ..of() }, "heading"),
        (UniformVelocityCfg { rel_standing_envs: 1.5, ..of() }, "rel_standing_envs"),
        (UniformVelocityCfg { rel_heading_envs: -0.1, ..of() }, "rel_heading_envs"),
        (UniformVelocityCfg { heading_stiffness: f64::INFINITY, ..of() }, "heading_stiffness"),
    ] {
        let error = uniform_velocity("velocity", robot, cfg).unwrap_err();
        assert!(matches!(&error, EnvError::Config { field, .. } if field.contains(word)), "{error}");
    }
    drop(sim);
    for seconds in [[0.0, 1.0], [2.0, 1.0], [1.0, f64::INFINITY]] {
        let (sim, _) = world(cfg(1, 1), false);
        let goal = CommandTerm::new("goal", ["x"], |_| [0.0]).resampled_every(seconds);
        let task = EnvBuilder::new(sim, EnvCfg::default()).action(idle()).command(goal);
        let error = task.observation(generated_commands("g", "goal", ["x"])).build().map(drop).unwrap_err();
        assert!(matches!(&error, EnvError::Config { field, .. } if field.contains("resampling time")), "{error}");
    }
    // A derived command of another shape, or with a number that is not finite.
    for (values, word) in [(Array2::zeros((1, 2)), "shape"), (array![[f64::NAN]], "finite")] {
        let (sim, _) = world(cfg(1, 1), false);
        let goal = CommandTerm::derived("goal", ["x"], |_| [0.0], move |_, _| Ok(values.clone()));
        let task = EnvBuilder::new(sim, EnvCfg::default()).action(idle()).command(goal);
        let mut env = task.observation(generated_commands("g", "goal", ["x"])).build().unwrap();
        let error = env.reset(None, None).unwrap_err().to_string();
        assert!(error.contains("goal") && error.contains(word), "{error}");
    }
}

/// Columns are independent, in the order of the file, and within their ranges.
#[test]
fn uniform_commands() {
    const N: usize = 400;
    let text = "
        [actions.push]
        type = \"joint_efforts\"
        bound = 1
        [commands.goal]
        type = \"uniform_command\"
        columns = { x = [2, 4], a = [-1, 0], same = [7, 7] }
        [observations.policy.goal]
        type = \"generated_commands\"
        command = \"goal\"
    ";
    let task = |text: &str| {
        let (sim, task) = (world(cfg(N, 1), false).0, TaskCfg::from_toml(text).unwrap());
        EnvBuilder::from_cfg(sim, &task, &TermRegistry::default()).unwrap().build().unwrap()
    };
    let mut env = task(text);
    assert_eq!(env.observation_space().names(), ["goal/x", "goal/a", "goal/same"]);
    let drawn = env.reset(None, Some(3)).unwrap();
    for (column, [low, high]) in [(0, [2.0, 4.0]), (1, [-1.0, 0.0])] {
        let values = drawn.column(column);
        assert!(values.iter().all(|value| (low..=high).contains(value)));
        // The mean of N numbers is within five standard deviations of a uniform distribution, width / sqrt(12 N).
        let deviation = (high - low) / (12.0 * N as f64).sqrt();
        assert!((values.sum() / N as f64 - 0.5 * (low + high)).abs() < 5.0 * deviation);
    }
    assert!(drawn.column(2).iter().all(|value| *value == 7.0));
    // The correlation of N independent pairs has the standard deviation 1 / sqrt(N).
    let product = |row: kinetoscope::ndarray::ArrayView1<'_, f64>| (row[0] - 3.0) * (row[1] + 0.5) * 6.0;
    let correlation = drawn.rows().into_iter().map(product).sum::<f64>() / N as f64;
    assert!(correlation.abs() < 5.0 / (N as f64).sqrt(), "{correlation}");
    // They stay during an episode, unless there is a time.
    let idle = Array2::zeros((N, 1));
    assert_eq!(env.step(&idle).unwrap().observations, drawn);
    let mut resampled = task(&text.replace("columns =", "resampling_time = [0.01, 0.01]\ncolumns ="));
    assert_eq!(resampled.reset(None, Some(3)).unwrap(), drawn);
    assert_ne!(resampled.step(&idle).unwrap().observations, drawn);
    assert!(matches!(uniform_command("goal", [("x", [1.0, 0.0])]), Err(EnvError::Config { .. })));
}
