//! A quadruped with a camera, a height scanner and contact sensors on its feet, as in Orbit's tutorial.
//!
//! ```text
//! cargo run --release --example add_sensors_on_robot -- --headless --num-envs 2 --steps 1000 --out images
//! cargo run --release --example add_sensors_on_robot -- --headless --steps 12000 --reset-every 0 --payload 5
//! cargo run --release --example add_sensors_on_robot -- --headless --robot quadruped/quadruped.xml --spawn-height 0
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::{Array2, ArrayView3, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::KeyedRng;
use kinetoscope::sensors::ContactSensor;
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sensors::ray::{HitTargets, RayCaster};
use launcher::spawn::SpawnFlags;
use launcher::{Launcher, MainLoop, image_file, stage};
use serde_json::{Value, json};
use std::any::Any;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// A standing quadruped with sensors.
#[derive(Debug, Parser)]
#[command(name = "add_sensors_on_robot", mut_arg("num_envs", |arg| arg.default_value("2")))]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// URDF or MJCF (.xml) of a quadruped with ANYmal's joint names, instead of the bundled one; an MJCF file sets its
    /// own start height
    #[arg(long)]
    robot: Option<PathBuf>,
    #[command(flatten)]
    spawn: SpawnFlags,
    /// Steps between printed summaries of the sensors; 0 for no summaries
    #[arg(long, alias = "print_every", default_value_t = 1)]
    print_every: u64,
    /// Steps between resets to the start pose with random joint angles; 0 for no resets
    #[arg(long, alias = "reset_every", default_value_t = 500)]
    reset_every: u64,
    /// Mass added to the base link, in kilograms
    #[arg(long, default_value_t = 0.0)]
    payload: f64,
    /// Stiffness of the drives, in N m/rad
    #[arg(long, default_value_t = 80.0)]
    stiffness: f64,
    /// Damping of the drives, in N m s/rad
    #[arg(long, default_value_t = 5.0)]
    damping: f64,
}

fn main() -> ExitCode {
    launcher::run("add_sensors_on_robot", || run(&Args::parse()))
}

/// Steps per second.
const STEPS_PER_SECOND: u64 = 200;

fn run(args: &Args) -> launcher::Result {
    let cfg = scene_cfg(args)?;
    let dt = cfg.simulation.physics_dt;
    let mut scene = InteractiveScene::new(cfg)?;
    scene.sim_mut().scene_mut().set_camera_view([3.5; 3], [0.0; 3])?;
    for diagnostic in scene.sim().diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    args.launcher.write_dump(scene.sim())?;
    println!("[INFO]: Setup complete...");

    args.launcher.serve(scene.sim_mut())?;
    args.launcher.open_window(scene.sim_mut());
    let recording = args.launcher.start_recording(scene.sim_mut())?;
    let progress = MainLoop::new(&args.launcher, 1000);
    let mut noise: Vec<KeyedRng> =
        (0..scene.num_envs()).map(|env| KeyedRng::keyed(args.launcher.seed, env as u64, "reset")).collect();
    let mut heights: Vec<Vec<f64>> = vec![Vec::new(); scene.num_envs()];
    let mut totals = Totals::default();
    let mut step = 0;
    while !progress.should_stop(step) {
        if args.reset_every > 0 && step % args.reset_every == 0 {
            // Poses are in the environment frame: environment origins are not added.
            let mut robot = scene.robot_mut("robot")?;
            let (root, standing) = (robot.read().default_root_state(), robot.read().default_qpos());
            robot.write_root_state(&root, None)?;
            let start = Array2::from_shape_fn(standing.dim(), |at| standing[at] + 0.1 * noise[at.0].uniform());
            let still = robot.read().default_qvel();
            robot.write_joint_state(&start, &still, None, None)?;
            robot.set_qpos_target(&standing, None, None)?;
            // The reset keeps the written state and clears the buffers of the sensors.
            scene.reset(None)?;
            totals.last_counts = [0; 3];
            progress.print_line("[INFO]: Resetting robot state...");
        }
        scene.update(1);
        step += 1;
        totals.count(&scene)?;
        if step % STEPS_PER_SECOND == 0 {
            let base = scene.robot("robot")?.root_pose();
            heights.iter_mut().enumerate().for_each(|(env, heights)| heights.push(base[(env, 2)]));
        }
        if args.print_every > 0 && step % args.print_every == 0 {
            progress.print_line(&summary(&scene)?);
        }
        progress.advance(step);
    }
    let rate = progress.env_steps_per_second(step, scene.num_envs());
    println!("\n{step} steps x {} environments: {rate:.0} environment steps per second", scene.num_envs());
    if let Some(out) = &args.launcher.out {
        launcher::make_folder(out)?;
        write_images(&mut scene, out)?;
        println!("Images written to {}", out.display());
    }
    recording.finish(scene.sim_mut())?;
    args.launcher.write_report(&report(&scene, &totals, &heights, (step, dt, rate))?)?;
    println!("Cleaning up...");
    Ok(())
}

