//! Cameras that look at objects of several kinds: color, depth, normals, instance and class of every pixel, and the
//! point cloud.
//!
//! ```text
//! cargo run --release --example run_camera -- --headless --num-envs 2 --steps 200 --save --draw --out images
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::{KeyedRng, Marker};
use kinetoscope::sensors::camera::colormap::mask_color;
use kinetoscope::sensors::camera::{Camera, CameraConvention, PointFrame};
use kinetoscope::sim::RigidObjectId;
use launcher::{Launcher, MainLoop, cloud, image_file, stage};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Drops objects of random shapes and records images of them.
#[derive(Debug, Parser)]
#[command(name = "run_camera", mut_arg("num_envs", |arg| arg.default_value("2")))]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Number of objects in each environment
    #[arg(long, default_value_t = 8)]
    objects: usize,
    /// Environment whose pixels and points are reported, and whose images --save writes
    #[arg(long, alias = "camera_id", default_value_t = 0)]
    camera_id: usize,
    /// Write an image of the environments, run_camera.png, with the camera's points as balls in the colors of the
    /// objects
    #[arg(long)]
    draw: bool,
    /// Write every channel as PNG, depth and mask as .npy, the points as .ply
    #[arg(long)]
    save: bool,
    /// Width of the images, in pixels
    #[arg(long, default_value_t = 640)]
    width: usize,
    /// Height of the images, in pixels
    #[arg(long, default_value_t = 480)]
    height: usize,
}

/// Steps between two images.
const IMAGE_EVERY: u64 = 50;
/// Maximum number of balls that `--draw` shows.
const MAX_BALLS: usize = 4000;

fn main() -> ExitCode {
    launcher::run("run_camera", || run(&Args::parse()))
}

fn run(args: &Args) -> launcher::Result {
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        arena_space: args.launcher.arena_space.unwrap_or(6.0),
        ..args.launcher.simulation()?
    })?;
    launcher::check_camera_id(args.camera_id, &sim)?;
    let objects = add_objects(&mut sim, args)?;
    let camera = sim.add_sensor("camera", camera_cfg(args))?;
    randomize_poses(&mut sim, &objects, args.launcher.seed)?;
    let eyes = launcher::alternating_eyes(sim.num_envs());
    sim.sensor_mut(camera)?.look_at(&eyes, &[[0.0; 3]], &[[0.0, 0.0, 1.0]], None)?;
    args.launcher.write_dump(&sim)?;
    println!("{}", sim.sensor(camera)?);
    let out = args.launcher.out_folder(args.save || args.draw)?;

    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress = MainLoop::new(&args.launcher, 200);
    let (mut step, mut drawing, mut images) = (0, Duration::ZERO, 0);
    let mut files: Vec<String> = Vec::new();
    while !progress.should_stop(step) {
        let end = progress.end_of_block(step, IMAGE_EVERY - step % IMAGE_EVERY);
        sim.update((end - step) as u32);
        step = end;
        let (start, seen) = (Instant::now(), sim.sensor(camera)?);
        seen.images()?;
        drawing += start.elapsed();
        images += seen.env_ids().len();
        progress.print_line(&shapes(seen, step)?);
        if args.save {
            files.extend(save(&sim, camera, args.camera_id, step, &out)?);
        }
        progress.advance(step);
    }
    let rate = progress.env_steps_per_second(step, sim.num_envs());
    let classes = pixels_by_class(&sim, camera, args.camera_id)?;
    println!("\npixels of camera {} by class: {classes:?}", args.camera_id);
    let points = colored_points(&sim, camera, args.camera_id)?;
    let error = reprojection_error(sim.sensor(camera)?, args.camera_id)?;
    println!("{} points; their largest reprojection error is {error:.1e} pixels", points.len());
    if args.save {
        let path = out.join("points.ply");
        cloud::write_ply(&path, &points)?;
        files.push("points.ply".into());
    }
    if args.draw {
        let markers = balls(sim.sensor(camera)?, args.camera_id)?;
        let origins = sim.cfg().env_origins();
        let target = [0, 1, 2].map(|k| origins[(args.camera_id, k)]);
        let eye = target.map(|x| x + 3.2);
        stage::write(&mut sim, &markers, eye, target, &out.join("run_camera.png"))?;
        files.push("run_camera.png".into());
    }
    let images_per_second = f64::from(u32::try_from(images)?) / drawing.as_secs_f64().max(1e-9);
    println!("{images} images of {} x {}: {images_per_second:.0} per second", args.width, args.height);
    let bounds = points.iter().fold(None, |bounds: Option<[[f32; 3]; 2]>, (p, _)| {
        let [low, high] = bounds.unwrap_or([*p, *p]);
        Some([[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))])
    });
    recording.finish(&mut sim)?;
    args.launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "steps": step,
        "threads": sim.threads(),
        "width": args.width,
        "height": args.height,
        "camera_id": args.camera_id,
        "ids": sim.scene().mask_ids().iter().map(|id| json!({
            "id": id.id, "object": id.object, "class": id.class,
        })).collect::<Vec<_>>(),
        "pixels_by_class": classes,
        "points": points.len(),
        "point_bounds": bounds,
        "round_trip_error_pixels": error,
        "files": files,
        "images_per_second": images_per_second,
        "env_steps_per_second": rate,
        "warnings": sim.warnings().counts(),
    }))
}

