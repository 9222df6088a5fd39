//! An arm hooks its fingers behind the handle of a drawer and pulls it open, in 16 environments with randomly placed
//! cabinets.
//!
//! The drawer is passive: its slide has only damping and dry friction, and only the fingers move it. Cabinets stand
//! free on the floor; nothing is written into the state after the start.
//!
//! ```text
//! cargo run --release --example open_drawer -- --headless --out images
//! cargo run --release --example open_drawer -- --headless --slide-friction 500
//! ```
//!
//! The exit code is 0 if at least 15 of 16 drawers are open. It is 1 for fewer, as with the second command, whose
//! drawers are stuck, and 2 for an error.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::prelude::*;
use kinetoscope::robot::kinematics::TipFrame;
use kinetoscope::scene::pose::{from_xyz_rpy, to_row};
use kinetoscope::sim::ArticulationId;
use launcher::motion::MotionPlayer;
use launcher::trial::{self, ImageSeries, TrialResults};
use launcher::{Launcher, MainLoop, grip, user_or_asset};
use nalgebra::Vector3;
use serde_json::json;
use std::f64::consts::PI;
use std::path::Path;
use std::process::ExitCode;

/// Opens drawers by 0.15 m and counts the successes.
#[derive(Debug, Parser)]
#[command(name = "open_drawer")]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Dry friction of the drawer's slide [N]; must be above 0
    #[arg(long, alias = "slide_friction", default_value_t = 2.0)]
    slide_friction: f64,
}

/// Position of the cabinet, its front facing the arm: middle of the random range, and largest offset from it \[m\].
const CABINET_CENTER: [f64; 2] = [0.98, 0.0];
const SCATTER: [f64; 2] = [0.03, 0.08];
/// Largest rotation of the cabinet \[rad\].
const MAX_YAW: f64 = 0.2;
/// Handle in the frame of the drawer \[m\].
const HANDLE: [f64; 3] = [0.073, 0.0, 0.0];

/// Required opening of the drawers \[m\]. The hand moves further, because the handle has some play in it.
const OPEN_BY: f64 = 0.15;
const PULL: f64 = 0.2;
/// Speed limit of a drawer at rest \[m/s\].
const AT_REST: f64 = 0.01;
/// Largest accepted displacement of the cabinet \[m\].
const MAX_CABINET_SHIFT: f64 = 0.02;

/// Handle in the hand, forward of the palm's frame and below it \[m\]: the bent fingers are 12 mm behind the handle.
const GRIP: [f64; 3] = [0.09, 0.0, -0.08];
/// Effort limit of the fingers \[N m\]: 19 N at each tip.
const FINGER_EFFORT: f64 = 2.0;
/// Bent fingers that fit between handle and drawer.
const BENT: [(&str, f64); 5] = [
    ("LEFT_HAND_THUMB1", 0.0),
    ("LEFT_HAND_INDEX", -0.6),
    ("LEFT_HAND_MIDDLE", -0.6),
    ("LEFT_HAND_RING", -0.6),
    ("LEFT_HAND_PINKY", -0.6),
];
/// Fingers and thumb around the handle.
const HOOKED: [(&str, f64); 5] = [
    ("LEFT_HAND_THUMB1", -0.5),
    ("LEFT_HAND_INDEX", -1.1),
    ("LEFT_HAND_MIDDLE", -1.1),
    ("LEFT_HAND_RING", -1.1),
    ("LEFT_HAND_PINKY", -1.1),
];

fn main() -> ExitCode {
    trial::run("open_drawer", || run(&trial::parse()))
}

