//! Screenshots: an image of the scene in one call, without a window or a display.

use crate::control::SnapshotRequest;
use crate::file_extension;
use crate::scene_view::{
    Canvas, EnvSelection, OrbitCamera, Overlays, RunState, SceneRenderer, Snapshot, SnapshotPool, ViewOptions,
};
use kinetoscope_render::{RenderError, View};
use kinetoscope_scene::AtomicFile;
use kinetoscope_sim::SimulationManager;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Settings of a screenshot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScreenshotCfg {
    /// Image size: pixels per row, rows.
    pub size: [usize; 2],
    /// Camera. `None` frames the shown environments, like the initial view of a window; with [`EnvSelection::All`], the
    /// view set by [`set_camera_view`](kinetoscope_sim::SceneViewMut::set_camera_view) applies instead.
    pub camera: Option<OrbitCamera>,
    /// Environments in the image.
    pub envs: EnvSelection,
    /// Overlays and geom groups. `trails` has no effect: a screenshot has no past positions.
    pub overlays: Overlays,
    /// Number of rendering threads, at least one. `None` uses every core. The image does not depend on this number.
    pub threads: Option<usize>,
}

impl Default for ScreenshotCfg {
    fn default() -> Self {
        Self { size: [960, 540], camera: None, envs: EnvSelection::All, overlays: Overlays::default(), threads: None }
    }
}

/// An error of [`Screenshot`].
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScreenshotError {
    /// The file name extension is not `.png`, in upper or lower case.
    #[error("{path}: unsupported image format .{end}; use a file name that ends in .png")]
    Extension {
        /// Path of the image file.
        path: PathBuf,
        /// File name extension, in lower case and without its dot.
        end: String,
    },
    /// The folder of the file does not exist.
    #[error("{path}: the folder {folder} does not exist; create it first")]
    NoFolder {
        /// Path of the image file.
        path: PathBuf,
        /// The missing folder.
        folder: PathBuf,
    },
    /// The file cannot be written, for example because the disk is full or the folder is read-only.
    #[error("{path}: {error}")]
    File {
        /// Path of the image file.
        path: PathBuf,
        /// Error of the operating system or of the PNG encoder.
        error: Arc<std::io::Error>,
    },
    /// A side of the image is zero or too long.
    #[error("invalid image size {width} x {height}; both sides must be 1 to {most} pixels")]
    Size {
        /// Pixels per row.
        width: usize,
        /// Number of rows.
        height: usize,
        /// Longest supported side \[pixels\].
        most: usize,
    },
    /// The environment does not exist.
    #[error("environment {env} does not exist; the simulation has {count}, numbered from 0")]
    Environment {
        /// Index of the requested environment in the simulation.
        env: usize,
        /// Number of environments.
        count: usize,
    },
    /// The renderer returned an error.
    #[error("rendering failed: {0}")]
    Draw(RenderError),
}

/// Screenshots of a simulation.
pub trait Screenshot {
    /// Writes an image of the current state to a PNG file: all environments in their grid, 960 by 540 pixels, seen from
    /// the initial camera of a window ([`overview_camera`](Self::overview_camera)).
    ///
    /// An existing file is replaced once the new file is complete. The simulation does not change.
    ///
    /// ```no_run
    /// use kinetoscope_sim::{SimulationManager, SimulationManagerCfg};
    /// use kinetoscope_viewer::Screenshot;
    ///
    /// let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
    /// sim.update(100);
    /// sim.screenshot("after_one_second.png")?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`screenshot_with`](Self::screenshot_with).
    fn screenshot(&mut self, path: impl AsRef<Path>) -> Result<(), ScreenshotError> {
        self.screenshot_with(path, &ScreenshotCfg::default())
    }

    /// Writes an image of the current state to a PNG file, like [`screenshot`](Self::screenshot), with the settings
    /// `cfg`.
    ///
    /// # Errors
    /// An invalid file name extension, size or environment, a missing or read-only folder, or a full disk. An existing
    /// file is unchanged after an error.
    fn screenshot_with(&mut self, path: impl AsRef<Path>, cfg: &ScreenshotCfg) -> Result<(), ScreenshotError>;

