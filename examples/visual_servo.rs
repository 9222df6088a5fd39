//! Image-based control: a hand-mounted camera finds a cube, and the arm moves the hand above it, in 16 environments
//! with randomly placed cubes.
//!
//! Mask and depth of each image give the position of the cube relative to the camera. Joint encoders and the
//! calibration of the camera give the position of the camera relative to the robot. The true position of the cube is
//! only read at the end, to evaluate the result.
//!
//! ```text
//! cargo run --release --example visual_servo -- --headless --out images
//! cargo run --release --example visual_servo -- --headless --miscalibrated 0.02
//! cargo run --release --example visual_servo -- --headless --blind
//! ```
//!
//! The exit code is 0 if at least 15 of 16 hands are above their cubes at the end, 1 for fewer, and 2 for an error. It
//! is 1 for the second command, whose cameras are miscalibrated, and for the third, whose masks are empty.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::prelude::*;
use kinetoscope::render::PixelIntrinsics;
use kinetoscope::robot::kinematics::TipFrame;
use kinetoscope::scene::pose::{from_xyz_rpy, to_row};
use kinetoscope::sensors::NoiseCfg;
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sim::RigidObjectId;
use launcher::motion::MotionPlayer;
use launcher::panel::{self, CameraChannels};
use launcher::trial::{self, ImageSeries, TrialResults};
use launcher::{Launcher, MainLoop, grip, image_file};
use nalgebra::{Point3, Vector3};
use serde_json::json;
use std::f64::consts::{FRAC_PI_2, PI};
use std::process::ExitCode;

/// Moves hands over cubes by camera images, and counts the successes.
#[derive(Debug, Parser)]
#[command(name = "visual_servo")]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Error of the assumed camera position [m], along both x and y of the image
    #[arg(long, default_value_t = 0.0)]
    miscalibrated: f64,
    /// Ignore the masks, so that no cube is found
    #[arg(long)]
    blind: bool,
}

/// Edge of the cube, and height of the table \[m\].
const EDGE: f64 = 0.06;
const TABLE: f64 = 0.06;
/// Center of the cubes' random positions, and largest offset from it \[m\]; cubes are rotated by at most 45°.
const PLACE: [f64; 2] = [0.48, 0.1];
const SCATTER: [f64; 2] = [0.1, 0.17];

/// Width and height of the camera image \[pixels\], and its field of view \[rad\].
const PIXELS: usize = 160;
const FOVY: f64 = 60.0 * PI / 180.0;
/// Position of the camera on the flange, and its target there \[m\]: past the back of the straight hand, whose tips are
/// at z = 0.21.
const EYE: [f64; 3] = [0.0, 0.12, 0.0];
const LOOKS_AT: [f64; 3] = [0.0, 0.0, 0.4];
/// Standard deviation of the depth noise \[m\].
const DEPTH_NOISE: f64 = 0.002;

/// Height of the flange above the table during the search, and above the top of a cube at the end \[m\]: the tips are
/// then 0.1 m above the cube.
const LOOK_HEIGHT: f64 = 0.6;
const END_HEIGHT: f64 = 0.31;
/// Number of control steps, and the share of the position error that the hand corrects in each.
const CONTROL_STEPS: usize = 12;
const GAIN: f64 = 0.6;
/// Minimum number of cube pixels for a position estimate.
const MIN_PIXELS: usize = 20;

/// Success: largest distance between the axis of the flange and the middle of the cube's top \[m\]. It is the size of a
/// pixel there, 0.33 m away, with a focal length of 80 / tan 30° = 139 pixels.
const MAX_LATERAL_ERROR: f64 = 0.0024;
/// Success: largest error of the height \[m\].
const MAX_HEIGHT_ERROR: f64 = DEPTH_NOISE;

fn main() -> ExitCode {
    trial::run("visual_servo", || run(&trial::parse()))
}

