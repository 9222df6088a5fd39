//! Runs the commands and programs of docs/recording.md as they are written there.

use kinetoscope::prelude::*;
use kinetoscope::record::{Format, RecorderCfg};
use kinetoscope_testkit::worlds::RecordedWorld;
use std::path::Path;
use std::process::{Command, Output};

const PAGE: &str = include_str!("../../../docs/recording.md");

/// Returns the code blocks of a language.
fn blocks(language: &str) -> Vec<String> {
    let fence = format!("```{language}\n");
    PAGE.split(&fence).skip(1).map(|rest| rest.split("```").next().unwrap().to_string()).collect()
}

/// Writes recordings with the names of the page, long enough for its times.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut world = RecordedWorld::new(1, 2);
    let mut recorders = Vec::new();
    for (format, end) in Format::all().filter(|(format, _)| !format.is_animation() && format.is_built()) {
        let path = folder.path().join(if end.is_empty() { "arm".into() } else { format!("arm.{end}") });
        recorders.push(world.sim.record(RecorderCfg { format: Some(format), ..RecorderCfg::new(path) }).unwrap());
    }
    (0..160).for_each(|step| world.step(step));
    recorders.into_iter().for_each(|recorder| drop(world.sim.finish_recording(recorder).unwrap()));
    folder
}

fn printed(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

#[test]
fn commands() {
    /// Commands that need a display, or a file that the page does not create; other tests run them.
    const ELSEWHERE: [&str; 4] = [
        "kinetoscope recover run.mcap",
        "kinetoscope replay arm.mcap",
        "kinetoscope replay arm.mcap --serve",
        "kinetoscope replay run.mcap --verify --scene scene.toml",
    ];
    let folder = folder();
    let program = Path::new(env!("CARGO_BIN_EXE_kinetoscope"));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::iter::once(program.parent().unwrap().to_path_buf()).chain(std::env::split_paths(&path));
    let path = std::env::join_paths(folders).unwrap();
    let mut elsewhere: Vec<String> =
        PAGE.contains("`kinetoscope recover run.mcap`").then(|| ELSEWHERE[0].into()).into_iter().collect();
    let mut run = 0;
    for line in blocks("sh").iter().flat_map(|block| block.lines()) {
        let line = line.split(" #").next().unwrap().trim();
        if let Some(rest) = line.strip_prefix("cargo run --release ") {
            // The table of examples is tested elsewhere; this test checks that the example exists.
            let name = rest.split_whitespace().skip_while(|word| *word != "--example").nth(1).unwrap();
            assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../examples/{name}.rs")).is_file(), "{line}");
        } else if ELSEWHERE.contains(&line) {
            elsewhere.push(line.into());
        } else if !line.is_empty() {
            let output =
                Command::new("sh").args(["-c", line]).env("PATH", &path).current_dir(&folder).output().unwrap();
            assert_eq!(output.status.code(), Some(0), "{line}: {}", printed(&output));
            run += 1;
        }
    }
    elsewhere.sort();
    assert_eq!((elsewhere, run >= 4), (ELSEWHERE.map(String::from).to_vec(), true), "{run} lines were run");
    for made in ["joints.svg", "tracking.png", "images/replay_0.000s.png", "images/replay_1.500s.png"] {
        assert!(folder.path().join(made).is_file(), "{made}");
    }
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn programs() {
    let python = kinetoscope_testkit::test_resources::python_readers();
    let folder = folder();
    // LeRobot needs some gigabytes: read_lerobot.py reads the data set where LeRobot is installed.
    let absent = |block: &str| block.contains("import LeRobotDataset");
    let blocks: Vec<_> = blocks("python").into_iter().filter(|block| !absent(block)).collect();
    for block in &blocks {
        let output = Command::new(&python).args(["-c", block]).current_dir(&folder).output().unwrap();
        assert!(output.status.success() && !output.stdout.is_empty(), "{block}\n{}", printed(&output));
    }
    assert!(blocks.len() >= 2, "{} programs were run", blocks.len());
}
