//! `kinetoscope bench`: how fast a model runs and is drawn on this machine.

use crate::model::ModelArgs;
use crate::render::{Look, rate};
use crate::{Ending, Result, excerpt, progress};
use kinetoscope::prelude::*;
use std::time::Instant;

/// Steps per second and pictures per second of a robot on this machine, on every core
///
/// Rates of one program on one machine: to compare with other simulators in one run, see `cargo xtask bench` in the
/// source tree.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    model: ModelArgs,
    /// Environments
    #[arg(long, alias = "num_envs", default_value_t = 64)]
    num_envs: usize,
    /// Threads that step [default: every core]
    #[arg(long)]
    threads: Option<usize>,
    /// How long each rate is measured, in seconds
    #[arg(long, default_value_t = 2.0)]
    seconds: f64,
    #[command(flatten)]
    look: Look,
}

const HELP: &str = "\
Examples:
  kinetoscope bench arm.urdf
  kinetoscope bench humanoid.xml --floating-base --num-envs 1024 --seconds 10
  kinetoscope bench arm.urdf --renderer fast-rt --width 320 --height 240

Exit codes: 0 done; 1 done, with warnings (something was repaired or ignored, an environment diverged); 2 refused.";

pub(crate) fn run(args: &Args) -> Result<Ending> {
    if !(args.seconds > 0.0 && args.seconds <= 3600.0) {
        return Err(format!("--seconds {}: give more than 0 and at most 3600", args.seconds).into());
    }
    let cfg = SimulationManagerCfg { num_envs: args.num_envs, threads: args.threads, ..Default::default() };
    let dt = cfg.physics_dt;
    let (mut sim, id) = args.model.simulation(cfg)?;
    let warned = excerpt::print_warnings(sim.diagnostics());
    let still = Still::of_env(&mut sim, EnvId(0))?;
    let view = args.look.view(&still)?;
    let mut rasterizer = args.look.rasterizer()?;
    let (start, mut steps) = (Instant::now(), 0u64);
    let step = || loop {
        sim.update(8);
        steps += 8;
        // Who trains reads the state after each step.
        let _ = sim.robot(id).get_qpos();
        let elapsed = start.elapsed().as_secs_f64();
        if elapsed >= args.seconds {
            return elapsed;
        }
    };
    let share = || Some(start.elapsed().as_secs_f64() / args.seconds);
    let elapsed = progress::during("steps", share, step);
    let each = steps as f64 / elapsed;
    let all = each * args.num_envs as f64;
    println!("{} environments on {} threads, steps of {dt} s", args.num_envs, sim.threads());
    println!("  {all:>12.0} environment steps per second, {:.0} x real time in all", all * dt);
    println!("  {each:>12.0} steps of all environments per second");
    let diverged = sim.diverged();
    for (env, reason) in &diverged {
        eprintln!("warning: environment {}: {reason}", env.0);
    }
    let pictures = rate(&mut rasterizer, still.shot(&view), args.seconds)?;
    println!("pictures of {} x {} with color, depth, mask and normals", view.width, view.height);
    println!("  {pictures:>12.1} per second");
    Ok(if warned || !diverged.is_empty() { Ending::Warned } else { Ending::Done })
}
