//! An arm grasps a cube, lifts it, holds it and puts it down on a shelf, in 16 environments with cubes of random masses
//! and places.
//!
//! Only contact friction holds the cube, and nothing is written into the state after the start. Every motion is planned
//! with inverse kinematics and played through the drives.
//!
//! ```text
//! cargo run --release --example grasp -- --headless --out images
//! cargo run --release --example grasp -- --headless --friction 0.02
//! ```
//!
//! The exit code is 0 if at least 15 of 16 environments succeed. It is 1 for fewer, as with the second command, whose
//! cubes slip, and 2 for an error.
//!
//! The second command shows that friction holds the cubes. Two fingers push with 9.5 N each, and the thumb pushes
//! against them with the sum. Both sides together hold at most 2 x 19 N x 0.02 = 0.76 N by friction; the lightest cube,
//! of 0.1 kg, weighs 0.98 N. The heaviest, of 0.4 kg, needs a friction coefficient of 3.92 N / 38 N = 0.10. Up to the
//! lift, the hands follow the same paths as in the first command, as the report shows. After the lift, the position of
//! the cube decides whether a path exists.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::prelude::*;
use kinetoscope::robot::kinematics::TipFrame;
use kinetoscope::scene::pose::{from_xyz_rpy, to_row};
use kinetoscope::sim::{FrictionCone, RigidObjectId};
use launcher::motion::MotionPlayer;
use launcher::trial::{self, ImageSeries, TrialResults};
use launcher::{Launcher, MainLoop, grip};
use nalgebra::Vector3;
use serde_json::json;
use std::f64::consts::FRAC_PI_2;
use std::process::ExitCode;

/// Grasps cubes, lifts them by 0.2 m, holds them for 2 s, puts them on a shelf, and counts the successes.
#[derive(Debug, Parser)]
#[command(name = "grasp")]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Sliding friction between hand and cube; between cube and furniture it is 1, or this value if that is larger
    #[arg(long, default_value_t = 1.0)]
    friction: f64,
}

/// Edge of the cube \[m\].
const EDGE: f64 = 0.06;
/// Range of the random masses \[kg\].
const MASSES: [f64; 2] = [0.1, 0.4];
/// Start position of the cube: middle of the tabletop, and largest offset from it along x and y \[m\].
const TABLE: [f64; 3] = [0.6, -0.15, 0.06];
const SCATTER: f64 = 0.05;
/// Largest start rotation of the cube \[rad\].
const MAX_YAW: f64 = 0.6;
/// Middle of the shelf's top \[m\]; the shelf faces the arm.
const SHELF: [f64; 3] = [0.42, 0.42, 0.15];
const SHELF_SIDE: f64 = 0.3;

/// Required lift of the cube \[m\]. The hand moves slightly further, because the cube may slip.
const LIFT: f64 = 0.2;
const LIFT_COMMAND: f64 = 0.22;
/// Required holding time \[s\].
const HOLD: f64 = 2.0;
/// Tolerance of the cube's height when it stands on the shelf \[m\].
const AT_REST_HEIGHT: f64 = 3e-3;
/// Speed limit of a cube at rest \[m/s, rad/s\].
const AT_REST_SPEED: f64 = 0.01;
/// Distance of the cube's middle from the palm's frame above which the hand has released the cube \[m\]. It is 0.114 in
/// the hand, and 0.22 once the hand has risen from the cube.
const RELEASE_DISTANCE: f64 = 0.17;

/// Middle of the grasped cube relative to the palm's frame \[m\]: forward, toward the thumb's side, down. The closing
/// fingers are 0.01 and 0.03 to the side, the thumb 0.02; the table is 5 mm below their tips.
const GRIP: [f64; 3] = [0.0707, -0.02, -0.087];
/// Effort limit of each finger \[N m\]. The fingers close until they meet the cube, with 9.5 N at the tip, which is
/// 0.105 m of joint and follower away. The thumb holds its position against both with up to 2 N m.
const FINGER_EFFORT: f64 = 1.0;
/// Open hand, thumb up.
const OPEN: [(&str, f64); 3] = [("LEFT_HAND_THUMB1", 0.0), ("LEFT_HAND_INDEX", -0.35), ("LEFT_HAND_MIDDLE", -0.35)];
/// Closed hand: the thumb at the cube, the fingers closing until they are blocked.
const CLOSED: [(&str, f64); 3] = [("LEFT_HAND_THUMB1", -0.18), ("LEFT_HAND_INDEX", -1.2), ("LEFT_HAND_MIDDLE", -1.2)];

fn main() -> ExitCode {
    trial::run("grasp", || run(&trial::parse()))
}

