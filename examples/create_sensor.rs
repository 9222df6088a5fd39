//! A camera that looks at an arm, a hand and a falling cube: color, depth, mask and normals of N environments.
//!
//! ```text
//! cargo run --release --example create_sensor -- --headless --num-envs 4 --steps 2004 --out images
//! cargo run --release --example create_sensor -- --headless --steps 1 --attach-sensor --out images
//! cargo run --release --example create_sensor -- --headless --steps 1 --renderer rt --out images
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::{Parser, ValueEnum};
use kinetoscope::ndarray::{ArrayView1, Axis};
use kinetoscope::prelude::*;
use kinetoscope::render::RenderProgress;
use kinetoscope::scene::pose::{from_wxyz, from_xyz_rpy};
use kinetoscope::sensors::camera::{Camera, CameraConvention, SegmentLevel, Segmentation, SegmentationCfg};
use launcher::arm::ArmWithHand;
use launcher::panel::{self, CameraChannels, grid, tile};
use launcher::views::SensorWindow;
use launcher::{Launcher, MainLoop, PathFlags, Renderer, StopRequest, image_file, render_progress};
use nalgebra::UnitQuaternion;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Moves an arm between two poses and records images of it.
#[derive(Debug, Parser)]
#[command(name = "create_sensor")]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    #[command(flatten)]
    robot: ArmWithHand,
    /// Attach the camera to a link of the robot instead of placing it above the cube
    #[arg(long, alias = "attach_sensor")]
    attach_sensor: bool,
    /// Parent link of the camera, as uid/link [default: the link of the arm that carries the hand]
    #[arg(long, alias = "attach_link", requires = "attach_sensor")]
    attach_link: Option<String>,
    /// Width of the images, in pixels
    #[arg(long, default_value_t = 640)]
    width: usize,
    /// Height of the images, in pixels
    #[arg(long, default_value_t = 480)]
    height: usize,
    /// Segmentation level of the mask image: every link, or every robot and object
    #[arg(long, value_enum, default_value_t = MaskLevel::Link)]
    mask: MaskLevel,
    /// Write images even if a window shows them; without a window they are always written
    #[arg(long)]
    save: bool,
    /// Write images even if a window shows them, and depth, mask and normals of all environments as .npy, shape (N, H,
    /// W, ...)
    #[arg(long)]
    raw: bool,
    /// Same as --renderer rt; without effect beside --renderer hybrid, fast-rt or rt
    #[arg(long, alias = "enable_rt")]
    enable_rt: bool,
    #[command(flatten)]
    paths: PathFlags,
}

/// Unit with its own id in the mask image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MaskLevel {
    /// Each link
    Link,
    /// Each robot and each object
    Instance,
}

/// The tutorial sets its two targets at multiples of these steps.
const POSITION_1_EVERY: u64 = 1001;
const POSITION_2_EVERY: u64 = 2003;

fn main() -> ExitCode {
    launcher::run("create_sensor", || run(&Args::parse()))
}

