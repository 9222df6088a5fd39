//! An arm learns to reach: a linear policy, found by augmented random search in 256 environments at once.
//!
//! ```text
//! cargo run --release --example train_reach -- --headless --out images
//! cargo run --release --example train_reach -- --headless --no-signal
//! ```
//!
//! Each iteration tests random perturbations of the policy's weights, each with both signs, on the same eight targets.
//! It moves the weights along the perturbations with the higher returns (Mania, Guy and Recht: *Simple random search of
//! static linear policies is competitive for reinforcement learning*, 2018; version V1 without the selection of the
//! best directions). All random numbers are keyed by `--seed`: curve and policy are the same for any number of threads.
//!
//! The learning code accesses the arm only through a [`VectorEnv`]; a few lines around it count the reached targets.
//!
//! The exit code is 0 if the arm has learned the task. It is 1 if it has not, as with the second command, which
//! shuffles the returns between policies, and 2 for an error.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::{KeyedRng, Marker};
use kinetoscope::tasks::{
    CommandTerm, Env, EnvBuilder, EnvCfg, ObservationTerm, RewardTerm, TermContext, TermResult, VectorEnv, terms,
};
use launcher::{Launcher, MainLoop, stage, trial};
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Learns to reach random targets, and counts the reached ones before and after.
#[derive(Debug, Parser)]
#[command(name = "train_reach", mut_arg("num_envs", |arg| arg.default_value("256")))]
pub(crate) struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Number of policy updates
    #[arg(long, default_value_t = 32)]
    iterations: usize,
    /// Standard deviation of the perturbations of the policy's weights
    #[arg(long, default_value_t = 0.15)]
    noise: f64,
    /// Learning rate of the weights
    #[arg(long, alias = "step_size", default_value_t = 0.15)]
    step_size: f64,
    /// Shuffle the returns between policies, so that they carry no learning signal
    #[arg(long, alias = "no_signal")]
    no_signal: bool,
}

/// Number of targets that every perturbation is tested on.
pub(crate) const TARGETS: usize = 8;
/// The box of targets: its center and half of its sides \[m\]. The tip starts at (0.54, 0.14, 0.37).
const MIDDLE: [f64; 3] = [0.5, 0.1, 0.45];
const HALF: [f64; 3] = [0.12, 0.3, 0.15];
/// Steps of an episode: 3 s.
const EPISODE: u64 = 60;
/// Physics steps of 10 ms per environment step: decisions at 20 Hz.
const DECIMATION: u32 = 5;
/// Largest change of a joint's target per step \[rad\]: 2 rad/s.
const MAX_TARGET_CHANGE: f64 = 0.1;
/// Scale of the observed distances \[1/m\], which makes them about as large as joint angles.
const DISTANCE_SCALE: f64 = 10.0;

/// Largest distance of the tip from a reached target at the end of an episode \[m\]. A ball of this radius is 0.26 % of
/// the box: a policy that ends anywhere in the box reaches that share of the targets.
const REACH_DISTANCE: f64 = 0.03;
/// Share of targets that has to be reached at the end.
const REQUIRED_SHARE: f64 = 0.9;

fn main() -> ExitCode {
    trial::run("train_reach", || run(&Args::parse()))
}

