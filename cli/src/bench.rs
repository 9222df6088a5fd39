//! `kinetoscope bench`: simulation and rendering throughput of a model.

use crate::command_status::{CommandStatus, Result};
use crate::model::{Model, ModelArgs, Setup, SpawnArgs};
use crate::progress;
use crate::render::{RenderArgs, images_per_second};
use kinetoscope::prelude::*;
use kinetoscope::sim::OffscreenScene;
use std::time::Instant;

/// Measure steps per second and images per second of a model on this machine
///
/// These rates are of this program alone. To compare with other simulators in one run, see `cargo xtask bench` in the
/// source tree.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    spawn: SpawnArgs,
    /// Number of environments [default: that of a scene file, else 64]
    #[arg(long, alias = "num_envs")]
    num_envs: Option<usize>,
    /// Number of stepping threads [default: that of a scene file, else every core]; images use every core
    #[arg(long)]
    threads: Option<usize>,
    /// Duration of each of the two measurements (steps, images), in seconds
    #[arg(long, default_value_t = 2.0)]
    seconds: f64,
    #[command(flatten)]
    look: RenderArgs,
}

const HELP: &str = "\
Examples:
  kinetoscope bench arm.urdf
  kinetoscope bench humanoid.xml --floating-base --num-envs 1024 --seconds 10
  kinetoscope bench scene.toml
  kinetoscope bench arm.urdf --renderer fast-rt --width 320 --height 240

Exit codes: 0 done; 1 done, with warnings (something was repaired or ignored, an environment diverged); 2 refused, or every
environment diverged.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    if !(args.seconds > 0.0 && args.seconds <= 3600.0) {
        return Err(format!("--seconds {}: must be more than 0 and at most 3600", args.seconds).into());
    }
    let setup = Setup { default_envs: 64, ..Setup::moving(args.num_envs, args.threads, &args.spawn) };
    let mut model = args.model.build(&setup)?;
    let warned = model.print_warnings();
    let (num_envs, dt) = (model.sim.num_envs(), model.sim.cfg().physics_dt);
    let still = OffscreenScene::of_env(&mut model.sim, EnvId(0))?;
    let view = args.look.view(&still)?;
    let mut rasterizer = args.look.rasterizer()?;
    let (start, mut steps) = (Instant::now(), 0u64);
    let step = || loop {
        model.sim.update(8);
        steps += 8;
        read_state(&model);
        let elapsed = start.elapsed().as_secs_f64();
        if elapsed >= args.seconds || model.sim.diverged().len() == num_envs {
            return elapsed;
        }
    };
    let share = || Some(start.elapsed().as_secs_f64() / args.seconds);
    let elapsed = progress::with_progress("steps", share, step);
    if let Some(error) = model.sim.scene().device_failure() {
        return Err(error.into());
    }
    // A diverged environment no longer steps, so its later steps are not counted.
    let diverged = model.sim.diverged();
    let stopped = diverged.len();
    if let Some(first) = diverged.first().filter(|_| stopped == num_envs) {
        return Err(format!(
            "the simulation diverged in all {num_envs} environments, in environment {} in {first}: no step rate can \
             be measured. Contacts that overlap at the start, light links on stiff drives or a long time step are the usual causes",
            first.env.0
        )
        .into());
    }
    let done = diverged.iter().map(|one| one.step).sum::<u64>() + steps * (num_envs - stopped) as u64;
    let env_steps_per_second = done as f64 / elapsed;
    let batch_steps_per_second = steps as f64 / elapsed;
    println!("{num_envs} environments on {} threads, steps of {dt} s", model.sim.threads());
    println!(
        "  {env_steps_per_second:>12.0} environment steps per second, {:.0} x real time in all",
        env_steps_per_second * dt
    );
    println!("  {batch_steps_per_second:>12.0} steps of all environments per second");
    if stopped > 0 {
        println!("  {stopped} of {num_envs} environments diverged and stopped: the rates are too high");
    }
    for one in &diverged {
        eprintln!("warning: environment {} diverged: {one}", one.env.0);
    }
    let images_per_second = images_per_second(&mut rasterizer, still.render_request(&view), args.seconds)?;
    println!("images of {} x {} with color, depth, mask and normals", view.width, view.height);
    println!("  {images_per_second:>12.1} per second");
    Ok(if warned || !diverged.is_empty() { CommandStatus::Warned } else { CommandStatus::Done })
}

/// Reads joint positions, or the state of a scene, as a training program does after each step.
fn read_state(model: &Model) {
    match model.robot {
        Some(robot) => drop(model.sim.robot(robot).qpos()),
        None => drop(model.sim.entities().engine_states()),
    }
}
