//! `kinetoscope replay`: shows a recording, renders images of it, or verifies it by running its actions again.

use crate::command_status::{CommandStatus, Result};
use crate::{excerpt, interrupt};
use kinetoscope::RecordingPlayback;
use kinetoscope::prelude::*;
use kinetoscope::record::{Playback, Recording, replay};
use kinetoscope::sim::OffscreenScene;
use kinetoscope::viewer::{Closed, OrbitCamera, ScreenshotCfg, ServeCfg, WindowCfg};
use kinetoscope::viewer::{Play, Speed};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Show a recording in a window or a browser with a timeline, render images of it, or run its actions again
///
/// A recording contains its scene, so the file is sufficient to show it. Running its actions again requires the
/// original scene, including drives: give the scene file with --scene.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Recording, .mcap or .npz
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Scene file of the recorded simulation, used instead of the scene in the recording; required by --verify
    #[arg(long, value_name = "SCENE.toml|yaml")]
    scene: Option<PathBuf>,
    /// Show the recording in browsers instead of a window; the default address is 127.0.0.1:8080
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8080")]
    serve: Option<String>,
    /// Write images to this folder instead of opening a window
    #[arg(long, value_name = "DIR", conflicts_with = "serve", requires = "at")]
    out: Option<PathBuf>,
    /// Times of the images, in seconds of the recording's time stamps; each shows the last frame at or before its time
    #[arg(long, value_name = "SECONDS,...", value_delimiter = ',', requires = "out", allow_hyphen_values = true)]
    at: Vec<f64>,
    /// Width of the images of --out, in pixels
    #[arg(long, default_value_t = 960)]
    width: usize,
    /// Height of the images of --out, in pixels
    #[arg(long, default_value_t = 540)]
    height: usize,
    /// Run the recorded actions again in the scene of --scene, and compare every number bit for bit
    #[arg(long, requires = "scene", conflicts_with_all = ["serve", "out"])]
    verify: bool,
    /// End after this number of seconds of real time, if the window is not closed earlier
    #[arg(long, value_name = "SECONDS", conflicts_with_all = ["out", "verify"])]
    seconds: Option<f64>,
}

const HELP: &str = "\
Examples:
  kinetoscope replay run.mcap                     in a window; --serve: in a browser
  kinetoscope replay run.mcap --out images --at 0,1.5,3
  kinetoscope replay run.mcap --verify --scene scene.toml

Exit codes: 0 shown, images written, or --verify found every number equal; 1 shown or images written, with warnings
(something of the recording or of the scene was left out), or --verify found a difference; 2 refused, or the display was
lost.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    if args.verify {
        return verify(args);
    }
    if let Some(seconds) = args.seconds.filter(|seconds| !(*seconds > 0.0 && *seconds < 1e9)) {
        return Err(format!("--seconds {seconds}: must be more than 0").into());
    }
    let recording = Recording::open(&args.file)?;
    let mut warned = !recording.warnings().is_empty();
    recording.warnings().iter().for_each(|warning| eprintln!("warning: {warning}"));
    let envs = recording.env_ids().last().map_or(1, |last| last.saturating_add(1));
    let scene = args.scene.as_deref().map(|file| build_scene(file, envs)).transpose()?;
    warned |= scene.as_ref().is_some_and(|(_, warned)| *warned);
    let (playback, sim) = Playback::open(&recording, scene.as_ref().map(|(scene, _)| scene.sim()))?;
    if !playback.joints_without_data().is_empty() {
        warned = true;
        eprintln!(
            "warning: no recorded state of {}: they keep their initial state",
            playback.joints_without_data().join(", ")
        );
    }
    match &args.out {
        Some(folder) => draw(args, playback, sim, folder)?,
        None => show(args, playback, sim)?,
    }
    Ok(if warned { CommandStatus::Warned } else { CommandStatus::Done })
}

/// Builds the scene of a file with the recorded number of environments. Also returns true if there were warnings.
fn build_scene(file: &Path, num_envs: usize) -> Result<(InteractiveScene, bool)> {
    let mut cfg = SceneCfg::from_file(file)?;
    cfg.simulation.num_envs = num_envs;
    let scene = InteractiveScene::new(cfg)?;
    let warned = excerpt::print_warnings(scene.sim().diagnostics());
    Ok((scene, warned))
}

fn verify(args: &Args) -> Result<CommandStatus> {
    let Some(file) = &args.scene else { return Err("--verify: give the scene with --scene".into()) };
    let (mut scene, _) = build_scene(file, replay::num_envs(&args.file)?)?;
    let verdict = replay::verify(scene.sim_mut(), &args.file)?;
    println!("{}: {verdict}", args.file.display());
    Ok(if verdict.is_identical() { CommandStatus::Done } else { CommandStatus::Warned })
}

fn draw(args: &Args, mut playback: Playback, mut sim: SimulationManager, folder: &Path) -> Result<()> {
    let (first, last) = (playback.times()[0], playback.times()[playback.times().len() - 1]);
    if let Some(time) = args.at.iter().find(|time| !(first..=last).contains(*time)) {
        return Err(format!("--at {time}: the recording is from {first} s to {last} s").into());
    }
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    // All images have the same camera, which frames everything that is visible at any of these times.
    let mut stills = Vec::new();
    for time in &args.at {
        playback.seek(&mut sim, playback.frame_at(*time))?;
        stills.push(OffscreenScene::overview(&mut sim, None, &[])?);
    }
    let (size, placed) = ([args.width, args.height], stills.iter().map(OffscreenScene::placed).collect::<Vec<_>>());
    let cfg =
        ScreenshotCfg { size, camera: Some(OrbitCamera::frame_scenes(&placed, size)), ..ScreenshotCfg::default() };
    for time in &args.at {
        playback.seek(&mut sim, playback.frame_at(*time))?;
        let path = folder.join(format!("replay_{time:.3}s.png"));
        sim.screenshot_with(&path, &cfg)?;
        println!("{}", path.display());
    }
    Ok(())
}

fn show(args: &Args, mut playback: Playback, mut sim: SimulationManager) -> Result<()> {
    let start = std::time::Instant::now();
    // A new viewer sees the first frame at once, not the initial state of the scene.
    playback.seek(&mut sim, 0)?;
    let mut playback = RecordingPlayback(playback);
    // Ctrl+C needs no action of its own, because `keep_playing` is called many times a second.
    let interrupted = interrupt::on_ctrl_c(|| ());
    let keep_playing = || {
        let in_time = args.seconds.is_none_or(|seconds| start.elapsed().as_secs_f64() < seconds);
        in_time && !interrupted.load(Ordering::SeqCst)
    };
    match &args.serve {
        Some(address) => {
            let served = sim.serve_with(address, ServeCfg { speed: Some(Speed::REAL_TIME), ..ServeCfg::default() })?;
            println!("Open {} in a browser; Ctrl+C ends the replay.", served.url());
            sim.play(&mut playback, &mut || keep_playing())?;
            served.close(&mut sim)?;
        }
        None => {
            let title = format!("{} - Kinetoscope", args.file.display());
            let window = sim.open_window_with(WindowCfg { title, ..WindowCfg::default() })?;
            println!("A window shows {}: closing it, or Ctrl+C here, ends it.", args.file.display());
            sim.play(&mut playback, &mut || window.is_open() && keep_playing())?;
            if let Some(reason) = window.closed().as_ref().and_then(Closed::error) {
                return Err(format!("the window was lost: {reason}").into());
            }
            window.close();
        }
    }
    Ok(())
}