fn run(args: &Args) -> launcher::Result<bool> {
    let manipulation = SimulationManagerCfg::manipulation();
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        physics_dt: 0.005,
        cone: FrictionCone::Elliptic,
        impratio: manipulation.impratio,
        friction: [args.friction, 0.005, 0.0001],
        arena_space: args.launcher.arena_space.unwrap_or(1.8),
        ..args.launcher.simulation()?
    })?;
    let robot = sim.add_robot(grip::robot_cfg(&OPEN, FINGER_EFFORT)?)?;
    let cube = add_objects(&mut sim)?;
    let out = args.launcher.out.clone();
    let mut album = ImageSeries::new(&mut sim, "grasp", out, [1.25, -0.65, 0.75], [0.45, 0.05, 0.25])?;
    sim.properties_mut()
        .randomize(&Randomization::new().with(Property::Mass, "cube", RandomizationOp::Set(MASSES)), None)?;
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    args.launcher.write_dump(&sim)?;
    let cubes = randomize_cubes(&mut sim, cube)?;
    let places = |sim: &SimulationManager| trial::poses(&sim.rigid_object(cube).pose());
    let above = |poses: &[Pose], height: f64| trial::moved(poses, |_| [0.0, 0.0, height]);

    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress = MainLoop::new(&args.launcher, (15.6 / sim.cfg().physics_dt) as u64);
    let tip = TipFrame::of_part("arm").at(grip::PALM).with_tcp(grip::palm_from_grip(GRIP));
    let mut motion = MotionPlayer::new(&mut sim, robot, "arm", tip, &progress)?;
    progress.print_line("To the cubes...");
    let grips: Vec<Pose> = cubes.iter().map(grip_pose).collect();
    motion.move_joint_space(&above(&grips, 0.12), 2.0)?;
    motion.move_linear(&grips, 1.5)?;
    album.add(motion.sim)?;
    progress.print_line("Closing the hands...");
    let start: Vec<f64> = places(motion.sim).iter().map(|cube| cube.translation.z).collect();
    motion.move_joints(&CLOSED, 1.0)?;
    album.add(motion.sim)?;
    progress.print_line("Lifting...");
    motion.move_linear(&above(&grips, LIFT_COMMAND), 1.5)?;
    let planned_to_lift = motion.planned().to_vec();
    motion.wait(0.3, |_| ())?;
    album.add(motion.sim)?;
    progress.print_line("Holding...");
    let mut rises = vec![f64::INFINITY; start.len()];
    let mut held = 0;
    motion.wait(HOLD, |sim| {
        held += 1;
        for ((rise, start), cube) in rises.iter_mut().zip(&start).zip(places(sim)) {
            *rise = rise.min(cube.translation.z - start);
        }
    })?;
    album.add(motion.sim)?;
    progress.print_line("To the shelf...");
    // The cube has shifted in the hand, so the plan continues from its measured pose.
    let lifted = above(&grips, LIFT_COMMAND);
    let from_cube = |(cube, grip): (&Pose, &Pose)| place_pose() * without_tilt(cube).inv_mul(grip);
    let down: Vec<Pose> = places(motion.sim).iter().zip(&lifted).map(from_cube).collect();
    motion.move_linear(&above(&down, 0.1), 2.5)?;
    motion.move_linear(&down, 1.5)?;
    motion.wait(0.3, |_| ())?;
    album.add(motion.sim)?;
    progress.print_line("Letting go...");
    motion.move_joints(&OPEN, 1.0)?;
    motion.move_linear(&above(&down, 0.12), 1.0)?;
    motion.wait(1.0, |_| ())?;
    album.add(motion.sim)?;

    let (steps, planned) = (motion.step(), motion.planned().to_vec());
    let rate = progress.env_steps_per_second(steps, sim.num_envs());
    let held = held as f64 * sim.cfg().physics_dt;
    let mut table = Vec::new();
    let (poses, velocities) = (places(&sim), sim.rigid_object(cube).velocity());
    let (palms, diverged) = (trial::poses(&sim.robot(robot).link_pose(grip::PALM)?), trial::diverged(&sim));
    for env in 0..sim.num_envs() {
        let mass = sim.properties().of(EnvId(env))?.get(Property::Mass, "cube")?[0];
        let lifted = held >= HOLD - 1e-9 && rises[env] >= LIFT;
        let on_shelf = shelf_pose().inv_mul(&poses[env]).translation.vector;
        let speed = velocities.row(env).iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let inside = on_shelf.x.abs().max(on_shelf.y.abs()) < SHELF_SIDE / 2.0;
        let rests = inside && (on_shelf.z - EDGE / 2.0).abs() < AT_REST_HEIGHT && speed < AT_REST_SPEED;
        let let_go = (palms[env].translation.vector - poses[env].translation.vector).norm() > RELEASE_DISTANCE;
        let success = planned[env] && lifted && rests && let_go && diverged[env].is_none();
        table.push(json!({
            "env": env, "mass": mass, "start": to_row(&cubes[env]), "planned": planned[env],
            "planned_to_lift": planned_to_lift[env],
            "lowest_rise": Some(rises[env]).filter(|rise| rise.is_finite()), "end": to_row(&poses[env]),
            "speed": speed, "lifted": lifted, "on_shelf": rests, "let_go": let_go,
            "diverged": diverged[env], "success": success,
        }));
        println!(
            "environment {env:>2}: {mass:.3} kg, way planned: {}, held at {:+.4} m: {}, on the shelf: {}, let go: {}",
            trial::word(planned[env]),
            rises[env],
            trial::word(lifted),
            trial::word(rests),
            trial::word(let_go),
        );
    }
    let count = TrialResults {
        what: "cubes were lifted, held and put down",
        setting: ("friction", args.friction),
        table,
        steps,
        rate,
        overview: ("grasp_all.png", [4.2, -4.8, 3.6], [0.4, 0.1, 0.0]),
    };
    recording.finish(&mut sim)?;
    trial::write_results(&args.launcher, &mut sim, count)
}