    /// Returns the camera set by [`set_camera_view`](kinetoscope_sim::SceneViewMut::set_camera_view). Without one,
    /// returns a camera from which all environments, without the ground, fill an image of `size` pixels (width, height)
    /// in their current state.
    fn overview_camera(&mut self, size: [usize; 2]) -> OrbitCamera;

    /// Renders the current state with the settings `cfg` and returns the image, without writing a file.
    ///
    /// # Errors
    /// The size or the environment is invalid, or the renderer returned an error.
    fn render_image(&mut self, cfg: &ScreenshotCfg) -> Result<Canvas, ScreenshotError>;
}

impl Screenshot for SimulationManager {
    fn screenshot_with(&mut self, path: impl AsRef<Path>, cfg: &ScreenshotCfg) -> Result<(), ScreenshotError> {
        let path = path.as_ref();
        let end = file_extension::lower_case(path);
        if end != "png" {
            return Err(ScreenshotError::Extension { path: path.into(), end });
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            return Err(ScreenshotError::NoFolder { path: path.into(), folder: folder.into() });
        }
        let canvas = self.render_image(cfg)?;
        let written = canvas.to_png().and_then(|bytes| AtomicFile::write(path, &bytes));
        written.map_err(|error| ScreenshotError::File { path: path.into(), error: Arc::new(error) })
    }

    fn overview_camera(&mut self, size: [usize; 2]) -> OrbitCamera {
        let snapshot = SnapshotPool::default().capture(self, 1, &SnapshotRequest::EMPTY, RunState::default());
        snapshot.map_or_else(OrbitCamera::default, |snapshot| OrbitCamera::overview(&snapshot, size))
    }

    fn render_image(&mut self, cfg: &ScreenshotCfg) -> Result<Canvas, ScreenshotError> {
        let ([width, height], most) = (cfg.size, View::MAX_SIDE);
        if ![width, height].iter().all(|side| (1..=most).contains(side)) {
            return Err(ScreenshotError::Size { width, height, most });
        }
        let count = self.num_envs();
        if let EnvSelection::One(env) = cfg.envs
            && env >= count
        {
            return Err(ScreenshotError::Environment { env, count });
        }
        let contacts = cfg.overlays.contacts.then_some(cfg.envs);
        let wants = SnapshotRequest { contacts, markers: cfg.overlays.sensors, ..SnapshotRequest::default() };
        let run = RunState { steps: self.observers().steps(), ..RunState::default() };
        let mut canvas = Canvas::default();
        // A new pool of size one always has a free snapshot.
        let Some(snapshot) = SnapshotPool::default().capture(self, 1, &wants, run) else { return Ok(canvas) };
        let view = cfg.camera.unwrap_or_else(|| framing_camera(&snapshot, cfg.envs, cfg.size)).view(width, height);
        let look = ViewOptions { envs: cfg.envs, overlays: cfg.overlays, ..ViewOptions::default() };
        let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
        let mut renderer = SceneRenderer::new(cfg.threads.unwrap_or_else(cores).max(1));
        renderer.draw(&snapshot, &view, &look, &mut canvas).map_err(ScreenshotError::Draw)?;
        Ok(canvas)
    }
}

