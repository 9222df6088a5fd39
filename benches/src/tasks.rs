//! Steps of the velocity task of a quadruped: observations, rewards, terminations, commands, events and resets, compared
//! with the same simulation that only gets the position targets. The ratio is the share of the simulation.
//!
//! The terms are those of Isaac Lab's velocity task on flat ground. Its robots stand, because the actions are 0.

use crate::interleave::{Contender, MeasurementCfg, in_both_orders, measure};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::ndarray::{Array1, Array2};
use kinetoscope::prelude::*;
use kinetoscope::tasks::{Env, EnvBuilder, TaskCfg, TermRegistry, TerminationTerm};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

const ENVS: [usize; 2] = [64, 4096];
const THREADS: [usize; 2] = [1, 2];
/// The robots stand still, so restarts are not needed.
const STEPS: u32 = 1_000_000;
/// Steps until the robots have settled.
const SETTLING: u32 = 50;
/// Length of an episode in steps: 20 s.
const EPISODE: usize = 1000;
/// Smallest share of the simulation in the time of a step.
const SMALLEST_SHARE: f64 = 0.9;

const TASK: &str = r#"
decimation = 4

[actions.joints]
type = "joint_positions"
scale = 0.5

[commands.velocity]
type = "uniform_velocity"
lin_vel_x = [-1, 1]
lin_vel_y = [-1, 1]
ang_vel_z = [-1, 1]
heading = [-3.14, 3.14]
heading_stiffness = 0.5
rel_standing_envs = 0.02
resampling_time = [10, 10]

[observations.policy]
base_lin_vel = { type = "base_lin_vel", noise = { low = -0.1, high = 0.1 } }
base_ang_vel = { type = "base_ang_vel", noise = { low = -0.2, high = 0.2 } }
gravity = { type = "projected_gravity", noise = { low = -0.05, high = 0.05 } }
command = { type = "generated_commands", command = "velocity" }
positions = { type = "joint_pos_rel", noise = { low = -0.01, high = 0.01 } }
velocities = { type = "joint_vel", noise = { low = -1.5, high = 1.5 } }
actions = { type = "last_action" }

[rewards]
linear = { type = "track_lin_vel", weight = 0.02, command = "velocity", std = 0.5 }
turning = { type = "track_ang_vel", weight = 0.01, command = "velocity", std = 0.5 }
vertical = { type = "lin_vel_z_l2", weight = -0.04 }
tilting = { type = "ang_vel_xy_l2", weight = -0.001 }
torques = { type = "joint_torques_l2", weight = -2e-7 }
accelerations = { type = "joint_acc_l2", weight = -5e-9 }
action_rate = { type = "action_rate", weight = -2e-4 }
air_time = { type = "feet_air_time", weight = 0.0025, sensor = "feet", command = "velocity", threshold = 0.5 }
contacts = { type = "undesired_contacts", weight = -0.02, sensor = "thighs", force = 1 }
upright = { type = "flat_orientation", weight = -0.05 }

[terminations]
fallen = { type = "illegal_contact", sensor = "trunk", force = 1 }

[events]
masses = { type = "randomize_mass", bodies = ["robot/base"], op = { add = [-1, 1] } }
joints = { type = "reset_joints_by_offset", positions = [-0.1, 0.1] }
root = { type = "reset_root_uniform", rpy = [[0, 0], [0, 0], [-3.14, 3.14]] }
push = { type = "push_by_setting_velocity", mode = { interval = [500, 750] }, linear = [[-0.2, 0.2], [-0.2, 0.2], [0, 0]] }
"#;

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let mut rows = Vec::new();
    for (envs, threads) in ENVS.into_iter().flat_map(|envs| THREADS.map(|threads| (envs, threads))) {
        let times = in_both_orders(|order| {
            let (mut with, mut without) =
                order.create(|| Quadrupeds::new(envs, threads, true), || Quadrupeds::new(envs, threads, false))?;
            let plan = MeasurementCfg { seconds: 0.5 * settings.seconds, restart_after: STEPS };
            measure(plan, &mut [&mut with, &mut without])
        })?;
        let micros = |side: usize| 1e6 / times.rate(side, envs);
        let row =
            Row::new("tasks", format!("quadruped, {envs} envs, velocity task"), "us/env-step", threads, micros(0));
        rows.push(row.against("simulation", micros(1), times.ratio(0, 1)).with_target_ratio(SMALLEST_SHARE));
    }
    Ok(rows)
}

/// Standing quadrupeds with a velocity task, or their simulation alone.
struct Quadrupeds {
    env: Env,
    has_task: bool,
    robot: RobotId,
    actions: Array2<f64>,
    targets: Array2<f64>,
}

impl Quadrupeds {
    fn new(envs: usize, threads: usize, has_task: bool) -> BenchResult<Self> {
        let mut cfg = SceneCfg::from_file(assets::path("scenes/quadruped.toml")?)?;
        cfg.simulation = SimulationManagerCfg { num_envs: envs, threads: Some(threads), ..cfg.simulation };
        cfg.entities.retain(|(_, entity)| !matches!(entity, EntityCfg::Sensor(_)));
        for (name, bodies, track_air_time) in
            [("feet", "FOOT", true), ("thighs", "THIGH", false), ("trunk", "base", false)]
        {
            let bodies = vec![format!("robot/.*{bodies}")];
            cfg.entities.push((name.into(), ContactSensorCfg { bodies, track_air_time, ..Default::default() }.into()));
        }
        let sim = InteractiveScene::new(cfg)?.into_sim();
        let robot = sim.entities().robot_id("robot")?;
        let targets = sim.robot(robot).default_qpos();
        let env = EnvBuilder::from_cfg(sim, &TaskCfg::from_toml(TASK)?, &TermRegistry::default())?
            .termination(staggered_ends())
            .build()?;
        let actions = Array2::zeros((envs, env.action_space().len()));
        let mut quadrupeds = Self { env, has_task, robot, actions, targets };
        quadrupeds.env.reset(None, Some(1))?;
        quadrupeds.block(SETTLING)?;
        Ok(quadrupeds)
    }
}

/// Ends the episode of each environment every [`EPISODE`] steps, of different environments in different steps, as after
/// random lengths of the first episodes.
fn staggered_ends() -> TerminationTerm {
    let step = AtomicUsize::new(0);
    let term = TerminationTerm::new("time_out", move |now| {
        let step = step.fetch_add(1, Ordering::Relaxed);
        // The factor has no divisor in common with the length, so all remainders are equally frequent.
        Ok(Array1::from_shape_fn(now.num_envs(), |env| (977 * env + step).is_multiple_of(EPISODE)))
    });
    term.truncating()
}

impl Contender for Quadrupeds {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            if self.has_task {
                self.env.step(&self.actions)?;
            } else {
                let decimation = self.env.cfg().decimation;
                let sim = self.env.sim_mut();
                sim.robot_mut(self.robot).set_qpos_target(&self.targets, None, None)?;
                sim.update(decimation);
            }
        }
        Ok(start.elapsed())
    }
}
