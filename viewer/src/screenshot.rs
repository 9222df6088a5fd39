//! A picture of the stage in one call, without a window or a screen.

use crate::control::Wants;
use crate::file_extension;
use crate::stage::{Canvas, Eye, Look, Overlays, Painter, Pool, Run, Shown, Snapshot};
use kinetoscope_render::{RenderError, View};
use kinetoscope_scene::AtomicFile;
use kinetoscope_sim::SimulationManager;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a picture of the stage shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenshotCfg {
    /// Pixels per row, rows.
    pub size: [usize; 2],
    /// From where; so that everything is in the picture, as windows begin, where `None`.
    pub eye: Option<Eye>,
    /// Which environments.
    pub shown: Shown,
    /// What is drawn over it.
    pub overlays: Overlays,
    /// Threads that draw; all of the machine where `None`. The picture is the same for any number.
    pub threads: Option<usize>,
}

impl Default for ScreenshotCfg {
    fn default() -> Self {
        Self { size: [960, 540], eye: None, shown: Shown::All, overlays: Overlays::default(), threads: None }
    }
}

/// There is no picture.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScreenshotError {
    /// The end of the name is of no format.
    #[error("{path}: pictures of the stage are not written as .{end}; give a name that ends in .png")]
    Extension {
        /// The file.
        path: PathBuf,
        /// The end of its name.
        end: String,
    },
    /// There is no such folder.
    #[error("{path}: there is no folder {folder} to write it to; make it first")]
    NoFolder {
        /// The file.
        path: PathBuf,
        /// The folder.
        folder: PathBuf,
    },
    /// The file cannot be written: the disk is full, the folder is read-only.
    #[error("{path}: {error}")]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        error: Arc<std::io::Error>,
    },
    /// A size that no picture has.
    #[error("a picture of {width} x {height} pixels: 1 to {most} would do for both")]
    Size {
        /// Pixels per row.
        width: usize,
        /// Rows.
        height: usize,
        /// The largest side.
        most: usize,
    },
    /// There is no such environment.
    #[error("there is no environment {env}; there are {count}, from 0")]
    Environment {
        /// The one that was asked for.
        env: usize,
        /// How many there are.
        count: usize,
    },
    /// It cannot be drawn.
    #[error("the stage cannot be drawn: {0}")]
    Draw(RenderError),
}

/// Simulations of which pictures can be taken.
pub trait Screenshot {
    /// Writes a picture of the stage as it is now to a PNG file: all environments in their grid, from where a window looks when it
    /// opens, 960 by 540 pixels. A file of that name is replaced, when the new one is whole. Nothing of the simulation changes.
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
    /// As [`screenshot_with`](Self::screenshot_with).
    fn screenshot(&mut self, path: impl AsRef<Path>) -> Result<(), ScreenshotError> {
        self.screenshot_with(path, &ScreenshotCfg::default())
    }

    /// As [`screenshot`](Self::screenshot), with more to choose.
    ///
    /// # Errors
    /// A name that does not end in `.png`, a folder that is missing or cannot be written to, a full disk; sizes and environments
    /// that do not exist. What was there before is there then.
    fn screenshot_with(&mut self, path: impl AsRef<Path>, cfg: &ScreenshotCfg) -> Result<(), ScreenshotError>;

    /// From where all environments fill an image of `size` pixels, as they are now.
    fn overview_eye(&mut self, size: [usize; 2]) -> Eye;