/// Returns a camera from which the shown environments fill the image, or the camera set by the program if all are
/// shown.
fn framing_camera(snapshot: &Snapshot, shown: EnvSelection, size: [usize; 2]) -> OrbitCamera {
    match shown {
        EnvSelection::All => OrbitCamera::overview(snapshot, size),
        EnvSelection::One(env) => OrbitCamera::overview(&snapshot.with_single_env(env), size),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::control::ViewerExt;
    use crate::sample::sample;
    use ndarray::array;

    /// The file shows the initial view of a window, and the simulation does not change.
    #[test]
    fn file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stage.png");
        let mut sim = sample(4).sim;
        sim.update(20);
        let state = |sim: &SimulationManager| {
            let (robot, cube) =
                (sim.robot(sim.entities().robot_id("arm").unwrap()), sim.entities().rigid_object_id("cube").unwrap());
            (sim.time(), sim.observers().steps(), robot.qpos(), robot.qvel(), sim.rigid_object(cube).pose())
        };
        let red = |image: &image::RgbaImage| image.pixels().filter(|p| p[0] > 100 && p[1] < 60 && p[2] < 60).count();
        let written = |sim: &mut SimulationManager| {
            sim.screenshot(&path).unwrap();
            image::load_from_memory(&std::fs::read(&path).unwrap()).unwrap().to_rgba8()
        };
        let before = state(&sim);
        let image = written(&mut sim);
        assert_eq!(state(&sim), before);
        let snapshot = sim.viewer(SnapshotRequest::default()).newest().unwrap();
        let (mut canvas, eye) = (Canvas::default(), OrbitCamera::overview(&snapshot, [960, 540]));
        SceneRenderer::new(1).draw(&snapshot, &eye.view(960, 540), &ViewOptions::default(), &mut canvas).unwrap();
        assert_eq!((image.dimensions(), image.as_raw().as_slice()), ((960, 540), canvas.bytes()));
        assert!(red(&image) > 100, "the cubes are red: {}", red(&image));
        // Control: without cubes, a different image replaces the file.
        let cube = sim.entities().rigid_object_id("cube").unwrap();
        sim.rigid_object_mut(cube).write_pose(&array![[0.0, 0.0, -50.0, 1.0, 0.0, 0.0, 0.0]], None).unwrap();
        assert_eq!(red(&written(&mut sim)), 0);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn choices() {
        let mut sim = sample(3).sim;
        let (size, envs) = ([64, 48], EnvSelection::One(1));
        let cfg = ScreenshotCfg { size, camera: None, envs, threads: Some(1), ..ScreenshotCfg::default() };
        let mut draw = |cfg: ScreenshotCfg| sim.render_image(&cfg);
        let canvas = draw(cfg).unwrap();
        assert_eq!(canvas.dimensions(), size);
        assert_eq!(canvas, draw(ScreenshotCfg { threads: Some(3), ..cfg }).unwrap());
        let camera = OrbitCamera::look_at([0.0, 0.0, 2.0], [0.0, 0.0, 0.0]);
        assert_ne!(canvas, draw(ScreenshotCfg { camera, ..cfg }).unwrap());
        let env = draw(ScreenshotCfg { envs: EnvSelection::One(3), ..cfg }).unwrap_err();
        assert!(matches!(env, ScreenshotError::Environment { env: 3, count: 3 }), "{env}");
        for size in [[0, 48], [64, View::MAX_SIDE + 1]] {
            let error = draw(ScreenshotCfg { size, ..cfg }).unwrap_err();
            assert!(matches!(error, ScreenshotError::Size { .. }), "{error}");
        }
    }

    /// A file that cannot be written is refused, and no temporary file remains.
    #[test]
    fn refusals() {
        let folder = tempfile::tempdir().unwrap();
        // A folder has this name: the image is written to a temporary file, which cannot replace the folder.
        std::fs::create_dir(folder.path().join("taken.png")).unwrap();
        std::fs::write(folder.path().join("taken.png/something"), "").unwrap();
        let mut sim = sample(1).sim;
        let rows = [
            ("a.jpg", "Extension", ""),
            ("a", "Extension", ""),
            ("a.png.part", "Extension", ""),
            ("no/such/a.png", "NoFolder", "no/such does not exist"),
            ("taken.png", "File", ""),
        ];
        let rows = rows.map(|(name, kind, part)| (name, sim.screenshot(folder.path().join(name)), kind, [part]));
        kinetoscope_testkit::error_tables::assert_errors(rows);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
