//! Code shared by the examples: flags, Ctrl+C, the progress bar, the report, images.
#![allow(dead_code, reason = "each example uses its part")]

pub(crate) mod arm;
pub(crate) mod cloud;
pub(crate) mod grip;
pub(crate) mod image_file;
pub(crate) mod live_view;
pub(crate) mod motion;
pub(crate) mod panel;
mod recording;
pub(crate) mod render_progress;
pub(crate) mod spawn;
pub(crate) mod stage;
pub(crate) mod trial;
pub(crate) mod views;

use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use kinetoscope::prelude::*;
use kinetoscope::sim::Device;
use std::cell::Cell;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Errors end an example with a message and exit code 2.
pub(crate) type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Flags of every example; each is accepted with dashes and with underscores.
#[derive(Clone, Debug, Args)]
pub(crate) struct Launcher {
    /// Number of environments
    #[arg(long, alias = "num_envs", default_value_t = 1)]
    pub(crate) num_envs: usize,
    /// Maximum number of steps [default: until the task of the example is done, the window is closed, or Ctrl+C]
    #[arg(long)]
    pub(crate) steps: Option<u64>,
    /// Run without a window
    #[arg(long)]
    pub(crate) headless: bool,
    /// Also show the simulation in browsers, in real time until a viewer changes the speed; the address defaults to
    /// 127.0.0.1:8080. An address that other machines can reach (0.0.0.0:8080) requires the printed token
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = SERVE)]
    pub(crate) serve: Option<String>,
    /// Also stream all recorded topics to Foxglove, which connects to ws://127.0.0.1:8765 or to the given port; an address
    /// that other machines can reach (0.0.0.0:8765) requires the printed token. Build with --features foxglove
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "8765")]
    pub(crate) foxglove: Option<String>,
    /// Device of the physics: cpu; cuda or cuda:N for MuJoCo Warp on a GPU, which is experimental and needs the Python
    /// package; warp-cpu for the same without a GPU
    #[arg(long, value_name = "DEVICE", default_value_t = Device::Cpu)]
    pub(crate) device: Device,
    #[command(flatten)]
    elsewhere: CompatibilityFlags,
    /// Renderer of the cameras; some examples support only auto and raster
    #[arg(long, value_enum, default_value_t = Renderer::Auto)]
    pub(crate) renderer: Renderer,
    /// Distance between environments in the overview, in meters [default: chosen by the example]
    #[arg(long, alias = "arena_space")]
    pub(crate) arena_space: Option<f64>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Number of threads that step the environments [default: every core]
    #[arg(long)]
    pub(crate) threads: Option<usize>,
    /// Folder for images [default: the working directory in examples that always write images; no images in others]
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    /// Folder for every stage of the pipeline: merged URDF, description, MJCF for both supported MuJoCo versions,
    /// meshes
    #[arg(long)]
    pub(crate) dump: Option<PathBuf>,
    /// File for the report, as JSON
    #[arg(long)]
    pub(crate) report: Option<PathBuf>,
    /// File to record everything to: .mcap for Foxglove and Rerun, .npz for NumPy, .lerobot for a LeRobot dataset
    /// (build with --features lerobot); .mp4 or .gif for the first camera, or for all environments side by side if the
    /// scene has no camera; a folder for PNG files of all cameras. Recording starts at once; without the flag, the
    /// record button of window and browser records to recording.mcap in the folder of --out
    #[arg(long, value_name = "FILE")]
    pub(crate) record: Option<PathBuf>,
    /// Image source of an animation of --record: `stage` for all environments side by side, or the name of a camera (of
    /// environment 0). Other formats record every camera, and with `stage` also all environments side by side
    #[arg(long, alias = "record_view", value_name = "NAME", requires = "record")]
    pub(crate) record_view: Option<String>,
    /// Replace the file of --record, and the partial file of an interrupted recording
    #[arg(long, requires = "record")]
    pub(crate) overwrite: bool,
    /// Physics steps from one recorded row of states to the next; sensors are recorded whenever they measure
    #[arg(long, value_name = "STEPS", default_value_t = 1)]
    pub(crate) record_every: u64,
    /// Recording period of single streams in physics steps: NAME=STEPS, where NAME is as in the file, such as
    /// arm/link_poses=10, or a prefix of it, such as camera=30
    #[arg(long, value_name = "NAME=STEPS,...", value_delimiter = ',', value_parser = rate)]
    pub(crate) record_rate: Vec<(String, u64)>,
    /// The recording shared by `--record` and the record buttons, created on first use.
    #[cfg(all(feature = "record", feature = "viewer"))]
    #[arg(skip)]
    files: std::sync::OnceLock<Arc<std::sync::Mutex<kinetoscope::FileRecording>>>,
    /// The window, once it is open; clones share it.
    #[arg(skip)]
    window: views::SharedWindow,
}

