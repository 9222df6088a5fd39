//! `kinetoscope render`: renders an image of a model in its initial state.

use crate::channel_image::{self, Channel};
use crate::command_status::{CommandStatus, Result};
use crate::model::{Files, ModelArgs, Setup};
use crate::progress;
use clap::ValueEnum;
use kinetoscope::exec::ThreadPool;
use kinetoscope::prelude::*;
use kinetoscope::render::View;
use kinetoscope::render::frame::Frame;
use kinetoscope::render::{ParallelRenderer, RenderRequest};
use kinetoscope::scene::PoseF32;
use kinetoscope::sensors::camera::look_at_pose;
use kinetoscope::sim::{Error, OffscreenScene};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Render an image of a model in its initial state
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    model: ModelArgs,
    /// Output file, as PNG
    #[arg(short, long, value_name = "FILE.png")]
    out: PathBuf,
    /// Image channel to write
    #[arg(long, value_enum, default_value_t = Channel::Color)]
    channel: Channel,
    #[command(flatten)]
    look: RenderArgs,
}

/// Camera and renderer settings.
#[derive(Debug, clap::Args)]
pub(crate) struct RenderArgs {
    /// Name of a camera in the MJCF file; without it and --eye, the image shows the whole model
    #[arg(long, conflicts_with_all = ["eye", "target"])]
    camera: Option<String>,
    /// Camera position in the world, in meters
    #[arg(long, value_name = "X,Y,Z", requires = "target", value_parser = parse_point, allow_hyphen_values = true)]
    eye: Option<Point>,
    /// Point in the world that the camera looks at, in meters
    #[arg(long, value_name = "X,Y,Z", requires = "eye", value_parser = parse_point, allow_hyphen_values = true)]
    target: Option<Point>,
    /// Vertical field of view, in degrees [default: that of --camera or of the MJCF file; 45 with --eye and for other
    /// files]
    #[arg(long)]
    fovy: Option<f64>,
    /// Image width, in pixels
    #[arg(long, default_value_t = 1280)]
    width: usize,
    /// Image height, in pixels
    #[arg(long, default_value_t = 720)]
    height: usize,
    /// Rendering method
    #[arg(long, value_enum, default_value_t = RenderMethod::Raster)]
    renderer: RenderMethod,
    /// Paths per pixel, with --renderer rt [default: 64]
    #[arg(long)]
    samples: Option<u32>,
}

/// Rendering method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum RenderMethod {
    /// Rasterizer
    Raster,
    /// Rasterizer with ray-traced shadows
    Hybrid,
    /// Ray-traced visibility; light and shadows as with raster
    FastRt,
    /// Path tracing
    Rt,
}

#[derive(Clone, Copy, Debug)]
struct Point([f64; 3]);

fn parse_point(text: &str) -> std::result::Result<Point, String> {
    let numbers: Vec<f64> = text.split(',').map(|n| n.trim().parse().unwrap_or(f64::NAN)).collect();
    match numbers[..] {
        [x, y, z] if numbers.iter().all(|n| n.is_finite()) => Ok(Point([x, y, z])),
        _ => Err("expected three numbers separated by commas, such as 1.5,-2,1".into()),
    }
}

const HELP: &str = "\
Examples:
  kinetoscope render arm.urdf -o arm.png
  kinetoscope render humanoid.xml -o depth.png --channel depth --eye 2,-1,1.5 --target 0,0,1
  kinetoscope render humanoid.xml -o out.png --renderer rt --samples 256

Exit codes: 0 done; 1 done, with warnings (something was repaired, ignored or missing); 2 refused.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    let (still, mut warned) = match args.model.files()? {
        Files::Mjcf(path) => {
            args.model.refuse_floating_base(&path)?;
            (load_mjcf(&path)?, false)
        }
        Files::Urdf(_) | Files::Scene(_) => {
            let mut model = args.model.build(&Setup::STATIC)?;
            (OffscreenScene::of_env(&mut model.sim, EnvId(0))?, model.print_warnings())
        }
    };
    for left_out in still.visible().omitted() {
        eprintln!("warning: {left_out}");
        warned = true;
    }
    let view = args.look.view(&still)?;
    let channels = Channels { color: true, depth: true, mask: true, normal: true, ..Channels::default() };
    let mut frame = Frame::new(view.width, view.height, channels);
    let start = Instant::now();
    let mut rasterizer = args.look.rasterizer()?;
    let progress = rasterizer.progress().clone();
    let mut job = [(still.render_request(&view), frame.as_mut())];
    progress::with_progress("paths", || progress.fraction(), || rasterizer.render(&mut job))
        .map_err(|(_, error)| error)?;
    let seconds = start.elapsed().as_secs_f64();
    if !warned && frame.mask.iter().flatten().all(|id| *id == 0) {
        eprintln!("warning: the image shows only the background: no visible shape is in view");
        warned = true;
    }
    channel_image::write(&frame, args.channel, [view.width, view.height], &args.out)?;
    println!("{}: {} x {} pixels in {:.1} ms", args.out.display(), view.width, view.height, 1e3 * seconds);
    Ok(if warned { CommandStatus::Warned } else { CommandStatus::Done })
}

