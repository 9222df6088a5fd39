//! What every example shares: flags, Ctrl+C, the progress bar, the report, pictures.
#![allow(dead_code, reason = "each example uses its part")]

pub(crate) mod arm;
pub(crate) mod cloud;
pub(crate) mod curve;
pub(crate) mod grip;
pub(crate) mod motion;
pub(crate) mod npy;
pub(crate) mod panel;
pub(crate) mod picture;
mod recording;
pub(crate) mod spawn;
pub(crate) mod stage;
pub(crate) mod still;
pub(crate) mod trial;
pub(crate) mod views;
pub(crate) mod waiting;

use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use kinetoscope::prelude::*;
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
    /// Number of steps; without it the example runs until Ctrl+C
    #[arg(long)]
    pub(crate) steps: Option<u64>,
    /// Run without a window
    #[arg(long)]
    pub(crate) headless: bool,
    /// Show the simulation in browsers, in real time until a viewer says otherwise; at 127.0.0.1:8080 where no address is
    /// given. An address that other machines reach (0.0.0.0:8080) needs the token that is printed
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = SERVE)]
    pub(crate) serve: Option<String>,
    /// Device of the physics: cpu (cuda and cuda:N are named in the answer, and refused)
    #[arg(long, value_name = "DEVICE", default_value = "cpu", value_parser = device)]
    pub(crate) device: Device,
    #[command(flatten)]
    elsewhere: FlagsFromElsewhere,
    /// How images are drawn
    #[arg(long, value_enum, default_value_t = Renderer::Auto)]
    pub(crate) renderer: Renderer,
    /// Distance of environments in the overview, in metres
    #[arg(long, alias = "arena_space")]
    pub(crate) arena_space: Option<f64>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Threads that step; every core by default
    #[arg(long)]
    pub(crate) threads: Option<usize>,
    /// Folder for pictures
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    /// Folder for every stage of the pipeline: merged URDF, description, MJCF for both MuJoCo lines, meshes
    #[arg(long)]
    pub(crate) dump: Option<PathBuf>,
    /// File for the report, as JSON
    #[arg(long)]
    pub(crate) report: Option<PathBuf>,
    /// File to record everything to: .mcap for Foxglove and Rerun, .npz for NumPy, .lerobot for a LeRobot dataset, .hdf5 for
    /// robomimic (build with --features hdf5); .mp4, .gif, .webp or .apng for the first camera, or the stage where there is none; a
    /// folder for PNG files of all cameras; from the start, where without it the record button of window and browser begins a recording.mcap
    #[arg(long, value_name = "FILE")]
    pub(crate) record: Option<PathBuf>,
    /// What a film of --record shows: `stage` for all environments side by side, or the name of a camera (of environment 0). Other
    /// files have every camera, and the stage too where it is named
    #[arg(long, alias = "record_view", value_name = "NAME", requires = "record")]
    pub(crate) record_view: Option<String>,
    /// Replace the file of --record, and what a recording that was killed has left
    #[arg(long, requires = "record")]
    pub(crate) overwrite: bool,
    /// Physics steps from one recorded row of states to the next
    #[arg(long, value_name = "STEPS", default_value_t = 1)]
    pub(crate) record_every: u64,
    /// The same for what has a rate of its own: NAME=STEPS, where NAME is as in the file, such as arm/link_poses=10 or camera=30
    #[arg(long, value_name = "NAME=STEPS,...", value_delimiter = ',', value_parser = rate)]
    pub(crate) record_rate: Vec<(String, u64)>,
    /// What records: made when somebody first asks.
    #[cfg(all(feature = "record", feature = "viewer"))]
    #[arg(skip)]
    files: std::sync::OnceLock<Arc<std::sync::Mutex<kinetoscope::FileRecording>>>,
    /// The window, once it is open; clones share it.
    #[arg(skip)]
    window: views::Shown,
}

fn rate(text: &str) -> std::result::Result<(String, u64), String> {
    let (name, steps) = text.rsplit_once('=').ok_or("write NAME=STEPS, such as camera=30")?;
    let steps = steps.trim().parse().map_err(|_| format!("{steps:?} is no number of steps"))?;
    Ok((name.trim().to_owned(), steps))
}

/// Where physics runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Device {
    /// This machine's processor.
    Cpu,
    /// A graphics card, by the name that was given (not supported).
    Cuda(String),
}

fn device(text: &str) -> std::result::Result<Device, String> {
    let is_card =
        |number: &str| number.is_empty() || number.strip_prefix(':').is_some_and(|n| n.parse::<u32>().is_ok());
    match text {
        "cpu" => Ok(Device::Cpu),
        _ if text.strip_prefix("cuda").is_some_and(is_card) => Ok(Device::Cuda(text.into())),
        _ => Err("the devices are cpu, cuda and cuda:N, and physics runs on cpu only".into()),
    }
}

