//! One scene through many lenses: pinholes with distortion, fisheyes, a panorama, or the calibration of a real camera.
//!
//! ```text
//! cargo run --release --example fisheye -- --headless --out images
//! cargo run --release --example fisheye -- --headless --lens panorama --width 1024 --height 512 --out images
//! cargo run --release --example fisheye -- --headless --camera-info ost.yaml --renderer rt --out images
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::{ArrayView1, Axis};
use kinetoscope::prelude::*;
use kinetoscope::render::lens::Lens;
use kinetoscope::render::lens::{
    Domain, Equidistant, Equisolid, FTheta, OpenCv, OpenCvFisheye, Orthographic, Panorama, Stereographic,
};
use kinetoscope::sensors::camera::{Camera, CameraInfo, PointFrame};
use launcher::panel::tile;
use launcher::{Launcher, MainLoop, PathFlags, Renderer, image_file};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Renders an arm, a hand and a few objects through lenses.
#[derive(Debug, Parser)]
#[command(name = "fisheye")]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Render through this lens only, such as panorama; may be repeated [default: one lens of each kind]
    #[arg(long = "lens", value_name = "NAME", conflicts_with = "camera_info")]
    lenses: Vec<String>,
    /// Render through the lens of a ROS camera_info file, with its size and intrinsics
    #[arg(long, alias = "camera_info", value_name = "FILE", conflicts_with_all = ["width", "height"])]
    camera_info: Option<PathBuf>,
    /// Width of the images, in pixels
    #[arg(long, default_value_t = 320)]
    width: usize,
    /// Height of the images, in pixels
    #[arg(long, default_value_t = 240)]
    height: usize,
    #[command(flatten)]
    paths: PathFlags,
}

/// Position and target of the cameras \[m\].
const EYE: [f64; 3] = [0.75, -0.55, 0.75];
const TARGET: [f64; 3] = [0.25, 0.0, 0.45];

fn main() -> ExitCode {
    launcher::run("fisheye", || run(&Args::parse()))
}

fn run(args: &Args) -> launcher::Result {
    let renderer = match args.launcher.renderer {
        // The rasterizer supports only lenses that keep straight lines straight.
        Renderer::Auto => Renderer::FastRt,
        other => other,
    };
    let renderer = renderer.for_cameras(args.paths)?;
    let views = views(args)?;
    let mut sim = SimulationManager::new(args.launcher.simulation_for_any_renderer())?;
    let robot = sim.add_robot(assets::sr5_with_hand()?)?;
    add_objects(&mut sim)?;
    let cameras = views
        .iter()
        .map(|(name, cfg)| sim.add_sensor(name, CameraCfg { renderer, ..cfg.clone() }))
        .collect::<Result<Vec<_>, _>>()?;
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    args.launcher.write_dump(&sim)?;
    let out = args.launcher.out_folder(true)?;

    let arm = sim.robot(robot).joint_ids("arm")?;
    let target = [0.0, 0.5, -1.5, 0.3, -0.5, 0.0];
    sim.robot_mut(robot).set_qpos_target(ArrayView1::from(&target).insert_axis(Axis(0)), Some(&arm), None)?;
    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    // Without a viewer, the images are the only output, and few steps are enough.
    let mut launcher = args.launcher.clone();
    launcher.steps = launcher.steps.or((launcher.headless && launcher.serve_address().is_none()).then_some(100));
    let progress = MainLoop::new(&launcher, 100);
    let mut step = 0;
    while !progress.should_stop(step) {
        sim.update(1);
        step += 1;
        progress.advance(step);
    }
    let rate = progress.env_steps_per_second(step, sim.num_envs());
    recording.finish(&mut sim)?;

    let (mut images, mut lenses) = (Vec::new(), Vec::new());
    for ((name, _), camera) in views.iter().zip(cameras) {
        let (image, report) = write_images(sim.sensor(camera)?, name, &out)?;
        println!("{name}: {}", summary_line(&report));
        images.push(image);
        lenses.push(report);
    }
    let all = out.join("lenses.png");
    image_file::write_png(&all, &tile(&images))?;
    println!("{} images, side by side in {}", images.len(), all.display());
    args.launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "threads": sim.threads(),
        "renderer": renderer,
        "steps": step,
        "env_steps_per_second": rate,
        "lenses": lenses,
        "warnings": sim.warnings().counts(),
    }))
}