fn run(args: &Args) -> launcher::Result<bool> {
    if !args.miscalibrated.is_finite() {
        return Err(format!("--miscalibrated {}: it must be a distance in meters", args.miscalibrated).into());
    }
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        physics_dt: 0.005,
        arena_space: args.launcher.arena_space.unwrap_or(1.8),
        ..args.launcher.simulation()?
    })?;
    // The tool points down: the pitches of JOINT2, -JOINT3 and -JOINT5 add up to half a turn.
    let down = [("JOINT2", 0.0), ("JOINT3", -1.6), ("JOINT5", -1.54), ("JOINT6", -FRAC_PI_2)];
    let init_qpos = down.map(|(joint, q)| (joint.to_string(), q)).to_vec();
    let robot = sim.add_robot(RobotCfg { init_qpos, ..assets::sr5_with_hand()? })?;
    let cube = add_objects(&mut sim)?;
    let camera = sim.add_sensor("hand_camera", camera_cfg())?;
    let out = args.launcher.out.clone();
    let mut album = ImageSeries::new(&mut sim, "visual_servo", out.clone(), [1.35, -0.75, 0.8], [0.4, 0.08, 0.3])?;
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    args.launcher.write_dump(&sim)?;
    randomize_cubes(&mut sim, cube)?;

    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress =
        MainLoop::new(&args.launcher, ((2.5 + 0.4 * CONTROL_STEPS as f64 + 0.5) / sim.cfg().physics_dt) as u64);
    let eyes = CubeDetector {
        camera,
        cube: if args.blind { i32::MIN } else { mask_id(&sim, "cube")? },
        intrinsics: Intrinsics::Fovy { radians: FOVY }.to_pixels(PIXELS, PIXELS)?,
        flange_from_camera: camera_cfg().extrinsics.parent_from_camera()?
            * Pose::translation(args.miscalibrated, args.miscalibrated, 0.0),
    };
    let tip = TipFrame::of_part("arm").at("ee_link");
    let mut motion = MotionPlayer::new(&mut sim, robot, "arm", tip, &progress)?;
    progress.print_line("To a view of the whole table...");
    let mut commands = vec![above([PLACE[0], PLACE[1], TABLE + LOOK_HEIGHT]); motion.sim.num_envs()];
    motion.move_joint_space(&commands, 2.5)?;
    let mut found = vec![false; commands.len()];
    for look in 0..CONTROL_STEPS {
        if [0, 2, CONTROL_STEPS - 1].contains(&look) {
            album.add(motion.sim)?;
            eyes.write_image(motion.sim, &out, look)?;
        }
        let flanges = trial::poses(&motion.sim.robot(robot).compute_fk(&positions(motion.sim, robot)?, tip, None)?);
        let mut errors = Vec::new();
        for (env, (command, flange)) in commands.iter_mut().zip(&flanges).enumerate() {
            let Some(top) = eyes.top_of_cube(motion.sim, env, flange)? else { continue };
            found[env] = true;
            // The error is added to the command, not to the measured pose of the hand: this also corrects the sag under
            // gravity.
            let wanted = top + Vector3::new(0.0, 0.0, END_HEIGHT);
            let error = wanted.coords - flange.translation.vector;
            command.translation.vector += GAIN * error;
            errors.push(error.norm());
        }
        let largest = errors.iter().fold(0.0, |most: f64, x| most.max(*x));
        let (seen, all) = (errors.len(), commands.len());
        progress.print_line(&format!(
            "Image {:>2}: {seen} of {all} cubes visible, largest position error {:.1} mm",
            look + 1,
            1e3 * largest
        ));
        motion.move_linear(&commands, 0.4)?;
    }
    motion.wait(0.5, |_| ())?;
    album.add(motion.sim)?;
    eyes.write_image(motion.sim, &out, CONTROL_STEPS)?;

    let (steps, planned) = (motion.step(), motion.planned().to_vec());
    let rate = progress.env_steps_per_second(steps, sim.num_envs());
    // For the result only: no command depends on these poses.
    let cubes = trial::poses(&sim.rigid_object(cube).pose());
    let (flanges, diverged) = (trial::poses(&sim.robot(robot).link_pose("ee_link")?), trial::diverged(&sim));
    let mut table = Vec::new();
    for env in 0..sim.num_envs() {
        let top = cubes[env] * Pose::translation(0.0, 0.0, EDGE / 2.0);
        // Middle of the cube's top in the frame of the flange, whose axis is z.
        let place = flanges[env].inverse_transform_point(&Point3::from(top.translation.vector));
        let (beside, height) = (place.x.hypot(place.y), place.z);
        let is_above = beside < MAX_LATERAL_ERROR && (height - END_HEIGHT).abs() < MAX_HEIGHT_ERROR;
        let success = planned[env] && found[env] && is_above && diverged[env].is_none();
        table.push(json!({
            "env": env, "cube": to_row(&cubes[env]), "found": found[env], "planned": planned[env], "beside": beside,
            "height": height, "diverged": diverged[env], "success": success,
        }));
        println!(
            "environment {env:>2}: cube found: {}, way planned: {}, {:.2} mm beside it, {:.2} mm too {}: {}",
            trial::word(found[env]),
            trial::word(planned[env]),
            1e3 * beside,
            1e3 * (height - END_HEIGHT).abs(),
            if height < END_HEIGHT { "low" } else { "high" },
            if is_above { "above" } else { "not above" },
        );
    }
    let count = TrialResults {
        what: "hands are above their cubes",
        setting: ("miscalibrated", args.miscalibrated),
        table,
        steps,
        rate,
        overview: ("visual_servo_all.png", [4.2, -4.8, 3.6], [0.4, 0.1, 0.0]),
    };
    recording.finish(&mut sim)?;
    trial::write_results(&args.launcher, &mut sim, count)
}

