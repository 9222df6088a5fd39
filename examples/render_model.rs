//! One image of any MJCF or URDF file, in four channels.
//!
//! ```text
//! cargo run --release --example render_model -- /usr/share/mujoco/model/humanoid/humanoid.xml --out images
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::{Parser, ValueEnum};
use kinetoscope::ndarray::{Array2, ArrayView2, ArrayView3};
use kinetoscope::prelude::*;
use kinetoscope::render::View;
use kinetoscope::render::frame::Frame;
use kinetoscope::render::{ParallelRenderer, Renderer as Known};
use kinetoscope::scene::PoseF32;
use kinetoscope::scene::pose::to_row;
use kinetoscope::sensors::camera::{CameraConvention, look_at_pose};
use kinetoscope::sim::OffscreenScene;
use launcher::live_view::LiveViewFlags;
use launcher::{PathFlags, Renderer, image_file, render_progress};
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Renders color, depth, mask and normals of a model at its initial state.
#[derive(Debug, Parser)]
#[command(name = "render_model")]
struct Args {
    /// MJCF or URDF file
    #[arg(value_name = "FILE.xml|FILE.urdf")]
    file: PathBuf,
    /// Positions [rad or m], separated by commas: all of MuJoCo's qpos for an MJCF file, one for each joint for a URDF
    /// file
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true)]
    qpos: Option<Vec<f64>>,
    /// Name of a camera in the file
    #[arg(long, conflicts_with_all = ["eye", "target"])]
    camera: Option<String>,
    /// Position of the camera in the world: x,y,z in meters
    #[arg(long, requires = "target", value_parser = point, allow_hyphen_values = true)]
    eye: Option<Point>,
    /// Point in the world that the camera looks at: x,y,z in meters
    #[arg(long, requires = "eye", value_parser = point, allow_hyphen_values = true)]
    target: Option<Point>,
    /// Vertical field of view, in degrees [default: that of --camera or of the MJCF file; 45 with --eye and for other
    /// files]
    #[arg(long)]
    fovy: Option<f64>,
    /// Width of the image, in pixels
    #[arg(long, default_value_t = 640)]
    width: usize,
    /// Height of the image, in pixels
    #[arg(long, default_value_t = 480)]
    height: usize,
    /// Render the shadows of lights
    #[arg(long, value_enum, default_value_t = Switch::On)]
    shadows: Switch,
    /// Samples per pixel of the color: 1 or 4
    #[arg(long, default_value_t = 4)]
    msaa: u8,
    /// Renderer of the image
    #[arg(long, value_enum, default_value_t = Renderer::Auto)]
    renderer: Renderer,
    #[command(flatten)]
    paths: PathFlags,
    /// Rays for ambient occlusion per sample, with --renderer hybrid; 0 for no ambient occlusion
    #[arg(long, default_value_t = 0)]
    ao_rays: u16,
    /// Time limit of --renderer rt, in seconds, after which the example ends with an error
    #[arg(long, value_name = "SECONDS")]
    time_limit: Option<f64>,
    /// Rendered geom groups, separated by commas; the default is that of MuJoCo's viewers
    #[arg(long, value_delimiter = ',', default_values_t = [0, 1, 2])]
    groups: Vec<u8>,
    /// Number of rendering threads [default: every core]
    #[arg(long)]
    threads: Option<usize>,
    /// Render repeatedly for this many seconds and report images per second
    #[arg(long)]
    bench: Option<f64>,
    /// Also render the color with the rasterizer, and write both side by side, for example raster-and-rt.png; requires
    /// --renderer rt, fast-rt or hybrid
    #[arg(long)]
    compare: bool,
    /// Folder for color.png, depth.png, mask.png, normal.png and meta.json
    #[arg(long, default_value = ".")]
    out: PathBuf,
    /// Also write color.npy, depth.npy, mask.npy and normal.npy
    #[arg(long)]
    raw: bool,
    #[command(flatten)]
    live: LiveViewFlags,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Switch {
    On,
    Off,
}

#[derive(Clone, Copy, Debug)]
struct Point([f64; 3]);

fn point(text: &str) -> std::result::Result<Point, String> {
    let numbers: Vec<f64> = text.split(',').map(|n| n.trim().parse().unwrap_or(f64::NAN)).collect();
    match numbers[..] {
        [x, y, z] if numbers.iter().all(|n| n.is_finite()) => Ok(Point([x, y, z])),
        _ => Err("expected three numbers separated by commas, such as 1.5,-2,1".into()),
    }
}