fn run(args: &Args) -> launcher::Result<bool> {
    let manipulation = SimulationManagerCfg::manipulation();
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        physics_dt: 0.005,
        cone: manipulation.cone,
        impratio: manipulation.impratio,
        arena_space: args.launcher.arena_space.unwrap_or(2.2),
        ..args.launcher.simulation()?
    })?;
    let robot = sim.add_robot(grip::robot_cfg(&BENT, FINGER_EFFORT)?)?;
    let [x, y] = CABINET_CENTER;
    let cabinet = sim.add_articulation(ArticulationCfg {
        uid: "cabinet".into(),
        urdf: UrdfCfg::single(user_or_asset(Path::new("cabinet/cabinet.urdf"))?),
        fix_base: false,
        init_pose: from_xyz_rpy([x, y, 0.0], [0.0, 0.0, PI]),
        ..Default::default()
    })?;
    let out = args.launcher.out.clone();
    let mut album = ImageSeries::new(&mut sim, "open_drawer", out, [0.3, -1.2, 0.75], [0.55, 0.0, 0.2])?;
    let friction = RandomizationOp::Set([args.slide_friction; 2]);
    sim.properties_mut()
        .randomize(&Randomization::new().with(Property::DryFriction, "cabinet/drawer_slide", friction), None)?;
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    args.launcher.write_dump(&sim)?;
    let stands = randomize_cabinets(&mut sim, cabinet)?;

    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress = MainLoop::new(&args.launcher, (10.0 / sim.cfg().physics_dt) as u64);
    let tip = TipFrame::of_part("arm").at(grip::PALM).with_tcp(grip::palm_from_grip(GRIP));
    let handles: Vec<Pose> = trial::poses(&sim.articulation(cabinet).link_pose("drawer")?)
        .iter()
        // The grip frame faces the drawer, so it is turned by half a turn from the frame of the handle.
        .map(|drawer| drawer * from_xyz_rpy(HANDLE, [0.0, 0.0, PI]))
        .collect();
    let above = |poses: &[Pose], height: f64| trial::moved(poses, |_| [0.0, 0.0, height]);
    let pulled = trial::moved(&handles, |handle| (handle.rotation * Vector3::new(-PULL, 0.0, 0.0)).into());
    let mut motion = MotionPlayer::new(&mut sim, robot, "arm", tip, &progress)?;
    progress.print_line("To the handles...");
    motion.move_joint_space(&above(&handles, 0.1), 2.0)?;
    motion.move_linear(&handles, 1.5)?;
    album.add(motion.sim)?;
    progress.print_line("Closing the hands...");
    motion.move_joints(&HOOKED, 1.0)?;
    album.add(motion.sim)?;
    progress.print_line("Pulling...");
    motion.move_linear(&pulled, 2.5)?;
    motion.wait(0.5, |_| ())?;
    album.add(motion.sim)?;
    progress.print_line("Letting go...");
    motion.move_joints(&BENT, 0.5)?;
    motion.move_linear(&above(&pulled, 0.1), 1.0)?;
    motion.wait(1.0, |_| ())?;
    album.add(motion.sim)?;

    let (steps, planned) = (motion.step(), motion.planned().to_vec());
    let rate = progress.env_steps_per_second(steps, sim.num_envs());
    let view = sim.articulation(cabinet);
    let (open, speed, ends) = (view.qpos(), view.qvel(), trial::poses(&view.root_pose()));
    let diverged = trial::diverged(&sim);
    let mut table = Vec::new();
    for env in 0..sim.num_envs() {
        let (open, speed) = (open[(env, 0)], speed[(env, 0)].abs());
        let shift = (ends[env].translation.vector - stands[env].translation.vector).norm();
        let (is_open, stays) = (open >= OPEN_BY && speed < AT_REST, shift < MAX_CABINET_SHIFT);
        let success = planned[env] && is_open && stays && diverged[env].is_none();
        table.push(json!({
            "env": env, "cabinet": to_row(&stands[env]), "planned": planned[env], "open": open, "speed": speed,
            "cabinet_shift": shift, "diverged": diverged[env], "success": success,
        }));
        println!(
            "environment {env:>2}: way planned: {}, open by {open:.4} m: {}, the cabinet moved by {:.1} mm: {}",
            trial::word(planned[env]),
            trial::word(is_open),
            1e3 * shift,
            if stays { "it stood" } else { "too far" },
        );
    }
    let count = TrialResults {
        what: "drawers were opened",
        setting: ("slide_friction", args.slide_friction),
        table,
        steps,
        rate,
        overview: ("open_drawer_all.png", [4.2, -5.2, 3.6], [0.4, 0.0, 0.0]),
    };
    recording.finish(&mut sim)?;
    trial::write_results(&args.launcher, &mut sim, count)
}

/// Moves each cabinet to a random place on the floor. Returns the poses.
fn randomize_cabinets(sim: &mut SimulationManager, cabinet: ArticulationId) -> launcher::Result<Vec<Pose>> {
    let place = |[x, y, turn]: [f64; 3]| {
        let place = [CABINET_CENTER[0] + SCATTER[0] * x, CABINET_CENTER[1] + SCATTER[1] * y, 0.0];
        from_xyz_rpy(place, [0.0, 0.0, PI + MAX_YAW * turn])
    };
    let poses: Vec<Pose> = grip::uniform_per_env(sim, "cabinet").into_iter().map(place).collect();
    sim.articulation_mut(cabinet).write_root_pose(&trial::pose_rows(&poses), None)?;
    Ok(poses)
}