fn rate(text: &str) -> std::result::Result<(String, u64), String> {
    let (name, steps) = text.rsplit_once('=').ok_or("write NAME=STEPS, such as camera=30")?;
    let steps = steps.trim().parse().map_err(|_| format!("{steps:?} is not a number of steps"))?;
    Ok((name.trim().to_owned(), steps))
}

/// Flags of EmbodiChain's and Isaac Lab's launchers, accepted so that their command lines run here.
#[derive(Clone, Debug, Args)]
struct CompatibilityFlags {
    /// GPU number; without effect here
    #[arg(long = "gpu-id", alias = "gpu_id", value_name = "N", hide = true)]
    gpu_id: Option<u32>,
    /// Isaac Lab's streaming: 1 and 2 are --serve here, 0 turns it off
    #[arg(long, value_name = "MODE", hide = true, value_parser = clap::value_parser!(u8).range(0..=2), conflicts_with = "serve")]
    livestream: Option<u8>,
    /// Isaac Lab's switch for cameras; without effect here
    #[arg(long = "enable-cameras", alias = "enable_cameras", hide = true)]
    enable_cameras: bool,
    /// Isaac Lab's switch for cameras without a window; without effect here
    #[arg(long = "offscreen-render", alias = "offscreen_render", hide = true)]
    offscreen_render: bool,
}

impl CompatibilityFlags {
    /// One line for each given flag without effect here, with the reason.
    fn notes(&self) -> Vec<String> {
        let cameras = "cameras render on the CPU, with or without a window";
        let flags = [
            (
                self.gpu_id.is_some(),
                "--gpu-id",
                "--device cuda:N chooses the GPU of the physics, and cameras run on the CPU",
            ),
            (self.enable_cameras, "--enable-cameras", cameras),
            (self.offscreen_render, "--offscreen-render", cameras),
        ];
        let given = flags.iter().filter(|(given, ..)| *given);
        given.map(|(_, flag, reason)| format!("note: {flag} has no effect here: {reason}")).collect()
    }
}

/// Renderer of the images. Examples without a camera accept every name so that scripts run; examples with a fixed
/// renderer refuse the others ([`Launcher::simulation`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Renderer {
    /// The default of the example
    Auto,
    /// Rasterizer
    Raster,
    /// Rasterizer with ray-traced shadows
    Hybrid,
    /// Ray-traced visibility, with the lighting and shadows of the rasterizer
    FastRt,
    /// Path tracing
    Rt,
}

/// Flags of path tracing, for examples that draw with it.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct PathFlags {
    /// Path tracing: paths per pixel [default: 64]
    #[arg(long, alias = "rt_samples", value_name = "PATHS")]
    pub(crate) rt_samples: Option<u32>,
    /// Path tracing: maximum number of bounces after the first hit [default: 4]
    #[arg(long, alias = "rt_bounces", value_name = "BOUNCES")]
    pub(crate) rt_bounces: Option<u32>,
    /// Path tracing: leave out the denoiser
    #[arg(long, alias = "rt_noisy")]
    pub(crate) rt_noisy: bool,
}

impl Renderer {
    /// The name of the flag's value.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// The renderer of the cameras.
    ///
    /// # Errors
    /// The number of paths or bounces is out of range, or the path tracing flags are given for another renderer.
    pub(crate) fn for_cameras(self, flags: PathFlags) -> Result<kinetoscope::render::Renderer> {
        use kinetoscope::render::Renderer as Known;
        let PathFlags { rt_samples, rt_bounces, rt_noisy } = flags;
        if self != Self::Rt && (rt_samples.is_some() || rt_bounces.is_some() || rt_noisy) {
            return Err(
                "--rt-samples, --rt-bounces and --rt-noisy are for path tracing: use them with --renderer rt".into()
            );
        }
        let renderer = match self {
            Self::Auto | Self::Raster => Known::Raster,
            Self::Hybrid => Known::Hybrid,
            Self::FastRt => Known::FastRayTraced,
            Self::Rt => Known::RayTraced {
                samples: rt_samples.unwrap_or(64),
                max_bounces: rt_bounces.unwrap_or(4),
                denoise: !rt_noisy,
                seed: 0,
            },
        };
        renderer.validate()?;
        Ok(renderer)
    }
}