fn main() -> ExitCode {
    launcher::run("render_model", || run(&Args::parse()))
}

fn run(args: &Args) -> launcher::Result {
    let renderer = args.renderer.for_cameras(args.paths)?;
    if args.time_limit.is_some() && args.renderer != Renderer::Rt {
        return Err("--time-limit is for path tracing: use it with --renderer rt".into());
    }
    if args.compare && renderer == Known::Raster {
        return Err(
            "--compare puts the rasterizer beside another renderer: use it with --renderer rt, fast-rt or hybrid"
                .into(),
        );
    }
    let still = load(args)?;
    for left_out in still.visible().omitted() {
        eprintln!("warning: {left_out}");
    }
    let (view, pose, fovy) = view(args, &still)?;
    let cfg = RasterCfg {
        samples: args.msaa,
        shadows: args.shadows == Switch::On,
        occlusion_rays: args.ao_rays,
        groups: args.groups.iter().fold(0, |bits, group| bits | 1u32.checked_shl(u32::from(*group)).unwrap_or(0)),
        ..RasterCfg::default()
    };
    let threads = match args.threads {
        Some(threads @ 1..=1024) => threads,
        Some(threads) => return Err(format!("--threads {threads}: it must be 1 to 1024").into()),
        None => std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get),
    };
    let mut rasterizer = ParallelRenderer::new(cfg, threads).with_pool(kinetoscope::exec::ThreadPool::new());
    rasterizer.set_renderer(renderer);
    let channels = Channels { color: true, depth: true, mask: true, normal: true, ..Channels::default() };
    let mut frame = Frame::new(view.width, view.height, channels);
    let seconds = Duration::try_from_secs_f64(args.bench.unwrap_or(0.0)).map_err(|e| format!("--bench: {e}"))?;
    let limit =
        args.time_limit.map(Duration::try_from_secs_f64).transpose().map_err(|e| format!("--time-limit: {e}"))?;
    let (start, mut images) = (Instant::now(), 0u32);
    let progress = rasterizer.progress().clone();
    render_progress::render_with_progress(
        &progress,
        limit,
        |_| (),
        || {
            while images == 0 || start.elapsed() < seconds {
                let mut job = [(still.render_request(&view), frame.as_mut())];
                rasterizer.render(&mut job).map_err(|(_, error)| error)?;
                images += 1;
            }
            launcher::Result::Ok(())
        },
    )?;
    let rate = f64::from(images) / start.elapsed().as_secs_f64();

    launcher::make_folder(&args.out)?;
    write_images(args, &view, &frame)?;
    if args.compare {
        let mut raster = Frame::new(view.width, view.height, Channels { color: true, ..Channels::default() });
        rasterizer.set_cfg(RasterCfg { occlusion_rays: 0, ..cfg });
        rasterizer.set_renderer(Known::Raster);
        rasterizer.render(&mut [(still.render_request(&view), raster.as_mut())]).map_err(|(_, error)| error)?;
        let both = [&raster, &frame].map(|frame| frame.color.as_deref().unwrap_or_default());
        image_file::write_png(
            &args.out.join(format!("raster-and-{}.png", args.renderer.name())),
            &image_file::side_by_side([view.width, view.height], both),
        )?;
    }
    let meta = json!({
        "width": view.width,
        "height": view.height,
        "fx": view.fx,
        "fy": view.fy,
        "cx": view.cx,
        "cy": view.cy,
        "fovy_deg": fovy.to_degrees(),
        "pose": {
            "ros": to_row(&pose),
            "opengl": to_row(&CameraConvention::OpenGl.pose_from_optical(&pose)),
            "world": to_row(&CameraConvention::World.pose_from_optical(&pose)),
        },
        "ids": still.mask_ids().iter().map(|id| json!({
            "id": id.id, "object": id.object, "link": id.link, "class": id.class, "body": id.body, "geoms": id.geoms,
        })).collect::<Vec<_>>(),
        "triangles": still.visible().scene().triangle_count(),
        "renderer": renderer,
        "images_per_second": rate,
        "threads": threads,
    });
    let path = args.out.join("meta.json");
    std::fs::write(&path, serde_json::to_string_pretty(&meta)? + "\n")
        .map_err(|e| format!("{}: {e}", path.display()))?;
    println!("{images} images, {rate:.3} per second; written to {}", args.out.display());
    if args.live.wants_motion() {
        args.live.show(&mut simulation(args)?)?;
    }
    Ok(())
}

