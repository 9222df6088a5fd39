//! A picture of the stage in one call, without a window or a screen.

use crate::control::Wants;
use crate::stage::{Canvas, Eye, Look, Overlays, Painter, Pool, Run, Shown, Snapshot};
use crate::whole_file;
use sensors::visibility::{RenderError, View};
use sim::SimulationManager;
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
    /// use sim::{SimulationManager, SimulationManagerCfg};
    /// use view::Screenshot;
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

    /// From where all environments are in the picture, as they are now.
    fn overview_eye(&mut self) -> Eye;

    /// The picture itself, four bytes per pixel.
    ///
    /// # Errors
    /// Sizes and environments that do not exist.
    fn picture_of_stage(&mut self, cfg: &ScreenshotCfg) -> Result<Canvas, ScreenshotError>;
}

impl Screenshot for SimulationManager {
    fn screenshot_with(&mut self, path: impl AsRef<Path>, cfg: &ScreenshotCfg) -> Result<(), ScreenshotError> {
        let path = path.as_ref();
        let end = whole_file::end_of(path);
        if end != "png" {
            return Err(ScreenshotError::Extension { path: path.into(), end });
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            return Err(ScreenshotError::NoFolder { path: path.into(), folder: folder.into() });
        }
        let canvas = self.picture_of_stage(cfg)?;
        let written = canvas.to_png().and_then(|bytes| whole_file::write(path, &bytes));
        written.map_err(|error| ScreenshotError::File { path: path.into(), error: Arc::new(error) })
    }

    fn overview_eye(&mut self) -> Eye {
        let snapshot = Pool::default().take(self, 1, &Wants::NOTHING, Run::default());
        snapshot.map_or_else(Eye::default, |snapshot| Eye::overview(&snapshot))
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
        let run = Run { steps: self.steps(), ..Run::default() };
        let mut canvas = Canvas::default();
        // A pool of one has one to give.
        let Some(snapshot) = Pool::default().take(self, 1, &wants, run) else { return Ok(canvas) };
        let view = cfg.eye.unwrap_or_else(|| everything(&snapshot, cfg.shown)).view(width, height);
        let look = Look { shown: cfg.shown, overlays: cfg.overlays, ..Look::default() };
        let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
        let mut painter = Painter::new(cfg.threads.unwrap_or_else(cores).max(1));
        painter.draw(&snapshot, &view, &look, &mut canvas).map_err(ScreenshotError::Draw)?;
        Ok(canvas)
    }
}

/// From where all that is shown is in the picture.
fn everything(snapshot: &Snapshot, shown: Shown) -> Eye {
    match shown {
        Shown::All => Eye::overview(snapshot),
        Shown::One(env) => {
            let envs = snapshot.envs.get(env).into_iter().cloned().collect();
            Eye::overview(&Snapshot { envs, ..Snapshot::default() })
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::control::Viewing;
    use crate::sample::sample;
    use ndarray::array;

    /// What a viewer's own painter draws of the newest snapshot.
    fn drawn(sim: &mut SimulationManager) -> Canvas {
        let snapshot = sim.viewer(Wants::default()).newest().unwrap();
        let (mut canvas, eye) = (Canvas::default(), Eye::overview(&snapshot));
        Painter::new(1).draw(&snapshot, &eye.view(960, 540), &Look::default(), &mut canvas).unwrap();
        canvas
    }

    fn read(path: &Path) -> image::RgbaImage {
        image::load_from_memory(&std::fs::read(path).unwrap()).unwrap().to_rgba8()
    }

    #[test]
    fn the_file_is_the_stage_as_a_window_first_shows_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stage.png");
        let mut sample = sample(4);
        sample.sim.update(20);
        let state = |sim: &SimulationManager| {
            let (robot, cube) = (sim.robot(sim.robot_id("arm").unwrap()), sim.rigid_object_id("cube").unwrap());
            (sim.time(), sim.steps(), robot.get_qpos(), robot.get_qvel(), sim.rigid_object(cube).get_pose())
        };
        let before = state(&sample.sim);
        sample.sim.screenshot(&path).unwrap();
        let image = read(&path);
        assert_eq!((image.dimensions(), image.as_raw().as_slice()), ((960, 540), drawn(&mut sample.sim).bytes()));
        assert_eq!(state(&sample.sim), before, "nothing of the simulation changes");
        // The cubes are red.
        let red = |image: &image::RgbaImage| image.pixels().filter(|p| p[0] > 100 && p[1] < 60 && p[2] < 60).count();
        assert!(red(&image) > 100, "{}", red(&image));
        // The control: what is moved is seen moved, and the file is replaced.
        let cube = sample.sim.rigid_object_id("cube").unwrap();
        let away = array![[0.0, 0.0, -50.0, 1.0, 0.0, 0.0, 0.0]];
        sample.sim.rigid_object_mut(cube).write_pose(&away, None).unwrap();
        sample.sim.screenshot(&path).unwrap();
        assert_eq!(red(&read(&path)), 0);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn one_environment_an_eye_and_a_size_are_chosen() {
        let mut sample = sample(3);
        let eye = Eye::looking([0.0, 0.0, 2.0], [0.0, 0.0, 0.0]);
        let shown = Shown::One(1);
        let cfg = ScreenshotCfg { size: [64, 48], eye: None, shown, threads: Some(1), ..ScreenshotCfg::default() };
        let canvas = sample.sim.picture_of_stage(&cfg).unwrap();
        assert_eq!(canvas.dimensions(), [64, 48]);
        let other = sample.sim.picture_of_stage(&ScreenshotCfg { threads: Some(3), ..cfg }).unwrap();
        assert_eq!(canvas, other);
        assert_ne!(canvas, sample.sim.picture_of_stage(&ScreenshotCfg { eye, ..cfg }).unwrap());
        let env = sample.sim.picture_of_stage(&ScreenshotCfg { shown: Shown::One(3), ..cfg }).unwrap_err();
        assert!(matches!(env, ScreenshotError::Environment { env: 3, count: 3 }), "{env}");
        for size in [[0, 48], [64, View::MAX_SIDE + 1]] {
            let error = sample.sim.picture_of_stage(&ScreenshotCfg { size, ..cfg }).unwrap_err();
            assert!(matches!(error, ScreenshotError::Size { .. }), "{error}");
        }
    }

    #[test]
    fn what_cannot_be_written_is_said_and_nothing_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let mut sim = sample(1).sim;
        for name in ["a.jpg", "a", "a.png.part"] {
            let error = sim.screenshot(folder.path().join(name)).unwrap_err();
            assert!(matches!(error, ScreenshotError::Extension { .. }), "{error}");
        }
        let error = sim.screenshot(folder.path().join("no/such/a.png")).unwrap_err();
        assert!(matches!(&error, ScreenshotError::NoFolder { folder, .. } if folder.ends_with("no/such")), "{error}");
        // A folder has the name: the picture is written beside it, and cannot take its place.
        std::fs::create_dir(folder.path().join("taken.png")).unwrap();
        std::fs::write(folder.path().join("taken.png/something"), "").unwrap();
        let error = sim.screenshot(folder.path().join("taken.png")).unwrap_err();
        assert!(matches!(error, ScreenshotError::File { .. }), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