/// Address of `--serve` without a value, and of `--livestream`.
const SERVE: &str = "127.0.0.1:8080";

impl Launcher {
    /// The address of the browser view, if `--serve` or `--livestream` is given.
    pub(crate) fn serve_address(&self) -> Option<&str> {
        let streamed = self.elsewhere.livestream.is_some_and(|mode| mode > 0).then_some(SERVE);
        self.serve.as_deref().or(streamed)
    }

    /// The simulation of these flags, for an example that renders with the rasterizer or has no camera.
    ///
    /// # Errors
    /// Another renderer is requested.
    pub(crate) fn simulation(&self) -> Result<SimulationManagerCfg> {
        if !matches!(self.renderer, Renderer::Auto | Renderer::Raster) {
            let name = self.renderer.name();
            return Err(format!(
                "--renderer {name} is not for this example: use --renderer raster or auto here, or create_sensor, stereo, \
                 fisheye, surfaces or render_model, which also support ray tracing"
            )
            .into());
        }
        Ok(self.simulation_for_any_renderer())
    }

    /// The simulation of these flags, for an example that supports every renderer or accepts every name.
    pub(crate) fn simulation_for_any_renderer(&self) -> SimulationManagerCfg {
        self.elsewhere.notes().iter().for_each(|note| println!("{note}"));
        SimulationManagerCfg {
            num_envs: self.num_envs,
            device: self.device,
            seed: self.seed,
            threads: self.threads,
            ..Default::default()
        }
    }

    /// Writes every stage of the pipeline to the folder of `--dump`; prints a warning for each item that is left out.
    ///
    /// # Errors
    /// A file cannot be written.
    pub(crate) fn write_dump(&self, sim: &SimulationManager) -> Result {
        let Some(dir) = &self.dump else { return Ok(()) };
        for left_out in sim.dump(dir)? {
            eprintln!("warning: {left_out}");
        }
        println!("Pipeline stages written to {}", dir.display());
        Ok(())
    }

    /// The folder of `--out`, otherwise the working directory. Creates the folder if `create` is true.
    ///
    /// # Errors
    /// The folder cannot be created.
    pub(crate) fn out_folder(&self, create: bool) -> Result<PathBuf> {
        let out = self.out.clone().unwrap_or_else(|| ".".into());
        if create {
            make_folder(&out)?;
        }
        Ok(out)
    }

    /// Writes `report` to the file of `--report`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn write_report(&self, report: &serde_json::Value) -> Result {
        let Some(path) = &self.report else { return Ok(()) };
        let text = serde_json::to_string_pretty(report)? + "\n";
        std::fs::write(path, text).map_err(|e| format!("--report {}: {e}", path.display()))?;
        println!("Report written to {}", path.display());
        Ok(())
    }
}

/// The path of an existing file, otherwise the bundled asset of that name.
///
/// # Errors
/// The path is neither a file nor an asset.
pub(crate) fn user_or_asset(path: &Path) -> Result<PathBuf> {
    if path.exists() { Ok(path.to_path_buf()) } else { Ok(assets::path(path)?) }
}

/// Creates the folder of `--out`.
///
/// # Errors
/// The folder cannot be created.
pub(crate) fn make_folder(out: &Path) -> Result {
    std::fs::create_dir_all(out).map_err(|e| format!("--out {}: {e}", out.display()).into())
}

/// Checks the environment number of `--camera-id`.
///
/// # Errors
/// The number is not below the number of environments.
pub(crate) fn check_camera_id(camera_id: usize, sim: &SimulationManager) -> Result {
    let n = sim.num_envs();
    if camera_id < n {
        Ok(())
    } else {
        Err(format!("--camera-id {camera_id}: there are {n} environments, from 0").into())
    }
}

/// Position of the tutorial's camera in each environment \[m\]: two places in alternation.
pub(crate) fn alternating_eyes(num_envs: usize) -> Vec<[f64; 3]> {
    (0..num_envs).map(|env| if env % 2 == 0 { [2.5, 2.5, 2.5] } else { [-2.5, -2.5, 2.5] }).collect()
}

/// Prints events of the libraries to the standard error stream. `RUST_LOG` selects them (`RUST_LOG=kinetoscope_sim=info`);
/// without it, only errors are printed.
pub(crate) fn print_events() {
    use std::io::IsTerminal as _;
    use tracing_subscriber::EnvFilter;
    use tracing_subscriber::filter::LevelFilter;
    let filter = EnvFilter::builder().with_default_directive(LevelFilter::ERROR.into()).from_env_lossy();
    let ansi = std::io::stderr().is_terminal();
    tracing_subscriber::fmt().with_env_filter(filter).with_ansi(ansi).with_writer(std::io::stderr).init();
}