fn is_urdf(args: &Args) -> bool {
    args.file.extension().is_some_and(|e| e.eq_ignore_ascii_case("urdf"))
}

/// A simulation of the model.
fn simulation(args: &Args) -> launcher::Result<SimulationManager> {
    let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..Default::default() })?;
    let row = args.qpos.as_ref().map(|qpos| Array2::from_shape_vec((1, qpos.len()), qpos.clone())).transpose()?;
    if is_urdf(args) {
        let urdf = UrdfCfg::single(launcher::user_or_asset(&args.file)?);
        let robot = sim.add_robot(RobotCfg { urdf, ..Default::default() })?;
        row.map(|row| sim.robot_mut(robot).write_qpos(&row, None, None)).transpose()?;
    } else {
        let part = sim.add_mjcf(MjcfPartCfg::file("model", &args.file))?;
        row.map(|row| sim.mjcf_part_mut(part).write_qpos(&row, None)).transpose()?;
    }
    Ok(sim)
}

/// Loads the model for rendering. A URDF goes through the whole pipeline; MuJoCo reads any other file.
fn load(args: &Args) -> launcher::Result<OffscreenScene> {
    if !is_urdf(args) {
        return Ok(OffscreenScene::of_mjcf(&args.file, args.qpos.as_deref())?);
    }
    let mut sim = simulation(args)?;
    let still = OffscreenScene::of_env(&mut sim, EnvId(0))?;
    for diagnostic in sim.diagnostics() {
        eprintln!("warning: {diagnostic}");
    }
    Ok(still)
}

/// The render view, the pose of its optical frame, and its vertical field of view \[rad\].
fn view(args: &Args, still: &OffscreenScene) -> launcher::Result<(View, Pose, f64)> {
    let free = still.first_view([args.width, args.height]);
    let (pose, own_fovy) = match (&args.camera, args.eye, args.target) {
        (Some(name), ..) => {
            let camera = still.camera(name)?;
            (camera.world_from_camera, camera.fovy)
        }
        (None, Some(eye), Some(target)) => (look_at_pose(eye.0, target.0, [0.0, 0.0, 1.0])?, 45f64.to_radians()),
        _ => (look_at_pose(free.eye, free.target, [0.0, 0.0, 1.0])?, free.fovy),
    };
    let radians = args.fovy.map_or(own_fovy, f64::to_radians);
    let pixels = Intrinsics::Fovy { radians }.to_pixels(args.width, args.height)?;
    let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
    let [near, far] = free.clip.map(|x| x as f32);
    let (width, height, world_from_camera) = (args.width, args.height, PoseF32::from(&pose));
    let view = View { parallel: false, width, height, fx, fy, cx, cy, near, far, world_from_camera };
    view.validate()?;
    Ok((view, pose, radians))
}

fn write_images(args: &Args, view: &View, frame: &Frame) -> launcher::Result {
    let (Some(color), Some(depth), Some(mask), Some(normal)) = (&frame.color, &frame.depth, &frame.mask, &frame.normal)
    else {
        return Err("a channel was not rendered".into());
    };
    let size = [view.width, view.height];
    let range = image_file::finite_range(depth.iter().copied()).unwrap_or([0.0, 1.0]);
    let file = |name: &str| args.out.join(name);
    image_file::write_png(&file("color.png"), &image_file::color_image(size, color))?;
    image_file::write_png(&file("depth.png"), &image_file::depth_image(size, depth, range))?;
    image_file::write_png(&file("mask.png"), &image_file::mask_image(size, mask))?;
    image_file::write_png(&file("normal.png"), &image_file::normal_image(size, normal))?;
    if args.raw {
        let (w, h) = (view.width, view.height);
        image_file::write_npy(&file("color.npy"), &ArrayView3::from_shape((h, w, 4), color)?)?;
        image_file::write_npy(&file("depth.npy"), &ArrayView2::from_shape((h, w), depth)?)?;
        image_file::write_npy(&file("mask.npy"), &ArrayView2::from_shape((h, w), mask)?)?;
        image_file::write_npy(&file("normal.npy"), &ArrayView3::from_shape((h, w, 3), normal)?)?;
    }
    Ok(())
}