/// Objects of random shapes, sizes and colors, of 5 kg; the semantic class is the shape.
fn add_objects(sim: &mut SimulationManager, args: &Args) -> launcher::Result<Vec<RigidObjectId>> {
    let mut random = KeyedRng::keyed(args.launcher.seed, 0, "objects");
    let mut objects = Vec::new();
    for k in 0..args.objects {
        let mut between = |low: f64, high: f64| random.uniform_range(low, high);
        let (size, length) = (between(0.1, 0.25), between(0.2, 0.5));
        let (class, shape) = match (between(0.0, 4.0) as usize).min(3) {
            0 => ("box", ObjectShape::Box { size: [size, length, 1.5 * size] }),
            1 => ("sphere", ObjectShape::Sphere { radius: size }),
            2 => ("cylinder", ObjectShape::Cylinder { radius: size, length }),
            _ => ("capsule", ObjectShape::Capsule { radius: size, length }),
        };
        objects.push(sim.add_rigid_object(RigidObjectCfg {
            uid: format!("object{k}"),
            shape,
            mass: Some(5.0),
            rgba: [between(0.2, 1.0), between(0.2, 1.0), between(0.2, 1.0), 1.0],
            semantic_class: Some(class.into()),
            ..Default::default()
        })?);
    }
    Ok(objects)
}

/// Stacks the objects above each other, with a random offset and rotation in each environment.
fn randomize_poses(sim: &mut SimulationManager, objects: &[RigidObjectId], seed: u64) -> launcher::Result {
    let mut random: Vec<KeyedRng> =
        (0..sim.num_envs()).map(|env| KeyedRng::keyed(seed, env as u64, "scatter")).collect();
    for (k, &object) in objects.iter().enumerate() {
        let mut poses = Array2::zeros((sim.num_envs(), 7));
        for (env, random) in random.iter_mut().enumerate() {
            let place = [2.0 * random.uniform() - 1.0, 2.0 * random.uniform() - 1.0, 0.5 + 0.4 * k as f64];
            // Four independent normal numbers have a uniformly distributed direction, thus a uniform rotation; the
            // write normalizes the quaternion.
            let rotation: [f64; 4] = std::array::from_fn(|_| random.normal());
            for (to, from) in poses.row_mut(env).iter_mut().zip(place.into_iter().chain(rotation)) {
                *to = from;
            }
        }
        sim.rigid_object_mut(object).write_pose(&poses, None)?;
    }
    Ok(())
}

fn camera_cfg(args: &Args) -> CameraCfg {
    CameraCfg {
        width: args.width,
        height: args.height,
        intrinsics: Intrinsics::Fovy { radians: 36f64.to_radians() },
        near: 0.1,
        far: 1e5,
        channels: Channels { color: true, depth: true, normal: true, mask: true, ..Channels::default() },
        ..Default::default()
    }
}

/// Shapes of the channels, in the tutorial's format.
fn shapes(camera: &Camera, step: u64) -> launcher::Result<String> {
    Ok(format!(
        "step {step}: rgb {:?}, depth {:?}, normals {:?}, instances {:?}",
        camera.color()?.dim(),
        camera.depth()?.dim(),
        camera.normal()?.dim(),
        camera.mask()?.dim()
    ))
}

/// The class of each mask id, and a number for each class in the order of the ids.
fn classes(sim: &SimulationManager) -> (BTreeMap<i32, String>, BTreeMap<String, i32>) {
    let of_id = sim.scene().mask_ids().iter().map(|id| (id.id, id.class.clone())).collect();
    let mut numbers = BTreeMap::new();
    for id in sim.scene().mask_ids() {
        let next = numbers.len() as i32 + 1;
        numbers.entry(id.class.clone()).or_insert(next);
    }
    (of_id, numbers)
}