fn run(args: &Args) -> launcher::Result {
    let renderer = match (args.enable_rt, args.launcher.renderer) {
        (true, Renderer::Raster) => {
            return Err(
                "--enable-rt traces rays: use it with --renderer rt, fast-rt or hybrid, or without --renderer".into()
            );
        }
        (true, Renderer::Auto) => Renderer::Rt,
        (_, renderer) => renderer,
    };
    let renderer = renderer.for_cameras(args.paths)?;
    println!("Creating simulation...");
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        physics_dt: 1.0 / 100.0,
        arena_space: args.launcher.arena_space.unwrap_or(3.0),
        ..args.launcher.simulation_for_any_renderer()
    })?;

    println!("Loading robot...");
    let robot = sim.add_robot(args.robot.cfg()?)?;
    println!("Robot created successfully with {} joints", sim.robot(robot).dof());
    sim.add_rigid_object(RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(0.05),
        mass: Some(1.0),
        friction: Some([0.95, 0.005, 0.0001]),
        init_pose: Pose::translation(1.2, -0.2, 0.1),
        rgba: [0.85, 0.2, 0.15, 1.0],
        ..Default::default()
    })?;
    let camera = sim.add_sensor("camera", CameraCfg { renderer, ..camera_cfg(args, &sim, robot) })?;
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    args.launcher.write_dump(&sim)?;

    println!("Starting simulation...");
    println!("Robot will move through different poses");
    println!("Press Ctrl+C to stop");
    let arm = sim.robot(robot).joint_ids("arm")?;
    let position = |wrist: f64| {
        // The tutorial gives positions of six joints; the other joints of a longer arm stay at zero.
        let mut target = vec![0.0; arm.len()];
        for (to, from) in target.iter_mut().zip([0.0, 0.5, -1.5, wrist, -0.5, 0.0]) {
            *to = from;
        }
        target
    };
    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress = MainLoop::new(&args.launcher, POSITION_2_EVERY);
    let size = panel::tiled_size([args.width, args.height], sim.num_envs());
    let window = args.launcher.open_sensor_window("Sensor Views (Color / Depth / Mask / Normals)", size);
    let saved = args.save || args.raw || window.is_none();
    let mut album = ImageWriter {
        out: saved.then(|| args.launcher.out_folder(true)).transpose()?,
        raw: args.raw,
        instances: (args.mask == MaskLevel::Instance)
            .then(|| sim.scene().segmentation(&SegmentationCfg::default()))
            .transpose()?,
        window,
        end: progress.stop_request(),
        files: Vec::new(),
        drawing: Duration::ZERO,
        images: 0,
    };
    let mut step = 0;
    'steps: while !progress.should_stop(step) {
        for (every, wrist, message) in
            [(POSITION_1_EVERY, 0.3, "Moving to arm position 1"), (POSITION_2_EVERY, -0.3, "Moving to arm position 2")]
        {
            if step % every == 0 {
                progress.print_line(message);
                let target = position(wrist);
                sim.robot_mut(robot).set_qpos_target(
                    ArrayView1::from(&target).insert_axis(Axis(0)),
                    Some(&arm),
                    None,
                )?;
                if !album.add(sim.sensor(camera)?, step)? {
                    break 'steps;
                }
            }
        }
        let next = [POSITION_1_EVERY, POSITION_2_EVERY].map(|every| (step / every + 1) * every);
        let end = progress.end_of_block(step, next[0].min(next[1]) - step);
        sim.update((end - step) as u32);
        step = end;
        progress.advance(step);
    }
    let rate = progress.env_steps_per_second(step, sim.num_envs());
    let images_per_second = album.images as f64 / album.drawing.as_secs_f64().max(1e-9);
    print_table(&album, &sim);
    println!(
        "\n{} images of {} x {} (color, depth, mask, normals): {images_per_second:.3} per second on {} threads",
        album.images,
        args.width,
        args.height,
        sim.cfg().num_threads()
    );
    println!(
        "{step} steps x {} environments, rendering included: {rate:.0} environment steps per second\n",
        sim.num_envs()
    );
    recording.finish(&mut sim)?;
    args.launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "steps": step,
        "threads": sim.threads(),
        "width": args.width,
        "height": args.height,
        "ids": sim.scene().mask_ids().iter().map(|id| json!({
            "id": id.id, "object": id.object, "link": id.link, "class": id.class,
        })).collect::<Vec<_>>(),
        "images": album.files,
        "renderer": renderer,
        "images_per_second": images_per_second,
        "env_steps_per_second": rate,
        "warnings": sim.warnings().counts(),
    }))?;
    println!("Stopping simulation...");
    drop(sim);
    println!("Cleaning up...");
    Ok(())
}

/// The tutorial's camera: above the cube, looking straight down, or on the arm's tip.
fn camera_cfg(args: &Args, sim: &SimulationManager, robot: RobotId) -> CameraCfg {
    let (fx, fy) = (600.0 * args.width as f64 / 640.0, 600.0 * args.height as f64 / 480.0);
    let extrinsics = if args.attach_sensor {
        let tip = || launcher::arm::tip(sim.robot(robot));
        Extrinsics {
            parent: Some(args.attach_link.clone().unwrap_or_else(tip)),
            placement: Placement::Pose { pos: [0.09, 0.05, 0.04], rotation: tutorial_rotation() },
            // The tutorial's simulator reads these numbers in OpenGL's axes for a camera with a parent.
            convention: CameraConvention::OpenGl,
        }
    } else {
        // Half a turn about y points the optical axis down.
        let rotation = from_wxyz([0.0, 0.0, 1.0, 0.0]);
        Extrinsics {
            parent: None,
            placement: Placement::Pose { pos: [1.2, -0.2, 1.5], rotation },
            ..Default::default()
        }
    };
    CameraCfg {
        width: args.width,
        height: args.height,
        intrinsics: Intrinsics::Pixels { fx, fy, cx: args.width as f64 / 2.0, cy: args.height as f64 / 2.0 },
        near: 0.01,
        far: 10.0,
        extrinsics,
        channels: Channels { color: true, depth: true, mask: true, normal: true, ..Default::default() },
        ..Default::default()
    }
}

