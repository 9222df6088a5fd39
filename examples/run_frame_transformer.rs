//! Poses of a quadruped's links relative to its base, and of a user-defined frame on a shank.
//!
//! ```text
//! cargo run --release --example run_frame_transformer -- --headless --steps 500 --out images
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::{ArrayView3, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope::sensors::{FrameTransformer, FrameTransformerCfg, TargetFrameCfg};
use launcher::spawn::SpawnFlags;
use launcher::{Launcher, MainLoop, stage};
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;
use std::process::ExitCode;

/// Shows the frames of a robot, one after the other.
#[derive(Debug, Parser)]
#[command(name = "run_frame_transformer")]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// URDF of a robot with the links of ANYmal
    #[arg(long, default_value = "quadruped/quadruped.urdf")]
    robot: PathBuf,
    #[command(flatten)]
    spawn: SpawnFlags,
    /// Link of the source frame
    #[arg(long, default_value = "base")]
    source: String,
    /// Links of the target frames: a regular expression that matches whole names
    #[arg(long, default_value = ".*")]
    targets: String,
}

/// Steps for which each frame is shown, as in the tutorial.
const FRAME_EVERY: u64 = 50;
/// Position of the foot on the shank \[m\]: the fixed joint of the URDF.
const FOOT: [f64; 3] = [0.08795, 0.01305, -0.33797];

fn main() -> ExitCode {
    launcher::run("run_frame_transformer", || run(&Args::parse()))
}

fn run(args: &Args) -> launcher::Result {
    let legged = SimulationManagerCfg::legged();
    let mut cfg = SimulationManagerCfg {
        physics_dt: legged.physics_dt,
        cone: legged.cone,
        impratio: legged.impratio,
        arena_space: args.launcher.arena_space.unwrap_or(2.0),
        ..args.launcher.simulation()?
    };
    let mut robot = robot_cfg(args)?;
    args.spawn.apply(&mut cfg, &mut robot)?;
    let mut sim = SimulationManager::new(cfg)?;
    let robot = sim.add_robot(robot)?;
    let frames = sim.add_sensor("frames", frames_cfg(args))?;
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    args.launcher.write_dump(&sim)?;
    println!("{}", sim.sensor(frames)?);
    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress = MainLoop::new(&args.launcher, 1000);
    let count = sim.sensor(frames)?.target_frame_names().len();
    let mut step = 0;
    let mut shown = 0;
    while !progress.should_stop(step) {
        let end = progress.end_of_block(step, FRAME_EVERY - step % FRAME_EVERY);
        sim.update((end - step) as u32);
        step = end;
        progress.print_line(&pose_line(&sim, frames, shown % count)?);
        shown += 1;
        progress.advance(step);
    }
    let rate = progress.env_steps_per_second(step, sim.num_envs());
    let table = table(&sim, frames)?;
    let user = max_distance_to_foot(&sim, frames, "LF_FOOT_USER")?;
    let own = max_distance_to_foot(&sim, frames, "LF_FOOT_URDF")?;
    println!("LF_FOOT_URDF is {own:.1e} m from LF_FOOT, LF_FOOT_USER is {user:.6} m");
    println!("{step} steps x {} environments: {rate:.0} environment steps per second", sim.num_envs());
    if let Some(out) = &args.launcher.out {
        launcher::make_folder(out)?;
        let (markers, file) = (sim.scene().markers(), out.join("run_frame_transformer.png"));
        let reach = sim.cfg().env_origins().iter().fold(0.0, |far: f64, x| far.max(x.abs()));
        let eye = [1.3 + 1.6 * reach, 1.5 + 1.6 * reach, 1.0 + reach];
        stage::write(&mut sim, &markers, eye, [0.0, 0.0, 0.35], &file)?;
        println!("Image written to {}", file.display());
    }
    recording.finish(&mut sim)?;
    args.launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "steps": step,
        "threads": sim.threads(),
        "time": sim.time(),
        "source": args.source,
        "source_pos_w": sim.sensor(frames)?.source_pos_w().rows().into_iter().map(|row| row.to_vec()).collect::<Vec<_>>(),
        "frames_of_env_0": table,
        "distance_of_foot_urdf_from_foot": own,
        "distance_of_foot_user_from_foot": user,
        "base_height": sim.robot(robot).root_pose()[(0, 2)],
        "env_steps_per_second": rate,
        "warnings": sim.warnings().counts(),
    }))
}

