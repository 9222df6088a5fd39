//! Examples after EmbodiChain's tutorials: output and poses, windows, and how they end.

use super::support::{CommandFolder, RunningCommand, window_of};
use kinetoscope_testkit::wait;
use kinetoscope_testkit::x_server::{Display, close, screenshot};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Title of the tutorial's image window.
const IMAGES: &str = "Sensor Views (Color / Depth / Mask / Normals)";

/// Returns the command of an example, which `cargo test` builds with the workspace, in its own folder.
fn example(name: &str, folder: &Path) -> Command {
    let tests = std::env::current_exe().unwrap();
    let file = tests.parent().unwrap().with_file_name("examples").join(name);
    assert!(file.is_file(), "{}: cargo build --examples", file.display());
    let mut command = Command::new(file);
    command.current_dir(folder).env_remove("DISPLAY").stdout(Stdio::piped());
    command
}

/// Poses and the order of the output match the tutorial's script; a hand closes at its lower limits.
#[test]
#[ignore = "needs the examples: cargo xtask test"]
fn create_robot() {
    let shell = CommandFolder::with(&[]);
    let args = ["--headless", "--num_envs", "2", "--steps", "4000", "--gpu_id", "0", "--report", "report.json"];
    let output = example("create_robot", shell.folder()).args(args).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{text}");
    let mut lines = text.lines();
    for line in [
        "Creating simulation...",
        "note: --gpu-id has no effect here: --device cuda:N chooses the GPU of the physics, and cameras run on the CPU",
        "Loading robot...",
        "Robot created successfully with 17 joints",
        "Starting simulation...",
        "Robot will move through different poses",
        "Press Ctrl+C to stop",
        "Moving to arm position 1",
        "Moving to arm position 2",
        "Closing hand",
        "Opening hand",
        "Stopping simulation...",
        "Cleaning up...",
    ] {
        assert!(lines.any(|next| next == line), "{line:?} is missing, or before the line above it: {text}");
    }
    let report: Value = serde_json::from_str(&std::fs::read_to_string(shell.path("report.json")).unwrap()).unwrap();
    let phases = report["phases"].as_array().unwrap();
    let target =
        |k: usize| phases[k]["target"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<_>>();
    assert_eq!(target(0), [0.0, -0.5, 0.5, -1.0, 0.5, 0.0]);
    assert_eq!(target(1), [0.5, 0.0, -0.5, 0.5, -0.5, 0.5]);
    // Lower limits, then upper limits, which are straight fingers.
    assert!(
        target(2).iter().all(|q| *q < -1.0) && target(3).iter().all(|q| *q == 0.0),
        "{:?} {:?}",
        target(2),
        target(3)
    );
}

#[test]
#[ignore = "needs Xvfb and the examples: cargo xtask test"]
fn closed_window() {
    let (display, shell) = (Display::start("1280x800"), CommandFolder::with(&[]));
    let connection = display.connect();
    // Without the end of the window, it would run for hours.
    let args = ["--steps", "10000000", "--report", "report.json"];
    let mut running = RunningCommand(
        example("create_robot", shell.folder()).args(args).env("DISPLAY", &display.name).spawn().unwrap(),
    );
    close(&connection, wait::until_some("a window", || window_of(&connection, "Kinetoscope")));
    assert_eq!(running.ended().code(), Some(0));
    assert!(shell.path("report.json").is_file());
    assert!(running.rest().ends_with("Stopping simulation...\nCleaning up...\n"));
}

#[test]
#[ignore = "needs Xvfb and the examples: cargo xtask test"]
fn sensor_window() {
    let display = Display::start("1920x1200");
    let connection = display.connect();
    let start = |shell: &CommandFolder, args: &[&str]| {
        let running = RunningCommand(
            example("create_sensor", shell.folder()).args(args).env("DISPLAY", &display.name).spawn().unwrap(),
        );
        (running, wait::until_some("the window of images", || window_of(&connection, IMAGES)))
    };
    let files = |shell: &CommandFolder| std::fs::read_dir(shell.folder()).unwrap().count();
    // Normals of the ground, at the center of the fourth image: (0, 0, 1) towards the camera is encoded as (128, 128,
    // 255).
    let normals = || screenshot(&connection, [970, 900], [1, 1])[0];
    let shell = CommandFolder::with(&[]);
    let (mut running, window) = start(&shell, &[]);
    wait::until("the images are shown", || normals()[2] > 250);
    assert_eq!(files(&shell), 0, "images are files only where they are not shown");
    close(&connection, window);
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
    let (mut running, _) = start(&shell, &["--save", "--steps", "1"]);
    assert_eq!(running.ended().code(), Some(0));
    assert!(shell.path("sensor_views_0.png").is_file());
    // Ctrl+C during path tracing of an image that takes minutes.
    let (mut running, window) = start(&shell, &["--enable_rt", "--rt-samples", "1000", "--mask", "instance"]);
    wait::until("the progress is shown", || {
        screenshot(&connection, [10, 30], [200, 24]).iter().any(|p| p[0] > 200 && p[2] < 100)
    });
    let begun = Instant::now();
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
    // A second on an idle machine.
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
    assert_ne!(window, 0);
    assert_eq!(files(&shell), 1, "an image that was cancelled is no file");
}
