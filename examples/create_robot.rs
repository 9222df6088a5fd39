//! An arm and a hand from two URDF files, or from one URDF or MJCF file, that repeat a cycle of four phases in N
//! environments.
//!
//! ```text
//! cargo run --release --example create_robot -- --headless --num-envs 4 --steps 4000
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use launcher::arm::ArmWithHand;
use launcher::{Launcher, MainLoop, Renderer};
use serde_json::{Value, json};
use std::process::ExitCode;

/// Drives an arm with a hand through the phases arm position 1, arm position 2, close hand, open hand.
#[derive(Debug, Parser)]
#[command(name = "create_robot")]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    #[command(flatten)]
    robot: ArmWithHand,
    /// Close the hand at the upper joint limits and open it at the lower ones, for hands whose fingers close that way
    #[arg(long, alias = "swap_hand")]
    swap_hand: bool,
}

/// Steps of one phase.
const PHASE: u64 = 1000;
/// Environment steps between two checks of Ctrl+C and the progress bar: about a tenth of a second.
const BLOCK: u64 = 4096;

fn main() -> ExitCode {
    launcher::run("create_robot", || run(&Args::parse()))
}

fn run(args: &Args) -> launcher::Result {
    if args.launcher.renderer != Renderer::Auto {
        println!("This example has no camera: --renderer has no effect (create_sensor has a camera).");
    }
    println!("Creating simulation...");
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        physics_dt: 1.0 / 100.0,
        arena_space: args.launcher.arena_space.unwrap_or(3.0),
        ..args.launcher.simulation_for_any_renderer()
    })?;

    println!("Loading robot...");
    let robot = sim.add_robot(args.robot.cfg()?)?;
    let dof = sim.robot(robot).dof();
    println!("Robot created successfully with {dof} joints");
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    args.launcher.write_dump(&sim)?;

    println!("Starting simulation...");
    println!("Robot will move through different poses");
    println!("Press Ctrl+C to stop");
    let phases = phases(&sim, robot, args.swap_hand)?;
    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress = MainLoop::new(&args.launcher, PHASE * phases.len() as u64);
    let mut finished = Vec::new();
    let mut step = 0;
    while !progress.should_stop(step) {
        let phase = &phases[(step / PHASE) as usize % phases.len()];
        if step % PHASE == 0 {
            progress.print_line(phase.message);
            let targets = phase.targets(sim.num_envs());
            sim.robot_mut(robot).set_qpos_target(&targets, Some(&phase.joints), None)?;
        }
        let block = (BLOCK / sim.num_envs() as u64).clamp(1, PHASE - step % PHASE);
        let end = progress.end_of_block(step, block);
        sim.update((end - step) as u32);
        step = end;
        progress.advance(step);
        if step % PHASE == 0 || progress.should_stop(step) {
            finished.push(phase.report(&sim, robot, step));
        }
    }
    let rate = progress.env_steps_per_second(step, sim.num_envs());
    print_table(&finished, &sim, step, rate);
    for diverged in sim.diverged() {
        eprintln!("environment {} diverged: {diverged}", diverged.env.0);
    }
    recording.finish(&mut sim)?;
    args.launcher.screenshot(&mut sim, "create_robot.png")?;
    args.launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "dof": dof,
        "joint_names": sim.robot(robot).joint_names(),
        "link_names": sim.robot(robot).link_names(),
        "total_mass": sim.robot(robot).total_mass(),
        "env_steps_per_second": rate,
        "steps": step,
        "threads": sim.threads(),
        "buffer_growths": sim.warnings().buffer_growths(),
        "warnings": sim.warnings().counts(),
        "phases": finished,
    }))?;
    println!("Stopping simulation...");
    drop(sim);
    println!("Cleaning up...");
    Ok(())
}

/// One quarter of the cycle: joints and their targets.
struct Phase {
    name: &'static str,
    message: &'static str,
    joints: Vec<JointIndex>,
    target: Vec<f64>,
}

fn phases(sim: &SimulationManager, robot: RobotId, swap_hand: bool) -> launcher::Result<Vec<Phase>> {
    let view = sim.robot(robot);
    let (arm, hand) = (view.joint_ids("arm")?, view.joint_ids("hand")?);
    // The tutorial gives positions of six joints; the other joints of a longer arm stay at zero.
    let arm_target =
        |first: &[f64]| arm.iter().enumerate().map(|(i, _)| first.get(i).copied().unwrap_or(0.0)).collect();
    let limits = view.qpos_limits();
    let hand_target = |end: usize| -> Vec<f64> {
        let targets = view.qpos_target();
        hand.iter()
            .map(|joint| Some(limits[(0, joint.0, end)]).filter(|l| l.is_finite()).unwrap_or(targets[(0, joint.0)]))
            .collect()
    };
    let (close, open) = if swap_hand { (1, 0) } else { (0, 1) };
    let phase = |name, message, joints: &[JointIndex], target| Phase { name, message, joints: joints.to_vec(), target };
    Ok(vec![
        phase("arm position 1", "Moving to arm position 1", &arm, arm_target(&[0.0, -0.5, 0.5, -1.0, 0.5, 0.0])),
        phase("arm position 2", "Moving to arm position 2", &arm, arm_target(&[0.5, 0.0, -0.5, 0.5, -0.5, 0.5])),
        phase("close hand", "Closing hand", &hand, hand_target(close)),
        phase("open hand", "Opening hand", &hand, hand_target(open)),
    ])
}

impl Phase {
    fn targets(&self, num_envs: usize) -> Array2<f64> {
        Array2::from_shape_fn((num_envs, self.target.len()), |(_, j)| self.target[j])
    }

    fn report(&self, sim: &SimulationManager, robot: RobotId, end_step: u64) -> Value {
        let view = sim.robot(robot);
        let columns: Vec<usize> = self.joints.iter().map(|j| j.0).collect();
        let (qpos, qvel) = (view.qpos().select(Axis(1), &columns), view.qvel().select(Axis(1), &columns));
        let target = view.qpos_target().select(Axis(1), &columns);
        let largest = |values: &Array2<f64>| values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        json!({
            "name": self.name,
            "end_step": end_step,
            "joint_names": columns.iter().map(|&c| &view.joint_names()[c]).collect::<Vec<_>>(),
            "target": target.row(0).to_vec(),
            "qpos": qpos.rows().into_iter().map(|r| r.to_vec()).collect::<Vec<_>>(),
            "qvel_max": largest(&qvel),
            "max_error": largest(&(&target - &qpos)),
        })
    }
}

fn print_table(phases: &[Value], sim: &SimulationManager, steps: u64, rate: f64) {
    println!(
        "\n{:<16} {:>9} {:>8} {:>16} {:>18}",
        "phase", "end step", "joints", "max error [mrad]", "max speed [mrad/s]"
    );
    for phase in phases {
        println!(
            "{:<16} {:>9} {:>8} {:>16.3} {:>18.4}",
            phase["name"].as_str().unwrap_or_default(),
            phase["end_step"],
            phase["joint_names"].as_array().map_or(0, Vec::len),
            1e3 * phase["max_error"].as_f64().unwrap_or(f64::NAN),
            1e3 * phase["qvel_max"].as_f64().unwrap_or(f64::NAN),
        );
    }
    println!(
        "\n{steps} steps x {} environments on {} threads with MuJoCo {}: {rate:.0} environment steps per second\n",
        sim.num_envs(),
        sim.threads(),
        kinetoscope::mujoco::version_string(),
    );
}