/// A robot with ANYmal's start posture and drives.
fn robot_cfg(args: &Args) -> launcher::Result<RobotCfg> {
    let urdf = UrdfCfg::single(launcher::user_or_asset(&args.robot)?);
    Ok(RobotCfg { uid: "robot".into(), urdf, ..assets::quadruped()? })
}

/// All links, the tutorial's frame on the left front shank, and the foot as in the URDF. The tutorial's frame is a
/// quarter turn about z from its foot. The foot frame must coincide with the link LF_FOOT.
fn frames_cfg(args: &Args) -> FrameTransformerCfg {
    let quarter = from_xyz_rpy([0.0; 3], [0.0, 0.0, -FRAC_PI_2]);
    let foot = Pose::translation(FOOT[0], FOOT[1], FOOT[2]);
    let on_shank = |name: &str, offset| TargetFrameCfg {
        name: Some(name.into()),
        offset,
        ..TargetFrameCfg::for_bodies("LF_SHANK")
    };
    let targets = vec![
        TargetFrameCfg::for_bodies(&args.targets),
        on_shank("LF_FOOT_USER", quarter * foot),
        on_shank("LF_FOOT_URDF", foot),
    ];
    FrameTransformerCfg { debug_vis: true, ..FrameTransformerCfg::new(&args.source, targets) }
}

/// The pose of one frame in environment 0, as text.
fn pose_line(sim: &SimulationManager, frames: SensorId<FrameTransformer>, target: usize) -> launcher::Result<String> {
    let (frames, time) = (sim.sensor(frames)?, sim.time().first().copied().unwrap_or(0.0));
    let (p, q) = (frames.target_pos_source(), frames.target_quat_source());
    let p = [0, 1, 2].map(|k| format!("{:7.4}", p[(0, target, k)])).join(", ");
    let q = [0, 1, 2, 3].map(|k| format!("{:7.4}", q[(0, target, k)])).join(", ");
    let name = &frames.target_frame_names()[target];
    Ok(format!("t = {time:5.2} s: {name:<34} at ({p}) m, rotated by ({q}), in the source frame"))
}

/// The poses of every frame in environment 0.
fn table(sim: &SimulationManager, frames: SensorId<FrameTransformer>) -> launcher::Result<Vec<Value>> {
    let frames = sim.sensor(frames)?;
    let numbers =
        |values: ArrayView3<'_, f64>, target: usize| values.index_axis(Axis(0), 0).index_axis(Axis(0), target).to_vec();
    let names = frames.target_frame_names().iter().enumerate();
    Ok(names
        .map(|(target, name)| {
            json!({
                "name": name,
                "pos_w": numbers(frames.target_pos_w(), target),
                "quat_w": numbers(frames.target_quat_w(), target),
                "pos_source": numbers(frames.target_pos_source(), target),
                "quat_source": numbers(frames.target_quat_source(), target),
            })
        })
        .collect())
}

/// The largest distance, over environments, between a frame and the link LF_FOOT \[m\].
fn max_distance_to_foot(
    sim: &SimulationManager,
    frames: SensorId<FrameTransformer>,
    name: &str,
) -> launcher::Result<f64> {
    let robot = sim.robot(sim.entities().robot_id("robot")?);
    let (foot, frames) = (robot.link_pose("LF_FOOT")?, sim.sensor(frames)?);
    let target = frames.target_frame_names().iter().position(|n| n == name).ok_or("the frame is gone")?;
    let at = frames.target_pos_w();
    let distance = |env: usize| (0..3).map(|k| (at[(env, target, k)] - foot[(env, k)]).powi(2)).sum::<f64>().sqrt();
    Ok((0..sim.num_envs()).map(distance).fold(0.0, f64::max))
}
