//! A quadruped with a camera, a height scanner and contact sensors on its feet, as in Orbit's tutorial.
//!
//! ```text
//! cargo run --release --example add_sensors_on_robot -- --headless --num-envs 2 --steps 1000 --out pictures
//! cargo run --release --example add_sensors_on_robot -- --headless --steps 12000 --reset-every 0 --payload 5
//! cargo run --release --example add_sensors_on_robot -- --headless --robot quadruped/quadruped.xml
//! ```

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::{Array2, ArrayView3, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::Random;
use kinetoscope::scene::pose::from_wxyz;
use kinetoscope::sensors::ray::pattern::Grid;
use launcher::{Launcher, Progress, picture, stage};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// A standing quadruped with sensors.
#[derive(Debug, Parser)]
#[command(name = "add_sensors_on_robot", mut_arg("num_envs", |arg| arg.default_value("2")))]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// URDF or MJCF (.xml) of a quadruped with ANYmal's joint names; in an MJCF file it starts as high as the file says
    #[arg(long, default_value = "quadruped/quadruped.urdf")]
    robot: PathBuf,
    /// Steps between resets with other joint angles; 0 for none
    #[arg(long, alias = "reset_every", default_value_t = 500)]
    reset_every: u64,
    /// Mass on the back, in kilograms
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

/// Steps from one line on the sensors to the next.
const REPORT_EVERY: u64 = 200;
/// Steps in a second.
const SECOND: u64 = 200;

fn run(args: &Args) -> launcher::Result {
    let legged = SimulationManagerCfg::legged();
    let mut cfg = SimulationManagerCfg {
        physics_dt: 1.0 / SECOND as f64,
        cone: legged.cone,
        impratio: legged.impratio,
        arena_space: args.launcher.arena_space.unwrap_or(2.0),
        ..args.launcher.simulation()?
    };
    // A dome of even light, as in the tutorial: most of it is the sky's; the lamp from above casts soft shadows.
    cfg.lights = vec![LightCfg { direction: [0.1, 0.2, -1.0].into(), color: [0.75; 3], ..LightCfg::default() }];
    let dt = cfg.physics_dt;
    let mut sim = SimulationManager::new(cfg)?;
    let robot = sim.add_robot(robot_cfg(args)?)?;
    let camera = sim.add_sensor("camera", camera_cfg())?;
    let scanner = sim.add_sensor("height_scanner", scanner_cfg())?;
    let contacts = sim.add_sensor("contact_forces", contacts_cfg())?;
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    args.launcher.write_dump(&sim)?;
    println!("[INFO]: Setup complete...");
    println!("{}\n{}\n{}", sim.sensor(camera)?, sim.sensor(scanner)?, sim.sensor(contacts)?);

    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress = Progress::new(&args.launcher, 1000);
    let mut noise: Vec<Random> =
        (0..sim.num_envs()).map(|env| Random::keyed(args.launcher.seed, env as u64, "reset")).collect();
    let mut heights: Vec<Vec<f64>> = vec![Vec::new(); sim.num_envs()];
    let mut totals = Totals::default();
    let standing = sim.robot(robot).get_default_qpos();
    let mut step = 0;
    while !progress.stop(step) {
        if args.reset_every > 0 && step % args.reset_every == 0 {
            sim.reset(None)?;
            totals.seen = [0; 3];
            let offset = Array2::from_shape_fn(standing.dim(), |(env, _)| 0.1 * noise[env].uniform());
            let mut legs = sim.robot_mut(robot);
            legs.write_qpos(&(&standing + &offset), None, None)?;
            legs.set_qpos(&standing, None, None)?;
            progress.say("[INFO]: Resetting robot state...");
        }
        sim.update(1);
        step += 1;
        totals.count(&sim, camera, scanner, contacts)?;
        if step % SECOND == 0 {
            let base = sim.robot(robot).get_root_pose();
            heights.iter_mut().enumerate().for_each(|(env, heights)| heights.push(base[(env, 2)]));
        }
        if step % REPORT_EVERY == 0 {
            progress.say(&summary(&sim, camera, scanner, contacts)?);
        }
        progress.advance(step);
    }
    let rate = progress.env_steps_per_second(step, sim.num_envs());
    println!("{}", summary(&sim, camera, scanner, contacts)?);
    println!("\n{step} steps x {} environments: {rate:.0} environment steps per second", sim.num_envs());
    if let Some(out) = &args.launcher.out {
        launcher::make_folder(out)?;
        write_pictures(&mut sim, camera, out)?;
        println!("Pictures written to {}", out.display());
    }
    recording.finish(&mut sim)?;
    args.launcher.write_report(&report(
        &sim,
        robot,
        (camera, scanner, contacts),
        &totals,
        &heights,
        (step, dt, rate),
    )?)?;
    Ok(())
}

/// ANYmal's start: 0.6 m up, knees bent.
fn robot_cfg(args: &Args) -> launcher::Result<RobotCfg> {
    let file = launcher::user_or_asset(&args.robot)?;
    // An MJCF file says how high its robot stands.
    let described = if file.extension().is_some_and(|extension| extension == "xml") {
        RobotCfg { mjcf: Some(MjcfFile::new(file)), ..Default::default() }
    } else {
        let init_pose = Pose::translation(0.0, 0.0, 0.6);
        RobotCfg { urdf: UrdfCfg::single(file), init_pose, ..Default::default() }
    };
    let pose = [(".*HAA", 0.0), (".*F_HFE", 0.4), (".*H_HFE", -0.4), (".*F_KFE", -0.8), (".*H_KFE", 0.8)];
    Ok(RobotCfg {
        uid: "robot".into(),
        fix_base: false,
        init_qpos: pose.map(|(joints, angle)| (joints.to_string(), angle)).to_vec(),
        drive: DriveCfg { stiffness: args.stiffness.into(), damping: args.damping.into(), ..Default::default() },
        payload: vec![("base".into(), args.payload)],
        ..described
    })
}

/// In front of the base, looking forward, 10 pictures per second.
fn camera_cfg() -> CameraCfg {
    CameraCfg {
        width: 640,
        height: 480,
        intrinsics: Intrinsics::ISAAC,
        near: 0.1,
        far: 1e5,
        extrinsics: Extrinsics {
            parent: Some("robot/base".into()),
            placement: Placement::Pose { pos: [0.510, 0.0, 0.015], rotation: from_wxyz([0.5, -0.5, 0.5, -0.5]) },
            convention: CameraConvention::Ros,
        },
        channels: Channels { color: true, depth: true, ..Default::default() },
        update_period: 0.1,
        ..Default::default()
    }
}

/// 187 rays from 20 m above, 50 times per second, that turn with the robot's heading and see the ground only.
fn scanner_cfg() -> RayCasterCfg {
    RayCasterCfg {
        parent: Some("robot/base".into()),
        offset: Pose::translation(0.0, 0.0, 20.0),
        alignment: RayAlignment::Yaw,
        pattern: Grid { resolution: 0.1, size: [1.6, 1.0], ..Grid::default() }.into(),
        targets: HitTargets::Named(vec!["ground".into()]),
        sampling: SamplingCfg::every(0.02),
        debug_vis: true,
        ..Default::default()
    }
}

/// Forces on the feet in every step, and in the five before.
fn contacts_cfg() -> ContactSensorCfg {
    ContactSensorCfg {
        sampling: SamplingCfg { history_length: 6, ..Default::default() },
        debug_vis: true,
        ..ContactSensorCfg::of(".*_FOOT")
    }
}

type Ids = (SensorId<Camera>, SensorId<RayCaster>, SensorId<ContactSensor>);

/// What the tutorial prints in every step.
fn summary(
    sim: &SimulationManager,
    camera: SensorId<Camera>,
    scanner: SensorId<RayCaster>,
    contacts: SensorId<ContactSensor>,
) -> launcher::Result<String> {
    let (camera, scanner, contacts) = (sim.sensor(camera)?, sim.sensor(scanner)?, sim.sensor(contacts)?);
    Ok(format!(
        "-------------------------------\n\
         Received shape of rgb   image: {:?}\n\
         Received shape of depth image: {:?}\n\
         -------------------------------\n\
         Received max height value: {:.4}\n\
         -------------------------------\n\
         Received max contact force of: {:.3}",
        camera.color()?.shape(),
        camera.depth()?.shape(),
        max_height(scanner).unwrap_or(f64::NAN),
        largest(contacts.net_forces_w()),
    ))
}

/// The largest z of all hits; `None` where no ray hits.
fn max_height(scanner: &RayCaster) -> Option<f64> {
    let hits = scanner.hits();
    let heights = hits.index_axis(Axis(2), 2);
    heights.iter().copied().filter(|z| z.is_finite()).reduce(f64::max)
}

/// The largest component of all forces, as the tutorial has it.
fn largest(forces: ArrayView3<'_, f64>) -> f64 {
    forces.iter().copied().fold(0.0, f64::max)
}

/// Measurements over the whole run; a reset starts a sensor's own count again.
#[derive(Default)]
struct Totals {
    seen: [u64; 3],
    updates: [u64; 3],
    max_force: f64,
}

impl Totals {
    fn count(
        &mut self,
        sim: &SimulationManager,
        camera: SensorId<Camera>,
        scanner: SensorId<RayCaster>,
        contacts: SensorId<ContactSensor>,
    ) -> launcher::Result {
        let contacts = sim.sensor(contacts)?;
        let now = [
            sim.sensor(camera)?.frame_counts()[0],
            sim.sensor(scanner)?.sample_counts()[0],
            contacts.sample_counts()[0],
        ];
        for ((updates, seen), now) in self.updates.iter_mut().zip(self.seen).zip(now) {
            *updates += now.checked_sub(seen).unwrap_or(now);
        }
        self.seen = now;
        self.max_force = self.max_force.max(largest(contacts.net_forces_w()));
        Ok(())
    }
}

fn report(
    sim: &SimulationManager,
    robot: RobotId,
    (camera, scanner, contacts): Ids,
    totals: &Totals,
    heights: &[Vec<f64>],
    (steps, dt, rate): (u64, f64, f64),
) -> launcher::Result<Value> {
    let (camera, scanner, contacts) = (sim.sensor(camera)?, sim.sensor(scanner)?, sim.sensor(contacts)?);
    let depth = picture::finite_range(camera.depth()?.iter().copied());
    let hit = scanner.hit_mask();
    let forces = contacts.net_forces_w();
    let of_env = |env: usize| -> Value {
        let body = |b: usize| (0..3).map(|k| forces[(env, b, k)]).collect::<Vec<f64>>();
        contacts.body_names().iter().enumerate().map(|(b, name)| (name.clone(), json!(body(b)))).collect()
    };
    Ok(json!({
        "mujoco_version": kinetoscope::sim::mj::version_string(),
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
        "total_mass": sim.robot(robot).total_mass(),
        "env_steps_per_second": rate,
        "warnings": sim.warning_counts(),
    }))
}

/// What the camera of each robot sees, and the stage with all robots and what their sensors show.
fn write_pictures(sim: &mut SimulationManager, camera: SensorId<Camera>, out: &Path) -> launcher::Result {
    let front = sim.sensor(camera)?;
    let (color, [width, height]) = (front.color()?, [640, 480]);
    for (row, env) in front.env_ids().iter().enumerate() {
        let pixels: Vec<u8> = color.index_axis(Axis(0), row).iter().copied().collect();
        let file = out.join(format!("front_camera_env{env}.png"));
        picture::write_png(&file, &picture::color_picture([width, height], &pixels))?;
    }
    let markers = sim.markers();
    stage::write(sim, &markers, [3.5; 3], [0.0; 3], &out.join("stage.png"))
}