/// Adds a ring of balls on the ground around the camera, so that every heading shows objects.
fn add_objects(sim: &mut SimulationManager) -> launcher::Result {
    for k in 0..12 {
        let (angle, radius) = (f64::from(k) * std::f64::consts::TAU / 12.0, 0.12);
        let at = [EYE[0] + 1.5 * angle.cos(), EYE[1] + 1.5 * angle.sin()];
        let shade = f64::from(k) / 12.0;
        sim.add_rigid_object(RigidObjectCfg {
            uid: format!("ball{k}"),
            shape: ObjectShape::Sphere { radius },
            mass: Some(1.0),
            init_pose: Pose::translation(at[0], at[1], radius),
            rgba: [0.9 - 0.7 * shade, 0.3, 0.2 + 0.7 * shade, 1.0],
            ..Default::default()
        })?;
    }
    Ok(())
}

/// The cameras to render with, and their names.
fn views(args: &Args) -> launcher::Result<Vec<(String, CameraCfg)>> {
    let placement = Placement::LookAt { eye: EYE, target: TARGET, up: [0.0, 0.0, 1.0] };
    let base = CameraCfg {
        width: args.width,
        height: args.height,
        near: 0.02,
        far: 50.0,
        extrinsics: Extrinsics { placement, ..Default::default() },
        channels: Channels { color: true, distance: true, depth: true, mask: true, ..Default::default() },
        ..Default::default()
    };
    if let Some(path) = &args.camera_info {
        let info = CameraInfo::read(path)?;
        let mut cfg = base;
        info.apply_to(&mut cfg);
        return Ok(vec![("camera_info".into(), cfg)]);
    }
    let wanted = |lens: &Lens| args.lenses.is_empty() || args.lenses.iter().any(|name| matches_name(name, lens));
    for name in &args.lenses {
        Lens::from_name(name)?;
    }
    let of = |lens: Lens| {
        let intrinsics = fitted_intrinsics(&lens, args.width, args.height)?;
        Ok((lens.name().to_owned(), CameraCfg { lens, intrinsics, ..base.clone() }))
    };
    sample_lenses().into_iter().filter(wanted).map(of).collect()
}

/// True if a name or an alias denotes a lens of this kind.
fn matches_name(name: &str, lens: &Lens) -> bool {
    Lens::from_name(name).is_ok_and(|known| known.name() == lens.name())
}

/// One lens of each kind, with realistic parameters.
fn sample_lenses() -> Vec<Lens> {
    vec![
        Lens::default(),
        OpenCv { k1: -0.24, k2: 0.08, p1: 0.0005, p2: -0.0003, ..OpenCv::default() }.into(),
        OpenCvFisheye { k1: -0.01, k2: 0.006, k3: -0.004, k4: 0.0006, max_angle: Some(1.6) }.into(),
        Equidistant { max_angle: 1.7 }.into(),
        Equisolid { max_angle: 1.7 }.into(),
        Orthographic { max_angle: 1.5 }.into(),
        Stereographic { max_angle: 1.7 }.into(),
        FTheta::default().into(),
        Panorama {}.into(),
    ]
}