/// Writes every channel of one environment; returns the names of the files.
fn save(
    sim: &SimulationManager,
    camera: SensorId<Camera>,
    env: usize,
    step: u64,
    out: &Path,
) -> launcher::Result<Vec<String>> {
    let camera = sim.sensor(camera)?;
    let (height, width) = camera.image_shape();
    let size = [width, height];
    let color: Vec<u8> = camera.color()?.index_axis(Axis(0), env).iter().copied().collect();
    let depth: Vec<f32> = camera.depth()?.index_axis(Axis(0), env).iter().copied().collect();
    let normal: Vec<f32> = camera.normal()?.index_axis(Axis(0), env).iter().copied().collect();
    let mask: Vec<i32> = camera.mask()?.index_axis(Axis(0), env).iter().copied().collect();
    let (class_of, numbers) = classes(sim);
    let class = |id: &i32| class_of.get(id).and_then(|class| numbers.get(class)).copied().unwrap_or(0);
    let semantic: Vec<i32> = mask.iter().map(class).collect();
    let range = image_file::finite_range(depth.iter().copied()).unwrap_or([0.0, 1.0]);
    let images = [
        ("rgb", image_file::color_image(size, &color)),
        ("depth", image_file::depth_image(size, &depth, range)),
        ("normals", image_file::normal_image(size, &normal)),
        ("instance_segmentation", image_file::mask_image(size, &mask)),
        ("semantic_segmentation", image_file::mask_image(size, &semantic)),
    ];
    let mut files = Vec::new();
    for (name, image) in &images {
        let file = format!("{name}_{env}_{step}.png");
        image_file::write_png(&out.join(&file), image)?;
        files.push(file);
    }
    let depth_file = format!("depth_{env}_{step}.npy");
    image_file::write_npy(&out.join(&depth_file), &camera.depth()?.index_axis(Axis(0), env))?;
    let mask_file = format!("instance_segmentation_{env}_{step}.npy");
    image_file::write_npy(&out.join(&mask_file), &camera.mask()?.index_axis(Axis(0), env))?;
    files.extend([depth_file, mask_file]);
    Ok(files)
}

/// Number of pixels of each class.
fn pixels_by_class(
    sim: &SimulationManager,
    camera: SensorId<Camera>,
    env: usize,
) -> launcher::Result<BTreeMap<String, u64>> {
    let (class_of, _) = classes(sim);
    let mut counts = BTreeMap::new();
    for id in sim.sensor(camera)?.mask()?.index_axis(Axis(0), env) {
        let class = class_of.get(id).map_or("nothing", String::as_str);
        *counts.entry(class.to_string()).or_insert(0) += 1;
    }
    Ok(counts)
}

/// World positions of the visible points \[m\] with their RGB colors.
fn colored_points(
    sim: &SimulationManager,
    camera: SensorId<Camera>,
    env: usize,
) -> launcher::Result<Vec<([f32; 3], [u8; 3])>> {
    let camera = sim.sensor(camera)?;
    let (map, color) = (camera.point_map(env, PointFrame::World)?, camera.color()?);
    let color = color.index_axis(Axis(0), env);
    let points = map.rows().into_iter().zip(color.rows());
    Ok(points
        .filter(|(point, _)| point[0].is_finite())
        .map(|(point, color)| ([point[0], point[1], point[2]], [color[0], color[1], color[2]]))
        .collect())
}

/// A subset of the points as balls, each in the color of its object in the mask image.
fn balls(camera: &Camera, env: usize) -> launcher::Result<Vec<(EnvId, Marker)>> {
    let (map, mask) = (camera.point_map(env, PointFrame::World)?, camera.mask()?);
    let mask = mask.index_axis(Axis(0), env);
    let every = mask.len().div_ceil(MAX_BALLS).max(1);
    let points = map.rows().into_iter().zip(&mask).filter(|(point, _)| point[0].is_finite());
    let ball = |point: [f32; 3], id: i32| {
        let [r, g, b] = mask_color(id).map(|c| f32::from(c) / 255.0);
        Marker::sphere(point.map(f64::from), 0.012, [r, g, b, 1.0])
    };
    let markers = points.step_by(every).map(|(p, &id)| (EnvId(env), ball([p[0], p[1], p[2]], id)));
    Ok(markers.collect())
}

/// The largest reprojection error of the point map \[pixels\].
fn reprojection_error(camera: &Camera, env: usize) -> launcher::Result<f64> {
    let (map, k) = (camera.point_map(env, PointFrame::World)?, camera.intrinsic_matrices());
    let pose: [f64; 7] = std::array::from_fn(|i| camera.pose_w(CameraConvention::Ros)[(env, i)]);
    let lens = [k[(env, 0, 0)], k[(env, 1, 1)], k[(env, 0, 2)], k[(env, 1, 2)]];
    Ok(cloud::reprojection_error(&map, lens, &pose))
}