/// Grip frame at the center of a cube, parallel to its faces: x points away from the arm, as far as quarter turns
/// allow.
fn grip_pose(cube: &Pose) -> Pose {
    let away = cube.translation.y.atan2(cube.translation.x);
    let yaw = without_tilt(cube).rotation.euler_angles().2;
    let quarter = ((away - yaw) / FRAC_PI_2).round() * FRAC_PI_2;
    from_xyz_rpy(cube.translation.vector.into(), [0.0, 0.0, yaw + quarter])
}

/// The pose with its tilt removed; only the yaw remains.
fn without_tilt(pose: &Pose) -> Pose {
    let ahead = pose.rotation * Vector3::x();
    from_xyz_rpy(pose.translation.vector.into(), [0.0, 0.0, ahead.y.atan2(ahead.x)])
}

fn shelf_pose() -> Pose {
    from_xyz_rpy(SHELF, [0.0, 0.0, SHELF[1].atan2(SHELF[0])])
}

/// Pose of the cube on the shelf, 1 mm above it.
fn place_pose() -> Pose {
    shelf_pose() * Pose::translation(0.0, 0.0, EDGE / 2.0 + 0.001)
}

/// Adds the cube, a table and a shelf of boards.
fn add_objects(sim: &mut SimulationManager) -> launcher::Result<RigidObjectId> {
    let mut board = |uid: &str, size: [f64; 3], pose: Pose| {
        sim.add_rigid_object(RigidObjectCfg {
            uid: uid.into(),
            shape: ObjectShape::Box { size },
            body_type: BodyType::Static,
            // MuJoCo uses the larger friction of the two surfaces.
            friction: Some(SimulationManagerCfg::default().friction),
            init_pose: pose,
            rgba: [0.72, 0.58, 0.42, 1.0],
            semantic_class: Some("furniture".into()),
            ..Default::default()
        })
    };
    let [x, y, z] = TABLE;
    board("table", [0.4, 0.5, z], Pose::translation(x, y, z / 2.0))?;
    let (shelf, thick) = (shelf_pose(), 0.02);
    board("shelf", [SHELF_SIDE, SHELF_SIDE, thick], shelf * Pose::translation(0.0, 0.0, -thick / 2.0))?;
    for (uid, side) in [("shelf_left", 1.0), ("shelf_right", -1.0)] {
        let height = SHELF[2] - thick;
        let y = side * (SHELF_SIDE - thick) / 2.0;
        board(uid, [SHELF_SIDE, thick, height], shelf * Pose::translation(0.0, y, -thick - height / 2.0))?;
    }
    Ok(sim.add_rigid_object(RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(EDGE),
        mass: Some(0.2),
        init_pose: Pose::translation(x, y, z + EDGE / 2.0),
        rgba: [0.85, 0.2, 0.15, 1.0],
        ..Default::default()
    })?)
}

/// Moves each cube to a random place on its table. Returns the poses.
fn randomize_cubes(sim: &mut SimulationManager, cube: RigidObjectId) -> launcher::Result<Vec<Pose>> {
    let place = |[x, y, turn]: [f64; 3]| {
        let place = [TABLE[0] + SCATTER * x, TABLE[1] + SCATTER * y, TABLE[2] + EDGE / 2.0];
        from_xyz_rpy(place, [0.0, 0.0, MAX_YAW * turn])
    };
    let poses: Vec<Pose> = grip::uniform_per_env(sim, "cube").into_iter().map(place).collect();
    sim.rigid_object_mut(cube).write_pose(&trial::pose_rows(&poses), None)?;
    Ok(poses)
}