/// Intrinsics that fit the image circle of a fisheye into the image, those of a full panorama, or a vertical field of
/// view of 75 degrees for pinholes.
fn fitted_intrinsics(lens: &Lens, width: usize, height: usize) -> launcher::Result<Intrinsics> {
    let Domain { radius, .. } = lens.domain()?;
    let (w, h) = (width as f64, height as f64);
    Ok(match lens {
        Lens::Panorama(_) => Panorama::intrinsics(width, height),
        Lens::Pinhole(_) | Lens::OpenCv(_) => Intrinsics::Fovy { radians: 75f64.to_radians() },
        _ => {
            let f = 0.49 * w.min(h) / radius;
            Intrinsics::Pixels { fx: f, fy: f, cx: 0.5 * w, cy: 0.5 * h }
        }
    })
}

/// One line of text about the report of a lens.
fn summary_line(report: &Value) -> String {
    let number = |name: &str| report[name].as_f64().unwrap_or(f64::NAN);
    let files: Vec<&str> = report["files"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    format!(
        "{}, {} x {} pixels, f = {:.1} x {:.1} pixels, up to {:.1} deg off the axis, {} pixels hit something, round trip \
         within {:.1e} pixels, {:.2} s; {}",
        report["lens"].as_str().unwrap_or_default(),
        report["width"],
        report["height"],
        number("fx"),
        number("fy"),
        number("largest_angle_deg"),
        report["pixels_that_hit"],
        number("round_trip_error_pixels"),
        number("seconds"),
        files.join(", ")
    )
}

/// Writes the images of a camera, and its calibration if ROS has a distortion model for the lens. Returns the color
/// image and its report.
fn write_images(camera: &Camera, name: &str, out: &Path) -> launcher::Result<(image::RgbImage, Value)> {
    let start = Instant::now();
    let (height, width) = camera.image_shape();
    let color: Vec<u8> = camera.color()?.index_axis(Axis(0), 0).iter().copied().collect();
    let seconds = start.elapsed().as_secs_f64();
    let size = [width, height];
    let image = image_file::color_image(size, &color);
    let mut files = vec![format!("{name}.png"), format!("{name}_distance.png")];
    image_file::write_png(&out.join(&files[0]), &image)?;
    let distance: Vec<f32> = camera.distance()?.index_axis(Axis(0), 0).iter().copied().collect();
    let range = image_file::finite_range(distance.iter().copied()).unwrap_or([0.0, 1.0]);
    image_file::write_png(&out.join(&files[1]), &image_file::depth_image(size, &distance, range))?;
    if let Ok(info) = camera.camera_info(name, 0) {
        files.push(format!("{name}.yaml"));
        info.write(out.join(format!("{name}.yaml")))?;
    }
    let optics = camera.optics(0)?;
    let (f, domain) = (optics.pixels(), optics.domain());
    let hits = camera.mask()?.index_axis(Axis(0), 0).iter().filter(|&&id| id != 0).count();
    let report = json!({
        "lens": camera.lens().name(),
        "parameters": camera.lens(),
        "width": width,
        "height": height,
        "fx": f.fx,
        "fy": f.fy,
        "cx": f.cx,
        "cy": f.cy,
        "largest_angle_deg": domain.angle.to_degrees(),
        "pixels_that_hit": hits,
        "round_trip_error_pixels": reprojection_error(camera)?,
        "seconds": seconds,
        "files": files,
    });
    Ok((image, report))
}

/// The largest reprojection error of the point map of environment 0 through the lens \[pixels\].
fn reprojection_error(camera: &Camera) -> launcher::Result<f64> {
    let (map, optics) = (camera.point_map(0, PointFrame::Camera)?, camera.optics(0)?);
    let mut worst = 0.0f64;
    for ((y, x), point) in map.rows().into_iter().enumerate().map(|(k, p)| ((k / map.dim().1, k % map.dim().1), p)) {
        if point[0].is_finite() {
            let [u, v] = optics.project([0, 1, 2].map(|k| f64::from(point[k]))).ok_or("a point has no projection")?;
            worst = worst.max((u - x as f64 - 0.5).hypot(v - y as f64 - 0.5));
        }
    }
    Ok(worst)
}
