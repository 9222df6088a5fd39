//! Ray-caster cameras that look at rough terrain: depth, distance, normals and points, with one exact ray per pixel.
//!
//! ```text
//! cargo run --release --example run_ray_caster_camera -- --headless --num-envs 2 --steps 200 --save --out images
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::Axis;
use kinetoscope::prelude::*;
use kinetoscope::scene::terrain::RoughTerrain;
use kinetoscope::sensors::camera::{CameraConvention, PointFrame};
use kinetoscope::sensors::ray::{HitTargets, RayCasterCamera, RayCasterCameraCfg};
use launcher::{Launcher, MainLoop, cloud, image_file};
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Looks at rough terrain with a ray-caster camera in every environment.
#[derive(Debug, Parser)]
#[command(name = "run_ray_caster_camera", mut_arg("num_envs", |arg| arg.default_value("2")))]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Environment whose points are evaluated, and whose images --save writes
    #[arg(long, alias = "camera_id", default_value_t = 0)]
    camera_id: usize,
    /// Write depth, distance and normals as PNG, depth as .npy, the points as .ply
    #[arg(long)]
    save: bool,
    /// Width of the images, in pixels
    #[arg(long, default_value_t = 640)]
    width: usize,
    /// Height of the images, in pixels
    #[arg(long, default_value_t = 480)]
    height: usize,
}

/// Side of the terrain \[m\].
const SIDE: f64 = 8.0;
/// Time between images \[s\].
const PERIOD: f64 = 0.5;

fn main() -> ExitCode {
    launcher::run("run_ray_caster_camera", || run(&Args::parse()))
}

fn run(args: &Args) -> launcher::Result {
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        ground: None,
        arena_space: args.launcher.arena_space.unwrap_or(SIDE),
        ..args.launcher.simulation()?
    })?;
    launcher::check_camera_id(args.camera_id, &sim)?;
    let rough = RoughTerrain { size: [SIDE; 2], cell: 0.2, range: [0.0, 0.3], step: 0.02, seed: args.launcher.seed };
    let terrain = sim.add_terrain(TerrainCfg { heights: rough.heights()?, size: rough.size, ..Default::default() })?;
    let camera = sim.add_sensor("camera", camera_cfg(args))?;
    let eyes = launcher::alternating_eyes(sim.num_envs());
    sim.sensor_mut(camera)?.look_at(&eyes, &[[0.0; 3]], &[[0.0, 0.0, 1.0]], None)?;
    args.launcher.write_dump(&sim)?;
    println!("{}", sim.sensor(camera)?);
    let out = args.launcher.out_folder(args.save)?;

    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress = MainLoop::new(&args.launcher, 200);
    let (mut step, mut stepping, mut files) = (0, Duration::ZERO, Vec::new());
    let (mut images, mut seen) = (0, 0);
    while !progress.should_stop(step) {
        let start = Instant::now();
        sim.update(1);
        stepping += start.elapsed();
        step += 1;
        let of = sim.sensor(camera)?;
        let count = of.frame_counts()[args.camera_id];
        if count > seen {
            (images, seen) = (images + sim.num_envs(), count);
            progress.print_line(&format!(
                "step {step}: depth {:?}, distance {:?}, normals {:?}",
                of.depth().dim(),
                of.distance().dim(),
                of.normal().dim()
            ));
            if args.save {
                files.extend(save(of, args.camera_id, step, &out)?);
            }
        }
        progress.advance(step);
    }
    let rate = progress.env_steps_per_second(step, sim.num_envs());
    let of = sim.sensor(camera)?;
    let map = of.point_map(args.camera_id, PointFrame::World)?;
    let points: Vec<[f32; 3]> =
        map.rows().into_iter().filter(|p| p[0].is_finite()).map(|p| [p[0], p[1], p[2]]).collect();
    let error = cloud::reprojection_error(&map, lens(of, args.camera_id), &pose(of, args.camera_id));
    // The terrain stands in the middle of its environment, without rotation.
    if points.is_empty() {
        return Err("no ray of the camera hits the terrain".into());
    }
    let off = points.iter().map(|p| {
        let height = sim.entities().terrain(terrain).height_at([f64::from(p[0]), f64::from(p[1])]);
        height.map_or(f64::INFINITY, |height| (height - f64::from(p[2])).abs())
    });
    // At the rim of the terrain, rounding can put a point just outside of it.
    let (beside, on): (Vec<f64>, Vec<f64>) = off.partition(|off| off.is_infinite());
    let worst = on.into_iter().fold(0.0, f64::max);
    println!("\n{} points; they lie on the terrain to {worst:.1e} m, {} beside it", points.len(), beside.len());
    println!("Their largest reprojection error is {error:.1e} pixels");
    if args.save {
        let range = image_file::finite_range(points.iter().map(|p| p[2])).unwrap_or([0.0, 1.0]);
        let colored: Vec<_> = points.iter().map(|p| (*p, gray(p[2], range))).collect();
        cloud::write_ply(&out.join("ray_caster_camera_points.ply"), &colored)?;
        files.push("ray_caster_camera_points.ply".into());
    }
    let images_per_second = images as f64 / stepping.as_secs_f64().max(1e-9);
    println!(
        "{images} images of {} x {}: {images_per_second:.0} per second, stepping included",
        args.width, args.height
    );
    recording.finish(&mut sim)?;
    args.launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "steps": step,
        "threads": sim.threads(),
        "width": args.width,
        "height": args.height,
        "camera_id": args.camera_id,
        "pictures": images,
        "points": points.len(),
        "points_beside_the_terrain": beside.len(),
        "largest_distance_of_points_from_the_terrain": worst,
        "round_trip_error_pixels": error,
        "files": files,
        "images_per_second": images_per_second,
        "env_steps_per_second": rate,
        "warnings": sim.warnings().counts(),
    }))
}