/// Rotation of the Euler angles xyz (-35, 135, 0) degrees about fixed axes, in SciPy's convention.
///
/// The tutorial writes the quaternion of these angles as x, y, z, w into a field that is read as w, x, y, z. With the
/// field's order the camera looks along (-0.58, -0.41, 0.71) of the link; with the intended order, along (-0.58, -0.57,
/// 0.58). Both directions show the workspace in front of the hand. This function returns the intended one, which
/// matches the angles.
fn tutorial_rotation() -> UnitQuaternion<f64> {
    from_xyz_rpy([0.0; 3], [(-35f64).to_radians(), 135f64.to_radians(), 0.0]).rotation
}

/// Recorded images, their destination and their rendering times.
struct ImageWriter {
    /// Folder of the files; `None` if images are only shown.
    out: Option<PathBuf>,
    raw: bool,
    /// Maps link ids of the mask to instance ids, for `--mask instance`.
    instances: Option<Segmentation>,
    window: Option<SensorWindow>,
    end: StopRequest,
    files: Vec<Value>,
    drawing: Duration,
    images: u64,
}

impl ImageWriter {
    /// Renders the current camera images, shows them and writes them to files, once for each step. Returns false if the
    /// user ended the example meanwhile.
    fn add(&mut self, camera: &Camera, step: u64) -> launcher::Result<bool> {
        // Two targets at step 0 share one image.
        if self.files.iter().any(|f| f["step"] == step) {
            return Ok(true);
        }
        let start = Instant::now();
        let on_update = |progress: &RenderProgress| {
            if self.end.is_set() {
                progress.cancel();
            }
            if let (Some(window), Some(share)) = (&self.window, progress.fraction()) {
                window.announce(&format!("Ray tracing: {:.0} %", 100.0 * share));
            }
        };
        match render_progress::render_with_progress(camera.progress(), None, on_update, || camera.images().map(|_| ()))
        {
            Err(_) if self.end.is_set() => return Ok(false),
            drawn => drawn?,
        }
        self.drawing += start.elapsed();
        self.images += camera.env_ids().len() as u64;
        let name = self.out.is_some().then(|| format!("sensor_views_{step}.png"));
        let mut panels = Vec::new();
        for (row, &env) in camera.env_ids().iter().enumerate() {
            let views = CameraChannels::of(camera, row)?;
            panels.push(match &self.instances {
                None => grid(&views),
                Some(of) => {
                    let mask: Vec<i32> = of
                        .segment(SegmentLevel::Instance, camera.mask()?)
                        .index_axis(Axis(0), row)
                        .iter()
                        .copied()
                        .collect();
                    grid(&CameraChannels { mask: &mask, ..views })
                }
            });
            let depth = image_file::finite_range(views.depth.iter().copied());
            let mut ids: Vec<i32> = views.mask.to_vec();
            ids.sort_unstable();
            ids.dedup();
            self.files.push(json!({
                "file": name,
                "step": step,
                "time": camera.stamps()[row],
                "env": env,
                "depth_min": depth.map(|[min, _]| min),
                "depth_max": depth.map(|[_, max]| max),
                "ids": ids,
            }));
        }
        let image = tile(&panels);
        if let (Some(out), Some(name)) = (&self.out, &name) {
            image_file::write_png(&out.join(name), &image)?;
            if self.raw {
                let file = |channel: &str| out.join(format!("{channel}_{step}.npy"));
                image_file::write_npy(&file("depth"), &camera.depth()?)?;
                image_file::write_npy(&file("mask"), &camera.mask()?)?;
                image_file::write_npy(&file("normal"), &camera.normal()?)?;
            }
        }
        if let Some(window) = &mut self.window {
            window.show(&image);
        }
        Ok(true)
    }
}

fn print_table(album: &ImageWriter, sim: &SimulationManager) {
    println!("\n{:<28} {:>6} {:>5} {:>18}  objects", "image", "step", "env", "depth [m]");
    for file in &album.files {
        let number = |key: &str| file[key].as_f64().unwrap_or(f64::NAN);
        let ids: Vec<i64> = file["ids"].as_array().into_iter().flatten().filter_map(Value::as_i64).collect();
        let mut objects: Vec<&str> = sim
            .scene()
            .mask_ids()
            .iter()
            .filter(|id| ids.contains(&i64::from(id.id)))
            .map(|id| id.object.as_str())
            .collect();
        objects.dedup();
        println!(
            "{:<28} {:>6} {:>5} {:>8.3} - {:>7.3}  {}",
            file["file"].as_str().unwrap_or("(shown only)"),
            file["step"],
            file["env"],
            number("depth_min"),
            number("depth_max"),
            objects.join(", "),
        );
    }
}
