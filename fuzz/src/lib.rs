//! Shared code of the fuzz targets: each target is one file in `targets/`, which calls what a user's input reaches.
//!
//! A target fails by a panic, by an error of the address sanitizer, or by its time or memory (`xtask/src/fuzz.rs` has the
//! limits). Errors are expected for most inputs; their messages are written, because that is code too.

use kinetoscope_scene::mesh::{DaeUpAxis, HullCfg, MeshOptions, convex_hull, load_bytes};
use kinetoscope_sim::{SimulationManager, SimulationManagerCfg};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Line between the files of an input that consists of several files.
const SEPARATOR: &[u8] = b"\n%%%%\n";

/// Number of vertices of a mesh up to which its hull is computed: the hull has bounds and tests of its own.
const MOST_HULL_VERTICES: usize = 64;

/// Folder of this process, for inputs that must be files.
pub fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("kinetoscope-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("the folder of temporary files is writable");
        folder
    })
}

/// Writes an input file and returns its path.
pub fn write(name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder().join(name);
    std::fs::write(&path, bytes).expect("the folder of this process is writable");
    path
}

/// The files of an input.
pub fn files(bytes: &[u8]) -> Vec<&[u8]> {
    let mut files = Vec::new();
    let mut rest = bytes;
    while let Some(at) = rest.windows(SEPARATOR.len()).position(|window| window == SEPARATOR) {
        files.push(&rest[..at]);
        rest = &rest[at + SEPARATOR.len()..];
    }
    files.push(rest);
    files
}

/// The value, or `None` for an error whose message is not empty.
pub fn accepted<T, E: Error>(result: Result<T, E>) -> Option<T> {
    result.inspect_err(|error| assert!(!error.to_string().is_empty())).ok()
}

/// Reads a mesh file. Whatever loads is valid, and so is its convex hull, if it has one.
pub fn mesh(name: &str, bytes: &[u8]) {
    for dae_up_axis in [DaeUpAxis::Ignore, DaeUpAxis::Apply] {
        let options = MeshOptions { dae_up_axis };
        let Some(mesh) = accepted(load_bytes(folder().join(name), bytes, &options)) else { continue };
        mesh.validate().expect("a mesh that loads is valid");
        assert!(!mesh.triangles.is_empty());
        if mesh.positions.len() <= MOST_HULL_VERTICES
            && let Some(hull) = accepted(convex_hull(&mesh.positions, &HullCfg::default()))
        {
            hull.validate().expect("a hull is valid");
        }
        if !name.ends_with(".dae") {
            return;
        }
    }
}

/// An empty scene of one environment.
pub fn simulation() -> SimulationManager {
    simulation_of(1)
}

/// An empty scene on one thread: fuzzers run beside each other.
pub fn simulation_of(num_envs: usize) -> SimulationManager {
    let cfg = SimulationManagerCfg { num_envs, threads: Some(1), ..SimulationManagerCfg::default() };
    SimulationManager::new(cfg).expect("an empty scene")
}