/// Flags of EmbodiChain's and Isaac Lab's launchers, so that their command lines run here.
#[derive(Clone, Debug, Args)]
struct FlagsFromElsewhere {
    /// Number of a graphics card; without effect here
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

impl FlagsFromElsewhere {
    /// One line for each flag that was given and has no effect here, with the reason.
    fn notes(&self) -> Vec<String> {
        let cameras = "cameras draw on the CPU, with or without a window";
        let flags = [
            (self.gpu_id.is_some(), "--gpu-id", "physics and cameras run on the CPU; --threads chooses how many cores"),
            (self.enable_cameras, "--enable-cameras", cameras),
            (self.offscreen_render, "--offscreen-render", cameras),
        ];
        let given = flags.iter().filter(|(given, ..)| *given);
        given.map(|(_, flag, reason)| format!("note: {flag} has no effect here: {reason}")).collect()
    }
}

/// How images are drawn; examples without a camera accept the names so that scripts run, and those whose cameras draw in one way
/// only refuse the others ([`Launcher::simulation`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Renderer {
    /// The default
    Auto,
    /// Rasterizer
    Raster,
    /// Rasterizer with shadows by rays
    Hybrid,
    /// What is seen by rays, light and shadows as the rasterizer has them
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
    /// Path tracing: surfaces that light goes over after the one that is seen, at most [default: 4]
    #[arg(long, alias = "rt_bounces", value_name = "BOUNCES")]
    pub(crate) rt_bounces: Option<u32>,
    /// Path tracing: leave the noise as it is
    #[arg(long, alias = "rt_noisy")]
    pub(crate) rt_noisy: bool,
}

