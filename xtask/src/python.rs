//! A Python with MuJoCo of the wheel's version, for what is compared with other programs: rivals of the benchmarks, and
//! MuJoCo's own renderer as a judge of our pictures; and another one, with readers of our recordings.

use crate::run::{Cmd, Outcome, Repo};
use crate::wheel;
use std::path::{Path, PathBuf};

/// Names the python to benchmarks and tests; without it they leave out what needs it, with a message.
pub(crate) const VARIABLE: &str = "KINETOSCOPE_PYTHON4";

/// Names the python to the tests of recordings; without it they leave out what needs it, with a message.
pub(crate) const READERS_VARIABLE: &str = "KINETOSCOPE_PYTHON_READERS";

/// Who reads our recordings.
const READERS: &[&str] = &[
    "numpy==2.4.6",
    "mcap==1.6.0",
    "mcap-ros2-support==0.6.0",
    "pillow==13.0.0",
    "av==18.1.0",
    "pyarrow==26.0.1",
    "h5py==3.16.0",
];

/// What MuJoCo's renderer draws through.
pub(crate) const OPENGL: Module = Module { name: "OpenGL", packages: &["PyOpenGL==3.1.10"] };

/// What to import, and what to install for it.
#[derive(Debug)]
pub(crate) struct Module {
    pub(crate) name: &'static str,
    pub(crate) packages: &'static [&'static str],
}

impl Module {
    /// Whether `python` has it, which is tried to bring about; says so where it cannot be had.
    pub(crate) fn install(&self, python: &Path) -> bool {
        let has = || {
            // Does not run the module: some talk, or compile, when they are imported.
            let check = format!("import importlib.util as u, sys; sys.exit(u.find_spec('{}') is None)", self.name);
            Cmd::new(python).args(["-c", &check]).quiet().succeeds()
        };
        let installed = has() || pip_install(python, self.packages).is_ok() && has();
        if !installed {
            eprintln!("note: {} could not be installed", self.packages.join(" "));
        }
        installed
    }
}

/// The python of a virtual environment below the target folder, made at the first call; `None`, with a note, where it
/// cannot be made.
pub(crate) fn with_mujoco(repo: &Repo) -> Option<PathBuf> {
    let venv = repo.target.join("bench-venv");
    let python = venv.join("bin/python");
    let is_ready = || {
        let check = format!("import mujoco; assert mujoco.__version__ == '{}'", wheel::PYTHON_VERSION);
        Cmd::new(&python).args(["-c", &check]).quiet().succeeds()
    };
    if is_ready() {
        return Some(python);
    }
    let made = Cmd::new("python3")
        .args(["-m", "venv", "--clear"])
        .arg(&venv)
        .run()
        .and_then(|()| pip_install(&python, &[&format!("mujoco=={}", wheel::PYTHON_VERSION)]));
    if made.is_ok() && is_ready() {
        return Some(python);
    }
    eprintln!("note: no python with mujoco {} could be made", wheel::PYTHON_VERSION);
    None
}

/// The python of another virtual environment below the target folder, with readers of recordings that nobody here wrote;
/// `None`, with a note, where it cannot be made.
pub(crate) fn with_readers(repo: &Repo) -> Option<PathBuf> {
    let venv = repo.target.join("readers-venv");
    let python = venv.join("bin/python");
    let is_ready =
        || Cmd::new(&python).args(["-c", "import numpy, mcap, mcap_ros2, PIL, av, pyarrow, h5py"]).quiet().succeeds();
    if is_ready() {
        return Some(python);
    }
    let made = Cmd::new("python3").args(["-m", "venv", "--clear"]).arg(&venv).run();
    if made.is_ok_and(|()| pip_install(&python, READERS).is_ok()) && is_ready() {
        return Some(python);
    }
    eprintln!("note: no python with {} could be made", READERS.join(" "));
    None
}

/// Wheels only: to build PyBullet takes a compiler and half an hour.
fn pip_install(python: &Path, packages: &[&str]) -> Outcome {
    Cmd::new(python)
        .args(["-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--quiet", "--only-binary=:all:"])
        .args(packages)
        .run()
}