fn run(args: &Args) -> launcher::Result<bool> {
    let num_envs = args.launcher.num_envs;
    if num_envs == 0 || !num_envs.is_multiple_of(2 * TARGETS) {
        let block = 2 * TARGETS;
        return Err(format!(
            "--num-envs {num_envs}: it must be a multiple of {block}, both signs on {TARGETS} targets"
        )
        .into());
    }
    for (flag, value) in [("--noise", args.noise), ("--step-size", args.step_size)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(format!("{flag} {value}: it must be above 0").into());
        }
    }
    // Number of distinct targets: few while learning, so that perturbations are compared on the same ones; later one
    // per environment.
    let targets = Arc::new(AtomicUsize::new(num_envs));
    let mut env = task(args, Arc::clone(&targets))?;
    args.launcher.write_dump(env.sim())?;
    args.launcher.serve(env.sim_mut())?;
    args.launcher.open_window(env.sim_mut());
    let recording = args.launcher.start_recording(env.sim_mut())?;
    let progress = MainLoop::new(&args.launcher, (args.iterations as u64).saturating_add(2).saturating_mul(EPISODE));
    let mut run = Rollout { env: &mut env, progress: &progress, step: 0 };

    let mut policy = Policy::zero(run.env);
    // Test targets that are not used for learning.
    let test_seed = args.launcher.seed.wrapping_add(1);
    let before = run.success_rate(&policy, test_seed)?;
    if let Some(before) = before {
        progress.print_line(&format!("Before: {:.1} % of {num_envs} targets are reached", 100.0 * before));
    }
    targets.store(TARGETS, Ordering::Relaxed);
    let mut rows: Vec<[f64; 3]> = Vec::new();
    let mut observations = run.env.reset(None, Some(args.launcher.seed))?;
    for iteration in 0..args.iterations {
        let tried = Candidates::new(&policy, args, iteration);
        let Some((returns, distances)) = run.episode(&mut observations, |env| tried.policies[env / TARGETS].view())?
        else {
            break;
        };
        let permuted = if args.no_signal { shuffled(&returns, args.launcher.seed, iteration) } else { returns.clone() };
        policy.learn(&tried, &permuted, args.step_size);
        let reached = count_reached(&distances) as f64 / num_envs as f64;
        let (mean, tip_to_target) = (returns.mean().unwrap_or_default(), distances.mean().unwrap_or_default());
        rows.push([mean, tip_to_target, reached]);
        if iteration % 5 == 4 {
            let text = format!(
                "Iteration {:>3}: return {mean:8.3}, {tip_to_target:.3} m from the target, {:.1} % reached",
                iteration + 1,
                100.0 * reached
            );
            progress.print_line(&text);
        }
    }
    targets.store(num_envs, Ordering::Relaxed);
    let after = run.success_rate(&policy, test_seed)?;

    let steps = run.step;
    let rate = progress.env_steps_per_second(steps * u64::from(DECIMATION), num_envs);
    let share = |reached: Option<f64>| reached.map_or("not measured".into(), |share| format!("{:.1} %", 100.0 * share));
    println!("\nTargets that are reached, to {REACH_DISTANCE} m: {} before, {} after", share(before), share(after));
    println!("{} iterations, {rate:.0} physics steps of an environment per second", rows.len());
    recording.finish(env.sim_mut())?;
    if let Some(out) = &args.launcher.out {
        write_curve(&rows, out)?;
        render_final_poses(&mut env, &policy, test_seed, &out.join("train_reach_all.png"))?;
        println!("Curve and image written to {}", out.display());
    }
    args.launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": num_envs,
        "seed": args.launcher.seed,
        "iterations": rows.len(),
        "near": REACH_DISTANCE,
        "reached_before": before,
        "reached_after": after,
        "needed": REQUIRED_SHARE,
        "signal": !args.no_signal,
        "curve": rows.iter().map(|[mean, apart, reached]| json!({ "return": mean, "distance": apart, "reached": reached })).collect::<Vec<_>>(),
        "policy": policy.weights.iter().collect::<Vec<_>>(),
        "env_steps_per_second": rate,
        "warnings": env.sim().warnings().counts(),
    }))?;
    Ok(after.is_some_and(|after| after >= REQUIRED_SHARE))
}

/// Builds the environment: arm, actions, commands, observations and rewards.
pub(crate) fn task(args: &Args, targets: Arc<AtomicUsize>) -> launcher::Result<Env> {
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        arena_space: args.launcher.arena_space.unwrap_or(1.6),
        ..args.launcher.simulation()?
    })?;
    let elbow = [("JOINT2", 0.3), ("JOINT3", -2.2), ("JOINT5", 0.6)];
    let arm = sim.add_robot(RobotCfg {
        uid: "sr5".into(),
        urdf: UrdfCfg::single(assets::path("sr5/SR5.urdf")?),
        init_qpos: elbow.map(|(joint, q)| (joint.to_string(), q)).to_vec(),
        ..Default::default()
    })?;
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    let turns = terms::relative_joint_positions(&sim, "turn", arm, &["JOINT[1-6]"], MAX_TARGET_CHANGE)?;
    let angles = terms::joint_pos_rel(&sim, "angle", arm, &["JOINT[1-6]"])?;
    // Vector from the tip to the target \[m\].
    let apart = move |now: &TermContext<'_>| -> TermResult<Array2<f64>> {
        let tip = now.sim().robot(arm).link_pose("ee_link")?;
        Ok(Array2::from_shape_fn((now.num_envs(), 3), |(env, k)| -tip[(env, k)]) + now.command("target")?)
    };
    let distance = move |now: &TermContext<'_>| -> TermResult<Array1<f64>> {
        Ok(apart(now)?.map_axis(Axis(1), |row| row.iter().map(|x| x * x).sum::<f64>().sqrt()))
    };
    Ok(EnvBuilder::new(sim, EnvCfg { decimation: DECIMATION, episode_steps: Some(EPISODE), ..EnvCfg::default() })
        .action(turns)
        .command(CommandTerm::new("target", ["x", "y", "z"], move |episode_rng| {
            // The target is the same for all compared policies, and changes with every episode.
            let target = (episode_rng.global_env() % targets.load(Ordering::Relaxed)) as u64;
            let mut random = KeyedRng::keyed(episode_rng.seed(), target, &format!("target {}", episode_rng.episode()));
            std::array::from_fn(|k| MIDDLE[k] + HALF[k] * (2.0 * random.uniform() - 1.0))
        }))
        .observation(ObservationTerm::new("to target", ["x", "y", "z"], apart).scaled(DISTANCE_SCALE))
        .observation(angles)
        .reward(RewardTerm::new("far", -1.0, distance))
        .reward(RewardTerm::new("near", 0.5, move |now| Ok(distance(now)?.mapv(|d| 1.0 - (d / 0.1).tanh()))))
        .reward(terms::action_rate("smooth", -1e-3))
        .build()?)
}

