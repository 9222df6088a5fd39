//! `kinetoscope view`: simulates a model in a window or a browser.

use crate::command_status::{CommandStatus, Result};
use crate::interrupt;
use crate::model::{ModelArgs, Setup, SpawnArgs};
use kinetoscope::prelude::*;
use kinetoscope::record::RecorderCfg;
use kinetoscope::viewer::{
    Closed, Command, RecordButton, ServeCfg, SnapshotRequest, Speed, Viewer, ViewerExt, Window, WindowCfg, WindowError,
};
use kinetoscope::{FileRecording, FoxgloveStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Simulate a model in a window, or in a browser with --serve
///
/// Drives hold the initial joint positions; sliders and the mouse move the model. The simulation ends when the window
/// is closed, all --steps are done, or on Ctrl+C; each of these is a regular end. H in the window shows its keys.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    spawn: SpawnArgs,
    /// Show the simulation in browsers and open no window; the default address is 127.0.0.1:8080. An address that other
    /// machines can reach (0.0.0.0:8080) requires the printed token
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = "127.0.0.1:8080")]
    serve: Option<String>,
    /// Also stream all recorded topics to Foxglove, which connects to ws://127.0.0.1:8765 or to the given port; an address
    /// that other machines can reach (0.0.0.0:8765) requires the printed token. Build with --features foxglove
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "8765")]
    foxglove: Option<String>,
    /// Number of environments, side by side [default: that of a scene file, else 1]
    #[arg(long, alias = "num_envs")]
    num_envs: Option<usize>,
    /// Distance between environments, in meters [default: that of a scene file, else 2]
    #[arg(long, alias = "arena_space")]
    arena_space: Option<f64>,
    /// Number of stepping threads [default: that of a scene file, else every core]
    #[arg(long)]
    threads: Option<usize>,
    /// End after this number of steps; otherwise run until the window is closed, or until Ctrl+C
    #[arg(long)]
    steps: Option<u64>,
    /// Record everything from the start: .mcap for Foxglove and Rerun, .npz for NumPy, .lerobot for a LeRobot dataset
    /// (build with --features lerobot); .mp4 or .gif for the first camera, or for all environments side by side if
    /// there is no camera; a folder for PNG files of all cameras. Without this flag, the record button records to
    /// recording.mcap
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Replace the file of --record and the partial file of an interrupted recording
    #[arg(long, requires = "record")]
    overwrite: bool,
    /// Simulated seconds per second of real time, until a viewer sets another speed
    #[arg(long, default_value_t = 1.0)]
    speed: f64,
}

const HELP: &str = "\
Examples:
  kinetoscope view arm.urdf
  kinetoscope view humanoid.xml --floating-base --num-envs 16 --speed 0.5
  kinetoscope view go2.urdf --floating-base       it stands on the ground; --spawn-height 0.2 drops it
  kinetoscope view scene.toml                     a scene file
  kinetoscope view arm.urdf --serve               in a browser, at http://127.0.0.1:8080
  kinetoscope view arm.urdf --record run.mcap
  kinetoscope view arm.urdf --foxglove            live in Foxglove, beside the window