    /// The picture itself, four bytes per pixel.
    ///
    /// # Errors
    /// Sizes and environments that do not exist.
    fn picture_of_stage(&mut self, cfg: &ScreenshotCfg) -> Result<Canvas, ScreenshotError>;
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
        let canvas = self.picture_of_stage(cfg)?;
        let written = canvas.to_png().and_then(|bytes| AtomicFile::write(path, &bytes));
        written.map_err(|error| ScreenshotError::File { path: path.into(), error: Arc::new(error) })
    }

    fn overview_eye(&mut self, size: [usize; 2]) -> Eye {
        let snapshot = Pool::default().take(self, 1, &Wants::NOTHING, Run::default());
        snapshot.map_or_else(Eye::default, |snapshot| Eye::overview(&snapshot, size))
    }

    fn picture_of_stage(&mut self, cfg: &ScreenshotCfg) -> Result<Canvas, ScreenshotError> {
        let ([width, height], most) = (cfg.size, View::MAX_SIDE);
        if ![width, height].iter().all(|side| (1..=most).contains(side)) {
            return Err(ScreenshotError::Size { width, height, most });
        }
        let count = self.num_envs();
        if let Shown::One(env) = cfg.shown
            && env >= count
        {
            return Err(ScreenshotError::Environment { env, count });
        }
        let contacts = cfg.overlays.contacts.then_some(cfg.shown);
        let wants = Wants { contacts, markers: cfg.overlays.sensors, ..Wants::default() };
        let run = Run { steps: self.observers().steps(), ..Run::default() };
        let mut canvas = Canvas::default();
        // A pool of one has one to give.
        let Some(snapshot) = Pool::default().take(self, 1, &wants, run) else { return Ok(canvas) };
        let view = cfg.eye.unwrap_or_else(|| everything(&snapshot, cfg.shown, cfg.size)).view(width, height);
        let look = Look { shown: cfg.shown, overlays: cfg.overlays, ..Look::default() };
        let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
        let mut painter = Painter::new(cfg.threads.unwrap_or_else(cores).max(1));
        painter.draw(&snapshot, &view, &look, &mut canvas).map_err(ScreenshotError::Draw)?;
        Ok(canvas)
    }
}

/// From where all that is shown fills the image.
fn everything(snapshot: &Snapshot, shown: Shown, size: [usize; 2]) -> Eye {
    match shown {
        Shown::All => Eye::overview(snapshot, size),
        Shown::One(env) => Eye::overview(&snapshot.only(env), size),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::control::Viewing;
    use crate::sample::sample;
    use ndarray::array;

    /// The file is the stage as a window first shows it, and nothing of the simulation changes.
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
        let snapshot = sim.viewer(Wants::default()).newest().unwrap();
        let (mut canvas, eye) = (Canvas::default(), Eye::overview(&snapshot, [960, 540]));
        Painter::new(1).draw(&snapshot, &eye.view(960, 540), &Look::default(), &mut canvas).unwrap();
        assert_eq!((image.dimensions(), image.as_raw().as_slice()), ((960, 540), canvas.bytes()));
        assert!(red(&image) > 100, "the cubes are red: {}", red(&image));
        // The control: without cubes another image replaces the file.
        let cube = sim.entities().rigid_object_id("cube").unwrap();
        sim.rigid_object_mut(cube).write_pose(&array![[0.0, 0.0, -50.0, 1.0, 0.0, 0.0, 0.0]], None).unwrap();
        assert_eq!(red(&written(&mut sim)), 0);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn choices() {
        let mut sim = sample(3).sim;
        let (size, shown) = ([64, 48], Shown::One(1));
        let cfg = ScreenshotCfg { size, eye: None, shown, threads: Some(1), ..ScreenshotCfg::default() };
        let mut draw = |cfg: ScreenshotCfg| sim.picture_of_stage(&cfg);
        let canvas = draw(cfg).unwrap();
        assert_eq!(canvas.dimensions(), size);
        assert_eq!(canvas, draw(ScreenshotCfg { threads: Some(3), ..cfg }).unwrap());
        let eye = Eye::looking([0.0, 0.0, 2.0], [0.0, 0.0, 0.0]);
        assert_ne!(canvas, draw(ScreenshotCfg { eye, ..cfg }).unwrap());
        let env = draw(ScreenshotCfg { shown: Shown::One(3), ..cfg }).unwrap_err();
        assert!(matches!(env, ScreenshotError::Environment { env: 3, count: 3 }), "{env}");
        for size in [[0, 48], [64, View::MAX_SIDE + 1]] {
            let error = draw(ScreenshotCfg { size, ..cfg }).unwrap_err();
            assert!(matches!(error, ScreenshotError::Size { .. }), "{error}");
        }
    }

    /// A file that cannot be written is refused, and nothing is left.
    #[test]
    fn refusals() {
        let folder = tempfile::tempdir().unwrap();
        // A folder has the name: the image is written beside it, and cannot take its place.
        std::fs::create_dir(folder.path().join("taken.png")).unwrap();
        std::fs::write(folder.path().join("taken.png/something"), "").unwrap();
        let mut sim = sample(1).sim;
        let rows = [
            ("a.jpg", "Extension", ""),
            ("a", "Extension", ""),
            ("a.png.part", "Extension", ""),
            ("no/such/a.png", "NoFolder", "no/such to write it"),
            ("taken.png", "File", ""),
        ];
        let rows = rows.map(|(name, kind, part)| (name, sim.screenshot(folder.path().join(name)), kind, [part]));
        kinetoscope_testkit::refusal::assert_refused(rows);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