/// Flange pose at a place, pointing down; its camera is on the far side of the hand.
fn above(place: [f64; 3]) -> Pose {
    from_xyz_rpy(place, [PI, 0.0, FRAC_PI_2])
}

/// Encoder readings of the arm joints \[rad\].
fn positions(sim: &SimulationManager, robot: RobotId) -> launcher::Result<kinetoscope::ndarray::Array2<f64>> {
    let robot = sim.robot(robot);
    let columns: Vec<usize> = robot.joint_ids("arm")?.iter().map(|joint| joint.0).collect();
    Ok(robot.qpos().select(kinetoscope::ndarray::Axis(1), &columns))
}

/// Mask id of the object called `name`.
fn mask_id(sim: &SimulationManager, name: &str) -> launcher::Result<i32> {
    let id = sim
        .scene()
        .mask_ids()
        .iter()
        .find(|id| id.object == name)
        .ok_or(format!("no entity of the masks is called {name:?}"))?;
    Ok(id.id)
}

fn camera_cfg() -> CameraCfg {
    CameraCfg {
        width: PIXELS,
        height: PIXELS,
        intrinsics: Intrinsics::Fovy { radians: FOVY },
        extrinsics: Extrinsics {
            parent: Some("sr5_with_brainco/ee_link".into()),
            placement: Placement::LookAt { eye: EYE, target: LOOKS_AT, up: [0.0, 1.0, 0.0] },
            ..Default::default()
        },
        channels: Channels { color: true, depth: true, mask: true, normal: true, ..Default::default() },
        noise: [("depth".to_string(), NoiseCfg::white(DEPTH_NOISE))].into(),
        ..Default::default()
    }
}

/// A camera with its assumed calibration.
struct CubeDetector {
    camera: SensorId<Camera>,
    /// Mask id of the cube.
    cube: i32,
    intrinsics: PixelIntrinsics,
    /// Calibration: pose of the optical frame on the flange.
    flange_from_camera: Pose,
}