/// The bundled scene with the flags applied.
fn scene_cfg(args: &Args) -> launcher::Result<SceneCfg> {
    let mut cfg = SceneCfg::from_file(assets::path("scenes/quadruped.toml")?)?;
    let from_flags = args.launcher.simulation()?;
    cfg.simulation = SimulationManagerCfg {
        num_envs: from_flags.num_envs,
        device: from_flags.device,
        seed: from_flags.seed,
        threads: from_flags.threads,
        arena_space: args.launcher.arena_space.unwrap_or(cfg.simulation.arena_space),
        ..cfg.simulation
    };
    for (_, entity) in &mut cfg.entities {
        if let EntityCfg::Sensor(sensor) = entity {
            let sensor: &mut dyn Any = &mut **sensor;
            if let Some(scanner) = sensor.downcast_mut::<RayCasterCfg>().filter(|_| args.spawn.no_ground) {
                // A target pattern without a match is an error. Without a ground the scene has no static geometry, so
                // with StaticOnly all rays miss.
                scanner.targets = HitTargets::StaticOnly;
            }
        }
        let EntityCfg::Robot(robot) = entity else { continue };
        if let Some(file) = &args.robot {
            let file = launcher::user_or_asset(file)?;
            // An MJCF file sets the start height of its robot.
            if file.extension().is_some_and(|extension| extension == "xml") {
                (robot.mjcf, robot.urdf, robot.init_pose) =
                    (Some(MjcfFile::new(file)), UrdfCfg::default(), Pose::identity());
            } else {
                robot.urdf = UrdfCfg::single(file);
            }
        }
        robot.drive = DriveCfg { stiffness: args.stiffness.into(), damping: args.damping.into(), ..Default::default() };
        robot.payload = vec![("base".into(), args.payload)];
        args.spawn.apply(&mut cfg.simulation, robot)?;
    }
    Ok(cfg)
}

/// The camera, the height scanner and the contact sensor.
fn sensors(scene: &InteractiveScene) -> launcher::Result<(&Camera, &RayCaster, &ContactSensor)> {
    Ok((scene.sensor("camera")?, scene.sensor("height_scanner")?, scene.sensor("contact_forces")?))
}

/// The text that the tutorial prints after every step.
fn summary(scene: &InteractiveScene) -> launcher::Result<String> {
    const LINE: &str = "-------------------------------";
    let (camera, scanner, contacts) = sensors(scene)?;
    Ok(format!(
        "{LINE}\n{camera}\n\
         Received shape of rgb   image:  {:?}\n\
         Received shape of depth image:  {:?}\n\
         {LINE}\n{scanner}\n\
         Received max height value:  {:.4}\n\
         {LINE}\n{contacts}\n\
         Received max contact force of:  {:.3}",
        camera.color()?.shape(),
        camera.depth()?.shape(),
        max_height(scanner).unwrap_or(f64::NAN),
        largest(contacts.net_forces_w()),
    ))
}

