//! The scene in a recording, which is enough to show it without the program that recorded it.
//!
//! The scene is a ZIP archive called `scene.zip`: an attachment of an MCAP file, or a member of a NumPy archive. It
//! contains the scene as MJCF for both supported MuJoCo versions, as written by [`SimulationManager::dump`], with
//! meshes, textures and terrains. The file `stage.json` has the settings that MJCF does not support. Any program that
//! reads ZIP archives can extract them.

use crate::archive;
use crate::error::{RecordError, Result};
use kinetoscope_mujoco::{BUILD_VERSION, SupportedVersion};
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_sim::{GroundCfg, MjcfId, MjcfPartCfg, SimulationManager, SimulationManagerCfg};
use serde_json::{Value, json};
use std::fs;
use std::io::{self, Cursor};
use std::path::{Component, Path, PathBuf};

/// Name of the archive in a recording.
pub(crate) const SCENE_ARCHIVE: &str = "scene.zip";
/// Name of the file with the settings that MJCF does not support.
const SETTINGS: &str = "stage.json";
/// Name of the MJCF part that contains the recorded scene.
pub(crate) const SCENE_PART: &str = "scene";
/// Names of the MJCF files, for MuJoCo 2 and for MuJoCo 4.
const MJCF: [&str; 2] = ["robot.mjcf2.xml", "robot.mjcf4.xml"];

/// Packs the scene of a simulation into an archive; also returns what was left out.
pub(crate) fn pack(sim: &SimulationManager) -> Result<(Vec<u8>, Vec<String>)> {
    let failed = |error: io::Error| RecordError::file(Path::new(SCENE_ARCHIVE), error);
    let folder = tempfile::tempdir().map_err(failed)?;
    // Drives do not matter for a scene that is only displayed.
    let shows = |diagnostic: &&Diagnostic| diagnostic.kind != DiagnosticKind::ExportHeavier;
    let left_out = sim.dump(folder.path())?.iter().filter(shows).map(|diagnostic| diagnostic.message.clone()).collect();
    let mut archive = archive::ArchiveWriter::new(Cursor::new(Vec::new()));
    let SimulationManagerCfg { arena_space, ground, .. } = sim.cfg();
    let stage = json!({ "num_envs": sim.num_envs(), "arena_space": arena_space, "ground": ground });
    archive.add(SETTINGS, b"", &mut stage.to_string().as_bytes()).map_err(failed)?;
    for file in files(folder.path()).map_err(failed)? {
        let name = file.strip_prefix(folder.path()).unwrap_or(&file).to_string_lossy().replace('\\', "/");
        // Files for humans and the MJCF of the run itself are not displayed.
        if name.ends_with(".txt") || name.ends_with(".urdf") || name == "run.mjcf.xml" {
            continue;
        }
        archive.add_deflated(&name, &fs::read(&file).map_err(failed)?).map_err(failed)?;
    }
    Ok((archive.finish().map_err(failed)?.into_inner(), left_out))
}

/// All files below a folder, sorted.
fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            if path.is_dir() { folders.push(path) } else { found.push(path) }
        }
    }
    found.sort();
    Ok(found)
}

/// Creates a simulation of a packed scene, for display, with the recorded number of environments. The scene is one MJCF
/// part, in which drives are plain MuJoCo actuators. `path` is the recording, for error messages.
///
/// # Errors
/// The archive is damaged, or its scene cannot be compiled.
pub(crate) fn unpack(bytes: &[u8], path: &Path) -> Result<(SimulationManager, MjcfId)> {
    let malformed = |what: &str| RecordError::Malformed { path: path.into(), what: format!("its scene: {what}") };
    let failed = |error: io::Error| RecordError::file(Path::new(SCENE_ARCHIVE), error);
    let files = archive::read_all(bytes).ok_or_else(|| malformed("the archive is damaged"))?;
    let folder = tempfile::tempdir().map_err(failed)?;
    let mut stage = Value::Null;
    for (name, data) in &files {
        if name == SETTINGS {
            stage = serde_json::from_slice(data).map_err(|_| malformed("stage.json is not valid JSON"))?;
            continue;
        }
        // A recorder writes no names that lead out of the folder.
        let inside = Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
        if !inside {
            return Err(malformed(&format!("{name:?} is not a valid file name")));
        }
        let file = folder.path().join(name);
        if let Some(parent) = file.parent() {
            fs::create_dir_all(parent).map_err(failed)?;
        }
        fs::write(&file, data).map_err(failed)?;
    }
    let number = |name: &str| stage[name].as_u64().and_then(|number| usize::try_from(number).ok());
    let num_envs = number("num_envs").ok_or_else(|| malformed("it does not contain the number of environments"))?;
    let arena_space = stage["arena_space"].as_f64().unwrap_or(SimulationManagerCfg::default().arena_space);
    let mjcf = folder.path().join(MJCF[usize::from(BUILD_VERSION == SupportedVersion::V4)]);
    // Older recordings lack the ground settings. Their ground is the plane of the MJCF.
    let ground: Option<GroundCfg> = serde_json::from_value(stage["ground"].clone()).unwrap_or_default();
    let ground = ground.filter(|_| remove_ground(&mjcf));
    let cfg = SimulationManagerCfg { num_envs, arena_space, ground, lights: Vec::new(), ..Default::default() };
    let mut sim = SimulationManager::new(cfg)?;
    let part = sim.add_mjcf(MjcfPartCfg::file(SCENE_PART, mjcf))?;
    Ok((sim, part))
}

/// Removes the ground from a packed MJCF file, so that the simulation can add its own; returns true if it was there.
fn remove_ground(mjcf: &Path) -> bool {
    let Ok(text) = fs::read_to_string(mjcf) else { return false };
    let Some(from) = text.find("<geom name=\"ground\" ") else { return false };
    let Some(length) = text[from..].find("/>") else { return false };
    let without = format!("{}{}", &text[..from], &text[from + length + 2..]);
    fs::write(mjcf, without).is_ok()
}