/// A linear policy: weights of the observations and of a constant 1, shape (observations + 1, actions).
#[derive(Clone, Debug)]
struct Policy {
    weights: Array2<f64>,
}

impl Policy {
    /// The zero policy: no action.
    fn zero(env: &impl VectorEnv) -> Self {
        Self { weights: Array2::zeros((env.observation_space().len() + 1, env.action_space().len())) }
    }

    /// Moves the weights along the perturbations with the higher returns.
    ///
    /// The step is the step size times the mean over perturbations, each weighted by its return difference between both
    /// signs, divided by the standard deviation of all returns.
    fn learn(&mut self, tried: &Candidates, returns: &Array1<f64>, step_size: f64) {
        let mean_return =
            |policy: usize| (0..TARGETS).map(|t| returns[policy * TARGETS + t]).sum::<f64>() / TARGETS as f64;
        let all: Vec<f64> = (0..tried.policies.len()).map(mean_return).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let spread = (all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt().max(1e-9);
        let rate = step_size / (tried.changes.len() as f64 * spread);
        for (pair, change) in all.chunks_exact(2).zip(&tried.changes) {
            self.weights.scaled_add(rate * (pair[0] - pair[1]), change);
        }
    }
}

/// Tested policies: each perturbation of the weights, added and subtracted.
struct Candidates {
    changes: Vec<Array2<f64>>,
    policies: Vec<Array2<f64>>,
}

impl Candidates {
    fn new(policy: &Policy, args: &Args, iteration: usize) -> Self {
        let change = |direction: usize| {
            let mut random = KeyedRng::keyed(args.launcher.seed, direction as u64, &format!("change {iteration}"));
            Array2::from_shape_simple_fn(policy.weights.dim(), || random.normal())
        };
        let changes: Vec<Array2<f64>> = (0..args.launcher.num_envs / (2 * TARGETS)).map(change).collect();
        let both = |change: &Array2<f64>| [args.noise, -args.noise].map(|by| &policy.weights + &(by * change));
        let policies = changes.iter().flat_map(both).collect();
        Self { changes, policies }
    }
}

/// The returns in random order.
fn shuffled(returns: &Array1<f64>, seed: u64, iteration: usize) -> Array1<f64> {
    let mut random = KeyedRng::keyed(seed, iteration as u64, "no signal");
    let mut told = returns.clone();
    // Fisher-Yates shuffle: all orders are equally probable.
    for k in (1..told.len()).rev() {
        let other = (random.uniform() * (k + 1) as f64) as usize;
        told.swap(k, other.min(k));
    }
    told
}

/// Runs episodes in all environments, one after the other.
struct Rollout<'r, E> {
    env: &'r mut E,
    progress: &'r MainLoop,
    /// Steps so far.
    step: u64,
}