Exit codes: 0 ended normally; 1 ended normally, with warnings (something was repaired or ignored, an environment diverged);
2 refused, or the display was lost.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    let [slow, fast] = Speed::FACTOR_RANGE;
    if !(slow..=fast).contains(&args.speed) {
        return Err(format!("--speed {}: must be {slow} to {fast}; 1 is real time", args.speed).into());
    }
    let setup = Setup { arena_space: args.arena_space, ..Setup::moving(args.num_envs, args.threads, &args.spawn) };
    let model = args.model.build(&setup)?;
    let warned = model.print_warnings();
    let mut sim = model.sim;
    // Ctrl+C is handled from here on, so that it also ends the start of the recording or of the page cleanly.
    let interrupted = on_ctrl_c(&mut sim);
    let files = Arc::new(Mutex::new(args.recording()));
    if args.record.is_some() {
        files
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .start(&mut sim)
            .map_err(|error| format!("--record {error}"))?;
    }
    let with_flag = |error| format!("--foxglove: {error}");
    let stream = args.foxglove.as_deref().map(|address| FoxgloveStream::start(&mut sim, address));
    let stream = stream.transpose().map_err(with_flag)?;
    stream.iter().for_each(|stream| println!("{stream}"));
    let window = args.open_view(&mut sim, RecordButton::shared(Arc::clone(&files)))?;
    let closed = || window.as_ref().and_then(Window::closed);
    let mut step = 0;
    while !interrupted.load(Ordering::SeqCst) && args.steps.is_none_or(|steps| step < steps) && closed().is_none() {
        sim.update(1);
        step += 1;
        if sim.scene().device_failure().is_some() {
            break;
        }
    }
    let recorded = files.lock().unwrap_or_else(PoisonError::into_inner).finish(&mut sim);
    for recorded in recorded.map_err(|error| format!("--record {error}"))? {
        println!("Recorded to {recorded}");
    }
    if let Some(stream) = stream {
        stream.end(&mut sim).map_err(with_flag)?;
    }
    if let Some(reason) = closed().as_ref().and_then(Closed::error) {
        return Err(format!("the window was lost after {step} steps: {reason}").into());
    }
    if let Some(error) = sim.scene().device_failure() {
        return Err(error.into());
    }
    let diverged = sim.diverged();
    for one in &diverged {
        eprintln!("warning: environment {}: {one}", one.env.0);
    }
    Ok(if warned || !diverged.is_empty() { CommandStatus::Warned } else { CommandStatus::Done })
}

impl Args {
    /// Returns the implementation of the record button.
    fn recording(&self) -> FileRecording {
        let path = self.record.clone().unwrap_or_else(|| "recording.mcap".into());
        FileRecording::new(RecorderCfg { overwrite: self.overwrite, ..RecorderCfg::new(path) })
    }

    /// Shows the simulation. Returns the window, or `None` for a browser view.
    ///
    /// # Errors
    /// No display is available, or the server cannot listen at the address.
    fn open_view(&self, sim: &mut SimulationManager, button: RecordButton) -> Result<Option<Window>> {
        let (speed, record_button) = (Some(Speed::Factor(self.speed)), Some(button));
        let names = self.model.file_names();
        if let Some(address) = &self.serve {
            let served = sim.serve_with(address, ServeCfg { speed, record_button, ..ServeCfg::default() });
            let served = served.map_err(|error| format!("--serve: {error}"))?;
            println!("Open {} in a browser to see {names}; Ctrl+C here ends it.", served.url());
            return Ok(None);
        }
        let title = format!("{names} - Kinetoscope");
        let cfg = WindowCfg { title, speed, record_button, ..WindowCfg::default() };
        let window = sim.open_window_with(cfg).map_err(|error| no_window(&error, &names))?;
        println!("A window shows {names}: H in it shows its keys; closing it, or Ctrl+C here, ends it.");
        Ok(Some(window))
    }
}

/// Returns the error message for a window that cannot be opened, with alternatives.
fn no_window(error: &WindowError, names: &str) -> String {
    match error {
        WindowError::NoDisplay { reason, display, wayland } => {
            let of = |variable: &Option<String>| variable.clone().unwrap_or_else(|| "not set".into());
            format!(
                "no window can be opened: {reason} (DISPLAY is {}, WAYLAND_DISPLAY is {}). Set DISPLAY to an X server, which \
                 Wayland desktops provide as XWayland; or view it in a browser, also from another machine: kinetoscope \
                 view {names} --serve; or render an image: kinetoscope render {names} -o out.png",
                of(display),
                of(wayland),
            )
        }
        other => other.to_string(),
    }
}

/// Returns a flag that Ctrl+C sets. Ctrl+C also resumes a paused simulation and sets it to free speed.
fn on_ctrl_c(sim: &mut SimulationManager) -> Arc<AtomicBool> {
    let wants = SnapshotRequest { rate: 0.0, contacts: None, markers: false, joints: false, cameras: false };
    let resume_viewer: Viewer = sim.viewer(wants);
    interrupt::on_ctrl_c(move || {
        resume_viewer.send(Command::Resume);
        resume_viewer.send(Command::SetSpeed(Speed::Unlimited));
    })
}