/// Loads a model from an MJCF file. Errors of the compiler get the file and the line that MuJoCo reports. With included
/// files the line is omitted, because MuJoCo does not report to which file it belongs.
fn load_mjcf(path: &Path) -> Result<OffscreenScene> {
    OffscreenScene::of_mjcf(path, None).map_err(|error| {
        let line = if let Error::Compile(refused) = &error { refused.line } else { None };
        let is_of_it = || std::fs::read_to_string(path).is_ok_and(|text| !text.contains("<include"));
        match line.filter(|_| is_of_it()) {
            Some(line) => format!("{}:{line}: {error}", path.display()).into(),
            None => error.into(),
        }
    })
}

impl RenderArgs {
    /// Returns the camera view of a model.
    ///
    /// # Errors
    /// The file has no camera of the given name, or a size, a point or an angle is invalid.
    pub(crate) fn view(&self, still: &OffscreenScene) -> Result<View> {
        let free = still.first_view([self.width, self.height]);
        let (pose, fovy) = match (&self.camera, self.eye, self.target) {
            (Some(name), ..) => {
                let camera = still.camera(name)?;
                (camera.world_from_camera, camera.fovy)
            }
            (None, Some(eye), Some(target)) => (look_at_pose(eye.0, target.0, [0.0, 0.0, 1.0])?, 45f64.to_radians()),
            _ => (look_at_pose(free.eye, free.target, [0.0, 0.0, 1.0])?, free.fovy),
        };
        let radians = self.fovy.map_or(fovy, f64::to_radians);
        let pixels = Intrinsics::Fovy { radians }.to_pixels(self.width, self.height)?;
        let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
        let [near, far] = free.clip.map(|x| x as f32);
        let (width, height, world_from_camera) = (self.width, self.height, PoseF32::from(&pose));
        let view = View { parallel: false, width, height, fx, fy, cx, cy, near, far, world_from_camera };
        view.validate()?;
        Ok(view)
    }

    /// Creates the renderer, with a thread per core.
    ///
    /// # Errors
    /// An invalid number of paths, or any number of paths without path tracing.
    pub(crate) fn rasterizer(&self) -> Result<ParallelRenderer> {
        if let Some(samples) = self.samples.filter(|_| self.renderer != RenderMethod::Rt) {
            return Err(format!("--samples {samples} requires --renderer rt").into());
        }
        let renderer = match self.renderer {
            RenderMethod::Raster => Renderer::Raster,
            RenderMethod::Hybrid => Renderer::Hybrid,
            RenderMethod::FastRt => Renderer::FastRayTraced,
            RenderMethod::Rt => {
                Renderer::RayTraced { samples: self.samples.unwrap_or(64), max_bounces: 4, denoise: true, seed: 0 }
            }
        };
        renderer.validate()?;
        let threads = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
        let cfg = RasterCfg { samples: 4, ..RasterCfg::default() };
        let mut rasterizer = ParallelRenderer::new(cfg, threads).with_pool(ThreadPool::new());
        rasterizer.set_renderer(renderer);
        Ok(rasterizer)
    }
}

/// Renders the same image repeatedly for some seconds. Returns images per second.
///
/// # Errors
/// Rendering failed.
pub(crate) fn images_per_second(
    rasterizer: &mut ParallelRenderer,
    request: RenderRequest<'_>,
    seconds: f64,
) -> Result<f64> {
    let channels = Channels { color: true, depth: true, mask: true, normal: true, ..Channels::default() };
    let mut frame = Frame::new(request.view.width, request.view.height, channels);
    let (start, mut images) = (Instant::now(), 0u32);
    let draw = || loop {
        rasterizer.render(&mut [(request, frame.as_mut())]).map_err(|(_, error)| error)?;
        images += 1;
        let elapsed = start.elapsed().as_secs_f64();
        if elapsed >= seconds {
            return Ok(f64::from(images) / elapsed);
        }
    };
    progress::with_progress("images", move || Some(start.elapsed().as_secs_f64() / seconds), draw)
}
