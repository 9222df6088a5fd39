//! Test resources that only some machines have: robots, models and programs.
//!
//! A test that needs a resource is marked `#[ignore = "needs ..."]`, so that plain `cargo test` lists it as ignored
//! with the reason. `cargo xtask test` installs the resources and runs these tests too. A missing resource is then a
//! failure.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Environment variable with the folder of real robots.
pub const ROBOTS_VARIABLE: &str = "KINETOSCOPE_ROBOTS";
/// Environment variable with a Python that has readers of recordings (`mcap`, NumPy, Pillow, PyAV, pyarrow).
pub const READERS_VARIABLE: &str = "KINETOSCOPE_PYTHON_READERS";
/// Environment variable with a Python that has MuJoCo 4 and OpenGL.
pub const RENDERER_VARIABLE: &str = "KINETOSCOPE_PYTHON4";

/// Folders that may hold real robots: [`ROBOTS_VARIABLE`], `shared/robots` beside the repository or above it, and the
/// one that `cargo xtask test` fills from PyPI.
fn robot_folders() -> impl Iterator<Item = PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let above = root.ancestors().skip(1).map(|dir| dir.join("shared/robots"));
    std::env::var_os(ROBOTS_VARIABLE)
        .map(PathBuf::from)
        .into_iter()
        .chain(above)
        .chain([root.join("target/example-robot-data/robots")])
}

/// Folder with URDF files of real robots.
pub fn robots_dir() -> PathBuf {
    robot_folders()
        .find(|dir| dir.is_dir())
        .unwrap_or_else(|| panic!("no folder of robot models: run `cargo xtask test`, or set {ROBOTS_VARIABLE}"))
}

/// File of a real robot; `path` is relative to the folder of robots.
pub fn robot(path: &str) -> PathBuf {
    robot_folders().map(|dir| dir.join(path)).find(|file| file.is_file()).unwrap_or_else(|| {
        panic!("no folder of robot models contains {path}: run `cargo xtask test`, or set {ROBOTS_VARIABLE}")
    })
}

/// A model that comes with MuJoCo, for example `humanoid/humanoid.xml`, or the folder of models for an empty path.
pub fn sample_model(path: &str) -> PathBuf {
    let found = Path::new("/usr/share/mujoco/model").join(path);
    assert!(found.exists(), "{} is absent: apt-get install libmujoco-samples", found.display());
    found
}

/// All files below `folder` with this extension (case-insensitive), sorted by path.
pub fn files_below(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let (mut folders, mut files) = (vec![folder.to_path_buf()], Vec::new());
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|end| end.eq_ignore_ascii_case(extension)) {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

fn python(variable: &str) -> PathBuf {
    std::env::var_os(variable).map(PathBuf::from).unwrap_or_else(|| {
        panic!("{variable} does not name a Python interpreter: run `cargo xtask test`, which creates one")
    })
}

/// Python interpreter that reads recordings.
pub fn python_readers() -> PathBuf {
    python(READERS_VARIABLE)
}

/// Python interpreter that renders with MuJoCo's own renderer.
pub fn python_renderer() -> PathBuf {
    python(RENDERER_VARIABLE)
}

/// Runs a Python script on a file and parses the JSON that it prints.
pub fn read_json(python: &Path, script: &Path, file: &Path) -> serde_json::Value {
    let output = Command::new(python).arg(script).arg(file).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Path of a browser: Chromium or Chrome.
pub fn chromium() -> PathBuf {
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()).collect();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let mut files = names.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    files.find(|path| path.is_file()).expect("a browser: apt-get install --no-install-recommends chromium")
}