impl Renderer {
    /// What the flag calls it.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// What cameras call it.
    ///
    /// # Errors
    /// Numbers of paths or bounces that are not possible, or any without path tracing.
    pub(crate) fn of_cameras(self, flags: PathFlags) -> Result<kinetoscope::render::Renderer> {
        use kinetoscope::render::Renderer as Known;
        let PathFlags { rt_samples, rt_bounces, rt_noisy } = flags;
        if self != Self::Rt && (rt_samples.is_some() || rt_bounces.is_some() || rt_noisy) {
            return Err(
                "--rt-samples, --rt-bounces and --rt-noisy are of path tracing: use them with --renderer rt".into()
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
    /// Address at which browsers see the simulation, where `--serve` or `--livestream` asks for it.
    pub(crate) fn serve_address(&self) -> Option<&str> {
        let streamed = self.elsewhere.livestream.is_some_and(|mode| mode > 0).then_some(SERVE);
        self.serve.as_deref().or(streamed)
    }

    /// The simulation these flags ask for, of an example that draws with the rasterizer or not with a camera.
    ///
    /// # Errors
    /// The device is not supported, or another renderer is asked for.
    pub(crate) fn simulation(&self) -> Result<SimulationManagerCfg> {
        if !matches!(self.renderer, Renderer::Auto | Renderer::Raster) {
            let name = self.renderer.name();
            return Err(format!(
                "--renderer {name} is not for this example: use --renderer raster or auto here, or create_sensor, stereo, \
                 fisheye, surfaces or render_model, which draw by rays too"
            )
            .into());
        }
        self.simulation_drawn_anyhow()
    }

    /// The simulation these flags ask for, of an example that draws as they say or accepts them all.
    ///
    /// # Errors
    /// The device is not supported.
    pub(crate) fn simulation_drawn_anyhow(&self) -> Result<SimulationManagerCfg> {
        if let Device::Cuda(name) = &self.device {
            return Err(format!(
                "--device {name} is not supported: Kinetoscope simulates on the CPU; use --device cpu, and --threads to choose \
                 how many cores"
            )
            .into());
        }
        self.elsewhere.notes().iter().for_each(|note| println!("{note}"));
        Ok(SimulationManagerCfg {
            num_envs: self.num_envs,
            seed: self.seed,
            threads: self.threads,
            ..Default::default()
        })
    }

    /// Writes every stage of the pipeline to the folder of `--dump`; what is left out is a warning each.
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

    /// The folder of `--out`, else the one that the example runs in; made where it is `wanted`.
    ///
    /// # Errors
    /// It cannot be made.
    pub(crate) fn out_folder(&self, wanted: bool) -> Result<PathBuf> {
        let out = self.out.clone().unwrap_or_else(|| ".".into());
        if wanted {
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

/// A file of the user as it is, else an asset of that name.
///
/// # Errors
/// It is neither.
pub(crate) fn user_or_asset(path: &Path) -> Result<PathBuf> {
    if path.exists() { Ok(path.to_path_buf()) } else { Ok(assets::path(path)?) }
}

/// Makes the folder of `--out`.
///
/// # Errors
/// It cannot be made.
pub(crate) fn make_folder(out: &Path) -> Result {
    std::fs::create_dir_all(out).map_err(|e| format!("--out {}: {e}", out.display()).into())
}

/// Checks that there is the environment of `--camera-id`.
///
/// # Errors
/// There is none of that number.
pub(crate) fn check_camera_id(camera_id: usize, sim: &SimulationManager) -> Result {
    let n = sim.num_envs();
    if camera_id < n {
        Ok(())
    } else {
        Err(format!("--camera-id {camera_id}: there are {n} environments, from 0").into())
    }
}

/// Where the tutorial's cameras stand \[m\]: at two places, in turns.
pub(crate) fn two_views(num_envs: usize) -> Vec<[f64; 3]> {
    (0..num_envs).map(|env| if env % 2 == 0 { [2.5, 2.5, 2.5] } else { [-2.5, -2.5, 2.5] }).collect()
}

/// Runs an example: an error is printed and gives exit code 2.
pub(crate) fn run(name: &str, example: impl FnOnce() -> Result) -> ExitCode {
    match example() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{name}: {error}");
            ExitCode::from(2)
        }
    }
}

/// The end of an example by its user: Ctrl+C, or the window closed.
#[derive(Clone, Debug, Default)]
pub(crate) struct End {
    interrupted: Arc<AtomicBool>,
    window: views::Shown,
}

impl End {
    /// True when Ctrl+C was pressed or the window was closed.
    pub(crate) fn has_come(&self) -> bool {
        self.interrupted.load(Ordering::SeqCst) || self.window.is_closed()
    }
}

/// The loop's clock: progress bar, Ctrl+C and the window's end, number of steps.
#[derive(Debug)]
pub(crate) struct Progress {
    bar: ProgressBar,
    steps: Option<u64>,
    end: End,
    start: Instant,
    /// When it was said last how far it is, where there is no terminal.
    said: Cell<Instant>,
}

/// Between two lines that say how far it is, where there is no terminal.
pub(crate) const LINE: Duration = Duration::from_secs(10);

impl Progress {
    /// Starts the clock; `cycle` is the length of the bar where the number of steps is open.
    pub(crate) fn new(launcher: &Launcher, cycle: u64) -> Self {
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interrupted);
        // A second Ctrl+C ends the program at once, should the report hang on a slow disk. Some programs that send the
        // signal send it twice, to the process and to its group: that is one Ctrl+C.
        let mut first: Option<Instant> = None;
        let handler = ctrlc::set_handler(move || {
            flag.store(true, Ordering::SeqCst);
            views::let_go();
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
        let end = End { interrupted, window: launcher.window.clone() };
        Self { bar, steps: launcher.steps, end, start, said: Cell::new(start) }
    }

    /// True when Ctrl+C was pressed, the window was closed or all steps are done.
    pub(crate) fn stop(&self, step: u64) -> bool {
        self.end.has_come() || self.steps.is_some_and(|steps| step >= steps)
    }

    /// The user's end of the example, for other threads.
    pub(crate) fn end(&self) -> End {
        self.end.clone()
    }

    /// Where a block of at most `length` steps ends.
    pub(crate) fn end_of_block(&self, step: u64, length: u64) -> u64 {
        (step + length).min(self.steps.unwrap_or(u64::MAX))
    }

    /// Prints a line above the bar.
    pub(crate) fn say(&self, message: &str) {
        // Without a terminal the bar is hidden and would swallow the line.
        if std::io::stderr().is_terminal() { self.bar.suspend(|| println!("{message}")) } else { println!("{message}") }
    }

    /// Moves the bar; where there is no terminal, a line every ten seconds says how far it is.
    pub(crate) fn advance(&self, step: u64) {
        if self.bar.is_hidden() && self.said.get().elapsed() >= LINE {
            self.said.set(Instant::now());
            let of = self.steps.map_or_else(String::new, |steps| format!(" of {steps}"));
            eprintln!("step {step}{of}, after {} s", self.start.elapsed().as_secs());
        }
        if self.steps.is_none() && step > self.bar.length().unwrap_or(0) {
            self.bar.set_length(step);
        }
        self.bar.set_position(step);
    }

    /// Steps of all environments per second since the start; ends the bar.
    pub(crate) fn env_steps_per_second(&self, steps: u64, num_envs: usize) -> f64 {
        let seconds = self.start.elapsed().as_secs_f64();
        self.bar.finish_and_clear();
        steps as f64 * num_envs as f64 / seconds.max(1e-9)
    }
}