impl CubeDetector {
    /// Estimated middle of the cube's top in the frame of the environment \[m\], given the assumed pose of the flange.
    /// `None` if too few pixels show the cube.
    ///
    /// The points of the cube are those of its mask, at the measured depth. The points within four standard deviations
    /// of the depth noise below the highest ones belong to the top. A view from above shows few points of the sides.
    fn top_of_cube(&self, sim: &SimulationManager, env: usize, flange: &Pose) -> launcher::Result<Option<Point3<f64>>> {
        let camera = sim.sensor(self.camera)?;
        let (mask, depth) = (camera.mask()?, camera.depth()?);
        let world_from_camera = flange * self.flange_from_camera;
        let PixelIntrinsics { fx, fy, cx, cy } = self.intrinsics;
        let mut points = Vec::new();
        for ((row, v, u), _) in mask.indexed_iter().filter(|((row, _, _), id)| *row == env && **id == self.cube) {
            let z = f64::from(depth[(row, v, u)]);
            if z.is_finite() {
                let (x, y) = ((u as f64 + 0.5 - cx) / fx, (v as f64 + 0.5 - cy) / fy);
                points.push(world_from_camera * Point3::new(x * z, y * z, z));
            }
        }
        if points.len() < MIN_PIXELS {
            return Ok(None);
        }
        // Noise raises single points, so the reference height is the 90th percentile.
        let mut heights: Vec<f64> = points.iter().map(|point| point.z).collect();
        heights.sort_by(|a, b| b.total_cmp(a));
        let high = heights[heights.len() / 10];
        let top: Vec<&Point3<f64>> = points.iter().filter(|point| point.z > high - 4.0 * DEPTH_NOISE).collect();
        let sum: Vector3<f64> = top.iter().map(|point| point.coords).sum();
        Ok(Some(Point3::from(sum / top.len() as f64)))
    }

    /// Writes the camera image of the first environment.
    fn write_image(&self, sim: &SimulationManager, out: &Option<std::path::PathBuf>, look: usize) -> launcher::Result {
        let Some(out) = out else { return Ok(()) };
        let views = CameraChannels::of(sim.sensor(self.camera)?, 0)?;
        image_file::write_png(&out.join(format!("visual_servo_camera_{look}.png")), &panel::grid(&views))
    }
}

/// Adds a cube on a table.
fn add_objects(sim: &mut SimulationManager) -> launcher::Result<RigidObjectId> {
    let [x, y] = PLACE;
    sim.add_rigid_object(RigidObjectCfg {
        uid: "table".into(),
        shape: ObjectShape::Box { size: [0.5, 0.6, TABLE] },
        body_type: BodyType::Static,
        init_pose: Pose::translation(x, y, TABLE / 2.0),
        rgba: [0.72, 0.58, 0.42, 1.0],
        semantic_class: Some("furniture".into()),
        ..Default::default()
    })?;
    Ok(sim.add_rigid_object(RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(EDGE),
        mass: Some(0.2),
        init_pose: Pose::translation(x, y, TABLE + EDGE / 2.0),
        rgba: [0.85, 0.2, 0.15, 1.0],
        ..Default::default()
    })?)
}

/// Moves each cube to a random place on its table.
fn randomize_cubes(sim: &mut SimulationManager, cube: RigidObjectId) -> launcher::Result {
    let place = |[x, y, turn]: [f64; 3]| {
        let place = [PLACE[0] + SCATTER[0] * x, PLACE[1] + SCATTER[1] * y, TABLE + EDGE / 2.0];
        from_xyz_rpy(place, [0.0, 0.0, FRAC_PI_2 / 2.0 * turn])
    };
    let poses: Vec<Pose> = grip::uniform_per_env(sim, "cube").into_iter().map(place).collect();
    sim.rigid_object_mut(cube).write_pose(&trial::pose_rows(&poses), None)?;
    Ok(())
}