/// Isaac Lab's default lens (focal length 24 mm, aperture 20.955 mm), with the terrain as the only target.
fn camera_cfg(args: &Args) -> RayCasterCameraCfg {
    RayCasterCameraCfg {
        width: args.width,
        height: args.height,
        targets: HitTargets::Named(vec!["terrain".into()]),
        sampling: SamplingCfg { update_period: PERIOD, ..SamplingCfg::default() },
        ..RayCasterCameraCfg::default()
    }
}

/// Focal lengths and principal point of one environment \[pixels\].
fn lens(camera: &RayCasterCamera, env: usize) -> [f64; 4] {
    let k = camera.intrinsic_matrices();
    [k[(env, 0, 0)], k[(env, 1, 1)], k[(env, 0, 2)], k[(env, 1, 2)]]
}

/// Pose of one environment's camera in the ROS convention.
fn pose(camera: &RayCasterCamera, env: usize) -> [f64; 7] {
    std::array::from_fn(|i| camera.pose_w(CameraConvention::Ros)[(env, i)])
}

/// Gray level of a height: low is dark.
fn gray(height: f32, [low, high]: [f32; 2]) -> [u8; 3] {
    [(55.0 + 200.0 * (height - low) / (high - low).max(1e-6)) as u8; 3]
}

/// Writes every channel of one environment; returns the names of the files.
fn save(camera: &RayCasterCamera, env: usize, step: u64, out: &Path) -> launcher::Result<Vec<String>> {
    let (height, width) = camera.image_shape();
    let size = [width, height];
    let of = |all: kinetoscope::ndarray::ArrayView3<'_, f32>| -> Vec<f32> {
        all.index_axis(Axis(0), env).iter().copied().collect()
    };
    let (depth, distance) = (of(camera.depth()), of(camera.distance()));
    let normal: Vec<f32> = camera.normal().index_axis(Axis(0), env).iter().copied().collect();
    let range = |numbers: &[f32]| image_file::finite_range(numbers.iter().copied()).unwrap_or([0.0, 1.0]);
    let images = [
        ("distance_to_image_plane", image_file::depth_image(size, &depth, range(&depth))),
        ("distance_to_camera", image_file::depth_image(size, &distance, range(&distance))),
        ("normals", image_file::normal_image(size, &normal)),
    ];
    let mut files = Vec::new();
    for (name, image) in &images {
        let file = format!("{name}_{env}_{step}.png");
        image_file::write_png(&out.join(&file), image)?;
        files.push(file);
    }
    let file = format!("distance_to_image_plane_{env}_{step}.npy");
    image_file::write_npy(&out.join(&file), &camera.depth().index_axis(Axis(0), env))?;
    files.push(file);
    Ok(files)
}