/// The largest z of all hits \[m\]; `None` if no ray hits.
fn max_height(scanner: &RayCaster) -> Option<f64> {
    let hits = scanner.hits();
    let heights = hits.index_axis(Axis(2), 2);
    heights.iter().copied().filter(|z| z.is_finite()).reduce(f64::max)
}

/// The largest signed component of all forces, at least 0 \[N\], defined as in the tutorial.
fn largest(forces: ArrayView3<'_, f64>) -> f64 {
    forces.iter().copied().fold(0.0, f64::max)
}

/// Statistics of the whole run; a reset restarts the counters of the sensors.
#[derive(Default)]
struct Totals {
    last_counts: [u64; 3],
    updates: [u64; 3],
    max_force: f64,
}

impl Totals {
    fn count(&mut self, scene: &InteractiveScene) -> launcher::Result {
        let (camera, scanner, contacts) = sensors(scene)?;
        let now = [camera.frame_counts()[0], scanner.sample_counts()[0], contacts.sample_counts()[0]];
        for ((updates, seen), now) in self.updates.iter_mut().zip(self.last_counts).zip(now) {
            *updates += now.checked_sub(seen).unwrap_or(now);
        }
        self.last_counts = now;
        self.max_force = self.max_force.max(largest(contacts.net_forces_w()));
        Ok(())
    }
}

fn report(
    scene: &InteractiveScene,
    totals: &Totals,
    heights: &[Vec<f64>],
    (steps, dt, rate): (u64, f64, f64),
) -> launcher::Result<Value> {
    let (sim, (camera, scanner, contacts)) = (scene.sim(), sensors(scene)?);
    let depth = image_file::finite_range(camera.depth()?.iter().copied());
    let hit = scanner.hit_mask();
    let forces = contacts.net_forces_w();
    let of_env = |env: usize| -> Value {
        let body = |b: usize| (0..3).map(|k| forces[(env, b, k)]).collect::<Vec<f64>>();
        contacts.body_names().iter().enumerate().map(|(b, name)| (name.clone(), json!(body(b)))).collect()
    };
    Ok(json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "steps": steps,
        "dt": dt,
        "camera": {
            "rgb_shape": camera.color()?.shape(),
            "depth_shape": camera.depth()?.shape(),
            "updates": totals.updates[0],
            "depth_min": depth.map(|[min, _]| min),
            "depth_max": depth.map(|[_, max]| max),
        },
        "height_scanner": {
            "rays": scanner.num_rays(),
            "updates": totals.updates[1],
            "max_height": max_height(scanner),
            "hit_fraction": hit.iter().filter(|hit| **hit).count() as f64 / hit.len() as f64,
        },
        "contact_forces": {
            "bodies": contacts.body_names(),
            "updates": totals.updates[2],
            "net_forces_w": (0..sim.num_envs()).map(of_env).collect::<Vec<_>>(),
            "history_shape": contacts.net_forces_w_history().shape(),
            "max_force": totals.max_force,
        },
        "base_height": heights,
        "total_mass": scene.robot("robot")?.total_mass(),
        "env_steps_per_second": rate,
        "warnings": sim.warnings().counts(),
    }))
}

/// Writes the camera image of each robot, and the stage with all robots and their sensor markers.
fn write_images(scene: &mut InteractiveScene, out: &Path) -> launcher::Result {
    let front = scene.sensor::<Camera>("camera")?;
    let (color, [width, height]) = (front.color()?, [640, 480]);
    for (row, env) in front.env_ids().iter().enumerate() {
        let pixels: Vec<u8> = color.index_axis(Axis(0), row).iter().copied().collect();
        let file = out.join(format!("front_camera_env{env}.png"));
        image_file::write_png(&file, &image_file::color_image([width, height], &pixels))?;
    }
    let sim = scene.sim_mut();
    let markers = sim.scene().markers();
    stage::write(sim, &markers, [3.5; 3], [0.0; 3], &out.join("stage.png"))
}