impl<E: VectorEnv> Rollout<'_, E> {
    /// Runs one episode in all environments, starting from the observations `seen`. Returns the return of each
    /// environment, and the distance of its tip from the target at the end \[m\]. Afterwards the next episode has
    /// begun, and `seen` holds its first observations. `None` if the user has stopped the run.
    fn episode<'p>(
        &mut self,
        seen: &mut Array2<f64>,
        policy: impl Fn(usize) -> ArrayView2<'p, f64>,
    ) -> launcher::Result<Option<(Array1<f64>, Array1<f64>)>> {
        let mut returns = Array1::zeros(self.env.num_envs());
        let mut actions = Array2::zeros((self.env.num_envs(), self.env.action_space().len()));
        for k in 1..=EPISODE {
            if self.progress.should_stop(self.step) {
                return Ok(None);
            }
            act(seen, &policy, &mut actions);
            let step = self.env.step(actions.view())?;
            self.step += 1;
            self.progress.advance(self.step);
            returns += &step.rewards;
            *seen = step.observations;
            if k == EPISODE {
                let apart = |row: ArrayView1<'_, f64>| {
                    row.iter().take(3).map(|x| (x / DISTANCE_SCALE).powi(2)).sum::<f64>().sqrt()
                };
                return Ok(Some((returns, step.final_observations.map_axis(Axis(1), apart))));
            }
        }
        Ok(None)
    }

    /// Share of the environments in which the policy reaches the target in one episode with the seed; `None` if the
    /// user has stopped the run.
    fn success_rate(&mut self, policy: &Policy, seed: u64) -> launcher::Result<Option<f64>> {
        let mut seen = self.env.reset(None, Some(seed))?;
        let done = self.episode(&mut seen, |_| policy.weights.view())?;
        Ok(done.map(|(_, distances)| count_reached(&distances) as f64 / distances.len() as f64))
    }
}

/// Computes the actions of each environment's policy from the observations `seen`.
fn act<'p>(seen: &Array2<f64>, policy: impl Fn(usize) -> ArrayView2<'p, f64>, actions: &mut Array2<f64>) {
    for ((env, mut action), row) in actions.rows_mut().into_iter().enumerate().zip(seen.rows()) {
        let weights = policy(env);
        action.assign(&weights.row(row.len()));
        row.iter().zip(weights.rows()).for_each(|(&x, weights)| action.scaled_add(x, &weights));
    }
}

/// Renders all environments with their targets, one step before the end of an episode.
fn render_final_poses(env: &mut Env, policy: &Policy, seed: u64, file: &Path) -> launcher::Result {
    let mut seen = env.reset(None, Some(seed))?;
    let mut actions = Array2::zeros((env.num_envs(), env.action_space().len()));
    for _ in 1..EPISODE {
        act(&seen, |_| policy.weights.view(), &mut actions);
        seen = env.step(&actions)?.observations;
    }
    let targets = env.context().command("target")?;
    let ball = |row: ArrayView1<'_, f64>| {
        Marker::sphere([row[0], row[1], row[2]], REACH_DISTANCE as f32, [0.9, 0.2, 0.1, 1.0])
    };
    let balls: Vec<_> = targets.rows().into_iter().enumerate().map(|(env, row)| (EnvId(env), ball(row))).collect();
    let far = env.sim().cfg().env_origins().iter().fold(0.0, |most: f64, x| most.max(*x));
    stage::write(env.sim_mut(), &balls, [far + 2.0, -far - 1.6, 2.2], [far - 1.0, 1.0 - far, 0.0], file)
}

/// Number of distances \[m\] that count as reached.
fn count_reached(distances: &Array1<f64>) -> usize {
    distances.iter().filter(|distance| **distance < REACH_DISTANCE).count()
}

/// Writes the learning curve as numbers and as a plot.
fn write_curve(rows: &[[f64; 3]], out: &Path) -> launcher::Result {
    launcher::make_folder(out)?;
    let mut text = String::from("iteration,return,distance_m,reached\n");
    for (k, [mean, apart, reached]) in rows.iter().enumerate() {
        text += &format!("{},{mean},{apart},{reached}\n", k + 1);
    }
    let file = out.join("curve.csv");
    std::fs::write(&file, text).map_err(|e| format!("{}: {e}", file.display()))?;
    plot_curve(rows, &out.join("curve.png"))
}

#[cfg(feature = "viewer")]
fn plot_curve(rows: &[[f64; 3]], file: &Path) -> launcher::Result {
    use kinetoscope::viewer::plot::{self, Plot, Series};
    let reached = (1..).zip(rows).map(|(k, row)| [f64::from(k), row[2]]);
    let plot = Plot {
        title: "share of targets reached while trying changes".into(),
        axis_labels: ["iteration".into(), "share".into()],
        series: vec![Series::new("reached", reached)],
        ..Plot::default()
    };
    Ok(plot::write(&plot, file)?)
}

/// Writes nothing: plots are a part of the viewers.
#[cfg(not(feature = "viewer"))]
fn plot_curve(_: &[[f64; 3]], file: &Path) -> launcher::Result {
    println!("{} is left out: this build has no plots; build with the feature `viewer`", file.display());
    Ok(())
}