/// Runs an example. An error is printed and gives exit code 2.
pub(crate) fn run(name: &str, example: impl FnOnce() -> Result) -> ExitCode {
    print_events();
    match example() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{name}: {error}");
            ExitCode::from(2)
        }
    }
}

/// Stop request of the user: Ctrl+C, or the window closed.
#[derive(Clone, Debug, Default)]
pub(crate) struct StopRequest {
    interrupted: Arc<AtomicBool>,
    window: views::SharedWindow,
}

impl StopRequest {
    /// True if Ctrl+C was pressed or the window was closed.
    pub(crate) fn is_set(&self) -> bool {
        self.interrupted.load(Ordering::SeqCst) || self.window.is_closed()
    }
}

/// Control of the main loop: progress bar, step limit, Ctrl+C and the closing of the window.
#[derive(Debug)]
pub(crate) struct MainLoop {
    bar: ProgressBar,
    steps: Option<u64>,
    end: StopRequest,
    start: Instant,
    /// Time of the last progress line, for runs without a terminal.
    last_line: Cell<Instant>,
}

/// Interval of progress lines without a terminal.
pub(crate) const LINE_INTERVAL: Duration = Duration::from_secs(10);

impl MainLoop {
    /// Starts the clock and handles Ctrl+C from now on. `cycle` is the length of the bar if the number of steps is
    /// open.
    pub(crate) fn new(launcher: &Launcher, cycle: u64) -> Self {
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interrupted);
        // A second Ctrl+C ends the program at once, in case the report hangs on a slow disk. Some programs send the
        // signal twice, to the process and to its group: a repetition within a second counts as the same Ctrl+C.
        let mut first: Option<Instant> = None;
        let handler = ctrlc::set_handler(move || {
            flag.store(true, Ordering::SeqCst);
            views::release_pause();
            if first.get_or_insert_with(Instant::now).elapsed() > Duration::from_secs(1) {
                std::process::exit(130);
            }
        });
        if let Err(error) = handler {
            eprintln!("warning: Ctrl+C will end the example without a report: {error}");
        }
        let bar = ProgressBar::new(launcher.steps.unwrap_or(cycle));
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} steps  {per_sec}") {
            bar.set_style(style);
        }
        let start = Instant::now();
        let end = StopRequest { interrupted, window: launcher.window.clone() };
        Self { bar, steps: launcher.steps, end, start, last_line: Cell::new(start) }
    }

    /// True if Ctrl+C was pressed, the window was closed or all steps are done.
    pub(crate) fn should_stop(&self, step: u64) -> bool {
        self.end.is_set() || self.steps.is_some_and(|steps| step >= steps)
    }

    /// The stop request, for other threads.
    pub(crate) fn stop_request(&self) -> StopRequest {
        self.end.clone()
    }

    /// Number of steps at the end of a block of at most `length` steps after `step`; the block ends at `--steps`.
    pub(crate) fn end_of_block(&self, step: u64, length: u64) -> u64 {
        (step + length).min(self.steps.unwrap_or(u64::MAX))
    }

    /// Prints a line above the bar.
    pub(crate) fn print_line(&self, message: &str) {
        // Without a terminal the bar is hidden and would swallow the line.
        if std::io::stderr().is_terminal() { self.bar.suspend(|| println!("{message}")) } else { println!("{message}") }
    }

    /// Moves the bar. Without a terminal, prints a progress line every ten seconds.
    pub(crate) fn advance(&self, step: u64) {
        if self.bar.is_hidden() && self.last_line.get().elapsed() >= LINE_INTERVAL {
            self.last_line.set(Instant::now());
            let of = self.steps.map_or_else(String::new, |steps| format!(" of {steps}"));
            eprintln!("step {step}{of}, after {} s", self.start.elapsed().as_secs());
        }
        if self.steps.is_none() && step > self.bar.length().unwrap_or(0) {
            self.bar.set_length(step);
        }
        self.bar.set_position(step);
    }

    /// Finishes the bar; returns `steps` of all environments per second of time since [`new`](Self::new).
    pub(crate) fn env_steps_per_second(&self, steps: u64, num_envs: usize) -> f64 {
        let seconds = self.start.elapsed().as_secs_f64();
        self.bar.finish_and_clear();
        steps as f64 * num_envs as f64 / seconds.max(1e-9)
    }
}
